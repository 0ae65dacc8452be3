"""What commands answer: exit codes, and a line for a wrong call."""

from __future__ import annotations

from typing import Any

DONE, NO, WRONG, INTERRUPTED = 0, 1, 2, 130
"""Exit codes: done; the answer is no; the call was wrong; Ctrl-C."""


class WrongCall(Exception):  # noqa: N818 - whoever called is to be told, in one line
    """What the user asked for makes no sense. The text says why, in their words."""


class refused:  # noqa: N801 - reads as a statement
    """A ValueError inside is the caller's mistake."""

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        if isinstance(error, ValueError):
            raise WrongCall(str(error)) from error
