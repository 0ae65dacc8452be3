"""Figures of studies show what they were given. How they look was looked at."""

from __future__ import annotations

import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest
from synthetic_fronts import flights

from problems.compiled import Objective
from runs.measures.attainment import attainment
from runs.measures.references import foreign
from runs.report.flights import flights_figure, paths_figure, representatives
from runs.report.plots import attainment_figure, convergence_figure, front_figure, legend, new_figure

GOALS = (Objective("flight time", "s"), Objective("speed", "km/s", "maximize"))
A = np.array([[1.0, 1.0], [3.0, 3.0]])
B = np.array([[2.0, 2.5]])
EMPTY = np.empty((0, 2))
TRUTH = np.column_stack([np.linspace(1, 3, 201), np.linspace(1.5, 3.5, 201)])


@pytest.mark.slow
def test_nothing_heavy_is_imported_before_it_is_used():
    code = (
        "import sys, runs.report.plots, runs.report.flights, runs.report.comparison_tables\n"
        "import runs.measures.references, runs.measures.attainment\n"
        "heavy = [m for m in ('matplotlib', 'scipy.stats', 'xarray', 'pymoo') if m in sys.modules]\n"
        "sys.exit(str(heavy) if heavy else 0)"
    )
    run = subprocess.run([sys.executable, "-c", code], env={"PYTHONPATH": ":".join(sys.path)}, capture_output=True, text=True, timeout=60)
    assert run.returncode == 0, run.stderr


def lines(ax):
    return {line.get_label(): np.column_stack(line.get_data()) for line in ax.get_lines()}


def words(figure):
    return [legend_text.get_text() for ax in figure.axes if ax.get_legend() for legend_text in ax.get_legend().get_texts()]


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


def test_no_two_of_many_solvers_look_alike():
    figure = front_figure({f"solver {k}": [foreign(A, GOALS)] for k in range(20)}, goals=GOALS)
    looks = {(line.get_color(), line.get_marker()) for line in figure.axes[0].get_lines()}
    assert len(looks) == 20


def test_arrays_without_a_shape_of_their_own_are_empty_runs():
    figure = front_figure({"ours": [foreign(A, GOALS), np.empty((0, 0))]}, goals=GOALS)
    assert words(figure) == ["ours, 2 runs (1 empty)"]


def test_a_solver_without_runs_is_not_in_the_legend():
    with_it, without = (front_figure({**first, "ours": [A]}, goals=GOALS) for first in ({"late": [B]}, {"late": []}))
    assert len(words(with_it)) == 2 and words(without) == [words(with_it)[1]]
    colors = [figure.axes[0].get_lines()[-1].get_color() for figure in (with_it, without)]
    assert colors[0] == colors[1], "the same as beside the other"


def test_a_truth_of_few_points_is_no_line():
    figure = front_figure({"ours": [A]}, reference=TRUTH[::50], goals=GOALS)
    assert [line.get_linestyle() for line in figure.axes[0].get_lines()] == ["None", "None"]


def test_more_objectives_are_drawn_in_pairs():
    goals = [Objective(f"objective {i}") for i in range(1, 5)]
    figure = front_figure({"ours": [np.eye(4)]}, goals=goals, reference=np.eye(4))
    assert len(figure.axes) == 6 and figure.axes[5].get_xlabel() == "← objective 3"
    with pytest.raises(ValueError, match="two or more objectives"):
        front_figure({"ours": []}, goals=goals[:1])


@pytest.mark.slow
@pytest.mark.parametrize("m", [5, 6])
def test_panels_of_many_objectives_do_not_fill_the_last_row(m):
    goals = [Objective(f"objective {i} with a name that is longer than a panel is high", "kg") for i in range(m)]
    figure = front_figure({"ours": [np.eye(m)]}, goals=goals)
    assert len(figure.axes) == m * (m - 1) // 2
    figure.draw_without_rendering()
    for ax in figure.axes:
        for axis, side in ((ax.xaxis, "width"), (ax.yaxis, "height")):
            text = axis.label.get_window_extent()
            assert getattr(text, side) < getattr(ax.bbox, side)


@pytest.mark.slow
def test_long_names_of_solvers_stay_above_their_panels():
    names = [f"the solver of the paper, until it has settled, number {k}" for k in range(3)]
    figure = attainment_figure({name: attainment([foreign(A, GOALS), foreign(B, GOALS)]) for name in names}, goals=GOALS)
    figure.draw_without_rendering()
    titles = [ax.get_title("left") for ax in figure.axes]
    assert all(" ".join(title.split()) == f"{name}, 2 runs" for title, name in zip(titles, names, strict=True))
    extents = [ax._left_title.get_window_extent() for ax in figure.axes]
    assert all(one.x1 < other.x0 for one, other in pairwise(extents)) and extents[-1].x1 < figure.bbox.x1


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
    goals = [Objective(f"objective {i}") for i in range(1, 4)]
    with pytest.raises(ValueError, match="two objectives, not of 3"):
        attainment_figure({"ours": attainment([np.eye(3)])}, goals=goals)


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


@pytest.mark.parametrize(("values", "inside"), [([0.2, 0.9, 0.95, 1.0], True), ([0.2, 0.25, 0.27, 1.0], False)])
def test_no_legend_on_a_line(values, inside):
    """The second curve jumps at its end, as after a polish, and is low where the legend would be."""
    run = (np.array([100.0, 400.0, 900.0, 1000.0]), np.array(values))
    figure = convergence_figure({"ours": [run]}, xlabel="evaluations", ylabel="hypervolume", larger=True, log=False)
    (ax,) = figure.axes
    assert (ax.get_legend() is not None) == inside and len(figure.legends) == (not inside)


def test_a_legend_is_where_the_layout_puts_it():
    """A label of many lines makes room for the axes scarce: their legend then covers more of them, and a line beside it."""

    def drawn(place: float, laid_out: bool = False):
        figure = new_figure(3.5, 2.5)
        ax = figure.subplots()
        ax.set(xlim=(0, 1), ylim=(0, 1), ylabel="\n" * 5)
        ax.axvline(place, label="a line")
        if laid_out:
            figure.get_layout_engine().execute(figure)
        return figure, ax

    def left(laid_out: bool) -> float:
        """Of the legend, in parts of the axes."""
        _, ax = drawn(0.0, laid_out)
        box = ax.legend(loc="upper right", frameon=False, handlelength=1.6).get_window_extent()
        return float(ax.transAxes.inverted().transform(box)[0, 0])

    loose, tight = left(False), left(True)
    assert tight < loose - 0.05, "else this test says nothing"
    for place, inside in ((0.5 * (loose + tight), False), (tight - 0.1, True)):
        figure, ax = drawn(place)
        legend(figure, ax, "upper right")
        assert (ax.get_legend() is not None) == inside and len(figure.legends) == (not inside)


@pytest.mark.slow
def test_flights_side_by_side_and_the_law(tmp_path):
    front = flights(5)
    chosen = representatives(front, 3)
    assert len(chosen) == 3 and {int(np.argmin(front.F[:, 0])), int(np.argmin(front.F[:, 1]))} <= set(chosen)
    assert representatives(front, 9) == list(range(5))
    law = {"time": np.array([0.0, 5.0]), "h": np.array([1.0, 2.0])}
    figure = flights_figure([front[i] for i in chosen], laws={"analytic law": [law, None, law]}, solver="ours")
    names = [ax.get_ylabel() for ax in figure.axes if ax.get_ylabel()]
    assert names == ["h [km]", "v [km/s]", "u [km/s²]"] and len(figure.axes) == 9
    assert figure.axes[0].get_lines()[-1].get_ydata().tolist() == [1.0, 2.0]
    assert len(figure.axes[0].get_lines()) == 3 and len(figure.axes[1].get_lines()) == 2, "two phases, and the law where there is one"
    assert figure.axes[0].get_title(loc="left").startswith("point 1\ntime ")
    figure.savefig(tmp_path / "flights.png")


def test_paths_in_one_picture():
    front = flights(3)
    law = {"time": np.array([0.0, 1.0]), "h": np.array([1.0, 2.0])}

    def track(v):
        return {"h [km]": v["h"], "twice h [km]": 2 * v["h"]}

    figure = paths_figure([front[0], front[2]], track, laws={"analytic law": [None, law]})
    (ax,) = figure.axes
    drawn = [np.column_stack(line.get_data()) for line in ax.get_lines()]
    assert len(drawn) == 7, "two phases and an end each, and a law"
    assert all(np.allclose(path[:, 1], 2 * path[:, 0], equal_nan=True) for path in drawn)
    assert words(figure) == ["point 1", "point 2", "analytic law"] and ax.get_xlabel() == "h [km]" and ax.get_ylabel() == "twice h [km]"
    assert len(paths_figure([front[0]], track, laws={"analytic law": [{}]}).axes[0].get_lines()) == 3


def test_flights_that_cannot_be_drawn():
    front = flights(2)
    with pytest.raises(ValueError, match="1 laws do not stand beside 2 points"):
        flights_figure([front[0], front[1]], laws={"analytic law": [None]})
    with pytest.raises(ValueError, match="of one to six points, not of 0"):
        flights_figure([])
    with pytest.raises(ValueError, match="point 1 of those to draw has no trajectory"):
        flights_figure([foreign(A, GOALS)[0]])


@pytest.mark.filterwarnings("error")
def test_an_indicator_that_is_zero_is_drawn_on_a_linear_axis():
    figure = convergence_figure({"ours": [(np.array([1.0, 2.0]), np.zeros(2))]}, xlabel="evaluations", ylabel="IGD")
    (ax,) = figure.axes
    assert ax.get_yscale() == "linear" and ax.get_ylim()[0] < 0 < ax.get_ylim()[1]
