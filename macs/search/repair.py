"""Repair: infeasible points that may be better than the archive's are moved to feasible ones nearby, by linear models of the constraints.

Where constraints are equalities, or leave little room, hardly any proposal is feasible. For trajectories the inner level moves each to a
feasible one. A black box has no derivatives, but residuals at points nearby: the model of a constraint is the linear function with the best
fit, weighted by distance; with too few points, the flattest fit (Conn, Scheinberg and Vicente 2009, chapters 4 and 5). The step is the
shortest to the zero of all models, as with gradients in the repair of Chootinan and Chen (2006). Each step costs one evaluation, and
improves the models. The number of repairs follows their success: on thin feasible sets the archive keeps hardly any other point, and where
infeasible parts are wide hardly any repaired one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..evaluation.evaluator import Evaluation, UnitBox
from ..pareto.dominance import dominates
from .state import ResidualSamples, SearchState, update_archives
from .trials import Trials


@dataclass(frozen=True)
class RepairLimits:
    """Limits of repair in an iteration (measured on MW1 to MW14 and on problems with equalities)."""

    steps: int = 6  # of a point
    lower: float = 0.5  # another step is made only if the last one has lowered the violation to this part
    part: float = 0.25  # of the points evaluated in an iteration that are repaired in it, at most


@dataclass(frozen=True)
class ModelLimits:
    """Parameters of the linear models of constraints."""

    points: int = 40  # most points that a model is made of; else two for each variable and two more; signs need twice as many
    flat: float = 1e-6  # singular values below this part of the largest count as zero: of the points around
    alike: float = 1e-3  # the same of gradients of unit length
    poor: float = 1e-4  # a constraint may be a limit on an absolute value where its misfit is a larger part of the squared changes
    clearly: float = 0.03  # and counts as one where signs lower the misfit to this part
    rounds: int = 5  # models of such a constraint, with each of which the signs of its residuals are chosen again
    guesses: int = 300  # first models that go on, of all such constraints together, but at least three of each
    beyond: float = 0.02  # part of the residuals by which a step goes beyond the zero of models, to end inside of limits


REPAIR_LIMITS, MODEL_LIMITS = RepairLimits(), ModelLimits()


def repair(trials: Trials, seen: Sequence[Evaluation]) -> None:
    """Repair some of the points of this iteration, drawn from the infeasible ones that the archive does not dominate; keep the residuals of
    all.

    Their number is the ratio of two success rates, of steps of repair and of other evaluations, at least one. A success is to be in the
    archive.
    """
    state, evaluator, box = trials.state, trials.evaluator, trials.box
    usable = [one for one in seen if one.residuals is not None and one.residuals.shape[1]]
    if not trials.settings.variant.repair or evaluator.moves or not usable:
        return
    for one in usable:
        _keep_residuals(state, trials, one)
    Z, F, violation = (np.concatenate([getattr(one, name) for one in usable]) for name in ("Z", "F", "violation"))
    residuals = np.concatenate([one.residuals for one in usable if one.residuals is not None])
    others, repaired = state.repairs.rates(prior=0.1)
    count = max(1, min(round(repaired / others), int(REPAIR_LIMITS.part * len(F))))
    rows = _promising(state, F, violation, evaluator.tolerance)
    if len(rows) > count:
        rows = state.rng.choice(rows, count, replace=False)
    Z, residuals, violation = Z[rows], residuals[rows], violation[rows]
    watched = residuals != 0.0
    for _ in range(REPAIR_LIMITS.steps):
        X = box.to_unit(Z[:, evaluator.free])
        moved, result = trials.evaluate(Z, X, box.put_back(X + steps_to_zero(box, X, residuals, state.samples, watched)))
        if result is None:
            break
        assert result.residuals is not None
        _keep_residuals(state, trials, result)
        rows = _promising(state, result.F, result.violation, evaluator.tolerance)
        rows = rows[result.violation[rows] <= REPAIR_LIMITS.lower * violation[moved[rows]]]
        Z, residuals, violation = result.Z[rows], result.residuals[rows], result.violation[rows]
        watched = watched[moved[rows]] | (residuals != 0.0)
    update_archives(state, trials.seen, trials.settings, evaluator)
    if len(state.archive):
        groups = (usable, trials.seen)
        kept = [sum(np.count_nonzero((one.violation <= evaluator.tolerance) & state.archive.has(one.F)) for one in g) for g in groups]
        state.repairs.add(np.array(kept, dtype=float), np.array([sum(len(one.F) for one in g) for g in groups], dtype=float))


def _promising(state: SearchState, F: np.ndarray, violation: np.ndarray, tolerance: float) -> np.ndarray:
    """Rows of the points with F (k, m) and violations (k,) that are infeasible and not dominated by the archive."""
    rows = np.flatnonzero((violation > tolerance) & np.isfinite(violation))
    return rows[~np.any(dominates(state.archive.F[:, None], F[rows]), axis=0)]


def _keep_residuals(state: SearchState, trials: Trials, one: Evaluation) -> None:
    """Keep the residuals of evaluated points, except failed evaluations."""
    assert one.residuals is not None
    fine = np.isfinite(one.violation)
    state.samples = state.samples.joined(trials.box.to_unit(one.Z[fine][:, trials.evaluator.free]), one.residuals[fine])


def steps_to_zero(box: UnitBox, X: np.ndarray, residuals: np.ndarray, samples: ResidualSamples, watched: np.ndarray) -> np.ndarray:
    """Steps (k, d) from points X (k, d) to the zero of the models of their residuals (k, c), or as near to it as the bounds allow.

    A constraint without a residual at a point has no part in its step, unless it is `watched` (k, c) beside whole numbers. No step is
    longer than the distance of the farthest point that its models are made of. It is zero where no other point is known. Whole numbers
    stay as they are where there are real ones: a step back would undo what made the point worth a repair.
    """
    squared = box.squared_distances(X, samples.X)
    squared[squared == 0.0] = np.inf
    count = min(2 * X.shape[1] + 2, MODEL_LIMITS.points)
    order = np.argsort(squared, axis=1, kind="stable")[:, : 2 * count]
    steps, moving = np.zeros_like(X), np.ones(X.shape[1]) if box.whole is None or box.whole.all() else ~box.whole
    for row, near in enumerate(order):
        near = near[np.isfinite(squared[row, near])]
        violated = np.flatnonzero(residuals[row] if moving.all() else watched[row])
        if len(near) and len(violated):
            apart, amount = np.sqrt(squared[row, near]), residuals[row, violated]
            with np.errstate(over="ignore", invalid="ignore"):  # a slope that is no finite number is left out
                gradients = _gradients(box.difference(samples.X[near], X[row]), samples.residuals[near][:, violated], amount, apart, count)
                step = _step(box, X[row], amount, gradients * moving)
            steps[row] = step * min(1.0, apart[:count].max() / max(float(np.linalg.norm(step)), np.finfo(float).tiny))
    return steps


def _gradients(steps: np.ndarray, residuals: np.ndarray, amount: np.ndarray, apart: np.ndarray, count: int) -> np.ndarray:
    """Gradients (c, d) of the linear models of residuals (n, c) at steps (n, d) of lengths `apart` (n,) from a point with the residuals
    `amount` (c,); of the first `count` of these.

    A limit such as abs(h(x)) <= 0.0001 has positive residuals on both sides of h(x) = 0. Where no residual is negative, some of them
    therefore count as negative, if a model of all of them fits far better then.
    """
    fit = _Fit(steps[:count], apart[:count])
    slopes = fit(residuals[:count] - amount)[0]
    maybe = np.flatnonzero((residuals >= 0.0).all(axis=0) & (amount > 0.0))
    if maybe.size:
        whole, change = _Fit(steps, apart), residuals[:, maybe] - amount[maybe]
        misfit = whole(change)[1]
        poor = misfit > MODEL_LIMITS.poor * np.square(change / apart[:, None]).sum(axis=0)
        maybe, misfit = maybe[poor], misfit[poor]
    if maybe.size:
        signs = _signs(whole, steps, residuals[:, maybe], amount[maybe], MODEL_LIMITS.clearly * misfit)
        folded = np.flatnonzero((signs < 0.0).any(axis=0))
        which = maybe[folded]
        slopes[:, which] = fit((signs[:, folded] * residuals[:, which])[:count] - amount[which])[0]
    return slopes.T


class _Fit:
    """Linear models by steps (n, d) of lengths `apart` (n,), by the square of which residuals are divided."""

    def __init__(self, steps: np.ndarray, apart: np.ndarray) -> None:
        self._steps, self._apart = steps / apart[:, None], apart[:, None]
        self._inverse = np.linalg.pinv(self._steps, rcond=MODEL_LIMITS.flat)

    def __call__(self, change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gradients (..., d, c) that fit changes (..., n, c) best, and the squared misfits (..., c)."""
        change = change / self._apart
        slopes = self._inverse @ change
        return slopes, np.square(self._steps @ slopes - change).sum(axis=-2)


def _signs(fit: _Fit, steps: np.ndarray, residuals: np.ndarray, amount: np.ndarray, least: np.ndarray) -> np.ndarray:
    """Signs (n, c) of residuals (n, c), 1 or -1, with which models have misfits below `least` (c,); 1 where none have. See `_gradients`.

    Each is that of the model before, from several first guesses, of which the best go on: all points are on the other side, or one is, and
    the model has the slope from here to it.
    """
    signs, columns = np.ones_like(residuals), np.arange(len(amount))
    along = (steps @ steps.T / np.square(steps).sum(axis=1)[:, None])[:, :, None]
    model = np.concatenate([np.full((1, *residuals.shape), -1.0), amount - along * (amount + residuals[:, None])])
    for _ in range(MODEL_LIMITS.rounds):
        tried = np.where(model < 0.0, -1.0, 1.0)
        found, misfits = fit(tried * residuals - amount)
        best = misfits.argmin(axis=0)
        better = misfits[best, columns] < least
        signs[:, better] = tried[best, :, columns][better].T
        least = np.where(better, misfits[best, columns], least)
        go_on = np.argsort(misfits, axis=0)[: max(MODEL_LIMITS.guesses // len(columns), 3)]
        model = amount + steps @ np.moveaxis(found[go_on, :, columns], 2, 1)
    return signs


def _step(box: UnitBox, x: np.ndarray, amount: np.ndarray, gradients: np.ndarray) -> np.ndarray:
    """The shortest step (d,) from x (d,) by which residuals `amount` (c,) with these gradients (c, d) vanish; variables that it would move
    beyond a bound stay there, and the others do more."""
    sizes = np.linalg.norm(gradients, axis=1)
    known = np.isfinite(sizes) & (sizes > 0.0)
    directions, wanted = gradients[known] / sizes[known, None], -(1.0 + MODEL_LIMITS.beyond) * amount[known] / sizes[known]
    step, free = np.zeros(len(x)), np.ones(len(x), dtype=bool)
    while len(wanted) and free.any():
        fixed = np.where(free, 0.0, step)
        step = fixed.copy()
        step[free] = np.linalg.pinv(directions[:, free], rcond=MODEL_LIMITS.alike) @ (wanted - directions @ fixed)
        end = x + step
        beyond = free & ~box.wraps & ((end < 0.0) | (end > 1.0))
        if not beyond.any():
            break
        step[beyond] = np.clip(end, 0.0, 1.0)[beyond] - x[beyond]
        free &= ~beyond
    return step
