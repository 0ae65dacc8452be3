"""The certificate: against residuals known in closed form, and against points moved off the front by hand."""

from __future__ import annotations

import numpy as np
import pytest
from smooth_problems import nlp_of, slide, two_wells, vector

from problems import load
from transcription import DFET, NLP
from transcription.inner import inner_solver
from transcription.nlp.optimality import optimality
from transcription.nlp.scalarized import scalarize

SPAN = 4.0
"""Of the parameters of `two_wells`."""


def at(nlp: NLP, **values: float) -> float:
    return optimality(nlp, vector(nlp, **values), np.ones(len(nlp.problem.goals)))


@pytest.mark.parametrize("p", [0.0, 1e-3, 0.3, 0.5, 1.0])
@pytest.mark.parametrize("q", [0.0, 0.1, -0.5])
def test_between_the_wells_only_the_distance_from_the_line_is_left(p: float, q: float) -> None:
    # mu = (1 - p, p) makes the derivative in p vanish; in q it is 2 q, whatever mu.
    assert at(nlp_of(two_wells()), p=p, q=q) == pytest.approx(2 * abs(q) * SPAN, abs=1e-12)


def test_beyond_a_well_its_own_gradient_is_the_least() -> None:
    assert at(nlp_of(two_wells()), p=1.5, q=0.0) == pytest.approx(2 * 0.5 * SPAN)
    assert at(nlp_of(two_wells()), p=-0.25, q=0.0) == pytest.approx(2 * 0.25 * SPAN)


def test_objectives_are_measured_in_the_scales_given() -> None:
    nlp = nlp_of(two_wells())
    z = vector(nlp, p=0.5, q=0.25)
    assert optimality(nlp, z, np.array([10.0, 10.0])) == pytest.approx(0.1 * optimality(nlp, z, np.ones(2)))
    # In other scales, mu is another one, but what can be made to vanish still is.
    assert optimality(nlp, vector(nlp, p=0.5, q=0.0), np.array([1e-3, 50.0])) == pytest.approx(0, abs=1e-9)
    # A range of zero, of an objective that does not vary over a front, stands for its own scale.
    assert 0 < optimality(nlp, z, np.zeros(2)) == pytest.approx(optimality(nlp, z))


def test_an_active_bound_takes_the_rest() -> None:
    nlp = nlp_of(two_wells(q=(0.5, 2.0)))
    assert at(nlp, p=0.3, q=0.5) == pytest.approx(0, abs=1e-12)
    # From the other side a bound does not help.
    other = nlp_of(two_wells(q=(-2.0, 0.5)))
    assert at(other, p=0.3, q=0.5) == pytest.approx(2 * 0.5 * 2.5)


def test_a_bound_counts_by_its_slack() -> None:
    nlp = nlp_of(two_wells(q=(0.5, 2.5)))
    for slack in (1e-9, 1e-6, 1e-4):
        # The best multiplier of a bound at distance s, where the slope is k: the norm of (k - nu, s nu) is k s/sqrt(1 + s^2).
        slope = 2 * (0.5 + slack) * 2
        s = slack / 2
        assert at(nlp, p=0.3, q=0.5 + slack) == pytest.approx(slope * s / np.sqrt(1 + s**2), rel=1e-6)
    assert at(nlp, p=0.3, q=0.6) == pytest.approx(2 * 0.6 * 2)


def walled(kind: str) -> NLP:
    """Two wells, and a constraint that keeps q at a half, or above it, or on a line."""
    problem = two_wells()
    p, q = problem.parameters["p"], problem.parameters["q"]
    limits = {
        "above": {"lower": 0.5},
        "equal": {"lower": 0.5, "upper": 0.5},
        "below": {"upper": 0.5},
        "twice": {"lower": 0.5, "upper": 0.5},
    }
    problem.constraint("wall", q + 0 * p, **limits[kind])
    if kind == "twice":
        problem.constraint("the same wall", 2 * q, lower=1, upper=1)
    return nlp_of(problem)


def test_constraints_take_the_rest_with_the_right_sign() -> None:
    assert at(walled("above"), p=0.3, q=0.5) == pytest.approx(0, abs=1e-12)
    assert at(walled("equal"), p=0.3, q=0.5) == pytest.approx(0, abs=1e-9)
    assert at(walled("below"), p=0.3, q=0.5) == pytest.approx(2 * 0.5 * SPAN)


def test_equations_that_say_the_same_twice() -> None:
    nlp = walled("twice")
    assert at(nlp, p=0.3, q=0.5) == pytest.approx(0, abs=1e-9)
    assert at(nlp, p=1.3, q=0.5) == pytest.approx(2 * 0.3 * SPAN, rel=1e-6)


def test_the_states_are_eliminated_by_their_adjoint() -> None:
    nlp = nlp_of(slide())
    for c in (0.05, 0.25, 0.5):
        assert at(nlp, u=c) == pytest.approx(0, abs=1e-9)
    # Of a constant control c, both objectives fall with it where c < 0: by 4 |c| and 4 (1 - 2 c), times what is a constant control's
    # share of a unit vector of coefficients. mu takes the lesser.
    weights = 0.5 / 4 * np.tile(np.polynomial.legendre.leggauss(3)[1], 4)
    assert at(nlp, u=-0.1) == pytest.approx(4 * 0.1 * np.linalg.norm(weights) * 4, rel=1e-9)


def solved(nlp: NLP, ranges: np.ndarray, share: float) -> np.ndarray:
    """A vector of the front that scalarize finds, from random controls."""
    rng = np.random.default_rng(5)
    candidates = nlp.lower[nlp.free] + rng.random((1, len(nlp.free))) * nlp.span[nlp.free]
    start = nlp.propagate(nlp.first_guess(candidates))[0]
    (F,), _ = nlp.evaluate(start[None])
    found = scalarize(nlp, start, reference=F - ranges * np.array([share, 1 - share]), weights=ranges)
    assert found.status == "converged"
    return found.z


CASES = {
    "goddard": (DFET(4, 6), np.array([141.0, 0.9])),
    "orbit_rise": (DFET(30, 1), np.array([60.0, 0.34])),
    "orbit_rise_full": (DFET(30, 1), np.array([60.0, 0.34])),
}


@pytest.mark.parametrize("name", CASES)
def test_small_on_the_front_and_large_off_it(name: str) -> None:
    mesh, ranges = CASES[name]
    nlp = mesh.transcribe(load(name))
    z = solved(nlp, ranges, 0.5)
    assert optimality(nlp, z, ranges) < 1e-8
    rng = np.random.default_rng(1)
    moved = z[nlp.free] + 0.05 * nlp.span[nlp.free] * rng.normal(size=len(nlp.free))
    again = inner_solver("auto").solve(nlp, np.clip(moved, nlp.lower[nlp.free], nlp.upper[nlp.free])[None], z[None])
    assert again.status[0] == "converged" and optimality(nlp, again.z[0], ranges) > 1e-3
