"""Rankings of fronts that are not as they should be, their tables and figures, and black boxes."""

from __future__ import annotations

import io
import warnings

import numpy as np
import pytest
from choices import plain_front
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure
from synthetic_fronts import flights, marked

from macs import MACS
from macs.decisions import (
    Around,
    FuzzyGoal,
    FuzzyPhysicalProgramming,
    FuzzySatisfactory,
    GoalProgramming,
    Larger,
    Nimbus,
    PhysicalProgramming,
    Ranges,
    ReferencePoint,
    Smaller,
    Value,
    WeightedSum,
)
from problems.compiled import Objective

EQUAL = WeightedSum({"time": 1.0, "height": 1.0})


def drawn(axes) -> bytes:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        picture = io.BytesIO()
        np.atleast_1d(axes)[0].figure.savefig(picture, format="png", dpi=50)
    return picture.getvalue()


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.lists(st.tuples(st.integers(4, 16), st.booleans(), st.booleans()), min_size=1, max_size=7, unique_by=lambda one: one[0]))
def test_hard_limits_come_before_simulations_and_these_before_values(points):
    """The time is to be at most 3, and small."""
    quarters, confirmed, feasible = (np.array(column) for column in zip(*sorted(points), strict=True))
    times, feasible[0] = 0.25 * quarters, True
    front = plain_front(times[:, None], [Objective("time", "s")], status=["converged" if one else "failed" for one in feasible])
    front = marked(front, list(confirmed)).replace(simulated_F=front.F)
    order = FuzzyGoal({"time": 2.0}, {"time": 1.0}).rank(front, Ranges({"time": 0.0}, {"time": 4.0})).order
    keys = [(not feasible[i], times[i] > 3, feasible[i] and not confirmed[i], max(times[i], 2.0), times[i]) for i in order]
    assert keys == sorted(keys)


def test_one_point_is_the_best_of_any_preference():
    front = flights(1)
    J = front[0].objectives
    now = {name: 1.1 * value for name, value in J.items()}
    for preference in (
        EQUAL,
        GoalProgramming(now),
        FuzzyGoal(now),
        FuzzyGoal({"time": Around(now["time"])}, aggregate="sum"),
        FuzzySatisfactory({}, ["time", "height"]),
        ReferencePoint(now),
        PhysicalProgramming({"time": Smaller.even(1, 100)}),
    ):
        ranking = preference.rank(front)
        assert list(ranking.order) == [0]
        assert ranking.best.objectives == J
        assert np.isfinite(ranking.values).all()
    assert EQUAL.rank(front).values == pytest.approx([0.0])


def test_an_objective_that_is_not_a_number_is_never_best():
    front = plain_front([[np.nan, 0.0], [1.0, 2.0], [2.0, 1.0]], [Objective("a"), Objective("b")])
    ranking = WeightedSum({"b": 1.0}).rank(front)
    assert np.isnan(front.F[2, 0])
    assert list(ranking.order) == [1, 0, 2]
    assert ranking.values[2] == np.inf
    assert ranking.ranges == Ranges({"a": 1.0, "b": 1.0}, {"a": 2.0, "b": 2.0})


@pytest.mark.slow
def test_black_boxes_are_ranked():
    def function(X):
        return np.column_stack([X[:, 0] ** 2 + X[:, 1], (X[:, 0] - 2) ** 2 + X[:, 1]])

    front = MACS(agents=6, archive=12).minimize(function, [(-1, 3), (0, 1)], evaluations=1500, seed=1, names=["a", "b"])
    assert front.source is None
    # The front is sqrt(a) + sqrt(b) = 2 between (0, 4) and (4, 0): aspirations that are alike are missed alike, at (1, 1).
    ranking = ReferencePoint({"a": 0.5, "b": 0.5}).rank(front, Ranges({"a": 0, "b": 0}, {"a": 4, "b": 4}))
    assert list(ranking.best.objectives.values()) == pytest.approx([1.0, 1.0], abs=0.4)
    distance = np.abs(front.objectives - 1.0).max(axis=1)
    assert distance[ranking.order[0]] == distance.min()
    assert "a" in ranking.table()
    assert drawn(ranking.plot())


@pytest.mark.slow
@pytest.mark.parametrize(
    "preference",
    [
        WeightedSum({"time": 1.0}),
        GoalProgramming({"time": 15.0, "height": Around(7.0)}),
        FuzzyGoal({"time": 15.0}),
        FuzzySatisfactory({}, ["time", "height"]),
        ReferencePoint({"time": 15.0}),
        Nimbus({"time": 15.0, "height": 7.0}, improve=["time"], free=["height"]),
        PhysicalProgramming({"time": Smaller.even(10, 30), "height": Value(5, 5.5, 6, 6.5, 7, 7.5, 8, 8.5, 9)}),
        FuzzyPhysicalProgramming({"height": Larger.even(9, 5)}),
    ],
    ids=lambda one: type(one).__name__,
)
def test_figures_of_any_preference(preference):
    ranking = preference.rank(flights(8))
    axes = ranking.plot_functions(Figure(layout="constrained"))
    entering = int((~np.isnan(ranking.degrees).all(axis=0)).sum())
    assert len(axes) == entering
    assert drawn(axes)
    bars = ranking.plot_degrees(2)
    assert drawn(bars)
    assert drawn(ranking.plot())
    heights = [patch.get_height() for patch in bars.patches if patch.get_width() < 0.8]
    shown = ranking.degrees[ranking.order[:2]]
    assert sorted(heights)[-1] == pytest.approx(np.nanmax(shown))
