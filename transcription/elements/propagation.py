"""The initial value problem of a phase, element after element, and its derivatives.

On each element the equations give the states at its points, Y = left + h f(Y) A: an implicit Runge-Kutta step. Where that system is
small, five Newton steps are written out symbolically, eliminations included, which costs a few microseconds an element; elsewhere, and
where these five do not converge, a rootfinder iterates.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from problems.compiled import CompiledPhase
from problems.layers import calls_externals, mapped

from ..numerics.batched import chained, expanded
from ..phases.writer import unwrapped_law, wrapped_controls
from .tables import Tables

Row = dict[int, Any]
MOST_UNKNOWNS = 48
"""Of an element whose Newton steps are written out."""


class Propagation:
    """The elements of a phase as Functions; see the module."""

    def __init__(self, elements: int, tables: Tables, phase: CompiledPhase) -> None:
        self.n, self.tables, self.phase = elements, tables, phase
        self._equations = _equations(tables, phase, ca.MX)
        self._step: ca.Function | None = None
        # Only elements of few unknowns, and few instructions, have their Newton steps written out.
        few, external = len(phase.states) * len(tables.tau) <= MOST_UNKNOWNS, calls_externals(phase.dynamics)
        if few and (external or expanded(phase.dynamics).is_a("SXFunction")):
            written = self._equations if external else _equations(tables, phase, ca.SX)
            step = _written_out(written, tables)
            if step.n_instructions() <= 30_000:
                self._equations, self._step = written, step
        self.quick = self._step is not None and not external
        self.inputs = sum(symbol.numel() for symbol in self._equations.symbols[1:])

    def elements(self, robust: bool) -> ca.Function:
        """(initial, U, starts, h, s) -> (right ends (nx, N), coefficients (nx, N k), residuals (1, N)); inputs stand side by side."""
        return chained(self.step(robust), self.n)

    def step(self, robust: bool) -> ca.Function:
        """The same for one element."""
        if robust or self._step is None:
            return _iterated(_equations(self.tables, self.phase, ca.MX), self.tables, self.phase)
        return self._step

    def derivatives(self, interior: bool) -> ca.Function:
        """(X, right, left, U, starts, h, s) -> derivatives (nx, N `inputs`) of the right ends [and of X] by left, U, start, h and s."""
        return mapped(_gradient(self._equations, self.tables, self.phase, interior), self.n)


@dataclass(frozen=True, eq=False)
class _Equations:
    """One element, symbolically: inputs (Y as a column, left, U, start, h, s), the residual of Y, the rates at Y, the results, and the
    derivatives of the residual by Y."""

    symbols: tuple[Any, ...]
    residual: Any
    rates: Any
    right: Any
    X: Any
    by_states: Any


def _equations(tables: Tables, phase: CompiledPhase, symbol: Any) -> _Equations:
    """The element's equations in symbols of one of CasADi's kinds."""
    nx, nu, nq, parameters = len(phase.states), len(phase.controls), len(tables.tau), phase.dynamics.size1_in(3)
    y, left, U = symbol.sym("y", nx * nq), symbol.sym("left", nx), symbol.sym("U", nu, tables.control_order + 1)
    start, h, s = symbol.sym("start"), symbol.sym("h"), symbol.sym("s", parameters)
    controls = wrapped_controls(unwrapped_law(U, phase) @ ca.DM(tables.control(tables.tau)).T, phase)
    Y, scales = ca.reshape(y, nx, nq), ca.DM([v.scale for v in phase.states])
    times = [start + 0.5 * h * (1.0 + tau) for tau in tables.tau]
    external = calls_externals(phase.dynamics)
    if external:
        points = [Y, controls, ca.horzcat(*times), ca.repmat(s, 1, nq)]
        rates = mapped(phase.dynamics, nq).call(points, True, False)[0]
    else:
        rates = ca.horzcat(*(phase.dynamics(Y[:, i], controls[:, i], times[i], s) for i in range(nq)))
    implicit, recover = (ca.sparsify(ca.DM(matrix)) for matrix in (tables.implicit, tables.recover))
    residual = ca.vec(Y - ca.repmat(left, 1, nq) - h * (rates @ implicit)) / ca.repmat(scales, nq, 1)
    X = ca.repmat(left, 1, tables.coefficients) + h * (rates @ recover)
    right = left + 0.5 * h * (rates @ ca.DM(tables.weights))
    if external:
        # Written down: CasADi would go through all points for each column.
        slopes = mapped(by_states(phase.dynamics), nq).call(points, True, False)[0]
        blocks = ca.MX(ca.kron(ca.DM.eye(nq), ca.DM.ones(nx, nx)).sparsity(), ca.vec(slopes))
        of_residual = ca.mtimes(
            ca.diag(1.0 / ca.repmat(scales, nq, 1)), ca.DM.eye(nx * nq) - h * ca.mtimes(ca.kron(implicit.T, ca.DM.eye(nx)), blocks)
        )
    else:
        of_residual = ca.jacobian(residual, y)
    return _Equations((y, left, U, start, h, s), residual, rates, right, X, of_residual)


def by_states(dynamics: ca.Function) -> ca.Function:
    """(x, u, t, s) -> the derivatives (nx, nx) of the rates by the states, dense."""
    inputs = dynamics.mx_in()
    return ca.Function("by_states", inputs, [ca.densify(ca.jacobian(dynamics(*inputs), inputs[0]))])


def _written_out(element: _Equations, tables: Tables) -> ca.Function:
    """(left, U, start, h, s) -> (right, X, largest residual) by Newton steps from the states that the rates at the left end give."""
    y, left, *others = element.symbols
    inline = {"always_inline": isinstance(y, ca.MX)}
    whole = ca.Function("whole", list(element.symbols), [element.residual, element.rates, element.right, element.X], inline)
    jacobian = ca.Function("jacobian", list(element.symbols), [element.by_states], inline)
    solve: Any = elimination(jacobian.sparsity_out(0)) if isinstance(y, ca.MX) else eliminate
    nq, h = len(tables.tau), others[2]
    Y = ca.repmat(left, nq, 1)
    Y = Y + h * ca.vec(whole(Y, left, *others)[1] @ ca.DM(tables.implicit))
    for _ in range(5):
        by_y = jacobian(Y, left, *others)
        Y = Y - solve(ca.sparsify(by_y) if isinstance(by_y, ca.SX) else by_y, whole(Y, left, *others)[0])
    residual, _, right, X = whole(Y, left, *others)
    return ca.Function("step", [left, *others], [ca.densify(right), ca.densify(X), ca.mmax(ca.fabs(residual))], {"cse": True})


def _iterated(element: _Equations, tables: Tables, phase: CompiledPhase) -> ca.Function:
    """(left, U, start, h, s) -> (right, X, 0) by CasADi's Newton method, which does not give up early."""
    _, left, U, *others = element.symbols
    nx, nq = len(phase.states), len(tables.tau)
    scales = ca.repmat(ca.DM([v.scale for v in phase.states]), nq, 1)
    p = ca.MX.sym("p", nx + U.numel() + sum(symbol.numel() for symbol in others))
    parts = ca.vertsplit(p, np.cumsum([0, nx, U.numel(), *(symbol.numel() for symbol in others)]).tolist())
    parts[1] = ca.reshape(parts[1], *U.shape)
    whole = ca.Function("whole", list(element.symbols), [element.residual, element.right, element.X])
    x = ca.MX.sym("x", nx * nq)
    equations = expanded(ca.Function("equations", [x, p], [whole(x * scales, *parts)[0]], ["x", "p"], ["g"]))
    options = {"error_on_fail": False, "max_iter": 30, "abstol": 1e-14, "abstolStep": 1e-14}
    newton = ca.rootfinder("newton", "fast_newton", equations, options)
    root = newton(ca.repmat(left, nq, 1) / scales, ca.vertcat(left, ca.vec(U), *others)) * scales
    right, X = whole(root, left, U, *others)[1:]
    return ca.Function("step", [left, U, *others], [ca.densify(right), ca.densify(X), ca.MX(0)])


def _gradient(element: _Equations, tables: Tables, phase: CompiledPhase, interior: bool) -> ca.Function:
    """(X, right, left, U, start, h, s) -> derivatives of (right [, X]) by (left, U, start, h, s), where the equations hold."""
    y, *inputs = element.symbols
    along = ca.veccat(*inputs)
    results = ca.vertcat(element.right, ca.vec(element.X)) if interior else element.right
    of_states, by_inputs = element.by_states, ca.jacobian(element.residual, along)
    direct, through = ca.jacobian(results, along), ca.jacobian(results, y)
    symbolic = isinstance(y, ca.SX)

    def solve(matrix: Any, right: Any) -> Any:
        return eliminate(matrix, right) if symbolic else ca.solve(matrix, right, "qr")

    if results.numel() < along.numel():
        total = direct - solve(of_states.T, through.T).T @ by_inputs
    else:
        total = direct - through @ solve(of_states, by_inputs)
    gradient = ca.Function("by_states", [y, *inputs], [ca.densify(total)])
    X, right = type(y).sym("X", len(phase.states), tables.coefficients), type(y).sym("right", len(phase.states))
    Y = ca.horzcat(inputs[0], X, right) @ ca.sparsify(ca.DM(tables.inside))
    return ca.Function("gradient", [X, right, *inputs], [gradient(ca.vec(Y), *inputs)], {"cse": symbolic})


def elimination(sparsity: ca.Sparsity) -> ca.Function:
    """(matrix, right) -> their solution by `eliminate`, to be called in other graphs."""
    matrix: Any = ca.SX.sym("matrix", sparsity)
    right: Any = ca.SX.sym("right", sparsity.shape[0])
    return ca.Function("solve", [matrix, right], [ca.densify(eliminate(matrix, right))], {"cse": True})


def eliminate(matrix: ca.SX, right: ca.SX) -> ca.SX:
    """The solution of `matrix` x = `right` as an expression.

    Gaussian elimination with pivots on the diagonal, in the order that fills in least (Markowitz 1957). There is no pivoting for size, so
    the values are only good where the diagonal dominates or nearly does, as in a Newton step of a short element: the caller has to check
    the residual.
    """
    rows, sides = _rows(matrix), _rows(right)
    order = _forward(rows, sides)
    solution: list[Row] = [{} for _ in rows]
    for p in reversed(order):
        for j, factor in rows[p].items():
            if j != p:
                _subtract(sides[p], factor, solution[j])
        inverse = 1 / rows[p][p]
        solution[p] = {k: value * inverse for k, value in sides[p].items()}
    result = ca.SX(*right.shape)
    for i, row in enumerate(solution):
        for k, value in row.items():
            result[i, k] = value
    return result


def _forward(rows: list[Row], sides: list[Row]) -> list[int]:
    """Bring the rows to triangular form; returns the order of the pivots. Row p then has itself and the columns of later pivots."""
    left = set(range(len(rows)))
    order = []
    while left:
        below = {p: [i for i in left if i != p and p in rows[i]] for p in left}
        p = min(left, key=lambda p: ((len(rows[p]) - 1) * len(below[p]), p))
        left.discard(p)
        order.append(p)
        inverse = 1 / rows[p][p]
        pivot = {j: value for j, value in rows[p].items() if j != p}
        for i in below[p]:
            factor = rows[i].pop(p) * inverse
            _subtract(rows[i], factor, pivot)
            _subtract(sides[i], factor, sides[p])
    return order


def _subtract(row: Row, factor: ca.SX, other: Row) -> None:
    for j, value in other.items():
        row[j] = row[j] - factor * value if j in row else -factor * value


def _rows(matrix: ca.SX) -> list[Row]:
    rows: list[Row] = [{} for _ in range(matrix.shape[0])]
    for i, j, value in zip(*matrix.sparsity().get_triplet(), matrix.nonzeros(), strict=True):
        rows[i][j] = value
    return rows
