"""Studies as TOML files: where they are, what may stand in them."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

from macs.solvers.start import unknown

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
