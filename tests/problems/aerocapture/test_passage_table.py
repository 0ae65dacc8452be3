"""The table against the solver, and all columns of Tables 1 and 2 of the paper."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from problems.cases.aerocapture.designs import BOUNDS, Designs, judged, shapes_of
from problems.cases.aerocapture.heating import allowed_load, heating_rate, shield_fraction
from problems.cases.aerocapture.passage import RANGE, Passage, passages
from problems.cases.aerocapture.passage_table import COLUMNS, outside, tabulated
from problems.cases.aerocapture.printed import TABLE_1, TABLE_2

SOLUTIONS = judged(np.array([p.design for p in TABLE_2.values()]))


@pytest.mark.parametrize("passage", [Passage(), Passage(arrival_speed=4200.0, exit_speed=3480.0)])
def test_the_table_agrees_with_the_solver(passage):
    ballistic = np.exp(np.random.default_rng(0).uniform(*np.log(RANGE), 200))
    ballistic[:2] = RANGE
    solved, found = passages(ballistic, passage), tabulated(ballistic, passage)
    for name in COLUMNS:
        np.testing.assert_allclose(getattr(found, name), getattr(solved, name), rtol=1e-6, err_msg=name)


@pytest.mark.parametrize("ballistic", [RANGE[0] / 1.01, RANGE[1] * 1.01, np.nan])
def test_outside_the_table(ballistic):
    assert outside([100.0, ballistic])[0] == ""
    assert "outside the table" in outside([100.0, ballistic])[1]
    with pytest.raises(ValueError, match="outside the table"):
        tabulated([100.0, ballistic])


def printed(name: str) -> list[float]:
    return [getattr(p, name) for p in TABLE_2.values()]


def test_table_2():
    """Scale height, density, wall enthalpy and mass over pressure coefficient were fitted to these numbers and to Table 1."""
    assert list(SOLUTIONS.reason) == [""] * 5
    np.testing.assert_allclose(SOLUTIONS.lowest / 1e3, printed("lowest"), atol=0.25)
    angles = np.abs(np.degrees(SOLUTIONS.entry_angle) - printed("entry_angle"))
    assert (angles <= [0.02, 0.02, 0.02, 0.02, 0.08]).all()
    np.testing.assert_allclose(np.degrees(SOLUTIONS.bank), printed("bank"), atol=0.3)
    np.testing.assert_allclose(SOLUTIONS.shield, printed("shield"), rtol=0.01)
    np.testing.assert_allclose(SOLUTIONS.ballistic, printed("ballistic"), rtol=0.01)


def test_table_1():
    """What depends on the ballistic coefficient alone: altitude, entry angle, lift. Its lift over drag is printed with two digits."""
    rows = np.array(list(TABLE_1.values()))
    found = tabulated(rows[:, 3])
    np.testing.assert_allclose(found.lowest / 1e3, rows[:, 4], atol=0.25)
    np.testing.assert_allclose(np.degrees(found.entry_angle), rows[:, 5], atol=0.02)
    np.testing.assert_allclose(found.lift, rows[:, 1] * np.cos(np.radians(rows[:, 2])), atol=0.005)


def test_what_cannot_be_judged_has_a_reason_and_disturbs_no_other_row():
    X = np.array([TABLE_2[2].design, (-1.0, 0.3, 50.0, 30.0, 10.0), (0.5, 0.4, 50.0, 70.0, 25.0), TABLE_2[3].design])
    found = judged(X)
    assert [bool(reason) for reason in found.reason] == [False, True, True, False]
    np.testing.assert_array_equal(found.shield[[0, 3]], SOLUTIONS.shield[[1, 2]])
    flat = judged(np.array([(0.9, 0.2, 70.0, 5.0, 0.0)]))
    assert "more lift than there is" in flat.reason[0]
    assert all(np.isfinite(getattr(flat, f.name)).all() for f in fields(Designs) if f.name != "reason")


def test_all_of_the_box_is_in_the_table():
    X = np.random.default_rng(2).uniform(*np.array(BOUNDS).T, (3000, 5))
    corners = np.array(np.meshgrid(*BOUNDS)).reshape(5, -1).T
    found = judged(np.vstack([X, corners]))
    assert np.isfinite(found.shield).all()
    assert not any("table" in reason for reason in found.reason)


def test_the_angle_of_attack_has_a_mirror_image():
    X = np.array([p.design for p in TABLE_2.values()])
    mirrored = judged(X * [1, 1, 1, 1, -1])
    np.testing.assert_allclose(mirrored.lift_to_drag, -SOLUTIONS.lift_to_drag)
    np.testing.assert_allclose(mirrored.bank, np.pi - SOLUTIONS.bank)
    np.testing.assert_allclose(mirrored.shield, SOLUTIONS.shield)


def test_a_faulty_shape_is_named():
    with pytest.raises(ValueError, match="capsule 1: the rear cone is lit"):
        shapes_of(np.array([TABLE_2[2].design, (0.5, 0.4, 50.0, 70.0, 25.0)]))


def test_shields():
    """6.3 kJ/cm2 by hand: 0.091 * 6300^0.51575; eq. (4) by hand at 1e-4 kg/m3, 5 km/s and a nose of 4 m, without a hot wall."""
    assert shield_fraction(6300.0) == pytest.approx(0.091 * np.exp(0.51575 * np.log(6300.0)), rel=1e-12)
    assert allowed_load(shield_fraction(6300.0)) == pytest.approx(6300.0)
    assert heating_rate(1e-4, 5000.0, 4.0, wall_enthalpy=0.0) == pytest.approx(1.35e-8 * 5e-3 * 5000.0**3.04)
    assert heating_rate(1e-4, 5000.0, wall_enthalpy=12.5e6) == pytest.approx(0.0, abs=1e-12)
