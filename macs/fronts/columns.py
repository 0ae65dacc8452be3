"""What the arrays of a front's file are, checks of those that are read, and named things as arrays and back."""

from __future__ import annotations

import json
import re
import unicodedata
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from problems.compiled import Limit, Variable, kinds

from ..io.netcdf import COUNT, NUMBER, TEXT, FileArray, Group, Labelled, words
from ..io.text import document

KINDS = {NUMBER: "numbers", COUNT: "whole numbers", TEXT: "texts"}


def checked(table: Mapping[str, FileArray], group: Group) -> Labelled:
    """The arrays of a group, which are those of a table."""
    unknown = [name for name in group.arrays if name not in table]
    if unknown:
        raise ValueError(f"it has an array '{unknown[0]}', which is not known")
    for name, column in table.items():
        if name not in group.arrays and not column.optional:
            raise ValueError(f"'{name}' is missing from it")
        if name in group.arrays and group.arrays[name].dtype.kind != column.kind:
            raise ValueError(f"'{name}' has {KINDS[group.arrays[name].dtype.kind]}, not {KINDS[column.kind]}")
    return Labelled(group.arrays, table, group.attrs)


def legal_names(names: Iterable[str], kind: str, taken: Iterable[str]) -> dict[str, str]:
    """What arrays and groups are called that have names of the user's: these names, where netCDF allows them and they are not `taken`.

    Else, each character other than a letter, digit or one of ``_ . + -`` becomes ``_``, and `kind` and ``_`` are put before the name until
    it begins with a letter and is free.
    """
    free: dict[str, str] = {}
    used = set(taken)
    for name in names:
        legal = re.sub(r"[^\w.+-]", "_", unicodedata.normalize("NFC", name))
        while legal in used or not legal[:1].isalpha():
            legal = f"{kind}_{legal}"
        used.add(legal)
        free[name] = legal
    return free


def distinct(names: Sequence[Any], what: str) -> None:
    """Raise ValueError if there is one twice."""
    if len(set(names)) < len(names):
        raise ValueError(f"two {what} have the same name")


def variable_table(dimension: str, what: str, limits: bool = False) -> dict[str, FileArray]:
    """The arrays of variables or limits along a dimension. The unit of limits is optional: there are files from before limits had one."""
    along, units = (dimension,), f"see {dimension}_unit"
    table = {
        dimension: FileArray(along, TEXT, f"name of the {what}"),
        f"{dimension}_lower": FileArray(along, NUMBER, f"lower bound of the {what}", units),
        f"{dimension}_upper": FileArray(along, NUMBER, f"upper bound of the {what}", units),
        f"{dimension}_scale": FileArray(along, NUMBER, f"scale of the {what}", units),
        f"{dimension}_unit": FileArray(along, TEXT, f"unit of the {what}", optional=limits),
    }
    if not limits:
        table[f"{dimension}_period"] = FileArray(along, NUMBER, f"period of the {what}, NaN if it is not periodic", units)
        table[f"{dimension}_integer"] = FileArray(along, COUNT, f"1 if the {what} is a whole number, else 0", optional=True)
        choices = f"what the whole numbers from 0 of the {what} stand for, a JSON list; empty if they are numbers"
        table[f"{dimension}_choices"] = FileArray(along, TEXT, choices, optional=True)
    return table


def variable_columns(variables: Sequence[Variable | Limit], dimension: str, limits: bool = False) -> dict[str, np.ndarray]:
    """Variables or limits as the arrays of `variable_table`; of whole numbers only where there are any."""
    plain = limits or not kinds(variables)  # type: ignore[arg-type]

    def entry(v: Variable | Limit, word: str) -> Any:
        value = getattr(v, word or "name")
        return (document(value) if value else "") if word == "choices" else value

    return {
        array: column.of([entry(v, array.removeprefix(dimension).lstrip("_")) for v in variables])
        for array, column in variable_table(dimension, "", limits).items()
        if not (plain and column.optional and not limits)
    }


def read_variables(data: Labelled, dimension: str) -> tuple[Variable, ...]:
    """Variables from their `variable_columns`. Raises ValueError for bounds, a scale or a period that are none."""
    rows = zip(read_limits(data, dimension), data[f"{dimension}_period"].tolist(), strict=True)
    if not np.all(np.isnan(data[f"{dimension}_period"]) | (data[f"{dimension}_period"] > 0)):
        raise ValueError(f"'{dimension}_period' has a period that is not above 0")
    found = [Variable(v.name, v.lower, v.upper, v.unit, v.scale, None if np.isnan(period) else period) for v, period in rows]
    if f"{dimension}_integer" in data.arrays:
        whole = data[f"{dimension}_integer"].tolist()
        texts = data[f"{dimension}_choices"] if f"{dimension}_choices" in data.arrays else [""] * len(whole)
        labels = read_documents((text or "[]" for text in texts), f"{dimension}_choices", lambda value: isinstance(value, list))
        found = [replace(v, integer=bool(one), choices=tuple(some)) for v, one, some in zip(found, whole, labels, strict=True)]
        if wrong := [v.name for v in found if v.choices and v.upper - v.lower != len(v.choices) - 1]:
            raise ValueError(f"the {dimension} '{wrong[0]}' has another number of choices than bounds")
    return tuple(found)


def read_limits(data: Labelled, dimension: str) -> tuple[Limit, ...]:
    """Limits from their `variable_columns`. Raises ValueError for bounds or a scale that are none."""
    names = data[dimension].tolist()
    lower, upper, scale = (data[f"{dimension}_{key}"] for key in ("lower", "upper", "scale"))
    for wrong, why in ((~(lower <= upper), "bounds that are no interval"), (~(scale > 0), "a scale that is not above 0")):
        if wrong.any():
            raise ValueError(f"the {dimension} '{names[int(np.argmax(wrong))]}' has {why}")
    units = data[f"{dimension}_unit"].tolist() if f"{dimension}_unit" in data.arrays else [""] * len(names)
    return tuple(Limit(*row) for row in zip(names, lower.tolist(), upper.tolist(), scale.tolist(), units, strict=True))


def named_table(name: str, dimension: str, what: str, entry: str) -> dict[str, FileArray]:
    """The arrays of dicts of numbers: values, which entries and which dicts there are."""
    return {
        dimension: FileArray((dimension,), TEXT, f"name of the {entry}"),
        name: FileArray(("point", dimension), NUMBER, what),
        f"{name}_given": FileArray(("point", dimension), COUNT, f"1 where there is a number in {name}, else 0"),
        f"{name}_known": FileArray(("point",), COUNT, f"1 for points that have {name}, else 0"),
    }


def named_columns(rows: Sequence[Mapping[str, float] | None], name: str, dimension: str) -> dict[str, np.ndarray]:
    """Dicts of numbers as the arrays of `named_table`."""
    labels = list(dict.fromkeys(key for row in rows for key in row or {}))
    values = np.array([[(row or {}).get(label, np.nan) for label in labels] for row in rows], dtype=float).reshape(len(rows), len(labels))
    given = np.array([[label in (row or {}) for label in labels] for row in rows], dtype=np.int8).reshape(values.shape)
    known = np.array([row is not None for row in rows], dtype=np.int8)
    return {dimension: words(labels), name: values, f"{name}_given": given, f"{name}_known": known}


def read_named(data: Labelled, name: str, dimension: str) -> list[dict[str, float] | None]:
    """Dicts of numbers from their `named_columns`. Raises ValueError if a name is there twice."""
    labels = data[dimension].tolist()
    distinct(labels, f"entries of '{dimension}'")
    values, given, known = (data[key].tolist() for key in (name, f"{name}_given", f"{name}_known"))
    return [
        {label: v for label, v, there in zip(labels, row, mask, strict=True) if there} if k else None
        for row, mask, k in zip(values, given, known, strict=True)
    ]


def read_documents(texts: Iterable[str], what: str, fits: Callable[[Any], bool]) -> list[Any]:
    """Values of JSON texts, equal texts once. Raises ValueError if one is no JSON, or its value does not fit."""
    values: dict[str, Any] = {}
    found = []
    for text in texts:
        if text not in values:
            try:
                values[text] = json.loads(text)
            except (ValueError, RecursionError) as error:
                raise ValueError(f"'{what}' is no JSON: {error}") from error
            if not fits(values[text]):
                raise ValueError(f"'{what}' is not what it should be: {text[:60]}")
        found.append(values[text])
    return found


def read_attribute(attrs: Mapping[str, Any], name: str, kinds: type | tuple[type, ...]) -> Any:
    """An attribute of a kind."""
    if name not in attrs:
        raise ValueError(f"the attribute '{name}' is missing from it")
    if not isinstance(attrs[name], kinds):
        raise ValueError(f"the attribute '{name}' is of another kind than it should be")
    return attrs[name]


def read_document(attrs: Mapping[str, Any], name: str) -> dict[str, Any]:
    """An attribute that is a JSON object."""
    return read_documents([read_attribute(attrs, name, str)], name, lambda value: isinstance(value, dict))[0]


def padded(rows: Sequence[np.ndarray | None], like: tuple[int, ...]) -> np.ndarray:
    """Arrays of the same rank in one, NaN where they end; `like` is the least shape."""
    shapes = [like, *(row.shape for row in rows if row is not None)]
    padded = np.full((len(rows), *np.max(shapes, axis=0)), np.nan)
    for i, row in enumerate(rows):
        if row is not None:
            padded[i][tuple(slice(length) for length in row.shape)] = row
    return padded
