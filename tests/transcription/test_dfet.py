"""DFET on elements of any lengths, each phase with its own."""

from math import pi, tan

import casadi as ca
import numpy as np
import pytest
from cases import decay, integrator, oscillator, oscillator_rates, propagated, slot
from gauss import integrate

from macs import optimize
from problems import Problem, load
from transcription import DFET, parse
from transcription.nlp.scalarized import scalarize


def sizes(nlp) -> tuple[int, int]:
    return len(nlp.variables), len(nlp.g_lower)


def rates_of(flight, m: float):
    phase = flight["swing"]

    def rates(j: int, t: float, x: np.ndarray) -> np.ndarray:
        edges = phase.control.edges
        tau = 2 * (t - edges[j]) / (edges[j + 1] - edges[j]) - 1
        return oscillator_rates(t, x, phase.control.on_element(j, np.array([tau]))[0], m, phase.tf)

    return rates


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
    assert found["dynamics of run.x"] < 1e-15 and max(found.values()) == nlp.evaluate(Z)[1][0]
    Z[0, slot(nlp, "run.u[0,0]")] = 2
    assert nlp.violations(Z[0])["bounds of run.u"] == pytest.approx(0.5)
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


UNEVEN = (0.0, 0.1, 0.35, 0.9, 1.0)


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


def closed_curve() -> Problem:
    """The largest area that a curve of length 1 encloses: that of a circle, 1 / (4 pi)."""
    problem = Problem("closed curve")
    curve = problem.phase("curve", t0=0, tf=1)
    x, y = (curve.state(name, bounds=(-1, 1)) for name in "xy")
    u, v = (curve.control(name, bounds=(-2, 2)) for name in "uv")
    curve.dynamics(x=u, y=v)
    curve.path("unit speed", u**2 + v**2, lower=1, upper=1)
    for name, state in (("x", x), ("y", y)):
        problem.constraint(f"closed in {name}", curve.final(state) - curve.initial(state), lower=0, upper=0)
        problem.constraint(f"centre in {name}", curve.integral(state), lower=0, upper=0)
    corners = [0.0, 0.25, 0.5, 0.75, 1.0]
    curve.guess(x=(corners, [0.125, 0.125, -0.125, -0.125, 0.125]), y=(corners, [0.125, -0.125, -0.125, 0.125, 0.125]), u=0.0, v=0.0)
    problem.maximize("area", curve.integral((y * u - x * v) / 2))
    return problem


CIRCLE, POLYGON = 1 / (4 * pi), 1 / (80 * tan(pi / 20))
"""The areas of a circle, and of a regular polygon of 20 sides, whose perimeter is 1."""


@pytest.mark.parametrize(
    ("word", "area", "miss"),
    [("dfet:10x4", CIRCLE, 1e-8), ("dfet:20x3:bernstein:1", CIRCLE, 3e-5), ("dfet:20x2:bernstein:0", POLYGON, 1e-8)],
)
def test_a_closed_curve_of_unit_speed_encloses_a_circle(word: str, area: float, miss: float) -> None:
    nlp = parse(word).nlp(closed_curve())
    middle = np.where(np.isnan(nlp.guess), 0.5 * (nlp.lower + nlp.upper)[nlp.free], nlp.guess)
    solved = scalarize(nlp, nlp.first_guess(middle[None])[0], reference=np.zeros(1), weights=np.ones(1))
    assert solved.status == "converged" and solved.violation < 1e-6
    assert abs(-solved.F[0] / area - 1) < miss


def mountain_car(most: float) -> Problem:
    """Moore's car, which has to swing: https://openmdao.github.io/dymos/examples/mountain_car/mountain_car.html."""
    problem = Problem("mountain car")
    hill = problem.phase("hill", t0=0.0, tf=(90.0, 120.0))
    x = hill.state("x", bounds=(-1.2, most), initial=-0.5, final=0.5)
    v = hill.state("v", bounds=(-0.07, 0.07), initial=0.0, final=(0.0, 0.07))
    u = hill.control("u", bounds=(-1.0, 1.0))
    hill.dynamics(x=v, v=0.001 * u - 0.0025 * ca.cos(3 * x))
    problem.minimize("time", hill.tf)
    return problem


def test_a_bound_at_the_end_that_is_imposed_changes_nothing():
    at_bound, inside = (optimize(mountain_car(most), DFET(8, 4), starts=1).objectives["time"] for most in (0.5, 0.7))
    assert at_bound == pytest.approx(inside, abs=1e-6)
