"""One point of a front, in the user's words."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from problems.compiled import Variable
    from transcription.trajectories.simulate import Simulation
    from transcription.trajectories.trajectory import Trajectory

    from .front import Front
    from .fronts.provenance import Source


class Point:
    """One point of a front: a trajectory, or one input of a black box. It lives as long as anyone holds it, and holds its front."""

    __slots__ = ("_front", "index")

    def __init__(self, front: Front, index: int):
        self._front = front
        self.index = index

    def alone(self) -> Front:
        """The front of this point alone."""
        return self._front._take([self.index])

    @property
    def objectives(self) -> dict[str, float]:
        """By name, in the user's units and senses."""
        return dict(zip(self._front.names, self._front.objectives[self.index].tolist(), strict=True))

    @property
    def F(self) -> np.ndarray:
        """Objectives (m,), all minimised."""
        return self._front.F[self.index]

    @property
    def violation(self) -> float:
        """Largest scaled residual of any constraint."""
        return float(self._front.violation[self.index])

    @property
    def violations(self) -> dict[str, float]:
        """Scaled residual by constraint; empty where none was recorded."""
        return dict(self._front._violations[self.index] or {})

    @property
    def status(self) -> str:
        """ "converged", "infeasible", "failed" or "timeout"."""
        return str(self._front.status[self.index])

    @property
    def decision(self) -> np.ndarray:
        """The decision vector, in the user's units; `variables` names its entries."""
        return self._front._decisions.row(self.index)

    @property
    def variables(self) -> tuple[Variable, ...]:
        """What the entries of the decision vector are."""
        return self._front._decisions.variables_of(self.index)

    @property
    def transcription(self) -> dict[str, Any] | None:
        """How the problem was written for this point, as `Transcription.to_dict` has it. None for a black box."""
        return self._front.transcriptions[self.index]

    @property
    def note(self) -> str:
        """What there is to say of the point; mostly nothing."""
        return self._front._notes[self.index]

    @property
    def source(self) -> Source | None:
        """Which problem the point is of. None for a black box."""
        return self._front.source

    @property
    def parameters(self) -> dict[str, float]:
        """Static decision variables by name. Of a black box, these are all there are."""
        if self._front.source is None:
            return dict(zip((v.name for v in self.variables), self.decision.tolist(), strict=True))
        return {} if self.trajectory is None else dict(self.trajectory.parameters)

    @property
    def trajectory(self) -> Trajectory | None:
        """The flight. None for a black box."""
        return self._front._trajectories[self.index]

    @property
    def optimality(self) -> float | None:
        """How far a gradient solver found the point from satisfying the conditions of Pareto optimality; None until one has looked, as
        after Ctrl-C or a time limit, when nobody waits for it."""
        return self._front._optimality[self.index]

    @property
    def excursions(self) -> dict[str, float] | None:
        """How far, scaled, a control, path constraint or state leaves its bounds *between* nodes, by name; None where unknown."""
        found = self._front._excursions[self.index]
        return None if found is None else dict(found)

    def simulate(self, rtol: float = 1e-9, atol: float = 1e-10, method: str = "DOP853") -> Simulation:
        """Integrate the dynamics under this point's own controls by an integrator that knows nothing of the transcription.

        Parameters
        ----------
        rtol, atol : float
            Tolerances of the integrator; `atol` is relative to the scales of the states.
        method : str
            Any of `scipy.integrate.solve_ivp`.

        Returns
        -------
        Simulation
            `defect[phase][state]`, `max_defect`, `violation`, `violations`, `objectives`, `trajectory`.

        Raises
        ------
        ValueError
            If there is nothing to simulate: a black box, or a saved front whose problem cannot be found.
        """
        problem = self._front.compiled()
        if self.trajectory is None:
            raise ValueError(f"point {self.index} has no trajectory to simulate: its status is '{self.status}'")
        from transcription.trajectories.simulate import simulate

        return simulate(problem, self.trajectory, rtol=rtol, atol=atol, method=method)

    def plot(self, figure: Any = None) -> np.ndarray:
        """Draw states, controls and path constraints over time; returns the array of Axes, one for each of them."""
        from .fronts.flight_plot import draw_point

        return draw_point(self, figure)

    def __repr__(self) -> str:
        values = ", ".join(
            f"{goal.name} {value:.6g}{f' {goal.unit}' if goal.unit else ''}"
            for goal, value in zip(self._front.goals, self.objectives.values(), strict=True)
        )
        return f"<Point: {values}; violation {self.violation:.1e}, {self.status}>"
