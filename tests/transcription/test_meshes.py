"""Where meshes need more, and whether they get it."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from cases import oscillator, propagated
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from problems import Problem, load
from transcription import DFET, MultipleShooting, PhaseTrajectory, PiecewisePolynomial, Trajectory
from transcription.meshes.errors import control_scales, decay_rates, own_scales, phase_errors, state_scales
from transcription.meshes.refinement import (
    DENSITY_FLOORS,
    LAYERS,
    continuous,
    curvature_density,
    curvatures,
    cuts,
    equidistributed,
    integrals,
    merged,
    next_method,
    normalised,
    raised,
    redistributed,
    refine,
    split,
    trajectory_density,
)
from transcription.meshes.verdict import Wanted, growth, judge
from transcription.nlp.derivatives import gradients
from transcription.numerics.polynomials import gauss_legendre, legendre_coefficients
from transcription.trajectories.simulate import simulate, simulate_elements

HIGHEST = DFET.highest_order
EDGES = np.array([0.0, 0.2, 0.5, 1.0])
NONE = np.full(3, np.nan)


def errors(nlp, flight):
    """Those of the only phase."""
    return phase_errors(nlp.problem, flight, simulate_elements(nlp.problem, flight, rtol=1e-12, atol=1e-13))[0]


def assessed(nlp, z, tolerance=1e-6):
    F = nlp.evaluate(z[None])[0][0]
    return judge(nlp.problem, nlp.unpack(z), Wanted(tolerance, tolerance), F, np.maximum(np.abs(F), 1e-3))


@st.composite
def meshes(draw):
    n = draw(st.integers(1, 12))
    lengths = np.array(draw(st.lists(st.floats(1e-3, 1.0), min_size=n, max_size=n)))
    edges = np.concatenate([[0.0], np.cumsum(lengths) / lengths.sum()])
    edges[-1] = 1.0
    number = st.one_of(st.floats(0, 1e12), st.sampled_from([np.inf, np.nan]))
    error = np.array(draw(st.lists(number, min_size=n, max_size=n)))
    rate = np.array(draw(st.lists(st.one_of(st.floats(-1, 5), st.just(np.inf)), min_size=n, max_size=n)))
    steep = np.array(draw(st.lists(st.one_of(st.floats(-0.999, 0.999), st.just(np.nan)), min_size=n, max_size=n)))
    return edges, draw(st.integers(0, HIGHEST)), error, rate, steep


@given(mesh=meshes(), room=st.integers(0, 30))
def test_meshes_stay_meshes_and_lose_nothing(mesh, room):
    edges, order, error, rate, steep = mesh
    most = len(edges) - 1 + room
    finer, raised = refine(edges, order, error, rate, steep, most=most, highest=HIGHEST)
    assert finer[0] == 0.0 and finer[-1] == 1.0 and (np.diff(finer) > 0).all()
    assert set(edges) <= set(finer) and len(finer) - 1 <= most
    assert order <= raised <= max(order, HIGHEST)
    if room >= 2:
        assert len(finer) > len(edges) or raised > order, "somewhere there is always more to do"


def test_where_elements_are_cut_merged_or_get_a_higher_order():
    finer, order = refine(EDGES, 4, np.array([5.0, 0.2, 0.1]), np.zeros(3), NONE, most=20, highest=HIGHEST)
    assert finer.tolist() == [0.0, 0.1, 0.2, 0.5, 1.0] and order == 4
    finer, order = refine(EDGES, 4, np.array([50.0, 0.2, 0.1]), np.full(3, 2.0), NONE, most=20, highest=HIGHEST)
    assert finer.tolist() == EDGES.tolist() and order == 5
    finer, _ = refine(EDGES, HIGHEST, np.array([50.0, 0.2, 0.1]), np.full(3, 2.0), NONE, most=20, highest=HIGHEST)
    assert finer.tolist() == [0.0, 0.1, 0.2, 0.5, 1.0]
    finer, order = refine(EDGES, 6, np.array([1e9, 0.2, 0.1]), np.full(3, 0.9), NONE, most=20, highest=HIGHEST)
    assert order == 6 and finer.tolist() == [0.0, 0.05, 0.1, pytest.approx(0.15), 0.2, 0.5, 1.0], "as many parts as the error asks for"
    finer, order = refine(EDGES, 4, np.array([0.1, 0.1, 9.0]), np.full(3, 3.0), np.array([np.nan, np.nan, 0.2]), most=20, highest=HIGHEST)
    assert finer == pytest.approx([0, 0.2, 0.5, 0.725, 0.875, 1.0]) and order == 4
    assert cuts(0.95) == [pytest.approx(0.7)] and cuts(-0.95) == [pytest.approx(-0.7)] and cuts(np.nan) == [0.0]
    assert cuts(0.95, graded=True) == pytest.approx([0.7, 0.94, 0.988]), "an element at the end, however thin the layer is"
    assert cuts(0.2, graded=True) == pytest.approx(sorted([0.2 + s * d for s in (-1, 1) for d in LAYERS]))
    finer, _ = refine(EDGES, 4, np.array([5.0, 50.0, 6.0]), np.zeros(3), NONE, most=4, highest=HIGHEST)
    assert finer.tolist() == [0.0, 0.2, 0.35, 0.5, 1.0]
    assert split(EDGES, {0: [0.0]}, most=3) is EDGES
    edges, kept = np.linspace(0, 1, 7), np.zeros(7, dtype=bool)
    good, bad = np.full(6, 1e-9), np.array([1.0, 1e-9, 1e-9, 1e-9, 1e-9, 1e-9])
    assert merged(edges, 4, good, kept).tolist() == [True, False, True, False, True, False, True]
    assert merged(edges, 4, bad, kept).tolist() == [True, True, False, True, False, True, True]
    kept[1] = True
    assert merged(edges, 4, good, kept).tolist() == [True, True, False, True, False, True, True]
    assert merged(np.array([0.0, 0.01, 1.0]), 4, good[:2], kept[:3]).all(), "elements of very different lengths stay apart"
    assert merged(edges, 4, np.full(6, 1e-2), kept).all()


def test_decay_rates_scales_curvatures_and_densities_of_nothing():
    tau = gauss_legendre(9)[0]

    def rate(f):
        return float(decay_rates(legendre_coefficients(f(tau)[None, :, None]))[0])

    # 1 / (1 + a^2 tau^2) is analytic within an ellipse, whose size is the rate.
    assert rate(lambda t: 1 / (1.5 - t)) == pytest.approx(np.log(1.5 + np.sqrt(1.25)), abs=0.2)
    assert rate(np.abs) < 0.5 and rate(np.sign) < 0.3 and rate(lambda t: 2.0 + 0 * t) == np.inf
    low, high, span = np.array([0.0, 5.0, -1e-9, 0.0, -3.0]), np.array([2.0, 5.0, 1e-9, 9.0, 4.0]), np.array([1e4, 1e4, 10.0, 3.0, 7.0])
    assert own_scales(low, high, span) == pytest.approx([2.0, 1e-2, 1e-5, 3.0, 7.0])
    places = np.sort(np.random.default_rng(0).uniform(-1, 1, 40))
    parabola = curvatures(places, np.stack([places**2, 3.0 - 2.0 * places], axis=-1))
    assert parabola[1:-1, 0] == pytest.approx(2.0 / (1.0 + 4.0 * places[1:-1] ** 2) ** 1.5, rel=1e-9), "exact by parabolas"
    assert parabola[:, 1] == pytest.approx(0.0, abs=1e-9)
    places = np.linspace(-0.8, 0.8, 400)
    assert curvatures(places, 0.5 * np.sqrt(4.0 - 4.0 * places**2)[:, None]) == pytest.approx(1.0, rel=1e-3)
    assert curvature_density(np.array([[8.0, 27.0], [0.0, 1.0]]), np.array([2.0, 1.0])) == pytest.approx([5.0, 1.0])
    places = np.array([0.0, 0.3, 1.0])
    assert (normalised(places, np.zeros((2, 2))) == 1.0).all()
    for values in (np.zeros((2, 2)), np.array([[1.0, -2.0], [5.0, 5.0]]), np.array([[1.0, np.nan], [5.0, 5.0]])):
        with pytest.raises(ValueError, match="a density must be finite and nowhere negative, and its integral positive"):
            equidistributed(places, values, 3)


def test_quadrature_is_held_against_the_flight():
    problem = Problem("ripple")
    phase = problem.phase("run", t0=0, tf=1)
    x = phase.state("x", bounds=(0, 3), initial=0)
    phase.dynamics(x=1)
    problem.minimize("cost", phase.integral(1 + ca.cos(40 * x)))
    nlp = DFET(2, 1).transcribe(problem)
    flight = nlp.unpack(nlp.propagate(nlp.first_guess(np.empty((1, 0))))[0])
    found = errors(nlp, flight)
    exact = 1 + np.sin(40) / 40
    z = nlp.interpolate(flight)
    F = nlp.evaluate(z[None])[0][0]
    verdict = judge(nlp.problem, flight, Wanted(1e-6, 1e-6), F, np.ones(1))
    assert found.defect.max() < 1e-10 and found.sums.sum() == pytest.approx(1.0)
    assert verdict.missed_by_elements == pytest.approx(abs(F[0] - exact), rel=1e-6) and verdict.missed_by_elements > 0.01
    assert "objectives differ" in " ".join(verdict.complaints())
    finer = next_method(nlp.transcription, verdict, flight)
    assert finer.mesh_of("run").elements > 2, "the states are exact: the integral alone asks for it"
    fine = judge(nlp.problem, flight, Wanted(1e-6, 1e-6), np.array([exact]), np.ones(1))
    confirming = next_method(nlp.transcription, fine, flight).mesh_of("run")
    assert confirming.elements >= 2 and confirming.order > 1, "where nothing is wrong, a mesh that has all of this one, and more"


@pytest.mark.parametrize("method", [DFET(2, 1), DFET(2, 3, basis="bernstein")])
def test_trajectories_become_as_exact_as_wanted(method):
    """Flown anew on each mesh with the same controls: nothing is optimised, and errors fall all the same."""
    nlp = method.transcribe(oscillator())
    z = propagated(nlp, k=1)[0]
    for _ in range(8):
        flight = nlp.unpack(z)
        verdict = assessed(nlp, z)
        if not verdict.simulation.max_defect > 1e-6:
            break
        finer = next_method(method, verdict, flight)
        assert finer != method
        method, nlp = finer, finer.transcribe(nlp.problem)
        z = nlp.propagate(nlp.interpolate(flight)[None])[0]
    assert simulate(nlp.problem, nlp.unpack(z), rtol=1e-11, atol=1e-12).max_defect < 1e-6


def test_errors_do_not_depend_on_the_width_of_bounds():
    values, found = np.sin(np.arange(9)), []
    for wide in (1e3, 1.0):
        problem = Problem("wide")
        phase = problem.phase("run", t0=0, tf=3)
        x, u = phase.state("x", bounds=(-5 * wide, 5 * wide), initial=1), phase.control("u", bounds=(-2 * wide, 2 * wide))
        phase.dynamics(x=-(x**3) + u)
        problem.minimize("cost", phase.integral(x**2 + u**2))
        nlp = DFET(3, 2).transcribe(problem)
        z = nlp.propagate(nlp.first_guess(values[None]))[0]
        flight = nlp.unpack(z)
        found.append((errors(nlp, flight), assessed(nlp, z).defect, control_scales(flight["run"])[0]))
        assert state_scales(flight["run"])[0] <= np.ptp(flight["run"].state.on_elements(np.linspace(-1, 1, 999))) * (1 + 1e-9)
    (one, defect, unit), (other, same_defect, same_unit) = found
    assert one.defect == pytest.approx(other.defect, rel=1e-5) and one.defect.max() > 1e-3
    assert one.tail == pytest.approx(other.tail, rel=1e-9)
    assert defect == pytest.approx(same_defect, rel=1e-5) and unit == pytest.approx(same_unit)


# Orders of controls, and elements that become one


@pytest.mark.slow
def test_growth_is_that_of_the_closed_form():
    """x' = k x + u: an error at the beginning grows by exp(k t)."""
    for rate, duration in ((1.0, 20.0), (-1.0, 20.0)):
        nlp, z = _linear(rate, duration)
        assert growth(nlp.problem, nlp.unpack(z)) == pytest.approx(max(1.0, np.exp(rate * duration)), rel=1e-3)


@pytest.mark.slow
def test_what_no_simulation_can_follow_is_called_that_and_not_an_error_of_the_mesh():
    nlp, z = _linear(1.0, 60.0)
    verdict = assessed(nlp, z)
    assert verdict.local < 1e-9 and verdict.defect > 1.0
    assert verdict.unstable and verdict.complaints() == [] and verdict.error <= 1.0
    assert "unstable: open-loop simulation cannot follow" in verdict.remark and "each element is right to" in verdict.remark
    assert next_method(nlp.transcription, verdict, nlp.unpack(z)).mesh_of("run").elements <= 60, "no mesh is refined for it"
    stable, z = _linear(-1.0, 60.0)
    assert not assessed(stable, z).unstable and assessed(stable, z).remark == ""


def _linear(rate, duration):
    """An exact flight of x' = rate x + u with the control that keeps it at cos t."""
    problem = Problem("linear")
    phase = problem.phase("run", t0=0, tf=duration)
    x = phase.state("x", bounds=(-9, 9), initial=1)
    u = phase.control("u", bounds=(-9, 9))
    phase.dynamics(x=rate * x + u)
    problem.minimize("cost", phase.integral(u**2))
    nlp = DFET(60, 9).transcribe(problem)
    t = duration * np.array([place for profile in nlp.profiles for place in profile.places])
    z = nlp.first_guess((-np.sin(t) - rate * np.cos(t))[None])[0]
    # The states that go with it, element by element.
    _, J, _, g = gradients(nlp)(z)
    states = np.setdiff1d(np.arange(len(z)), nlp.free)
    z[states] -= np.linalg.lstsq(np.array(J)[:, states], np.array(g).ravel() - nlp.g_lower, rcond=None)[0]
    return nlp, z


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


@given(densities(), st.integers(1, 40))
@settings(max_examples=60, deadline=None)
def test_intervals_have_equal_shares(density, count):
    places, values = density
    edges = equidistributed(places, values, count)
    assert edges[0] == 0.0 and edges[-1] == 1.0 and len(edges) == count + 1 and (np.diff(edges) > 0).all()
    whole = share_before(places, values, 1.0)
    for i in (count // 3, count // 2):
        assert share_before(places, values, edges[i]) == pytest.approx(whole * i / count, abs=1e-9 * whole)


@given(densities(), st.integers(1, 40), st.floats(0.05, 1.0))
@settings(max_examples=60, deadline=None)
def test_a_floor_bounds_the_longest_interval(density, count, least):
    places, values = density
    found = raised(places, values, least)
    assert integrals(places, found)[-1] == pytest.approx(1.0) and found.min() >= least - 1e-12
    assert np.diff(equidistributed(places, found, count)).max() <= 1.0 / (least * count) + 1e-12
    if least == 1.0:
        assert equidistributed(places, found, count) == pytest.approx(np.linspace(0, 1, count + 1), abs=1e-12)


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
