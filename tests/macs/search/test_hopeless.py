"""A search that ends where nothing is feasible, and what it says of that."""

from __future__ import annotations

import numpy as np
import pytest

from macs import MACS
from macs.search.macs import HOPELESS
from problems import Problem
from transcription import DFET


def ride(low: float) -> Problem:
    """A walk whose sum of place and speed stays below `low`, and whose difference above 0.2: both at the start, at rest at 0, only if low
    is at least 0."""
    problem = Problem("ride")
    walk = problem.phase("walk", t0=0.0, tf=(0.5, 3.0))
    x, v = walk.state("x", bounds=(-10, 10), initial=0), walk.state("v", bounds=(-5, 5), initial=0, final=-1)
    u = walk.control("u", bounds=(-5, 5))
    walk.dynamics(x=v, v=u)
    walk.path("sum", x + v, upper=low)
    walk.path("place", x, lower=-2.0)
    problem.minimize("time", walk.tf)
    problem.minimize("effort", walk.integral(u**2))
    return problem


def test_a_search_ends_where_solves_for_feasibility_find_nothing(tmp_path):
    """At rest at 0 the sum is 0: it exceeds -0.5 by half of its scale, wherever a solve begins."""
    front = MACS(agents=5, archive=5).solve(ride(-0.5), DFET(3, 3), evaluations=5000, seed=1, checkpoint=tmp_path / "run.ckpt")
    assert len(front) == 0 and front.stats["stopped"] == "settled" and HOPELESS <= front.stats["evaluations"] < 500
    assert "near none of them there is one" in front.message and "violates path 'sum' of 'walk' by 0.5 of its scale" in front.message
    assert front.closest.violations["path 'sum' of 'walk'"] == pytest.approx(0.5, abs=1e-3)
    again = MACS(agents=5, archive=5).solve(ride(-0.5), DFET(3, 3), evaluations=5000, seed=1, checkpoint=tmp_path / "run.ckpt")
    assert again.message == front.message


def test_it_goes_on_where_something_is_feasible():
    front = MACS(agents=5, archive=5, mesh="fixed").solve(ride(0.0), DFET(3, 3), evaluations=300, seed=1, verify=None)
    assert len(front) == 5 and front.stats["stopped"] == "budget" and front.stats["evaluations"] == 300


def test_what_is_only_propagated_is_no_reason_to_end():
    front = MACS(agents=5, archive=5, mesh="fixed", refine=False).solve(
        ride(-0.5), DFET(3, 3), evaluations=300, seed=1, verify=None, inner="propagate"
    )
    assert len(front) == 0 and front.stats["evaluations"] == 300 and "near none" not in front.message


def test_black_boxes_go_on():
    front = MACS(agents=5, archive=5).minimize(
        lambda X: (np.column_stack([X[:, 0], 1 - X[:, 0]]), np.ones((len(X), 1))), [(0, 1)] * 2, evaluations=200, seed=1
    )
    assert len(front) == 0 and front.stats["evaluations"] == 200
