"""Results that are computed once from a value that never changes, and kept as long as the value lives."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import cached_property, wraps
from inspect import unwrap
from typing import Any, Concatenate, ParamSpec, TypeVar

Owner = TypeVar("Owner", bound="Deriving")
Further = ParamSpec("Further")
Result = TypeVar("Result")


class Deriving:
    """A value that keeps what `remembered` functions compute from it. Pickles and copies begin without."""

    @cached_property
    def derived(self) -> dict[Hashable, Any]:
        """Results by (function, further arguments)."""
        return {}

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "derived"}


def remembered(function: Callable[Concatenate[Owner, Further], Result]) -> Callable[Concatenate[Owner, Further], Result]:
    """A function of a value, and perhaps of further hashable arguments by position, that computes each result once."""

    @wraps(function)
    def once(owner: Owner, *further: Further.args, **none: Further.kwargs) -> Result:
        key = (function, *further)
        if key not in owner.derived:
            owner.derived[key] = function(owner, *further, **none)
        result: Result = owner.derived[key]
        return result

    return once


def computed(
    function: Callable[Concatenate[Owner, Further], Result], owner: Owner, *further: Further.args, **none: Further.kwargs
) -> Result | None:
    """What a `remembered` function has computed already; None if it has not been asked."""
    result: Result | None = owner.derived.get((unwrap(function), *further))
    return result
