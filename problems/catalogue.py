"""The catalogue of cases: from a name or an address to a Problem or a VectorProblem."""

from __future__ import annotations

import difflib
import hashlib
import importlib
import importlib.util
import inspect
import os
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import cloudpickle

from .cases import standard
from .checks import unknown
from .problem import DEFAULT_EVALUATIONS, Problem
from .vector import VectorProblem

STANDARD = "standard/"
"""What the names of the published problems begin with."""
OWN = {
    "goddard": ("goddard:problem", "ascent from a flat airless body: time against horizontal speed"),
    "orbit_rise": ("orbit_rise:problem", "low-thrust orbit rise: time against energy, thrust angle in [0, pi]"),
    "orbit_rise_full": ("orbit_rise:problem_full", "the same, thrust angle in [-pi, pi] and periodic"),
    "landing_site": ("landing_site:problem", "landers on rough ground: effort against hazard, many local fronts"),
    "reentry_case1": ("reentry:reentry_case1", "shuttle re-entry: cross-range, heat load, oscillation, peak heating rate"),
    "reentry_case2": ("reentry:reentry_case2", "the same within narrow limits"),
    "reentry_case3": ("reentry:reentry_case3", "the same around three no-fly zones"),
    "skip": ("skip_entry:skip", "skip entry down to 51.88 km and up again: terminal mass against terminal speed"),
    "smv": ("skip_entry:smv", "skip entry over a turning planet: flight time, heat load, terminal speed and mass"),
    "aerocapture": (
        "aerocapture.coupled:problem",
        "aerocapture at Mars, shapes of capsules at constant bank: inverse packing efficiency against heat shield",
    ),
    "aerocapture_bank": (
        "aerocapture.bank:problem",
        "aerocapture at Mars by a bank profile, to a polar orbit: delta v against heat shield",
    ),
    "aerocapture_codesign": (
        "aerocapture.codesign:problem",
        "aerocapture at Mars, shape and bank profile together: inverse packing efficiency, heat shield and delta v",
    ),
    "betts": ("reentry:betts", "shuttle re-entry of the greatest cross-range: one objective, its optimum known"),
    "betts_heating": ("reentry:betts_heating", "the same with a limit to the heating rate"),
    "welded_beam": ("structures:welded_beam", "without trajectories: cost against deflection of a welded beam"),
    "four_bar_truss": ("structures:four_bar_truss", "without trajectories: volume against displacement of a truss, front in closed form"),
}
"""Module within `cases` and function of each case, and one line on it."""
CASES: dict[str, tuple[str, str]] = {
    **{name: (f"problems.cases.{address}", text) for name, (address, text) in OWN.items()},
    **{
        STANDARD + name: (address, f"{'of others' if name in standard.ASKED_ABOUT else 'published'}: {text}")
        for name, (address, text) in standard.cases().items()
    },
}
FORMER = {
    "problems.cases.betts:problem": "betts",
    "problems.cases.betts_heating:problem": "betts_heating",
    "problems.cases.four_bar_truss:problem": "four_bar_truss",
    "problems.cases.welded_beam:problem": "welded_beam",
    "problems.cases.aerocapture.codesign.case:problem": "aerocapture_codesign",
    **{f"problems.cases.skip_entry.{case}:problem": case for case in ("skip", "smv")},
    **{f"problems.cases.reentry.case{i}:problem": f"reentry_case{i}" for i in (1, 2, 3)},
    **{f"problems.cases.reentry.cases:case{i}": f"reentry_case{i}" for i in (1, 2, 3)},
    **{f"problems.cases.reentry.cases:{case}": case for case in ("betts", "betts_heating")},
}
"""Names of cases by addresses that they had, which saved fronts may carry."""
FORMER_STANDARD = re.compile(r"problems\.cases\.standard\.\w+\.(\w+):problem")
"""Those of the published problems, each of which was a module."""
FILE = "_problem_file_"
"""Beginning of the names of modules that are read from files."""
PROBLEM_FILE_BYTES = 2**24
"""Most that a file with a problem may have."""


def names() -> tuple[str, ...]:
    """The names of the cases that come with the project.

    Examples
    --------
    >>> from problems import names
    >>> "goddard" in names()
    True
    """
    return tuple(CASES)


def describe(name: str) -> str:
    """One line on a case of the catalogue.

    Parameters
    ----------
    name : str
        One of `names()`.

    Examples
    --------
    >>> from problems import describe
    >>> describe("goddard")
    'ascent from a flat airless body: time against horizontal speed'
    """
    return CASES[name][1]


def address_of(name: str) -> str:
    """The address of a case, by its name or by an address that it had; any other as it is."""
    former = FORMER_STANDARD.fullmatch(name)
    case = FORMER.get(name, name) if former is None else STANDARD + former[1]
    return CASES[case][0] if case in CASES else name


def is_catalogued(address: str) -> bool:
    """True for a name of the catalogue and for the address of one of its cases: then `load` runs no code but the project's own.

    Parameters
    ----------
    address : str

    Examples
    --------
    >>> from problems import is_catalogued
    >>> is_catalogued("goddard"), is_catalogued("my_problem.py:build")
    (True, False)
    """
    return any(address_of(address) == own for own, _ in CASES.values())


def load(name: str, **data: Any) -> Any:
    """The problem of a case or an address, with trajectories (`Problem`) or without (`VectorProblem`).

    The module or file that an address names is imported, which runs its code; see `is_catalogued`. The function is only called if it is a
    plain one that is defined there, and is not annotated to return anything but a problem.

    Parameters
    ----------
    name : str
        A case of `names()`, or the address of a function that returns a Problem: "file.py:function" or "package.module:function".
    **data
        Keyword arguments for that function.

    Returns
    -------
    Problem or VectorProblem
        Its `address` and `data` are kept, so that a saved front finds it again.

    Raises
    ------
    ValueError
        There is no such case, file, module or function, it is none that makes a Problem, or it does not take these data.

    Examples
    --------
    >>> from problems import load
    >>> load("goddard")
    Problem('goddard', ...)
    """
    address = address_of(name)
    place, _, function_name = address.rpartition(":")
    if name.endswith(".py"):
        raise ValueError(f"'{name}' is a file; name its function that makes the problem, too: '{name}:function'")
    if not place or not function_name:
        near = difflib.get_close_matches(name, CASES, n=1)
        hint = f", did you mean '{near[0]}'?" if near else ";"
        known = ", ".join([*(case for case in CASES if not case.startswith(STANDARD)), f"the published problems {STANDARD}..."])
        raise ValueError(f"there is no problem '{name}'{hint} there are {known}; or give 'file.py:function' or 'package.module:function'")
    function = _builder(_file_module(place) if place.endswith(".py") else _named_module(place, name), function_name, name)
    stated = _check_data(function, name, data)
    try:
        problem = function(**data)
    except TypeError as error:
        if stated or not data:
            raise
        raise ValueError(f"problem '{name}' does not take {', '.join(data)}: {error}") from error
    if not isinstance(problem, Problem | VectorProblem):
        raise ValueError(f"'{name}' must return a Problem or a VectorProblem, not {type(problem).__name__}")
    if problem.default_evaluations is None and is_catalogued(name):
        problem.default_evaluations = DEFAULT_EVALUATIONS
    # A file is found again from another folder.
    problem.address, problem.data = f"{os.path.realpath(place)}:{function_name}" if place.endswith(".py") else name, data
    return problem


def _builder(module: ModuleType, function_name: str, name: str) -> FunctionType:
    """The function of a module that makes a problem. Raises ValueError, before it is called, if it can be seen that it does not."""
    function = getattr(module, function_name, None)
    if not isinstance(function, FunctionType) or function.__module__ != module.__name__:
        raise ValueError(f"'{name.rpartition(':')[0]}' has no function '{function_name}' of its own")
    returned = function.__annotations__.get("return", "")
    word = returned.strip("'\"") if isinstance(returned, str) else getattr(returned, "__name__", str(returned))
    made = word.rpartition(".")[2] in ("Problem", "CompiledProblem", "VectorProblem")
    # A file is the user's own; of what is installed, most functions without annotation do not make problems.
    if (word and not made) or (not word and not (module.__name__.startswith(FILE) or _knows_problems(module))):
        raise ValueError(
            f"problem '{name}': '{function_name}' is not known to return a Problem; annotate it with '-> Problem' or '-> VectorProblem'"
        )
    return function


def _check_data(function: FunctionType, name: str, data: Mapping[str, Any]) -> bool:
    """Raise ValueError, before it is called, for data that the function of a problem does not take, and for those that it lacks.

    Returns whether it states the names of all data that it takes; what hands on any data is known to refuse them when it is called.
    """
    parameters = inspect.signature(function).parameters.values()
    named = {one.name: one for one in parameters if one.kind in (one.POSITIONAL_OR_KEYWORD, one.KEYWORD_ONLY)}
    stated = not any(one.kind is one.VAR_KEYWORD for one in parameters)
    if stated:
        for given in data:
            if given not in named:
                there_are = f": {unknown('data', given, named)}" if named else ", nor any other data"
                raise ValueError(f"problem '{name}' does not take {given}{there_are}")
    lacking = [one for one in named if named[one].default is inspect.Parameter.empty and one not in data]
    if lacking:
        raise ValueError(f"problem '{name}' needs data: {', '.join(lacking)}")
    return stated


def _knows_problems(module: ModuleType) -> bool:
    """Whether a module has something of this package among its names."""
    origins = (one.__name__ if isinstance(one, ModuleType) else getattr(one, "__module__", None) for one in vars(module).values())
    return any(isinstance(origin, str) and origin.partition(".")[0] == __package__ for origin in origins)


def _file_module(place: str) -> ModuleType:
    path = Path(os.path.realpath(place))  # which, unlike Path.resolve, does not fail for links in a circle
    if not path.is_file():
        # A pipe or a device is not read: it may never end.
        raise ValueError(f"'{place}' is no ordinary file" if os.path.lexists(place) else f"there is no file '{place}'")
    if path.stat().st_size > PROBLEM_FILE_BYTES:
        raise ValueError(f"'{place}' has {path.stat().st_size} bytes, a file with a problem at most {PROBLEM_FILE_BYTES}")
    name = f"{FILE}{path.stem}_{hashlib.sha256(str(path).encode()).hexdigest()[:12]}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ValueError(f"'{place}' is not a Python file")
    module = importlib.util.module_from_spec(spec)
    # As for a script: what stands beside the file can be imported by it, and its own classes find their module.
    known = set(sys.modules)
    sys.modules[name] = module
    sys.path.insert(0, str(path.parent))
    try:
        spec.loader.exec_module(module)
        for one in [other for key, other in sys.modules.items() if key not in known]:
            # Other processes cannot import them by their names: what they define is sent as it is.
            if Path(str(getattr(one, "__file__", None))).parent == path.parent:
                cloudpickle.register_pickle_by_value(one)
    except BaseException as error:
        del sys.modules[name]
        if isinstance(error, SyntaxError):
            raise ValueError(f"'{place}' is not valid Python: {error}") from error
        raise
    finally:
        sys.path.remove(str(path.parent))
    return module


def _named_module(place: str, name: str) -> ModuleType:
    if place.partition(".")[0] in sys.stdlib_module_names:
        raise ValueError(f"problem '{name}': '{place}' is of Python's own library, which has no problems")
    try:
        return importlib.import_module(place)
    except (ModuleNotFoundError, TypeError) as error:
        raise ValueError(f"there is no module '{place}' for the problem '{name}': {error}") from error
