"""The case with many local fronts: its closed form against gradient solves, its front against a plain scan of the ground."""

from __future__ import annotations

import numpy as np
import pytest

from macs import optimize
from macs.pareto.dominance import nondominated
from problems import load
from problems.cases import landing_site
from runs import gd
from transcription import DFET


@pytest.mark.slow
def test_least_effort_is_that_of_an_optimal_flight():
    point = optimize(landing_site.problem(landers=1), DFET(1, 3), objective="hazard", start=np.full((1, 8), 1e-3), starts=1)
    flight = point.trajectory["divert"].at(landing_site.DURATION)
    site = flight["x1"], flight["y1"]
    assert point.objectives["hazard"] == pytest.approx(landing_site.hazard(*site), rel=1e-9)
    # The cheapest flight to this very site, on a finer mesh: the thrust is linear in time, so that finer meshes gain nothing.
    problem = landing_site.problem(landers=1)
    for axis, goal in zip("xy", site, strict=True):
        problem.constraint(f"there {axis}", problem.phases["divert"].final(problem.phases["divert"][f"{axis}1"]), lower=goal, upper=goal)
    for mesh in (DFET(1, 3), DFET(3, 4)):
        best = optimize(problem, mesh, objective="effort", starts=1)
        assert best.objectives["effort"] == pytest.approx(landing_site.least_effort(*site), rel=1e-6)


@pytest.mark.slow
def test_the_front_of_one_is_that_of_a_scan_of_the_ground():
    axis = np.linspace(-1.0, landing_site.REACH, 1401)
    x, y = np.meshgrid(axis, axis)
    sites = np.stack([landing_site.least_effort(x, y).ravel(), landing_site.hazard(x, y).ravel()], axis=1)
    scan = sites[nondominated(sites)]
    truth = landing_site.reference(landers=1)
    scan = scan[scan[:, 0] <= truth[-1, 0]]
    assert gd(scan, truth) < 1e-3 and gd(truth, scan) < 2e-3
    assert len(scan) > 300


@pytest.mark.slow
def test_a_team_is_no_better_than_its_members():
    """Random teams of optimal and other members are nowhere below the front of teams."""
    rng = np.random.default_rng(0)
    truth, x, y = landing_site.reference(), *rng.uniform(-1, 3, (2, 20_000, 3))
    teams = np.stack([landing_site.least_effort(x, y).sum(axis=1), landing_site.hazard(x, y).sum(axis=1)], axis=1)
    one = landing_site.single()
    teams = np.vstack([teams, one[rng.integers(len(one), size=(20_000, 3))].sum(axis=1)])
    slack = 2e-3 * np.ptp(truth, axis=0)
    reached = np.searchsorted(truth[:, 0], teams[:, 0] + slack[0], side="right") - 1
    assert (teams[:, 1] >= truth[reached, 1] - slack[1]).all()


def test_it_is_in_the_catalogue():
    assert load("landing_site", landers=2).phases["divert"]["x2"] is not None
