"""What figures of preferences show: curves over ranges and a little beyond, points on them, bars, and words on the axes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from choices import plain_front
from matplotlib.figure import Figure

from macs.decisions import FuzzyGoal, PhysicalProgramming, Ranges, Smaller, WeightedSum
from problems.compiled import Objective

A, B = Objective("a", "kg"), Objective("b", "m", "maximize")
FRONT = plain_front(np.array([[1.0, 8.0], [3.0, 14.0], [5.0, 16.0]]), [A, B])
RANGES = Ranges({"a": 0.0, "b": 20.0}, {"a": 10.0, "b": 0.0})
EVEN = WeightedSum({"a": 1.0, "b": 1.0})


def test_functions_are_drawn_over_the_ranges_and_a_twentieth_beyond() -> None:
    first, second = EVEN.plot_functions(FRONT, RANGES)
    assert first.get_xlim() == pytest.approx((-0.5, 10.5)) and second.get_xlim() == pytest.approx((-1.0, 21.0))
    # One axis is of one objective, so that the other one does not matter: from 1 at the best to 0 at the worst.
    for ax, at, heights in ((first, [0.0, 10.0], [1.0, 0.0]), (second, [0.0, 20.0], [0.0, 1.0])):
        x, y = ax.lines[0].get_data()
        assert np.interp(at, x, y) == pytest.approx(heights) and np.diff(y) == pytest.approx(np.full(len(y) - 1, np.diff(y)[0]))
        assert (ax.get_yscale(), ax.lines[0].get_label()) == ("linear", "degree (1: best, 0: worst)")
    assert first.get_ylabel() == "degree (1: best, 0: worst)" and second.get_ylabel() == ""
    assert (first.get_xlabel(), second.get_xlabel()) == ("← a [kg]", "b [m] →"), "arrows to what is better"
    assert first.figure.get_suptitle() == "weighted sum"


def test_points_are_on_the_curves_and_the_best_is_ringed() -> None:
    figure = Figure()
    axes = EVEN.plot_functions(FRONT, RANGES, 1, figure)
    assert axes[0].figure is figure
    dots, ring = axes[0].collections
    assert dots.get_offsets().tolist() == pytest.approx(np.array([[1.0, 0.9], [3.0, 0.7], [5.0, 0.5]]))
    assert ring.get_offsets().tolist() == pytest.approx(np.array([[3.0, 0.7]]))
    assert len(EVEN.plot_functions(FRONT, RANGES)[0].collections) == 1, "none is ringed where none is named"


def test_without_ranges_they_are_those_of_the_front() -> None:
    first, second = EVEN.plot_functions(FRONT)
    assert first.get_xlim() == pytest.approx((0.8, 5.2)) and second.get_xlim() == pytest.approx((7.6, 16.4))


def test_an_objective_that_does_not_enter_has_no_axes() -> None:
    (only,) = FuzzyGoal({"b": 15.0}).plot_functions(FRONT, RANGES)
    assert only.get_xlabel() == "b [m] →" and only.get_ylabel() == "membership"
    x, y = only.lines[0].get_data()
    assert np.interp([7.5, 15.0, 20.0], x, y) == pytest.approx([0.5, 1.0, 1.0], abs=1e-3)


# Bars


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


# Words


def test_what_it_speaks_of_is_said_and_checked() -> None:
    assert (EVEN.title, EVEN.words) == ("weighted sum", "weighted sum of a, b")
    assert PhysicalProgramming({"a": Smaller(1, 2, 3, 4, 5)}).words == "physical programming of a"
    EVEN.check((A, B))
    with pytest.raises(ValueError, match=r"^unknown objective 'b'"):
        EVEN.check((A,))
