"""Figures of studies show what they were given. How they look was looked at."""

import sys

import moocore
import numpy as np
import pytest
from synthetic_fronts import flights

from macs.fronts.pictures.style import COLORS
from macs.pareto.dominance import nondominated
from problems.compiled import Objective
from runs.measures.attainment import attainment, band, staircase
from runs.measures.references import foreign
from runs.report.flights import flights_figure, paths_figure, representatives
from runs.report.plots import attainment_figure, convergence_figure, front_figure

GOALS = (Objective("flight time", "s"), Objective("speed", "km/s", "maximize"))
A = np.array([[1.0, 1.0], [3.0, 3.0]])
B = np.array([[2.0, 2.5]])
EMPTY = np.empty((0, 2))
TRUTH = np.column_stack([np.linspace(1, 3, 201), np.linspace(1.5, 3.5, 201)])


def lines(ax):
    return {line.get_label(): np.column_stack(line.get_data()) for line in ax.get_lines()}


def test_all_points_of_all_runs_and_the_truth(tmp_path):
    fronts = {"ours": [foreign(A, GOALS), foreign(B, GOALS), foreign(EMPTY, GOALS)], "theirs": [A - [0, 0.5]]}
    figure = front_figure(fronts, goals=GOALS, reference=TRUTH, marked=B)
    (ax,) = figure.axes
    drawn = lines(ax)
    assert drawn["ours, 3 runs (1 empty)"].tolist() == [[1, 1], [3, 3], [2, 2.5]]
    assert drawn["theirs, 1 run"].tolist() == (A - [0, 0.5]).tolist()
    assert drawn["truth"] == pytest.approx(TRUTH)
    assert ax.get_xlabel() == "← flight time [s]" and ax.get_ylabel() == "speed [km/s]\N{NO-BREAK SPACE}→"
    assert [text.get_text() for text in ax.texts] == ["1"]
    figure.savefig(tmp_path / "fronts.pdf")
    assert "matplotlib.pyplot" not in sys.modules or not sys.modules["matplotlib.pyplot"].get_fignums()


def test_more_objectives_are_drawn_in_pairs():
    goals = [Objective(f"objective {i}") for i in range(1, 5)]
    figure = front_figure({"ours": [np.eye(4)]}, goals=goals, reference=np.eye(4))
    assert len(figure.axes) == 6 and figure.axes[5].get_xlabel() == "← objective 3"


def test_each_of_many_solvers_has_panels_of_its_own_above_what_all_found_and_what_a_paper_prints():
    goals = [Objective(f"objective {i}") for i in range(1, 5)]
    fronts = {f"solver {k}": [k * np.eye(4)] for k in range(6)} | {"none": []}
    figure = front_figure(fronts, goals=goals, printed=[[1.0, 2.0, 3.0, 9.0]])
    assert {ax.get_title(loc="left") for ax in figure.axes} == {"", *(f"solver {k}, 1 run" for k in range(6))}
    assert len(figure.axes) == 18 and figure.axes[-1].get_ylim()[1] > 9.0, "three planes of each, one end of each axis"
    last = next(ax for ax in figure.axes if ax.get_title(loc="left") == "solver 5, 1 run")
    drawn = lines(last)
    assert drawn["printed in the paper"].tolist() == [[1, 2]] and len(drawn["all solvers"]) == 24
    assert [5.0, 0.0] in last.get_lines()[1].get_xydata().tolist() and last.get_lines()[1].get_color() == COLORS[5]
    three = front_figure(dict([*fronts.items()][:3]), goals=goals, reference=np.eye(4), printed=[[1.0, 2.0, 3.0, 9.0]])
    assert len(three.axes) == 6 and lines(three.axes[5])["printed in the paper"].tolist() == [[3, 9]]


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
    assert empty.axes[0].get_title(loc="left").endswith("(worst: not attained)")
    assert [text.get_text() for text in empty.legends[0].get_texts()] == ["truth", "best", "median", "worst"]


@pytest.mark.parametrize(("log", "times"), [(True, 2), (False, 2), (False, 20)])
def test_medians_over_what_was_spent(log, times, tmp_path):
    x = np.array([10.0, 20.0, 30.0])
    ours = [(x, np.array([np.inf, 2.0, 1.0])), (x, np.array([np.nan, 4.0, 2.0])), (x, np.array([3.0, 3.0, 0.5]))]
    figure = convergence_figure({"ours": ours, "theirs": [(x * times, np.array([5.0, 4.0, 3.0]))]}, xlabel="solves", ylabel="IGD", log=log)
    (ax,) = figure.axes
    drawn = lines(ax)
    assert np.isnan(drawn["ours, 3 runs"][0, 1]) and drawn["ours, 3 runs"][1:].tolist() == [[20, 3], [30, 1], [30 * times, 1]]
    assert ax.get_yscale() == ("log" if log else "linear") and ax.get_xlabel() == "solves"
    assert (ax.get_xscale(), *ax.get_xlim()) == (("linear", 0, 60) if times == 2 else ("log", 10, 600))
    assert ax.get_ylim()[0] < 0.75 and 5 < ax.get_ylim()[1] < 10
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


def test_paths_in_a_plane_and_what_a_case_derives_of_its_states():
    front = flights(3)
    points, law = [front[i] for i in range(3)], {"time": np.array([0.0, 5.0]), "h": np.array([1.0, 2.0])}

    def track(states):
        return {"h [km]": states["h"], "h [m]": 1e3 * states["h"]}

    ax = paths_figure(points, track, laws=[law, None, None], law_name="analytic law").axes[0]
    drawn = [line for line in ax.get_lines() if line.get_linestyle() == "-"]
    assert len(drawn) == sum(len(point.trajectory.phases) for point in points)
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_lines()[-1].get_ydata().tolist()) == ("h [km]", "h [m]", [1e3, 2e3])
    ends = [line for line in ax.get_lines() if line.get_marker() == "o"]
    assert [float(line.get_ydata()[0]) for line in ends] == pytest.approx([1e3 * ph["h"][-1] for p in points for ph in p.trajectory.phases])
    figure = flights_figure(points, laws=[law, None, None], derived=lambda states: {"twice h": 2.0 * states["h"]})
    names = [ax.get_ylabel() for ax in figure.axes if ax.get_ylabel()]
    assert names == ["h [km]", "v [km/s]", "twice h", "u [km/s²]"], "after the states"
    assert figure.axes[6].get_lines()[-1].get_ydata().tolist() == [2.0, 4.0]


# What many runs attain: surfaces by hand, against moocore and their definition; histories as median and quartiles


ENDS = np.array([[1.0, 3.0], [3.0, 1.0]])
MIDDLE = np.array([[2.0, 2.0]])
GAINS = (Objective("cost"), Objective("gain", "m", "maximize"))


def test_two_runs_by_hand_with_empty_fronts_senses_and_staircases():
    for runs in ([ENDS, MIDDLE], [MIDDLE, ENDS]):
        found = attainment(runs)
        assert found.best.tolist() == [[1, 3], [2, 2], [3, 1]]
        assert found.worst.tolist() == [[2, 3], [3, 2]]
        assert found.median.tolist() == found.best.tolist()
    found = attainment([ENDS, EMPTY, MIDDLE])
    assert found.runs == 3 and found.corners[1].tolist() == [[2, 3], [3, 2]] and found.worst.shape == (0, 2)
    assert found.median.tolist() == [[2, 3], [3, 2]]
    nothing = attainment([foreign(EMPTY, GAINS)] * 2)
    assert nothing.best.shape == (0, 2) and nothing.worst.shape == (0, 2)
    runs = [foreign(front * [1, -1], GAINS) for front in (ENDS, MIDDLE)]
    found, plain = attainment(runs), attainment([ENDS, MIDDLE])
    for k in (1, 2):
        assert (found.corners[k - 1] * [1, -1]).tolist() == plain.corners[k - 1].tolist()
    mixed = attainment([runs[0], MIDDLE * [1, -1]])
    assert mixed.worst.tolist() == found.worst.tolist()
    plain = staircase(ENDS, np.ones(2), np.array([5.0, 6.0]))
    assert plain.tolist() == [[1, 6], [1, 3], [3, 3], [3, 1], [5, 1]]
    turned = staircase(ENDS * [1, -1], np.array([1, -1]), np.array([5.0, -6.0]))
    assert (turned * [1, -1]).tolist() == plain.tolist()


@pytest.mark.parametrize(("m", "runs"), [(2, 7), (3, 5)])
def test_as_moocore_and_the_definition_have_them(m, runs):
    rng = np.random.default_rng(m)
    fronts = [rng.random((rng.integers(1, 7), m)) for _ in range(runs)]
    found = attainment(fronts)
    sets = np.repeat(np.arange(runs), [len(front) for front in fronts])
    anywhere = rng.random((300, m))
    attained = sum((front[:, None] <= anywhere).all(axis=2).any(axis=0).astype(int) for front in fronts)
    for k in range(1, runs + 1):
        theirs = moocore.eaf(np.vstack(fronts), sets, percentiles=[100 * k / runs])[:, :m]
        assert sorted(found.corners[k - 1].tolist()) == sorted(theirs.tolist())
        assert nondominated(found.corners[k - 1]).all()
        assert ((found.corners[k - 1][:, None] <= anywhere).all(axis=2).any(axis=0) == (attained >= k)).all()


def test_a_band_by_hand():
    runs = [(np.array([1.0, 3.0]), np.array([10.0, 4.0])), (np.array([2.0]), np.array([6.0])), (np.array([1.0, 2.0]), np.array([8.0, 1.0]))]
    found = band(runs)
    assert found.x.tolist() == [1, 2, 3] and found.runs == 3
    # Before its first sample the second run has failed; after its last each keeps its value.
    assert found.median.tolist() == [10.0, 6.0, 4.0]
    assert found.lower.tolist() == [9.0, 3.5, 2.5] and found.upper.tolist() == [np.inf, 8.0, 5.0]
    mirrored = band([(x, -y) for x, y in runs], larger=True)
    assert mirrored.median.tolist() == (-found.median).tolist() and mirrored.lower.tolist() == (-found.upper).tolist()
    x = np.array([0.0, 1.0])
    found = band([(x, np.array([np.nan, 2.0])), (x, np.array([np.inf, 3.0])), (x, np.array([1.0, 1.0]))])
    assert found.median.tolist() == [np.inf, 2.0] and found.lower.tolist() == [np.inf, 1.5]
