"""Long work that may be asked to end early, without every function in between knowing of it.

Whoever starts the work says how to tell whether it is still wanted; a loop whose steps take long asks between them, and leaves the rest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_ASKED: ContextVar[Callable[[], bool] | None] = ContextVar("stopping", default=None)


@contextmanager
def stopped_by(asked: Callable[[], bool]) -> Iterator[None]:
    """Within, `stopping()` is what `asked()` says. It must not raise: what was done so far is to come back."""
    token = _ASKED.set(asked)
    try:
        yield
    finally:
        _ASKED.reset(token)


def stopping() -> bool:
    """Whether the work at hand is to end with what it has."""
    asked = _ASKED.get()
    return asked is not None and asked()
