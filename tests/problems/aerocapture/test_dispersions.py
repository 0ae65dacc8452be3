"""Capsules under dispersions against DOP853 in Cartesian coordinates, roots of other code, and what must hold for any draws."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from truths.corridor import DENSITY, MU, RADIUS, TARGET, TOP, apoapsis, planar

from macs import payoff
from problems import load
from problems.cases.aerocapture import bank
from problems.cases.aerocapture.designs import TABLE_2, assess, shapes_of
from problems.cases.aerocapture.dispersions import NOMINAL, Capsule, Cases, Dispersions, fly, two_burns, with_same_bank, with_solved_bank
from problems.cases.aerocapture.mars import MARS, circularisation, exit_angle
from transcription import stated

RTOL = 1e-6


@cache
def capsule(number: int) -> Capsule:
    """A solution of Table 2 with its constant bank."""
    X = np.array([TABLE_2[number].design])
    found, nose = assess(X), shapes_of(X)[0].nose
    return Capsule(*(float(c[0]) for c in (found.ballistic, found.lift_to_drag, nose, found.entry_angle, found.bank)))


def over_a_plain(design: Capsule, upward, case: Cases, row: int):
    """How a case ends, see `planar`."""
    angle, ballistic = design.entry_angle + case.entry_angle[row], float(design.ballistic * case.ballistic[row])
    return planar(angle, ballistic, upward, float(DENSITY * case.density[row]))


def upward_of(design: Capsule):
    if callable(design.bank):
        return lambda t: design.lift_to_drag * np.cos(float(design.bank(np.array([t]))[0]))
    constant = float(design.lift_to_drag * np.cos(design.bank))
    return lambda _: constant


@pytest.mark.parametrize("number", TABLE_2)
def test_without_dispersion_it_is_the_nominal_passage(number):
    """The passage is solved by collocation from the exit back to the entry; this is flown forward."""
    design, nominal = capsule(number), assess(np.array([TABLE_2[number].design]))
    found = with_same_bank(design, NOMINAL)
    assert found.captured[0] and not found.lost[0]
    assert found.apoapsis_error[0] == pytest.approx(0.0, abs=1e-3)
    assert found.delta_v[0] == pytest.approx(circularisation(3500.0), rel=RTOL)
    assert found.shield[0] == pytest.approx(nominal.shield[0], rel=RTOL)
    assert found.lowest[0] == pytest.approx(nominal.lowest[0] / 1e3, rel=RTOL)
    anew = with_solved_bank(design, NOMINAL)
    assert anew.on_target[0] and anew.upward[0] == pytest.approx(nominal.lift[0], abs=RTOL)


@pytest.mark.slow
@pytest.mark.parametrize("design", [capsule(1), capsule(5)])
def test_cases_flown_by_other_code(design):
    """Those that come out, captured or not, to 1e-6; and nothing else is captured or lost."""
    cases = Dispersions(cases=14, seed=5).draw()
    exits, outcome = fly(design, cases, design.upward), with_same_bank(design, cases)
    met = set()
    for row in range(len(cases)):
        end, least = over_a_plain(design, upward_of(design), cases, row)
        assert outcome.lost[row] == (end is None)
        if end is None:
            assert not outcome.captured[row] and np.isnan(outcome.delta_v[row])
            met.add("lost")
            continue
        assert exits.speed[row] == pytest.approx(end[1], rel=RTOL)
        assert exits.path_angle[row] == pytest.approx(end[2], abs=RTOL)
        assert exits.heat[row] == pytest.approx(end[-1], rel=RTOL)
        assert exits.lowest[row] == pytest.approx(least, rel=RTOL)
        above = (apoapsis(end[1], end[2]) - RADIUS) / 1e3
        assert outcome.captured[row] == (above <= 10_000)
        met.add("captured" if above <= 10_000 else "away")
        if outcome.captured[row]:
            assert outcome.apoapsis_error[row] == pytest.approx(above - 200.0, rel=1e-5, abs=1e-2)
            assert outcome.shield[row] == pytest.approx(0.091 * (end[-1] / np.sqrt(design.nose)) ** 0.51575, rel=RTOL)
            assert outcome.lowest[row] == pytest.approx(least / 1e3, rel=RTOL)
    assert {"lost", "captured"} <= met


def test_the_farthest_apoapsis_that_counts():
    """On both sides of 10,000 km, and of the parabola: lift over drags found by a root of other code."""
    design = capsule(2)

    def above(upward: float) -> float:
        end, _ = over_a_plain(design, lambda _: upward, NOMINAL, 0)
        return 1.0 / apoapsis(end[1], end[2]) if end is not None else 1.0

    start = design.lift_to_drag * np.cos(design.bank)
    limit = brentq(lambda u: above(u) - 1.0 / (RADIUS + 10_000e3), start, start + 0.06, xtol=1e-10)
    for upward, inside in ((limit - 1e-6, True), (limit + 1e-6, False), (limit + 0.05, False), (0.3, False)):
        flight = Capsule(design.ballistic, 1.0, design.nose, design.entry_angle, np.arccos(upward))
        found = with_same_bank(flight, NOMINAL)
        assert found.captured[0] == inside and not found.lost[0]
    assert found.measures()["delta v, P99", "m/s"] is None


@pytest.mark.slow
def test_not_enough_lift_is_flown_with_all_of_it():
    """A steep case needs more lift upward than there is, shallow ones more downward; none is on target, but one is captured."""
    most = abs(capsule(2).lift_to_drag * np.cos(capsule(2).bank)) + 0.01
    weak = Capsule(capsule(2).ballistic, -most, 1.0, capsule(2).entry_angle, 0.0)
    cases = Cases(np.radians([-2.0, 0.0, 0.5, 0.05]), np.ones(4), np.ones(4))
    found = with_solved_bank(weak, cases)
    assert found.upward[[0, 2, 3]].tolist() == [most, -most, -most]
    assert found.on_target.tolist() == [False, True, False, False]
    assert found.captured.tolist() == [False, True, False, True]
    assert found.lost.tolist() == [True, False, False, False]


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(st.floats(0.7, 1.4), st.floats(-0.2, 0.2), st.sampled_from(sorted(TABLE_2)))
def test_density_and_ballistic_coefficient_together_change_only_the_heat(factor, angle, number):
    """The motion depends on their ratio; the heating rate goes with the root of the density."""
    design = capsule(number)
    tilt, one = np.full(2, np.radians(angle)), np.array([1.0, factor])
    exits = fly(design, Cases(tilt, one, one), lambda rows, _: np.full(len(rows), 0.1))
    np.testing.assert_allclose(exits.speed[1], exits.speed[0], rtol=1e-7)
    np.testing.assert_allclose(exits.lowest[1], exits.lowest[0], rtol=1e-7)
    np.testing.assert_allclose(exits.heat[1], np.sqrt(factor) * exits.heat[0], rtol=1e-7)


def test_two_burns():
    """Of an exit to the target that of the paper; else the sum of two differences of speeds by vis-viva."""
    angle = exit_angle(3500.0)
    assert two_burns(np.array([3500.0]), np.array([angle]))[0] == pytest.approx(circularisation(3500.0), rel=1e-12)
    speed, path = np.array([3480.0, 3600.0, 4500.0]), np.array([0.01, 0.05, 0.1])
    for v, g, found in zip(speed, path, two_burns(speed, path), strict=True):
        r = apoapsis(v, g)
        between = 2 * MU / (r + TARGET)
        at_apoapsis = abs(np.sqrt(2 * MU / r - between) - TOP * v * np.cos(g) / r)
        assert found == pytest.approx(at_apoapsis + abs(np.sqrt(2 * MU / TARGET - between) - np.sqrt(MU / TARGET)), rel=1e-9)
    assert MARS.target_radius == TARGET


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bits():
    """And a case does not depend on the others."""
    settings_ = Dispersions(cases=200, seed=7)
    cases = settings_.draw()
    again = settings_.draw()
    assert cases.entry_angle.tobytes() == again.entry_angle.tobytes()
    assert cases.density.tobytes() != Dispersions(cases=200, seed=8).draw().density.tobytes()
    design, some = capsule(2), np.arange(3, 200, 7)
    whole, part = with_same_bank(design, cases), with_same_bank(design, cases[some])
    assert whole.apoapsis_error[some].tobytes() == part.apoapsis_error.tobytes()
    assert with_solved_bank(design, cases).upward.tobytes() == with_solved_bank(design, again).upward.tobytes()


def test_draws_are_normal():
    """Means and standard deviations within four standard errors, and no correlation."""
    cases = Dispersions(cases=40_000, seed=2).draw()
    values = np.array([np.degrees(cases.entry_angle) / 0.1, (cases.density - 1) / 0.1, (cases.ballistic - 1) / 0.02])
    np.testing.assert_allclose(values.mean(axis=1), 0.0, atol=4 / 200)
    np.testing.assert_allclose(np.cov(values), np.eye(3), atol=4 * np.sqrt(2) / 200)


@pytest.mark.parametrize(
    ("given_", "words"),
    [
        ({"cases": 0}, "cases must be a whole number of at least 1"),
        ({"cases": 10.5}, "cases must be a whole number"),
        ({"seed": -1}, "seed must be a whole number of at least 0"),
        ({"density": -0.1}, "density must be in .0, 0.2."),
        ({"entry_angle": 2.0}, "entry_angle must be in .0, 1."),
        ({"ballistic": float("nan")}, "ballistic"),
    ],
)
def test_settings_that_make_no_sense(given_, words):
    with pytest.raises(ValueError, match=words):
        Dispersions(**given_)


@pytest.mark.slow
def test_points_of_the_bank_problem_fly_their_profiles():
    """The nominal case of both ends of the front has the objectives that the simulation of the whole motion in space finds."""
    problem = load("aerocapture_bank")
    front = payoff(problem, stated(problem.default_transcription), starts=1)
    for point, found in zip(front, bank.dispersed(front, Dispersions(cases=3)), strict=True):
        simulated = point.simulate(rtol=1e-10).objectives
        nominal = found["nominal"]
        assert abs(nominal.apoapsis_error[0]) < 0.5
        assert nominal.shield[0] == pytest.approx(simulated["TPS mass fraction"], rel=1e-4)
        assert nominal.delta_v[0] == pytest.approx(simulated["delta v"], abs=0.3)
        assert found["bank solved anew"].on_target.all() and len(found["bank as it is"].captured) == 3
