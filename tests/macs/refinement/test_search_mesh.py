"""The mesh of a search that was given none."""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from macs import MACS, NSGA2
from macs.refinement.search_mesh import COARSE, MOST, _together, default_transcription, found_mesh
from problems import Problem, load
from problems.cases.standard import published
from transcription import parse
from transcription.phases.mesh import PhaseMesh


def smooth() -> Problem:
    """A cart from rest to rest: time against effort, 12 / T^3."""
    problem = Problem("cart")
    move = problem.phase("move", t0=0.0, tf=(1.0, 2.0))
    x, v = move.state("x", bounds=(-1, 2), initial=0, final=1), move.state("v", bounds=(-5, 5), initial=0, final=0)
    u = move.control("u", bounds=(-20, 20))
    move.dynamics(x=v, v=u)
    problem.minimize("time", move.tf)
    problem.minimize("effort", move.integral(u**2))
    assert x is not None
    return problem


def layered(width: float) -> Problem:
    """A state that falls from 1 within `width` of a phase of length 1, and rises to 1 again as late, for little effort."""
    problem = Problem("layers")
    run = problem.phase("run", t0=0.0, tf=1.0)
    x = run.state("x", bounds=(-3, 3), initial=1.0)
    u = run.control("u", bounds=(-5, 5))
    run.dynamics(x=(u - x**3) / width)
    problem.minimize("cost", run.integral(0.5 * (x**2 + u**2)) / width)
    problem.minimize("miss", (run.final(x) - 1.5) ** 2)
    return problem


def test_a_problem_has_its_own_default_or_a_coarse_mesh():
    assert default_transcription(load("goddard")) == parse("dfet:4x6")
    assert default_transcription(smooth()) == default_transcription(smooth().compile()) == COARSE


@pytest.mark.slow
def test_a_smooth_problem_keeps_the_coarse_mesh():
    found = found_mesh(smooth().compile(), 1e-3, 1e-6)
    assert found.search == COARSE and found.fine is None and 2 <= found.counts.gradient_solves < 60
    assert found.ends is not None and len(found.ends) == 2


@pytest.mark.slow
def test_boundary_layers_get_short_elements():
    found = found_mesh(layered(0.01).compile(), 1e-3, 1e-6)
    assert found.search == COARSE and found.fine is not None
    edges = np.array(found.fine.mesh_of("run").edges)
    assert len(edges) - 1 <= MOST
    lengths = np.diff(edges)
    assert lengths[0] < 0.03 and lengths[-1] < 0.03 and lengths.max() > 0.05


@pytest.mark.slow
def test_a_search_without_a_transcription_finds_one():
    front = MACS(agents=4, archive=5).solve(layered(0.02), evaluations=200, seed=1)
    assert len(front) >= 3 and front.verified.all()
    assert front.stats["gradient_solves"] > 200 // 20, "what the mesh cost is counted"


@pytest.mark.slow
def test_a_search_begins_with_the_optima_of_single_objectives():
    """Of this arm's quickest way there are many local optima, in which searches of thousands of candidates end: 3.2 seconds and more."""
    front = MACS(agents=4).solve(load("standard/two_link_arm"), evaluations=30, seed=1)
    assert front.verified.all() and front.F.min() == pytest.approx(published("two_link_arm")[0].value, rel=5e-4)


@pytest.mark.slow
def test_a_search_keeps_the_ends_that_were_found_for_its_mesh():
    """A few evaluations lead to few points. Least effort in a time T is 12 / T^3, least time 1."""
    problem = smooth()
    found = MACS(agents=4).solve(problem, evaluations=6, seed=1)
    assert found.verified.all() and found.objectives[0] == pytest.approx([1.0, 12.0], rel=1e-4)
    assert found.objectives[-1] == pytest.approx([2.0, 12 / 2**3], rel=1e-4)


def test_what_peaks_forbid_is_searched_on_the_coarse_mesh():
    problem = smooth()
    problem.maximize("top speed", problem.phases["move"].peak(ca.fabs(problem.phases["move"]["v"])))
    assert found_mesh(problem.compile(), 1e-3, 1e-6).fine is None


meshes = st.lists(
    st.lists(st.integers(1, 99), min_size=0, max_size=12, unique=True).map(
        lambda inner: PhaseMesh((0.0, *(place / 100 for place in sorted(inner)), 1.0), 3)
    ),
    min_size=1,
    max_size=3,
)


@settings(max_examples=60, deadline=None)
@given(meshes)
def test_a_common_mesh_is_about_as_fine_as_each_of_several(several):
    common = np.array(_together(several).edges)
    assert len(common) - 1 <= min(MOST, sum(mesh.elements for mesh in several))
    for begin, end in pairwise(common):
        for low, high in (element for mesh in several for element in pairwise(mesh.edges)):
            mostly = min(high, end) - max(low, begin) >= 0.5 * (high - low)
            assert not mostly or end - begin <= 2.0 * (high - low) + 0.01 or len(common) - 1 == MOST


def test_degrees_are_higher_than_any():
    one, two = PhaseMesh((0.0, 1.0), 3, 1), PhaseMesh((0.0, 0.5, 1.0), 5, 2)
    assert (_together([one, two]).order, _together([one, two]).control_order) == (6, 2)
    assert _together([one, PhaseMesh((0.0, 1.0), 2)]).control_order is None


def test_a_mesh_with_more_elements_than_a_search_is_to_have_is_thinned_evenly():
    fine = PhaseMesh(tuple(np.linspace(0, 1, 101).tolist()), 3)
    lengths = np.diff(_together([fine]).edges)
    assert len(lengths) == MOST and lengths.max() / lengths.min() < 5


@pytest.mark.slow
@pytest.mark.parametrize("budget", [None, 300])
def test_the_number_of_evaluations_has_a_default(budget):
    problem = smooth()
    problem.default_evaluations = 250
    front = NSGA2(population=10).solve(problem, evaluations=budget, seed=1)
    assert front.stats["evaluations"] == (budget or 250)
    if budget is None:
        assert MACS(agents=4, archive=4).solve(problem, seed=1).stats["stopped"] == "done"
