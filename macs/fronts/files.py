"""A front as one netCDF-4 file, whole or not at all; and as a table of comma-separated values.

Root group: `dataset.root_dataset`. One group for each phase, by its name: `dataset.phase_dataset`. Group `_closest`, where there is one:
the least infeasible point of an empty front, laid out like a root. Nothing is pickled and nothing that is read is run.

A file is made in memory, written under a temporary name in the same folder, flushed to the disk and renamed: a full disk, a crash or a
second reader never meets half of one. It is read from memory too, so that no handle on it stays open.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..io.atomic import check_target, write_whole
from .dataset import FORMAT, VERSION, phase_dataset, phase_names, root_columns, root_dataset, trajectories
from .labelled import Labelled, document, words
from .points import Points

CLOSEST = "_closest"


PHASES = "phases"
"""Attribute of a root: the groups that hold its phases, in their order, as JSON."""


DIMENSION_ONLY = "This is a netCDF dimension but not a netCDF variable"
"""What netCDF-4 calls a dimension without labels."""


def save(front: Points, path: str | PathLike[str]) -> None:
    """Write a front; see `Front.save`."""
    check_target(path)
    write_whole(path, to_bytes(front))


def load(path: str | PathLike[str], problem: Any = None) -> Points:
    """Read a front; see `Front.load`."""
    try:
        content = Path(path).read_bytes()
    except FileNotFoundError:
        raise FileNotFoundError(f"there is no file '{path}'") from None
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror or error}") from error
    try:
        front = from_bytes(content)
    except Exception as error:
        # Whatever a damaged or foreign file provokes in HDF5 or in what follows, the user's file is what is wrong.
        raise ValueError(f"{path} does not hold a front that can be read: {_reason(content, error)}") from error
    if problem is not None:
        if front.source is None:
            raise ValueError(f"{path} holds a front of a black box: it has no problem")
        front._problem = front.source.check(problem, str(path))
    return front


def save_csv(front: Points, path: str | PathLike[str]) -> None:
    """Write objectives, violation, status and decisions; see `Front.to_csv`."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    columns = [(goal.name, goal.unit) for goal in front.goals]
    decisions = [(variable.name, variable.unit) for variable in front.variables]
    writer.writerow([f"{name} [{unit}]" if unit else name for name, unit in [*columns, ("violation", ""), ("status", ""), *decisions]])
    for point, objectives, place in zip(front, front.objectives.tolist(), front.places, strict=True):
        # Of a variable that the point, on a mesh of its own, does not have, the cell is empty.
        cells = [""] * len(front.variables)
        for column, value in zip(place.tolist(), point.decision.tolist(), strict=True):
            cells[column] = repr(value)
        writer.writerow([*map(repr, objectives), repr(point.violation), point.status, *cells])
    check_target(path)
    write_whole(path, text.getvalue().encode())


def to_bytes(front: Points) -> bytes:
    """The content of a front's file."""
    import h5netcdf

    buffer = io.BytesIO()
    with h5netcdf.File(buffer, "w") as file:
        for group, data in _datasets(front):
            _write_group(file if not group else file.create_group(group), data)
    return buffer.getvalue()


def from_bytes(content: bytes) -> Points:
    """The front in a file's content. Raises whatever comes if it is none."""
    import h5py

    with h5py.File(io.BytesIO(content), "r") as file:
        if _text(file.attrs.get("format")) != FORMAT:
            raise ValueError("it is a netCDF file of something else")
        version = int(np.ravel(file.attrs["format_version"])[0])
        if version != VERSION:
            older = "update MACS" if version > VERSION else "an earlier MACS wrote it"
            raise ValueError(f"its format is version {version}, this MACS reads version {VERSION}: {older}")
        return _read_front(file)


def _datasets(front: Points, group: str = "") -> Iterator[tuple[str, Labelled]]:
    """A front's groups by name, its root first."""
    root = root_dataset(front)
    groups = _group_names(phase_names(front), {CLOSEST, *root.variables, *root.sizes})
    root.attrs[PHASES] = document(groups)
    root.attrs["has_closest"] = int(front._closest is not None)
    prefix = f"{group}/" if group else ""
    yield group, root
    for name, place in groups.items():
        yield prefix + place, phase_dataset(front, name)
    if front._closest is not None:
        yield from _datasets(front._closest.alone(), prefix + CLOSEST)


def _group_names(phases: list[str], taken: set[str]) -> dict[str, str]:
    """A group for each phase: its own name, unless HDF5 could not hold a group of that name there."""
    groups: dict[str, str] = {}
    for phase in phases:
        place = phase.replace("/", "_").replace("\0", "_")
        while not place.strip(". ") or place in taken:
            place = f"phase_{place}"
        taken.add(place)
        groups[phase] = place
    return groups


def _write_group(group: Any, data: Labelled) -> None:
    """One group, as it is: no fill values, no packing, no time decoding."""
    import h5py

    group.dimensions = data.sizes
    for name, (dimensions, values) in data.variables.items():
        if values.dtype.kind in "UO":
            group.create_variable(name, dimensions, dtype=h5py.string_dtype(), data=values.astype(object))
        else:
            group.create_variable(name, dimensions, data=values)
    for key, value in data.attrs.items():
        group.attrs[key] = value


def _read_front(group: Any) -> Points:
    root = _read_group(group)
    phases = [_read_group(group[place]) for place in json.loads(root.attrs[PHASES]).values()]
    closest = _read_front(group[CLOSEST])[0] if root.attrs["has_closest"] else None
    return Points(**root_columns(root), trajectories=trajectories(root, phases), closest=closest)


def _read_group(group: Any) -> Labelled:
    """What `_write_group` wrote, by HDF5's own names for it; several times faster than through netCDF's, for the same values."""
    import h5py

    variables = {}
    for name, data in group.items():
        if isinstance(data, h5py.Dataset) and not str(_text(data.attrs.get("NAME", ""))).startswith(DIMENSION_ONLY):
            dimensions = (name,) if data.is_scale else tuple(dim[0].name.rsplit("/")[-1] for dim in data.dims)
            variables[name] = (dimensions, _values(data))
    return Labelled(variables, {key: _text(value) for key, value in group.attrs.items()})


def _values(data: Any) -> np.ndarray:
    values = np.asarray(data[...])
    return words([_text(word) for word in values.tolist()]) if values.dtype.kind == "O" else values


def _text(value: Any) -> Any:
    return value.decode() if isinstance(value, bytes) else value


def _reason(content: bytes, error: Exception) -> str:
    if not content:
        return "it is empty"
    if not content.startswith(b"\x89HDF\r\n\x1a\n"):
        return "it is not a netCDF-4 file"
    if isinstance(error, OSError):
        return f"it is cut short or damaged ({error})"
    if isinstance(error, KeyError):
        return f"{error.args[0] if error.args else 'something'} is missing from it"
    return str(error) or type(error).__name__
