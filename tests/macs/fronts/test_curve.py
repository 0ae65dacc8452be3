"""The front as a curve: against fronts in closed form, with their slopes, kinks and gaps."""

import numpy as np
import pytest

from macs import Front, sweep
from macs.fronts.curve import GAPS
from macs.fronts.dataset import root_dataset
from problems import load
from problems.compiled import Objective
from tests import synthetic_fronts
from transcription import DFET
from transcription.trajectories.costates import Costates

GOALS = (Objective("time", "s", "minimize"), Objective("speed", "km/s", "maximize"))
SCALES = np.array([100.0, 3.0])  # ranges of the objectives: curves below are those of f in [0, 1]


def front(f, rates, weighed=True, goals=GOALS, **changes) -> Front:
    """A front with objectives (n, 2), minimised, in ranges, and rates df2/df1 (n,) there."""
    w = np.column_stack([np.where(np.isinf(rates), 1.0, -rates), np.where(np.isinf(rates), 0.0, 1.0)]) / SCALES
    costates = [Costates(one / one.sum(), {}) if weighed else None for one in w]
    variables, decision = synthetic_fronts.black_box(1).variables, np.zeros((len(f), 3))
    columns = {"F": f * SCALES, "decision": decision, "violation": np.zeros(len(f)), "status": ["converged"] * len(f)}
    return Front(**columns | {"costates": costates, "variables": variables, "goals": goals} | changes)


def seen(f):
    """Objectives in the user's units and senses."""
    return f * SCALES * [1.0, -1.0]


def quarter(count):
    """A quarter of a circle: vertical at the first end, horizontal at the other."""
    angles = np.linspace(0.0, np.pi / 2, count)
    with np.errstate(divide="ignore"):
        return 1.0 - np.column_stack([np.cos(angles), np.sin(angles)]), -1.0 / np.tan(angles)


def along(function, slope, x):
    return np.column_stack([x, function(x)]), slope(x)


def corner(x):
    """Two constraints, each active on one side of x = 0.5: no smooth front."""
    return along(lambda x: np.maximum(1.0 - 1.6 * x + 0.4 * x**2, 0.6 - 0.6 * x), lambda x: np.where(x < 0.5, -1.6 + 0.8 * x, -0.6), x)


def valleys(x):
    """Two valleys that cross at x = 0.4: a part of each is the front."""
    first, second = 1.0 - 0.6 * x - 0.2 * x**2, 1.2 - 1.18 * x
    return along(lambda x: np.minimum(first, second), lambda x: np.where(x < 0.4, -0.6 - 0.4 * x, -1.18), x)


def test_a_few_points_with_slopes_give_the_curve_within_its_error_also_at_a_vertical_and_a_horizontal_end():
    curve = front(*quarter(7)).curve()
    f, _ = quarter(1000)
    assert curve.distances(seen(f)).max() <= curve.error < 2e-3
    assert curve.message == ""
    assert curve.pieces.shape == (1, 2, 2)
    assert np.allclose(curve.pieces[0], seen(f[[0, -1]]))


def test_any_value_of_either_objective_is_found_and_what_is_off_the_front_is_no_number():
    curve = front(*quarter(15)).curve()
    f, rates = quarter(50)
    assert np.allclose(curve(seen(f)[:, 0]), seen(f), atol=1e-3)
    assert np.allclose(curve(seen(f)[:, 1].reshape(5, 10), "speed"), seen(f).reshape(5, 10, 2), atol=0.03)
    assert np.isnan(curve([-0.1, 100.1])).all() and np.isnan(curve(0.1, "speed")).all()
    assert np.allclose(curve.rates(seen(f)[1:-1, 0]), -rates[1:-1] * 0.03, rtol=0.02, atol=1e-5)
    assert np.allclose(curve.rates(seen(f)[1:-1, 1], 1), -1 / rates[1:-1] / 0.03, rtol=0.02, atol=0.02)
    assert curve.rates(0.0) == np.inf and curve.rates(100.0) == pytest.approx(0.0, abs=1e-4)
    with pytest.raises(ValueError, match="there is no objective 'mass'; there are time, speed"):
        curve(1.0, "mass")


def test_the_slope_at_an_end_is_not_believed_where_it_is_one_of_several():
    # At the end of a front the best of one objective is optimal with no weight on the other, whatever the slope there.
    f, rates = along(lambda x: 1.0 - 0.7 * x - 0.3 * x**2, lambda x: -0.7 - 0.6 * x, np.linspace(0, 1, 7))
    rates[0], rates[-1] = -np.inf, 0.0
    dense, _ = along(lambda x: 1.0 - 0.7 * x - 0.3 * x**2, lambda x: x, np.linspace(0, 1, 300))
    curve = front(f, rates).curve()
    assert curve.distances(seen(dense)).max() <= curve.error < 5e-4


@pytest.mark.parametrize("count", [6, 10, 11, 24])
@pytest.mark.parametrize(("shape", "place"), [(corner, 50.0), (valleys, 40.0)])
def test_pieces_end_at_kinks(shape, place, count):
    x = np.linspace(0, 1, count)
    f, rates = shape(x)
    rates[np.isclose(100 * x, place)] = -1.0  # a slope between those of both sides
    curve = front(f, rates).curve()
    assert len(curve.pieces) == 2
    assert curve.pieces[:, :, 0].ravel() == pytest.approx([0.0, place, place, 100.0], abs=0.01)
    assert curve.distances(seen(shape(np.linspace(0, 1, 1000))[0])).max() <= curve.error < 1e-3


def test_interpolants_that_agree_are_no_proof():
    # A parabola over the line between the ends: no interpolant differs from it. Something may hide between so few points all the same.
    s = np.linspace(0, 1, 5)
    h, slopes = 0.3 * ((2 * s - 1) ** 2 - 1), 1.2 * (2 * s - 1)
    inside = np.abs(slopes) < 1
    f = np.column_stack([s + h, 1 - s + h])[inside]
    assert 1e-4 < front(f, -(1 - slopes[inside]) / (1 + slopes[inside])).curve().error < 1e-2


def test_a_gap_is_where_a_side_would_be_dominated_by_itself():
    # The first arc is at its lowest at x = 0.4; the second one is as low as that at x = 0.6.
    def arcs(x):
        return along(
            lambda x: np.where(x < 0.5, 0.5 + 3 * (x - 0.4) ** 2, 0.8 - 0.5 * x), lambda x: np.where(x < 0.5, 6 * (x - 0.4), -0.5), x
        )

    f, rates = arcs(np.r_[np.linspace(0, 0.38, 8), np.linspace(0.62, 1.0, 6)])
    found = front(f, rates)
    curve = found.curve()
    assert curve.pieces[:, :, 0] == pytest.approx(np.array([[0, 40], [60, 100]]), abs=0.3)
    assert np.isnan(curve(50.0)).all() and np.isfinite(curve([39.5, 60.5])).all()
    assert np.isnan(curve.sample()).any(axis=1).sum() == 1
    line = found.plot().lines[0]
    assert np.isnan(line.get_ydata()).sum() == 1


def test_a_gap_that_a_search_has_seen_is_kept_whatever_the_slopes_are():
    x = np.r_[np.linspace(0, 0.3, 4), np.linspace(0.6, 1, 5)]
    f, rates = along(lambda x: 1.0 - x, lambda x: np.full(len(x), -1.0), x)
    assert len(front(f, rates).curve().pieces) == 1
    curve = front(f, rates, stats={GAPS: [[30.0, 60.0]]}).curve()
    assert curve.pieces[:, :, 0] == pytest.approx(np.array([[0, 30], [60, 100]]))


def test_without_weights_there_is_no_curve():
    found = front(*quarter(12), weighed=False)
    with pytest.raises(ValueError, match=r"a curve goes through two points .* of 12 points left out: 12 without weights"):
        found.curve()
    assert found.plot().lines == [] or not any(len(line.get_xdata()) > 12 for line in found.plot().lines)


def test_what_is_not_on_the_front_is_left_out_and_told():
    f, rates = quarter(9)
    f[4] += 0.2
    marked = front(f, rates, status=["converged"] * 7 + ["infeasible", "converged"])
    curve = marked.replace(costates=[None if k == 2 else one for k, one in enumerate(marked.costates)]).curve()
    assert curve.message == "of 9 points left out: 1 not feasible, 1 without weights, 1 dominated or equal"
    assert curve.distances(seen(quarter(500)[0])).max() <= curve.error < 0.02
    with pytest.raises(ValueError, match="of 9 points left out: 8 not verified"):
        synthetic_fronts.marked(front(*quarter(9)), [True] + [False] * 8).curve()


def test_pictures_show_it_where_it_is_known():
    """Slopes that contradict the points, as of local optima in many valleys: between these nobody knows the front."""
    f, rates = quarter(9)
    curve = front(f, rates * np.exp(2 * np.random.default_rng(0).standard_normal(9))).curve()
    known = curve.within()
    assert curve.error > 0.1 and known.error < 0.02
    gap, shown = seen(f[7:9]).mean(axis=0)[0], seen(f[1:3]).mean(axis=0)[0]
    assert np.isnan(known(gap)).all() and np.isfinite(curve(gap)).all() and np.isfinite(known(shown)).all()
    assert np.isnan(known.sample()).any() and len(curve.within(1.0).parts) == len(curve.parts)


def test_a_curve_is_of_two_objectives():
    with pytest.raises(ValueError, match="a curve is a front of two objectives, and this one has 3: 'f0', 'f1', 'f2'"):
        synthetic_fronts.black_box(m=3).curve()


def test_the_knee_is_farthest_from_the_line_between_the_ends():
    found = front(*quarter(9))
    assert found.knee().index == 4
    assert found.curve().knee == pytest.approx(seen(quarter(9)[0])[4], rel=1e-3)


def test_a_front_of_a_problem_is_a_curve_also_from_its_file(tmp_path):
    problem, mesh = load("goddard"), DFET(4, 6)
    found = sweep(problem, mesh, points=8, starts=1, verify=None)
    curve, dense = found.curve(), sweep(problem, mesh, points=12, starts=1, verify=None)
    assert curve.distances(dense.objectives).max() <= curve.error < 2e-3
    found.save(tmp_path / "front.nc")
    loaded = Front.load(tmp_path / "front.nc")
    assert np.array_equal(loaded.curve().sample(), curve.sample())
    assert np.array_equal(root_dataset(loaded)["curve_objectives"], curve.sample())
    assert "curve_objectives" not in root_dataset(loaded[:1]).arrays
