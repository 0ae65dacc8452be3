"""Labelled arrays, and named things as columns of them and back: variables with their bounds, dicts of numbers, JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from problems.compiled import Limit, Variable

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, eq=False)
class Labelled:
    """Arrays with named dimensions, as a group of a netCDF file has them: what files need of an xarray.Dataset, which takes a second or two
    to import.

    Attributes
    ----------
    variables : name -> (names of dimensions, array)
        Labels of a dimension are the variable of its name.
    attrs : mapping
        Strings and integers.

    Raises
    ------
    ValueError
        If two arrays do not agree on how long a dimension is.
    """

    variables: Mapping[str, tuple[tuple[str, ...], np.ndarray]]
    attrs: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        lengths = self.sizes
        for name, (dimensions, values) in self.variables.items():
            if values.shape != (shape := tuple(lengths[dimension] for dimension in dimensions)):
                raise ValueError(f"'{name}' has the shape {values.shape}, its dimensions {', '.join(dimensions)} that of {shape}")

    @property
    def sizes(self) -> dict[str, int]:
        """How long the dimensions are."""
        return {
            dimension: length
            for dimensions, values in self.variables.values()
            for dimension, length in zip(dimensions, values.shape, strict=False)
        }

    def __getitem__(self, name: str) -> np.ndarray:
        return self.variables[name][1]

    def __contains__(self, name: str) -> bool:
        return name in self.variables

    def to_xarray(self) -> xarray.Dataset:
        """The same for people."""
        import xarray

        return xarray.Dataset({name: (list(dimensions), values) for name, (dimensions, values) in self.variables.items()}, attrs=self.attrs)


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


def read_variables(data: Labelled, dimension: str) -> tuple[Variable, ...]:
    """What `variable_columns` made; limits, which have no unit, come back as variables too."""
    names = [str(name) for name in data[dimension]]
    if not names:
        return ()
    n = len(names)
    columns = [data[f"{dimension}_{key}"].tolist() for key in ("lower", "upper")]
    units = [str(unit) for unit in data[f"{dimension}_unit"]] if f"{dimension}_unit" in data else [""] * n
    periods = data[f"{dimension}_period"].tolist() if f"{dimension}_period" in data else [np.nan] * n
    scales = data[f"{dimension}_scale"].tolist()
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


def read_named(root: Labelled, name: str, dimension: str) -> list[dict[str, float] | None]:
    """What `named_columns` made."""
    labels = [str(label) for label in root[dimension]]
    values, given, known = (root[key].tolist() for key in (name, f"{name}_given", f"{name}_known"))
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
