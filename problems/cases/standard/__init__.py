"""Well-known optimal control problems with complete data, and their published optima: `load("standard/bryson_denham")`.

The modules are kinds of problems: the best of `curves`, `smooth` controls, active state and mixed constraints in `paths`, bang-bang
(`switching`) and `singular` controls, several `phases`, `wild` ones that others asked about; three long statements have a module of their
own. They are no part of a problem's name. A problem is a function `NAME(**data) -> Problem` with its `@optimum` above it: that for the
default data first, then those for other data, if there are any. `published(NAME)` finds them, and `macs bench standard`, or `wild`,
compares them with ours. No transcription is named here. Where a statement has no bounds for a state or control, ours are so wide that they
do not act, except where its docstring says otherwise.
"""

from . import climb, curves, delta_iii, flight, low_thrust, paths, phases, singular, smooth, switching, wild
from .published import SHARE, PublishedOptimum, cases, published

__all__ = [
    "ASKED_ABOUT",
    "SHARE",
    "PublishedOptimum",
    "cases",
    "climb",
    "curves",
    "delta_iii",
    "flight",
    "low_thrust",
    "paths",
    "phases",
    "published",
    "singular",
    "smooth",
    "switching",
    "wild",
]
ASKED_ABOUT = tuple(name for name, (address, _) in cases().items() if address.startswith(f"{wild.__name__}:"))
"""Problems that others asked about."""
