"""What a result says of how it came about: what it cost, and which versions of what made it."""

from __future__ import annotations

import platform
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any

STATS: dict[str, Any] = {
    "evaluations": 0,
    "inner_iterations": 0,
    "gradient_solves": 0,
    "fallbacks": 0,
    "failures": {},
    "wall_time": 0.0,
    "seed": None,
    "tolerance": 1e-6,
    "reproducible": True,
}
"""What every front's `stats` hold, and `versions`."""

PACKAGES = ("macs-trajectories", "casadi", "numpy", "scipy")


@lru_cache(maxsize=1)
def _found() -> tuple[tuple[str, str], ...]:
    found = [("python", platform.python_version()), ("platform", f"{platform.system()} {platform.machine()}")]
    for package in PACKAGES:
        try:
            found.append((package, version(package)))
        except PackageNotFoundError:
            found.append((package, "unknown"))
    return tuple(found)


def versions() -> dict[str, str]:
    """Versions of Python, of this package and of those whose arithmetic its results depend on, by name."""
    return dict(_found())
