"""Shooting, single and multiple, on equal intervals and others: against scipy, closed forms, and itself."""

from functools import cache

import casadi as ca
import numpy as np
import pytest
from cases import candidates, decay, integrator, oscillator, oscillator_rates, propagated, slot, total_derivatives
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from macs import optimize
from problems import Problem, load
from problems.cases import goddard
from transcription import MultipleShooting, SingleShooting
from transcription.base import largest
from transcription.inner import inner_solver
from transcription.shooting.runge_kutta import TABLEAUX
from transcription.shooting.step import StepMesh
from transcription.trajectories.simulate import simulate

KINDS = ("constant", "linear", "spline")


def values_of(nlp, z: np.ndarray, name: str) -> np.ndarray:
    """The values of a control, in the order of time."""
    return np.array([value for v, value in zip(nlp.variables, z, strict=True) if v.name.startswith(f"{name}[")])


def law_at(kind: str, times: np.ndarray, values: np.ndarray):
    """A control as scipy has it, by values at times, or between them."""
    if kind == "constant":
        return lambda t: values[np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(values) - 1)]
    return CubicSpline(times, values) if kind == "spline" else lambda t: np.interp(t, times, values)


def law(kind: str, t0: float, tf: float, values: np.ndarray):
    """The same on equal intervals."""
    return law_at(kind, np.linspace(t0, tf, len(values) + (kind == "constant")), values)


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


@pytest.mark.parametrize("scheme", ["midpoint", "kutta3", "rk38", "rk8"])
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


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_derivatives_of_the_reduced_problem(method):
    nlp = method.transcribe(rich(period=2 * np.pi))
    total_derivatives(nlp, nlp.first_guess(candidates(nlp, 2, seed=4)))


@given(st.integers(1, 9), st.integers(1, 4), st.integers(2, 12))
@settings(max_examples=60, deadline=None)
def test_no_step_leads_across_a_node_of_the_controls(intervals, steps, nodes):
    mesh, edges = StepMesh.of(intervals, steps, np.linspace(0, 1, nodes)), np.linspace(0, 1, nodes)
    assert (np.diff(mesh.places) > 1e-6).all() and mesh.places[0] == 0.0 and mesh.places[-1] == 1.0
    assert np.allclose(mesh.places[mesh.ends], np.linspace(0, 1, intervals + 1))
    assert np.abs(mesh.places[:, None] - edges).min(axis=0).max() < 1e-9
    assert intervals * steps <= mesh.steps <= intervals * steps + nodes - 2


@pytest.mark.parametrize("nodes", [2, 5, 40])
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
    excess = np.maximum(0, np.array([at_nodes, halfway, fifths]) - 0.5)
    assert [violation for _, violation in seen.values()] == pytest.approx(excess, abs=1e-12)


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


# Of one step of RK4 on each of 12 intervals of 20 s, by 0.0037; two on each of six with constant controls are exact enough.
@pytest.mark.parametrize(("method", "defect"), [(SingleShooting(13, control="linear"), 5e-3), (MultipleShooting(6, steps=2), 1e-4)])
def test_the_inner_levels_find_feasible_flights(method, defect):
    nlp = method.transcribe(load("goddard"))
    quick, nearest = (inner_solver(inner).solve(nlp, candidates(nlp, 6)) for inner in ("auto", "ipopt"))
    for found in (quick, nearest):
        assert set(found.status) == {"converged"} and found.violation.max() <= 1e-6
        assert max(simulate(nlp.problem, nlp.unpack(z)).max_defect for z in found.z[:3]) < defect
    # Newton's steps may end at a point that is a little farther than the nearest one: here by 0.0012 of a span.
    assert quick.moved == pytest.approx(nearest.moved, abs=2e-3)


@pytest.mark.parametrize(("kind", "scheme"), [("linear", "euler"), ("constant", "rk4"), ("spline", "rk8")])
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


@pytest.mark.parametrize("method", METHODS[2:4], ids=str)
def test_a_trajectory_comes_back_as_the_vector_it_was_made_of(method):
    problem = load("goddard")
    nlp = method.transcribe(problem)
    z = inner_solver("auto").solve(nlp, candidates(nlp, 1)).z[0]
    assert nlp.interpolate(nlp.unpack(z)) == pytest.approx(z, abs=1e-9)


EDGES = (0.0, 0.1, 0.15, 0.4, 0.5, 0.9, 1.0)
UNEVEN_KINDS = [("constant", None), ("linear", 10), ("spline", 4)]


def on(edges=EDGES, **more) -> MultipleShooting:
    return MultipleShooting(3, mesh={"swing": (edges, TABLEAUX[more.get("scheme", "rk4")].order)}, **more)


@pytest.mark.parametrize(("count", "kind", "nodes"), [(6, "constant", None), (49, "linear", 10), (6, "spline", 4)])
def test_a_mesh_of_equal_intervals_is_the_same_bits(count, kind, nodes):
    more = {"control": kind, "control_nodes": nodes, "steps": 3}
    plain = MultipleShooting(count, **more).transcribe(oscillator())
    meshed = on(tuple(np.linspace(0, 1, count + 1).tolist()), **more).transcribe(oscillator())
    Z = plain.first_guess(candidates(plain, 3))
    assert [v.name for v in plain.variables] == [v.name for v in meshed.variables]
    for one, other in zip(plain.propagate_and_score(Z), meshed.propagate_and_score(Z), strict=True):
        assert np.array_equal(one, other)


@pytest.mark.parametrize(("kind", "nodes"), UNEVEN_KINDS)
def test_a_flight_is_what_scipy_makes_of_the_same_controls(kind, nodes):
    nlp = on(scheme="rk8", steps=4, control=kind, control_nodes=nodes).transcribe(oscillator())
    for z in propagated(nlp, 2):
        t0, tf, m = (z[slot(nlp, name)] for name in ("swing.t0", "swing.tf", "m"))
        kinks = t0 + (tf - t0) * np.interp(np.linspace(0, 1, nodes or len(EDGES)), np.linspace(0, 1, len(EDGES)), EDGES)
        u, v = (law_at(kind, kinks, values_of(nlp, z, name)) for name in ("swing.u", "swing.v"))
        x, cost = np.array([z[slot(nlp, "swing.x(t0)")], 0.5]), 0.0

        def rates(t, y, u=u, v=v, m=m, tf=tf):
            return [*oscillator_rates(t, y[:2], np.array([u(t), v(t)]), m, tf), u(t) ** 2 + y[0] * y[1]]

        for a, b in zip(kinks[:-1], kinks[1:] - 1e-13, strict=True):
            *x, cost = solve_ivp(rates, (a, b), [*x, cost], method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        assert z[[slot(nlp, "swing.x(tf)"), slot(nlp, "swing.y(tf)")]] == pytest.approx(x, abs=2e-9)
        assert pytest.approx([cost, -x[0]], abs=2e-9) == nlp.evaluate(z[None])[0][0]
        flight, times = nlp.unpack(z)["swing"], np.linspace(t0, tf, 200)[1:-1] + 1e-5
        assert flight.at(times)["u"] == pytest.approx(u(times), abs=1e-11)
        if nodes is None:
            assert flight.state.edges[::4] == pytest.approx(t0 + (tf - t0) * np.array(EDGES), abs=1e-12)
            assert np.diff(flight.state.edges).reshape(6, 4) == pytest.approx((tf - t0) * np.diff(EDGES)[:, None] / 4 * np.ones((6, 4)))
        assert simulate(nlp.problem, nlp.unpack(z)).max_defect < 1e-8


def test_derivatives_of_the_reduced_problem_on_uneven_intervals():
    nlp = on(control="spline", control_nodes=4, steps=2).transcribe(oscillator())
    total_derivatives(nlp, nlp.first_guess(candidates(nlp, 2, seed=4)))


def lag(rate: float, tf: object = 100.0) -> Problem:
    """y follows a control with a lag, and x follows y."""
    problem = Problem("lag")
    phase = problem.phase("turn", t0=0, tf=tf)
    x, y = phase.state("x", bounds=(-200, 200), initial=0), phase.state("y", bounds=(-1, 1), initial=0)
    u = phase.control("u", bounds=(-1, 1))
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


def test_what_may_be_stable_is_not_refused():
    SingleShooting(51).transcribe(lag(2.0, tf=(10.0, 100.0)))  # short flights are
    SingleShooting(6, scheme="euler").transcribe(oscillator())  # grows a little, as Euler's method does
    SingleShooting(4).transcribe(lag(2.0, tf=3.0))
    for case in ("goddard", "orbit_rise", "landing_site"):
        SingleShooting(31).transcribe(load(case))


def test_steps_that_grow_may_be_mended_by_those_between():
    """A factor of 1.375 in each long step, and of 0.27 in each short one: what should vanish does, from one pair of steps to the next."""
    pairs = np.tile([3.0, 1.6], 60)
    edges = (0.0, *(np.cumsum(pairs) / pairs.sum())[:-1].tolist(), 1.0)
    MultipleShooting(120, mesh={"turn": (edges, 4)}).transcribe(lag(pairs.sum() / 100))


def test_the_longest_step_decides():
    """Of 100 equal steps of 1 s each is stable to a rate of 2.785; so are 49 half steps and a last one of 75.5 s only to 0.037."""
    even, tail = np.linspace(0, 1, 101), np.append(0.5e-2 * np.arange(50), 1.0)
    MultipleShooting(100, mesh={"turn": (tuple(even.tolist()), 4)}).transcribe(lag(2.7))
    method = MultipleShooting(100, mesh={"turn": (tuple(tail.tolist()), 4)})
    with pytest.raises(ValueError, match=r"steps of 75.5 s are too long for 'y', .*: rk4 multiplies it .*; take steps=\d+"):
        method.transcribe(lag(1.0))
    assert not method.suits(lag(1.0).compile()) and method.suits(lag(0.03).compile())
    # Rates of 0.1: 7.55 decays in one step are multiplied by 80, which is not yet certain to be wrong.
    method.transcribe(lag(0.1))


# The Runge-Kutta methods: conditions of order, errors and stability


Tree = tuple  # of its branches
STAGES = {"euler": 1, "midpoint": 2, "heun": 2, "kutta3": 3, "rk4": 4, "rk38": 4, "rk8": 11}
ORDERS = {"euler": 1, "midpoint": 2, "heun": 2, "kutta3": 3, "rk4": 4, "rk38": 4, "rk8": 8}


@cache
def trees(order: int) -> list[Tree]:
    """All rooted trees with so many nodes."""

    def forests(total: int, largest: int):
        if not total:
            yield ()
        for size in range(min(total, largest), 0, -1):
            for tree in trees(size):
                for others in forests(total - size, size):
                    yield tuple(sorted((tree, *others)))

    return sorted(set(forests(order - 1, order - 1)))


def size(tree: Tree) -> int:
    return 1 + sum(map(size, tree))


def density(tree: Tree) -> int:
    return size(tree) * int(np.prod([density(branch) for branch in tree]))


def weights(A: np.ndarray, tree: Tree) -> np.ndarray:
    """Elementary weights of the stages (Hairer, Norsett and Wanner, II.2)."""
    return np.prod([A @ weights(A, branch) for branch in tree], axis=0) * np.ones(len(A))


def misses(name: str, order: int) -> float:
    """By how much the conditions of this order are missed."""
    method = TABLEAUX[name]
    return max(abs(np.array(method.b) @ weights(method.matrix, tree) - 1 / density(tree)) for tree in trees(order))


def test_there_are_as_many_trees_as_there_should_be():
    assert [len(trees(n)) for n in range(1, 9)] == [1, 1, 2, 4, 9, 20, 48, 115]


@pytest.mark.parametrize("name", TABLEAUX)
def test_all_conditions_of_the_order_hold_and_those_of_the_next_do_not(name):
    order = TABLEAUX[name].order
    assert order == ORDERS[name] and len(TABLEAUX[name].b) == STAGES[name]
    assert max(misses(name, n) for n in range(1, order + 1)) < 1e-15
    assert misses(name, order + 1) > 1e-6


def stepped_error(name: str, n: int) -> np.ndarray:
    """The error after n steps from 0 to 2 of an equation whose solution is (exp(sin t), cos t)."""

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        return np.array([y[0] * y[1], -np.sin(t) + 0.5 * (y[0] - np.exp(np.sin(t)))])

    y, h = np.array([1.0, 1.0]), 2.0 / n
    for k in range(n):
        y, _ = TABLEAUX[name].step(lambda c, at, k=k: rates((k + c) * h, at), y, h)
    return y - np.array([np.exp(np.sin(2.0)), np.cos(2.0)])


@pytest.mark.parametrize("name", TABLEAUX)
def test_errors_fall_with_the_order_on_an_equation_with_a_closed_form(name):
    n = 6 if name == "rk8" else 40
    coarse, fine = (np.linalg.norm(stepped_error(name, steps)) for steps in (n, 2 * n))
    assert np.log2(coarse / fine) == pytest.approx(TABLEAUX[name].order, abs=0.35)


@pytest.mark.parametrize("name", TABLEAUX)
def test_the_stability_function_is_what_a_step_does_to_an_exponential(name):
    method, z = TABLEAUX[name], np.array([-0.7, -3.0, 0.5 + 1.2j, 2j])
    stepped = [method.step(lambda c, y, each=each: each * y, 1.0, 1.0)[0] for each in z]
    assert np.allclose(method.stability(z), stepped, rtol=1e-13)
    # It agrees with the exponential up to its order, and is a polynomial of as many terms as there are stages.
    assert np.allclose(method.growth[: method.order + 1], [1 / np.prod(np.arange(1.0, k + 1)) for k in range(method.order + 1)], atol=1e-15)
    assert method.growth.shape == (len(method.b) + 1,)


@pytest.mark.parametrize(("name", "limit"), [("euler", 2.0), ("heun", 2.0), ("kutta3", 2.5127), ("rk4", 2.7853), ("rk38", 2.7853)])
def test_how_far_a_step_may_go_on_the_real_axis(name, limit):
    assert abs(TABLEAUX[name].stability(-limit + 1e-3)) < 1 < abs(TABLEAUX[name].stability(-limit - 1e-3))
