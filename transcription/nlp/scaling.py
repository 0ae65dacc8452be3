"""Scaling of nonlinear programs, and options of IPOPT."""

from __future__ import annotations

from typing import Any

import numpy as np

from problems.compiled import remembered

from ..base import INFEASIBLE, NLP, TIMEOUT
from .derivatives import gradients, objective_gradients

STATUS_OF_IPOPT = {
    "Infeasible_Problem_Detected": INFEASIBLE,
    "Maximum_CpuTime_Exceeded": TIMEOUT,
    "Maximum_WallTime_Exceeded": TIMEOUT,
    "User_Requested_Stop": TIMEOUT,
}
"""The status that a return status of IPOPT means, where it is not just a failure."""


def ipopt_options(seconds: float, max_iterations: int) -> dict[str, Any]:
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
    """The origin (n,) of y = (z - origin) / scale: the lower bounds, so that a narrow range far from zero keeps its digits."""
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


SAMPLES = 31
"""Number of places where the slopes of objectives are evaluated for their scales."""
ROUNDING = 1e-12
"""An objective that changes by less than this part of its size is constant: its slopes are rounding errors."""


@remembered
def nlp_scales(nlp: NLP) -> np.ndarray:
    """The scales of the objectives (m,) where the front is not known: its change, to first order, if all variables moved by
    their scales; the median over the box, 1 where that is 0 or rounding.
    """
    rng = np.random.default_rng(0)
    lower, upper = np.where(np.isfinite(nlp.lower), nlp.lower, 0.0), np.where(np.isfinite(nlp.upper), nlp.upper, nlp.scale)
    Z = lower + rng.random((SAMPLES, len(lower))) * (upper - lower)
    slopes = np.array(objective_gradients(nlp)(Z.T)).reshape(-1, SAMPLES, len(lower))
    sizes = np.median(np.nan_to_num(np.abs(slopes) @ nlp.scale, posinf=0.0), axis=1)
    least = ROUNDING * np.median(np.nan_to_num(np.abs(nlp.evaluate(Z)[0]), posinf=0.0), axis=0)
    return np.where(sizes > least, sizes, 1.0)


@remembered
def _places(nlp: NLP) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the derivatives of g that may differ from 0."""
    i, j = gradients(nlp).sparsity_out(1).get_triplet()
    return np.array(i, dtype=int), np.array(j, dtype=int)


ROUNDS = 5
"""Of equilibration."""
LEAST_SCALE, ROW_SCALES = 1e-3, (1e-3, 1e2)
"""How small the scale of a variable may become, and how small or large that of a row, in their own."""


def equilibrated(nlp: NLP, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Scales of the variables (n,) and of the rows (r,) by which the largest derivative in each row and each column is near one at z.

    Ruiz, "A scaling algorithm to equilibrate both rows and columns norms in matrices", RAL-TR-2001-034. Bounds may be much wider than what
    a variable does: its scale may become less than its own, never more.
    """
    sizes = np.abs(np.array(gradients(nlp)(z)[1].nonzeros()))
    sizes[~np.isfinite(sizes)] = 0.0
    i, j = _places(nlp)
    columns, rows = nlp.scale.copy(), nlp.g_scale.copy()
    for _ in range(ROUNDS):
        for scales, index, power in ((rows, i, 0.5), (columns, j, -0.5)):
            largest = np.zeros(len(scales))
            np.maximum.at(largest, index, sizes * columns[j] / rows[i])
            scales *= np.where(largest > 0, largest, 1.0) ** power
    columns = np.clip(columns, LEAST_SCALE * nlp.scale, nlp.scale)
    return columns, np.clip(rows, ROW_SCALES[0] * nlp.g_scale, ROW_SCALES[1] * nlp.g_scale)
