"""What the nonlinear programs of this floor share: variables in units of their scales, and a silent IPOPT."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base import NLP

CONVERGED, INFEASIBLE, FAILED, TIMEOUT = "converged", "infeasible", "failed", "timeout"

SAID = {
    "Infeasible_Problem_Detected": INFEASIBLE,
    "Maximum_CpuTime_Exceeded": TIMEOUT,
    "Maximum_WallTime_Exceeded": TIMEOUT,
}
"""What IPOPT's last words mean, where they say more than that it failed."""


def quiet(seconds: float, max_iterations: int) -> dict[str, Any]:
    """Options of a CasADi `nlpsol` with IPOPT that prints nothing, raises nothing and ends in time."""
    return {
        "print_time": False,
        "error_on_fail": False,
        "record_time": False,
        "show_eval_warnings": False,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "ipopt.max_iter": max_iterations,
        "ipopt.max_wall_time": seconds,
    }


def origin(nlp: NLP) -> np.ndarray:
    """Where y = (z - origin) / scale is 0, (n,): the lower bounds, so that a narrow range far from zero keeps its digits."""
    return np.where(np.isfinite(nlp.lower), nlp.lower, 0.0)


def scaled_bounds(nlp: NLP) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of y, (n,) each. Periodic variables get one more period on either side, so that a bound never stops them."""
    start = origin(nlp)
    return (nlp.lower - nlp.period - start) / nlp.scale, (nlp.upper + nlp.period - start) / nlp.scale


def back_in_bounds(nlp: NLP, z: np.ndarray) -> np.ndarray:
    """A vector (n,) within its bounds: periodic variables wrapped, the others clipped."""
    out = np.flatnonzero((nlp.period > 0) & ((z < nlp.lower) | (z > nlp.upper)))
    z = z.copy()
    z[out] = nlp.lower[out] + np.mod(z[out] - nlp.lower[out], nlp.period[out])
    return np.clip(z, nlp.lower, nlp.upper)
