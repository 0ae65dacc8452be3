"""Figures of studies show what they were given. How they look was looked at."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from synthetic_fronts import flights

from problems.compiled import Objective
from runs.measures.attainment import attainment
from runs.measures.references import foreign
from runs.report.flights import flights_figure, representatives
from runs.report.plots import attainment_figure, convergence_figure, front_figure

GOALS = (Objective("flight time", "s"), Objective("speed", "km/s", "maximize"))
A = np.array([[1.0, 1.0], [3.0, 3.0]])
B = np.array([[2.0, 2.5]])
EMPTY = np.empty((0, 2))
TRUTH = np.column_stack([np.linspace(1, 3, 201), np.linspace(1.5, 3.5, 201)])


def lines(ax):
    return {line.get_label(): np.column_stack(line.get_data()) for line in ax.get_lines()}


def words(figure):
    own = [ax.get_legend() for ax in figure.axes if ax.get_legend()]
    return [text.get_text() for one in (*own, *figure.legends) for text in one.get_texts()]


def test_all_points_of_all_runs_and_the_truth(tmp_path):
    fronts = {"ours": [foreign(A, GOALS), foreign(B, GOALS), foreign(EMPTY, GOALS)], "theirs": [A - [0, 0.5]]}
    figure = front_figure(fronts, goals=GOALS, reference=TRUTH, marked=B)
    (ax,) = figure.axes
    drawn = lines(ax)
    assert drawn["ours, 3 runs (1 empty)"].tolist() == [[1, 1], [3, 3], [2, 2.5]]
    assert drawn["theirs, 1 run"].tolist() == (A - [0, 0.5]).tolist()
    assert drawn["truth"] == pytest.approx(TRUTH)
    assert ax.get_xlabel() == "← flight time [s]" and ax.get_ylabel() == "speed [km/s] →"
    assert [text.get_text() for text in ax.texts] == ["1"]
    figure.savefig(tmp_path / "fronts.pdf")
    assert "matplotlib.pyplot" not in sys.modules or not sys.modules["matplotlib.pyplot"].get_fignums()


def test_more_objectives_are_drawn_in_pairs():
    goals = [Objective(f"objective {i}") for i in range(1, 5)]
    figure = front_figure({"ours": [np.eye(4)]}, goals=goals, reference=np.eye(4))
    assert len(figure.axes) == 6 and figure.axes[5].get_xlabel() == "← objective 3"


def test_surfaces_are_staircases():
    figure = attainment_figure(
        {"ours": attainment([foreign(A, GOALS), foreign(B, GOALS)]), "theirs": attainment([A * [1, -1]])}, goals=GOALS
    )
    first, second = figure.axes
    drawn = lines(first)
    assert set(drawn) == {"best", "median", "worst"}
    assert {tuple(corner) for corner in [(1, 1), (2, 2.5), (3, 3)]} <= {tuple(corner) for corner in drawn["best"].tolist()}
    assert drawn["median"].tolist() == drawn["best"].tolist() and [3.0, 2.5] in drawn["worst"].tolist()
    steps = np.diff(drawn["worst"], axis=0)
    assert np.all((steps == 0).any(axis=1)), "up or across, never both"
    assert second.get_title(loc="left") == "theirs, 1 run" and second.get_xlim() == first.get_xlim()
    empty = attainment_figure({"ours": attainment([foreign(A, GOALS), foreign(EMPTY, GOALS)])}, goals=GOALS, reference=TRUTH)
    assert "worst: not attained" in words(empty)


@pytest.mark.parametrize("log", [True, False])
def test_medians_over_what_was_spent(log, tmp_path):
    x = np.array([10.0, 20.0, 30.0])
    ours = [(x, np.array([np.inf, 2.0, 1.0])), (x, np.array([np.nan, 4.0, 2.0])), (x, np.array([3.0, 3.0, 0.5]))]
    figure = convergence_figure({"ours": ours, "theirs": [(x * 2, np.array([5.0, 4.0, 3.0]))]}, xlabel="evaluations", ylabel="IGD", log=log)
    (ax,) = figure.axes
    drawn = lines(ax)
    assert np.isnan(drawn["ours, 3 runs"][0, 1]) and drawn["ours, 3 runs"][1:].tolist() == [[20, 3], [30, 1], [60, 1]]
    assert ax.get_yscale() == ("log" if log else "linear") and ax.get_xlabel() == "evaluations" and ax.get_xlim() == (0, 60)
    low, high = ax.get_ylim()
    assert low < 0.75 and 5 < high < 10
    figure.savefig(tmp_path / "convergence.png")


@pytest.mark.slow
def test_flights_side_by_side_and_the_law(tmp_path):
    front = flights(5)
    chosen = representatives(front, 3)
    assert len(chosen) == 3 and {int(np.argmin(front.F[:, 0])), int(np.argmin(front.F[:, 1]))} <= set(chosen)
    assert representatives(front, 9) == list(range(5))
    law = {"time": np.array([0.0, 5.0]), "h": np.array([1.0, 2.0])}
    figure = flights_figure([front[i] for i in chosen], laws=[law, None, law], law_name="analytic law", solver="ours")
    names = [ax.get_ylabel() for ax in figure.axes if ax.get_ylabel()]
    assert names == ["h [km]", "v [km/s]", "u [km/s²]"] and len(figure.axes) == 9
    assert figure.axes[0].get_lines()[-1].get_ydata().tolist() == [1.0, 2.0]
    assert len(figure.axes[0].get_lines()) == 3 and len(figure.axes[1].get_lines()) == 2, "two phases, and the law where there is one"
    assert figure.axes[0].get_title(loc="left").startswith("point 1\ntime ")
    figure.savefig(tmp_path / "flights.png")
