"""A front as one netCDF-4 file, whole or not at all.

Root group: `dataset.root_dataset`. One group for each phase: `dataset.phase_dataset`. Group `_closest`, if there is one: the least
infeasible point of an empty front, laid out like a root. At the end, a checksum (`io.atomic`), without which nothing of the file is read.
Nothing is pickled, and no code that a file names is run.

A file is made in memory, written under a temporary name in the same folder, flushed to the disk and renamed: a full disk, a crash or a
second reader never meets half of one. It is read into memory too, so that it does not stay open.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator
from dataclasses import replace
from os import PathLike
from typing import Any

import numpy as np

from ..io import netcdf
from ..io.atomic import check_target, read_whole, sealed, unsealed, write_whole
from ..io.netcdf import Group, Labelled, words
from ..io.text import document
from .columns import checked, read_attribute, read_document, variable_columns
from .dataset import (
    AT_NODES,
    CLOSEST,
    FORMAT,
    FORMAT_VERSION,
    ROOT,
    group_names,
    phase_dataset,
    phase_names,
    quantity_names,
    read_flights,
    root_columns,
    root_dataset,
)
from .points import Points
from .provenance import STATS, stats_attributes
from .verified import with_tolerances

LARGEST_FRONT = 2**30
"""Bytes that a file may have."""
PHASES = "phases"
"""Attribute of a root: the groups of its phases, in their order, as JSON."""
SEALED = b"long_name"
"""What files have in many places since they have a checksum, and did not have before: one that lost it is not taken for an old one."""
EDGE_STATES = "edge_states"
"""An array that the first files of format 1 had beside the same values in the coefficients."""


def save(front: Points, path: str | PathLike[str]) -> None:
    """Write a front; see `Front.save`."""
    check_target(path)
    write_whole(path, to_bytes(front))


def load(path: str | PathLike[str], problem: Any = None, trust: bool = False) -> Points:
    """Read a front; see `Front.load`."""
    try:
        content = read_whole(path, LARGEST_FRONT)
    except FileNotFoundError:
        raise FileNotFoundError(f"there is no file '{path}'") from None
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror or error}") from error
    try:
        front, version = _read(content)
    except Exception as error:
        # HDF5 raises errors of many classes for a damaged or foreign file: whichever it is, the user's file is wrong.
        raise ValueError(f"{path} does not hold a front that can be read: {_reason(content, error)}") from error
    if version < FORMAT_VERSION:
        text = f"{path} was written by an earlier MACS (format {version}) and has no checksum: damage is not noticed. Save it again."
        warnings.warn(text, stacklevel=3)
    if front.source is None and problem is not None:
        raise ValueError(f"{path} holds a front of a black box: it has no problem")
    if front.source is not None:
        source = replace(front.source, trusted=trust)
        known = None if problem is None else source.check(problem, str(path))
        for points in [front] if front._closest is None else [front, front._closest._points]:
            points.source, points._problem = source, known
    return front


def to_bytes(front: Points) -> bytes:
    """The content of a front's file. Raises ValueError for a front of more than `LARGEST_FRONT` bytes."""
    content = sealed(netcdf.to_bytes(dict(_datasets(front))))
    if len(content) > LARGEST_FRONT:
        raise ValueError(f"the front has {len(content)} bytes, a file at most {LARGEST_FRONT}: save fewer points")
    return content


def from_bytes(content: bytes) -> Points:
    """The front in a file's content. Raises an exception of any class if it is none."""
    return _read(content)[0]


def _datasets(front: Points) -> Iterator[tuple[str, Labelled]]:
    """A front's groups by their paths, its root first."""
    yield from _one_dataset(front, "")
    if front._closest is not None:
        yield from _one_dataset(front._closest.alone(), CLOSEST)


def _one_dataset(front: Points, path: str) -> Iterator[tuple[str, Labelled]]:
    root, groups = root_dataset(front), group_names(phase_names(front))
    root.attrs[PHASES] = document(groups)
    yield path, root
    for name, group in groups.items():
        yield f"{path}/{group}", phase_dataset(front, name)


def _read(content: bytes) -> tuple[Points, int]:
    """The front, and the version of its format."""
    whole = unsealed(content)
    if whole is None and SEALED in content:
        raise ValueError("it is cut short or damaged: it has no checksum")
    root = netcdf.from_bytes(content, older=True) if whole is None else netcdf.from_bytes(whole)
    if root.attrs.get("format") != FORMAT:
        raise ValueError("it is a netCDF file of something else")
    version = read_attribute(root.attrs, "format_version", int)
    if version > FORMAT_VERSION:
        raise ValueError(f"its format is version {version}, this MACS reads up to version {FORMAT_VERSION}: update MACS")
    if (whole is None) != (version < FORMAT_VERSION) or version < 1:
        raise ValueError(f"its format is version {version}, {'without' if whole is None else 'with'} a checksum: no MACS wrote it so")
    closest = root.groups.pop(CLOSEST, None)
    return _read_front(root, version, None if closest is None else _read_front(closest, version)), version


def _read_front(root: Group, version: int, closest: Points | None = None) -> Points:
    places = read_document(root.attrs, PHASES)
    if set(places.values()) != set(root.groups) or len(places) > len(root.groups):
        raise ValueError(f"its groups are {', '.join(root.groups) or 'none'}, its phases {', '.join(places) or 'none'}")
    if closest is not None and len(closest) != 1:
        raise ValueError(f"the closest point is one, not {len(closest)}")
    root, phases = upgrade(root, {name: root.groups[place] for name, place in places.items()}, version)
    data = checked(ROOT, root)
    points = Points(**root_columns(data), **read_flights(data, phases), closest=None if closest is None else closest[0])
    return points if "tolerances" in data.arrays else with_tolerances(points)


def upgrade(root: Group, phases: dict[str, Group], version: int) -> tuple[Group, dict[str, Group]]:
    """A root and its phases in today's format, from those of an earlier one.

    Format 1 had one transcription and no notes. Up to format 2, names without entries had no bounds, states, controls and path constraints
    were in one array each, and the numbers of `stats` in its JSON.
    """
    if version == FORMAT_VERSION:
        return root, phases
    n = len(root.arrays["violation"])
    arrays, attrs = {**root.arrays}, {**root.attrs}
    if version == 1:
        lengths, columns = arrays.pop("decision_length"), np.arange(arrays["decision"].shape[1])
        arrays["place"] = np.where(columns < lengths[:, None], columns, -1)
        arrays |= {"transcription": words([attrs["transcription"]] * n), "note": words([""] * n)}
        for phase in phases.values():
            phase.arrays.pop(EDGE_STATES, None)
            phase.arrays.update({basis: words([phase.attrs[basis]] * n) for basis in ("state_basis", "control_basis")})
    arrays["parameter_unit"] = words([""] * len(arrays["parameter"]))
    attrs |= stats_attributes(STATS | json.loads(attrs["stats"]))
    for phase in phases.values():
        entries = quantity_names({kind: phase.arrays[kind].tolist() for kind in AT_NODES})
        for kind, attribute in AT_NODES.items():
            values = phase.arrays.pop(attribute)
            empty = variable_columns((), kind, limits=kind == "path")
            empty.pop("path_unit", None)  # limits had no units
            phase.arrays.update(empty | phase.arrays | {array: values[..., i] for i, array in enumerate(entries[kind])})
    return Group(variable_columns((), "variable") | arrays, attrs, {}), phases


def _reason(content: bytes, error: Exception) -> str:
    if not content:
        return "it is empty"
    if not content.startswith(b"\x89HDF\r\n\x1a\n"):
        return "it is not a netCDF-4 file"
    if isinstance(error, OSError):
        return f"it is cut short or damaged ({error})"
    if isinstance(error, KeyError):
        return f"{error.args[0] if error.args else 'something'} is missing from it"
    return " ".join(str(error).split()) or type(error).__name__
