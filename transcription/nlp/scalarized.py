"""Gradient solves of one Pareto point: every scalarisation of several objectives as one nonlinear program.

    minimise alpha   subject to   F_i(z) - reference_i <= alpha weights_i,   F_i(z) <= ceiling_i,   all rows and bounds of the NLP.

With positive weights this is Pascoletti and Serafini, "Scalarizing vector optimization problems", JOTA 42(4), 1984: from the reference
along the weights to the front. A weight of 0 makes the reference a hard limit, so that one positive weight is the epsilon-constraint
method; an infinite reference leaves an objective out, so that one positive weight and nothing else is plain minimisation. With the
objectives of a feasible point as the reference, alpha <= 0 means that none got worse than there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from problems.derived import remembered
from problems.peaks import refuse_peaks

from ..base import CONVERGED, FAILED, INFEASIBLE, NLP, TIMEOUT
from ..stopping import Stopped, check_stopping, stopping
from .scaling import STATUS_OF_IPOPT, back_in_bounds, ipopt_options, nlp_scales, origin, scaled_bounds, symbol
from .watched import Watched

ACCURACY = 1e-9
"""IPOPT's tolerance: what a certificate of optimality far below 1e-6 needs."""
PEAK_LIMIT = 3.0
"""Multiple of their scale, or of their value at the start, up to which peaks may rise: nothing else bounds those that are not minimised."""
AT_END, RESTARTS = 1e-2, 3
"""Distance, in widths of its box, at which an end of it counts as what stops a variable; most restarts for that."""
SOLVED = ("Solve_Succeeded", "Solved_To_Acceptable_Level")


@dataclass(frozen=True)
class _Strategy:
    """A strategy of IPOPT: its options, how far free variables may move in spans, whether alpha may not exceed the start's."""

    options: tuple[tuple[str, object], ...]
    radius: float = np.inf
    held: bool = False


ADAPTIVE = _Strategy((
    ("mu_strategy", "adaptive"),
    ("fast_step_computation", "yes"),
    ("mumps_scaling", 0),
    ("mumps_permuting_scaling", 0),
    ("mumps_pivot_order", 0),
))  # fmt: skip
"""Few iterations from good points and poor ones, and cheap ones: what is scaled already needs neither scaling nor refinement."""
NEAR = _Strategy(
    (("mu_init", 1e-4), ("bound_push", 1e-4), ("bound_frac", 1e-4), ("slack_bound_push", 1e-4), ("slack_bound_frac", 1e-4)),
    radius=0.1,
    held=True,
)
"""Stays in the basin of a feasible start."""
SLOW = _Strategy((("mu_init", 0.1),))
"""IPOPT as it comes."""


@dataclass(frozen=True, eq=False, repr=False)
class Solved:
    """The result of one solve.

    Attributes
    ----------
    z : array (n,)
        The vector that was found, within its bounds, periodic variables wrapped; the start where nothing was.
    F : array (m,)
        Objectives there, all minimised.
    violation : float
        Largest scaled residual of the NLP there; infinite where it is no number.
    status : str
        "converged" (a local optimum, and feasible by `NLP.evaluate` and within all limits), "infeasible", "failed" or "timeout".
    iterations : int
        Of IPOPT.
    clocked : bool
        Whether a clock ended any of the work: then the same solve need not give the same again.
    begun : bool
        False if there was no solve: the work was to end before.
    """

    z: np.ndarray
    F: np.ndarray
    violation: float
    status: str
    iterations: int
    clocked: bool = False
    begun: bool = True

    def __repr__(self) -> str:
        return f"Solved({self.status}, F={self.F}, violation={self.violation:.1e}, iterations={self.iterations})"


@dataclass(frozen=True)
class _Settings:
    """The settings of a program."""

    tolerance: float
    max_iterations: int
    seconds: float


@dataclass(frozen=True, eq=False)
class _Task:
    """One scalarisation in numbers near one.

    Row i is (F_i - shift_i) / scale_i <= slope_i a, with a = 0 at the start; (F_i - shift_i) / scale_i <= top_i is its hard limit. The rows
    of the NLP are between lower and upper.
    """

    shift: np.ndarray
    scale: np.ndarray
    slope: np.ndarray
    used: np.ndarray
    top: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    def value(self, F: np.ndarray) -> float:
        """The least a that F (m,) allows."""
        moving = self.slope > 0
        return float(np.max((F - self.shift)[moving] / (self.scale * self.slope)[moving]))

    def excess(self, F: np.ndarray) -> float:
        """The amount by which F (m,) exceeds hard limits, in scales."""
        over = (F - self.shift) / self.scale
        hard = self.used & (self.slope == 0)
        return float(np.fmax(over - self.top, np.where(hard, over, -np.inf)).max(initial=0.0))


def scalarize(
    nlp: NLP,
    start: np.ndarray,
    *,
    reference: np.ndarray,
    weights: np.ndarray,
    ceiling: np.ndarray | None = None,
    margin: np.ndarray | None = None,
    tolerance: float = 1e-6,
    max_iterations: int = 500,
    seconds: float = 60.0,
    persistent: bool = True,
) -> Solved:
    """Go down from a point to the front: least alpha with F - reference <= alpha weights.

    Parameters
    ----------
    nlp : NLP
    start : array (n,)
        A full vector; its states need not obey the dynamics. From a point near the answer the solve takes a few iterations.
    reference, weights : arrays (m,)
        For minimised objectives. Weights are not negative, and are what counts as much in each objective; weight 0: a hard limit at the
        reference. Reference +inf: the objective does not matter.
    ceiling : array (m,), optional
        Hard limits of the objectives beside; +inf for none.
    margin : array (r,), optional
        By how much, in their scales, rows of the NLP are to stay inside their limits; where these are too near to each other for that, in
        the middle. Default: not at all.
    tolerance : float
        Largest scaled residual of a feasible point.
    max_iterations, seconds : int, float
        Limits of IPOPT. The time is a safety net: what it ends is not reproducible.
    persistent : bool
        Try another way where the first reached the limit of iterations. It is always tried where the first ended badly before.

    Returns
    -------
    Solved
        A local optimum. It may be worse than a feasible start: where that matters, compare, or give the start's objectives as ceiling. The
        start itself, with status "timeout" and not begun, if the work is to end early (`stopping`).

    Raises
    ------
    ValueError
        If shapes do not match, a weight is negative or none that matters is positive, the start is no number, or a peak is used otherwise
        than minimised or bounded above.
    """
    start = back_in_bounds(nlp, np.asarray(start, dtype=float)) if np.shape(start) == nlp.lower.shape else start
    if stopping():
        return _not_begun(nlp, start)
    task = _task(nlp, start, reference, weights, ceiling, margin)
    settings = _Settings(float(tolerance), int(max_iterations), float(seconds))
    F, violation = nlp.evaluate(start[None])
    # With a margin, a start that misses it is not to be kept.
    feasible = margin is None and violation[0] <= tolerance and task.excess(F[0]) <= tolerance
    first = _unstuck(nlp, task, start, settings, ADAPTIVE)
    worse = feasible and task.value(first.F) > tolerance
    tired = first.iterations >= max_iterations and not persistent
    if first.clocked or tired or (first.status == CONVERGED and not worse):
        return first
    second = _unstuck(nlp, task, start, settings, NEAR if feasible else SLOW)
    best = min((first, second), key=lambda solved: (solved.status != CONVERGED, _rank(task, solved, tolerance)))
    return replace(best, iterations=first.iterations + second.iterations, clocked=second.clocked)


def _not_begun(nlp: NLP, start: np.ndarray) -> Solved:
    """The start itself, where the work is to end before IPOPT begins."""
    F, violation = nlp.evaluate(start[None])
    return Solved(start, F[0], float(violation[0]), TIMEOUT, 0, clocked=True, begun=False)


def _task(
    nlp: NLP, start: np.ndarray, reference: np.ndarray, weights: np.ndarray, ceiling: np.ndarray | None, margin: np.ndarray | None
) -> _Task:
    n, m, r = len(nlp.variables), len(nlp.problem.goals), len(nlp.g_scale)
    limits = np.full(m, np.inf) if ceiling is None else np.asarray(ceiling, dtype=float)
    inside = np.zeros(r) if margin is None else np.asarray(margin, dtype=float)
    reference, weights = np.asarray(reference, dtype=float), np.asarray(weights, dtype=float)
    given = (("start", start, n), ("reference", reference, m), ("weights", weights, m), ("ceiling", limits, m), ("margin", inside, r))
    for name, value, size in given:
        if np.shape(value) != (size,) or np.isnan(value).any():
            raise ValueError(f"scalarize: {name} must be {size} numbers, not {value!r}")
    if not (inside >= 0).all():
        raise ValueError(f"scalarize: margin must not be negative, not {inside.min():g}")
    used = reference < np.inf
    moving = used & (weights > 0)
    if not (np.isfinite(weights) & (weights >= 0)).all() or not moving.any() or not np.isfinite(reference[used]).all():
        raise ValueError(
            f"scalarize: weights must not be negative, and one with a finite reference positive, not {weights} for {reference}"
        )
    F = nlp.evaluate(start[None])[0][0]
    F = np.where(np.isfinite(F), F, np.where(used, reference, 0.0))
    # alpha is measured from the start's, in the scales of the objectives: digits are kept wherever the reference is.
    alpha = np.max((F[moving] - reference[moving]) / weights[moving])
    shift = np.where(used, np.where(used, reference, 0.0) + alpha * weights, F)
    scale = nlp_scales(nlp)
    slope = np.where(moving, weights, 0.0) / scale
    lower, upper = nlp.g_lower / nlp.g_scale, nlp.g_upper / nlp.g_scale
    inside = np.minimum(inside, 0.5 * (upper - lower))
    return _Task(shift, scale, slope / slope.max(), used, (limits - shift) / scale, lower + inside, upper - inside)


def _unstuck(nlp: NLP, task: _Task, start: np.ndarray, settings: _Settings, strategy: _Strategy) -> Solved:
    """A run of IPOPT, and more from where it stopped, as long as that is an end of a box that the problem does not have."""
    iterations = 0
    for _ in range(RESTARTS + 1):
        solved, stuck = _attempt(nlp, task, start, settings, strategy)
        iterations += solved.iterations
        if not stuck or solved.clocked:
            break
        start = solved.z
    if stuck and solved.status == CONVERGED:
        solved = replace(solved, status=FAILED)
    return replace(solved, iterations=iterations)


def _attempt(nlp: NLP, task: _Task, start: np.ndarray, settings: _Settings, strategy: _Strategy) -> tuple[Solved, bool]:
    """One run of IPOPT, and whether it stopped at an end of a box that the problem does not have."""
    tolerance = settings.tolerance
    try:
        solver = _program(nlp, settings, strategy.options)
    except Stopped:
        return _not_begun(nlp, start), False
    y = np.clip((start - origin(nlp)) / nlp.scale, *scaled_bounds(nlp))
    lower, upper, made_up = _box(nlp, y, strategy.radius)
    none = np.full(2 * len(task.used), -np.inf)
    answer = solver(
        x0=np.append(y, 0.0),
        p=np.concatenate([task.shift, 1.0 / task.scale, task.slope]),
        lbx=np.append(lower, -np.inf),
        ubx=np.append(upper, 0.0 if strategy.held else np.inf),
        lbg=np.concatenate([task.lower, none]),
        ubg=np.concatenate([task.upper, np.where(task.used, 0.0, np.inf), task.top]),
    )
    stats = solver.stats()
    outcome, iterations = stats["return_status"], int(stats["iter_count"])
    y = np.array(answer["x"]).ravel()[:-1]
    stuck = bool((made_up & (np.stack([y - lower, upper - y]) < AT_END * np.where(made_up, upper - lower, 0.0))).any())
    z = nlp.tighten(back_in_bounds(nlp, origin(nlp) + y * nlp.scale)[None])[0]
    F, violation = nlp.evaluate(z[None])
    status = STATUS_OF_IPOPT.get(outcome, FAILED)
    if not (np.isfinite(F).all() and np.isfinite(violation[0])):
        z, status = start, FAILED
        F, violation = nlp.evaluate(z[None])
    elif outcome in SOLVED:
        status = CONVERGED if violation[0] <= tolerance and task.excess(F[0]) <= tolerance else INFEASIBLE
    return Solved(z, F[0], float(violation[0]), status, iterations, STATUS_OF_IPOPT.get(outcome) == TIMEOUT), stuck


def _box(nlp: NLP, y: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bounds of the scaled variables around y, (n,) each, and which of them the problem does not have, (2, n)."""
    lower, upper = scaled_bounds(nlp)
    upper = np.where(np.isinf(upper), PEAK_LIMIT * np.maximum(1.0, np.abs(y)), upper)
    reach = np.full(len(y), np.inf)
    reach[nlp.free] = radius * (nlp.span / nlp.scale)[nlp.free]
    low, high = np.maximum(lower, y - reach), np.minimum(upper, y + reach)
    return low, high, np.stack([low > lower, high < upper]) | (nlp.period > 0)


def _rank(task: _Task, solved: Solved, tolerance: float) -> tuple[float, float]:
    """Feasible before infeasible, by what they miss; then by alpha."""
    missed = max(solved.violation, task.excess(solved.F))
    value = task.value(solved.F)
    return (missed if missed > tolerance else 0.0, value if np.isfinite(value) else np.inf)


@remembered
def _program(nlp: NLP, settings: _Settings, strategy: tuple[tuple[str, object], ...]) -> Watched:
    """The program of `_parts` for IPOPT, with these settings and options."""
    parts, derivatives = _parts(nlp)
    options = ipopt_options(settings.seconds, settings.max_iterations) | {
        "ipopt.tol": ACCURACY,
        "ipopt.acceptable_tol": 100 * ACCURACY,
        "ipopt.constr_viol_tol": min(1e-8, 0.1 * settings.tolerance),
        "ipopt.nlp_scaling_method": "none",
        "ipopt.bound_relax_factor": 0.0,
    }
    return Watched("scalarized", parts, options | derivatives | {f"ipopt.{name}": value for name, value in strategy})


@remembered
def _parts(nlp: NLP) -> tuple[dict[str, Any], dict[str, ca.Function]]:
    """The program in x = (y, a), y the scaled variables, and its derivatives; its parameters are shift, 1 / scale and slope of `_Task`."""
    refuse_peaks(nlp.problem)
    n, m = len(nlp.variables), len(nlp.problem.goals)
    x, p = symbol(nlp, "x", n + 1), symbol(nlp, "p", 3 * m)
    shift, inverse, slope = ca.vertsplit(p, m)
    F, g = nlp.functions(origin(nlp) + x[:n] * nlp.scale)
    above = (F - shift) * inverse
    blocks = g / nlp.g_scale, above - x[n] * slope, above
    rows = ca.vertcat(*blocks)
    # Block by block: a row of an integral is dense, and one sweep for many columns is lost where there is such a row among sparse ones.
    jacobian = ca.Function("jac_g", [x, p], [rows, ca.vertcat(*(ca.jacobian(block, x) for block in blocks))], ["x", "p"], ["g", "jac_g_x"])
    check_stopping()
    lam_f, lam_g = symbol(nlp, "lam_f", 1), symbol(nlp, "lam_g", rows.numel())
    # The objective is linear.
    curvature = ca.triu(ca.hessian(ca.dot(lam_g, rows), x)[0])
    hessian = ca.Function("hess_lag", [x, p, lam_f, lam_g], [curvature], ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"])
    return {"x": x, "p": p, "f": x[n], "g": rows}, {"jac_g": jacobian, "hess_lag": hessian}
