"""One point of a front as a view of a row of its columns."""

from __future__ import annotations

from os import PathLike
from typing import Any

import numpy as np

from problems.compiled import CompiledProblem, Objective, Variable
from problems.vector import CompiledVectorProblem
from transcription.trajectories.costates import Costates
from transcription.trajectories.simulate import Simulation, simulate
from transcription.trajectories.trajectory import Trajectory

from ..evaluation.blackbox import Reevaluation, reevaluation
from .provenance import ProblemSource


class Point:
    """One point of a front: a trajectory, or one row of variables of a vector problem or black box. It refers to the data of its front.

    Attributes
    ----------
    objectives : dict
        By name, in the user's units and senses.
    trajectory : Trajectory or None
    verified : bool or None
        Whether a simulation agrees with it; None: not simulated.

    Examples
    --------
    >>> from macs import sweep
    >>> from problems import load
    >>> from transcription import DFET
    >>> front = sweep(load("goddard"), DFET(6, 6, basis="bernstein"), points=3, starts=1)
    >>> point = front[2]
    >>> print(round(point.objectives["flight time"], 3), point.status, point.verified)
    250.0 converged True
    """

    __slots__ = ("_points", "index")

    def __init__(self, points: Any, index: int):
        self._points = points
        self.index = index

    def alone(self) -> Any:
        """`Points` of this point alone."""
        return self._points.take([self.index])

    def compiled(self) -> CompiledProblem:
        """The problem of the point, see `Points.compiled`."""
        return self._points.compiled()

    @property
    def ranges(self) -> np.ndarray:
        """Ranges (m,) of the objectives over all points of its front."""
        return np.ptp(self._points.F, axis=0)

    @property
    def goals(self) -> tuple[Objective, ...]:
        """The objectives as the user stated them."""
        return self._points.goals

    @property
    def objectives(self) -> dict[str, float]:
        """Objectives by name, in the user's units and senses."""
        return dict(zip(self._points.names, self._points.objectives[self.index].tolist(), strict=True))

    @property
    def F(self) -> np.ndarray:
        """Objectives (m,), all minimised."""
        return self._points.F[self.index]

    @property
    def violation(self) -> float:
        """Largest scaled residual of any constraint."""
        return float(self._points.violation[self.index])

    @property
    def violations(self) -> dict[str, float]:
        """Scaled residual by constraint; empty if none was recorded."""
        return dict(self._points.violations[self.index] or {})

    @property
    def status(self) -> str:
        """ "converged", "infeasible", "failed" or "timeout"."""
        return str(self._points.status[self.index])

    @property
    def verified(self) -> bool | None:
        """Whether a simulation agrees with this point within its own tolerances; None if it was not simulated."""
        return bool(self._points.verified[self.index]) if self._points.was_simulated[self.index] else None

    @property
    def tolerances(self) -> dict[str, float] | None:
        """By how much its simulated objectives may differ if it is verified, by name, in the user's units; None if it was not judged yet.

        They are part of the point, whatever front it belongs to; see `Front.verify`.
        """
        values = self._points.tolerances[self.index]
        return None if np.isnan(values).any() else dict(zip(self._points.names, values.tolist(), strict=True))

    @property
    def defect(self) -> float | None:
        """Largest difference between simulated states and those of the transcription, in spans of their bounds; None: not simulated."""
        return number(self._points.defect[self.index])

    @property
    def simulated(self) -> dict[str, float] | None:
        """Objectives by name as simulated, in the user's units and senses; None: not simulated."""
        if not self._points.was_simulated[self.index]:
            return None
        values = self._points.simulated_F[self.index] * self._points.signs
        return dict(zip(self._points.names, values.tolist(), strict=True))

    @property
    def simulated_violation(self) -> float | None:
        """Largest scaled residual of any constraint of the simulated trajectory; None: not simulated."""
        return number(self._points.simulated_violation[self.index])

    @property
    def decision(self) -> np.ndarray:
        """Decision vector, in the user's units; `variables` are its entries."""
        return self._points._decisions.row(self.index)

    @property
    def variables(self) -> tuple[Variable, ...]:
        """Variables of the decision vector, in its order."""
        return self._points._decisions.variables_of(self.index)

    @property
    def transcription(self) -> dict[str, Any] | None:
        """Transcription of this point, as `Transcription.to_dict` gives it; None for a black box."""
        return self._points.transcriptions[self.index]

    @property
    def note(self) -> str:
        """Remark on the point; usually empty."""
        return self._points.notes[self.index]

    @property
    def stats(self) -> dict[str, Any]:
        """The costs, the seed and what else its front records of the call that found it."""
        return dict(self._points.stats)

    @property
    def message(self) -> str:
        """What its front has to say as a whole, such as an optimum that one start alone has found; usually empty."""
        return str(self._points.message)

    @property
    def source(self) -> ProblemSource | None:
        """Identity of the problem; None for a black box."""
        return self._points.source

    @property
    def parameters(self) -> dict[str, Any]:
        """Static decision variables by name; for a black box or a vector problem, all its variables: floats, ints, or what was chosen."""
        if not self._points.dynamic:
            return {v.name: v.meant(value) for v, value in zip(self.variables, self.decision.tolist(), strict=True)}
        return {} if self.trajectory is None else dict(self.trajectory.parameters)

    @property
    def dynamic(self) -> bool:
        """Whether it is of a problem with trajectories."""
        return bool(self._points.dynamic)

    @property
    def trajectory(self) -> Trajectory | None:
        """The trajectory; None for a black box."""
        return self._points.trajectories[self.index]

    @property
    def optimality(self) -> float | None:
        """Scaled residual of the conditions of Pareto optimality; None if it was not computed, for example after Ctrl-C or a time limit."""
        return self._points.optimality[self.index]

    @property
    def gain(self) -> float | None:
        """What other controls would gain in all objectives together, to first order, by Pontryagin's minimum principle, in the units that
        `Front.verify` has: mostly ranges of the front. None where it has no `costates` of a method on elements, or no `tolerances`.

        A simulation does not see it: a point whose mesh has no edge at a switch of its controls simulates as it says, and is beaten by one
        that switches at the right time. Where states or path constraints are at their limits, and on singular arcs, it says nothing.
        """
        return number(self._points.gain[self.index])

    @property
    def costates(self) -> Costates | None:
        """Costates by phase and state, arrays at the nodes of the trajectory: `point.costates["ascent"]["vx"]`.

        They are multipliers of the point's own conditions of optimality, and belong to the sum of all objectives, each minimised, times
        its weight (`weights`). Where they jump, as at limits of states, they are those just after; at the end of a phase those just
        before. A costate is in units of that sum per unit of the state.

        None where there is no trajectory, where `optimality` was not computed, and where it or the violation exceeds 1e-3: then the
        multipliers are no costates.
        """
        return self._points.costates[self.index]

    @property
    def hamiltonian(self) -> dict[str, np.ndarray] | None:
        """The Hamiltonian by phase at the nodes of the trajectory, costates' rates + weighted integrands, in units of the weighted sum per
        unit of the phase's time; None where there are no `costates`.

        Where nothing in a phase depends on time it is constant there, and it is 0 if its end is free and no objective depends on that.
        """
        return None if self.costates is None else {name: phase.hamiltonian for name, phase in self.costates.items()}

    @property
    def weights(self) -> dict[str, float] | None:
        """The weights of the objectives in the sum to which `costates` belong, by name; None where there are none.

        Not negative, and of sum 1 in the objectives' own units: a single objective has weight 1. Maximised objectives enter with the
        opposite sign. Where a front of two is smooth, their ratio is its slope.
        """
        return None if self.costates is None else dict(zip(self._points.names, self.costates.weights.tolist(), strict=True))

    @property
    def excursions(self) -> dict[str, float] | None:
        """Excess, scaled, of controls, path constraints and states that leave their bounds *between* nodes, by name; None if unknown."""
        found = self._points.excursions[self.index]
        return None if found is None else dict(found)

    def simulate(self, rtol: float = 1e-9, atol: float = 1e-10, method: str = "DOP853") -> Simulation | Reevaluation:
        """Simulation of this point: its dynamics under its controls, by an integrator that is independent of the transcription. A point of
        a vector problem is evaluated again.

        Parameters
        ----------
        rtol, atol, method
            Of `scipy.integrate.solve_ivp`; `atol` is relative to the scales of the states.

        Returns
        -------
        Simulation
            `defect[phase][state]`, `max_defect`, `violation`, `violations`, `objectives`, `trajectory`. Of a vector problem, a
            `Reevaluation`, with the same names.

        Raises
        ------
        ValueError
            For a black box, a point without a trajectory, and a saved front whose problem cannot be found.
        """
        problem = self._points.stated()
        if isinstance(problem, CompiledVectorProblem):
            return reevaluation(problem, self.decision)
        if self.trajectory is None:
            raise ValueError(f"point {self.index} has no trajectory to simulate: its status is '{self.status}'")
        return simulate(problem, self.trajectory, rtol=rtol, atol=atol, method=method)

    def plot(self, figure: Any = None, *, costates: bool = False) -> np.ndarray:
        """Axes with the states, controls and path constraints over time, one for each of them. Without dynamics, axes with each variable
        along its front, and this point in it.

        `front[i].plot()[0].figure.savefig("point.png")` writes the picture to a file. The title says whether a point is not feasible, not
        verified or not simulated. Nodes of infeasible and unverified points are hollow.

        Parameters
        ----------
        figure : matplotlib Figure, optional
            Empty figure to draw into. Default: a new one.
        costates : bool
            Whether costates and the Hamiltonian are drawn below, if there are any.
        """
        from .pictures.flight_plot import draw_flight
        from .pictures.front_plot import draw_designs
        from .pictures.style import caption, hollow

        if not self._points.dynamic:
            return draw_designs(self._points, caption(self), figure, [self.index])
        if self.trajectory is None:
            raise ValueError("there is no trajectory to draw: the evaluation of the point failed")
        return draw_flight(self.trajectory, caption(self), figure, self.costates if costates else None, hollow=hollow(self))

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write the trajectory as a table for a spreadsheet, a row for each node, under a header that names units.

        Its columns are the phase, time, states, controls, path constraints, and the costates and the Hamiltonian if there are any. Without
        dynamics it is the row of the point in `Front.to_csv`.
        """
        from .spreadsheets import save_point_csv

        save_point_csv(self, path)

    @property
    def title(self) -> str:
        """Objectives in one line: "flight time 141.2 s, horizontal speed 2.900 km/s"."""
        return ", ".join(f"{goal.name} {text} {goal.unit}".rstrip() for goal, text in zip(self.goals, self.texts, strict=True))

    @property
    def texts(self) -> list[str]:
        """Objectives as text, with the digits that tables of its front have."""
        return self._points.texts(self.objectives.values())

    def _repr_html_(self) -> str:
        """For notebooks: a table of the objectives and a small picture."""
        from .pictures.flight_plot import point_html

        return point_html(self)

    def __repr__(self) -> str:
        return f"<Point {self.index}: {self.title}; violation {self.violation:.1e}, {self.status}>"


def number(value: Any) -> float | None:
    """The value as a float; None for None and for NaN."""
    return None if value is None or np.isnan(value) else float(value)
