"""Columns of points: one entry for each, read-only; and their decision vectors, which need not be of the same variables: each point may
have a mesh of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from problems.compiled import Variable


def frozen(array: Any) -> np.ndarray:
    """A read-only copy."""
    copy = np.array(array)
    copy.setflags(write=False)
    return copy


def by_first(objectives: np.ndarray) -> np.ndarray:
    """Rows sorted by the first objective, ties by the next ones; NaN last."""
    return np.lexsort(objectives.T[::-1])


def number(value: Any) -> float | None:
    """The value as a float; None for None and for NaN."""
    return None if value is None or np.isnan(value) else float(value)


def column(values: Any, n: int, name: str) -> Any:
    """The `values`, which must be n; n times None for None."""
    if values is None:
        return [None] * n
    if len(values) != n:
        raise ValueError(f"{name} has {len(values)} entries, F has {n} rows")
    return values


def shared(dicts: Sequence[Mapping[str, Any] | None]) -> tuple[dict[str, Any] | None, ...]:
    """The dicts, with equal ones as one object."""
    distinct: list[dict[str, Any]] = []
    found: list[dict[str, Any] | None] = []
    for given in dicts:
        known = next((one for one in distinct if one == given), None)
        if known is None and given is not None:
            known = dict(given)
            distinct.append(known)
        found.append(known)
    return tuple(found)


def padded(rows: Sequence[np.ndarray | None], like: tuple[int, ...]) -> np.ndarray:
    """Arrays of the same rank in one, NaN where they end; `like` is the least shape."""
    shapes = [like, *(row.shape for row in rows if row is not None)]
    padded = np.full((len(rows), *np.max(shapes, axis=0)), np.nan)
    for i, row in enumerate(rows):
        if row is not None:
            padded[i][tuple(slice(length) for length in row.shape)] = row
    return padded


@dataclass(frozen=True, eq=False)
class Decisions:
    """n decision vectors as one table, a column for each variable that any of them has."""

    variables: tuple[Variable, ...]  # in the order of the first point, then those that only later ones have
    values: np.ndarray  # (n, D): NaN where a point has no such variable
    places: tuple[np.ndarray, ...]  # the columns that a point's own vector consists of, in its order

    @classmethod
    def of(cls, rows: Sequence[Any], variables: Sequence[Variable | Sequence[Variable]]) -> Decisions:
        """From n vectors and their variables: one sequence for all of them, or one for each.

        Raises ValueError if a vector has not as many entries as variables.
        """
        common = tuple(v for v in variables if isinstance(v, Variable))
        each = [tuple(own) for own in variables if not isinstance(own, Variable)] or [common] * len(rows)
        columns: dict[Variable, int] = {}
        places = {own: np.array([columns.setdefault(v, len(columns)) for v in own], dtype=int) for own in dict.fromkeys([common, *each])}
        values = np.full((len(rows), len(columns)), np.nan)
        for i, (row, own) in enumerate(zip(rows, each, strict=True)):
            if len(row) != len(own):
                raise ValueError(f"decision {i} has {len(row)} entries, its variables are {len(own)}")
            values[i, places[own]] = row
        return cls.placed(tuple(columns), values, [places[own] for own in each])

    @classmethod
    def placed(cls, variables: tuple[Variable, ...], values: np.ndarray, places: Sequence[np.ndarray]) -> Decisions:
        """From the parts; the arrays are made read-only."""
        for array in (values, *places):
            array.setflags(write=False)
        return cls(variables, values, tuple(places))

    def row(self, i: int) -> np.ndarray:
        """The vector of point i, read-only."""
        row = self.values[i, self.places[i]]
        row.setflags(write=False)
        return row

    def variables_of(self, i: int) -> tuple[Variable, ...]:
        """What its entries are."""
        return tuple(self.variables[column] for column in self.places[i].tolist())

    def take(self, rows: Sequence[int] | np.ndarray) -> Decisions:
        """Some of the points, in the order given, without the variables that none of them has."""
        places = [self.places[i] for i in rows]
        used = np.zeros(len(self.variables), dtype=bool)
        for place in places or [np.arange(len(used))]:
            used[place] = True
        column = np.cumsum(used) - 1
        kept = tuple(v for v, keep in zip(self.variables, used.tolist(), strict=True) if keep)
        return self.placed(kept, self.values[np.asarray(rows, dtype=int)][:, used], [column[place] for place in places])
