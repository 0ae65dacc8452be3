from dataclasses import replace
from functools import partial
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from cases import candidates, decay, integrator, oscillator, oscillator_rates, solved
from scipy.integrate import solve_ivp

from problems import Problem, load
from transcription import DFET, PiecewisePolynomial, Trajectory
from transcription.inner import inner_solver
from transcription.trajectories.limits import excursions
from transcription.trajectories.simulate import simulate, simulate_all


def simulated(nlp, z, **options):
    return simulate(nlp.problem, nlp.unpack(z), **options)


def tampered(flight: Trajectory, phase: str, change) -> Trajectory:
    """The flight with the control coefficients of one phase changed."""
    law = flight[phase].control
    control = PiecewisePolynomial(law.edges, change(law.coefficients.copy()), law.basis)
    return Trajectory(tuple(replace(p, control=control) if p.name == phase else p for p in flight.phases), flight.parameters)


@pytest.mark.parametrize("method", ["RK45", "DOP853", "Radau", "BDF", "LSODA"])
def test_a_flight_without_controls_has_its_closed_form(method):
    problem, phase = decay(tf=1.5)
    problem.minimize("square", phase.integral(phase["x"] ** 2))
    problem.minimize("moment", phase.integral(phase.time))
    problem.minimize("top", phase.peak(-phase["x"]))
    problem.maximize("end", phase.final(phase["x"] * phase.time))
    nlp = DFET(3, 4).transcribe(problem)
    check = simulated(nlp, nlp.propagate(nlp.first_guess(np.empty((1, 0))))[0], rtol=1e-9, method=method)
    e = np.exp(-1.5)
    exact = {"rest": e, "square": (1 - e**2) / 2, "moment": 1.125, "top": -e, "end": 1.5 * e}
    assert check.objectives == pytest.approx(exact, rel=1e-5)
    assert check.trajectory["fall"].at(0.7)["x"] == pytest.approx(np.exp(-0.7), rel=1e-5)
    assert check.max_defect < 1e-6 and check.violation < 1e-9


@pytest.mark.parametrize("element", [0, 2])
def test_a_tampered_control_is_found(element):
    nlp = DFET(3, 4).transcribe(load("goddard"))
    gentle = np.full((1, len(nlp.free)), 0.4)
    gentle[0, [v.name for v in (nlp.variables[i] for i in nlp.free)].index("ascent.tf")] = 150.0
    flight = nlp.unpack(inner_solver("ipopt").solve(nlp, gentle).z[0])

    def change(c):
        c[element] += 0.3
        return c

    honest, false = simulate(nlp.problem, flight), simulate(nlp.problem, tampered(flight, "ascent", change))
    assert false.max_defect > 10 * honest.max_defect and false.max_defect > 1e-3
    assert false.violation > 1e-3 and max(false.violations, key=false.violations.get).startswith(
        ("final value of ascent.", "bounds of ascent.")
    )


def test_violations_of_paths_constraints_bounds_and_ends_are_named():
    problem, phase = integrator(final=(0, 1), bounds=(-1, 8))
    phase.path("gate", phase["x"] * phase.time, upper=4)
    problem.constraint("late", phase.integral(phase["x"]), upper=1, scale=5)
    problem.constraint("calm", phase.peak(phase["x"]), upper=12)
    problem.minimize("end", phase.final(phase["x"]))
    nlp = DFET(2, 2).transcribe(problem)
    C = np.full((1, 6), 6.0)
    check = simulated(nlp, nlp.propagate(nlp.first_guess(C))[0])
    assert check.violations["final value of run.x"] == pytest.approx(11 / 20)
    assert check.violations["bounds of run.x"] == pytest.approx(2 / 20)
    assert check.violations["path 'gate' of 'run'"] == pytest.approx(20)
    assert check.violations["constraint 'late'"] == pytest.approx(11 / 5)
    assert check.violations["constraint 'calm'"] == pytest.approx(0, abs=1e-9)
    assert check.violation == max(check.violations.values())


def two_legs(jump: float) -> Problem:
    problem = Problem("legs")
    legs = []
    for i in range(2):
        leg = problem.phase(f"leg {i}", t0=0 if i == 0 else (0, 4), tf=(1, 2) if i == 0 else (3, 4))
        x = leg.state("x", bounds=(-10, 10), initial=1 if i == 0 else None)
        leg.state("m", bounds=(0, 20), initial=10 if i == 0 else None)
        leg.dynamics(x=x * leg.control("u", bounds=(-1, 1)), m=-x)
        legs.append(leg)
    problem.link(legs[0], legs[1], states=["x"])
    problem.constraint("drop", legs[0].final(legs[0]["m"]) - legs[1].initial(legs[1]["m"]), lower=jump, upper=jump)
    problem.minimize("time", legs[1].tf)
    problem.maximize("mass", legs[1].final(legs[1]["m"]))
    return problem


def test_linked_phases_are_simulated_from_where_the_first_ended():
    nlp = DFET(3, 6, basis="bernstein").transcribe(two_legs(2.0))
    found = solved(nlp)
    assert set(found.status) == {"converged"}
    flight = nlp.unpack(found.z[0])
    check = simulate(nlp.problem, flight)
    assert check.max_defect < 1e-3 and check.violation < 1e-3
    assert "constraint 'drop'" in check.violations

    def change(c):
        return np.clip(c + 0.5, -1, 1)

    other = simulate(nlp.problem, tampered(flight, "leg 0", change))
    first, second = other.trajectory["leg 0"], other.trajectory["leg 1"]
    assert second.edge_states[0, 0] == first.edge_states[-1, 0] != flight["leg 1"].edge_states[0, 0]
    assert second.edge_states[0, 1] == flight["leg 1"].edge_states[0, 1], "what is not linked starts where the trajectory says"
    assert other.defect["leg 1"]["x"] > 1e-3 and other.violations["constraint 'drop'"] > 1e-3


@pytest.mark.parametrize(("a", "finite"), [(300.0, True), (1000.0, False)])
def test_an_unstable_equation_on_too_long_elements_is_feasible_there_and_infinite_when_simulated(a, finite):
    """On elements of length h the method of two stages multiplies the state by R(ah), which tends to 1, and the exact solution by e^(ah).
    So the mesh believes in what the simulation cannot follow: e^700 is the largest number there is."""
    problem = Problem("linear")
    phase = problem.phase("run", t0=0, tf=1)
    x = phase.state("x", bounds=(-1, 1), initial=0.01)
    phase.dynamics(x=a * x + phase.control("u", bounds=(-0.5, 0.5)))
    problem.minimize("end", phase.final(x))
    nlp = DFET(2, 1).transcribe(problem)
    z = nlp.propagate(nlp.first_guess(np.full((1, len(nlp.free)), 0.4)))
    check = simulated(nlp, z[0])
    assert nlp.evaluate(z)[1][0] < 1e-6 and np.isfinite(check.max_defect) == finite and check.max_defect > 1e100


@pytest.mark.slow
@pytest.mark.parametrize("method", ["RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA"])
def test_dynamics_that_break_down_are_an_infinite_defect(method, capfd):
    """x' = -1/x reaches 0 at t = 1/2, where there is nothing more to integrate; or nothing from the start."""
    for initial, root in ((1.0, False), (0.0, False), (-0.5, True))[method == "LSODA" :]:
        problem = Problem("broken")
        phase = problem.phase("run", t0=0, tf=(1, 2))
        x = phase.state("x", bounds=(-1, 1), initial=initial)
        phase.dynamics(x=(ca.sqrt(x) if root else -1 / x) + phase.control("u", bounds=(-0.1, 0.1)))
        problem.minimize("end", phase.final(x) + phase.integral(x) + phase.peak(x))
        nlp = DFET(2, 2).transcribe(problem)
        flight = nlp.unpack(nlp.first_guess(candidates(nlp, 1))[0])
        check = simulate(nlp.problem, flight, method=method)
        assert check.max_defect == np.inf and check.violation == np.inf
    assert capfd.readouterr().out == ""


@pytest.mark.parametrize(
    "options", [{"method": "Euler"}, {"method": None}, {"method": "rk45"}, {"rtol": 0}, {"rtol": -1}, {"atol": 0}, {"atol": np.nan}]
)
def test_bad_settings_are_refused(options):
    problem, _ = decay()
    nlp = DFET(1, 1).transcribe(problem)
    z = nlp.propagate(nlp.first_guess(np.array([[1.5]])))[0]
    with pytest.raises(ValueError, match=next(iter(options))):
        simulated(nlp, z, **options)


def overshooting(basis: str):
    problem, phase = integrator()
    phase.path("push", phase["u"] + 0 * phase["x"], upper=1.2)
    problem.minimize("end", phase.final(phase["x"]))
    nlp = DFET(1, 4, basis=basis).transcribe(problem)
    # Bang-bang coefficients: between its nodes, a polynomial through them overshoots.
    z = nlp.propagate(nlp.first_guess(np.array([[1, 1, -1, -1, 1.0]])))[0]
    return nlp, z


def test_a_control_that_overshoots_between_nodes_is_found_and_bernsteins_does_not():
    nlp, z = overshooting("lobatto")
    found = excursions(nlp.problem, nlp.unpack(z))
    law = nlp.unpack(z)["run"].at(np.linspace(0, 2, 4001))["u"]
    assert found["run.u"] == pytest.approx(max(law.max() - 1, -1 - law.min()) / 2, rel=1e-2)
    assert found["run.push"] == pytest.approx(law.max() - 1.2, rel=1e-2)
    assert simulated(nlp, z).violations["path 'push' of 'run'"] == pytest.approx(law.max() - 1.2, rel=1e-2)
    nlp, z = overshooting("bernstein")
    assert excursions(nlp.problem, nlp.unpack(z)) == {} and simulated(nlp, z).violation == 0


@pytest.mark.parametrize("degree", [4, 14])
def test_steps_are_as_exact_as_those_of_scipy_and_so_is_what_is_between(degree):
    nlp = DFET(2, 4, control_order=degree).transcribe(oscillator())
    flight = nlp.unpack(nlp.propagate(nlp.first_guess(candidates(nlp, 1)))[0])
    planned, m = flight["swing"], flight.parameters["m"]
    exact, rough = (simulate(nlp.problem, flight, rtol=rtol, atol=0.01 * rtol).trajectory["swing"] for rtol in (1e-12, 1e-6))
    y = planned.edge_states[0]
    for left, right in pairwise(planned.state.edges):
        law = partial(planned.controls_on, int(left > planned.t0))

        def rates(t, y, left=left, right=right, law=law):
            return oscillator_rates(t, y, law(np.array([2 * (t - left) / (right - left) - 1]))[0], m, planned.tf)

        inside = (exact.time >= left) & (exact.time <= right)
        known = solve_ivp(rates, (left, right), y, "DOP853", rtol=1e-12, atol=1e-12, t_eval=exact.time[inside]).y.T
        np.testing.assert_allclose(exact.states[inside], known, atol=1e-10)
        assert 1e-12 < np.abs(rough.states[inside] - known).max() < 1e-5
        y = known[-1]


@pytest.mark.slow
def test_several_are_simulated_as_each_is_alone():
    nlp = DFET(4, 4).transcribe(oscillator())
    flights = [nlp.unpack(z) for z in nlp.propagate(nlp.first_guess(candidates(nlp, 6)))]
    other = DFET(3, 5).transcribe(oscillator())
    flights[2:2] = [other.unpack(z) for z in other.propagate(other.first_guess(candidates(other, 2)))]
    together = simulate_all(nlp.problem, flights)
    assert len(together) == len(flights)
    for flight, check in zip(flights, together, strict=True):
        alone = simulate(nlp.problem, flight)
        assert check.objectives == pytest.approx(alone.objectives, rel=1e-8)
        assert check.violations == pytest.approx(alone.violations, abs=1e-8)
        np.testing.assert_allclose(check.trajectory["swing"].states, alone.trajectory["swing"].states, atol=1e-8)


@pytest.mark.parametrize("place", [0.137, 0.51, 0.866])
def test_what_is_narrower_than_the_gaps_between_samples_is_found(place):
    radius, width, distance = 4e-3, 3e-3, 1e-3
    problem = Problem("past a post")
    way = problem.phase("way", t0=0, tf=1)
    x = way.state("x", bounds=(0, 1), initial=0)
    way.dynamics(x=1.0)
    away = ca.sqrt((x - place) ** 2 + distance**2)
    way.path("post", away, lower=radius)
    problem.minimize("heat", way.peak(1 / (1 + ((x - place) / width) ** 2)))
    problem.minimize("end", way.final(x))
    nlp = DFET(1, 2).transcribe(problem)
    flight = nlp.unpack(nlp.propagate(nlp.first_guess(np.empty((1, 0))))[0])
    check = simulate(nlp.problem, flight)
    # The flight passes the post at `distance`, and the heat has its peak there, of 1.
    assert check.violation == pytest.approx(radius - distance, rel=1e-2)
    assert check.objectives["heat"] == pytest.approx(1.0, rel=1e-3)
    assert excursions(nlp.problem, flight) == {"way.post": pytest.approx(radius - distance, rel=1e-2)}
    assert simulate(nlp.problem, flight, rtol=1e-9).trajectory["way"].paths.min() > radius, "no sample shows it"


def test_states_controls_paths_and_peaks_have_their_extremes_between_samples():
    """v' = u of a parabola through (9.2, 10, 9.5); y = 3 t - 4 t^2 and its square; pulses of width 0.006 anywhere in the one element."""
    problem = Problem("extremes")
    run = problem.phase("run", t0=0, tf=1)
    _, y = run.state("v", bounds=(-20, 20), initial=0), run.state("y", bounds=(-2, 0.56), initial=0)
    run.dynamics(v=run.control("u", bounds=(-10, 10)), y=3 - 8 * run.time)
    run.path("square", y**2, upper=0.3)
    places = np.linspace(0.05, 0.95, 37)
    for k, place in enumerate(places):
        run.path(f"pulse {k}", ca.exp(-(((run.time - place) / 0.006) ** 2)), upper=0.25)
        problem.minimize(f"peak {k}", run.peak(y / 10 + ca.exp(-(((run.time - place) / 0.006) ** 2))))
    nlp = DFET(1, 2).transcribe(problem)
    flight = nlp.unpack(nlp.propagate(nlp.first_guess(np.array([[9.2, 10.0, 9.5]])))[0])
    check, found = simulate(nlp.problem, flight), excursions(nlp.problem, flight)
    # At tf, y is -1 and its square 1: in between, y has its top, 9/16, at t = 3/8.
    exact = {"u": 0.15**2 / (2 * 1.3) / 20, "y": (9 / 16 - 0.56) / 2.56, "square": 0.7} | {f"pulse {k}": 0.75 for k in range(len(places))}
    assert found == pytest.approx({f"run.{name}": amount for name, amount in exact.items()}, abs=1e-7)
    labels = {name: f"bounds of run.{name}" if len(name) == 1 else f"path '{name}' of 'run'" for name in exact}
    assert {name: check.violations[label] for name, label in labels.items()} == pytest.approx(exact, abs=1e-7)
    tops = (3 * places - 4 * places**2) / 10 + 1 + (3 - 8 * places) ** 2 * 0.006**2 / 400
    assert list(check.objectives.values()) == pytest.approx(tops, abs=1e-7)
