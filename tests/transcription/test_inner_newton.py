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
from transcription.inner import Newton
from transcription.inner.least_distance import least_distance


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
        (load("goddard"), DFET(3, 3, control_order=4, basis="bernstein")),
        (two_phases(), DFET(3, 2)),
        (two_phases(), Euler(6)),
    ],
    ids=["bernstein", "two phases", "default derivatives"],
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
@pytest.mark.skipif(not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="no C compiler")
def test_compiled_functions_give_the_same_bits(monkeypatch):
    problem = load("goddard")
    monkeypatch.setenv("MACS_COMPILE", "0")
    C = candidates(DFET(3, 3).transcribe(problem), 12)
    expected = Newton().solve(DFET(3, 3).transcribe(problem), C)
    monkeypatch.setenv("MACS_COMPILE", "always")
    nlp = DFET(3, 3).transcribe(problem)
    for _ in range(2):
        found = Newton().solve(nlp, C)
        assert np.array_equal(found.z, expected.z) and np.array_equal(found.iterations, expected.iterations)


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
