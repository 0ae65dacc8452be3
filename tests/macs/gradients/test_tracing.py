"""sweep(error=): fronts in closed form are traced to what was asked for, with their kinks and gaps."""

from functools import cache

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import brentq
from smooth_problems import corners, still, two_wells

from macs import MACS, Front, sweep
from macs.fronts.curve import GAPS
from problems import Problem
from transcription import DFET

MESH, X = DFET(1, 2), np.linspace(0.0, 1.0, 2001)


def corner() -> Problem:
    """Two constraints, each active on one side of the corner at (0.5, 0.3)."""
    problem = still("corner")
    a, b = problem.parameter("a", bounds=(0, 1)), problem.parameter("b", bounds=(-1, 2))
    problem.constraint("one", b - (1 - 1.6 * a + 0.4 * a**2), lower=0)
    problem.constraint("two", b - (0.6 - 0.6 * a), lower=0)
    problem.minimize("first", a)
    problem.minimize("second", b)
    return problem


def valleys() -> Problem:
    """c is near -1 in one valley and near 1 in another: their fronts cross at 0.4."""
    problem = still("valleys")
    a, c = problem.parameter("a", bounds=(0, 1)), problem.parameter("c", bounds=(-1.5, 1.5))
    between, high = 0.5 * (1 + c), 50 * (c**2 - 1) ** 2
    problem.minimize("first", a + high)
    problem.minimize("second", (1 - between) * (1 - 0.6 * a - 0.2 * a**2) + between * (1.2 - 1.18 * a) + high)
    return problem


def wave(a):
    return 1 - a + 0.25 * np.sin(3 * np.pi * a)


def gaps() -> Problem:
    """From its first end alone there is nothing before the wave is as low; and nothing from its trough to where it is as low again."""
    problem = still("gaps")
    a = problem.parameter("a", bounds=(0, 1))
    problem.minimize("first", a)
    problem.minimize("second", 1 - a + 0.25 * ca.sin(3 * ca.pi * a))
    return problem


@cache
def traced(state) -> Front:
    return sweep(state(), MESH, error=1e-3, starts=4)


@pytest.mark.parametrize(
    ("state", "front", "kink"),
    [
        (corner, np.column_stack([X, np.maximum(1 - 1.6 * X + 0.4 * X**2, 0.6 - 0.6 * X)]), [0.5, 0.3]),
        (valleys, np.column_stack([X, np.minimum(1 - 0.6 * X - 0.2 * X**2, 1.2 - 1.18 * X)]), [0.4, 0.728]),
        (two_wells, np.column_stack([X**2, (X - 1) ** 2]), None),
    ],
)
def test_few_points_are_a_front_with_its_kink(state, front, kink):
    found = traced(state)
    curve = found.curve()
    assert 5 <= len(found) <= 16 and found.message.count("curve") == 0
    assert curve.distances(front).max() <= curve.error < 1e-3
    assert len(curve.pieces) == 1 + (kink is not None)
    if kink:
        assert curve.pieces[0, 1] == pytest.approx(kink, abs=1e-3) and curve.pieces[1, 0] == pytest.approx(kink, abs=1e-3)


@pytest.mark.slow
def test_gaps_are_where_nothing_is():
    curve = traced(gaps).curve()
    trough = brentq(lambda a: 0.75 * np.pi * np.cos(3 * np.pi * a) - 1, 0.5, 0.6)
    edges = [0, 0, brentq(lambda a: wave(a) - 1, 0.1, 0.3), trough, brentq(lambda a: wave(a) - wave(trough), 0.8, 1), 1]
    assert curve.pieces[:, :, 0].ravel() == pytest.approx(np.array(edges), abs=2e-3)
    x = np.concatenate([np.linspace(*edges[2:4], 500), np.linspace(*edges[4:], 500)])
    assert curve.distances(np.column_stack([x, wave(x)])).max() <= curve.error < 1e-3
    assert traced(gaps).stats[GAPS] == [[pytest.approx(0.0, abs=1e-6), pytest.approx(edges[2], abs=2e-3)]]


def test_an_error_and_a_number_of_points_exclude_each_other():
    with pytest.raises(ValueError, match="give either points or error"):
        sweep(corner(), MESH, points=5, error=1e-2)
    with pytest.raises(ValueError, match=r"error must be in \(0, 1\], not 0"):
        sweep(corner(), MESH, error=0)
    with pytest.raises(ValueError, match="error is for fronts of two objectives by 'pascoletti-serafini'; give points instead"):
        sweep(corners(), MESH, error=1e-2)
    with pytest.raises(ValueError, match="error is for fronts of two objectives by 'pascoletti-serafini'; give points instead"):
        sweep(corner(), MESH, method="epsilon")


def test_what_was_not_reached_is_told(monkeypatch):
    monkeypatch.setattr("macs.gradients.tracing.LATTICE_SIZE", 5)
    assert "the curve errs by about" in sweep(two_wells(), MESH, error=1e-6, starts=1).message


def test_points_without_rates_are_a_front_without_a_curve(monkeypatch):
    monkeypatch.setattr("macs.gradient_tools._Job._weights", lambda *arguments, **more: None)
    found = sweep(two_wells(), MESH, error=1e-2, starts=1)
    assert len(found) == 5 and "the curve errs by about nan" in found.message


def test_any_front_gets_points_until_its_curve_errs_by_less():
    few = sweep(two_wells(), MESH, points=4, starts=1)
    found = few.dense(error=1e-3)
    assert few.curve().error > 1e-3 and found.verified.all() and 5 <= len(found) <= 16
    assert found.curve().distances(np.column_stack([X**2, (X - 1) ** 2])).max() <= found.curve().error < 1e-3
    assert found.stats["gradient_solves"] > few.stats["gradient_solves"]
    with pytest.raises(ValueError, match="either a number of points or error="):
        few.dense(5, error=1e-3)


def test_a_search_goes_on_until_its_curve_errs_by_less():
    found = MACS(archive=4).solve(two_wells(), MESH, evaluations=100, seed=1, error=2e-3)
    assert found.curve().error < 2e-3 and found.verified.all() and found.solver["name"] == "MACS"
    without = MACS(archive=4, refine=False).solve(two_wells(), MESH, evaluations=60, seed=1, error=1e-2)
    assert len(without) and "whose weights are its slopes" in without.message
    with pytest.raises(ValueError, match="error is for two objectives and trajectories, which 'corners' has not"):
        MACS().solve(corners(), MESH, error=1e-2)
