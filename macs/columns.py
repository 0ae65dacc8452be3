"""Named things as columns of a Dataset and back: variables with their bounds, dicts of numbers, JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from problems.compiled import Limit, Variable

if TYPE_CHECKING:
    import xarray


def variable_columns(variables: Sequence[Variable | Limit], dimension: str) -> dict[str, Any]:
    """Bounds, units and scales along a dimension whose labels are the names."""
    if not variables:
        return {dimension: ((dimension,), words([]))}
    columns: dict[str, Any] = {
        dimension: words([v.name for v in variables]),
        f"{dimension}_lower": np.array([v.lower for v in variables], dtype=float),
        f"{dimension}_upper": np.array([v.upper for v in variables], dtype=float),
        f"{dimension}_scale": np.array([v.scale for v in variables], dtype=float),
    }
    if isinstance(variables[0], Variable):
        columns[f"{dimension}_unit"] = words([getattr(v, "unit", "") for v in variables])
        periods = [getattr(v, "period", None) for v in variables]
        columns[f"{dimension}_period"] = np.array([np.nan if period is None else period for period in periods], dtype=float)
    return {key: ((dimension,), values) for key, values in columns.items()}


def read_variables(data: xarray.Dataset, dimension: str) -> tuple[Variable, ...]:
    """What `variable_columns` made; limits, which have no unit, come back as variables too."""
    names = [str(name) for name in data[dimension].values]
    if not names:
        return ()
    n = len(names)
    columns = [data[f"{dimension}_{key}"].values.tolist() for key in ("lower", "upper")]
    units = [str(unit) for unit in data[f"{dimension}_unit"].values] if f"{dimension}_unit" in data else [""] * n
    periods = data[f"{dimension}_period"].values.tolist() if f"{dimension}_period" in data else [np.nan] * n
    scales = data[f"{dimension}_scale"].values.tolist()
    return tuple(
        Variable(name, lower, upper, unit, scale, None if np.isnan(period) else period)
        for name, lower, upper, unit, scale, period in zip(names, *columns, units, scales, periods, strict=True)
    )


def named_columns(rows: Sequence[Mapping[str, float] | None], name: str, dimension: str) -> dict[str, Any]:
    """Dicts of numbers as an array; `<name>_given` (point, dimension) says which are there, `<name>_known` (point) which rows are."""
    labels = list(dict.fromkeys(key for row in rows for key in row or {}))
    values = np.array([[(row or {}).get(label, np.nan) for label in labels] for row in rows], dtype=float).reshape(len(rows), len(labels))
    given = np.array([[label in (row or {}) for label in labels] for row in rows], dtype=np.int8).reshape(values.shape)
    return {
        dimension: ((dimension,), words(labels)),
        name: (("point", dimension), values),
        f"{name}_given": (("point", dimension), given),
        f"{name}_known": (("point",), np.array([row is not None for row in rows], dtype=np.int8)),
    }


def read_named(root: xarray.Dataset, name: str, dimension: str) -> list[dict[str, float] | None]:
    """What `named_columns` made."""
    labels = [str(label) for label in root[dimension].values]
    values, given, known = (root[key].values.tolist() for key in (name, f"{name}_given", f"{name}_known"))
    return [
        {label: v for label, v, there in zip(labels, row, mask, strict=True) if there} if k else None
        for row, mask, k in zip(values, given, known, strict=True)
    ]


def words(names: Sequence[str]) -> np.ndarray:
    """Strings as an array, also none at all."""
    return np.array(list(names), dtype=str) if len(names) else np.array([], dtype="<U1")


def document(value: Any, strict: bool = False) -> str:
    """JSON, numpy's numbers and arrays included. What is not data is written as its `repr`; if strict, it raises TypeError."""

    def plain(item: Any) -> Any:
        if isinstance(item, np.ndarray):
            return item.tolist()
        if isinstance(item, np.generic):
            return item.item()
        if strict:
            raise TypeError(f"{type(item).__name__} is not data")
        return repr(item)

    return json.dumps(value, default=plain)
