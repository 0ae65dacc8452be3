"""Long work that may be asked to end early, without every function in between knowing of it.

The caller states how to find out whether the work is still wanted; a loop of long steps asks between them, and leaves out the rest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_ASKED: ContextVar[Callable[[], bool] | None] = ContextVar("stopping", default=None)


@contextmanager
def stopped_by(asked: Callable[[], bool]) -> Iterator[None]:
    """Within, `stopping()` returns what `asked()` does, which must not raise: what was done so far is to be returned."""
    token = _ASKED.set(asked)
    try:
        yield
    finally:
        _ASKED.reset(token)


def stopping() -> bool:
    """Whether the work at hand is to end with what it has."""
    asked = _ASKED.get()
    return asked is not None and asked()
