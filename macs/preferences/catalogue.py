"""Preferences as plain data, such as JSON has, and back: from a closed table of classes, so that nothing of a file is executed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING
from typing import Any

import numpy as np

from problems.checks import settings_of, unknown

from .achievement import Nimbus, ReferencePoint, WeightedSum
from .goals import Around, FuzzyGoal, FuzzySatisfactory, GoalProgramming
from .physical import FuzzyPhysicalProgramming, PhysicalProgramming
from .preference import Preference
from .preference_functions import Larger, ObjectiveClass, Range, Smaller, Value

METHODS: dict[str, type[Preference]] = {
    one.__name__: one
    for one in (
        *(WeightedSum, GoalProgramming, FuzzyGoal, FuzzySatisfactory, ReferencePoint, Nimbus),
        *(PhysicalProgramming, FuzzyPhysicalProgramming),
    )
}
CLASSES: dict[str, type[ObjectiveClass]] = {one.__name__: one for one in (Smaller, Larger, Value, Range)}
AROUND = Around.__name__


def to_dict(preference: Preference) -> dict[str, Any]:
    """A preference as plain data: {"method": name of its class, "settings": {...}}.

    In settings, classes of physical programming are {"class": "Smaller", "boundaries": [...]}, and targets on both sides
    {"class": "Around", "value": ..., "tolerance": ...}.

    Raises
    ------
    ValueError
        For a preference of a class of the user's own.

    Parameters
    ----------
    preference : Preference

    Examples
    --------
    >>> from macs.decisions import WeightedSum, from_dict, to_dict
    >>> wish = WeightedSum({"flight time": 1, "horizontal speed": 3})
    >>> to_dict(wish)["method"], from_dict(to_dict(wish)) == wish
    ('WeightedSum', True)
    """
    name = type(preference).__name__
    if METHODS.get(name) is not type(preference):
        raise ValueError(f"a {name} cannot be written down; there are {', '.join(METHODS)}")
    return {"method": name, "settings": {one.name: _plain(getattr(preference, one.name)) for one in settings_of(preference)}}


def from_dict(data: Any) -> Preference:
    """The preference that `to_dict` wrote. Settings that have a default may be left out.

    Raises
    ------
    ValueError
        In one line, for an unknown method, class or setting, one that is missing, and values that the class refuses.

    Parameters
    ----------
    data : dict
        With "method" and "settings".

    Examples
    --------
    >>> from macs.decisions import WeightedSum, from_dict, to_dict
    >>> wish = WeightedSum({"flight time": 1, "horizontal speed": 3})
    >>> to_dict(wish)["method"], from_dict(to_dict(wish)) == wish
    ('WeightedSum', True)
    """
    _check_keys(data, ("method", "settings"), "a preference")
    method = data.get("method")
    if not isinstance(method, str) or method not in METHODS:
        raise ValueError(unknown("preference", method, METHODS))
    given, kind = data.get("settings", {}), METHODS[method]
    known = settings_of(kind)
    _check_keys(given, [one.name for one in known], method)
    for one in known:
        if one.name not in given and one.default is MISSING and one.default_factory is MISSING:
            raise ValueError(f"{method}: '{one.name}' is missing")
    try:
        return kind(**{name: value if isinstance(value, bool) else _made(value, 1) for name, value in given.items()})
    except ValueError as error:
        raise ValueError(f"{method}: {' '.join(str(error).split())}") from None


def _plain(value: Any) -> Any:
    if isinstance(value, ObjectiveClass):
        return {"class": type(value).__name__, "boundaries": list(value.boundaries)}
    if isinstance(value, Around):
        return {"class": AROUND, "value": value.value, "tolerance": _plain(value.tolerance)}
    if isinstance(value, Mapping):
        return {name: _plain(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return value.item() if isinstance(value, np.generic) else value


def _made(value: Any, depth: int) -> Any:
    """A value from plain data. Objects name their class by a text; an objective of the name "class" has no text as its value."""
    if depth > 4:  # a pair of tolerances of a target is as deep
        raise ValueError("its settings are nested too deeply")
    if isinstance(value, bool):
        raise ValueError(f"{value} is no number")
    if isinstance(value, list | tuple):
        return [_made(one, depth + 1) for one in value]
    if not isinstance(value, Mapping):
        return value
    name = value.get("class")
    if not isinstance(name, str):
        return {key: _made(one, depth + 1) for key, one in value.items()}
    if name == AROUND:
        _check_keys(value, ("class", "value", "tolerance"), AROUND)
        return Around(_made(value.get("value"), depth + 1), _made(value.get("tolerance"), depth + 1))
    if name not in CLASSES:
        raise ValueError(unknown("class", name, [*CLASSES, AROUND]))
    _check_keys(value, ("class", "boundaries"), name)
    boundaries = value.get("boundaries")
    if not isinstance(boundaries, list | tuple):
        raise ValueError(f"the boundaries of {name} must be a list of numbers, not {boundaries!r}")
    return CLASSES[name](*_made(boundaries, depth))


def _check_keys(data: Any, known: Any, what: str) -> None:
    if not isinstance(data, Mapping):
        raise ValueError(f"{what} must be a table of {', '.join(known)}, not {data!r}"[:200])
    for key in data:
        if key not in known:
            raise ValueError(f"{what}: {unknown('key', key, known)}")
