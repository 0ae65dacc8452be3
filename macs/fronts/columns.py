"""Columns of points: one entry for each, read-only."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np


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
