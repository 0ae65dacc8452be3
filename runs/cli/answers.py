"""Exit codes of commands, and the error for a wrong call."""

from __future__ import annotations

from typing import Any

DONE, FAILED, WRONG, INTERRUPTED = 0, 1, 2, 130
"""Exit codes: done; failed (nothing feasible, a check not passed, runs missing); the call was wrong; Ctrl-C."""


class WrongCall(Exception):  # noqa: N818 - a message to the user in one line
    """The user's call is wrong. The text is the reason, in the user's words."""


class wrong_call_on_value_error:  # noqa: N801 - reads as a statement
    """A context in which a ValueError becomes a `WrongCall`."""

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        if isinstance(error, ValueError):
            raise WrongCall(str(error)) from error
