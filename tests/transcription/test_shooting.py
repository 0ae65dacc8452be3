from __future__ import annotations

import pickle

import casadi as ca
import numpy as np
import pytest
from cases import candidates, decay, integrator, oscillator, oscillator_rates, propagated, slot
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from macs import MACS, Front, optimize
from problems import Problem, load
from problems.cases import goddard
from transcription import DFET, MultipleShooting, SingleShooting, from_dict, parse
from transcription import word as said
from transcription.base import largest
from transcription.inner import inner_solver
from transcription.shooting.runge_kutta import TABLEAUX
from transcription.shooting.step import StepMesh
from transcription.trajectories.simulate import simulate

KINDS = ("constant", "linear", "spline")


def values_of(nlp, z: np.ndarray, name: str) -> np.ndarray:
    """The values of a control, in the order of time."""
    return np.array([value for v, value in zip(nlp.variables, z, strict=True) if v.name.startswith(f"{name}[")])


def law(kind: str, t0: float, tf: float, values: np.ndarray):
    """A control as scipy has it."""
    if kind == "constant":
        edges = np.linspace(t0, tf, len(values) + 1)
        return lambda t: values[np.clip(np.searchsorted(edges, t, side="right") - 1, 0, len(values) - 1)]
    times = np.linspace(t0, tf, len(values))
    return CubicSpline(times, values) if kind == "spline" else lambda t: np.interp(t, times, values)


def rich(period: float | None = None) -> Problem:
    """All there is: parameters, free times and initial states, integrals, peaks and paths that see states, controls and time."""
    problem = Problem("rich")
    m = problem.parameter("m", bounds=(0.5, 2))
    phase = problem.phase("swing", t0=(0.0, 0.5), tf=(1.5, 2.0))
    x = phase.state("x", bounds=(-3, 3), initial=(-1, 1))
    y = phase.state("y", bounds=(-4, 4), initial=0.5, final=0.1)
    bounds = (-np.pi, np.pi) if period else (-1, 1)
    u, v = phase.control("u", bounds=bounds, period=period), phase.control("v", bounds=(0, 1))
    phase.dynamics(x=y + 0.1 * ca.sin(3 * phase.time) * ca.cos(u), y=-m * ca.sin(x) - 0.2 * y * v**2 + ca.cos(phase.time * phase.tf) * v)
    phase.path("speed", x * y + u * phase.time, upper=2.0)
    problem.minimize("cost", phase.integral(v**2 + x * y) + phase.final(x * u))
    problem.minimize("peak", phase.peak(x + 0.1 * v) + phase.peak(-(y**2)))
    problem.constraint("mean", phase.integral(x) * phase.integral(y) + phase.initial(v), upper=3.0)
    return problem


METHODS = [
    SingleShooting(7),
    SingleShooting(6, control="linear", steps=2, path_points=1),
    SingleShooting(9, control="spline", control_nodes=4, scheme="rk8"),
    MultipleShooting(4, control="linear", control_nodes=6, path_points=2, scheme="kutta3"),
    MultipleShooting(3, steps=3, scheme="heun"),
    MultipleShooting(5, control="spline"),
]


# The flight


@pytest.mark.parametrize(("kind", "nodes"), [("constant", 4), ("linear", None), ("spline", 4), ("spline", None)])
def test_a_flight_is_what_scipy_makes_of_the_same_controls(kind, nodes):
    nlp = SingleShooting(12, scheme="rk8", steps=3, control=kind, control_nodes=nodes).transcribe(oscillator())
    for z in propagated(nlp, 2):
        t0, tf, m = (z[slot(nlp, name)] for name in ("swing.t0", "swing.tf", "m"))
        u, v = (law(kind, t0, tf, values_of(nlp, z, name)) for name in ("swing.u", "swing.v"))
        x, cost, kinks = np.array([z[slot(nlp, "swing.x(t0)")], 0.5]), 0.0, np.linspace(t0, tf, nodes or 12)

        def rates(t, y, u=u, v=v, m=m, tf=tf):
            return [*oscillator_rates(t, y[:2], np.array([u(t), v(t)]), m, tf), u(t) ** 2 + y[0] * y[1]]

        for a, b in zip(kinks[:-1], kinks[1:] - 1e-13, strict=True):
            *x, cost = solve_ivp(rates, (a, b), [*x, cost], method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        assert z[[slot(nlp, "swing.x(tf)"), slot(nlp, "swing.y(tf)")]] == pytest.approx(x, abs=2e-9)
        F = nlp.evaluate(z[None])[0][0]
        assert pytest.approx([cost, -x[0]], abs=2e-9) == F


@pytest.mark.parametrize("scheme", TABLEAUX)
@pytest.mark.parametrize("method", [lambda n, **more: SingleShooting(n + 1, **more), MultipleShooting], ids=["single", "multiple"])
def test_errors_of_states_and_integrals_fall_with_the_order(method, scheme):
    problem, phase = decay(tf=2.0)
    problem.minimize("area", phase.integral(phase["x"] * ca.cos(phase.time)))
    problem.parameter("idle", bounds=(0, 1))
    exact = np.array([np.exp(-2), 0.5 + 0.5 * np.exp(-2) * (np.sin(2) - np.cos(2))])
    n = 3 if scheme == "rk8" else 20
    nlps = [method(k, scheme=scheme).transcribe(problem) for k in (n, 2 * n)]
    coarse, fine = (np.abs(nlp.propagate_and_score(np.zeros((1, len(nlp.variables))))[1][0] - exact) for nlp in nlps)
    assert np.log2(coarse / fine) == pytest.approx([TABLEAUX[scheme].order] * 2, abs=0.45)


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_flying_and_scoring_in_one_go_is_flying_and_then_scoring(method):
    nlp = method.transcribe(rich())
    Z = nlp.first_guess(candidates(nlp, 5))
    flight, F, residuals = nlp.propagate_and_score(Z)
    violation = largest(residuals)
    assert np.array_equal(flight, nlp.propagate(Z)) and np.array_equal(flight[:, nlp.free], Z[:, nlp.free])
    again, worst = nlp.evaluate(flight)
    assert pytest.approx(again, abs=1e-12) == F and worst == pytest.approx(violation, abs=1e-12)
    assert violation == pytest.approx([max(nlp.violations(z).values()) for z in flight], abs=1e-12)
    # Nothing is left of the equations but the final value that is imposed.
    for z in flight:
        assert all(abs(miss) < 1e-12 for label, miss in nlp.violations(z).items() if label.startswith(("dynamics", "peak")))


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_many_candidates_at_once_are_the_same_bits_as_one_by_one(method):
    nlp = method.transcribe(rich(period=2 * np.pi))
    Z = nlp.first_guess(candidates(nlp, 101))
    together, alone = nlp.propagate_and_score(Z), [nlp.propagate_and_score(z[None]) for z in Z[[0, 1, 63, 64, 100]]]
    for found, singles in zip(together, zip(*alone, strict=True), strict=True):
        assert np.array_equal(found[[0, 1, 63, 64, 100]], np.concatenate(singles))


@pytest.mark.parametrize("period", [None, 2 * np.pi], ids=["plain", "periodic"])
@pytest.mark.parametrize("method", METHODS, ids=str)
def test_derivatives_of_the_reduced_problem(method, period):
    nlp = method.transcribe(rich(period))
    reduced, Z = nlp.reduced, nlp.first_guess(candidates(nlp, 2, seed=4))
    rows = np.arange(len(reduced.lower))
    A = reduced.derivatives(reduced.propagate(Z), rows)
    ends = np.flatnonzero(~reduced.inside)
    assert np.allclose(reduced.derivatives(reduced.propagate(Z), ends), A[:, ends], rtol=1e-12, atol=1e-13)
    for k, column in enumerate(nlp.free):
        moved = [Z.copy(), Z.copy()]
        moved[0][:, column] += 1e-6
        moved[1][:, column] -= 1e-6
        slope = (reduced.propagate(moved[0]).values - reduced.propagate(moved[1]).values) / 2e-6
        assert np.allclose(A[:, :, k], slope, atol=2e-8), nlp.variables[column].name


def test_dynamics_of_a_table_and_of_a_callback_fly_too():
    """Which are no scalar operations, and of which the last one has no derivatives."""

    class Wind(ca.Callback):
        def __init__(self):
            ca.Callback.__init__(self)
            self.construct("wind", {})

        def eval(self, arguments):
            return [ca.sin(arguments[0])]

    wind, times = Wind(), np.linspace(-1.0, 3.0, 400)
    ends = []
    for make in (ca.sin, ca.interpolant("table", "bspline", [times], np.sin(times)), wind):
        problem, phase = integrator()
        phase._rates = {}
        phase.dynamics(x=make(phase.time) * phase["u"])
        problem.minimize("end", phase.final(phase["x"]))
        nlp = SingleShooting(9, control="linear").transcribe(problem)
        ends.append(inner_solver("propagate").solve(nlp, candidates(nlp, 30)).F)
    assert ends[1] == pytest.approx(ends[0], abs=1e-8) and ends[2] == pytest.approx(ends[0], abs=1e-14)


# Meshes and controls


@given(st.integers(1, 9), st.integers(1, 4), st.integers(2, 12))
@settings(max_examples=60, deadline=None)
def test_no_step_leads_across_a_node_of_the_controls(intervals, steps, nodes):
    mesh, edges = StepMesh.of(intervals, steps, np.linspace(0, 1, nodes)), np.linspace(0, 1, nodes)
    assert (np.diff(mesh.places) > 1e-6).all() and mesh.places[0] == 0.0 and mesh.places[-1] == 1.0
    assert np.allclose(mesh.places[mesh.ends], np.linspace(0, 1, intervals + 1))
    assert np.abs(mesh.places[:, None] - edges).min(axis=0).max() < 1e-9
    assert intervals * steps <= mesh.steps <= intervals * steps + nodes - 2


@pytest.mark.slow
@given(st.integers(2, 9), st.integers(2, 7), st.sampled_from(KINDS), st.integers(0, 10**6))
@settings(max_examples=15, deadline=None)
def test_the_integral_of_a_control_is_exact(nodes, control_nodes, kind, seed):
    problem, phase = integrator()
    problem.minimize("end", phase.final(phase["x"]))
    nlp = SingleShooting(nodes, control=kind, control_nodes=control_nodes).transcribe(problem)
    z = propagated(nlp, 1, seed)[0]
    values = values_of(nlp, z, "run.u")
    if kind == "spline":
        exact = CubicSpline(np.linspace(0, 2, control_nodes), values).integrate(0, 2)
    else:
        exact = 2 * np.mean(values) if kind == "constant" else np.trapezoid(values, dx=2 / (control_nodes - 1))
    assert z[slot(nlp, "run.x(tf)")] == pytest.approx(float(exact), abs=1e-12)


@pytest.mark.parametrize("nodes", [2, 3, 4, 5, 11, 80])
@pytest.mark.parametrize("kind", KINDS)
def test_controls_are_what_scipy_makes_of_their_values(kind, nodes):
    problem, phase = integrator()
    problem.minimize("end", phase.final(phase["x"]))
    nlp = MultipleShooting(6, control=kind, control_nodes=nodes, steps=2).transcribe(problem)
    z = propagated(nlp, 1)[0]
    flight, times = nlp.unpack(z)["run"], np.linspace(0, 2, 301)[:-1] + 1e-4
    assert flight.at(times)["u"] == pytest.approx(law(kind, 0, 2, values_of(nlp, z, "run.u"))(times), abs=1e-12)


@pytest.mark.parametrize("kind", ["linear", "spline"])
def test_periodic_controls_go_the_short_way_round(kind):
    problem, phase = integrator(bounds=(-np.pi, np.pi), period=2 * np.pi)
    phase._rates = {}
    phase.dynamics(x=ca.cos(phase["u"]))
    problem.minimize("end", phase.final(phase["x"]))
    nlp = SingleShooting(41, scheme="rk8", control=kind, control_nodes=5).transcribe(problem)
    angles = np.array([2.5, 3.5, 4.5, 6.0, 7.0])
    wrapped = np.mod(angles + np.pi, 2 * np.pi) - np.pi
    z = nlp.propagate(nlp.first_guess(wrapped[None]))[0]
    straight = law(kind, 0, 2, angles)
    fine = np.linspace(0, 2, 20_001)
    assert z[slot(nlp, "run.x(tf)")] == pytest.approx(np.trapezoid(np.cos(straight(fine)), fine), abs=1e-7)
    shown = nlp.unpack(z)["run"].at(fine)["u"]
    assert np.abs(shown).max() <= np.pi + 1e-12 and np.cos(shown) == pytest.approx(np.cos(straight(fine)), abs=1e-9)


# What constraints and peaks see


def bump() -> Problem:
    """x = t - 1 in 2 time units; exp(-40 (x - 0.25)^2) is largest, 1, at t = 1.25."""
    problem = Problem("bump")
    phase = problem.phase("run", t0=0, tf=2.0)
    x, u = phase.state("x", bounds=(-2, 2), initial=-1), phase.control("u", bounds=(0.5, 1.5))
    phase.dynamics(x=u)
    height = ca.exp(-40 * (x - 0.25) ** 2)
    phase.path("low", height, upper=0.5)
    problem.minimize("peak", phase.peak(height))
    return problem


@pytest.mark.parametrize(
    "method", [lambda **more: SingleShooting(5, **more), lambda **more: MultipleShooting(4, **more)], ids=["single", "multiple"]
)
def test_paths_and_peaks_are_looked_at_at_nodes_and_where_asked_between(method):
    seen = {}
    for points in (0, 1, 4):
        nlp = method(control="linear", path_points=points).transcribe(bump())
        z = nlp.propagate(nlp.first_guess(np.ones((1, 5))))
        seen[points] = nlp.evaluate(z)[0][0, 0], nlp.evaluate(z)[1][0]
        assert nlp.g_labels.count("path 'low' of 'run'") == 4 * (points + 1) + 1
    nodes = np.linspace(-1, 1, 5)
    at_nodes, halfway, fifths = (np.exp(-40 * (x - 0.25) ** 2).max() for x in (nodes, np.linspace(-1, 1, 9), np.linspace(-1, 1, 21)))
    assert [peak for peak, _ in seen.values()] == pytest.approx([at_nodes, halfway, fifths], rel=1e-12)
    assert [violation for _, violation in seen.values()] == pytest.approx(
        np.maximum(0, np.array([at_nodes, halfway, fifths]) - 0.5), abs=1e-12
    )


def test_where_a_control_jumps_both_of_its_values_count():
    problem, phase = integrator()
    phase.path("thrust", phase["u"] * phase.time, upper=0.5)
    problem.minimize("peak", phase.peak(phase["u"] * phase.time))
    nlp = SingleShooting(3).transcribe(problem)
    z = nlp.propagate(nlp.first_guess(np.array([[0.9, 0.0]])))
    assert nlp.evaluate(z)[0][0, 0] == pytest.approx(0.9) and nlp.violations(z[0])["path 'thrust' of 'run'"] == pytest.approx(0.4)


def test_bounds_of_states_hold_at_the_nodes():
    problem, phase = integrator()
    problem.minimize("end", phase.final(phase["x"]))
    phase._states["x"] = phase._states["x"].__class__("x", -10, 0.7, "", 1.0)
    phase._final["x"] = (-10, 0.7)
    for method in (SingleShooting(5), MultipleShooting(4)):
        nlp = method.transcribe(problem)
        z = nlp.propagate(nlp.first_guess(np.array([[1.0, 1.0, -1.0, -1.0]])))[0]
        assert nlp.violations(z)["bounds of run.x"] == pytest.approx(0.3)


# Solving


@pytest.mark.slow
def test_goddard_against_its_closed_form():
    nlp = MultipleShooting(40, control="linear").transcribe(load("goddard"))
    assert all(label in nlp.g_labels for label in ("dynamics of ascent.vx", "final value of ascent.y"))
    problem = load("goddard")
    best = optimize(problem, MultipleShooting(40, control="linear"), objective="horizontal speed", starts=1)
    law = goddard.optimal_flight(250.0)
    assert best.status == "converged" and best.optimality < 1e-6
    assert best.objectives["horizontal speed"] == pytest.approx(law["vx"][-1], rel=2e-8)
    times = law["time"][:-1]
    assert best.trajectory["ascent"].at(times)["y"] == pytest.approx(law["y"][:-1], abs=2e-3)
    assert best.simulate().max_defect < 1e-6
    quick = optimize(problem, MultipleShooting(40, control="linear"), objective="flight time", starts=1)
    assert quick.objectives["flight time"] == pytest.approx(goddard.shortest_time(), rel=1e-3)


def test_single_and_multiple_shooting_have_the_same_optimum():
    problem = load("goddard")
    found = [optimize(problem, method, objective="flight time", starts=1) for method in (SingleShooting(11), MultipleShooting(10))]
    assert found[0].objectives["flight time"] == pytest.approx(found[1].objectives["flight time"], rel=1e-7)
    assert np.array_equal([v.name for v in found[0].variables if ".u" in v.name], [v.name for v in found[1].variables if ".u" in v.name])


def test_a_long_chain_is_not_written_out_for_derivatives(monkeypatch):
    from transcription.shooting import phase as shooting_phase

    plain = optimize(load("goddard"), SingleShooting(11), objective="flight time", starts=1)
    monkeypatch.setattr(shooting_phase, "LONG", 0)
    assert SingleShooting(11).transcribe(load("goddard")).functions.is_a("MXFunction")
    chained = optimize(load("goddard"), SingleShooting(11), objective="flight time", starts=1)
    assert chained.objectives["flight time"] == pytest.approx(plain.objectives["flight time"], rel=1e-9)


@pytest.mark.parametrize("inner", ["auto", "ipopt"])
@pytest.mark.parametrize("method", [SingleShooting(13, control="linear"), MultipleShooting(6, steps=2)], ids=["single", "multiple"])
def test_the_inner_levels_find_feasible_flights(method, inner):
    nlp = method.transcribe(load("goddard"))
    found = inner_solver(inner).solve(nlp, candidates(nlp, 6))
    assert set(found.status) == {"converged"} and found.violation.max() <= 1e-6
    for z in found.z:
        assert simulate(nlp.problem, nlp.unpack(z)).max_defect < 1e-2
    if inner == "auto":
        other = inner_solver("ipopt").solve(nlp, candidates(nlp, 6))
        assert found.moved == pytest.approx(other.moved, abs=2e-3)


def two_legs() -> Problem:
    """Up and along, then down: a mass is dropped between the legs; least effort to be at rest at (1, 0)."""
    problem = Problem("legs")
    drop = problem.parameter("drop", bounds=(0.1, 0.5))
    first = problem.phase("first", t0=0, tf=(0.5, 1.5))
    second = problem.phase("second", t0=(0.5, 1.5), tf=2.0)
    for phase, ends in ((first, {"initial": 0}), (second, {"final": 0})):
        phase.state("x", bounds=(-2, 3), **({"initial": 0} if phase is first else {"final": 1}))
        v, u = phase.state("v", bounds=(-5, 5), **ends), phase.control("u", bounds=(-10, 10))
        phase.dynamics(x=v, v=u - (drop if phase is second else 0) * v)
    problem.link(first, second)
    problem.minimize("effort", first.integral(first["u"] ** 2) + second.integral(second["u"] ** 2))
    problem.maximize("drop", drop)
    return problem


@pytest.mark.slow
def test_linked_phases_a_free_time_between_them_and_a_parameter():
    found = [optimize(two_legs(), method, objective="effort", starts=1) for method in (MultipleShooting(12, control="linear"), DFET(4, 3))]
    assert [point.status for point in found] == ["converged"] * 2
    assert found[0].objectives["effort"] == pytest.approx(found[1].objectives["effort"], rel=1e-3)
    flight = found[0].trajectory
    assert flight["first"].tf == flight["second"].t0 and np.array_equal(flight["first"].edge_states[-1], flight["second"].edge_states[0])
    assert found[0].simulate().max_defect < 1e-5
    nlp = SingleShooting(9).transcribe(two_legs())
    Z = propagated(nlp, 2)
    for z in Z:
        check = simulate(nlp.problem, nlp.unpack(z))
        # Flown one after the other: what is imposed at the end is missed by what the flight says.
        assert check.violations["final value of second.x"] == pytest.approx(
            nlp.violations(z)["final value of second.x"], rel=1e-3, abs=1e-5
        )


# Trajectories


@pytest.mark.parametrize(("kind", "scheme"), [*(("linear", scheme) for scheme in TABLEAUX), ("constant", "rk4"), ("spline", "rk8")])
def test_a_trajectory_interpolates_with_the_order_of_its_scheme(kind, scheme):
    worst = []
    for n in (8, 16):
        nlp = SingleShooting(n + 1, scheme=scheme, control=kind, control_nodes=5).transcribe(oscillator())
        C = np.full((1, len(nlp.free)), 0.5)
        C[:, [slot(nlp, "m"), slot(nlp, "swing.tf"), slot(nlp, "swing.t0")]] = 1.0, 1.8, 0.2
        flight = nlp.unpack(nlp.propagate(nlp.first_guess(C))[0])
        phase, exact = flight["swing"], simulate(nlp.problem, flight, rtol=1e-12, atol=1e-13).trajectory["swing"]
        times = np.linspace(phase.t0, phase.tf, 200)
        worst.append(np.abs(phase.state(times) - exact.state(times)).max())
        assert phase.state(phase.time) == pytest.approx(phase.states, abs=1e-12)
        left, right = phase.state.ends()
        assert left[1:] == pytest.approx(right[:-1], abs=1e-12)
    order = TABLEAUX[scheme].order
    assert worst[1] < 3e-11 or np.log2(worst[0] / worst[1]) > order - 0.6


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_a_trajectory_comes_back_as_the_vector_it_was_made_of(method):
    problem = load("goddard")
    nlp = method.transcribe(problem)
    z = inner_solver("auto").solve(nlp, candidates(nlp, 1)).z[0]
    assert nlp.interpolate(nlp.unpack(z)) == pytest.approx(z, abs=1e-9)


@pytest.mark.slow
def test_flights_go_from_one_method_to_another():
    problem = load("goddard")
    start = optimize(problem, DFET(4, 6), objective="horizontal speed", starts=1)
    for method in (SingleShooting(41, control="linear"), MultipleShooting(20, control="spline"), MultipleShooting(30)):
        nlp = method.transcribe(problem)
        z = nlp.interpolate(start.trajectory)
        assert nlp.evaluate(nlp.propagate(z[None]))[1][0] < 0.02
        back = DFET(4, 6).transcribe(problem).interpolate(nlp.unpack(z))
        assert np.abs(back - start.decision).max() < 0.2
    again = optimize(problem, MultipleShooting(30), objective="horizontal speed", start=start, starts=1)
    assert again.status == "converged" and again.objectives["horizontal speed"] == pytest.approx(0.9038897, rel=1e-4)


@pytest.mark.slow
def test_a_front_is_found_saved_and_loaded(tmp_path):
    method = SingleShooting(11, control="linear")
    front = MACS(agents=4, archive=4).solve(load("goddard"), method, evaluations=30, seed=1)
    assert len(front) and (front.violation <= 1e-6).all() and "SingleShooting(nodes=11" in front.table()
    front.save(tmp_path / "front.nc")
    loaded = Front.load(tmp_path / "front.nc")
    assert np.array_equal(loaded.objectives, front.objectives) and loaded[0].simulate().max_defect < 1e-3
    times = np.linspace(0, loaded[0].trajectory["ascent"].tf, 33)
    assert loaded[0].trajectory["ascent"].at(times)["y"] == pytest.approx(front[0].trajectory["ascent"].at(times)["y"], abs=1e-13)
    assert from_dict(loaded[0].transcription) == method
    propagated = MACS(agents=4, archive=4, refine=False).solve(load("goddard"), method, evaluations=40, seed=1, inner="propagate")
    assert propagated.stats["evaluations"] == 40


# Words and settings


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_settings_pickle_and_come_back_from_plain_data(method):
    assert pickle.loads(pickle.dumps(method)) == method == from_dict(method.to_dict())
    assert eval(repr(method)) == method and hash(method) == hash(from_dict(method.to_dict()))


@pytest.mark.parametrize(
    ("word", "method"),
    [
        ("shooting:200", SingleShooting(200)),
        ("shooting:200:linear", SingleShooting(200, control="linear")),
        ("Shooting:20x4:rk8:spline:5", SingleShooting(20, steps=4, scheme="rk8", control="spline", control_nodes=5)),
        ("multiple-shooting:40", MultipleShooting(40)),
        ("multiple-shooting:40x2:heun", MultipleShooting(40, steps=2, scheme="heun")),
        ("dfet:4x6:bernstein", DFET(4, 6, basis="bernstein")),
        ("dfet:4x6:1", DFET(4, 6, control_order=1)),
        ("dfet:40x2:bernstein:1", DFET(40, 2, control_order=1, basis="bernstein")),
    ],
)
def test_words_of_the_command_line(word, method):
    assert parse(word) == method == parse(said(method))


def test_what_cannot_be_said_in_a_word():
    assert said(SingleShooting(9, path_points=1)) is None and said(DFET(3, 2, mesh={"fly": ([0, 0.5, 1], 2)})) is None
    assert said(SingleShooting(9)) == "shooting:9" and said(DFET(3, 2)) == "dfet:3x2"


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("shooting", "write it as shooting:200"),
        ("shooting:4x", "write it as"),
        ("shooting:a", "write it as"),
        ("shooting:20:cubic", "'cubic' is given twice or unknown; there are constant, linear, spline; euler"),
        ("shooting:20:linear:spline", "'spline' is given twice"),
        ("shooting:1", "nodes must be a whole number of at least 2, not 1"),
        ("multiple-shooting:0", "intervals must be a whole number of at least 1"),
        ("dfet:4x6:lobatto:3:3", "write it as"),
    ],
)
def test_words_that_mean_nothing(word, message):
    with pytest.raises(ValueError, match=message):
        parse(word)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SingleShooting(1), "SingleShooting: nodes must be a whole number of at least 2, not 1"),
        (lambda: SingleShooting(2.5), "SingleShooting: nodes must be a whole number"),
        (lambda: MultipleShooting(True), "MultipleShooting: intervals must be a whole number of at least 1, not True"),
        (lambda: MultipleShooting(3, steps=0), "MultipleShooting: steps must be a whole number of at least 1, not 0"),
        (lambda: SingleShooting(9, control_nodes=1), "SingleShooting: control_nodes must be a whole number of at least 2, not 1"),
        (lambda: SingleShooting(9, path_points=-1), "SingleShooting: path_points must be a whole number of at least 0, not -1"),
        (
            lambda: SingleShooting(9, scheme="rk5"),
            f"SingleShooting: scheme must be one of {', '.join(map(repr, TABLEAUX))}, not 'rk5'",
        ),
        (lambda: SingleShooting(9, control="cubic"), "SingleShooting: control must be one of 'constant', 'linear', 'spline', not 'cubic'"),
    ],
)
def test_settings_that_make_no_sense(make, message):
    with pytest.raises(ValueError, match=message):
        make()


# Steps that are too long


def lag(rate: float, tf: object = 100.0) -> Problem:
    """y follows a control with a lag, and x follows y."""
    problem = Problem("lag")
    phase = problem.phase("turn", t0=0, tf=tf)
    x, y, u = (
        phase.state("x", bounds=(-200, 200), initial=0),
        phase.state("y", bounds=(-1, 1), initial=0),
        phase.control("u", bounds=(-1, 1)),
    )
    phase.dynamics(x=y * ca.cos(0.01 * x), y=rate * (u - y))
    problem.maximize("far", phase.final(x))
    return problem


@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "limit"), [("euler", 2.0), ("rk4", 2.7853), ("rk8", 4.0)])
def test_a_lag_that_the_step_cannot_follow_is_refused(scheme, limit):
    SingleShooting(51, scheme=scheme).transcribe(lag(0.9 * limit / 2))
    for method, cure in ((SingleShooting(51, scheme=scheme), "nodes"), (MultipleShooting(50, scheme=scheme), "intervals")):
        name = type(method).__name__
        message = rf"{name}: phase 'turn': steps of 2 s are too long for 'y', .* {scheme} .*; take {cure}=\d+ or more, or steps=\d"
        with pytest.raises(ValueError, match=message) as error:
            method.transcribe(lag(1.6 * limit / 2))
        words = str(error.value).replace(",", "").split()
        enough = int(next(word for word in words if word.startswith(f"{cure}=")).split("=")[1])
        type(method)(enough, scheme=scheme).transcribe(lag(1.6 * limit / 2))
        type(method)(51, scheme=scheme, steps=int(words[-1].split("=")[1])).transcribe(lag(1.6 * limit / 2))


def test_a_lag_that_no_step_in_reach_can_follow_is_refused():
    with pytest.raises(ValueError, match=r"too long for 'y', .*; take far shorter ones"):
        SingleShooting(51).transcribe(lag(1e6))


def test_what_may_be_stable_is_not_refused():
    SingleShooting(51).transcribe(lag(2.0, tf=(10.0, 100.0)))  # short flights are
    SingleShooting(6, scheme="euler").transcribe(oscillator())  # grows a little, as Euler's method does
    SingleShooting(4).transcribe(lag(2.0, tf=3.0))
    for case in ("goddard", "orbit_rise", "landing_site"):
        SingleShooting(31).transcribe(load(case))
