"""Where meshes need more, and whether they get it."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from cases import decay, oscillator, propagated
from hypothesis import given
from hypothesis import strategies as st

from problems import Problem
from transcription import DFET
from transcription.meshes.adaptation import cuts, degrees, judge, next_method, refine, split
from transcription.meshes.errors import decay_rates, phase_errors
from transcription.numerics.polynomials import gauss_legendre, legendre_coefficients
from transcription.trajectories.simulate import simulate

HIGHEST = DFET.highest_order
EDGES = np.array([0.0, 0.2, 0.5, 1.0])
NONE = np.full(3, np.nan)


# The kernel


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


def test_only_where_the_error_is_large_are_elements_cut():
    finer, order = refine(EDGES, 4, np.array([5.0, 0.2, 0.1]), np.zeros(3), NONE, most=20, highest=HIGHEST)
    assert finer.tolist() == [0.0, 0.1, 0.2, 0.5, 1.0] and order == 4


def test_smooth_elements_get_a_higher_order():
    finer, order = refine(EDGES, 4, np.array([50.0, 0.2, 0.1]), np.full(3, 2.0), NONE, most=20, highest=HIGHEST)
    assert finer.tolist() == EDGES.tolist() and order == 5
    finer, _ = refine(EDGES, HIGHEST, np.array([50.0, 0.2, 0.1]), np.full(3, 2.0), NONE, most=20, highest=HIGHEST)
    assert finer.tolist() == [0.0, 0.1, 0.2, 0.5, 1.0]


def test_what_a_higher_order_would_not_mend_is_cut():
    finer, order = refine(EDGES, 6, np.array([1e9, 0.2, 0.1]), np.full(3, 0.9), NONE, most=20, highest=HIGHEST)
    assert len(finer) == 5 and order == 6


def test_an_element_is_cut_around_a_steep_place():
    finer, order = refine(EDGES, 4, np.array([0.1, 0.1, 9.0]), np.full(3, 3.0), np.array([np.nan, np.nan, 0.2]), most=20, highest=HIGHEST)
    assert finer == pytest.approx([0, 0.2, 0.5, 0.725, 0.875, 1.0]) and order == 4
    assert cuts(0.95) == [pytest.approx(0.65)] and cuts(np.nan) == [0.0]


def test_the_worst_elements_come_first_where_there_is_little_room():
    finer, _ = refine(EDGES, 4, np.array([5.0, 50.0, 6.0]), np.zeros(3), NONE, most=4, highest=HIGHEST)
    assert finer.tolist() == [0.0, 0.2, 0.35, 0.5, 1.0]
    assert split(EDGES, {0: [0.0]}, most=3) is EDGES


def test_degrees_are_what_the_rate_promises():
    assert degrees(np.exp(8.0), 1.0) == 4 and degrees(0.1, 1.0) == 1 and degrees(9.0, 0.0) == np.inf


# What it decides from


def test_decay_rates_are_those_of_the_function():
    tau = gauss_legendre(9)[0]

    def rate(f):
        return float(decay_rates(legendre_coefficients(f(tau)[None, :, None]))[0])

    # 1 / (1 + a^2 tau^2) is analytic within an ellipse, whose size is the rate.
    assert rate(lambda t: 1 / (1.5 - t)) == pytest.approx(np.log(1.5 + np.sqrt(1.25)), abs=0.2)
    assert rate(np.abs) < 0.5 and rate(np.sign) < 0.3
    assert rate(lambda t: 2.0 + 0 * t) == np.inf


def test_local_defects_are_those_of_the_single_elements():
    nlp = DFET(1, 1, mesh={"fall": ((0, 0.5, 1), 0)}).transcribe(decay(tf=2.0)[0])
    flight = nlp.unpack(propagated(nlp, k=1)[0])
    found = phase_errors(nlp.problem, flight, rtol=1e-12, atol=1e-13)[0]
    edges = flight["fall"].edge_states[:, 0]
    assert found.defect == pytest.approx(np.abs(edges[:-1] * np.exp(-1.0) - edges[1:]) / 4.0, rel=1e-6)


def test_quadrature_is_held_against_the_flight():
    problem = Problem("ripple")
    phase = problem.phase("run", t0=0, tf=1)
    x = phase.state("x", bounds=(0, 3), initial=0)
    phase.dynamics(x=1)
    problem.minimize("cost", phase.integral(1 + ca.cos(40 * x)))
    nlp = DFET(2, 1).transcribe(problem)
    flight = nlp.unpack(nlp.propagate(nlp.first_guess(np.empty((1, 0))))[0])
    found = phase_errors(nlp.problem, flight, rtol=1e-10, atol=1e-11)[0]
    assert found.defect.max() < 1e-10 and found.integral.max() > 0.01


def test_controls_that_switch_are_found():
    problem = Problem("switch")
    phase = problem.phase("run", t0=0, tf=1)
    phase.state("x", bounds=(-3, 3), initial=0)
    u = phase.control("u", bounds=(-1, 1))
    phase.dynamics(x=u)
    problem.minimize("end", phase.final(phase["x"]))
    nlp = DFET(1, 8, basis="bernstein").transcribe(problem)
    names = [nlp.variables[i].name for i in nlp.free]
    z = nlp.propagate(nlp.first_guess(np.array([[1.0 if i < 5 else -1.0 for i in range(len(names))]])))[0]
    found = phase_errors(nlp.problem, nlp.unpack(z), rtol=1e-9, atol=1e-10)[0]
    assert abs(found.steep[0] - 0.1) < 0.2
    z = nlp.propagate(nlp.first_guess(np.linspace(-0.9, 0.9, len(names))[None]))[0]
    assert np.isnan(phase_errors(nlp.problem, nlp.unpack(z), rtol=1e-9, atol=1e-10)[0].steep[0])


# Together


@pytest.mark.parametrize("method", [DFET(2, 1), DFET(3, 4, control_order=2), DFET(2, 3, basis="bernstein")])
def test_trajectories_become_as_exact_as_wanted(method):
    """Flown anew on each mesh with the same controls: nothing is optimised, and errors fall all the same."""
    nlp = method.transcribe(oscillator())
    z = propagated(nlp, k=1)[0]
    for _ in range(8):
        flight = nlp.unpack(z)
        verdict = judge(nlp.problem, flight, 1e-6, 1e-6)
        if not verdict.simulation.max_defect > 1e-6:
            break
        finer = next_method(method, verdict, flight)
        assert finer != method
        method, nlp = finer, finer.transcribe(nlp.problem)
        z = nlp.propagate(nlp.interpolate(flight)[None])[0]
    assert simulate(nlp.problem, nlp.unpack(z), rtol=1e-11, atol=1e-12).max_defect < 1e-6


def test_controls_that_leave_their_bounds_are_written_by_what_bounds_them():
    nlp = DFET(1, 2).transcribe(oscillator())
    z = propagated(nlp, k=1)[0]
    for i in nlp.free:
        if ".u[" in nlp.variables[i].name:
            z[i] = 1.0 if "[0,1]" in nlp.variables[i].name else -1.0
    flight = nlp.unpack(nlp.propagate(z[None])[0])
    verdict = judge(nlp.problem, flight, 1e-6, 1e-6)
    assert verdict.leaving > 0.01 and "a control leaves its bounds" in " ".join(verdict.complaints())
    finer = next_method(DFET(1, 2), verdict, flight)
    assert finer.basis == "bernstein"
    again = finer.transcribe(nlp.problem)
    assert judge(nlp.problem, again.unpack(again.interpolate(flight)), 1e-6, 1e-6).leaving == 0.0
