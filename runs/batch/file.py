"""Study files: the TOML files that come with the project, or that a user writes."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from macs.io.atomic import read_whole
from problems.catalogue import PROBLEM_FILE_BYTES
from problems.checks import unknown

from ..files import check_known, check_trusted, errors_begin_with
from ..measures.references import reference_addresses

STUDIES = Path(__file__).parents[1] / "studies"


def names() -> list[str]:
    """The studies that come with the project."""
    return sorted(path.stem for path in STUDIES.glob("*.toml"))


def describe(name: str) -> str:
    """One line on a study that comes with the project."""
    return str(tomllib.loads((STUDIES / f"{name}.toml").read_text(encoding="utf-8")).get("description", ""))


def read(source: str | PathLike[str], keys: Mapping[str, bool], trust: bool) -> dict[str, Any]:
    """The content of a study file, with the name of the file as its name unless it states one."""
    path = find(source)
    with errors_begin_with(str(source)):
        try:
            data = tomllib.loads(read_whole(path, PROBLEM_FILE_BYTES).decode())
        except OSError as error:
            raise ValueError(f"cannot be read: {error.strerror or error}") from error
        except UnicodeDecodeError as error:
            raise ValueError("it is not a text file") from error
        except (tomllib.TOMLDecodeError, RecursionError) as error:
            raise ValueError(f"it is not TOML: {error}") from error
        check_known("key", data, keys)
        for key, required in keys.items():
            if required and key not in data:
                raise ValueError(f"{key} is missing")
        for address in _addresses(data):
            check_trusted(address, trust, "it")
    if data.get("verify") is False:
        data["verify"] = None  # TOML has no word for nothing
    data.setdefault("name", path.stem)
    data["problems"] = _beside(data["problems"], path.parent)
    return data


def _addresses(data: Mapping[str, Any]) -> list[str]:
    """The addresses of code that a study file states: of its problems, and of references."""
    problems = data["problems"]
    stated = problems.values() if isinstance(problems, Mapping) else problems if isinstance(problems, list) else [problems]
    addresses = [one.get("problem") if isinstance(one, Mapping) else one for one in stated]
    return [one for one in addresses if isinstance(one, str)] + reference_addresses(data.get("reference"))


def find(source: str | PathLike[str]) -> Path:
    """The file of a study: the path itself, or that of a study that comes with the project. Raises ValueError if there is none."""
    path = Path(source)
    if path.suffix == ".toml":
        if not os.path.lexists(path):
            raise ValueError(f"there is no file '{source}'")
        return path
    if str(source) not in names():
        raise ValueError(f"{unknown('study', str(source), names())}, or give a file.toml")
    return STUDIES / f"{source}.toml"


def _beside(problems: Any, folder: Path) -> Any:
    """Problems with the paths of Python files that lie beside the study; their labels are as in the file."""
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
