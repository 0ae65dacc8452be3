"""Checks of preferences. Each raises a ValueError of one line that names the objective."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from problems.checks import number, unknown
from problems.compiled import Objective

ROUNDING = 1e-9
"""Fraction of a range by which a target may lie beyond it."""


def named(values: Any, what: str) -> dict[str, Any]:
    """A dict by name of objectives that is not empty."""
    if not isinstance(values, Mapping) or not values:
        raise ValueError(f"{what} must be a dict by name of objectives, such as {{'flight time': 150.0}}, not {values!r}")
    for name in values:
        if not isinstance(name, str):
            raise ValueError(f"{what} must be a dict by name of objectives, but {name!r} is no name")
    return dict(values)


def named_numbers(values: Any, what: str) -> dict[str, float]:
    """A dict of finite numbers by name of objectives."""
    return {name: number(value, f"{what} of '{name}'") for name, value in named(values, what).items()}


def named_weights(values: Any, what: str = "weights") -> dict[str, float]:
    """A dict of numbers by name of objectives, none negative, not all zero."""
    weights = named_numbers(values, what)
    for name, weight in weights.items():
        if weight < 0:
            raise ValueError(f"{what} of '{name}' must not be negative, not {weight:g}")
    if not any(weights.values()):
        raise ValueError(f"{what} must not all be zero")
    return weights


def names_of(values: Any, what: str) -> tuple[str, ...]:
    """A tuple of different names."""
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise ValueError(f"{what} must be a list of names of objectives, not {values!r}")
    names = tuple(values)
    for name in names:
        if not isinstance(name, str):
            raise ValueError(f"{what} must be a list of names of objectives, but {name!r} is no name")
        if names.count(name) > 1:
            raise ValueError(f"{what}: '{name}' is named twice")
    return names


def places(names: Iterable[str], goals: Sequence[Objective]) -> dict[str, int]:
    """The place of each of these objectives among the goals."""
    known = [goal.name for goal in goals]
    for name in names:
        if name not in known:
            raise ValueError(unknown("objective", name, known))
    return {name: known.index(name) for name in names}


def shown(value: float, goal: Objective) -> str:
    """A value with its unit."""
    return f"{value:.6g}{f' {goal.unit}' if goal.unit else ''}"


def levels(priorities: Any) -> tuple[tuple[str, ...], ...]:
    """Levels of priority, most important first, each a tuple of names; no name occurs twice."""
    if isinstance(priorities, str) or not isinstance(priorities, Sequence) or not priorities:
        raise ValueError(f"priorities must be a list of names of objectives, most important first, not {priorities!r}")
    found = tuple(names_of([level] if isinstance(level, str) else level, "priorities") for level in priorities)
    names_of([name for level in found for name in level], "priorities")
    return found
