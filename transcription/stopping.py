"""Long work that may be asked to end early, without every function in between knowing of it.

The caller states how to find out whether the work is still wanted. A loop of long steps asks between them. Where what was done so far is of
use, it leaves out the rest (`stopping`); where half of the work is worth nothing, as in a simulation or while a program is built, it raises
`Stopped` (`check_stopping`), which the next loop above takes as the end of what it can keep.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

Asked = Callable[[], str | bool]
"""Returns the reason to end, or True; "" or False if there is none. It must not raise."""


def _never() -> bool:
    return False


_ASKED: ContextVar[Asked] = ContextVar("stopping", default=_never)


class Stopped(Exception):  # noqa: N818 - an end, not an error
    """Raised to end the work with its results so far. The text is the reason."""


@contextmanager
def stopped_by(asked: Asked) -> Iterator[None]:
    """Within, the work is to end if `asked()` says so, or what it is a part of is to end."""
    outer = _ASKED.get()
    token = _ASKED.set(asked if outer is _never else lambda: asked() or outer())
    try:
        yield
    finally:
        _ASKED.reset(token)


def stopping() -> bool:
    """Whether the work at hand is to end with what it has."""
    return bool(reason_to_stop())


def reason_to_stop() -> str:
    """Reason to end the work at hand; "" if there is none."""
    return in_words(_ASKED.get())


def asked_now() -> Asked:
    """What is asked at present, so that work which begins here can ask it, too."""
    return _ASKED.get()


def in_words(asked: Asked) -> str:
    """The reason that `asked` has; "" if there is none."""
    reason = asked()
    return reason if isinstance(reason, str) else "asked to end" * reason


def check_stopping() -> None:
    """Raise `Stopped` if the work at hand is to end."""
    reason = reason_to_stop()
    if reason:
        raise Stopped(reason)
