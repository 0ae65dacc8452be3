"""The reduced problem, its derivatives, and Newton's method on it: against differences, and against the projection by IPOPT."""

import shutil

import casadi as ca
import numpy as np
import pytest
from euler import Euler
from hypothesis import given, settings
from hypothesis import strategies as st

from problems import Problem, load
from transcription import DFET
from transcription.inner import Ipopt, Newton, Projection, Propagate
from transcription.inner.least_distance import least_distance
from transcription.numerics import batched


def candidates(nlp, count, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(nlp.lower[nlp.free], nlp.upper[nlp.free], (count, len(nlp.free)))


def two_phases():
    """A glider with a linked second phase, a parameter, a path constraint, an integral constraint and a bounded peak."""
    problem = Problem("relay")
    drag = problem.parameter("drag", bounds=(0.1, 0.3))
    first = problem.phase("first", t0=0.0, tf=(0.5, 2.0))
    second = problem.phase("second", t0=(0.5, 2.0), tf=(2.0, 5.0))
    for phase in (first, second):
        phase.state("x", bounds=(-5, 5), initial=0.0 if phase is first else None, final=None if phase is first else 1.0)
        phase.state("v", bounds=(-5, 5), initial=0.0 if phase is first else None)
        phase.control("u", bounds=(-2, 2))
        phase.dynamics(x=phase["v"], v=phase["u"] - drag * phase["v"] * ca.fabs(phase["v"]) + 0.1 * ca.sin(phase.time))
    problem.link(first, second)
    second.path("speed", second["v"] ** 2, upper=4.0)
    problem.constraint("work", first.integral(first["u"] ** 2) + second.integral(second["u"] ** 2), upper=3.0)
    problem.constraint("strain", second.peak(second["u"] * second["v"]), upper=1.0)
    problem.minimize("time", second.tf)
    problem.minimize("effort", second.integral(second["u"] ** 2))
    return problem


@pytest.mark.slow
@pytest.mark.parametrize(
    ("problem", "mesh"),
    [
        (load("goddard"), DFET(4, 6)),
        (load("orbit_rise"), DFET(5, 2)),
        (load("goddard"), DFET(3, 3, control_order=4, basis="bernstein")),
        (two_phases(), DFET(3, 2)),
        (two_phases(), Euler(6)),
    ],
    ids=["goddard", "orbit", "bernstein", "two phases", "default derivatives"],
)
def test_total_derivatives_are_those_of_differences(problem, mesh):
    nlp = mesh.transcribe(problem)
    reduced, free = nlp.reduced, nlp.free
    inner = nlp.lower[free] + 0.1 * nlp.span[free] + 0.8 * (candidates(nlp, 2) - nlp.lower[free])
    Z = nlp.first_guess(inner)
    propagated = reduced.propagate(Z)
    every = np.arange(len(reduced.scale))
    A = reduced.derivatives(propagated, every)
    for j, variable in enumerate(free):
        h = 1e-6 * nlp.span[variable]
        up, down = Z.copy(), Z.copy()
        up[:, variable] += h
        down[:, variable] -= h
        differences = (reduced.propagate(up).values - reduced.propagate(down).values) / (2 * h)
        error = np.abs(differences - A[:, :, j]) * nlp.span[variable] / reduced.scale
        assert error.max() < 1e-6
    at_ends = np.flatnonzero(~reduced.inside)
    assert reduced.derivatives(propagated, at_ends) == pytest.approx(A[:, at_ends], rel=1e-9, abs=1e-12)


def test_what_propagation_leaves_is_what_the_nlp_says():
    nlp = DFET(3, 2).transcribe(two_phases())
    propagated = nlp.reduced.propagate(nlp.first_guess(candidates(nlp, 4)))
    reduced = nlp.reduced
    outside = np.maximum(np.maximum(reduced.lower - propagated.values, propagated.values - reduced.upper) / reduced.scale, 0).max(axis=1)
    assert outside == pytest.approx(nlp.evaluate(propagated.Z)[1], rel=1e-9)


@pytest.mark.slow
def test_warm_solves_agree_with_the_projection():
    nlp = DFET(4, 6).transcribe(load("goddard"))
    W = Ipopt().solve(nlp, candidates(nlp, 20)).z
    rng = np.random.default_rng(1)
    low, high, span = nlp.lower[nlp.free], nlp.upper[nlp.free], nlp.span[nlp.free]
    near = np.clip(W[:, nlp.free] + 0.05 * span * rng.standard_normal((20, len(span))), low, high)
    fast, exact = Newton().solve(nlp, near, W), Ipopt().solve(nlp, near, W, tolerance=1e-11)
    assert set(fast.status) == {"converged"} and fast.iterations.mean() < 8
    assert np.abs((fast.F - exact.F) / np.ptp(exact.F, axis=0)).max() < 1e-5
    assert (fast.moved <= 1.001 * exact.moved + 1e-9).all() and fast.moved.mean() < 0.07
    auto = Projection().solve(nlp, near, W)
    assert auto.fallbacks == 0 and np.array_equal(auto.z, fast.z)


@pytest.mark.slow
def test_cold_solves_agree_with_the_projection():
    """But for the few whose nearest point is not found in time, or has a rival as near."""
    nlp = DFET(4, 6).transcribe(load("goddard"))
    C = candidates(nlp, 30)
    fast, exact = Projection().solve(nlp, C), Ipopt().solve(nlp, C, tolerance=1e-9)
    assert set(fast.status) == {"converged"} and fast.fallbacks <= 3
    off = np.abs((fast.F - exact.F) / np.ptp(exact.F, axis=0)).max(axis=1)
    assert (off < 1e-5).mean() > 0.85 and np.median(off) < 2e-6
    assert (fast.moved <= 1.05 * exact.moved).mean() > 0.95
    assert np.array_equal(fast.violation, nlp.evaluate(fast.z)[1])


@pytest.mark.slow
def test_inequalities_paths_and_phases():
    nlp = DFET(3, 2).transcribe(two_phases())
    C = candidates(nlp, 20)
    fast, exact = Newton().solve(nlp, C), Ipopt().solve(nlp, C)
    both = (fast.status == "converged") & (exact.status == "converged")
    assert both.sum() >= 15 and fast.violation[both].max() <= 1e-6
    assert (fast.moved[both] <= 1.05 * exact.moved[both] + 1e-3).mean() > 0.8


def limited_speed():
    """A double integrator whose speed limit is active nearly all along."""
    problem = Problem("limited")
    phase = problem.phase("p", t0=0.0, tf=(2.0, 6.0))
    phase.state("x", bounds=(-5, 5), initial=0.0, final=2.0)
    v = phase.state("v", bounds=(-5, 5), initial=0.0, final=0.0)
    u = phase.control("u", bounds=(-2, 2))
    phase.dynamics(x=v, v=u)
    phase.path("speed", v, upper=0.6)
    problem.minimize("time", phase.tf)
    problem.minimize("effort", phase.integral(u**2))
    return problem


@pytest.mark.slow
def test_active_path_constraints_are_met_at_the_nearest_point():
    nlp = DFET(6, 3).transcribe(limited_speed())
    C = candidates(nlp, 20)
    fast, exact = Newton().solve(nlp, C), Ipopt().solve(nlp, C)
    assert (fast.status == "converged").mean() > 0.9 and fast.violation[fast.status == "converged"].max() <= 1e-6
    good = fast.status == "converged"
    assert (fast.moved[good] <= 1.05 * exact.moved[good]).all()


@pytest.mark.slow
@pytest.mark.skipif(not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="no C compiler")
def test_compiled_functions_give_the_same_bits(monkeypatch):
    problem = load("goddard")
    monkeypatch.setenv("MACS_COMPILE", "0")
    C = candidates(DFET(3, 3).transcribe(problem), 12)
    expected = Newton().solve(DFET(3, 3).transcribe(problem), C)
    monkeypatch.setenv("MACS_COMPILE", "1")
    monkeypatch.setattr(batched, "PAYS", 1)
    nlp = DFET(3, 3).transcribe(problem)
    for _ in range(2):
        found = Newton().solve(nlp, C)
        assert np.array_equal(found.z, expected.z) and np.array_equal(found.iterations, expected.iterations)


def test_what_is_feasible_already_is_one_propagation():
    nlp = DFET(30, 1).transcribe(load("orbit_rise"))
    C = candidates(nlp, 5)
    propagated, found = Propagate().solve(nlp, C), Newton().solve(nlp, C)
    inside = propagated.status == "converged"
    assert inside.any() and np.array_equal(found.z[inside], propagated.z[inside])
    assert (found.iterations[inside] == 1).all() and not found.moved[inside].any()


def test_nothing_infeasible_is_called_feasible():
    problem = Problem("impossible")
    phase = problem.phase("p", t0=0.0, tf=1.0)
    x = phase.state("x", bounds=(-10, 10), initial=0.0, final=5.0)
    u = phase.control("u", bounds=(-1, 1))
    phase.dynamics(x=u)
    problem.minimize("end", phase.integral(u * x))
    nlp = DFET(2, 2).transcribe(problem)
    found = Projection().solve(nlp, candidates(nlp, 3))
    assert set(found.status) == {"infeasible"} and found.violation.min() > 0.1 and found.fallbacks == 3


def test_an_unstable_flight_falls_back_and_is_right():
    problem = Problem("needle")
    phase = problem.phase("p", t0=0.0, tf=8.0)
    x = phase.state("x", bounds=(-2, 2), initial=0.5, final=0.0)
    u = phase.control("u", bounds=(-10, 10))
    phase.dynamics(x=4 * x + u)
    problem.minimize("effort", phase.integral(u**2))
    nlp = DFET(8, 3).transcribe(problem)
    found = Projection().solve(nlp, candidates(nlp, 4))
    assert set(found.status) == {"converged"} and nlp.evaluate(found.z)[1].max() <= 1e-6


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 6), st.integers(1, 3))
def test_least_distance_satisfies_the_conditions_of_a_nearest_point(seed, d, r):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((1, r, d))
    inside = rng.uniform(0.2, 0.8, (1, d))
    b = (A @ inside[:, :, None])[:, :, 0]
    gap = np.where(rng.random((1, r)) < 0.5, 0.0, 0.1)
    center = rng.uniform(-1, 2, (1, d))
    x, met, _ = least_distance(center, A, b - gap, b + gap, (np.zeros((1, d)), np.ones((1, d))), np.zeros((1, r)))
    if met[0]:
        # No feasible direction, of many, leads nearer to the centre.
        others = inside + 0.2 * rng.standard_normal((200, d))
        values = others @ A[0].T
        fine = ((others >= 0) & (others <= 1)).all(axis=1) & (np.abs(values - b) <= gap + 1e-12).all(axis=1)
        fine = np.vstack([others[fine], inside])
        assert np.linalg.norm(x - center) <= np.linalg.norm(fine - center, axis=1).min() + 1e-6


@pytest.mark.parametrize("broken", [np.nan, np.inf, -np.inf])
def test_derivatives_that_are_no_numbers_stop_no_search(broken):
    A, b, box = np.array([[[1.0, 2.0]], [[broken, 1.0]]]), np.full((2, 1), 1.2), (np.zeros((2, 2)), np.ones((2, 2)))
    center = np.array([[0.2, 0.3], [0.4, 1.5]])
    with np.errstate(invalid="ignore"):
        x, met, multipliers = least_distance(center, A, b, b, box, np.zeros((2, 1)))
    alone, _, _ = least_distance(center[:1], A[:1], b[:1], b[:1], (box[0][:1], box[1][:1]), np.zeros((1, 1)))
    assert met.tolist() == [True, False] and np.isfinite(multipliers).all()
    assert x == pytest.approx(np.array([alone[0], [0.4, 1.0]]), abs=1e-9)
