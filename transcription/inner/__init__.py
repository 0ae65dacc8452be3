"""The inner level: candidate -> nearest feasible point, status, distance moved."""

from __future__ import annotations

from .auto import Auto
from .base import InnerResult, InnerSolver
from .ipopt import Ipopt
from .march import March

NAMED = {"auto": Auto(), "march": March(), "ipopt": Ipopt(), "ipopt-feasibility": Ipopt(objective="constant")}


def inner_solver(inner: str | InnerSolver) -> InnerSolver:
    """An inner solver by name, or as it is given. Raises ValueError for an unknown name."""
    if isinstance(inner, InnerSolver):
        return inner
    if not isinstance(inner, str) or inner not in NAMED:
        raise ValueError(f"unknown inner level {inner!r}; there are {', '.join(NAMED)}")
    return NAMED[inner]


__all__ = ["Auto", "InnerResult", "InnerSolver", "Ipopt", "March", "inner_solver"]
