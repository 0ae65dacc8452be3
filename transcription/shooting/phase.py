"""One phase by shooting: its variables, its rows, its propagation, its trajectory and its costates."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from itertools import pairwise

import casadi as ca
import numpy as np

from problems.compiled import CompiledPhase

from ..numerics.batched import CHAIN, Batched, widened, work
from ..numerics.polynomials import lobatto_nodes
from ..phases.adjoint import Adjoint, PhaseMultipliers, slopes
from ..phases.layout import Layout
from ..phases.rows import EndSlots, Rows, Written
from ..phases.writer import PhaseWriter
from ..trajectories.trajectory import PhaseTrajectory, PiecewisePolynomial
from .control_law import ControlLaw
from .step import RungeKuttaStep, StepMesh

LONGEST_CHAIN = 3_000_000
"""Most operations of a chain of steps times variables that it depends on, for which its derivatives are written out."""


class ShootingPhase(PhaseWriter):
    """One phase on M intervals.

    Slots: `U` (values, nu) of the controls, `S` (N, stages, k) of absolute values and `F` (N, places, k) of those that depend on nothing
    that varies in time but controls, and, where the intervals are apart (multiple shooting), `B` (M + 1, nx) states at their ends, which
    are unknowns of their own. Hidden: `R` (shots, nx), where the states arrive from the left at the end of each shot; `Y` (M - 1, nx),
    states at the nodes that are no variables (single shooting); `Q` integrals; `W` (points, rows) samples of path constraints and peaks;
    `A` (N, stages, k), of which `S` are the absolute values.
    """

    def __init__(
        self, mesh: StepMesh, law: ControlLaw, step: RungeKuttaStep, phase: CompiledPhase, layout: Layout, ends: EndSlots, *, apart: bool
    ) -> None:
        super().__init__(phase, layout, ends)
        self.mesh, self.law, self.step, self.apart = mesh, law, step, apart
        nx, prefix = len(phase.states), f"{phase.name}."
        inner = len(mesh.ends) - 2
        self.U = layout.add_table(prefix, phase.controls, law.count, 1, free=True)[:, 0]
        at_nodes = [replace(v, name=f"{v.name}[node]") for v in phase.states]
        inside = layout.add_table(prefix, at_nodes, inner if apart else 0, 1)[:, 0]
        self.B = np.vstack([ends.initial[None], inside, ends.final[None]])
        self._shots = mesh.ends if apart else mesh.ends[[0, -1]]
        self.R = layout.add_hidden(len(self._shots) - 1, nx)
        self.Y = layout.add_hidden(0 if apart else inner, nx)
        self.Q = layout.add_hidden(phase.integrands.size1_out(0))
        points = mesh.steps * len(step.points) + (1.0 not in step.points)
        self.W = layout.add_hidden(points if step.rows else 0, step.rows)
        self.A = layout.add_hidden(mesh.steps, len(step.weights), len(step.sized))
        self.S = layout.add_table(prefix, self.sizes(step.sized), *self.A.shape[:2])
        # One place in each step where controls are constant, else one for each time of a stage.
        self._fixed = [k for k in range(len(phase.sized)) if k not in step.sized]
        self._places = {0.0: 1.0} if law.jumps else step.scheme.quadrature
        self.F = layout.add_table(prefix, self.sizes(self._fixed), mesh.steps, len(self._places))
        self.magnitudes = np.concatenate([self.S.ravel(), self.F.ravel()])
        self.interior = np.concatenate([part.ravel() for part in (self.B[1:-1], self.Y, self.W, self.A)])
        self.compilable, self.wide = step.symbolic, step.plain
        # In each shot, a row depends on half of the shot's controls in the mean.
        rows = self.R.size + self.Y.size + self.W.size + self.A.size
        self.dense = rows * int((self.U >= 0).sum()) // (2 * len(self.R))

    def hidden(self, extended: ca.MX) -> tuple[np.ndarray, ca.MX]:
        states, integrals, *seen = zip(*self._propagated_shots(extended), strict=True)
        return self._hidden(extended, ca.horzcat(*states), sum(integrals), *(ca.horzcat(*parts) for parts in seen))

    def write(self, extended: ca.MX, rows: Rows) -> Written:
        phase, pick = self.phase, self.layout.pick
        self.add_dynamics(rows, pick(extended, self.R) - pick(extended, self._arrivals))
        at_nodes = pick(extended, self.Y)
        for i, v in enumerate(phase.states if len(self.Y) else ()):
            rows.add(at_nodes[i, :], v.lower, v.upper, v.scale, f"bounds of {phase.name}.{v.name}", of=(phase.name, "state"))
        seen = pick(extended, self.W)
        self.add_paths(rows, seen[: len(phase.paths), :])
        first, last = self._inputs(extended, 0, 1)[0], self._inputs(extended, self.mesh.steps - 1)[0]
        integrals, least = self._with_sizes(extended, rows)
        ends = self.step.controls(first, 0.0), self.step.controls(last, 1.0)
        return Written(*ends, integrals, seen[len(phase.paths) :, :], least)

    def _with_sizes(self, extended: ca.MX, rows: Rows) -> tuple[ca.MX, ca.MX]:
        """The integrals, those of absolute values as sums of the variables S and F, and the least values of these."""
        pick, n, (C, _, h, s) = self.layout.pick, self.mesh.steps, self._inputs(extended)
        law, one, places = ca.MX.sym("C", C.shape[0], self.law.degree + 1), ca.MX.sym("s", s.shape[0]), list(self._places)
        values = [self.phase.sizes(0, self.step.controls(law, place), 0, one)[self._fixed, :] for place in places]
        fixed = ca.Function("fixed", [law, one], [ca.horzcat(*values)]).map(n)(C, s)
        entries, least = ca.vertsplit(pick(extended, self.Q)), []
        for chosen, slots, sizes, weights in (
            (self.step.sized, self.S, pick(extended, self.A), self.step.weights),
            (self._fixed, self.F, fixed, np.array(list(self._places.values()))),
        ):
            S = pick(extended, slots)
            least.append(self.add_sizes(rows, sizes, S, chosen))
            totals = S @ ca.vec(ca.DM(weights) @ h)
            for k, total in zip(chosen, ca.vertsplit(totals), strict=True):
                entries[self.phase.sized[k]] = total
        return ca.vertcat(*entries), ca.vertcat(*least)

    def state_nodes(self) -> tuple[np.ndarray, np.ndarray]:
        return self._arrivals, self.mesh.places[self._shots][1:]

    def control_nodes(self) -> tuple[np.ndarray, np.ndarray]:
        return self.U, self.law.places

    def propagate(self, extended: ca.MX, *, robust: bool) -> tuple[ca.MX, ca.MX, ca.MX]:
        """There is nothing to solve."""
        k, n = extended.shape[1], self.mesh.steps
        begun = self._before.map(k)(extended)
        if k == 1:
            return *self._after(extended, *self._chain(n)(*begun)), ca.MX(0, 1)
        step = self.step.forward
        results = widened(step, k).mapaccum("steps", n)(_by_step(begun[0], k, 1), *(_by_step(part, k, n) for part in begun[1:]))
        back = (_by_candidate(part, k, n, step.size_out(i)) for i, part in enumerate(results))
        return *self._after.map(k)(extended, *back), ca.MX(0, k)

    def sensitivity(self, extended: ca.MX, S: ca.MX, *, interior: bool) -> tuple[ca.MX, ca.MX]:
        nx, nq, n = len(self.phase.states), len(self.Q), self.mesh.steps
        inputs, initial = self._inputs(extended), self.layout.pick(extended, self.ends.initial)
        states = self._propagated(initial, *inputs)[0]
        before = ca.horzcat(initial, states[:, :-1])
        blocks = ca.horzsplit(self.step.gradient(samples=interior).map(n)(before, *inputs), self.step.inputs)
        ends, q, seen = [S[self.layout.index(self.ends.initial).tolist(), :]], ca.MX(nq, S.shape[1]), []
        for i, D in enumerate(blocks):
            out = D[:, :nx] @ ends[-1] + D[:, nx:] @ self._outer[i]
            ends.append(out[:nx, :])
            q += out[nx : nx + nq, :]
            seen.append(out[nx + nq :, :])
        arrivals = [ends[i] for i in self._shots[1:]]
        slots, values = [self._arrivals, self.R, self.Q], [*arrivals, *arrivals, q]
        if interior:
            first = self.step.rows * len(self.step.points)
            seen, sizes = ([one[part, :] for one in seen] for part in (slice(first), slice(first, None)))
            if len(self.W) > n * len(self.step.points):
                D = self.step.end_gradient(states[:, -1], *self._inputs(extended, n - 1))
                seen.append(D[:, :nx] @ ends[-1] + D[:, nx:] @ self._outer[n - 1])
            at_nodes = [ends[i] for i in self.mesh.ends[1:-1] if len(self.Y)]
            slots, values = [*slots, self.Y, self.W, self.A], [*values, *at_nodes, *seen, *sizes]
        return self.layout.replaced(S, np.concatenate([part.ravel() for part in slots]), ca.vertcat(*values)), ends[n]

    def unpack(self, extended: np.ndarray) -> PhaseTrajectory:
        phase, k = self.phase, self.law.degree + 1
        C, states = (values[0] for values in self._on_steps(extended[None]))
        s = extended[self.layout.index(self.ends.statics)]
        edges = s[0] + (s[1] - s[0]) * self.mesh.places
        control = PiecewisePolynomial(edges, C.reshape(self.mesh.steps, k, len(phase.controls)), "lobatto")
        table = states.reshape(self.mesh.steps, -1, len(phase.states))
        B = extended[self.layout.index(self.B)].reshape(self.B.shape)
        shots = self._shots
        table[shots[:-1], 0], table[shots[1:] - 1, -1] = B[:-1], B[1:]
        state = PiecewisePolynomial(edges, table, "lobatto")
        inside = 2.0 * np.array([place for place in self.step.points if place < 1.0]) - 1.0
        return self.trajectory(extended, inside, state, control)

    def swept(self, extended: np.ndarray, multipliers: PhaseMultipliers) -> Adjoint:
        """Costates by the adjoint of the steps themselves, exact whatever their length, and cubic inside of each."""
        phase, flown, nx, nq, n = self.phase, self.unpack(extended), len(self.phase.states), len(self.Q), self.mesh.steps
        rows, points, inside = self.step.rows, len(self.step.points), self.mesh.ends[1:-1]
        D, at_end = (np.array(one) for one in self._linearised(extended))
        # By the states before a step: the states after it, its integrals, and samples at its points, of which the first is its beginning.
        D = D.reshape(-1, n, self.step.inputs).swapaxes(0, 1)[:, :, :nx]
        after, integrals, samples, sizes = np.split(D, np.cumsum([nx, nq, points * rows]), axis=1)
        samples = samples.reshape(n, points, rows, nx)
        of_sizes = self.of_sizes(multipliers, self.step.sized, n * self.A.shape[1]).reshape(n, -1)
        weights = np.tile(multipliers.integrals, (n, 1))
        weights[:, [phase.sized[k] for k in self.step.sized]] = 0.0
        seen = np.array([*multipliers.paths, *multipliers.peaks]).reshape(self.W.shape[::-1]).T
        of_samples, of_end = seen[: n * points].reshape(n, points, rows), seen[n * points :].ravel()
        falls = np.zeros((n, nx))
        if self.apart:
            slots = self.B[1:-1]
            falls[inside] = np.where(slots >= 0, multipliers.variables[slots], 0.0)
        elif len(self.Y):
            falls[inside] = np.array(multipliers.states).T
        begin, end = np.empty_like(falls), np.empty_like(falls)
        p = multipliers.dynamics.reshape(-1, nx)[-1] + of_end @ at_end.reshape(-1, self.step.inputs)[:, :nx]
        for k in range(n - 1, -1, -1):
            end[k] = p
            of_inside = np.einsum("pr,prx->x", of_samples[k, 1:], samples[k, 1:])
            begin[k] = p @ after[k] + weights[k] @ integrals[k] + of_sizes[k] @ sizes[k] + of_inside
            p = begin[k] + falls[k] + of_samples[k, :1].ravel() @ samples[k, :1].reshape(-1, nx)
        s = extended[self.layout.index(self.ends.statics)]
        ends, densities = [], np.zeros((n, len(phase.sized)))
        densities[:, self.step.sized] = of_sizes.reshape(self.A.shape).sum(axis=1) / np.diff(flown.state.edges)[:, None]
        for tau, costates in ((-1.0, begin), (1.0, end)):
            x, u = (piece(np.array([tau]))[:, 0] for piece in (flown.state.on_elements, flown.controls_on_elements))
            by_x, own = slopes(phase, x, u, flown.state.times(np.array([tau]))[:, 0], s, np.hstack([weights, densities]))
            ends.append(-(np.einsum("kij,kj->ki", by_x, costates) + own))
        return Adjoint(_hermite(flown.state.edges, begin, end, *ends))

    @cached_property
    def _linearised(self) -> ca.Function:
        """Extended vector -> derivatives (results, N inputs) of all steps, and (rows, inputs) of samples at their end."""
        extended, n = ca.MX.sym("extended", self.layout.total), self.mesh.steps
        before, last, inputs = self._at_steps(extended)
        D, at_end = self.step.gradient(samples=True).map(n)(before, *inputs), ca.MX(0, self.step.inputs)
        if len(self.W) > n * len(self.step.points):
            at_end = self.step.end_gradient(last, *self._inputs(extended, n - 1))
        return ca.Function("linearised", [extended], [ca.densify(D), ca.densify(at_end)])

    @property
    def _arrivals(self) -> np.ndarray:
        """Slots of the states at the ends of the shots, as variables."""
        return self.B[1:] if self.apart else self.B[-1:]

    @cached_property
    def _on_steps(self) -> Batched:
        """Extended vectors -> coefficients of controls (N, degree + 1, nu) and states (N, order + 1, nx) on steps, both flat."""
        extended = ca.MX.sym("extended", self.layout.total)
        before, _, inputs = self._at_steps(extended)
        places = 0.5 * (1.0 + lobatto_nodes(self.step.scheme.order + 1))
        states = self.step.inside(places).map(self.mesh.steps)(before, *inputs)
        return Batched(ca.Function("unpacked", [extended], [ca.densify(inputs[0]), ca.densify(states)]), compiled=self.compilable)

    def _at_steps(self, extended: ca.MX) -> tuple[ca.MX, ca.MX, tuple[ca.MX, ...]]:
        """States (nx, N) before all steps, those after the last one, and the other inputs."""
        left, shots = self.layout.pick(extended, self.B[:-1]), [states for states, *_ in self._propagated_shots(extended)]
        before = ca.horzcat(*(part for j, states in enumerate(shots) for part in (left[:, j], states[:, :-1])))
        return before, shots[-1][:, -1], self._inputs(extended)

    def _inputs(self, extended: ca.MX, first: int = 0, last: int | None = None) -> tuple[ca.MX, ...]:
        """The other inputs of the steps, or of some of them, side by side: coefficients of the controls, starts, lengths, and s."""
        s = self.layout.pick(extended, self.ends.statics)
        places = self.mesh.places[first : None if last is None else last + 1]
        C = self.law.coefficients(self.layout.pick(extended, self.U), places, self.phase)
        length = s[1] - s[0]
        starts, lengths = s[0] + length * ca.DM(places[:-1]).T, length * ca.DM(np.diff(places)).T
        return C, starts, lengths, ca.repmat(s, 1, len(places) - 1)

    def _chain(self, n: int) -> ca.Function:
        """(states and integrals so far, inputs of n steps) -> (these after each step, samples)."""
        chain = self.step.forward.mapaccum("steps", n) if n > 1 else self.step.forward
        if work(chain) * min(len(self.layout.free), n * self.step.inputs) <= LONGEST_CHAIN:
            return chain
        # Its derivatives, written out, would take too much memory.
        symbols = chain.mx_in()
        return ca.Function(CHAIN, symbols, chain.call(symbols))

    def _propagated(self, initial: ca.MX, *inputs: ca.MX) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
        """States (nx, n) after each of n steps, integrals over all of them, samples (rows, n points), sizes."""
        nx = len(self.phase.states)
        y, samples, sizes = self._chain(inputs[1].shape[1])(self._begun(initial), *inputs)
        return y[:nx, :], y[nx:, -1], samples, sizes

    def _propagated_shots(self, extended: ca.MX) -> list[tuple[ca.MX, ca.MX, ca.MX, ca.MX]]:
        """The results of `_propagated` for each shot, from its own initial states."""
        k, left = self.law.degree + 1, self.layout.pick(extended, self.B[:-1])
        C, *others = self._inputs(extended)
        return [
            self._propagated(left[:, j], C[:, first * k : last * k], *(values[:, first:last] for values in others))
            for j, (first, last) in enumerate(pairwise(self._shots.tolist()))
        ]

    @cached_property
    def _before(self) -> ca.Function:
        """Extended vector -> inputs of the chain of all steps."""
        extended = ca.MX.sym("extended", self.layout.total)
        inputs = self._begun(self.layout.pick(extended, self.ends.initial)), *self._inputs(extended)
        return ca.Function("before", [extended], [ca.densify(part) for part in inputs])

    @cached_property
    def _after(self) -> ca.Function:
        """(extended vector, outputs of that chain) -> (the same with the states and hidden quantities, final states)."""
        nx, n, step = len(self.phase.states), self.mesh.steps, self.step.forward
        extended = ca.MX.sym("extended", self.layout.total)
        y, *seen = (ca.MX.sym(f"result{i}", step.size1_out(i), step.size2_out(i) * n) for i in range(step.n_out()))
        filled = self.layout.replaced(extended, *self._hidden(extended, y[:nx, :], y[nx:, -1], *seen))
        filled = self.layout.replaced(filled, self._arrivals, ca.vec(y[:nx, (self._shots[1:] - 1).tolist()]))
        return ca.Function("after", [extended, y, *seen], [ca.densify(filled), ca.densify(y[:nx, -1])])

    def _begun(self, initial: ca.MX) -> ca.MX:
        """States, and integrals of nothing yet."""
        return ca.vertcat(initial, ca.DM.zeros(len(self.Q), 1))

    def _hidden(self, extended: ca.MX, states: ca.MX, q: ca.MX, samples: ca.MX, sizes: ca.MX) -> tuple[np.ndarray, ca.MX]:
        """Slots and values of the hidden quantities of a propagation: states (nx, N) after each step, integrals, samples, sizes."""
        if len(self.W) > samples.shape[1]:
            samples = ca.horzcat(samples, self.step.at_end(states[:, -1], *self._inputs(extended, self.mesh.steps - 1)))
        at_nodes = states[:, (self.mesh.ends[1:-1] - 1).tolist()] if len(self.Y) else ca.MX(0, 1)
        right = states[:, (self._shots[1:] - 1).tolist()]
        slots = np.concatenate([part.ravel() for part in (self.R, self.Y, self.Q, self.W, self.A)])
        return slots, ca.veccat(right, at_nodes, q, samples, sizes)

    @cached_property
    def _outer(self) -> list[ca.DM]:
        """Derivatives of the coefficients of the controls, the start, the length and s of each step by the free variables: constants."""
        seeds, n = self.layout.seeds(), self.mesh.steps
        U = ca.MX.sym("U", len(self.phase.controls), self.law.count)
        C = ca.vec(self.law.coefficients(U, self.mesh.places, self.phase))
        by_values = ca.sparsify(ca.Function("slopes", [U], [ca.jacobian(C, ca.vec(U))])(0))
        controls = by_values @ seeds[self.layout.index(self.U).tolist(), :]
        statics = seeds[self.layout.index(self.ends.statics).tolist(), :]
        length, each = statics[1, :] - statics[0, :], C.numel() // n
        places, widths = self.mesh.places[:-1].tolist(), np.diff(self.mesh.places).tolist()
        return [
            ca.vertcat(controls[i * each : (i + 1) * each, :], statics[0, :] + length * places[i], length * widths[i], statics)
            for i in range(n)
        ]


def _hermite(edges: np.ndarray, begin: np.ndarray, end: np.ndarray, first: np.ndarray, last: np.ndarray) -> PiecewisePolynomial:
    """Hermite's cubic polynomials through values (N, nx) at the beginning and the end of each step with these slopes (N, nx) in time."""
    t, h = 0.5 * (1.0 + lobatto_nodes(4))[:, None], np.diff(edges)[:, None, None]
    begin, end, first, last = (one[:, None, :] for one in (begin, end, first, last))
    values = (1 + 2 * t) * (1 - t) ** 2 * begin + t**2 * (3 - 2 * t) * end + h * t * (1 - t) * ((1 - t) * first - t * last)
    return PiecewisePolynomial(edges, values, "lobatto")


def _by_step(values: ca.MX, k: int, n: int) -> ca.MX:
    """Values of k candidates, side by side, for n steps each: one row a candidate, step after step."""
    order = np.arange(values.numel()).reshape(k, n, -1).transpose(1, 2, 0).ravel()
    return ca.reshape(ca.vec(values)[order.tolist()], k, len(order) // k) if len(order) else ca.MX(k, 0)


def _by_candidate(values: ca.MX, k: int, n: int, size: tuple[int, int]) -> ca.MX:
    """The way back, for matrices of this size of each candidate and step."""
    order = np.arange(values.numel()).reshape(n, -1, k).transpose(2, 0, 1).ravel()
    return ca.reshape(ca.vec(values)[order.tolist()], size[0], size[1] * n * k) if len(order) else ca.MX(size[0], size[1] * n * k)
