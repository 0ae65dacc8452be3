from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from cases import candidates, decay, integrator, oscillator, oscillator_rates, propagated, slot
from gauss import integrate

from problems import load
from transcription import DFET


def sizes(nlp) -> tuple[int, int]:
    return len(nlp.variables), len(nlp.g_lower)


def rates_of(flight, m: float):
    phase = flight["swing"]

    def rates(j: int, t: float, x: np.ndarray) -> np.ndarray:
        edges = phase.control.edges
        tau = 2 * (t - edges[j]) / (edges[j + 1] - edges[j]) - 1
        return oscillator_rates(t, x, phase.control.on_element(j, np.array([tau]))[0], m, phase.tf)

    return rates


# What it is


def test_the_sizes_are_those_of_the_paper():
    assert sizes(DFET(4, 6).transcribe(load("goddard"))) == (155, 128)
    assert sizes(DFET(30, 1).transcribe(load("orbit_rise"))) == (421, 360)
    assert len(DFET(4, 6).transcribe(load("goddard")).free) == 29
    assert len(DFET(30, 1).transcribe(load("orbit_rise")).free) == 61


@pytest.mark.slow
@pytest.mark.parametrize("basis", ["lobatto", "bernstein"])
@pytest.mark.parametrize(("elements", "order"), [(1, 0), (3, 0), (2, 1), (3, 2), (1, 4), (2, 6), (1, 9)])
def test_it_is_the_gauss_legendre_implicit_runge_kutta_method(basis, elements, order):
    nlp = DFET(elements, order, basis=basis).transcribe(oscillator())
    Z = propagated(nlp, k=2)
    _, violation = nlp.evaluate(Z)
    for z, worst in zip(Z, violation, strict=True):
        flight = nlp.unpack(z)
        phase = flight["swing"]
        edges, stages = integrate(rates_of(flight, flight.parameters["m"]), phase.states[0], phase.state.edges, order + 1)
        assert np.abs(phase.edge_states - edges).max() < 1e-12 * max(1, np.abs(edges).max())
        inside = phase.states[:-1].reshape(elements, order + 2, 2)[:, 1:]
        assert np.abs(inside - stages).max() < 1e-11 * max(1, np.abs(edges).max()), "states at the quadrature nodes are the stages"
        assert worst < 1e-13


@pytest.mark.parametrize("basis", ["lobatto", "bernstein"])
@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_boundary_values_converge_with_order_2l_plus_2(basis, order):
    problem, _ = decay(tf=2.0)
    errors = []
    for n in (2, 4):
        nlp = DFET(n, order, basis=basis).transcribe(problem)
        phase = nlp.unpack(nlp.propagate(nlp.first_guess(np.empty((1, 0))))[0])["fall"]
        errors.append(np.abs(phase.edge_states[:, 0] - np.exp(-phase.state.edges)).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * (order + 1), abs=0.35)


# Derivatives and shapes


def test_batches_are_rows():
    nlp = DFET(2, 3).transcribe(oscillator())
    Z = propagated(nlp, k=4)
    F, violation = nlp.evaluate(Z)
    assert F.shape == (4, 2) and violation.shape == (4,)
    for i in range(4):
        one, worst = nlp.evaluate(Z[i : i + 1])
        assert np.array_equal(one[0], F[i]) and worst[0] == violation[i]
    assert np.array_equal(nlp.propagate(Z), Z) or np.abs(nlp.propagate(Z) - Z).max() < 1e-12
    C = candidates(nlp, 4)
    before = C.copy()
    first = nlp.first_guess(C)
    assert np.array_equal(C, before) and np.array_equal(first[:, nlp.free], C)
    assert ((first >= nlp.lower) & (first <= nlp.upper)).all()
    assert np.array_equal(nlp.propagate(first)[:, nlp.free], C)


def test_violations_name_what_is_violated():
    problem, phase = integrator(final=1)
    phase.path("gate", phase["x"], upper=0.5)
    problem.constraint("late", phase.integral(phase["x"]), lower=4, scale=2)
    problem.minimize("cost", phase.final(phase["x"]))
    nlp = DFET(2, 2).transcribe(problem)
    Z = nlp.propagate(nlp.first_guess(np.ones((1, 6))))
    found = nlp.violations(Z[0])
    assert found["path 'gate' of 'run'"] == pytest.approx(1 + 0.5 * (1 + np.sqrt(0.6)) - 0.5)
    assert found["constraint 'late'"] == pytest.approx((4 - 2) / 2)
    assert found["final value of run.x"] == pytest.approx(1 / 20)
    assert found["dynamics of run.x"] < 1e-15
    assert max(found.values()) == nlp.evaluate(Z)[1][0]
    Z[0, slot(nlp, "run.u[0,0]")] = 2
    assert nlp.violations(Z[0])["bounds of run.u"] == pytest.approx(0.5)


# Integrals, paths, ends


@pytest.mark.parametrize("basis", ["lobatto", "bernstein"])
def test_integrals_have_their_closed_form(basis):
    problem, phase = decay(tf=1.5)
    x, t = phase["x"], phase.time
    problem.minimize("square", phase.integral(x**2))
    problem.maximize("moment", phase.integral(t * x))
    problem.minimize("clock", phase.integral(1))
    nlp = DFET(3, 6, basis=basis).transcribe(problem)
    F, _ = nlp.evaluate(nlp.propagate(nlp.first_guess(np.empty((1, 0)))))
    e = np.exp(-1.5)
    assert F[0] == pytest.approx([e, (1 - e**2) / 2, -(1 - e * 2.5), 1.5], rel=1e-10)


def test_path_constraints_are_imposed_at_ends_and_nodes():
    problem, phase = integrator()
    phase.path("gate", phase["x"] + phase.time, lower=-1, upper=3)
    phase.path("exact", phase["u"] ** 2, lower=1, upper=1)
    problem.minimize("cost", phase.final(phase["x"]))
    nlp = DFET(3, 2).transcribe(problem)
    rows = [i for i, label in enumerate(nlp.g_labels) if "gate" in label]
    assert len(rows) == 3 * (3 + 2)
    assert set(nlp.g_lower[rows]) == {-1} and set(nlp.g_upper[rows]) == {3}
    z = nlp.propagate(nlp.first_guess(np.ones((1, 9))))[0]
    values = np.array(nlp.functions(z)[1]).ravel()[rows]
    times = nlp.unpack(z)["run"].time
    assert np.unique(values.round(12)) == pytest.approx(2 * times), "x = t here"
    assert nlp.unpack(z)["run"]["gate"] == pytest.approx(2 * times)


@pytest.mark.parametrize(
    "method", [DFET(3, 3, control_order=0), DFET(2, 1, control_order=4), DFET(1, 0), DFET(3, 2, control_order=5, basis="bernstein")]
)
def test_controls_may_have_another_order_than_states(method):
    nlp = method.transcribe(oscillator())
    assert len(nlp.free) == 4 + 2 * method.elements * (method.degree_of_controls(method.order) + 1) - 0
    Z = propagated(nlp)
    assert nlp.evaluate(Z)[1].max() < 1e-12
    phase = nlp.unpack(Z[0])["swing"]
    assert phase.control.coefficients.shape == (method.elements, method.degree_of_controls(method.order) + 1, 2)
    assert (np.diff(phase.time) > 0).all()


# Data


@pytest.mark.parametrize("kind", ["linear", "bspline"])
def test_tables_are_looked_up(kind):
    grid = np.linspace(0, 2, 21)
    table = ca.interpolant("table", kind, [grid], np.cos(grid))
    surface = ca.interpolant("surface", kind, [grid, grid], np.add.outer(grid, 2 * grid).ravel(order="F"))
    problem, phase = decay(tf=1.0)
    phase.state("y", bounds=(-5, 5), initial=0)
    phase._rates = {}
    phase.dynamics(x=-phase["x"], y=table(phase.time) + surface(ca.vertcat(phase.time, phase["x"])))
    problem.minimize("end", phase.final(phase["y"]))
    nlp = DFET(20, 2).transcribe(problem)
    Z = nlp.propagate(nlp.first_guess(np.empty((1, 0))))
    exact = np.sin(1) + 0.5 + 2 * (1 - np.exp(-1))
    F, violation = nlp.evaluate(Z)
    assert F[0, 1] == pytest.approx(exact, rel=2e-3 if kind == "linear" else 1e-5)
    assert violation[0] < 1e-12
