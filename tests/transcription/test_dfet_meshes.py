"""DFET on elements of any lengths, each phase with its own."""

from __future__ import annotations

import json

import numpy as np
import pytest
from cases import candidates, decay, integrator, oscillator, propagated, solved
from euler import Euler
from gauss import integrate
from test_dfet import rates_of

from problems import Problem, load
from transcription import DFET, from_dict
from transcription.phases.mesh import PhaseMesh

UNEVEN = (0.0, 0.1, 0.35, 0.9, 1.0)


def two_phases() -> Problem:
    problem = Problem("two")
    one, two = problem.phase("one", t0=0, tf=1), problem.phase("two", t0=1, tf=3)
    x = one.state("x", bounds=(-5, 5), initial=1)
    y = two.state("x", bounds=(-5, 5))
    one.dynamics(x=-x)
    two.dynamics(x=-2 * y)
    problem.link(one, two)
    problem.minimize("end", two.final(y))
    return problem


@pytest.mark.slow
@pytest.mark.parametrize("basis", ["lobatto", "bernstein"])
def test_equal_elements_given_by_their_edges_are_equal_elements(basis):
    n = 7
    plain = DFET(n, 3, control_order=2, basis=basis)
    for edges in (np.linspace(0, 1, n + 1), np.arange(n + 1) / n):
        given = DFET(2, 5, control_order=2, basis=basis, mesh={"swing": (edges, 3)})
        one, two = plain.transcribe(oscillator()), given.transcribe(oscillator())
        assert [v.name for v in one.variables] == [v.name for v in two.variables]
        Z = propagated(one)
        assert np.array_equal(two.propagate(Z), Z)
        assert all(np.array_equal(a, b) for a, b in zip(one.evaluate(Z), two.evaluate(Z), strict=True))
        assert np.array_equal(one.unpack(Z[0])["swing"].time, two.unpack(Z[0])["swing"].time)


@pytest.mark.parametrize("basis", ["lobatto", "bernstein"])
@pytest.mark.parametrize("order", [0, 1, 4])
def test_uneven_elements_are_the_gauss_method_too(basis, order):
    nlp = DFET(1, 1, basis=basis, mesh={"swing": (UNEVEN, order)}).transcribe(oscillator())
    for z, worst in zip(propagated(nlp, k=2), nlp.evaluate(propagated(nlp, k=2))[1], strict=True):
        flight = nlp.unpack(z)
        phase = flight["swing"]
        assert np.allclose((phase.state.edges - phase.t0) / (phase.tf - phase.t0), UNEVEN, atol=1e-15)
        edges, _ = integrate(rates_of(flight, flight.parameters["m"]), phase.states[0], phase.state.edges, order + 1)
        assert np.abs(phase.edge_states - edges).max() < 1e-12 * max(1, np.abs(edges).max())
        assert worst < 1e-13


@pytest.mark.parametrize("order", [0, 1, 2])
def test_halving_uneven_elements_gains_the_order_of_the_method(order):
    errors = []
    for edges in (np.array(UNEVEN), np.sort([*UNEVEN, *(0.5 * (np.array(UNEVEN)[1:] + np.array(UNEVEN)[:-1]))])):
        nlp = DFET(1, 0, mesh={"fall": (edges, order)}).transcribe(decay(tf=2.0)[0])
        errors.append(abs(nlp.unpack(propagated(nlp, k=1)[0])["fall"].edge_states[-1, 0] - np.exp(-2.0)))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * order + 2, abs=0.4)


def test_phases_have_their_own_elements_and_orders():
    nlp = DFET(3, 2, mesh={"two": (UNEVEN, 5)}).transcribe(two_phases())
    flight = nlp.unpack(propagated(nlp, k=1)[0]) if len(nlp.free) else nlp.unpack(nlp.propagate(nlp.first_guess(np.empty((1, 0))))[0])
    assert len(flight["one"].state.edges) == 4 and flight["one"].state.coefficients.shape[1] == 5
    assert len(flight["two"].state.edges) == 5 and flight["two"].state.coefficients.shape[1] == 8
    assert flight["two"].edge_states[-1, 0] == pytest.approx(np.exp(-5.0), abs=1e-7)


def test_the_degree_of_the_controls_follows_the_order_unless_it_is_given():
    free = [len(DFET(4, 6, control_order=q, mesh={"ascent": (UNEVEN, 9)}).transcribe(load("goddard")).free) for q in (None, 2)]
    assert free == [4 * 10 + 1, 4 * 3 + 1]


@pytest.mark.slow
def test_a_mesh_may_have_a_degree_of_controls_of_its_own():
    nlp = DFET(3, 2, control_order=1, mesh={"swing": (UNEVEN, 4, 0)}).transcribe(oscillator())
    assert nlp.unpack(propagated(nlp, k=1)[0])["swing"].control.coefficients.shape == (4, 1, 2)
    same = DFET(3, 2, control_order=1, mesh={"swing": (UNEVEN, 4, 2)}), DFET(3, 2, control_order=2, mesh={"swing": (UNEVEN, 4)})
    one, two = (method.transcribe(oscillator()) for method in same)
    Z = propagated(one)
    assert np.array_equal(Z, propagated(two))
    assert all(np.array_equal(a, b) for a, b in zip(one.evaluate(Z), two.evaluate(Z), strict=True))


@pytest.mark.parametrize("basis", ["lobatto", "bernstein"])
def test_guesses_follow_the_elements(basis):
    problem, phase = integrator()
    problem.minimize("end", phase.tf)
    phase.guess(u=([0.0, 2.0], [0.0, 1.0]), x=(0.0, 1.0))
    nlp = DFET(1, 1, basis=basis, mesh={phase.name: (UNEVEN, 3)}).transcribe(problem)
    control = nlp.unpack(nlp.first_guess(np.where(np.isnan(nlp.guess), 0.5, nlp.guess)[None])[0])[phase.name].control
    length = control.edges[-1] - control.edges[0]
    times = control.edges[0] + length * np.array([0.05, 0.3, 0.6, 0.95])
    assert control(times)[:, 0] == pytest.approx(times / 2, abs=1e-12)


@pytest.mark.parametrize("basis", ["lobatto", "bernstein"])
def test_a_trajectory_comes_back_from_its_own_mesh(basis):
    nlp = DFET(3, 4, control_order=3, basis=basis).transcribe(oscillator())
    for z in propagated(nlp):
        assert np.abs((nlp.interpolate(nlp.unpack(z)) - z) / nlp.span).max() < 1e-10


def test_a_solution_is_nearly_one_on_another_mesh():
    coarse = DFET(4, 6).transcribe(load("goddard"))
    z = solved(coarse, k=1).z[0]
    fine = DFET(4, 6, mesh={"ascent": ((0, 0.1, 0.25, 0.4, 0.5, 0.75, 0.8, 1), 8)}, basis="bernstein").transcribe(load("goddard"))
    start = fine.interpolate(coarse.unpack(z))
    assert ((fine.lower <= start) & (start <= fine.upper)).all()
    flight, same = coarse.unpack(z)["ascent"], fine.unpack(start)["ascent"]
    assert (same.t0, same.tf) == (flight.t0, flight.tf)
    times = np.linspace(same.t0, same.tf, 50)
    assert np.abs(flight.state(times) - same.state(times)).max() < 0.05


def test_periodic_controls_are_interpolated_the_short_way_round():
    coarse = DFET(3, 3).transcribe(load("orbit_rise_full"))
    names = [v.name for v in coarse.variables]
    z = coarse.first_guess(candidates(coarse, k=1))[0]
    for i in coarse.free:
        if ".u[" in names[i] or coarse.variables[i].period:
            z[i] = 3.0 if i % 2 else -3.0
    flight = coarse.unpack(z)
    fine = DFET(6, 3, basis="bernstein").transcribe(load("orbit_rise_full"))
    again = fine.unpack(fine.interpolate(flight))
    for name, phase in flight.items():
        times = np.linspace(phase.t0, phase.tf, 40)[1:-1]
        difference = again[name].control(times) - phase.control(times)
        periods = np.array([v.period or np.inf for v in phase.control_variables])
        assert np.abs(np.sin(np.pi * difference / periods)).max() < 1e-9


@pytest.mark.parametrize(
    "mesh", [None, {}, {"swing": (UNEVEN, 3)}, {"a": ((0, 1), 2), "b": (UNEVEN, 0)}, [("a", PhaseMesh((0, 0.5, 1), 4))]]
)
def test_meshes_make_equal_values_and_go_through_files(mesh):
    method = DFET(2, 3, mesh=mesh)
    assert all(set(plain) == {"edges", "order"} for plain in (method.to_dict()["settings"]["mesh"] or {}).values())
    again = from_dict(json.loads(json.dumps(method.to_dict())))
    assert again == method and hash(again) == hash(method)
    assert json.loads(json.dumps(method.to_dict())) == method.to_dict() == again.to_dict()


def test_degrees_of_controls_and_moving_edges_are_kept():
    mesh = PhaseMesh(UNEVEN, 3, np.int64(1), [3, np.int64(1)])
    assert (mesh.control_order, mesh.moving) == (1, (1, 3))
    assert PhaseMesh.of(json.loads(json.dumps(mesh.to_dict()))) == mesh == PhaseMesh.of((UNEVEN, 3, 1, (1, 3)))
    assert repr(mesh) == "PhaseMesh(4 elements of order 3, controls of order 1, 2 of 3 inner edges moving)"
    assert mesh != PhaseMesh(UNEVEN, 3, 1) != PhaseMesh(UNEVEN, 3)
    method = DFET(2, 3, mesh={"swing": (UNEVEN, 3, 1)})
    again = from_dict(json.loads(json.dumps(method.to_dict())))
    assert again == method and hash(again) == hash(method)


def test_methods_that_do_not_use_them_refuse_them():
    with pytest.raises(ValueError, match="Euler: phase 'swing': the order of its controls cannot be chosen"):
        Euler(3, mesh={"swing": (UNEVEN, 1, 2)})
    with pytest.raises(ValueError, match="Euler: phase 'swing': the edges of its elements cannot move"):
        Euler(3, mesh={"swing": (UNEVEN, 1, None, (2,))})


@pytest.mark.parametrize(
    "mesh",
    [
        {"swing": ((0, 0.5), 2)},
        {"swing": ((0, 0.5, 0.5, 1), 2)},
        {"swing": ((0, 0.7, 0.5, 1), 2)},
        {"swing": ((0, np.nan, 1), 2)},
        {"swing": ((0, 0.5, 0.5 + 1e-12, 1), 2)},
        {"swing": ((0, 1), -1)},
        {"swing": ((0, 1), 1.5)},
        {"swing": (0, 1)},
        {"swing": ("ab", 1)},
        {"swing": 3},
        {"swing": {"edges": (0, 1), "degree": 2}},
        {"swing": (UNEVEN, 2, -1)},
        {"swing": (UNEVEN, 2, 1.5)},
        {"swing": (UNEVEN, 2, 1, (0,))},
        {"swing": (UNEVEN, 2, 1, (4,))},
        {"swing": (UNEVEN, 2, 1, (1.0,))},
        {"swing": (UNEVEN, 2, 1, (True,))},
        {"swing": (UNEVEN, 2, 1, (1, 2, 1))},
        {"swing": (UNEVEN, 2, 1, 1)},
        {"swing": (UNEVEN, 2, 1, "12")},
    ],
)
def test_what_is_no_mesh_is_refused_by_the_phases_name(mesh):
    with pytest.raises(ValueError, match="DFET: phase 'swing'"):
        DFET(2, 3, mesh=mesh)


def test_a_mesh_of_no_phase_is_refused():
    with pytest.raises(ValueError, match="phase 'swim'; the phases of 'oscillator' are swing"):
        DFET(2, 3, mesh={"swim": (UNEVEN, 2)}).transcribe(oscillator())
    with pytest.raises(ValueError, match="must be a mapping"):
        DFET(2, 3, mesh=7)
