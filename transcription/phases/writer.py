"""The contract of a method: how it writes one phase. The rest of an NLP is the same for all methods (`assembly.py`)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from problems.compiled import CompiledPhase, Variable

from ..numerics.batched import expanded
from ..trajectories.limits import paths_and_peaks
from ..trajectories.trajectory import PhaseTrajectory, PiecewisePolynomial, wrapped
from .adjoint import Adjoint, Ending, PhaseMultipliers, swept
from .layout import Layout
from .rows import EndSlots, Rows, Written

DYNAMICS = "dynamics of"
"""How labels of the equations of states begin; where an imposed final value enters, rows bear the name of that."""


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

    def __init__(self, phase: CompiledPhase, layout: Layout, ends: EndSlots) -> None:
        self.phase, self.layout, self.ends = phase, layout, ends

    @abstractmethod
    def write(self, extended: ca.MX, rows: Rows) -> Written:
        """Add the rows of an extended symbol, hidden quantities and all, best by `add_dynamics` and `add_paths`."""

    @abstractmethod
    def state_nodes(self) -> tuple[np.ndarray, np.ndarray]:
        """Slots (k, nx) of the states that the dynamics determine, final ones included, and their places (k,) in [0, 1]."""

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
        """The costates on the elements of one extended vector from the multipliers (k,) of its dynamics; None: not known."""
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
        """Whether a limit that makes costates jump has a multiplier before tf that counts beside costates, both in scales."""
        phase, slots = self.phase, self.state_nodes()[0]
        scales = np.array([v.scale for v in phase.states])
        between = (slots >= 0) & (slots != self.ends.final)
        of_states = np.where(between, multipliers.variables[np.where(between, slots, 0)], 0.0) * scales
        jumping = zip(phase.paths, multipliers.paths, self._mixed, strict=True)
        of_paths = [limit.scale * one for limit, one, mixed in jumping if not mixed]
        least = 1e-8 * np.abs(multipliers.dynamics.reshape(-1, len(scales)) * scales).max(initial=0.0)
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
        """(extended vector, multipliers) -> its derivatives of the Lagrangian: dynamics and integrals, jumping terms, others."""
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
        """Slots (k,) of the hidden quantities, and these as a column (k, 1): they follow from the variables."""
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
        """Fill in inner states and controls of one extended vector (1, ...): by default a trajectory's values at the nodes."""
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
        """Derivatives of propagated states by the free variables; by default of the implicit function of the dynamics."""
        return self._equations.sensitivity(extended, S)

    @cached_property
    def _equations(self) -> StateEquations:
        """The rows of dynamics as equations of the states; to be asked for once the layout is complete."""
        extended, rows = ca.MX.sym("extended", self.layout.total), Rows()
        self.write(extended, rows)
        return StateEquations(self.phase, self.layout, extended, rows.propagated_equations, self.state_nodes()[0], self.ends.final)

    def add_dynamics(self, rows: Rows, residual: ca.MX) -> None:
        """Add rows residual (nx, k) = 0 in the order of time; those of the last column bear the name of an imposed end."""
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
            rows.add(samples, limit.lower, limit.upper, limit.scale, label, of=(self.phase.name, "path"))

    def sizes(self, chosen: Sequence[int]) -> list[Variable]:
        """The variables that stand for absolute values, and for roots, which are never negative."""
        phase = self.phase
        return [Variable(f"size[{k}]", 0.0 if phase.roots[k] else -np.inf, np.inf, "", phase.size_scales[k]) for k in chosen]

    def add_sizes(self, rows: Rows, sizes: ca.MX, S: ca.MX, chosen: Sequence[int]) -> ca.MX:
        """Add the rows that keep the variables S (n, k) from being less than the absolute values, or roots, of the `chosen` sizes (n, k);
        returns these (n k,)."""
        plain, roots = ([i for i, k in enumerate(chosen) if self.phase.roots[k] is root] for root in (False, True))
        scales, label, k = np.array(self.phase.size_scales)[list(chosen)], f"absolute values in '{self.phase.name}'", sizes.shape[1]
        of = self.phase.name, "size"
        for sign in (1.0, -1.0) if plain else ():
            rows.add(sign * sizes[plain, :] - S[plain, :], -np.inf, 0.0, np.tile(scales[plain], k), label, propagated=True, of=of)
        if roots:
            one = ca.MX.sym("S", len(roots))
            (squares,) = rows.at_points(ca.Function("squares", [one], [one * one]), S[roots, :])
            rows.add(sizes[roots, :] - squares, -np.inf, 0.0, np.tile(scales[roots] ** 2, k), label, propagated=True, of=of)
        least = [ca.sqrt(ca.fmax(row, 0.0)) if i in roots else ca.fabs(row) for i, row in enumerate(ca.vertsplit(sizes))]
        return ca.vec(ca.vertcat(*least)) if least else ca.MX(0, 1)

    def of_sizes(self, multipliers: PhaseMultipliers, chosen: Sequence[int], k: int) -> np.ndarray:
        """What a unit of each of the sizes (k, n) counts that `add_sizes` was given first."""
        roots, rows = np.array(self.phase.roots, dtype=bool)[list(chosen)], iter(multipliers.sizes)
        found = np.zeros((k, len(roots)))
        if not roots.all():
            found[:, ~roots] = (next(rows) - next(rows)).reshape(k, -1)
        if roots.any():
            found[:, roots] = next(rows).reshape(k, -1)
        return found

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
    """An extended symbol with the hidden quantities of all these phases, in one copy of the whole vector."""
    hidden = [writer.hidden(extended) for writer in writers]
    slots = np.concatenate([own for own, _ in hidden])
    return writers[0].layout.replaced(extended, slots, ca.vertcat(*(values for _, values in hidden))) if len(slots) else extended


class StateEquations:
    """G(y, e) = 0 for the scaled states y of one phase, where e is the rest of an extended vector. slots (k, nx), final (nx,)."""

    def __init__(
        self, phase: CompiledPhase, layout: Layout, extended: ca.MX, residual: ca.MX, slots: np.ndarray, final: np.ndarray
    ) -> None:
        if residual.numel() != slots.size:
            raise ValueError(f"phase '{phase.name}': {residual.numel()} rows of dynamics do not determine {slots.size} states")
        self._layout, self._slots, self._final = layout, slots.ravel(), final
        self._scales = ca.DM(np.tile([v.scale for v in phase.states], len(slots)))
        self._initial = np.tile(np.arange(len(phase.states)), len(slots))
        y = ca.MX.sym("y", slots.size)
        rows = ca.Function("rows", [extended], [residual])(layout.replaced(extended, self._slots, y * self._scales, constants=True))
        self._residual = expanded(ca.Function("equations", [y, extended], [ca.densify(rows)], ["x", "p"], ["g"]))
        options = {"error_on_fail": False, "max_iter": 100, "abstol": 1e-14, "abstolStep": 1e-14}
        self._newton = ca.rootfinder("newton", "fast_newton", self._residual, options)
        x, p = self._residual.mx_in()
        g = self._residual(x, p)
        self._jacobians = expanded(ca.Function("jacobians", [x, p], [ca.jacobian(g, x), ca.jacobian(g, p)]))
        index = layout.index(self._slots)
        self._rows_of_final = [int(np.flatnonzero(index == i)[0]) for i in layout.index(final)]

    def propagate(self, extended: ca.MX, initial: np.ndarray) -> tuple[ca.MX, ca.MX, ca.MX]:
        """`initial` (nx,) are the slots of the initial states, from which all others begin."""
        y = self._newton(extended[self._layout.index(initial)[self._initial].tolist()] / self._scales, extended)
        x = y * self._scales
        return self._layout.replaced(extended, self._slots, x), x[self._rows_of_final], self._residual(y, extended)

    def sensitivity(self, extended: ca.MX, S: ca.MX) -> tuple[ca.MX, ca.MX]:
        y = extended[self._layout.index(self._slots).tolist()] / self._scales
        if (self._final < 0).any():
            # An extended vector has the imposed values, not those that propagation gives.
            y = self._newton(y, extended)
        by_states, by_rest = self._jacobians(y, extended)
        of_states = ca.solve(by_states, -(by_rest @ S), "qr") * ca.repmat(self._scales, 1, S.shape[1])
        return self._layout.replaced(S, self._slots, of_states), of_states[self._rows_of_final, :]


def line(start: np.ndarray, end: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Straight lines from `start` (k,) to `end` (k,) at `share` (...) of the way; shape (k, ...)."""
    shape = (-1,) + (1,) * share.ndim
    return start.reshape(shape) + (end - start).reshape(shape) * share


def along(given: Any, t0: np.ndarray, tf: np.ndarray, share: np.ndarray) -> np.ndarray:
    """A user's guess where it is needed. given (times, values), t0, tf (k,), share (...) -> (k, ...)."""
    first, second = given if np.ndim(given) else (given, given)
    if np.ndim(first):
        return np.interp(line(t0, tf, share), first, second)
    return line(np.full(len(t0), float(first)), np.full(len(t0), float(second)), share)


def state_along(phase: CompiledPhase, i: int, start: np.ndarray, t0: np.ndarray, tf: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Values (k, ...) of state i, as guessed, or on lines from `start` (k,) to the middle of its final range; `share` as in `along`."""
    state, final = phase.states[i], phase.final[i]
    if state.name in phase.guesses:
        return along(phase.guesses[state.name], t0, tf, share)
    return line(start, start if final == (state.lower, state.upper) else np.full(len(start), 0.5 * sum(final)), share)


def unwrapped_law(U: ca.MX, phase: CompiledPhase) -> ca.MX:
    """Coefficients (nu, q + 1) of which those of periodic controls follow each other the short way round: see `trajectory.unwrapped`."""
    period, divisor, _ = _periods(phase)
    if not period.any():
        return U
    law = ca.horzsplit(U)
    for k in range(1, len(law)):
        step = law[k] - law[k - 1]
        law[k] = law[k - 1] + step - period * ca.floor(step / divisor + 0.5)
    return ca.horzcat(*law)


def wrapped_controls(controls: ca.MX, phase: CompiledPhase) -> ca.MX:
    """Controls (nu, k) of which the periodic ones are brought back into their bounds: see `trajectory.wrapped`."""
    period, divisor, lower = _periods(phase)
    if not period.any():
        return controls
    turns = [ca.floor((column - lower) / divisor) for column in ca.horzsplit(controls)]
    return controls - ca.repmat(ca.DM(period), 1, controls.shape[1]) * ca.horzcat(*turns)


def _periods(phase: CompiledPhase) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Periods of the controls (nu,), 0 where there is none; the same to divide by; lower bounds."""
    period = np.array([v.period or 0.0 for v in phase.controls])
    return period, np.where(period > 0, period, 1.0), np.array([v.lower for v in phase.controls])
