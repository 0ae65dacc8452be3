"""Studies as TOML files: where they are, what may stand in them."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from os import PathLike
from pathlib import Path
from typing import Any

from macs.solvers.start import drawing
from problems import Problem
from problems.checks import unknown
from problems.compiled import CompiledProblem
from transcription import Smooth
from transcription.inner import NAMED

STUDIES = Path(__file__).parents[1] / "studies"


KEYS = (
    "name",
    "description",
    "problems",
    "transcriptions",
    "solvers",
    "terms",
    "evaluations",
    "runs",
    "seed",
    "reference",
    "inner",
    "tolerance",
    "start",
    "verify",
    "time_limit",
    "paper",
    "goal",
    "nominal",
    "flights",
    "note",
)
"""What a file may say: what `Study` takes."""


NEEDED = ("problems", "solvers", "runs", "seed")


def names() -> list[str]:
    """The studies that come with the project."""
    return sorted(path.stem for path in STUDIES.glob("*.toml"))


def describe(name: str) -> str:
    """One line on a study that comes with the project."""
    return str(tomllib.loads((STUDIES / f"{name}.toml").read_text(encoding="utf-8")).get("description", ""))


def read(source: str | PathLike[str]) -> dict[str, Any]:
    """What a study's file says: arguments of `Study`. Raises ValueError that names the file, and what is wrong with it."""
    path = _find(source)
    with told(str(source)):
        try:
            data = tomllib.loads(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise ValueError(f"cannot be read: {error.strerror or error}") from error
        except UnicodeDecodeError as error:
            raise ValueError("it is not a text file") from error
        except tomllib.TOMLDecodeError as error:
            raise ValueError(f"it is not TOML: {error}") from error
        for key in data:
            if key not in KEYS:
                raise ValueError(unknown("key", key, KEYS))
        for key in NEEDED:
            if key not in data:
                raise ValueError(f"{key} is missing")
    data.setdefault("name", path.stem)
    data["problems"] = _beside(data["problems"], path.parent)
    return data


def _find(source: str | PathLike[str]) -> Path:
    path = Path(source)
    if path.suffix == ".toml":
        if not path.is_file():
            raise ValueError(f"there is no file '{source}'")
        return path
    if str(source) not in names():
        raise ValueError(f"{unknown('study', str(source), names())}, or give a file.toml")
    return STUDIES / f"{source}.toml"


def _beside(problems: Any, folder: Path) -> Any:
    """Problems, those in Python files that lie beside the study found there; their labels are what the study's author wrote."""
    if isinstance(problems, str):
        problems = [problems]
    if isinstance(problems, list) and all(isinstance(one, str) for one in problems) and len(set(problems)) == len(problems):
        problems = {one: one for one in problems}
    if not isinstance(problems, dict):
        return problems
    return {label: _placed(one, folder) for label, one in problems.items()}


def _placed(one: Any, folder: Path) -> Any:
    if isinstance(one, dict) and "problem" in one:
        return one | {"problem": _placed(one["problem"], folder)}
    if isinstance(one, str) and ".py:" in one and (folder / one.rpartition(":")[0]).is_file():
        return str(folder / one)
    return one


def plain(data: Any) -> Any:
    """`data` as it comes back from JSON; what JSON does not know, as its `repr`."""
    return json.loads(json.dumps(data, default=lambda one: one.tolist() if hasattr(one, "tolist") else repr(one)))


def is_number(value: Any) -> bool:
    """Whether a value is a number, and finite."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


@contextmanager
def told(where: str, anything: str = "") -> Iterator[None]:
    """A ValueError inside begins with where it is. Any other error becomes one that says `anything`, if there is something to say."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from error
    except (Exception, SystemExit) as error:
        if not anything:
            raise
        raise ValueError(f"{where}: {anything}: {type(error).__name__}: {error}") from error


def same(one: Mapping[str, Any], other: Mapping[str, Any], place: str = "") -> str:
    """Where two pieces of plain data differ first, in words; nothing if they do not."""
    for key in (*one, *(key for key in other if key not in one)):
        name = f"{place}{key}"
        first, second = one.get(key), other.get(key)
        if isinstance(first, Mapping) and isinstance(second, Mapping):
            inner = same(first, second, f"{name}.")
            if inner:
                return inner
        elif first != second:
            return f"{name} is {json.dumps(first)} there and {json.dumps(second)} here"
    return ""


TERMS = ("transcription", "evaluations", "inner", "start")
"""What a solver may work with instead of what the others do."""


INNER = "auto"
"""The inner level where nobody names one."""


def check(terms: Any, solvers: Collection[str]) -> None:
    """Raise ValueError that names what makes no sense in a study's `terms`, of solvers with these labels."""
    if not isinstance(terms, Mapping):
        raise ValueError(f"terms must be a table of tables, one for a solver, not {terms!r}")
    for label, own in terms.items():
        if label not in solvers:
            raise ValueError(f"terms: there is no solver '{label}'; there are {', '.join(solvers)}")
        with told(f"terms of '{label}'"):
            _check_own(own)


def _check_own(own: Any) -> None:
    if not isinstance(own, Mapping) or not own:
        raise ValueError(f"there must be a table of {', '.join(TERMS)}, not {own!r}")
    for key in own:
        if key not in TERMS:
            raise ValueError(unknown("key", key, TERMS))
    if isinstance(own.get("transcription"), list | tuple | Mapping):
        raise ValueError(f"transcription must be one, not {own['transcription']!r}")
    if "inner" in own:
        check_inner(own["inner"])
    sampling(own.get("start"))


def of_problem(problem: Problem | CompiledProblem, inner: str | None, start: Any) -> dict[str, Any]:
    """The inner level and start of a problem's own, where a study names none and they are not what solvers do anyway: plain data.

    Raises ValueError if they make no sense. A compiled problem has none.
    """
    found: dict[str, Any] = {}
    if isinstance(problem, CompiledProblem):
        return found
    if inner is None:
        check_inner(problem.default_inner)
        found |= {"inner": problem.default_inner} if problem.default_inner != INNER else {}
    if start is None and problem.default_start is not None:
        found["start"] = written(problem.default_start)
    return found


def check_inner(inner: Any) -> None:
    """Raise ValueError unless there is an inner level of this name."""
    if inner not in NAMED:
        raise ValueError(unknown("inner level", inner, NAMED))


def sampling(start: Any) -> Smooth | str | None:
    """What `solve` gets as its `start`. Raises ValueError for what makes no sense."""
    if isinstance(start, Mapping):
        for key in start:
            if key not in Smooth.__dataclass_fields__:
                raise ValueError(unknown("setting of start", key, Smooth.__dataclass_fields__))
        return Smooth(**start)
    found = drawing(start)
    if found is None and start is not None:
        raise ValueError(f"start must be 'uniform', 'smooth', or a table of the settings of Smooth, not {start!r}")
    return found


def written(start: Any) -> Any:
    """A start as plain data, which `sampling` understands."""
    found = sampling(start)
    return asdict(found) if isinstance(found, Smooth) else found
