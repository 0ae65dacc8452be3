"""Restoration: infeasible points that may be better than the archive's are moved to feasible ones nearby.

Where constraints are equalities, or leave little room, hardly any proposal is feasible. For trajectories the inner level moves each to a
feasible one. For a black box linear models of its constraints do, see `evaluation.linear_models`: one evaluation for each step, and few
steps, since each one makes the models better. As many points are restored as pays: where constraints are thin the archive keeps hardly any
other point, and where infeasible parts are wide hardly any restored one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..evaluation.evaluator import Evaluation
from ..evaluation.linear_models import steps_to_zero
from ..pareto.dominance import dominates
from .breeding import success_rates, updated_credit
from .state import SearchState, remember
from .trials import Trials

OTHERS, RESTORED = 0, 1
"""Rows of `SearchState.restored`."""
STEPS = 6
"""Most steps of a point in an iteration."""
LOWER = 0.5
"""Another step is made only if the last one has lowered the violation to this part."""
PART = 0.25
"""At most this part of the points evaluated in an iteration are restored in it."""


def restore(trials: Trials, seen: Sequence[Evaluation]) -> None:
    """Restore some of the points that were evaluated in this iteration, drawn from those that are infeasible and that the archive does not
    dominate; remember the residuals of all.

    Their number is the ratio of two success rates, of steps and of other evaluations, at least one. A success is to be in the archive.
    """
    state, evaluator, box = trials.state, trials.evaluator, trials.box
    usable = [one for one in seen if one.residuals is not None and one.residuals.shape[1]]
    if not trials.settings.restore or evaluator.moves or not usable:
        return
    for one in usable:
        _sample(state, trials, one)
    Z, F, violation = (np.concatenate([getattr(one, name) for one in usable]) for name in ("Z", "F", "violation"))
    residuals = np.concatenate([one.residuals for one in usable if one.residuals is not None])
    rates = success_rates(state.restored)
    count = max(1, min(round(rates[RESTORED] / rates[OTHERS]), int(PART * len(F))))
    rows = _promising(state, F, violation, evaluator.tolerance)
    if len(rows) > count:
        rows = state.rng.choice(rows, count, replace=False)
    Z, residuals, violation = Z[rows], residuals[rows], violation[rows]
    for _ in range(STEPS):
        X = box.to_unit(Z[:, evaluator.free])
        moved, result = trials.evaluate(Z, X, box.put_back(X + steps_to_zero(box, X, residuals, state.samples)))
        if result is None:
            break
        assert result.residuals is not None
        _sample(state, trials, result)
        rows = _promising(state, result.F, result.violation, evaluator.tolerance)
        rows = rows[result.violation[rows] <= LOWER * violation[moved[rows]]]
        Z, residuals, violation = result.Z[rows], result.residuals[rows], result.violation[rows]
    remember(state, trials.seen, trials.settings, evaluator)
    if len(state.archive):
        made = [(OTHERS, one) for one in usable] + [(RESTORED, one) for one in trials.seen]
        kinds = np.concatenate([np.full(len(one.F), kind) for kind, one in made])
        kept = [(one.violation <= evaluator.tolerance) & state.archive.has(one.F) for _, one in made]
        state.restored = updated_credit(state.restored, kinds, np.concatenate(kept))


def _promising(state: SearchState, F: np.ndarray, violation: np.ndarray, tolerance: float) -> np.ndarray:
    """Rows of the points with F (k, m) and violations (k,) that are infeasible, but not dominated by a point of the archive."""
    rows = np.flatnonzero((violation > tolerance) & np.isfinite(violation))
    return rows[~np.any(dominates(state.archive.F[:, None], F[rows]), axis=0)]


def _sample(state: SearchState, trials: Trials, one: Evaluation) -> None:
    """Keep the residuals of evaluated points, but for those whose evaluation failed."""
    assert one.residuals is not None
    fine = np.isfinite(one.violation)
    state.samples = state.samples.joined(trials.box.to_unit(one.Z[fine][:, trials.evaluator.free]), one.residuals[fine])
