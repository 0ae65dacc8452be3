"""Long work that may be asked to end early, without every function in between knowing of it.

The caller states how to find out whether the work is still wanted. A loop of long steps asks between them. Where what was done so far is of
use, it leaves out the rest (`stopping`); where half of the work is worth nothing, as in a simulation or while a program is built, it raises
`Stopped` (`check_stopping`), which the next loop above takes as the end of what it can keep.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

Asked = Callable[[], str | bool]
"""Returns the reason to end, or True; "" or False if there is none. It must not raise."""


def _never() -> bool:
    """Nothing asks to end."""
    return False


@dataclass
class _Clock:
    """When the end of the whole work was first seen to be asked for; None if it is not."""

    since: float | None = None


_ASKED: ContextVar[Asked] = ContextVar("stopping", default=_never)
_CLOCK: ContextVar[_Clock | None] = ContextVar("stopping since", default=None)


class Stopped(Exception):  # noqa: N818 - an end, not an error
    """Raised to end the work with its results so far. The text is the reason."""


@contextmanager
def stopped_by(asked: Asked) -> Iterator[None]:
    """Within, the work is to end if `asked()` says so, or what it is a part of is to end."""
    outer, clock = _ASKED.get(), _CLOCK.get() or _Clock()
    tokens = _ASKED.set(asked if outer is _never else lambda: asked() or outer()), _CLOCK.set(clock)
    try:
        yield
    finally:
        _ASKED.reset(tokens[0])
        _CLOCK.reset(tokens[1])


def stopping() -> bool:
    """Whether the work at hand is to end with what it has."""
    return bool(reason_to_stop())


def reason_to_stop() -> str:
    """Reason to end the work at hand; "" if there is none."""
    reason, clock = in_words(_ASKED.get()), _CLOCK.get()
    if clock is not None and (clock.since is None) == bool(reason):
        clock.since = time.monotonic() if reason else None
    return reason


def asked_now() -> Asked:
    """What is asked at present, so that work which begins here can ask it, too."""
    return _ASKED.get()


def in_words(asked: Asked) -> str:
    """The reason that `asked` has; "" if there is none."""
    reason = asked()
    return reason if isinstance(reason, str) else "asked to end" * reason


def check_stopping(grace: float = 0.0) -> None:
    """Raise `Stopped` if the work at hand is to end, and was so for `grace` seconds: what is over by then may come to its end."""
    reason, clock = reason_to_stop(), _CLOCK.get()
    if reason and (not grace or clock is None or clock.since is None or time.monotonic() - clock.since >= grace):
        raise Stopped(reason)
