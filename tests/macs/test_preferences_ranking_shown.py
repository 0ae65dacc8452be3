"""What a ranking shows: its table, its figures, and what is to be known of its best point."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from choices import plain_front
from matplotlib.figure import Figure
from synthetic_fronts import marked

from macs.decisions import FuzzyGoal, Nimbus, PhysicalProgramming, Ranges, Smaller, WeightedSum
from macs.preferences.preference import standing
from problems.compiled import Objective

A, B = Objective("a", "kg"), Objective("b", "", "maximize")
ROWS = ((1.0, 8.0), (3.0, 14.0), (5.0, 16.0), (9.0, 17.0))
RANGES = Ranges({"a": 0.0, "b": 20.0}, {"a": 10.0, "b": 0.0})
GOAL = FuzzyGoal({"a": 1.0, "b": 15.0}, {"a": 4.0, "b": 5.0})
"""Hard limits are a of at most 5 and b of at least 10."""


def front(*rows: tuple[float, float], **columns: Any) -> Any:
    return plain_front(np.array(rows or ROWS), [A, B], sort=False, **columns)


def flown(points: Any, F: Any, verified: list[bool]) -> Any:
    """Points that a simulation confirms or not, and what it has found."""
    return marked(points, verified).replace(simulated_F=np.array(F, dtype=float) * points.signs)


# Tables


def test_a_table_has_rank_row_objectives_values_and_degrees() -> None:
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


def test_what_does_not_enter_has_no_column_and_what_is_not_shown_is_counted() -> None:
    ranking = FuzzyGoal({"a": 6.0}).rank(front(), RANGES)
    lines = ranking.table(2).splitlines()
    # Two points meet the target; the second stage has values of these only.
    assert lines[2].split() == ["rank", "#", "a", "b", "value", "value", "degree"]
    assert lines[3].endswith("largest 1 - membership  sum of all       a")
    assert lines[-1] == "... 2 more points" and len(lines) == 8
    assert ranking.table(3).splitlines()[-1] == "... 1 more point"
    assert "more" not in ranking.table(4) and "more" not in ranking.table(None)
    many = WeightedSum({"a": 1.0}).rank(front(*((float(k), 0.0) for k in range(23))))
    assert many.table().splitlines()[-1] == "... 3 more points" and len(many.table(None).splitlines()) == 28


def test_what_is_no_number_is_a_dash_and_what_is_to_be_known_is_below() -> None:
    limited = PhysicalProgramming({"a": Smaller.even(0.1, 0.5)})
    ranking = limited.rank(front())
    lines = ranking.table().splitlines()
    assert [line.split()[4] for line in lines[5:9]] == ["-"] * 4
    assert lines[9:] == ["", "No point meets all hard limits; none has a at most 0.5 kg."]
    assert WeightedSum({"a": 1.0}).rank(front(), RANGES).table().count("\n") == 8


def test_a_ranking_is_shown_in_one_line() -> None:
    ranking = GOAL.rank(front(), RANGES)
    assert len(ranking) == 4 and ranking.best.index == 1
    assert repr(ranking) == f"<Ranking of 4 points by {GOAL!r}: best {ranking.best.title}>"
    assert repr(GOAL.rank(front((3.0, 14.0)), RANGES)).startswith("<Ranking of 1 point by FuzzyGoal(")


# Figures


@pytest.mark.slow
def test_the_figure_sets_apart_what_is_beyond_limits_and_what_is_doubtful() -> None:
    points = front(status=["converged", "converged", "converged", "failed"])
    own = Figure().add_subplot()
    ax = GOAL.rank(points, RANGES).plot(own)
    assert ax is own and ax.get_title(loc="left") == "fuzzy goal"
    places = {one.get_label(): one.get_offsets().tolist() for one in ax.collections}
    assert places["exceeds a hard limit"] == [[1.0, 8.0]] and places["not feasible or not verified"] == [[9.0, 17.0]]
    assert places["best (#1)"] == [[3.0, 14.0]] and ax.collections[0].get_offsets().tolist() == [[3.0, 14.0], [5.0, 16.0]]
    assert GOAL.rank(points, RANGES).plot() is not own


def test_bars_are_those_of_the_best_with_their_rank_and_row() -> None:
    ranking = GOAL.rank(front(), RANGES)
    own = Figure().add_subplot()
    ax = ranking.plot_degrees(2, own)
    assert ax is own and [one.get_label() for one in ax.containers] == ["rank 1 (#1)", "rank 2 (#2)"]
    assert [bar.get_height() for bar in ax.containers[0]] == pytest.approx([0.5, 0.8])
    assert len(ranking.plot_degrees().containers) == 3


def test_functions_have_the_best_point_ringed() -> None:
    figure = Figure()
    ranking = GOAL.rank(front(), RANGES)
    axes = ranking.plot_functions(figure)
    assert axes[0].figure is figure and axes[0].get_xlim() == pytest.approx((-0.5, 10.5)), "the ranges are those of the ranking"
    dots, ring = axes[0].collections
    assert len(dots.get_offsets()) == 4 and ring.get_offsets().tolist() == pytest.approx(np.array([[3.0, 0.5]]))


# What is to be known of the best


def test_limits_that_no_point_meets_are_named() -> None:
    assert GOAL.rank(front(), RANGES).message == ""
    assert GOAL.rank(front((1.0, 8.0), (9.0, 17.0)), RANGES).message == "No point meets all hard limits together."
    assert GOAL.rank(front((6.0, 12.0), (9.0, 17.0)), RANGES).message == "No point meets all hard limits; none has a at most 5 kg."
    both = "No point meets all hard limits; none has a at most 5 kg, nor b at least 10."
    assert GOAL.rank(front((6.0, 8.0), (9.0, 9.0)), RANGES).message == both
    # Points that are not feasible meet nothing.
    assert GOAL.rank(front((6.0, 8.0), (3.0, 14.0), status=["converged", "failed"]), RANGES).message == both


def test_limits_that_stages_share_are_named_once() -> None:
    now = {"a": 4.0, "b": 12.0}
    preference = Nimbus(now, to={"b": 16.0}, until={"a": 5.0}, enough=True)
    assert preference.rank(front((6.0, 13.0), (9.0, 17.0)), RANGES).message == "No point meets all hard limits; none has a at most 5 kg."


def test_what_no_simulation_confirms_is_said() -> None:
    J = [(3.0, 14.0), (5.0, 16.0)]
    assert GOAL.rank(flown(front(*J), J, [False, True]), RANGES).message == ""
    assert GOAL.rank(flown(front(*J), J, [False, False]), RANGES).message == "No point was confirmed by a simulation."
    assert GOAL.rank(flown(front(*J), [(9.0, 14.0), (9.0, 16.0)], [False, False]), RANGES).message == (
        "No point meets all hard limits when simulated. No point was confirmed by a simulation."
    )


def test_one_point_that_claims_to_meet_all_limits_is_contradicted() -> None:
    J = [(3.0, 14.0), (6.0, 9.0)]
    assert GOAL.rank(flown(front(*J), [(9.0, 14.0), (6.0, 9.0)], [False, True]), RANGES).message.startswith(
        "No point meets all hard limits when simulated."
    )


def test_all_that_the_nearest_confirmed_point_exceeds_is_said() -> None:
    J = [(3.0, 14.0), (6.0, 9.0)]
    words = GOAL.rank(flown(front(*J), J, [False, True]), RANGES).message
    assert words.endswith("of the nearest, 'a at most 5 kg' is missed by 1 kg, 'b at least 10' is missed by 1.")


def test_what_confirmed_points_exceed_is_said_where_the_best_is_not_confirmed() -> None:
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
    stages = GOAL.stages((A, B), RANGES)
    assert standing(stages, points).tolist() == [0, 1, 3, 2, 3, 4]
    # What was simulated exceeds the limit of 5 by a tenth of the tolerance, 4.
    assert standing(stages, points, 0.11).tolist()[2] == 1 and standing(stages, points, 0.09).tolist()[2] == 3
    assert standing(stages, points.replace(stats={"verify": 0.11})).tolist()[2] == 1
    # Of what is confirmed, what was simulated does not matter: it agrees as well as it was asked to.
    agreed = flown(front(*J[:1]), [(5.4, 14.0)], [True])
    assert standing(stages, agreed).tolist() == [0]
    beyond = standing(stages, front((5.0 + 4e-6 * 0.9, 14.0), (5.0 + 4e-6 * 1.1, 14.0)))
    assert beyond.tolist() == [0, 2], "up to rounding"


# The order


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
