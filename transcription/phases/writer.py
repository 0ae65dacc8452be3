"""The contract of a method: how it writes one phase. The rest of an NLP is the same for all methods (`assembly.py`)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np

from problems.compiled import CompiledPhase

from ..numerics.periodic import wrapped
from ..trajectories.limits import paths_and_peaks
from ..trajectories.trajectory import PhaseTrajectory, PiecewisePolynomial
from .adjoint import Adjoint, Ending, PhaseMultipliers, swept
from .guess import along, state_along
from .layout import Layout
from .pointwise import Pointwise
from .state_equations import StateEquations

DYNAMICS = "dynamics of"
"""How labels of the equations of states begin; where an imposed final value enters, rows bear the name of that."""
NEGLIGIBLE = 1e-8
"""Multipliers of limits that are smaller than this part of the costates are none."""


@dataclass(frozen=True, eq=False)
class Ends:
    """Slots of a phase's times, of its initial and final states (nx,), and of the parameters."""

    t0: int
    tf: int
    initial: np.ndarray
    final: np.ndarray
    parameters: np.ndarray

    @property
    def statics(self) -> np.ndarray:
        """Slots of s = [t0, tf, *parameters]."""
        return np.array([self.t0, self.tf, *self.parameters], dtype=int)


@dataclass
class Rows:
    """Rows of constraints as they come together.

    `points`, where it is a list, gets what is evaluated `at_points`; by default that is no more than a call.
    """

    points: list[Pointwise] | None = None
    expressions: list[ca.MX] = field(default_factory=list)
    lower: list[np.ndarray] = field(default_factory=list)
    upper: list[np.ndarray] = field(default_factory=list)
    scale: list[np.ndarray] = field(default_factory=list)
    labels: list[str] = field(default_factory=list)
    propagated: list[bool] = field(default_factory=list)
    dynamics: dict[str, slice] = field(default_factory=dict)
    """Where the rows of dynamics of each phase are."""
    samples: dict[tuple[str, str], list[slice]] = field(default_factory=dict)
    """Where the rows of each of its path constraints ("path"), peaks ("peak") and bounded hidden states ("state") are, by its name and
    that word."""

    def add(
        self, expression: ca.MX, lower: object, upper: object, scale: object, labels: str | Sequence[str], *, propagated: bool = False
    ) -> None:
        """A matrix of rows, taken column by column; limits, scale and label one for each or one for all.

        `propagated` rows are satisfied by propagation, where no final value is imposed.
        """
        count = expression.numel()
        self.expressions.append(ca.vec(expression))
        for target, value in ((self.lower, lower), (self.upper, upper), (self.scale, scale)):
            target.append(np.broadcast_to(np.asarray(value, dtype=float), count))
        self.propagated.append(propagated)
        self.labels.extend([labels] * count if isinstance(labels, str) else labels)

    def add_samples(
        self, phase: str, kind: str, expression: ca.MX, lower: object, upper: object, scale: object, label: str, *, propagated: bool = False
    ) -> None:
        """Rows that are samples of one quantity of a phase, so that their multipliers are found again; see `add` and `samples`."""
        self.samples.setdefault((phase, kind), []).append(slice(self.count, self.count + expression.numel()))
        self.add(expression, lower, upper, scale, label, propagated=propagated)

    def at_points(self, function: ca.Function, *inputs: ca.MX) -> list[ca.MX]:
        """The outputs of a Function of columns at k points, side by side: matrices (size of the output, k) of inputs (size, k)."""
        sizes = [function.numel_out(i) for i in range(function.n_out())]
        if not sum(sizes):
            return [ca.MX(0, inputs[0].shape[1])] * len(sizes)
        point = Pointwise.of(function, inputs)
        if self.points is not None:
            self.points.append(point)
        values = point.evaluated if self.points is None else point.values
        return ca.vertsplit(values, np.cumsum([0, *sizes]).tolist())

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.labels)

    @property
    def propagated_equations(self) -> ca.MX:
        """Scaled residuals (count, 1) of the equations that propagation satisfies."""
        chosen = [i for i, propagated in enumerate(self.propagated) if propagated and (self.lower[i] == self.upper[i]).all()]
        return ca.vertcat(ca.MX(0, 1), *(self.expressions[i] / self.scale[i] for i in chosen))

    @property
    def left(self) -> np.ndarray:
        """Indices of the rows that propagation does not satisfy."""
        return np.flatnonzero(np.repeat(~np.array(self.propagated, dtype=bool), [e.numel() for e in self.expressions]))


@dataclass(frozen=True, eq=False)
class Written:
    """Quantities of a phase for objectives and constraints: controls (nu,) at both ends, integrals (column), samples of peaks (peaks, k);
    and the least values of the variables at `PhaseWriter.magnitudes` (column)."""

    first_control: ca.MX
    last_control: ca.MX
    integrals: ca.MX
    peak_samples: ca.MX
    magnitudes: ca.MX = field(default_factory=lambda: ca.MX(0, 1))


class PhaseWriter(ABC):
    """One phase, written by one method: its variables, its rows, its propagation and its trajectory.

    An implementation puts its variables into the layout when it is made, and has the four abstract methods below. Propagation and its
    derivatives follow from the rows of dynamics, guess and interpolation from the nodes; a method that can do better overrides them.
    """

    interior: np.ndarray = np.empty(0, dtype=int)  # slots of the states and hidden quantities that `sensitivity` replaces only on demand
    # Slots of variables that stand for absolute values: without bounds, and as small as may be once the rest is known.
    magnitudes: np.ndarray = np.empty(0, dtype=int)
    compilable: bool = False  # whether fast propagation, and `sensitivity`, can be written in C
    wide: bool = False  # whether `propagate` takes several extended vectors side by side
    # About how many derivatives of rows by controls there are because states depend on all controls before them; 0 where it is sparse.
    dense: int = 0
    # Whether rows and quantities are affine in the variables and in what `Rows.at_points` returns, whose inputs are affine in the
    # variables, too; steps of periodic controls count as constant. Then derivatives are put together from those at the points.
    affine: bool = False

    def __init__(self, phase: CompiledPhase, layout: Layout, ends: Ends) -> None:
        self.phase, self.layout, self.ends = phase, layout, ends

    @abstractmethod
    def write(self, extended: ca.MX, rows: Rows) -> Written:
        """Add the rows of dynamics and path constraints of an extended symbol, hidden quantities and all.

        `add_dynamics` and `add_paths` do so with the labels and scales that all methods share.
        """

    @abstractmethod
    def state_nodes(self) -> tuple[np.ndarray, np.ndarray]:
        """Slots (k, nx) of the states that the rows of dynamics determine, the final ones among them, and where they lie (k,): 0 at t0, 1
        at tf."""

    @abstractmethod
    def control_nodes(self) -> tuple[np.ndarray, np.ndarray]:
        """Slots (k, nu) of the coefficients of the controls, in their order in time, and where they lie (k,): 0 at t0, 1 at tf."""

    @abstractmethod
    def unpack(self, extended: np.ndarray) -> PhaseTrajectory:
        """The phase's trajectory from one extended vector; `trajectory` completes what the method knows."""

    def state_places(self, extended: np.ndarray) -> np.ndarray:
        """Places (k,) of the states of `state_nodes` in one extended vector, in which edges of the mesh may have moved."""
        return self.state_nodes()[1]

    def costates(self, extended: np.ndarray, multipliers: np.ndarray) -> PiecewisePolynomial | None:
        """The costates of the phase on the elements of one extended vector, from the multipliers (k,) of its rows of dynamics; by default
        None: what these say between their places is not known."""
        return None

    def swept(self, extended: np.ndarray, multipliers: PhaseMultipliers) -> Adjoint:
        """The costates of the phase by the adjoint equation, integrated backward along one extended vector that is optimal.

        At tf they are the derivatives of the Lagrangian by the final states, as far as these belong to the phase's dynamics and integrals:
        whatever else the method or the problem makes of them follows tf. Limits of states, path constraints on states alone and peaks make
        them jump, at the nodes of the states in which these are written; what other path constraints do there is spread between the nodes.
        """
        dynamics, limits, mixed = (np.array(one).ravel() for one in self._by_states(extended, *self._columns(multipliers)))
        mine = multipliers.variables
        limits = limits + np.concatenate([mine, np.zeros(len(limits) - len(mine))])
        slots, places = self.state_nodes()[0], self.state_places(extended)
        inside = (slots != self.ends.final).any(axis=1)
        index = self.layout.index
        ending = Ending(
            final=-dynamics[index(self.ends.final)],
            initial=dynamics[index(self.ends.initial)],
            places=places[inside],
            jumps=limits[index(slots)].reshape(slots.shape)[inside],
            spread=mixed[index(slots)].reshape(slots.shape)[inside],
        )
        s = extended[index(self.ends.statics)]
        return swept(self.phase, self.unpack(extended), s, multipliers.integrals, ending)

    def limited(self, multipliers: PhaseMultipliers) -> bool:
        """Whether limits that make costates jump have a multiplier before tf that counts for something beside costates, both in the scales
        of what they belong to: limits of states, path constraints on states alone, and peaks."""
        phase, slots = self.phase, self.state_nodes()[0]
        scales = np.array([v.scale for v in phase.states])
        between = (slots >= 0) & (slots != self.ends.final)
        of_states = np.where(between, multipliers.variables[np.where(between, slots, 0)], 0.0) * scales
        jumping = zip(phase.paths, multipliers.paths, self._mixed, strict=True)
        of_paths = [limit.scale * one for limit, one, mixed in jumping if not mixed]
        least = NEGLIGIBLE * np.abs(multipliers.dynamics.reshape(-1, len(scales)) * scales).max(initial=0.0)
        return any(np.abs(one).max(initial=0.0) > least for one in (of_states, *of_paths, *multipliers.peaks))

    @cached_property
    def _mixed(self) -> list[bool]:
        """Which of the path constraints depend on controls: their multipliers are densities."""
        rows, _ = self.phase.path.jac_sparsity(0, 1).get_triplet()
        return [k in rows for k in range(len(self.phase.paths))]

    def _columns(self, multipliers: PhaseMultipliers) -> tuple[np.ndarray, ...]:
        """Multipliers as inputs of `_by_states`."""
        paths, peaks = (np.concatenate([np.empty(0), *several]) for several in (multipliers.paths, multipliers.peaks))
        mixed = np.concatenate([np.empty(0), *(np.full(len(one), of_u) for one, of_u in zip(multipliers.paths, self._mixed, strict=True))])
        return multipliers.dynamics, np.where(mixed, 0.0, paths), np.where(mixed, paths, 0.0), peaks, multipliers.integrals

    @cached_property
    def _by_states(self) -> ca.Function:
        """(extended vector, multipliers of dynamics, path constraints on states alone, others, peaks and integrals) -> derivatives by the
        extended vector of the Lagrangian's terms of dynamics and integrals, of those that make costates jump, and of the others."""
        extended, rows = ca.MX.sym("extended", self.layout.total), Rows()
        written = self.write(filled([self], extended), rows)
        g, name = ca.vertcat(*rows.expressions), self.phase.name
        paths = ca.vertcat(ca.MX(0, 1), *(g[one] for one in rows.samples.get((name, "path"), ())))
        columns = [g[rows.dynamics[name]], paths, paths, ca.vec(written.peak_samples.T), written.integrals]
        symbols = [ca.MX.sym(f"of_{k}", one.numel()) for k, one in enumerate(columns)]
        dynamics, of_states, mixed, of_peaks, integrals = (ca.dot(*one) for one in zip(columns, symbols, strict=True))
        outputs = [ca.densify(ca.gradient(one, extended)) for one in (dynamics + integrals, of_states + of_peaks, mixed)]
        return ca.Function("by_states", [extended, *symbols], outputs)

    def hidden(self, extended: ca.MX) -> tuple[np.ndarray, ca.MX]:
        """Slots (k,) of the phase's hidden quantities, and these as a column (k, 1): they follow from the variables. Most methods have
        none."""
        return np.empty(0, dtype=int), ca.MX(0, 1)

    def guess(self, extended: np.ndarray) -> None:
        """Fill in the states of extended vectors (k, ...), whose times, parameters, controls and initial states are set."""
        t0, tf = extended[:, self.ends.t0], extended[:, self.ends.tf]
        slots, share = self.state_nodes()
        for i, (state, final) in enumerate(zip(self.phase.states, self.phase.final, strict=True)):
            values = state_along(self.phase, i, extended[:, self.ends.initial[i]], t0, tf, share)
            self.layout.write(extended, slots[:, i], np.clip(values, state.lower, state.upper))
            last = self.ends.final[i : i + 1]
            self.layout.write(extended, last, np.clip(extended[:, last], *final))

    def guess_controls(self, t0: float, tf: float) -> dict[int, float]:
        """The user's guess of the controls, where there is one, by slot."""
        slots, share = self.control_nodes()
        found: dict[int, float] = {}
        for control, places in zip(self.phase.controls, slots.T, strict=True):
            if control.name in self.phase.guesses:
                values = along(self.phase.guesses[control.name], np.array([t0]), np.array([tf]), share)[0]
                found.update(zip(places.tolist(), np.clip(values, control.lower, control.upper), strict=True))
        return found

    def interpolate(self, extended: np.ndarray, trajectory: PhaseTrajectory) -> None:
        """Fill in the states between the ends, and the controls, of one extended vector (1, ...) from a trajectory of the phase.

        By default their values at the nodes. Bounds are seen to afterwards.
        """
        length = trajectory.tf - trajectory.t0
        slots, share = self.control_nodes()
        controls = trajectory.control(trajectory.t0 + length * share)
        self.layout.write(extended, slots, wrapped(controls, self.phase.controls)[None])
        slots, share = self.state_nodes()
        between = (slots != self.ends.final).any(axis=1)
        self.layout.write(extended, slots[between], trajectory.state(trajectory.t0 + length * share[between])[None])

    def propagate(self, extended: ca.MX, *, robust: bool) -> tuple[ca.MX, ca.MX, ca.MX]:
        """Propagation from the initial states. By default Newton's method on all rows of dynamics, from constant states."""
        return self._equations.propagate(extended, self.ends.initial)

    def sensitivity(self, extended: ca.MX, S: ca.MX, *, interior: bool) -> tuple[ca.MX, ca.MX]:
        """Derivatives of the states of an extended symbol, which are propagated, by the free variables. By default those of the implicit
        function that the rows of dynamics define."""
        return self._equations.sensitivity(extended, S)

    @cached_property
    def _equations(self) -> StateEquations:
        """The rows of dynamics as equations of the states; to be asked for once the layout is complete."""
        extended, rows = ca.MX.sym("extended", self.layout.total), Rows()
        self.write(extended, rows)
        return StateEquations(self.phase, self.layout, extended, rows.propagated_equations, self.state_nodes()[0], self.ends.final)

    def add_dynamics(self, rows: Rows, residual: ca.MX) -> None:
        """Add rows residual = 0 of a matrix (nx, k) in the order of time, which propagation satisfies.

        An imposed final value enters the last column, whose rows therefore bear its name.
        """
        states, k = self.phase.states, residual.shape[1]
        names = [f"{DYNAMICS} {self.phase.name}.{v.name}" for v in states]
        last = [
            f"final value of {self.phase.name}.{v.name}" if low == high else name
            for v, (low, high), name in zip(states, self.phase.final, names, strict=True)
        ]
        rows.dynamics[self.phase.name] = slice(rows.count, rows.count + len(states) * k)
        rows.add(residual, 0, 0, np.tile([v.scale for v in states], k), names * (k - 1) + last, propagated=True)

    def add_paths(self, rows: Rows, values: ca.MX | list[ca.MX]) -> None:
        """Add the path constraints, of which `values` (npath, k) are samples; or one row of samples for each, of any lengths."""
        for limit, samples in zip(self.phase.paths, ca.vertsplit(values) if isinstance(values, ca.MX) else values, strict=True):
            label = f"path '{limit.name}' of '{self.phase.name}'"
            rows.add_samples(self.phase.name, "path", samples, limit.lower, limit.upper, limit.scale, label)

    def add_sizes(self, rows: Rows, sizes: ca.MX, S: ca.MX, scales: Sequence[float]) -> None:
        """Add the rows that keep the variables S (n, k), of these scales (n,), from being less than the absolute values of sizes (n, k)."""
        for sign in (1.0, -1.0):
            of_all = np.tile(scales, sizes.shape[1])
            rows.add(sign * sizes - S, -np.inf, 0.0, of_all, f"absolute values in '{self.phase.name}'", propagated=True)

    def trajectory(
        self, extended: np.ndarray, tau: np.ndarray, state: PiecewisePolynomial, control: PiecewisePolynomial
    ) -> PhaseTrajectory:
        """The trajectory of an extended vector from its two polynomials, with nodes at `tau` (k,) in [-1, 1) of each element and at tf."""
        phase = self.phase
        time = np.append(state.times(tau).ravel(), state.edges[-1])
        states, controls = (np.vstack([*piece.on_elements(tau), piece.ends()[1][-1:]]) for piece in (state, control))
        controls = wrapped(controls, phase.controls)
        s = extended[self.layout.index(self.ends.statics)]
        return PhaseTrajectory(
            name=phase.name,
            time_unit=phase.time_unit,
            time=time,
            states=states,
            controls=controls,
            paths=paths_and_peaks(phase, states, controls, time, s)[0],
            state=state,
            control=control,
            state_variables=phase.states,
            control_variables=phase.controls,
            path_limits=phase.paths,
        )


def filled(writers: Sequence[PhaseWriter], extended: ca.MX) -> ca.MX:
    """An extended symbol with the hidden quantities of these phases, of all at once: a copy of the whole vector for each phase would cost
    the square of their number."""
    hidden = [writer.hidden(extended) for writer in writers]
    slots = np.concatenate([own for own, _ in hidden])
    return writers[0].layout.replaced(extended, slots, ca.vertcat(*(values for _, values in hidden))) if len(slots) else extended
