"""References that fronts are measured against: a file, the closed form of a case, or the non-dominated union of fronts."""

from __future__ import annotations

import csv
import importlib
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from msgspec import Meta

from macs.evaluation.evaluator import CONVERGED
from macs.front import Front
from macs.io.atomic import read_whole
from macs.io.text import label
from macs.pareto.dominance import nondominated
from problems.catalogue import CASES, address_of
from problems.compiled import Objective

from ..files import DATA_BYTES, check_known, errors_begin_with
from .indicators import Points, described, goals_of, minimised

if TYPE_CHECKING:
    from problems.compiled import CompiledProblem
    from problems.vector import CompiledVectorProblem


FILES = (".nc", ".csv", ".tsv", ".txt", ".dat", ".pf")
"""Suffixes of files that are references whether they are there or not."""
ReferenceKey = Annotated[
    str | dict[str, str] | None,
    Meta(description="'union', 'truth', the name of a case, a file, or one of these by problem"),
]


def union(fronts: Sequence[Points]) -> Points:
    """The non-dominated points of several fronts: the reference of a problem whose true front is not known."""
    goals = goals_of(fronts)
    own = [front for front in fronts if isinstance(front, Front)]
    if len(own) == len(fronts):
        return Front.merge(own)
    rows = [minimised(front, goals, f"front {i}") for i, front in enumerate(fronts)]
    F = np.vstack([part for part in rows if part.size] or [rows[0]])
    F = F[nondominated(F)]
    return F if goals is None else foreign(F * [goal.sign for goal in goals], goals)


def foreign(objectives: np.ndarray, goals: Sequence[Objective], name: str = "foreign") -> Front:
    """A Front of objectives (n, m) alone, in the user's units and senses: points of another program, as it states them."""
    values = minimised(objectives, None)
    n = len(values)
    return Front(
        F=values.reshape(n, len(goals)) * [goal.sign for goal in goals],
        decision=[np.empty(0)] * n,
        violation=np.zeros(n),
        status=[CONVERGED] * n,
        goals=goals,
        solver={"name": name, "settings": {}},
        message="" if n else "There is no point.",
    )


def module_of(case: str) -> SimpleNamespace:
    """What the module of a case has by name; in one of several cases, what begins with the function's own name and "_" goes first.

    It may also have

    - `reference() -> array (k, m)`: its true front, in the user's units and senses;
    - `optimal_flight(flight_time) -> {"time": ..., name: values (n,)}`: the best flight of a duration, and `LAW`, its name;
    - `plot(flights) -> {name: Figure}`: its own figures of objects with a `trajectory`;
    - `track(states) -> {label: values (n,)}`: where it is in a plane, of values by name of state: two, horizontal and vertical;
    - `derived(states) -> {label: values (n,)}`: what else to draw over time;
    - `dispersed(front, settings)`: what becomes of each point of a front under dispersions, `{way to fly: outcome}`, the nominal case
      first, where an outcome has `measures() -> {(name, unit): value}`; and `Dispersions`, the dataclass of the settings.
    """
    place, _, function = address_of(case).rpartition(":")
    try:
        found = vars(importlib.import_module(place))
    except (ModuleNotFoundError, ValueError, TypeError) as error:
        raise ValueError(f"there is no problem '{case}'; there are {', '.join(CASES)}") from error
    own = {name.removeprefix(f"{function}_"): value for name, value in found.items() if name.startswith(f"{function}_")}
    return SimpleNamespace(**(found | own))


def closed_form(case: str, data: Mapping[str, Any] = MappingProxyType({})) -> np.ndarray:
    """The true front (k, m) of a case, see `module_of`; of one with other `data` than its own, none is known.

    Raises ValueError if there is no such case, or its front is not known.
    """
    module = module_of(case)
    if data:
        changed = ", ".join(f"{name} = {value!r}" for name, value in data.items())
        raise ValueError(f"no true front of '{case}' with {changed} is known; measure against a file or the union")
    if not hasattr(module, "reference"):
        raise ValueError(
            f"no true front of '{case}' is known: '{module.__name__}' has no function 'reference'; measure against a file or the union"
        )
    return np.asarray(module.reference(), dtype=float)


def called(case: str) -> tuple[str, bool]:
    """The name of a case's closed form, and whether it is the truth; it is not if the case has a `reference_name`."""
    what = getattr(module_of(case), "reference_name", None)
    return (what, False) if what else ("the true front", True)


def read(path: str | PathLike[str], goals: Sequence[Objective] = ()) -> Front:
    """A front from a file: a saved one (.nc), or a table of objectives, such as `Front.to_csv` or `numpy.savetxt` writes."""
    if Path(path).suffix.lower() == ".nc":
        front = Front.load(path)
        if goals and front.goals != tuple(goals):
            raise ValueError(f"'{path}' has the objectives {described(front.goals)}, not {described(goals)}")
        return front
    if not goals:
        raise ValueError(f"'{path}' is a table: to read it, state the objectives that it is of")
    lines = list(_content(_table(path), goals))
    if not lines:
        raise ValueError(f"'{path}' is empty")
    headed = not _is_number(lines[0][1][0])
    columns, status = _columns(lines[0][1], goals, path) if headed else (list(range(len(goals))), None)
    rows = []
    for number, row in lines[headed:]:
        needed = max(*columns, -1 if status is None else status) + 1
        if len(row) < needed:
            raise ValueError(f"'{path}', line {number}: {len(row)} columns, at least {needed} are needed")
        if status is not None and row[status] != CONVERGED:
            continue
        cells = [row[i] for i in columns]
        if not all(map(_is_number, cells)):
            raise ValueError(f"'{path}', line {number}: {', '.join(map(repr, cells))} should be {len(goals)} finite numbers")
        rows.append([float(cell) for cell in cells])
    return foreign(np.array(rows).reshape(len(rows), len(goals)), goals, name=Path(path).stem)


def _table(path: str | PathLike[str]) -> list[list[str]]:
    """The rows of a table with commas, semicolons, tabulators or blanks between its columns. Raises what `read` says."""
    try:
        text = read_whole(path, DATA_BYTES).decode("utf-8-sig")
        first = next((line for line in text.splitlines() if line.strip() and not line.startswith("#")), "")
        mark = next((mark for mark in ";\t," if mark in first), None)
        if mark is None:
            return [line.split() for line in text.splitlines()]
        rows = list(csv.reader(io.StringIO(text, newline=""), delimiter=mark))
        # Beside semicolons, commas stand for the points of numbers.
        return [[point if _is_number(point := cell.replace(",", ".")) else cell for cell in row] for row in rows] if mark == ";" else rows
    except FileNotFoundError:
        raise FileNotFoundError(f"there is no file '{path}'") from None
    except OSError as error:
        raise ValueError(f"'{path}' cannot be read: {error.strerror or error}") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"'{path}' is no table: {error}") from error


def _content(rows: Sequence[Sequence[str]], goals: Sequence[Objective]) -> Iterator[tuple[int, list[str]]]:
    """Numbers and cells of the rows that are neither empty nor a comment; one that names all objectives is a header."""
    for number, row in enumerate(rows, 1):
        cells = [cell.strip() for cell in row]
        if cells and cells[0].startswith("#"):
            cells = [cell for cell in (cells[0].lstrip("# "), *cells[1:]) if cell]
            if not all(_places(goal, cells) for goal in goals):
                continue
        if any(cells):
            yield number, cells


def _places(goal: Objective, header: Sequence[str]) -> list[int]:
    """The columns that a header says to be of an objective."""
    return [i for i, cell in enumerate(header) if cell in (goal.name, label(goal.name, goal.unit))]


def _columns(header: Sequence[str], goals: Sequence[Objective], path: str | PathLike[str]) -> tuple[list[int], int | None]:
    """Where the objectives are, and the status, if it is there."""
    found = []
    for goal in goals:
        at = _places(goal, header)
        if not at:
            raise ValueError(f"'{path}' has no column '{label(goal.name, goal.unit)}'; it has {', '.join(header)}")
        found.append(at[0])
    return found, header.index("status") if "status" in header else None


def _is_number(cell: str) -> bool:
    try:
        return bool(np.isfinite(float(cell)))
    except ValueError:
        return False


@dataclass(frozen=True)
class Reference:
    """A reference front."""

    front: Front
    what: str  # in words: "the true front, in closed form"
    true: bool  # whether it is the truth, or only the best that is known
    alone: bool = False  # whether it is but one run, or one point of several, so that nothing can be compared with it


def look_up(given: Any, label: str, address: str, data: Mapping[str, Any], goals: Sequence[Objective]) -> Reference | None:
    """The reference of a problem."""
    if isinstance(given, Mapping):
        given = given.get(label)
    if given == "union":
        return None
    if given is None or given == "truth":
        try:
            if not address:
                raise ValueError("no true front of a problem that a script states is known; measure against a file or the union")
            return Reference(foreign(closed_form(address, data), goals, "truth"), *called(address))
        except ValueError:
            if given is not None:
                raise
            return None
    if is_file(given):
        return Reference(read(given, goals), str(given), False)
    what, true = called(given)
    return Reference(foreign(closed_form(given), goals, "truth"), f"{what} of {given}", true)


def reference_addresses(given: Any) -> list[str]:
    """The addresses of code in a study's reference."""
    stated = given.values() if isinstance(given, Mapping) else [given]
    return [one for one in stated if isinstance(one, str) and one not in ("union", "truth") and not is_file(one)]


def is_file(given: str) -> bool:
    """Whether a reference is a file, by its name or since there is one, and not a case, such as `file.py:function`."""
    path = Path(given)
    return ":" not in given and path.suffix != ".py" and (path.suffix.lower() in FILES or (given not in CASES and path.is_file()))


def check_reference(given: Any, stated: Mapping[str, CompiledProblem | CompiledVectorProblem]) -> None:
    """Raise ValueError if a study of problems, by label, has no such reference, or it cannot be read."""
    with errors_begin_with("reference"):
        check_known("problem", given if isinstance(given, Mapping) else (), stated)
    for name, problem in stated.items():
        try:
            look_up(given, name, problem.address, problem.data, problem.goals)
        except (ValueError, OSError) as error:
            raise ValueError(f"reference of '{name}': {error}") from error
