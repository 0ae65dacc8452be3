"""Inner solvers by name."""

from __future__ import annotations

from .base import InnerSolver
from .ipopt import Ipopt
from .levels import Auto
from .march import March

NAMED: dict[str, InnerSolver] = {
    "auto": Auto(),
    "march": March(),
    "ipopt": Ipopt(),
    "ipopt-feasibility": Ipopt(objective="constant"),
}


def inner_solver(inner: str | InnerSolver) -> InnerSolver:
    """An inner solver by name, or as it is given. Raises ValueError for an unknown name."""
    if isinstance(inner, InnerSolver):
        return inner
    if not isinstance(inner, str) or inner not in NAMED:
        raise ValueError(f"unknown inner level {inner!r}; there are {', '.join(NAMED)}")
    return NAMED[inner]
