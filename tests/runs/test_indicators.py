"""Indicators against closed forms and against pymoo."""

import numpy as np
import pytest
from pymoo.indicators.gd import GD
from pymoo.indicators.hv import HV
from pymoo.indicators.igd import IGD
from pymoo.indicators.igd_plus import IGDPlus
from pymoo.problems import get_problem

import runs
from macs import Front
from macs.evaluation.evaluator import CONVERGED
from problems.cases import goddard
from problems.compiled import Objective
from runs import additive_epsilon, gd, hypervolume, igd, igd_plus
from runs.measures.indicators import Scale, hypervolume_at
from runs.measures.references import foreign
from transcription.trajectories.costates import Costates

LINE = np.column_stack([np.linspace(0, 1, 101), np.linspace(1, 0, 101)])
CORNERS = np.array([[0.0, 1.0], [1.0, 0.0]])


@pytest.mark.parametrize("name", ["zdt1", "zdt3", "dtlz2"])
def test_as_pymoo_has_them_on_its_own_fronts(name):
    truth = get_problem(name).pareto_front()
    rng = np.random.default_rng(0)
    # Every fifth point, too sparse for a curve; and a front somewhat above, some of it at the border of the volume.
    R = truth[::5] if truth.shape[1] == 2 else truth
    ideal, nadir = R.min(axis=0), R.max(axis=0)
    F = truth[rng.choice(len(truth), 15, replace=False)] + 0.3 * rng.random((15, truth.shape[1])) * (nadir - ideal)
    scale = {"zero_to_one": True, "ideal": ideal, "nadir": nadir}
    for ours, theirs in ((gd, GD), (igd, IGD), (igd_plus, IGDPlus)):
        assert ours(F, R) == pytest.approx(theirs(R, **scale)(F), rel=1e-10)
        assert ours(F, R, normalise=False) == pytest.approx(theirs(R)(F), rel=1e-10)
    assert hypervolume(F, R) == pytest.approx(HV(ref_point=np.full(truth.shape[1], 1.1))((F - ideal) / (nadir - ideal)), rel=1e-10)


def test_what_did_not_converge_is_no_point():
    goals = (Objective("cost"), Objective("gain", sense="maximize"))
    F, status = [[0.0, -1.0], [0.5, 0.5], [-9.0, -9.0], [np.nan, np.nan]], ["converged", "converged", "infeasible", "failed"]
    front = Front(F=F, decision=[[]] * 4, violation=[0, 0, 1, np.inf], status=status, goals=goals)
    good = np.array([[0.0, 1.0], [0.5, -0.5]])
    truth = np.array([[0.0, 2.0], [1.0, 3.0], [0.2, 2.2]])
    for indicator in (gd, igd, igd_plus, additive_epsilon, hypervolume):
        assert indicator(front, truth) == indicator(good * [1, -1], truth * [1, -1])
    with pytest.raises(ValueError, match="row 1 of the front is not finite"):
        gd(np.array([[0.0, 1.0], [np.nan, 1.0]]), LINE)
    with pytest.raises(ValueError, match="row 0 of the reference is not finite"):
        gd(LINE, np.array([[np.inf, 1.0]]))


def test_the_scale_says_what_was_done():
    goals = (Objective("flight time", "s"), Objective("speed", "km/s", "maximize"))
    front = foreign(np.array([[110.0, 0.5]]), goals)
    truth = np.array([[100.0, 0.0], [200.0, 1.0], [150.0, 0.8], [300.0, 0.9]])
    scale = Scale.of(foreign(truth, goals), what="the closed form")
    assert scale.ideal == (100.0, 1.0) and scale.nadir == (200.0, 0.0) and scale.count == 3
    assert scale.corner == pytest.approx((210.0, -0.1))
    words = scale.describe()
    assert "nadir (flight time 200 s, speed 0 km/s) of the closed form (3 points)" in words
    assert "up to 1.1 in each objective (flight time 210 s, speed -0.1 km/s)" in words
    dense = foreign(goddard.reference(), goals)
    assert "(2 001 points, the curve through them)" in Scale.of(dense).describe()
    assert "(2 001 points)" in Scale.of(dense, curve=False).describe()
    # What the volume is measured in: the box from the front's point to the corner, in ranges.
    assert hypervolume(front, truth) == pytest.approx(np.prod((np.array(scale.corner) - [110, 0.5]) / [100, -1]))


def test_a_dense_reference_is_a_curve_in_pieces_by_their_lengths_unless_curve_is_false():
    between = np.array([[0.005, 0.995], [0.305, 0.695]])
    assert gd(between, LINE) == pytest.approx(0.0, abs=1e-14)
    assert gd(between + 0.01, LINE) == pytest.approx(0.01 * np.sqrt(2), rel=1e-9)
    assert gd(np.array([[0.31, 0.71], [0.53, 0.53]]), LINE) == pytest.approx(0.02 * np.sqrt(2)), "each point has its own distance"
    assert gd(between, CORNERS) > 0.1, "two points are no curve unless they are near"
    assert gd(between[:1], np.array([[0.0, 1.0], [0.01, 0.99], [0.99, 0.01], [1.0, 0.0]])) == pytest.approx(0.0, abs=1e-14)
    # From the middle of a straight front: mean distance of a segment's points from its middle is a quarter of its length.
    assert igd(np.array([[0.5, 0.5]]), LINE) == pytest.approx(np.sqrt(2) / 4, rel=1e-3)
    uneven = np.vstack([LINE[:50], np.column_stack([np.linspace(0.5, 1, 5000), np.linspace(0.5, 0, 5000)])])
    assert igd(np.array([[0.5, 0.5]]), uneven) == pytest.approx(np.sqrt(2) / 4, rel=1e-3)
    pieces = np.vstack([LINE[:31], LINE[70:]])
    assert gd(np.array([[0.5, 0.5]]), pieces) == pytest.approx(0.2 * np.sqrt(2), rel=1e-9)
    assert gd(np.array([[0.105, 0.895]]), pieces) == pytest.approx(0.0, abs=1e-14)
    assert igd(pieces, pieces) < 0.01
    cloud = np.vstack([LINE, LINE + 3.0])  # dominated points do not count
    assert gd(LINE, cloud) == 0.0 and igd(LINE, cloud) == igd(LINE, LINE)
    # From 0 to 0.3, and from 0.8 to 1 with many more points: the mean of t is 0.15 on the first, 0.9 on the second.
    share = np.concatenate([np.linspace(0.0, 0.3, 31), np.linspace(0.8, 1.0, 1001)])
    reference = np.column_stack([share, 1.0 - share])
    assert igd(np.array([[0.0, 1.0]]), reference) == pytest.approx((0.15 * 0.3 + 0.9 * 0.2) / 0.5 * np.sqrt(2), rel=2e-3)
    # Of a straight front with a spacing of 1/100, and of one whose second half has a hundred times as many points.
    between, end = np.array([[0.005, 0.995]]), np.array([[0.0, 1.0]])
    assert gd(between, LINE) == pytest.approx(0.0, abs=1e-14)
    assert gd(between, LINE, curve=False) == pytest.approx(0.005 * np.sqrt(2))
    share = np.concatenate([np.linspace(0.0, 0.49, 50), np.linspace(0.5, 1.0, 5000)])
    uneven = np.column_stack([share, 1.0 - share])
    # From its end a point at a share t is t sqrt(2) away, and worse by t in one objective.
    for indicator, unit in ((igd, np.sqrt(2)), (igd_plus, 1.0)):
        assert indicator(end, uneven) == pytest.approx(0.5 * unit, rel=1e-3)
        assert indicator(end, uneven, curve=False) == pytest.approx(share.mean() * unit)


def test_a_sparse_reference_with_rates_is_its_curve_unless_a_point_of_it_lies_before_that():
    """An arc of a circle about (1, 1), of which the second objective is maximised, and the arc 0.1 outside of it."""
    goals = (Objective("cost", "kg"), Objective("gain", "", "maximize"))

    def arc(radius, count):
        angles = np.radians(np.linspace(10.0, 80.0, count))
        directions = np.column_stack([np.cos(angles), np.sin(angles)])
        return 1.0 - radius * directions, [Costates(one / one.sum(), {}) for one in directions]

    def reference(F, costates):
        blank = {"decision": np.zeros((len(F), 0)), "violation": np.zeros(len(F)), "status": [CONVERGED] * len(F)}
        return Front(F=F, goals=goals, costates=costates, **blank)

    F, costates = arc(1.0, 5)
    five = reference(F, costates)
    outside = arc(0.9, 50)[0] * [1, -1]
    assert gd(outside, five, normalise=False) == pytest.approx(0.1, abs=1e-4) and gd(outside, five, curve=False, normalise=False) > 0.11
    assert gd(five, five) < 1e-6
    # From its middle: the mean chord of half of the arc.
    half = np.radians(35.0)
    assert igd(five[2:3], five, normalise=False) == pytest.approx(8 / half * np.sin(half / 4) ** 2, abs=1e-3)
    words = Scale.of(five).describe()
    assert "(5 points, the curve through them, known to about 2e-03)" in words and "known" not in Scale.of(five, curve=False).describe()
    behind, before = (np.vstack([F, [arc(radius, 8)[0][3]]]) for radius in (0.98, 1.02))
    assert gd(five, reference(behind, [*costates, None])) < 1e-6
    assert "curve" not in Scale.of(reference(before, [*costates, None])).describe()
    assert "curve" not in Scale.of(reference(F, [*costates[:2], None, None, None])).describe(), "its pieces are not all of it"


def test_volumes_and_distances_in_closed_form():
    assert hypervolume(CORNERS, CORNERS) == pytest.approx(0.1 * 1.1 * 2 - 0.1**2)
    assert hypervolume(LINE, LINE) == pytest.approx(0.5 + 2 * 0.1 + 0.01, abs=0.006)
    assert hypervolume(np.array([[2.0, 2.0]]), LINE) == 0.0
    assert hypervolume(CORNERS, CORNERS, point=2.0) == pytest.approx(2 * 2 - 1)
    assert hypervolume(CORNERS * [1, 7], CORNERS * [1, 7], normalise=False) == pytest.approx(7 * 0.21)
    assert additive_epsilon(CORNERS * [1, 7] + 0.25, CORNERS * [1, 7], normalise=False) == pytest.approx(0.25)
    assert additive_epsilon(LINE + 0.25, LINE) == pytest.approx(0.25)
    assert igd_plus(LINE - 0.1, LINE) == 0.0 < igd(LINE - 0.1, LINE)
    scaled = LINE * [1e-3, 1e5] + [7.0, -3.0]
    for indicator in (gd, igd, igd_plus, additive_epsilon, hypervolume):
        assert indicator(scaled + np.array([1e-4, 2e4]), scaled) == pytest.approx(indicator(LINE + np.array([0.1, 0.2]), LINE), rel=1e-6)
    assert gd(np.array([[2.0, 3.0]]), np.array([[1.0, 1.0]])) == pytest.approx(np.sqrt(5.0))
    assert hypervolume(np.array([[1.5, 1.5]]), np.array([[1.0, 1.0]])) == pytest.approx(0.6**2)
    # From (1 s, 9 m/s) to (5 s, 2 m/s) it is 4 by 7, and from (3 s, 10 m/s) 2 by 1 more; a point that failed adds nothing.
    goals = (Objective("time", "s"), Objective("speed", "m/s", "maximize"))
    status = ["converged", "converged", "infeasible"]
    front = Front(F=[[1.0, -9.0], [3.0, -10.0], [0.0, -20.0]], decision=[[]] * 3, violation=[0, 0, 1], status=status, goals=goals)
    assert hypervolume_at(front, (5.0, 2.0)) == pytest.approx(4 * 7 + 2 * 1)
    assert hypervolume_at(front, (5.0, 9.5)) == pytest.approx(2 * 0.5)
    assert hypervolume_at(front, (0.5, 2.0)) == hypervolume_at(front[front.status == "infeasible"], (5.0, 2.0)) == 0.0
    assert hypervolume_at(np.array([[1.0, -9.0], [3.0, -10.0]]), (5.0, -2.0)) == pytest.approx(30.0)


def test_empty_fronts_and_nonsense():
    empty = np.empty((0, 2))
    assert np.isnan(gd(empty, LINE)) and hypervolume(empty, LINE) == 0.0
    assert igd(empty, LINE) == igd_plus(empty, LINE) == additive_epsilon(empty, LINE) == np.inf
    with pytest.raises(ValueError, match="no points"):
        gd(LINE, empty)
    with pytest.raises(ValueError, match="2 objectives, the reference 3"):
        gd(LINE, np.zeros((1, 3)))
    with pytest.raises(ValueError, match="shape"):
        igd(np.zeros(2), LINE)
    with pytest.raises(AttributeError, match="hypervolum"):
        runs.hypervolum  # noqa: B018
    goals = [Objective("time", "s"), Objective("fuel", "kg")]
    for others in (goals[::-1], [goals[0], Objective("fuel", "t")], [goals[0], Objective("fuel", "kg", "maximize")]):
        with pytest.raises(ValueError, match="the reference has other objectives: minimize"):
            gd(foreign(np.ones((1, 2)), goals), foreign(np.ones((1, 2)), others))
    assert gd(foreign(np.ones((1, 2)), goals), foreign(np.ones((1, 2)), [goals[0], Objective("fuel", "kg", scale=2.0)])) >= 0.0


@pytest.mark.filterwarnings("error")
def test_an_array_beside_a_front_is_in_the_senses_of_the_user():
    """The reference is from (0, 1) to (1, 3), of which the second objective is maximised."""
    goals = (Objective("cost"), Objective("gain", sense="maximize"))
    truth = foreign(np.array([[0.0, 1.0], [1.0, 3.0]]), goals)
    assert gd(np.array([[0.5, 1.0]]), truth) == pytest.approx(0.5)
    assert hypervolume(np.array([[0.0, 3.0]]), truth) == pytest.approx(1.1 * 1.1)
    none = np.empty((0, 2))
    assert np.isnan(gd(none, truth)) and igd(none, truth) == np.inf and hypervolume(none, truth) == 0.0
