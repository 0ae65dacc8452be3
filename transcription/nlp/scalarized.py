"""Gradient solves of one Pareto point: every scalarisation of several objectives as one nonlinear program.

    minimise alpha   subject to   F_i(z) - reference_i <= alpha weights_i,   F_i(z) <= ceiling_i,   all rows and bounds of the NLP.

With positive weights this is Pascoletti and Serafini, "Scalarizing vector optimization problems", JOTA 42(4), 1984: from the reference
along the weights to the front. A weight of 0 makes the reference a hard limit, so that one positive weight is the epsilon-constraint
method; an infinite reference leaves an objective out, so that one positive weight and nothing else is plain minimisation. With the
objectives of a feasible point as the reference, alpha <= 0 means that none is worse than at this point.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base import CONVERGED, FAILED, INFEASIBLE, NLP, TIMEOUT
from ..stopping import Stopped, stopping
from .derivatives import convex_objectives
from .optimality import Multipliers, optimality
from .program import (
    STATUS_OF_IPOPT,
    Options,
    Watched,
    back_in_bounds,
    equilibrated,
    gradients,
    nlp_scales,
    origin,
    program_parameters,
    solver,
)

AT_LIMIT = "maximum iterations exceeded"
IN_BOX = "it stopped at ends of the boxes around where it began"
"""Message of a solve that could have gone on."""
SOLVED = ("Solve_Succeeded", "Solved_To_Acceptable_Level")


@dataclass(frozen=True)
class SolveNumbers:
    """Constants of a gradient solve, measured on the standard problems and the re-entries."""

    accuracy: float = 1e-9  # IPOPT's tolerance: what a certificate of optimality far below 1e-6 needs
    # Multiple of their scale, or of their value at the start, up to which peaks may rise: nothing else bounds those not minimised.
    peak_limit: float = 3.0
    # Part of the tolerance by which bounds of states, and rows that are no equalities, give way: where a trajectory begins or ends on one,
    # or runs along it, nothing is strictly inside, multipliers have no limit, and an interior point method does not converge.
    slack: float = 1e-2
    restarts: int = 3  # from where a variable was stopped by an end of its box
    # Residual of the conditions of optimality up to which a feasible vector is a solution, however its solve ended: in the objective's own
    # size, how much of it could be gained over a whole span of the variables.
    useful: float = 1e-4
    # Multiple of what counts as one unit of an objective at the start, and of 1, from which on its usual scale is that of an explosion
    # somewhere in the box: in it the objective would be nothing.
    absurd: float = 1e12
    least_iterations: int = 100  # for which a strategy is worth beginning, if there may be as many


SOLVE = SolveNumbers()


@dataclass(frozen=True)
class _Strategy:
    """A strategy of IPOPT and its limits."""

    options: Options
    share: float  # of the iterations
    radius: float = np.inf  # how far free variables may move, in spans
    held: bool = False  # whether alpha may not exceed the start's
    equilibrated: bool = True  # whether variables and rows are


COMMON: Options = (
    ("tol", SOLVE.accuracy),
    ("acceptable_tol", 100 * SOLVE.accuracy),
    ("nlp_scaling_method", "none"),
    ("bound_relax_factor", 0.0),
    ("fast_step_computation", "yes"),
    ("mumps_permuting_scaling", 0),
    ("mumps_pivot_order", 0),
)
"""Options of all strategies: what is scaled already needs neither scaling nor refinement."""
ADAPTIVE = _Strategy((("mu_strategy", "adaptive"),), share=0.24)
"""Few iterations from good points and poor ones, where it works at all."""
NEAR = _Strategy(
    (("mu_init", 1e-4), ("bound_push", 1e-4), ("bound_frac", 1e-4), ("slack_bound_push", 1e-4), ("slack_bound_frac", 1e-4)),
    share=0.3,
    radius=0.1,
    held=True,
)
"""Stays in the basin of a feasible start."""
INSIDE = _Strategy(NEAR.options, share=0.3)
"""From the optimum of almost the same: little has to change."""
WARMED: Options = (("warm_start_init_point", "yes"), ("mu_strategy", "adaptive"), ("mu_init", 1e-8))
MOVED = ("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac", "mult_bound_push")
"""What IPOPT would move away from limits before a warm start."""
WARM = _Strategy((*WARMED, *((f"warm_start_{what}", SOLVE.accuracy) for what in MOVED)), share=0.2)
"""From a vector with its multipliers: both are nearly those of the optimum."""
UNSCALED = _Strategy((("mu_strategy", "adaptive"),), share=0.3, equilibrated=False)
"""In the scales of the problem, where the derivatives at the start say little about those at the optimum."""
MONOTONE = _Strategy((("mu_init", 0.1),), share=0.46)
"""A barrier that only falls: slower, and not misled by constraints of which many are active at once."""


@dataclass(frozen=True, eq=False, repr=False)
class Solved:
    """The result of one solve."""

    z: np.ndarray  # (n,): The vector that was found, within its bounds, periodic variables wrapped; the start where nothing was
    F: np.ndarray  # (m,): Objectives there, all minimised
    violation: float  # largest scaled residual of the NLP there; infinite where it is no number
    status: str  # "converged" (a local optimum, and feasible by `NLP.evaluate` and within all limits), "infeasible", "failed" or "timeout"
    iterations: int  # of IPOPT, by all strategies together
    clocked: bool = False  # whether a clock ended any of the work: then the same solve need not give the same again
    begun: bool = True  # false if there was no solve: the work was to end before
    # Why the solve ended where it did not converge by itself, never empty then: the limit that was reached, or what IPOPT says.
    message: str = ""
    multipliers: Multipliers | None = None  # None where nothing was solved

    def __repr__(self) -> str:
        return f"Solved({self.status}, F={self.F}, violation={self.violation:.1e}, iterations={self.iterations})"


@dataclass(frozen=True)
class _Settings:
    """The settings of a program."""

    tolerance: float
    max_iterations: int
    seconds: float
    scaled: bool  # whether MUMPS scales its matrices
    held: np.ndarray  # which variables keep their values
    warm: Multipliers | None  # to begin with


@dataclass(frozen=True, eq=False)
class _Task:
    """One scalarisation in numbers near one.

    Row i is (F_i - shift_i) / scale_i <= slope_i a, with a = 0 at the start; (F_i - shift_i) / scale_i <= top_i is its hard limit. The rows
    of the NLP are between lower and upper. If they are `summed`, one row is the sum of slope_i (F_i - shift_i) / scale_i <= a instead.
    """

    shift: np.ndarray
    scale: np.ndarray
    slope: np.ndarray
    used: np.ndarray
    top: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    summed: bool

    @property
    def limited(self) -> bool:
        """Whether objectives have hard limits."""
        return bool(np.isfinite(self.top).any() or self.hard.any())

    @property
    def hard(self) -> np.ndarray:
        """Mask (m,) of the objectives with one, at a = 0."""
        return self.used & (self.slope == 0) & ~self.summed

    def value(self, F: np.ndarray) -> float:
        """The least a that F (m,) allows."""
        moving = self.slope > 0
        above = (F - self.shift)[moving] / self.scale[moving]
        return float(above @ self.slope[moving] if self.summed else np.max(above / self.slope[moving]))

    def excess(self, F: np.ndarray) -> float:
        """The amount by which F (m,) exceeds hard limits, in scales."""
        over = (F - self.shift) / self.scale
        return float(np.fmax(over - self.top, np.where(self.hard, over, -np.inf)).max(initial=0.0))


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
    seconds: float = 600.0,
    persistent: bool = True,
    near: bool = False,
    held: Sequence[int] | np.ndarray = (),
    summed: bool = False,
    warm: Multipliers | None = None,
) -> Solved:
    """Descend from a start (n,) to the front: least alpha with F - reference <= alpha weights (m,); ceiling (m,), margin (r,). The
    variables `held`, and whole numbers, keep the start's values. `summed`: the least weighted sum of the objectives instead. `warm`:
    multipliers that are nearly those of the result."""
    start = back_in_bounds(nlp, start)
    if stopping():
        return not_begun(nlp, start)
    try:
        task = _task(nlp, start, reference, weights, ceiling, margin, summed=summed)
    except Stopped:  # while derivatives were built
        return not_begun(nlp, start)
    if not np.isfinite(start).all():  # a peak of what is infinite there; IPOPT would not begin
        return replace(not_begun(nlp, start), status=FAILED, clocked=False)
    F, violation = nlp.evaluate(start[None])
    # With a margin, a start that misses it is not to be kept.
    feasible = margin is None and violation[0] <= tolerance and task.excess(F[0]) <= tolerance
    drawn, several = not (persistent or feasible or near), np.count_nonzero(task.used) > 1
    # Scaling by MUMPS takes some per cent of an iteration. Where limits of objectives leave nothing strictly inside, from feasible starts
    # for several objectives, from starts that are drawn, and where all but times is linear, so that optima lie in corners, iterations
    # without may take many times as long: 30 times on the skip entry, 100 times on a row of masses.
    scaled = task.limited or drawn or (feasible and several) or convex_objectives(nlp).all()
    kept = np.union1d(held, nlp.integers).astype(int)
    settings = _Settings(float(tolerance), int(max_iterations), float(seconds), bool(scaled), kept, warm)
    found: list[Solved] = []
    nearby = (INSIDE,) if warm is None else (WARM, INSIDE)
    for strategy in nearby if near else _strategies(feasible, margin is not None):
        left = max_iterations - sum(solved.iterations for solved in found)
        least = min(SOLVE.least_iterations, max_iterations)
        share = max(least, int(strategy.share * max_iterations)) if found or persistent else max_iterations
        if left < min(least, share):
            break
        # What is feasible and ran out of iterations, or of its box, goes on, scaled anew.
        unended = (IN_BOX,) if feasible else (IN_BOX, AT_LIMIT)
        going = [solved.z for solved in found if solved.message in unended and _rank(task, solved, tolerance)[0] == 0.0]
        found.append(_unstuck(nlp, task, going[-1] if going else start, replace(settings, max_iterations=min(share, left)), strategy))
        worse = feasible and task.value(found[-1].F) > tolerance
        if found[-1].clocked or (found[-1].status == CONVERGED and not worse):
            break
    best = min(found, key=lambda solved: (solved.status != CONVERGED, _rank(task, solved, tolerance)))
    iterations = sum(solved.iterations for solved in found)
    ended = best.status != CONVERGED and found[-1].message == AT_LIMIT
    message = f"the limit of {max_iterations} iterations was reached" if ended else best.message
    if best.status in (FAILED, INFEASIBLE) and len(task.used) == 1 and max(best.violation, task.excess(best.F)) <= tolerance:
        # Of several objectives, the certificate would not know which was asked for.
        residual = optimality(nlp, best.z, _own_scales(nlp, best.z, best.F))
        if residual <= SOLVE.useful:
            best, message = replace(best, status=CONVERGED), f"{message}; the conditions of optimality hold to {residual:.0e}"
    return replace(best, iterations=iterations, clocked=found[-1].clocked, message=message)


def _strategies(feasible: bool, tightened: bool) -> tuple[_Strategy, ...]:
    """The strategies in their order, from a start that is feasible or not, or that only misses margins."""
    return (INSIDE, ADAPTIVE, MONOTONE) if tightened else (ADAPTIVE, NEAR if feasible else UNSCALED, MONOTONE)


def _own_scales(nlp: NLP, z: np.ndarray, F: np.ndarray) -> np.ndarray:
    """Units of objectives (m,) at a vector: their size, 1e-4 of their change where near zero, no more than usual."""
    usual = nlp_scales(nlp)
    change = np.abs(np.nan_to_num(np.array(gradients(nlp)(z)[0]))) @ nlp.scale
    own = np.maximum(np.abs(F), 1e-4 * change)
    return np.minimum(usual, np.where(own > 0, own, usual))


def not_begun(nlp: NLP, start: np.ndarray) -> Solved:
    """The start itself, where the work is to end before IPOPT begins."""
    F, violation = nlp.evaluate(start[None])
    return Solved(start, F[0], float(violation[0]), TIMEOUT, 0, clocked=True, begun=False, message="it was not begun")


def _task(nlp: NLP, start: np.ndarray, reference: np.ndarray, weights: np.ndarray, *limits: np.ndarray | None, summed: bool) -> _Task:
    """limits: ceiling (m,), margin (r,)."""
    ceiling, margin = limits
    top = np.full(len(reference), np.inf) if ceiling is None else ceiling
    inside = np.zeros(len(nlp.g_scale)) if margin is None else margin
    used = reference < np.inf
    moving = used & (weights > 0)
    F = nlp.evaluate(start[None])[0][0]
    F = np.where(np.isfinite(F), F, np.where(used, reference, 0.0))
    # alpha is measured from the start's, in the scales of the objectives: digits are kept wherever the reference is.
    alpha = np.max((F[moving] - reference[moving]) / weights[moving])
    shift = F if summed else np.where(used, np.where(used, reference, 0.0) + alpha * weights, F)
    scale = nlp_scales(nlp)
    if (scale > SOLVE.absurd).any():
        own = _own_scales(nlp, start, F)
        scale = np.where(scale > SOLVE.absurd * np.maximum(own, 1.0), own, scale)
    slope = np.where(moving, weights, 0.0) * (scale if summed else 1.0 / scale)
    lower, upper = nlp.g_lower / nlp.g_scale, nlp.g_upper / nlp.g_scale
    inside = np.minimum(inside, 0.5 * (upper - lower))
    return _Task(shift, scale, slope / slope.max(), used, (top - shift) / scale, lower + inside, upper - inside, summed)


def _unstuck(nlp: NLP, task: _Task, start: np.ndarray, settings: _Settings, strategy: _Strategy) -> Solved:
    """Runs of IPOPT, each from the last point of the one before, as long as that lies on an artificial bound of the box."""
    iterations = 0
    for _ in range(SOLVE.restarts + 1):
        solved, stuck = _attempt(nlp, task, start, settings, strategy)
        iterations += solved.iterations
        if not stuck or solved.clocked or iterations >= settings.max_iterations:
            break
        start = solved.z
    if stuck and solved.status == CONVERGED:
        solved = replace(solved, status=FAILED, message=IN_BOX)
    return replace(solved, iterations=iterations)


def _attempt(nlp: NLP, task: _Task, start: np.ndarray, settings: _Settings, strategy: _Strategy) -> tuple[Solved, bool]:
    """One run of IPOPT, and whether it stopped on an artificial bound of the box."""
    tolerance = settings.tolerance
    options = (*COMMON, ("mumps_scaling", 77 if settings.scaled else 0), ("constr_viol_tol", min(1e-8, 0.1 * tolerance)), *strategy.options)
    try:
        columns, rows = equilibrated(nlp, start) if strategy.equilibrated else (nlp.scale, nlp.g_scale)
        run = solver(nlp, settings.seconds, settings.max_iterations, options, task.summed)
    except Stopped:
        return not_begun(nlp, start), False
    lower, upper, made_up = _box(nlp, start, strategy.radius)
    lower[settings.held], upper[settings.held], made_up[:, settings.held] = start[settings.held], start[settings.held], False
    slack = min(1e-8, SOLVE.slack * tolerance)
    states = np.where(made_up, 0.0, slack * nlp.scale)
    states[:, nlp.free] = 0.0
    ways = np.where(nlp.g_lower < nlp.g_upper, slack, 0.0)
    used = np.ones(1, dtype=bool) if task.summed else task.used
    none, zero = np.full(len(used) + len(task.top), -np.inf), origin(nlp)
    to_rows = nlp.g_scale / rows
    begun = {} if strategy is not WARM or settings.warm is None else _multipliers(task, settings.warm, columns, rows)
    answer = run(
        x0=np.append((np.clip(start, lower, upper) - zero) / columns, 0.0),
        p=program_parameters(task.shift, 1.0 / task.scale, task.slope, columns, rows),
        lbx=np.append((lower - states[0] - zero) / columns, -np.inf),
        ubx=np.append((upper + states[1] - zero) / columns, 0.0 if strategy.held else np.inf),
        lbg=np.concatenate([(task.lower - ways) * to_rows, none]),
        ubg=np.concatenate([(task.upper + ways) * to_rows, np.where(used, 0.0, np.inf), task.top]),
        **begun,
    )
    z = zero + np.array(answer["x"]).ravel()[:-1] * columns
    # An end of the box that is nearer than a hundredth of its width is what stopped a variable.
    stuck = bool((made_up & (np.stack([z - lower, upper - z]) < 0.01 * np.where(made_up, upper - lower, 0.0))).any())
    solved, done = ended(nlp, run, z, start, settings.max_iterations)
    if done:
        missed = max(solved.violation, task.excess(solved.F))
        message = f"it ended where limits are exceeded by {missed:.1e} of their scales" if missed > tolerance else ""
        solved = replace(solved, status=INFEASIBLE if message else CONVERGED, message=message)
    of_rows, moving, resting = np.split(np.array(answer["lam_g"]).ravel(), np.cumsum([len(rows), len(used)]))
    of_objectives = (moving * (task.slope if task.summed else 1.0) + resting) / task.scale
    return replace(solved, multipliers=Multipliers(of_objectives, of_rows / rows, np.array(answer["lam_x"]).ravel()[:-1] / columns)), stuck


def _multipliers(task: _Task, found: Multipliers, columns: np.ndarray, rows: np.ndarray) -> dict[str, np.ndarray]:
    """What IPOPT begins with from multipliers, in the scales of a program: those of the objectives that move have a sum of 1 there."""
    moving = found.of_objectives * task.scale
    total = float(moving.sum() / task.slope.sum() if task.summed else moving @ task.slope)
    if not total > 0.0:
        return {}
    of_rows = [found.of_rows * rows, [total] if task.summed else moving, np.zeros(len(moving))]
    return {"lam_x0": np.append(found.of_bounds * columns, 0.0) / total, "lam_g0": np.concatenate(of_rows) / total}


def ended(nlp: NLP, run: Watched, z: np.ndarray, start: np.ndarray, max_iterations: int) -> tuple[Solved, bool]:
    """What a run of IPOPT left at z (n,), or the start where that is no number; and whether it solved its program."""
    stats = run.stats()
    outcome = stats["return_status"]
    # Where IPOPT does not begin, nothing is written there.
    iterations = int(stats["iter_count"]) if 0 <= stats["iter_count"] <= max_iterations else 0
    status, message, done = STATUS_OF_IPOPT.get(outcome, FAILED), outcome.replace("_", " ").lower(), outcome in SOLVED
    z = nlp.tighten(back_in_bounds(nlp, z)[None])[0]
    F, violation = nlp.evaluate(z[None])
    clocked = status == TIMEOUT
    if not np.isfinite([*F[0], violation[0]]).all():
        z, status, message, done = start, FAILED, "it ended at no numbers" if done else message, False
        F, violation = nlp.evaluate(z[None])
    return Solved(z, F[0], float(violation[0]), status, iterations, clocked, message=message), done


def _box(nlp: NLP, z: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bounds of the variables around z, (n,) each, and the mask (2, n) of the artificial ones among them. Periodic variables get one more
    period on either side, so that a bound never stops them; peaks, which have none, a multiple of their values."""
    lower, upper = nlp.lower - nlp.period, nlp.upper + nlp.period
    upper = np.where(np.isinf(upper), SOLVE.peak_limit * np.maximum(nlp.scale, np.abs(z)), upper)
    reach = np.full(len(z), np.inf)
    reach[nlp.free] = radius * nlp.span[nlp.free]
    low, high = np.maximum(lower, z - reach), np.minimum(upper, z + reach)
    return low, high, np.stack([low > lower, high < upper]) | (nlp.period > 0)


def _rank(task: _Task, solved: Solved, tolerance: float) -> tuple[float, float]:
    """Order: by violation, feasible ones alike; then by alpha."""
    missed = max(solved.violation, task.excess(solved.F))
    value = task.value(solved.F)
    return (missed if missed > tolerance else 0.0, value if np.isfinite(value) else np.inf)
