from __future__ import annotations

import itertools

import casadi as ca
import numpy as np
import pytest
from cases import candidates, decay, flown, integrator, oscillator, oscillator_rates, slot
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


@pytest.mark.parametrize("basis", ["lobatto", "bernstein"])
@pytest.mark.parametrize(("elements", "order"), [(1, 0), (3, 0), (2, 1), (3, 2), (1, 4), (2, 6), (1, 9)])
def test_it_is_the_gauss_legendre_implicit_runge_kutta_method(basis, elements, order):
    nlp = DFET(elements, order, basis=basis).transcribe(oscillator())
    Z = flown(nlp, k=2)
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
        phase = nlp.unpack(nlp.march(nlp.first_guess(np.empty((1, 0))))[0])["fall"]
        errors.append(np.abs(phase.edge_states[:, 0] - np.exp(-phase.state.edges)).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * (order + 1), abs=0.35)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_between_nodes_the_states_converge_with_order_l_plus_2(order):
    problem, _ = decay(tf=2.0)
    errors, times = [], np.linspace(0, 2, 401)
    for n in (4, 8):
        nlp = DFET(n, order).transcribe(problem)
        phase = nlp.unpack(nlp.march(nlp.first_guess(np.empty((1, 0))))[0])["fall"]
        errors.append(np.abs(phase.at(times)["x"] - np.exp(-times)).max())
    assert np.log2(errors[0] / errors[1]) > order + 1.6


def test_bases_agree_where_both_are_exact():
    """The same control polynomial in both bases gives the same flight, objectives and integrals."""
    problem, order = oscillator(), 3
    first, second = (DFET(2, order, basis=basis).transcribe(problem) for basis in ("lobatto", "bernstein"))
    z = flown(first, k=1)[0]
    phase = first.unpack(z)["swing"]
    points = np.array([-0.9, -0.2, 0.4, 1.0])
    from transcription import polynomials

    solve = np.linalg.inv(polynomials.basis_matrix("bernstein", order, points))
    other = second.first_guess(candidates(second, 1))
    for name in ("m", "swing.t0", "swing.tf", "swing.x(t0)"):
        other[0, slot(second, name)] = z[slot(first, name)]
    for j in range(2):
        coefficients = solve @ phase.control.on_element(j, points)
        for k in range(order + 1):
            for i, name in enumerate("uv"):
                other[0, slot(second, f"swing.{name}[{j},{k}]")] = coefficients[k, i]
    other = second.march(other)
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
    z = flown(nlp, k=1)[0] + 0.01
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
    Z = flown(nlp, k=4)
    F, violation = nlp.evaluate(Z)
    assert F.shape == (4, 2) and violation.shape == (4,)
    for i in range(4):
        one, worst = nlp.evaluate(Z[i : i + 1])
        assert np.array_equal(one[0], F[i]) and worst[0] == violation[i]
    assert np.array_equal(nlp.march(Z), Z) or np.abs(nlp.march(Z) - Z).max() < 1e-12
    C = candidates(nlp, 4)
    before = C.copy()
    first = nlp.first_guess(C)
    assert np.array_equal(C, before) and np.array_equal(first[:, nlp.free], C)
    assert ((first >= nlp.lower) & (first <= nlp.upper)).all()
    assert np.array_equal(nlp.march(first)[:, nlp.free], C)


def test_march_leaves_what_it_was_given_alone():
    nlp = DFET(2, 3).transcribe(oscillator())
    Z = nlp.first_guess(candidates(nlp, 2))
    before = Z.copy()
    nlp.march(Z), nlp.tighten(Z), nlp.evaluate(Z), nlp.unpack(Z[0])
    assert np.array_equal(Z, before)


def test_violations_name_what_is_violated():
    problem, phase = integrator(final=1)
    phase.path("gate", phase["x"], upper=0.5)
    problem.constraint("late", phase.integral(phase["x"]), lower=4, scale=2)
    problem.minimize("cost", phase.final(phase["x"]))
    nlp = DFET(2, 2).transcribe(problem)
    Z = nlp.march(nlp.first_guess(np.ones((1, 6))))
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
    F, _ = nlp.evaluate(nlp.march(nlp.first_guess(np.empty((1, 0)))))
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
    z = nlp.march(nlp.first_guess(np.ones((1, 9))))[0]
    values = np.array(nlp.functions(z)[1]).ravel()[rows]
    times = nlp.unpack(z)["run"].time
    assert np.unique(values.round(12)) == pytest.approx(2 * times), "x = t here"
    assert nlp.unpack(z)["run"]["gate"] == pytest.approx(2 * times)


@pytest.mark.parametrize(
    "method", [DFET(3, 3, control_order=0), DFET(2, 1, control_order=4), DFET(1, 0), DFET(3, 2, control_order=5, basis="bernstein")]
)
def test_controls_may_have_another_order_than_states(method):
    nlp = method.transcribe(oscillator())
    assert len(nlp.free) == 4 + 2 * method.elements * (method.degree_of_controls + 1) - 0
    Z = flown(nlp)
    assert nlp.evaluate(Z)[1].max() < 1e-12
    phase = nlp.unpack(Z[0])["swing"]
    assert phase.control.coefficients.shape == (method.elements, method.degree_of_controls + 1, 2)
    assert (np.diff(phase.time) > 0).all()


def test_fixed_things_are_no_variables():
    problem, phase = integrator(bounds=(0.5, 0.5))
    m = problem.parameter("m", bounds=(3, 3))
    problem.minimize("cost", m * phase.final(phase["x"]))
    nlp = DFET(2, 2).transcribe(problem)
    assert len(nlp.free) == 0 and all(v.lower < v.upper for v in nlp.variables)
    F, violation = nlp.evaluate(nlp.march(nlp.first_guess(np.empty((2, 0)))))
    assert pytest.approx(np.full((2, 1), 3.0)) == F and violation.max() < 1e-14
    flight = nlp.unpack(nlp.march(nlp.first_guess(np.empty((1, 0))))[0])
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
    phase = nlp.unpack(flown(nlp, k=1)[0])["run"]
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
    Z = nlp.march(nlp.first_guess(np.empty((1, 0))))
    exact = np.sin(1) + 0.5 + 2 * (1 - np.exp(-1))
    F, violation = nlp.evaluate(Z)
    assert F[0, 1] == pytest.approx(exact, rel=2e-3 if kind == "linear" else 1e-5)
    assert violation[0] < 1e-12


# Periodic controls


def spinner(**bounds) -> Problem:
    problem, phase = integrator(**({"bounds": (-np.pi, np.pi), "period": 2 * np.pi} | bounds))
    phase._rates = {}
    phase.dynamics(x=ca.cos(phase["u"]))
    problem.minimize("end", phase.final(phase["x"]))
    problem.minimize("turns", phase.integral(ca.sin(phase["u"])))
    return problem


@pytest.mark.parametrize("basis", ["lobatto", "bernstein"])
def test_a_period_more_changes_nothing(basis):
    nlp = DFET(2, 3, basis=basis).transcribe(spinner())
    assert nlp.period[nlp.free] == pytest.approx(np.full(8, 2 * np.pi))
    rng = np.random.default_rng(3)
    Z = flown(nlp, k=5)
    moved = Z.copy()
    moved[:, nlp.free] += 2 * np.pi * rng.integers(-1, 2, (5, 8))
    F, g = (np.array(v).T for v in nlp.functions(Z.T))
    G, h = (np.array(v).T for v in nlp.functions(moved.T))
    assert pytest.approx(F, abs=1e-12) == G and pytest.approx(g, abs=1e-12) == h
    assert nlp.march(moved)[:, [i for i in range(Z.shape[1]) if i not in nlp.free]] == pytest.approx(
        Z[:, [i for i in range(Z.shape[1]) if i not in nlp.free]], abs=1e-12
    )
    assert nlp.distance(Z, moved) == pytest.approx(np.zeros(5), abs=1e-12)


@pytest.mark.parametrize(
    "values", [(3.0, -3.0), (-3.0, 3.0), (np.pi / 2, -np.pi / 2), (-np.pi / 2, np.pi / 2), (0, np.pi), (-np.pi, 0), (0, 3)]
)
def test_inside_an_element_a_periodic_control_takes_the_short_way(values):
    """And the trajectory takes the same as the equations, also at half a period."""
    nlp = DFET(1, 1, basis="bernstein").transcribe(spinner())
    z = nlp.march(nlp.first_guess(np.array([values], dtype=float)))[0]
    phase = nlp.unpack(z)["run"]
    law = phase.control.coefficients[0, :, 0]
    assert abs(law[1] - law[0]) <= np.pi + 1e-12
    assert np.cos(law) == pytest.approx(np.cos(values))
    A = 0.5 * (law[0] + law[1])
    half = 0.5 * (law[1] - law[0]) / np.sqrt(3)
    assert phase.edge_states[-1, 0] == pytest.approx(np.cos(A + half) + np.cos(A - half), abs=1e-12)
    shown = phase.at(np.linspace(0, 2, 50))["u"]
    assert (shown >= -np.pi - 1e-12).all() and (shown <= np.pi + 1e-12).all()
    assert (phase["u"] >= -np.pi - 1e-12).all() and (phase["u"] <= np.pi + 1e-12).all()


# Links


def relay(legs: int, jump: float = 0.0) -> Problem:
    """x' = u one leg after the other; `drop` is lost between the legs, if at all."""
    problem = Problem("relay")
    phases = []
    for i in range(legs):
        phase = problem.phase(f"leg {i}", t0=0 if i == 0 else (0, 10), tf=(0, 10), duration=(0, 3))
        phase.state("x", bounds=(-10, 10), initial=0 if i == 0 else None)
        phase.state("m", bounds=(0, 20), initial=10 if i == 0 else None)
        u = phase.control("u", bounds=(-1, 1))
        phase.dynamics(x=u, m=-0.1)
        phases.append(phase)
    for i, (first, second) in enumerate(itertools.pairwise(phases)):
        problem.link(first, second, states=["x"] if jump else None)
        if jump:
            drop = first.final(first["m"]) - second.initial(second["m"])
            problem.constraint(f"drop {i}", drop, lower=jump, upper=jump)
    problem.minimize("time", phases[-1].tf)
    problem.maximize("way", phases[-1].final(phases[-1]["x"]))
    return problem


@pytest.mark.parametrize("legs", [1, 2, 3, 12])
def test_linked_phases_share_time_and_states(legs):
    nlp = DFET(2, 2).transcribe(relay(legs))
    assert not any(label.startswith("link") for label in nlp.g_labels)
    flight = nlp.unpack(flown(nlp, k=1)[0])
    assert list(flight) == [f"leg {i}" for i in range(legs)] and len(flight) == legs
    for i in range(1, legs):
        before, after = flight[f"leg {i - 1}"], flight[f"leg {i}"]
        assert after.t0 == pytest.approx(before.tf, abs=1e-12)
        assert np.array_equal(after.edge_states[0], before.edge_states[-1])
    total = sum(p.control.coefficients.mean() for p in flight.values())
    assert np.isfinite(total)
    last = flight[f"leg {legs - 1}"]
    assert last.edge_states[-1, 1] == pytest.approx(10 - 0.1 * last.tf)


@pytest.mark.parametrize("second", [(3.0, 3.0), (4.0, 2.0)], ids=["no time", "backwards"])
def test_a_phase_of_no_duration_still_has_its_ends(second):
    problem = relay(2)
    nlp = DFET(3, 2).transcribe(problem)
    C = candidates(nlp, 1)
    C[0, [list(nlp.free).index(slot(nlp, f"leg {i}.tf")) for i in range(2)]] = second
    z = nlp.march(nlp.first_guess(C))[0]
    flight = nlp.unpack(z)
    assert np.array_equal(flight["leg 1"].edge_states[0], flight["leg 0"].edge_states[-1])
    assert flight["leg 1"].edge_states[-1, 1] == pytest.approx(10 - 0.1 * second[1]) == flight["leg 1"]["m"][-1]
    assert flight["leg 1"]["u"][0] == pytest.approx(flight["leg 1"].control.on_element(0, -np.ones(1))[0, 0])
    assert (nlp.evaluate(z[None])[1][0] < 1e-12) == (second[1] >= second[0])


def test_states_that_are_not_linked_may_jump():
    nlp = DFET(2, 2).transcribe(relay(3, jump=1.5))
    assert "constraint 'drop 0'" in nlp.g_labels
    from cases import solved

    found = solved(nlp)
    assert set(found.status) == {"converged"}
    flight = nlp.unpack(found.z[0])
    assert flight["leg 0"]["m"][-1] - flight["leg 1"]["m"][0] == pytest.approx(1.5, abs=1e-5)
    assert flight["leg 0"]["x"][-1] == flight["leg 1"]["x"][0]


def test_several_phases_may_lead_into_one_declared_before_them():
    problem = Problem("meeting")
    together = problem.phase("together", t0=(0, 5), tf=6)
    x = together.state("x", bounds=(-10, 10))
    together.dynamics(x=0)
    for name, start in (("left", -1), ("right", 1)):
        phase = problem.phase(name, t0=0, tf=(1, 5))
        phase.state("x", bounds=(-10, 10), initial=start)
        phase.dynamics(x=phase.control("u", bounds=(-1, 1)))
        problem.link(phase, together)
    problem.minimize("place", together.final(x))
    nlp = DFET(2, 2).transcribe(problem)
    joined = {label for label in nlp.g_labels if label.startswith("link")}
    assert joined == {"link from 'right' to 'together': t0", "link from 'right' to 'together': x"}
    from cases import solved

    found = solved(nlp)
    assert set(found.status) == {"converged"}
    flight = nlp.unpack(found.z[0])
    assert list(flight) == ["together", "left", "right"]
    assert flight["left"].tf == pytest.approx(flight["right"].tf, abs=1e-5) == flight["together"].t0
    assert flight["left"]["x"][-1] == pytest.approx(flight["right"]["x"][-1], abs=1e-4)


def test_one_phase_may_lead_into_several():
    problem = Problem("staging")
    ends = {}
    for name in ("stack", "orbiter", "booster"):
        phase = problem.phase(name, t0=0 if name == "stack" else (0, 9), tf=(1, 9))
        ends[name] = phase
        phase.state("x", bounds=(-10, 10), initial=0 if name == "stack" else None)
        phase.dynamics(x=phase.control("u", bounds=(-1, 1)))
    problem.link(ends["stack"], ends["orbiter"])
    problem.link(ends["stack"], ends["booster"])
    problem.minimize("time", ends["orbiter"].tf + ends["booster"].tf)
    nlp = DFET(2, 2).transcribe(problem)
    flight = nlp.unpack(flown(nlp, k=1)[0])
    for name in ("orbiter", "booster"):
        assert flight[name].t0 == pytest.approx(flight["stack"].tf) and flight[name]["x"][0] == flight["stack"]["x"][-1]


def test_durations_are_rows_only_where_the_times_do_not_see_to_it():
    def labels(**times):
        problem, phase = integrator(**times)
        problem.minimize("time", phase.tf)
        return [label for label in DFET(1, 1).transcribe(problem).g_labels if "duration" in label]

    assert labels(tf=(1, 5)) == []
    assert labels(tf=(1, 5), duration=(2, 4)) == []
    assert labels(t0=(0, 4), tf=(1, 5)) == ["duration of 'run'"]
    assert labels(t0=(0, 4), tf=(5, 9)) == []
    assert labels(t0=(0, 4), tf=(5, 9), duration=(2, 3)) == ["duration of 'run'"]


# Guesses


def guessed(**values):
    problem, phase = integrator(tf=(1, 3), initial=(-1, 1), final=(2, 4))
    problem.parameter("p", bounds=(0, 4))
    problem.minimize("end", phase.final(phase["x"]))
    parameters = {k: values.pop(k) for k in list(values) if k == "p"}
    phase.guess(**values)
    problem.guess(**parameters)
    nlp = DFET(2, 3).transcribe(problem)
    return nlp, dict(zip((nlp.variables[i].name for i in nlp.free), nlp.guess, strict=True))


def test_nothing_guessed_is_nan():
    nlp, _found = guessed()
    assert np.isnan(nlp.guess).all()
    Z = nlp.first_guess(candidates(nlp, 2))
    phase = nlp.unpack(Z[0])["run"]
    assert phase.edge_states[-1, 0] == pytest.approx(3), "middle of the final range"
    assert phase.edge_states[1, 0] == pytest.approx(0.5 * (phase.edge_states[0, 0] + 3)), "on a line"


def test_numbers_lines_and_samples_are_guesses():
    nlp, found = guessed(u=0.25, p=1, tf=2)
    assert found["run.tf"] == 2 and found["p"] == 1 and found["run.u[1,2]"] == 0.25 and np.isnan(found["run.x(t0)"])
    nlp, found = guessed(u=(-1, 1), x=(-0.5, 3.5), tf=2)
    assert found["run.x(t0)"] == -0.5
    nodes = 0.5 * (1 + np.polynomial.legendre.leggauss(4)[0])
    assert [found[f"run.u[0,{k}]"] for k in range(4)] == pytest.approx(-1 + nodes)
    assert [found[f"run.u[1,{k}]"] for k in range(4)] == pytest.approx(nodes)
    nlp, found = guessed(u=([0, 1, 3], [0, 1, 1]), x=([0, 3], [0, 3]), tf=2)
    assert [found[f"run.u[0,{k}]"] for k in range(4)] == pytest.approx(nodes), "samples are in absolute time"
    C = np.where(np.isnan(nlp.guess), 1.0, nlp.guess)[None]
    phase = nlp.unpack(nlp.first_guess(C)[0])["run"]
    assert phase.states[:, 0] == pytest.approx(phase.time, abs=1e-12)


def test_guesses_are_taken_into_narrower_ranges():
    nlp, found = guessed(x=(-5, 9))
    assert found["run.x(t0)"] == -1
    Z = nlp.first_guess(np.where(np.isnan(nlp.guess), 1.0, nlp.guess)[None])
    assert Z[0, slot(nlp, "run.x(tf)")] == 4


# Peaks


def humps(tf: float = 3.0) -> tuple[Problem, object]:
    """x = sin(t) exactly enough: the peak is 1 inside, the minimum at the end."""
    problem = Problem("humps")
    phase = problem.phase("wave", t0=0, tf=tf)
    x = phase.state("x", bounds=(-5, 5), initial=0)
    y = phase.state("y", bounds=(-5, 5), initial=1)
    phase.dynamics(x=y, y=-x)
    return problem, phase


@pytest.mark.parametrize("basis", ["lobatto", "bernstein"])
def test_peaks_are_the_largest_values(basis):
    problem, phase = humps()
    problem.minimize("top", phase.peak(phase["x"]))
    problem.maximize("bottom", -phase.peak(-phase["y"]))
    problem.minimize("both", phase.peak(phase["x"]) + phase.integral(1))
    nlp = DFET(12, 4, basis=basis).transcribe(problem)
    Z = nlp.march(nlp.first_guess(np.empty((1, 0))))
    F, violation = nlp.evaluate(Z)
    assert F[0] == pytest.approx([1, -np.cos(3), 4], abs=1e-3) and violation[0] < 1e-12
    assert not len(nlp.free), "peaks follow"


def test_tighten_sets_peaks_and_nothing_else():
    problem, phase = integrator()
    problem.minimize("top", phase.peak(phase["u"]))
    nlp = DFET(2, 2).transcribe(problem)
    Z = flown(nlp)
    k = slot(nlp, "run.peak[0]")
    loose = Z.copy()
    loose[:, k] += 7
    assert nlp.evaluate(loose)[1].max() < 1e-12, "a bound above the peak is no violation"
    low = Z.copy()
    low[:, k] -= 7
    assert nlp.evaluate(low)[1].min() > 1
    assert np.array_equal(nlp.tighten(loose), Z) and np.array_equal(nlp.tighten(low), Z)


def test_a_peak_may_be_bounded_above():
    from cases import solved

    problem, phase = integrator(final=1)
    problem.constraint("gentle", phase.peak(phase["u"]), upper=0.6)
    problem.minimize("effort", phase.integral(phase["u"] ** 2))
    nlp = DFET(3, 2, basis="bernstein").transcribe(problem)
    found = solved(nlp, k=4)
    assert set(found.status) == {"converged"}
    for z in found.z:
        assert nlp.unpack(z)["run"].at(np.linspace(0, 2, 200))["u"].max() < 0.6 + 0.03


# Trajectories


def test_time_increases_and_at_interpolates():
    nlp = DFET(3, 4).transcribe(oscillator())
    flight = nlp.unpack(flown(nlp, k=1)[0])
    phase = flight["swing"]
    assert (np.diff(phase.time) > 0).all() and phase.time[0] == phase.t0 and phase.time[-1] == phase.tf
    assert set(phase.state.edges) <= set(phase.time)
    together = phase.at(phase.time)
    assert set(together) == {"x", "y", "u", "v"}
    for name in together:
        assert together[name] == pytest.approx(phase[name], abs=1e-12)
        one = phase.at(float(phase.time[3]))[name]
        assert isinstance(one, float) and one == pytest.approx(phase[name][3])
    assert phase.at(np.zeros((2, 3)) + phase.t0)["x"].shape == (2, 3)
    assert phase.at(np.array([]))["x"].shape == (0,)
    # States are continuous over the ends of elements.
    for edge in phase.state.edges[1:-1]:
        assert phase.at(edge - 1e-9)["x"] == pytest.approx(phase.at(edge)["x"], abs=1e-7)


def test_what_is_not_there_is_told():
    nlp = DFET(2, 2).transcribe(oscillator())
    flight = nlp.unpack(flown(nlp, k=1)[0])
    phase = flight["swing"]
    with pytest.raises(KeyError, match=r"descent.*swing"):
        flight["descent"]
    with pytest.raises(KeyError, match=r"swing.*height.*x, y, u, v"):
        phase["height"]
    for time in (phase.t0 - 0.01, phase.tf + 0.01, np.nan, [phase.t0, phase.tf + 1]):
        with pytest.raises(ValueError, match="swing"):
            phase.at(time)
    phase.at([phase.t0, phase.tf])


def test_unpacking_takes_values_back_exactly():
    nlp = DFET(2, 2).transcribe(load("goddard"))
    z = nlp.first_guess(candidates(nlp, 1))[0]
    phase = nlp.unpack(z)["ascent"]
    assert phase.tf == z[slot(nlp, "ascent.tf")]
    assert phase.control.coefficients[1, 2, 0] == z[slot(nlp, "ascent.u[1,2]")]
    assert phase.edge_states[0].tolist() == [0, 0, 0, 0] and phase.edge_states[-1, 2] == 10
