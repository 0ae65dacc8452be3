"""Meshes by a density function."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import brentq

from problems import load
from transcription import DFET, MultipleShooting, PhaseTrajectory, PiecewisePolynomial, Trajectory
from transcription.meshes.refinement import (
    DENSITY_FLOORS,
    continuous,
    curvature_density,
    curvatures,
    equidistributed,
    integrals,
    normalised,
    raised,
    redistributed,
    trajectory_density,
)


@st.composite
def densities(draw):
    """Places, relative to a phase, and a density on them that may jump and vanish, but not everywhere."""
    k = draw(st.integers(1, 12))
    lengths = np.array(draw(st.lists(st.floats(0.01, 1.0), min_size=k, max_size=k)))
    values = np.array(draw(st.lists(st.one_of(st.just(0.0), st.floats(1e-3, 1e3)), min_size=2 * k, max_size=2 * k))).reshape(k, 2)
    values[draw(st.integers(0, k - 1)), 0] += 1.0
    places = np.append(0.0, np.cumsum(lengths))
    return places / places[-1], values


def share_before(places: np.ndarray, values: np.ndarray, t: float) -> float:
    """The integral of a density up to t, by scipy, cell after cell."""
    total = 0.0
    for a, b, (left, right) in zip(places[:-1], places[1:], values, strict=True):
        if t > a:
            total += quad(lambda s, a=a, b=b, left=left, right=right: left + (s - a) / (b - a) * (right - left), a, min(b, t))[0]
    return total


# The paper's Figure 2: 20 points by two densities


@pytest.mark.parametrize("cells", [1, 7, 100])
def test_a_density_that_is_the_time_gives_square_roots(cells):
    places = np.linspace(0.0, 1.0, cells + 1)
    found = equidistributed(places, continuous(places), 20)
    assert found == pytest.approx(np.sqrt(np.arange(21) / 20), abs=1e-14)


def test_two_bells_are_what_scipy_makes_of_them():
    def f(t):
        return np.exp(-50 * t**2 + 20 * t - 2) + np.exp(-50 * t**2 + 80 * t - 32)

    def F(t):
        return quad(f, 0.0, t, epsabs=1e-13, points=[p for p in (0.2, 0.8) if p < t])[0]

    places, whole = np.linspace(0.0, 1.0, 10_001), F(1.0)
    found = equidistributed(places, continuous(f(places)), 20)
    exact = [brentq(lambda t, i=i: F(t) - i / 20 * whole, 0.0, 1.0, xtol=1e-13) for i in range(1, 20)]
    assert found[1:-1] == pytest.approx(exact, abs=1e-7)
    assert found == pytest.approx(1.0 - found[::-1], abs=1e-12)
    assert np.diff(found).argmax() in (9, 10), "in the valley between the bells"


# Equidistribution


@given(densities(), st.integers(1, 40))
@settings(max_examples=60, deadline=None)
def test_intervals_have_equal_shares(density, count):
    places, values = density
    edges = equidistributed(places, values, count)
    assert edges[0] == 0.0 and edges[-1] == 1.0 and len(edges) == count + 1 and (np.diff(edges) > 0).all()
    whole = share_before(places, values, 1.0)
    for i in (count // 3, count // 2):
        assert share_before(places, values, edges[i]) == pytest.approx(whole * i / count, abs=1e-9 * whole)


@given(densities(), st.integers(1, 40), st.floats(1e-6, 1e6), st.floats(-1e3, 1e3), st.floats(1e-3, 1e3))
@settings(max_examples=60, deadline=None)
def test_units_of_the_density_and_of_time_do_not_matter(density, count, factor, start, length):
    places, values = density
    edges = equidistributed(places, values, count)
    assert equidistributed(places, factor * values, count) == pytest.approx(edges, abs=1e-9)
    moved = equidistributed(start + length * places, values, count)
    assert (moved - start) / length == pytest.approx(edges, abs=1e-7 * max(1.0, abs(start) / length))


@given(densities(), st.integers(1, 40), st.floats(0.05, 1.0))
@settings(max_examples=60, deadline=None)
def test_a_floor_bounds_the_longest_interval(density, count, least):
    places, values = density
    found = raised(places, values, least)
    assert integrals(places, found)[-1] == pytest.approx(1.0)
    assert found.min() >= least - 1e-12
    assert np.diff(equidistributed(places, found, count)).max() <= 1.0 / (least * count) + 1e-12
    if least == 1.0:
        assert equidistributed(places, found, count) == pytest.approx(np.linspace(0, 1, count + 1), abs=1e-12)


def test_nothing_but_zeros_is_even_and_no_density_at_all_is_refused():
    places = np.array([0.0, 0.3, 1.0])
    assert (normalised(places, np.zeros((2, 2))) == 1.0).all()
    for values in (np.zeros((2, 2)), np.array([[1.0, -2.0], [5.0, 5.0]]), np.array([[1.0, np.nan], [5.0, 5.0]])):
        with pytest.raises(ValueError, match="a density must be finite and nowhere negative, and its integral positive"):
            equidistributed(places, values, 3)


# Curvature


def test_the_curvature_of_a_parabola_and_of_a_circle():
    places = np.sort(np.random.default_rng(0).uniform(-1, 1, 40))
    parabola = curvatures(places, np.stack([places**2, 3.0 - 2.0 * places], axis=-1))
    assert parabola[1:-1, 0] == pytest.approx(2.0 / (1.0 + 4.0 * places[1:-1] ** 2) ** 1.5, rel=1e-9), "exact by parabolas"
    assert parabola[:, 1] == pytest.approx(0.0, abs=1e-9)
    places = np.linspace(-0.8, 0.8, 400)
    assert curvatures(places, 0.5 * np.sqrt(4.0 - 4.0 * places**2)[:, None]) == pytest.approx(1.0, rel=1e-3)
    assert curvature_density(np.array([[8.0, 27.0], [0.0, 1.0]]), np.array([2.0, 1.0])) == pytest.approx([5.0, 1.0])


def some_trajectory() -> Trajectory:
    """Of one phase with one state and one control."""
    nlp = DFET(1, 1).nlp(load("standard/hypersensitive"))
    return nlp.unpack(np.zeros(len(nlp.variables)))


def phase_of(places: np.ndarray, x: np.ndarray, start: float = 0.0, length: float = 1.0, unit: float = 1.0) -> PhaseTrajectory:
    """A trajectory through states x (k + 1,) with straight lines between, and one control; `unit`: the states' own one."""
    flight = some_trajectory()["run"]
    edges = start + length * places
    state = PiecewisePolynomial(edges, unit * np.stack([x[:-1], x[1:]], axis=1)[:, :, None], "lobatto")
    bounds = tuple(replace(v, lower=unit * v.lower, upper=unit * v.upper) for v in flight.state_variables)
    return replace(flight, state=state, state_variables=bounds)


def test_a_kink_has_the_shortest_intervals_and_straight_lines_equal_ones():
    places = np.linspace(0.0, 1.0, 21)
    bent = trajectory_density(phase_of(places, np.abs(places - 0.4)))
    edges = equidistributed(bent[0], raised(*bent), 20)
    shortest = np.diff(edges).argmin()
    assert edges[shortest] <= 0.4 + 1e-9 and edges[shortest + 1] >= 0.4 - 1e-9
    for x in (places, np.full(21, 2.0)):
        flat = trajectory_density(phase_of(places, x))
        assert equidistributed(flat[0], raised(*flat), 20) == pytest.approx(places, abs=1e-6)
    single = trajectory_density(phase_of(np.array([0.0, 1.0]), np.array([0.0, 1.0])))
    assert equidistributed(single[0], raised(*single), 4) == pytest.approx(np.linspace(0, 1, 5))


@pytest.mark.parametrize("method", [MultipleShooting(30, steps=5), DFET(30, 2)], ids=["shooting", "dfet"])
def test_a_layer_gets_the_elements(method):
    """x = exp(-30 t / 50) at the beginning of a phase that is 50 long, then nothing."""
    problem = load("standard/hypersensitive")
    places = np.linspace(0.0, 1.0, 301)
    trajectory = replace(some_trajectory(), phases=(phase_of(places, np.exp(-30 * places), length=50.0),))
    found = redistributed(method, problem.compile(), trajectory)
    mesh, lengths = found.mesh_of("run"), np.diff(found.mesh_of("run").edges)
    assert mesh.elements == 30 and mesh.order == method.order
    assert (np.array(mesh.edges) < 0.2).sum() > 15, "half of them in a fifth of the time, in which all happens"
    assert lengths.max() <= 1.0 / (DENSITY_FLOORS[0] * 30) + 1e-12
