"""Exit codes of commands, and the error for a wrong call."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

DONE, FAILED, WRONG, INTERRUPTED = 0, 1, 2, 130
"""Exit codes: done; failed (nothing feasible, a check not passed, runs missing); the call was wrong; Ctrl-C."""


class WrongCall(Exception):  # noqa: N818 - a message to the user in one line
    """The user's call is wrong. The text is the reason, in the user's words."""


@contextmanager
def wrong_call_on_value_error() -> Iterator[None]:
    """A context in which a ValueError becomes a `WrongCall`."""
    try:
        yield
    except ValueError as error:
        raise WrongCall(str(error)) from error
