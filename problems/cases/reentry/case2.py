"""The re-entry within narrow limits; see `statement`."""

from __future__ import annotations

from functools import partial
from typing import Any

from ...problem import Problem
from .figures import plot, track
from .statement import REFERENCE, Limits, known, reentry

__all__ = ["LIMITS", "REFERENCE", "plot", "problem", "reference", "track"]

LIMITS = Limits(heating_rate=150.0, dynamic_pressure=250.0, load_factor=1.25)
reference = partial(known, "case2")


def problem(**data: Any) -> Problem:
    """The case; for `data` see `statement.reentry`."""
    return reentry("reentry_case2", LIMITS, **data)
