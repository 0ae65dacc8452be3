from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from cases import candidates, decay, integrator, oscillator, oscillator_rates, propagated, slot
from gauss import integrate

from problems import Problem, load
from transcription import DFET, Transcription, from_dict, parse


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


@pytest.mark.parametrize("order", [1, 2, 3])
def test_between_nodes_the_states_converge_with_order_l_plus_2(order):
    problem, _ = decay(tf=2.0)
    errors, times = [], np.linspace(0, 2, 401)
    for n in (4, 8):
        nlp = DFET(n, order).transcribe(problem)
        phase = nlp.unpack(nlp.propagate(nlp.first_guess(np.empty((1, 0))))[0])["fall"]
        errors.append(np.abs(phase.at(times)["x"] - np.exp(-times)).max())
    assert np.log2(errors[0] / errors[1]) > order + 1.6


def test_bases_agree_where_both_are_exact():
    """The same control polynomial in both bases gives the same flight, objectives and integrals."""
    problem, order = oscillator(), 3
    first, second = (DFET(2, order, basis=basis).transcribe(problem) for basis in ("lobatto", "bernstein"))
    z = propagated(first, k=1)[0]
    phase = first.unpack(z)["swing"]
    points = np.array([-0.9, -0.2, 0.4, 1.0])
    from transcription.numerics import polynomials

    solve = np.linalg.inv(polynomials.basis_matrix("bernstein", order, points))
    other = second.first_guess(candidates(second, 1))
    for name in ("m", "swing.t0", "swing.tf", "swing.x(t0)"):
        other[0, slot(second, name)] = z[slot(first, name)]
    for j in range(2):
        coefficients = solve @ phase.control.on_element(j, points)
        for k in range(order + 1):
            for i, name in enumerate("uv"):
                other[0, slot(second, f"swing.{name}[{j},{k}]")] = coefficients[k, i]
    other = second.propagate(other)
    assert second.unpack(other[0])["swing"].edge_states == pytest.approx(phase.edge_states, abs=1e-12)
    F, _ = first.evaluate(z[None])
    G, _ = second.evaluate(other)
    assert pytest.approx(F, rel=1e-12) == G


@pytest.mark.parametrize(
    "settings",
    [(0, 1), (1, -1), (1.5, 1), (1, 1.0), ("2", 1), (True, 1), (1, True), (None, 1), (1, 1, -1), (1, 1, 2.0), (1, 1, None, "hermite")],
    ids=str,
)
def test_bad_settings_are_refused(settings):
    names = ("elements", "order", "control_order", "basis")
    with pytest.raises(ValueError, match="|".join(names)):
        DFET(**dict(zip(names, settings, strict=False)))


def test_settings_travel():
    for method in (DFET(4, 6), DFET(2, 3, control_order=1, basis="bernstein"), DFET(np.int64(3), np.int32(2))):
        assert from_dict(method.to_dict()) == method
        assert isinstance(method, Transcription) and hash(method) == hash(from_dict(method.to_dict()))
    assert parse("dfet:4x6") == DFET(4, 6) and parse("DFET:4x6:bernstein") == DFET(4, 6, basis="bernstein")
    for text in (
        "",
        "dfet",
        "dfet:4",
        "dfet:4x",
        "dfet:x6",
        "dfet:4x6x7",
        "rk:4x6",
        "dfet:-4x6",
        "dfet:4x6:hermite",
        "dfet:0x1",
        "dfet:4.5x6",
        "dfet:4x6:1:2",
        "dfet:4x6:lobatto:bernstein",
        "dfet:4x6:bernstein:1:1",
    ):
        with pytest.raises(ValueError):
            parse(text)
    with pytest.raises(ValueError, match="Magic"):
        from_dict({"method": "Magic"})
    with pytest.raises(ValueError, match="DFET"):
        from_dict({"method": "DFET", "settings": {"stages": 3}})


# Derivatives and shapes


@pytest.mark.parametrize("method", [DFET(2, 2), DFET(2, 1, control_order=2, basis="bernstein")])
def test_derivatives_are_exact_and_sparse(method):
    nlp = method.transcribe(oscillator())
    z = propagated(nlp, k=1)[0] + 0.01
    jacobian = nlp.functions.factory("J", ["z"], ["jac:g:z", "jac:F:z"])
    exact = [np.array(J.full()) for J in jacobian(z)]
    step = 1e-6
    for matrix, k in zip(exact, (1, 0), strict=True):
        difference = np.array(
            [
                (np.array(nlp.functions(z + step * e)[k]) - np.array(nlp.functions(z - step * e)[k])).ravel() / (2 * step)
                for e in np.eye(len(z))
            ]
        ).T
        assert np.abs(matrix - difference).max() < 1e-6 * max(1, np.abs(matrix).max())
    assert nlp.functions.jac_sparsity(1, 0).density() < 50


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


def test_march_leaves_what_it_was_given_alone():
    nlp = DFET(2, 3).transcribe(oscillator())
    Z = nlp.first_guess(candidates(nlp, 2))
    before = Z.copy()
    nlp.propagate(Z), nlp.tighten(Z), nlp.evaluate(Z), nlp.unpack(Z[0])
    assert np.array_equal(Z, before)


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


def test_fixed_things_are_no_variables():
    problem, phase = integrator(bounds=(0.5, 0.5))
    m = problem.parameter("m", bounds=(3, 3))
    problem.minimize("cost", m * phase.final(phase["x"]))
    nlp = DFET(2, 2).transcribe(problem)
    assert len(nlp.free) == 0 and all(v.lower < v.upper for v in nlp.variables)
    F, violation = nlp.evaluate(nlp.propagate(nlp.first_guess(np.empty((2, 0)))))
    assert pytest.approx(np.full((2, 1), 3.0)) == F and violation.max() < 1e-14
    flight = nlp.unpack(nlp.propagate(nlp.first_guess(np.empty((1, 0))))[0])
    assert flight.parameters == {"m": 3} and flight["run"]["u"] == pytest.approx(np.full(9, 0.5))


def test_free_times_and_ranged_ends_are_variables_within_their_ranges():
    problem, phase = integrator(t0=(0, 1), tf=(2, 3), initial=(-1, 1), final=(0.5, 2))
    problem.minimize("time", phase.tf - phase.t0)
    nlp = DFET(2, 1).transcribe(problem)
    found = {v.name: (v.lower, v.upper) for v in nlp.variables}
    assert found["run.t0"] == (0, 1) and found["run.tf"] == (2, 3)
    assert found["run.x(t0)"] == (-1, 1) and found["run.x(tf)"] == (0.5, 2)
    free = {nlp.variables[i].name for i in nlp.free}
    assert {"run.t0", "run.tf", "run.x(t0)"} <= free and "run.x(tf)" not in free
    phase = nlp.unpack(propagated(nlp, k=1)[0])["run"]
    assert phase.edge_states[-1, 0] - phase.edge_states[0, 0] == pytest.approx(
        np.sum([np.mean(phase.control.coefficients[j]) for j in range(2)]) * (phase.tf - phase.t0) / 2
    )


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


def test_dynamics_without_derivatives_are_refused():
    class Drag(ca.Callback):
        def __init__(self):
            ca.Callback.__init__(self)
            self.construct("drag", {})

        def eval(self, arguments):
            return [0.1 * arguments[0] ** 2]

    drag = Drag()
    problem = Problem("braking")
    phase = problem.phase("slide", t0=0, tf=(1, 2))
    v = phase.state("v", bounds=(0, 10), initial=5)
    phase.dynamics(v=-drag(v))
    problem.minimize("speed", phase.final(v))
    with pytest.raises(ValueError, match=r"phase 'slide'.*no derivatives.*enable_fd"):
        DFET(2, 2).transcribe(problem)
