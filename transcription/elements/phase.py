"""One phase on elements: its variables, its rows, its propagation and its trajectory."""

from __future__ import annotations

from abc import abstractmethod
from functools import cache, cached_property

import casadi as ca
import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem, Variable
from problems.problem import Problem

from ..assembly import Assembly
from ..base import NLP
from ..meshed import Meshed
from ..numerics.polynomials import gauss_legendre
from ..phases.layout import Layout
from ..phases.mesh import PhaseMesh
from ..phases.rows import EndSlots, Rows, Written
from ..phases.writer import PhaseWriter, unwrapped_law, wrapped_controls
from ..trajectories.trajectory import PhaseTrajectory, PiecewisePolynomial, unwrapped, wrapped
from .propagation import Propagation
from .tables import Tables


class ElementsPhase(PhaseWriter):
    """One phase on the N elements of its mesh, by the method that `Tables` describe.

    Slots: `X` (N, k, nx) coefficients of the states, `U` (N, q + 1, nu) of the controls, `B` (N + 1, nx) states at the ends of the
    elements, which are unknowns of their own, `E` (m,) places of the edges that move, relative to the phase.
    """

    affine = True

    def __init__(self, mesh: PhaseMesh, tables: Tables, phase: CompiledPhase, layout: Layout, ends: EndSlots) -> None:
        super().__init__(phase, layout, ends)
        self.mesh, self.tables = mesh, tables
        self.n = elements = mesh.elements
        prefix = f"{phase.name}."
        self.U = self._controls(prefix)
        moving = zip(mesh.moving, mesh.ranges().tolist(), strict=True)
        places = [Variable(f"{prefix}edge[{j}]", low, high, "", high - low) for j, (low, high) in moving]
        self.E = np.array([layout.add(place, free=True) for place in places], dtype=int)
        self._begin = np.array(mesh.edges)[list(mesh.moving)]
        self.X = layout.add_table(prefix, phase.states, elements, tables.coefficients)
        at_edges = [v.named(f"{v.name}[edge]") for v in phase.states]
        if {-1.0, 1.0} <= set(tables.nodes):
            # A polynomial meets the values imposed at the ends of a phase to its own error only. Where these are bounds of a state, its
            # coefficient there has no bound of its own: the error would be one-sided, and would hold edges and controls in place.
            layout.widen(self.X[0, 0, ends.initial < 0], self.X[-1, -1, ends.final < 0])
        self.interior = self.X.ravel()
        edges = layout.add_table(prefix, at_edges, 1, elements - 1)[0]
        self.B = np.vstack([ends.initial[None], edges, ends.final[None]])
        self.S = layout.add_table(prefix, self.sizes(range(len(phase.sized))), elements, len(tables.tau))
        self.magnitudes = self.S.ravel()

    def _controls(self, prefix: str) -> np.ndarray:
        """Slots (N, q + 1, nu) of the controls; where one is constant, all of an arc are the same."""
        shape, arcs, constant = (self.n, self.tables.control_order + 1), self.mesh.arcs, dict(self.mesh.constant)
        if not constant:
            return self.layout.add_table(prefix, self.phase.controls, *shape, free=True)
        one: dict[tuple[str, int], int] = {}

        def slot(v: Variable, j: int, k: int) -> int:
            arc = int(arcs[j])
            if arc not in constant.get(v.name, ()):
                return self.layout.add(v.named(f"{prefix}{v.name}[{j},{k}]"), free=True)
            if (v.name, arc) not in one:
                one[v.name, arc] = self.layout.add(v.named(f"{prefix}{v.name}[arc {arc}]"), free=True)
            return one[v.name, arc]

        return np.array([[[slot(v, j, k) for v in self.phase.controls] for k in range(shape[1])] for j in range(self.n)])

    @cached_property
    def _propagation(self) -> Propagation:
        # Only where something is propagated: gradient solves of few starts never need what takes seconds to write out.
        return Propagation(self.n, self.tables, self.phase)

    @property
    def compilable(self) -> bool:  # type: ignore[override]
        return self._propagation.quick

    def write(self, extended: ca.MX, rows: Rows) -> Written:
        phase, tables, pick = self.phase, self.tables, self.layout.pick
        X, B = pick(extended, self.X), pick(extended, self.B)
        left, right = B[:, :-1], B[:, 1:]
        place, share, s = self._inside(extended, tables.tau)
        rates, integrands, sizes = rows.at_points(
            rates_and_integrands(phase),
            self._combined(left, X, right, tables.inside),
            self._controls_at(extended, tables.tau),
            place,
            share,
            s,
        )
        first, last = tables.balance[:1], tables.balance[-1:]
        self.add_dynamics(
            rows,
            self._spread(X, tables.balance[1:-1])
            + self._spread(rates, tables.test)
            + self._spread(left, first)
            + self._spread(right, last),
        )

        def samples(function: ca.Function, chosen: list[int], tau: np.ndarray) -> ca.MX:
            """Values of some rows of a Function of the phase at places of each element."""
            if not chosen:
                return ca.MX(0, self.n * len(tau))
            states = self._combined(left, X, right, tables.at(tau))
            place, _, s = self._inside(extended, tau)
            (values,) = rows.at_points(at_place(function, chosen, phase), states, self._controls_at(extended, tau), place, s)
            return values

        paths: dict[int, ca.MX] = {}
        for equality, tau in ((False, tables.points), (True, tables.exact)):
            chosen = [k for k, limit in enumerate(phase.paths) if (limit.lower == limit.upper) is equality]
            paths |= zip(chosen, ca.vertsplit(samples(phase.path, chosen, tau)), strict=True)
        self.add_paths(rows, [paths[k] for k in range(len(phase.paths))])
        peaks = samples(phase.peak_parts, list(range(len(phase.peak_of))), tables.dense)
        ends = self._controls_at(extended, np.array([-1.0, 1.0]))
        totals = integrands @ ca.DM(np.tile(tables.weights, self.n))
        S = pick(extended, self.S)
        if phase.sized:
            totals = self._with_sizes(totals, S, (share, s), rows)
        return Written(ends[:, 0], ends[:, -1], totals, peaks, self.add_sizes(rows, sizes, S, range(len(phase.sized))))

    def _spread(self, values: ca.DM | ca.MX, matrix: np.ndarray) -> ca.MX:
        """Columns that stand side by side for each element, times the same matrix for each element."""
        return ca.MX(values) @ ca.kron(ca.DM.eye(self.n), ca.sparsify(ca.DM(matrix)))

    def _combined(self, left: ca.MX, X: ca.MX, right: ca.MX, matrix: np.ndarray) -> ca.MX:
        """[left X right] of each element, times the same matrix (k + 2, n) for each element."""
        return self._spread(left, matrix[:1]) + self._spread(X, matrix[1:-1]) + self._spread(right, matrix[-1:])

    def _inside(self, extended: ca.MX, tau: np.ndarray) -> tuple[ca.MX, ca.MX, ca.MX]:
        """Where points at `tau` of each element lie, and the length of their elements, both relative to the phase; and s."""
        places, s = self._places(extended) / self.n, self.layout.pick(extended, self.ends.statics)
        starts, shares = places[:, :-1], places[:, 1:] - places[:, :-1]
        place = self._spread(starts, np.ones((1, len(tau)))) + self._spread(shares, 0.5 * (1.0 + tau)[None])
        return place, self._spread(shares, np.ones((1, len(tau)))), ca.repmat(s, 1, self.n * len(tau))

    def _controls_at(self, extended: ca.MX, tau: np.ndarray) -> ca.MX:
        """Controls (nu, N k) at k places of each element."""
        basis, U = self.tables.control(tau).T, self.layout.pick(extended, self.U)
        if not any(v.period for v in self.phase.controls):
            return self._spread(U, basis)
        law = ca.MX.sym("U", len(self.phase.controls), self.tables.control_order + 1)
        values = wrapped_controls(unwrapped_law(law, self.phase) @ ca.DM(basis), self.phase)
        return ca.Function("controls", [law], [values]).map(self.n)(U)

    def _with_sizes(self, totals: ca.MX, S: ca.MX, lengths: tuple[ca.MX, ca.MX], rows: Rows) -> ca.MX:
        """The integrals, those of absolute values as sums of the variables S (sizes, n k)."""
        entries = ca.vertsplit(totals)
        (weighted,) = rows.at_points(times_half_length(self.phase, len(self.phase.sized)), S, *lengths)
        for row, one in zip(self.phase.sized, ca.vertsplit(weighted), strict=True):
            entries[row] = one @ ca.DM(np.tile(self.tables.weights, self.n))
        return ca.vertcat(*entries)

    def state_nodes(self) -> tuple[np.ndarray, np.ndarray]:
        return np.vstack([self.B[1:], self.X.reshape(-1, self.B.shape[1])]), self._state_places(self.mesh)

    def state_places(self, extended: np.ndarray) -> np.ndarray:
        return self._state_places(self.mesh.found_in(self._edges(extended)))

    def _state_places(self, mesh: PhaseMesh) -> np.ndarray:
        return np.concatenate([mesh.edges[1:], mesh.inside(self.tables.nodes).ravel()])

    def control_nodes(self) -> tuple[np.ndarray, np.ndarray]:
        share = self.mesh.inside(self.tables.control_nodes).ravel()
        return self.U.reshape(len(share), len(self.phase.controls)), share

    def propagate(self, extended: ca.MX, *, robust: bool) -> tuple[ca.MX, ca.MX, ca.MX]:
        initial = self.layout.pick(extended, self.ends.initial)
        right, X, residual = self._propagation.elements(robust)(initial, *self._inputs(extended))
        extended = self.layout.replaced(extended, np.concatenate([self.X.ravel(), self.B[1:].ravel()]), ca.veccat(X, right))
        return extended, right[:, -1], residual.T

    def sensitivity(self, extended: ca.MX, S: ca.MX, *, interior: bool) -> tuple[ca.MX, ca.MX]:
        n, nx, pick = self.n, len(self.phase.states), self.layout.pick
        left, X, inputs = pick(extended, self.B[:-1]), pick(extended, self.X), self._inputs(extended)
        right = self._propagated_right(extended, left[:, -1], inputs)
        blocks = ca.horzsplit(self._propagation.derivatives(interior)(X, right, left, *inputs), self._propagation.inputs)
        edges, inside = [S[(self.ends.initial % S.shape[0]).tolist(), :]], []
        for D, outer in zip(blocks, self._outer(extended), strict=True):
            out = D[:, :nx] @ edges[-1] + D[:, nx:] @ outer
            edges.append(out[:nx, :])
            inside.append(out[nx:, :])
        slots, values = [self.B[1:].ravel()], edges[1:]
        if interior:
            slots, values = [*slots, self.X.ravel()], [*values, *inside]
        return self.layout.replaced(S, np.concatenate(slots), ca.vertcat(*values)), edges[n]

    def _propagated_right(self, extended: ca.MX, left: ca.MX, inputs: tuple[ca.MX, ...]) -> ca.MX:
        """States (nx, N) at the right ends; the last one propagated where values are imposed on it and dynamics are evaluated there."""
        right = self.layout.pick(extended, self.B[1:])
        if not self.tables.needs_right or (self.ends.final >= 0).all():
            return right
        own = [part[:, -part.shape[1] // self.n :] for part in inputs]
        return ca.horzcat(right[:, :-1], self._propagation.step(False)(left, *own)[0])

    def _inputs(self, extended: ca.MX) -> tuple[ca.MX, ...]:
        """The other inputs of the elements, side by side: controls, starts, lengths, and s."""
        s = self.layout.pick(extended, self.ends.statics)
        mean, places = (s[1] - s[0]) / self.n, self._places(extended)
        starts, lengths = s[0] + mean * places[:, :-1], mean * (places[:, 1:] - places[:, :-1])
        return self.layout.pick(extended, self.U), starts, lengths, ca.repmat(s, 1, self.n)

    def _places(self, extended: ca.MX) -> ca.DM | ca.MX:
        """Places (1, N + 1) of the edges, in mean lengths of an element: see `PhaseMesh.places`."""
        places = ca.DM(self.mesh.places).T
        if not len(self.E):
            return places
        moved = extended[self.layout.index(self.E).tolist()] - ca.DM(self._begin)
        return places + self.n * (ca.sparsify(ca.DM(self.mesh.shares)) @ moved).T

    def _outer(self, extended: ca.MX) -> list[ca.DM | ca.MX]:
        """Derivatives (nu (q + 1) + 2 + len(s), d) of each element's controls, start, length and s by the free variables."""
        seeds, length = self.layout.seeds(), ca.diff(self.layout.pick(extended, self.ends.statics)[:2])
        statics, *controls = (seeds[(slots.ravel() % seeds.shape[0]).tolist(), :] for slots in (self.ends.statics, *self.U))
        mean, places = (statics[1, :] - statics[0, :]) / self.n, self._places(extended)
        starts = [statics[0, :] + mean * places[j] for j in range(self.n)]
        lengths = [mean * (places[j + 1] - places[j]) for j in range(self.n)]
        if len(self.E):
            moved = length * (ca.DM(self.mesh.shares) @ seeds[self.E.tolist(), :])
            starts = [start + moved[j, :] for j, start in enumerate(starts)]
            lengths = [one + moved[j + 1, :] - moved[j, :] for j, one in enumerate(lengths)]
        return [ca.vertcat(controls[j], starts[j], lengths[j], statics) for j in range(self.n)]

    def guess_controls(self, t0: float, tf: float) -> dict[int, float]:
        """Edges that move begin where the mesh has them."""
        edges = dict(zip(self.E.tolist(), self._begin.tolist(), strict=True))
        return edges | super().guess_controls(t0, tf)

    def interpolate(self, extended: np.ndarray, trajectory: PhaseTrajectory) -> None:
        """Edges that move are where they are in a trajectory of this mesh, else where the mesh has them."""
        phase, tables, t0, length = self.phase, self.tables, trajectory.t0, trajectory.tf - trajectory.t0
        mesh = self.mesh.found_in(trajectory.state.edges)
        # Between the ends of this mesh's elements, where a control may jump: Gauss-Legendre nodes never meet them.
        nodes = gauss_legendre(tables.control_order + 1)[0]
        states = trajectory.state(t0 + length * mesh.inside(tables.stages))
        controls = unwrapped(trajectory.control(t0 + length * mesh.inside(nodes)), phase.controls)
        at_edges = trajectory.state(t0 + length * np.array(mesh.edges[1:-1]))
        self.layout.write(extended, self.E, np.array(mesh.edges)[None, list(mesh.moving)])
        self.layout.write(extended, self.X, np.linalg.solve(tables.at_stages, states)[None])
        U = wrapped(np.linalg.solve(tables.control(nodes), controls), phase.controls)
        for name, arcs in self.mesh.constant:
            i = [v.name for v in phase.controls].index(name)
            for arc in arcs:
                # Not the mean: near a switch, a trajectory of a coarser mesh is on its way to the other bound.
                U[mesh.arcs == arc, :, i] = np.median(controls[mesh.arcs == arc, :, i])
        self.layout.write(extended, self.U, U[None])
        self.layout.write(extended, self.B[1:-1], at_edges[None])

    def _edges(self, extended: np.ndarray) -> np.ndarray:
        """Times (N + 1,) of the ends of elements."""
        (t0, tf), places = extended[self.ends.statics[:2]], self.mesh.places
        if len(self.E):
            places = places + self.n * self.mesh.shares @ (extended[self.E] - self._begin)
        return t0 + (tf - t0) * places / self.n

    def costates(self, extended: np.ndarray, multipliers: np.ndarray) -> PiecewisePolynomial | None:
        if self.tables.costates is None:
            return None
        of_rows = multipliers.reshape(self.n, self.tables.rows, -1)
        return PiecewisePolynomial(self._edges(extended), self.tables.costates @ of_rows, self.tables.costate_basis)

    def unpack(self, extended: np.ndarray) -> PhaseTrajectory:
        phase, tables, edges = self.phase, self.tables, self._edges(extended)
        control = PiecewisePolynomial(edges, unwrapped(extended[self.U], phase.controls), tables.control_basis)
        B = extended[self.B]
        closed = np.concatenate([B[:-1, None], tables.at_stages @ extended[self.X], B[1:, None]], axis=1)
        return self.trajectory(extended, tables.points[:-1], PiecewisePolynomial(edges, closed, tables.closed), control)


class ElementsMethod(Meshed):
    """A method that writes phases on elements, of any degree of the controls, by its own `tables`: what DFET and collocation share."""

    orders_controls = True
    moves_edges = True
    control_order: int | None

    @abstractmethod
    def tables(self, order: int, control_order: int) -> Tables:
        """The element with states and controls of these degrees."""

    def degree_of_controls(self, order: int, own: int | None = None) -> int:
        """The degree of controls on a mesh whose own one is `own`, where states have degree `order`."""
        return next((q for q in (own, self.control_order) if q is not None), self.most_control_order(order))

    def transcribe(self, problem: Problem | CompiledProblem) -> NLP:
        """Write `problem` as an NLP; see `Transcription.transcribe`."""
        compiled, tables = problem.compile(), cache(self.tables)
        self.check_phases(compiled)
        for phase in compiled.phases:
            need_derivatives(phase, type(self).__name__)

        def writer(phase: CompiledPhase, layout: Layout, ends: EndSlots) -> ElementsPhase:
            mesh = self.mesh_of(phase.name)
            return ElementsPhase(mesh, tables(mesh.order, self.degree_of_controls(mesh.order, mesh.control_order)), phase, layout, ends)

        return Assembly(compiled, writer).nlp(self)


def rates_and_integrands(phase: CompiledPhase) -> ca.Function:
    """(x, u, place, share, s) -> (rates and integrands times half of the element's length; sizes); place and share are the phase's."""
    x, u, place, share, s = _symbols(phase)
    half, along = 0.5 * share * (s[1] - s[0]), (x, u, s[0] + place * (s[1] - s[0]), s)
    values = [half * phase.dynamics(*along), half * phase.integrands(*along), phase.sizes(*along)]
    return ca.Function("inside", [x, u, place, share, s], values)


def at_place(function: ca.Function, chosen: list[int], phase: CompiledPhase) -> ca.Function:
    """(x, u, place, s) -> some rows of what a Function of a phase returns at this place, relative to the phase."""
    x, u, place, _, s = _symbols(phase)
    return ca.Function(function.name(), [x, u, place, s], [function(x, u, s[0] + place * (s[1] - s[0]), s)[chosen]])


def times_half_length(phase: CompiledPhase, size: int) -> ca.Function:
    """(values, share, s) -> values times half of the length of an element with this share of the phase."""
    values, (_, _, _, share, s) = ca.MX.sym("values", size), _symbols(phase)
    return ca.Function("weighted", [values, share, s], [0.5 * share * (s[1] - s[0]) * values])


def need_derivatives(phase: CompiledPhase, method: str) -> None:
    """Raise ValueError if the dynamics have no derivatives: implicit equations cannot be solved without."""
    try:
        phase.dynamics.jacobian()
    except RuntimeError:
        raise ValueError(
            f"{method}: phase '{phase.name}': the dynamics have no derivatives; give their Callback a Jacobian, "
            "or its option 'enable_fd': True"
        ) from None


def _symbols(phase: CompiledPhase) -> list[ca.MX]:
    """Symbols of x, u, place, share and s at one point."""
    sizes = {"x": len(phase.states), "u": len(phase.controls), "place": 1, "share": 1, "s": phase.dynamics.size1_in(3)}
    return [ca.MX.sym(name, size) for name, size in sizes.items()]
