"""Rankings of fronts that are not as they should be, their tables and figures, and black boxes."""

from __future__ import annotations

import io
import warnings
from types import SimpleNamespace

import numpy as np
import pytest
from choices import cart, plain_front
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure
from synthetic_fronts import black_box, flights, marked

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


def test_points_that_were_not_confirmed_come_after_those_that_were():
    front = marked(flights(5), [False, True, False, True, True])
    ranking = EQUAL.rank(front)
    assert set(ranking.order[:3]) == {1, 3, 4}
    assert ranking.ranges == Ranges.of(front[[1, 3, 4]])
    none = EQUAL.rank(marked(flights(5), [False] * 5))
    assert none.message == "No point was confirmed by a simulation."
    assert none.best.index == EQUAL.rank(flights(5)).best.index
    # Points that were not simulated are neither confirmed nor contradicted.
    some = EQUAL.rank(marked(flights(5), [False] * 5, seen=[True, False, False, False, False]))
    assert some.order[-1] == 0


LIMITED = PhysicalProgramming({"time": Smaller.even(2.0, 3.0), "effort": Smaller.even(0.5, 1.0)})
"""The times 1.2, 2.6 and 4 s have efforts of 6.94, 0.68 and 0.19: only the second is within the limits, and the third is nearer to them."""


def test_an_unconfirmed_point_within_hard_limits_comes_before_confirmed_ones_beyond_them():
    ranking = LIMITED.rank(marked(cart(3), [True, False, True]))
    assert list(np.isfinite(ranking.values)) == [False, True, False]
    assert list(ranking.order) == [1, 2, 0]
    assert ranking.message == (
        "The best point is not confirmed by a simulation; confirmed ones exceed hard limits: of the nearest, 'time at most 3 s' is missed"
        " by 1 s."
    )
    # A confirmed one within the limits comes before all.
    ranking = LIMITED.rank(marked(cart(5), [True, True, False, True, True]), Ranges.of(cart(5)))
    assert list(ranking.order) == [2, 3, 4, 1, 0] and "of the nearest, 'time at most 3 s' is missed by 0.3 s" in ranking.message
    ranking = PhysicalProgramming({"time": Smaller.even(2.0, 3.5)}).rank(marked(cart(5), [False, False, False, True, False]))
    assert ranking.order[0] == 3 and ranking.order[-1] == 4 and ranking.message == ""


def test_what_was_simulated_beyond_a_hard_limit_is_beyond_it():
    front = marked(cart(3), [True, False, True])
    # By more, in units of the limit's class, than what points may miss: 3 s and 1.
    over = front.replace(simulated_F=np.where(np.arange(3)[:, None] == 1, [[3.1, 0.7]], front.simulated_F))
    ranking = LIMITED.rank(over)
    assert list(ranking.order) == [2, 0, 1]
    assert ranking.message == "No point meets all hard limits when simulated."
    # Not simulated, it is not known to be.
    blank = front.replace(
        **{name: np.where(np.arange(3) == 1, np.nan, getattr(front, name)) for name in ("defect", "simulated_violation")},
        simulated_F=np.where(np.arange(3)[:, None] == 1, np.nan, front.simulated_F),
    )
    ranking = LIMITED.rank(blank)
    assert ranking.order[0] == 1 and ranking.message == ""


@pytest.mark.slow
@settings(max_examples=200, deadline=None, derandomize=True)
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


def test_given_ranges_normalise():
    front, wide = cart(11), Ranges({"time": 0.0, "effort": 0.0}, {"time": 10.0, "effort": 100.0})
    ranking = WeightedSum({"time": 1.0, "effort": 1.0}).rank(front, wide)
    assert ranking.values == pytest.approx(front.F[:, 0] / 10 + front.F[:, 1] / 100)
    assert GoalProgramming({"time": 1.0}).rank(front, wide).values == pytest.approx((front.F[:, 0] - 1.0) / 10)


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


def test_degrees_of_points_that_others_chose():
    front, ranges = flights(4), Ranges.of(flights(4))
    bars = EQUAL.plot_degrees({"first": front[0], "last": SimpleNamespace(point=front[3])}, ranges)
    heights = [patch.get_height() for patch in bars.patches if patch.get_width() < 0.8]
    assert heights == pytest.approx([1.0, 0.0, 0.0, 1.0])
    assert drawn(bars)
    assert Nimbus(SimpleNamespace(point=front[1]), improve=["time"], free=["height"]).current == front[1].objectives


def test_degrees_of_choices_are_of_one_problem():
    with pytest.raises(ValueError, match="'other' is a point of another problem"):
        EQUAL.plot_degrees({"one": flights(2)[0], "other": black_box(2)[0]}, Ranges.of(flights(2)))
    with pytest.raises(ValueError, match="choices must be a dict of points by name"):
        EQUAL.plot_degrees([flights(2)[0]])
