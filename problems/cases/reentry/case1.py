"""The re-entry within wide limits; see `statement`."""

from __future__ import annotations

from functools import partial
from typing import Any

from ...problem import Problem
from .figures import plot, track
from .statement import REFERENCE, Limits, known, reentry

__all__ = ["LIMITS", "REFERENCE", "plot", "problem", "reference", "track"]

LIMITS = Limits(heating_rate=200.0, dynamic_pressure=280.0, load_factor=2.5)
reference = partial(known, "case1")


def problem(**data: Any) -> Problem:
    """The case; for `data` see `statement.reentry`."""
    return reentry("reentry_case1", LIMITS, **data)
