"""Derivatives of many rows, built some hundreds of rows at a time: between the pieces it is asked whether the work is to end early."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ..stopping import check_stopping

PIECE = 500
"""Rows of one piece. Their derivatives take less than a second, whereas those of all rows of a fine mesh take many."""


def jacobian(rows: Any, z: Any) -> Any:
    """The Jacobian of rows (r,) with respect to z, sparse. Raises `Stopped` if the work is to end early."""
    if not _several(rows):
        return ca.jacobian(rows, z)
    found = [_Entries.of(ca.jacobian(rows[first:last], z[used]), first, used) for first, last, used in _pieces(rows, z)]
    return _joined(found, rows.numel(), z.numel())


def weighted_hessian(rows: Any, weights: Any, z: Any, more: Any) -> Any:
    """The upper triangle of the Hessian of `more` + weights'rows with respect to z, sparse. Raises `Stopped` as `jacobian` does."""
    if not _several(rows):
        return ca.triu(ca.hessian(more + ca.dot(weights, rows), z)[0])
    found = []
    for first, last, used in _pieces(rows, z):
        lagrangian = ca.dot(weights[first:last], rows[first:last])
        if not first:
            lagrangian, used = more + lagrangian, sorted({*used, *_columns(more, z)})
        found.append(_Entries.of(ca.triu(ca.hessian(lagrangian, z[used])[0]), used, used))
    return _joined(found, z.numel(), z.numel())


def _several(rows: Any) -> bool:
    """Whether rows are derived in pieces. Those that are not made of scalar operations are one piece, since each piece of them would have
    all operations."""
    return rows.numel() > PIECE and isinstance(rows, ca.SX)


def _pieces(rows: Any, z: Any) -> Iterator[tuple[int, int, list[int]]]:
    """The first row of each piece, that after its last, and the entries of z on which it depends: derivatives by all of z would take time
    in proportion to z for each piece."""
    by_row, count = ca.jacobian_sparsity(rows, z).T, rows.numel()
    starts, columns = np.array(by_row.colind()), np.array(by_row.row(), dtype=int)
    for first in range(0, count, PIECE):
        check_stopping()
        last = min(first + PIECE, count)
        yield first, last, np.unique(columns[starts[first] : starts[last]]).tolist()


def _columns(expression: Any, z: Any) -> list[int]:
    """The entries of z on which an expression depends."""
    return sorted({*ca.jacobian_sparsity(expression, z).get_triplet()[1]})


@dataclass(frozen=True, eq=False)
class _Entries:
    """Entries of a large matrix: their rows and columns, and their values as a column."""

    rows: np.ndarray
    columns: np.ndarray
    values: Any

    @classmethod
    def of(cls, part: Any, rows: int | list[int], columns: list[int]) -> _Entries:
        """Those of a part: its first row, or all its rows, and its columns in the large matrix."""
        i, j = (np.array(one, dtype=int) for one in part.sparsity().get_triplet())
        return cls(rows + i if isinstance(rows, int) else np.array(rows, dtype=int)[i], np.array(columns, dtype=int)[j], ca.vec(part.nz[:]))


def _joined(parts: list[_Entries], rows: int, columns: int) -> Any:
    """The matrix (rows, columns) of all entries; of those at one place the sum, in their order."""
    place = np.concatenate([part.columns * rows + part.rows for part in parts])
    values = ca.vertcat(*(part.values for part in parts))
    places, first, which = np.unique(place, return_index=True, return_inverse=True)
    sums = values[first.tolist()]
    again = np.setdiff1d(np.arange(len(place)), first)
    for k in again.tolist():
        sums[int(which[k])] += values[k]
    row, column = places % rows, places // rows
    return ca.SX(ca.Sparsity.triplet(rows, columns, row.tolist(), column.tolist()), sums)
