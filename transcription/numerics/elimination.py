"""Linear systems solved symbolically, once and for all: straight-line code that does only what the pattern of the matrix asks for."""

from __future__ import annotations

from typing import Any

import casadi as ca

Row = dict[int, Any]


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
