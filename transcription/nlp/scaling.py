"""Scaling of nonlinear programs, their derivatives, and options of IPOPT."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from problems.derived import remembered

from ..base import INFEASIBLE, NLP, TIMEOUT
from .pieces import jacobian

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


DENSE = 0.25
"""Share of the variables that a row is dense with."""
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
    found = [gradients(nlp)(lower + rng.random(len(lower)) * (upper - lower)) for _ in range(SAMPLES)]
    slopes, values = np.array([np.array(one[0]) for one in found]), np.array([np.array(one[2]).ravel() for one in found])
    sizes = np.median(np.nan_to_num(np.abs(slopes) @ nlp.scale, posinf=0.0), axis=0)
    least = ROUNDING * np.median(np.nan_to_num(np.abs(values), posinf=0.0), axis=0)
    return np.where(sizes > least, sizes, 1.0)


@remembered
def _places(nlp: NLP) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the derivatives of g that may differ from 0."""
    i, j = gradients(nlp).sparsity_out(1).get_triplet()
    return np.array(i, dtype=int), np.array(j, dtype=int)


@remembered
def gradients(nlp: NLP) -> ca.Function:
    """z -> (dF/dz (m, n), dg/dz (r, n), both sparse, F, g)."""
    z = symbol(nlp, "z", len(nlp.variables))
    F, g = nlp.functions(z)
    return ca.Function("gradients", [z], [ca.jacobian(F, z), _jacobian(g, z), F, g], ["z"], ["dF", "dg", "F", "g"])


def _jacobian(rows: Any, z: Any) -> Any:
    """Derivatives of the rows; dense ones, those of integrals, apart: one sweep for many columns is lost where there is one such row."""
    counts = np.diff(ca.jacobian_sparsity(rows, z).T.colind())
    dense = np.flatnonzero(counts > DENSE * max(z.numel(), 1))
    if not len(dense) or len(dense) == len(counts):
        return jacobian(rows, z)
    sparse = np.setdiff1d(np.arange(len(counts)), dense)
    blocks = ca.vertcat(*(jacobian(rows[which.tolist()], z) for which in (sparse, dense)))
    return blocks[np.argsort(np.concatenate([sparse, dense])).tolist(), :]


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


def symbol(nlp: NLP, name: str, size: int) -> Any:
    """A column of symbols of the kind that the functions of an NLP are made of: derivatives of flat lists of scalar operations are best
    made, and fastest, as such lists; a Callback allows none."""
    return (ca.SX if nlp.functions.is_a("SXFunction") else ca.MX).sym(name, size)
