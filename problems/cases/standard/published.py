"""Published optima, and the collection of the problems that have one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from inspect import getdoc
from types import MappingProxyType
from typing import Any, TypeVar

Builder = TypeVar("Builder", bound=Callable[..., Any])

SHARE = 5e-4
"""A value meets a published one if it differs by no more than this share of its scale, or than `PublishedOptimum.within`."""


@dataclass(frozen=True)
class PublishedOptimum:
    """The optimum of one objective, for some data.

    Attributes
    ----------
    objective : str
    value : float
        As the user sees it: what is to be maximised is not negated.
    within : float
        Its uncertainty: half a unit of the last published digit, or more where it is known to be less accurate.
    source : str
        Author, year, and place in it; or the closed form.
    data : mapping
        Arguments of the problem's function if they are not the defaults.
    local : tuple of float
        Values of other local optima that are known.
    scale : float, optional
        What its differences are measured by: the size of the value by default.
    remark : str
        What a comparison has to know.
    """

    objective: str
    value: float
    within: float
    source: str
    data: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    local: tuple[float, ...] = ()
    scale: float | None = None
    remark: str = ""

    def error(self, value: float) -> float:
        """The difference of a value from the published one, in scales."""
        return (value - self.value) / (self.scale or abs(self.value) or 1.0)

    def met(self, value: float) -> bool:
        """Whether a value is the published one, within a share `SHARE` of its scale or its own uncertainty."""
        return abs(self.error(value)) <= SHARE or abs(value - self.value) <= self.within


_COLLECTION: dict[str, tuple[Callable[..., Any], list[PublishedOptimum]]] = {}
"""Function and optima of each problem, by name; `optimum` adds to it where the problems are defined."""


def optimum(*record: Any, **further: Any) -> Callable[[Builder], Builder]:
    """Decorator of a function that makes a problem: adds it to the collection, with a `PublishedOptimum` of these arguments.

    There may be several, one above the other; the first is for the default data.
    """

    def add(function: Builder) -> Builder:
        _COLLECTION.setdefault(function.__name__, (function, []))[1].insert(0, PublishedOptimum(*record, **further))
        return function

    return add


def cases() -> dict[str, tuple[str, str]]:
    """For each problem the address of its function, and one line on it: the first of its docstring."""
    return {name: (f"{function.__module__}:{name}", _line(function)) for name, (function, _) in _COLLECTION.items()}


def published(name: str) -> tuple[PublishedOptimum, ...]:
    """The published optima of a problem, that for its default data first. Raises ValueError if there is no such problem."""
    if name not in _COLLECTION:
        raise ValueError(f"there is no problem '{name}' in the collection; there are {', '.join(_COLLECTION)}")
    return tuple(_COLLECTION[name][1])


def _line(function: Callable[..., Any]) -> str:
    first = (getdoc(function) or "").partition("\n")[0].rstrip(".")
    return first[:1].lower() + first[1:]
