"""Derivatives of many rows, built some hundreds of rows at a time: between the pieces it is asked whether the work is to end early."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import casadi as ca

from ..stopping import check_stopping

PIECE = 500
"""Rows of one piece. Their derivatives take less than a second, whereas those of all rows of a fine mesh take many."""


def jacobian(rows: Any, z: Any) -> Any:
    """The Jacobian of rows (r,) with respect to z, sparse. Raises `Stopped` if the work is to end early."""
    return ca.vertcat(*(ca.jacobian(piece, z) for (piece,) in _pieces(rows)))


def weighted_hessian(rows: Any, weights: Any, z: Any, more: Any) -> Any:
    """The upper triangle of the Hessian of `more` + weights'rows with respect to z, sparse. Raises `Stopped` as `jacobian` does."""
    total = None
    for piece, of_piece in _pieces(rows, weights):
        lagrangian = ca.dot(of_piece, piece) if total is not None else more + ca.dot(of_piece, piece)
        part = ca.triu(ca.hessian(lagrangian, z)[0])
        total = part if total is None else total + part
    return total


def _pieces(*columns: Any) -> Iterator[tuple[Any, ...]]:
    """Columns of one length, a piece of each at a time. Those that are not made of scalar operations are one piece, since each piece of
    them would have all operations."""
    count = columns[0].numel()
    if count <= PIECE or not isinstance(columns[0], ca.SX):
        yield columns
        return
    for k in range(0, count, PIECE):
        check_stopping()
        yield tuple(column[k : min(k + PIECE, count)] for column in columns)
