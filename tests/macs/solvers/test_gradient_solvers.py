"""Gradient tools as solvers: the same points as the tools, and what studies need of a solver."""

from __future__ import annotations

import numpy as np
import pytest

from macs import payoff, sweep
from macs.solvers.checkpoint import keeps
from macs.solvers.solver import solver
from problems import load
from transcription import parse

METHOD = parse("dfet:4x4")


@pytest.fixture(scope="module")
def goddard():
    return load("goddard")


@pytest.mark.slow
def test_they_find_what_the_tools_find(goddard):
    for own, tool in (
        (solver("payoff", starts=1), payoff(goddard, METHOD, starts=1)),
        (solver("sweep", points=4, starts=1), sweep(goddard, METHOD, points=4, starts=1)),
    ):
        front = own.solve(goddard, METHOD, evaluations=10, seed=0)
        np.testing.assert_array_equal(front.objectives, tool.objectives)
        assert "stopped" not in front.stats and front.stats["evaluations"] == 0
        assert front.stats["gradient_solves"] == tool.stats["gradient_solves"] > 0


def test_the_best_of_one_objective(goddard):
    front = solver("optimum", objective="horizontal speed", starts=1).solve(goddard, METHOD, seed=0)
    assert len(front) == 1 and front[0].objectives["horizontal speed"] == pytest.approx(
        payoff(goddard, METHOD, starts=1)[1].objectives["horizontal speed"]
    )


@pytest.mark.slow
def test_meshes_follow_on_request(goddard):
    method = parse("multiple-shooting:8:linear")
    fixed, dense = (solver("payoff", starts=1, mesh=mesh).solve(goddard, method, seed=0) for mesh in ("fixed", "density"))
    mended = solver("payoff", starts=1, mesh="mended").solve(goddard, METHOD, seed=0)
    assert not fixed.verified[0] and mended.verified.all()
    meshes = [one.trajectory["ascent"].state.edges for one in (fixed[0], dense[0])]
    assert len(meshes[0]) == len(meshes[1]) and np.ptp(np.diff(meshes[1])) > 1.0 > np.ptp(np.diff(meshes[0]))


@pytest.mark.parametrize(
    ("name", "settings", "words"),
    [
        ("payoff", {"starts": 0}, "Payoff: starts"),
        ("payoff", {"mesh": "fine"}, "Payoff: mesh"),
        ("sweep", {"points": 1}, "Sweep: points"),
        ("sweep", {"method": "weights"}, "Sweep: method"),
    ],
)
def test_settings_out_of_range_are_refused(name, settings, words):
    with pytest.raises(ValueError, match=words):
        solver(name, **settings)


def test_plain_functions_are_refused():
    with pytest.raises(ValueError, match="needs derivatives"):
        solver("payoff", starts=1).minimize(lambda X: X, [(0, 1), (0, 1)], evaluations=5)


def test_no_checkpoint_keeps_them():
    assert not keeps(solver("payoff", starts=1))
