"""Rankings: their tables and figures, what is said of their best point, and fronts that are not as they should be."""

import io
import warnings
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from choices import plain_front
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure
from synthetic_fronts import flights, marked

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
from macs.preferences.preference import standing
from problems.compiled import Objective

A, B, METRES = Objective("a", "kg"), Objective("b", "", "maximize"), Objective("b", "m", "maximize")
ROWS = ((1.0, 8.0), (3.0, 14.0), (5.0, 16.0), (9.0, 17.0))
RANGES = Ranges({"a": 0.0, "b": 20.0}, {"a": 10.0, "b": 0.0})
GOAL = FuzzyGoal({"a": 1.0, "b": 15.0}, {"a": 4.0, "b": 5.0})
"""Hard limits are a of at most 5 and b of at least 10."""


def front(*rows: tuple[float, float], **columns: Any) -> Any:
    return plain_front(np.array(rows or ROWS), [A, B], sort=False, **columns)


def flown(points: Any, F: Any, verified: list[bool]) -> Any:
    """Points that a simulation confirms or not, and what it has found."""
    return marked(points, verified).replace(simulated_F=np.array(F, dtype=float) * points.signs)


def test_tables() -> None:
    assert GOAL.rank(front(), RANGES).table() == "\n".join([
        "FuzzyGoal(targets={'a': 1.0, 'b': 15.0}, tolerances={'a': 4.0, 'b': 5.0})",
        "",
        "rank  #         a        b                   value  degree  degree",
        "         min [kg]  max [-]  largest 1 - membership       a       b",
        "----  -  --------  -------  ----------------------  ------  ------",
        "   1  1   3.00000  14.0000                     0.5   0.500   0.800",
        "   2  2   5.00000  16.0000                       1   0.000   1.000",
        "   3  0   1.00000   8.0000                       -   1.000   0.000",
        "   4  3   9.00000  17.0000                       -   0.000   1.000",
    ])  # fmt: skip
    ranking = FuzzyGoal({"a": 6.0}).rank(front(), RANGES)
    lines = ranking.table(2).splitlines()
    # Two points meet the target; the second stage has values of these only.
    assert lines[2].split() == ["rank", "#", "a", "b", "value", "value", "degree"]
    assert lines[3].endswith("largest 1 - membership  sum of all       a")
    assert lines[-1] == "... 2 more points" and len(lines) == 8
    assert "more" not in ranking.table() and "more" not in ranking.table(None)


@pytest.mark.slow
def test_the_figure_sets_apart_what_is_beyond_limits_and_what_is_doubtful() -> None:
    points = front(status=["converged", "converged", "converged", "failed"])
    own = Figure().add_subplot()
    ax = GOAL.rank(points, RANGES).plot(own)
    assert ax is own and ax.get_title(loc="left") == "fuzzy goal"
    places = {one.get_label(): one.get_offsets().tolist() for one in ax.collections}
    assert places["exceeds a hard limit"] == [[1.0, 8.0]] and places["not feasible or not verified"] == [[9.0, 17.0]]
    assert places["best (#1)"] == [[3.0, 14.0]] and ax.collections[0].get_offsets().tolist() == [[3.0, 14.0], [5.0, 16.0]]
    assert [one.get_label() for one in GOAL.rank(points, RANGES).plot_degrees(2).containers] == ["rank 1 (#1)", "rank 2 (#2)"]


# What is to be known of the best


def test_limits_that_no_point_meets_are_named() -> None:
    assert GOAL.rank(front(), RANGES).message == ""
    assert GOAL.rank(front((1.0, 8.0), (9.0, 17.0)), RANGES).message == "No point meets all hard limits together."
    assert GOAL.rank(front((6.0, 12.0), (9.0, 17.0)), RANGES).message == "No point meets all hard limits; none has a at most 5 kg."
    both = "No point meets all hard limits; none has a at most 5 kg, nor b at least 10."
    assert GOAL.rank(front((6.0, 8.0), (9.0, 9.0)), RANGES).message == both
    # Points that are not feasible meet nothing.
    assert GOAL.rank(front((6.0, 8.0), (3.0, 14.0), status=["converged", "failed"]), RANGES).message == both


def test_what_no_simulation_confirms_is_said() -> None:
    J = [(3.0, 14.0), (5.0, 16.0)]
    assert GOAL.rank(flown(front(*J), J, [False, True]), RANGES).message == ""
    assert GOAL.rank(flown(front(*J), J, [False, False]), RANGES).message == "No point was confirmed by a simulation."
    assert GOAL.rank(flown(front(*J), [(9.0, 14.0), (9.0, 16.0)], [False, False]), RANGES).message == (
        "No point meets all hard limits when simulated. No point was confirmed by a simulation."
    )
    J = [(3.0, 14.0), (6.0, 9.0)]
    words = GOAL.rank(flown(front(*J), J, [False, True]), RANGES).message
    assert words.endswith("of the nearest, 'a at most 5 kg' is missed by 1 kg, 'b at least 10' is missed by 1.")
    contradicted = GOAL.rank(flown(front(*J), [(9.0, 14.0), J[1]], [False, True]), RANGES).message
    assert contradicted.startswith("No point meets all hard limits when simulated.")
    J = [(3.0, 14.0), (6.0, 16.0), (9.0, 17.0)]
    ranking = GOAL.rank(flown(front(*J), J, [False, True, True]), RANGES)
    assert ranking.order.tolist() == [0, 1, 2]
    assert ranking.message == (
        "The best point is not confirmed by a simulation; confirmed ones exceed hard limits: of the nearest, 'a at most 5 kg' is missed by"
        " 1 kg."
    )


def test_standings() -> None:
    """Within the limits; within them, but contradicted; beyond them; the same, contradicted; not feasible."""
    J = [(3.0, 14.0), (3.0, 14.0), (3.0, 14.0), (9.0, 14.0), (9.0, 14.0), (3.0, 14.0)]
    seen = [*J[:2], (5.4, 14.0), *J[3:]]
    points = flown(front(*J, status=["converged"] * 5 + ["failed"]), seen, [True, False, False, True, False, True])
    limits = GOAL.stages((A, B), RANGES)[0]
    assert standing(limits, points).tolist() == [0, 1, 3, 2, 3, 4]
    # What was simulated exceeds the limit of 5 by a tenth of the tolerance, 4.
    assert standing(limits, points, 0.11).tolist()[2] == 1 and standing(limits, points, 0.09).tolist()[2] == 3
    assert standing(limits, points.replace(stats={"verify": 0.11})).tolist()[2] == 1
    # Of what is confirmed, what was simulated does not matter: it agrees as well as it was asked to.
    agreed = flown(front(*J[:1]), [(5.4, 14.0)], [True])
    assert standing(limits, agreed).tolist() == [0]
    beyond = standing(limits, front((5.0 + 4e-6 * 0.9, 14.0), (5.0 + 4e-6 * 1.1, 14.0)))
    assert beyond.tolist() == [0, 2], "up to rounding"


def test_equal_values_are_told_apart_by_the_sum_of_normalised_objectives() -> None:
    ranking = WeightedSum({"a": 1.0}).rank(front((1.0, 5.0), (1.0, 9.0), (1.0, 7.0)), RANGES)
    assert ranking.order.tolist() == [1, 2, 0] and ranking.values.tolist() == [0.1, 0.1, 0.1]
    assert ranking.front[0].objectives == {"a": 1.0, "b": 5.0} and ranking.ranges == RANGES
    assert ranking.stage_names == ("weighted sum",) and ranking.degrees[:, 1].tolist() == pytest.approx([0.25, 0.45, 0.35])
    assert WeightedSum({"a": 1.0}).rank(front()).ranges == Ranges.of(front())


def test_what_cannot_be_ranked_says_so() -> None:
    failed = front((1.0, 2.0), status=["failed"])
    with pytest.raises(ValueError, match=r"^the front has no feasible point to rank$"):
        GOAL.rank(failed, RANGES)
    with pytest.raises(ValueError, match=r"^the front has no feasible point to rank: nothing there$"):
        GOAL.rank(failed.replace(message="nothing there"), RANGES)
    with pytest.raises(ValueError, match=r"^a front is ranked, not 3$"):
        GOAL.rank(3)


# Of fronts that are not as they should be

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
        assert list(ranking.order) == [0] and ranking.best.objectives == J
        assert np.isfinite(ranking.values).all()
    assert EQUAL.rank(front).values == pytest.approx([0.0])


def test_an_objective_that_is_not_a_number_is_never_best():
    front = plain_front([[np.nan, 0.0], [1.0, 2.0], [2.0, 1.0]], [Objective("a"), Objective("b")])
    ranking = WeightedSum({"b": 1.0}).rank(front)
    assert np.isnan(front.F[2, 0]) and list(ranking.order) == [1, 0, 2]
    assert ranking.values[2] == np.inf
    assert ranking.ranges == Ranges({"a": 1.0, "b": 1.0}, {"a": 2.0, "b": 2.0})


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
    assert len(axes) == (~np.isnan(ranking.degrees).all(axis=0)).sum()
    assert drawn(axes) and drawn(ranking.plot_degrees(2)) and drawn(ranking.plot())


# Figures of preferences: curves over ranges and a little beyond, points on them, bars, and words on the axes


FRONT = plain_front(np.array([[1.0, 8.0], [3.0, 14.0], [5.0, 16.0]]), [A, METRES])
EVEN = WeightedSum({"a": 1.0, "b": 1.0})


def test_functions_are_drawn_over_ranges_and_a_little_beyond_with_points_on_them() -> None:
    first, second = EVEN.plot_functions(FRONT, RANGES)
    assert first.get_xlim() == pytest.approx((-0.5, 10.5)) and second.get_xlim() == pytest.approx((-1.0, 21.0))
    # One axis is of one objective, so that the other one does not matter: from 1 at the best to 0 at the worst.
    for ax, at, heights in ((first, [0.0, 10.0], [1.0, 0.0]), (second, [0.0, 20.0], [0.0, 1.0])):
        x, y = ax.lines[0].get_data()
        assert np.interp(at, x, y) == pytest.approx(heights) and np.diff(y) == pytest.approx(np.full(len(y) - 1, np.diff(y)[0]))
        assert (ax.get_yscale(), ax.lines[0].get_label()) == ("linear", "degree (1: best, 0: worst)")
    assert first.get_ylabel() == "degree (1: best, 0: worst)" and second.get_ylabel() == ""
    assert (first.get_xlabel(), second.get_xlabel()) == ("← a [kg]", "b [m]\N{NO-BREAK SPACE}→"), "arrows to what is better"
    assert first.figure.get_suptitle() == "weighted sum"
    figure = Figure()
    axes = EVEN.plot_functions(FRONT, RANGES, 1, figure)
    assert axes[0].figure is figure
    dots, ring = axes[0].collections
    assert dots.get_offsets().tolist() == pytest.approx(np.array([[1.0, 0.9], [3.0, 0.7], [5.0, 0.5]]))
    assert ring.get_offsets().tolist() == pytest.approx(np.array([[3.0, 0.7]]))
    assert len(EVEN.plot_functions(FRONT, RANGES)[0].collections) == 1, "none is ringed where none is named"
    first, second = EVEN.plot_functions(FRONT)
    assert first.get_xlim() == pytest.approx((0.8, 5.2)) and second.get_xlim() == pytest.approx((7.6, 16.4))
    (only,) = FuzzyGoal({"b": 15.0}).plot_functions(FRONT, RANGES)
    assert only.get_xlabel() == "b [m]\N{NO-BREAK SPACE}→" and only.get_ylabel() == "membership"
    x, y = only.lines[0].get_data()
    assert np.interp([7.5, 15.0, 20.0], x, y) == pytest.approx([0.5, 1.0, 1.0], abs=1e-3)


def bars(ax: Any) -> list[list[float]]:
    return [[bar.get_height() for bar in container] for container in ax.containers]


def test_degrees_are_bars_of_each_choice() -> None:
    own = Figure().add_subplot()
    ax = EVEN.plot_degrees({"first": FRONT[0], "last": SimpleNamespace(point=FRONT[2])}, RANGES, own)
    assert ax is own and np.array(bars(ax)) == pytest.approx(np.array([[0.9, 0.4], [0.5, 0.8]]))
    assert [one.get_text() for one in ax.get_xticklabels()] == ["a", "b"]
    assert [one.get_text() for one in ax.get_legend().get_texts()] == ["first", "last"]
    assert ax.get_ylabel() == "degree (1: best, 0: worst)" and ax.get_ylim()[1] == pytest.approx(1.1)
    other = EVEN.plot_degrees({"first": FRONT[0]}, RANGES)
    assert other is not own and np.array(bars(other)) == pytest.approx(np.array([[0.9, 0.4]]))


def test_where_smaller_degrees_are_better_the_axis_has_the_ranges_of_preference() -> None:
    ax = PhysicalProgramming({"a": Smaller(1.0, 2.0, 3.0, 4.0, 5.0)}).plot_degrees({"first": FRONT[1]})
    assert ax.get_ylim() == (0.0, 6.0) and [one.get_text() for one in ax.get_xticklabels()] == ["a"]
    assert any(words for words in ax.child_axes[0].get_yticklabels())
    (only,) = PhysicalProgramming({"a": Smaller(1.0, 2.0, 3.0, 4.0, 5.0)}).plot_functions(FRONT)
    assert only.get_yscale() == "log"


def test_degrees_are_of_points_of_one_problem() -> None:
    other = plain_front(np.array([[1.0, 8.0]]), [A, Objective("c")])[0]
    with pytest.raises(ValueError, match=r"^'there' is a point of another problem: its objectives are a, c$"):
        EVEN.plot_degrees({"here": FRONT[0], "there": other}, RANGES)
    for wrong in ([FRONT[0]], {}, {"here": 3}, {"here": FRONT[0], "there": 3}):
        with pytest.raises(ValueError, match=r"^choices must be a dict of points by name, not "):
            EVEN.plot_degrees(wrong, RANGES)  # type: ignore[arg-type]


def test_what_it_speaks_of_is_said_and_checked() -> None:
    assert (EVEN.title, EVEN.words) == ("weighted sum", "weighted sum of a, b")
    assert PhysicalProgramming({"a": Smaller(1, 2, 3, 4, 5)}).words == "physical programming of a"
    EVEN.check((A, METRES))
    with pytest.raises(ValueError, match=r"^unknown objective 'b'"):
        EVEN.check((A,))
