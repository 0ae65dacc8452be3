"""The re-entry within wide limits, around three no-fly zones; see `statement`.

Every feasible flight passes south of all three, as far as gradients can tell: for one that passes north of the first, this zone would have
to lie 6.3 degrees farther south; of the second, south of the first, 1.5 degrees; of the third, south of both others, 8.0 degrees.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from ...problem import Problem
from . import figures
from .case1 import LIMITS
from .figures import track
from .statement import REFERENCE, Zone, known, reentry

__all__ = ["LIMITS", "REFERENCE", "ZONES", "plot", "problem", "reference", "track"]

ZONES = (Zone(30.0, 7.5, 5.0), Zone(60.0, 15.0, 5.0), Zone(70.0, 20.0, 5.0))
plot = partial(figures.plot, zones=ZONES)
reference = partial(known, "case3")


def problem(**data: Any) -> Problem:
    """The case; for `data` see `statement.reentry`."""
    return reentry("reentry_case3", LIMITS, ZONES, **data)
