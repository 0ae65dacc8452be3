"""Costates and the Hamiltonian: against closed forms, and against how the optimum changes with the initial state."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np
import pytest
from euler import Euler

from problems import Problem, load
from problems.cases import goddard
from transcription import parse
from transcription.elements.phase import ElementsPhase
from transcription.nlp.optimality import Conditions, costates
from transcription.nlp.scalarized import scalarize
from transcription.phases.adjoint import Adjoint
from transcription.phases.writer import PhaseWriter
from transcription.trajectories.trajectory import PiecewisePolynomial

WORDS = [
    "gauss:8x6",
    "radau:8x6",
    "lobatto:8x6",
    "gauss:1x40",
    "radau:1x40",
    "lobatto:1x40",
    "chebyshev:1x40",
    "radau:8x5:bernstein",
    "dfet:8x6",
    "dfet:8x6:bernstein",
    "multiple-shooting:30:linear",
    "shooting:61:linear",
    "multiple-shooting:10x4:rk8:spline",
]
"""Methods and meshes that resolve the optima here."""


def solved(problem, word, reference=None, weights=None):
    """The NLP and its optimum: by default of the first objective alone."""
    nlp = (parse(word) if isinstance(word, str) else word).nlp(problem.compile())
    m = len(nlp.problem.goals)
    own = np.arange(m) == 0
    middle = 0.5 * (nlp.lower[nlp.free] + nlp.upper[nlp.free])
    start = nlp.first_guess(np.where(np.isnan(nlp.guess), middle, nlp.guess)[None])[0]
    reference = np.where(own, 0.0, np.inf) if reference is None else reference
    found = scalarize(nlp, start, reference=reference, weights=own.astype(float) if weights is None else weights)
    assert found.status == "converged"
    return nlp, found


def adjoint(problem, word, **task):
    """The trajectory of an optimum, and its costates."""
    nlp, found = solved(problem, word, **task)
    conditions = Conditions.of(nlp, found.z)
    assert conditions.residual < 1e-6
    return nlp.unpack(found.z), costates(nlp, found.z, conditions.multipliers())


def tangent_law(flight_time: float, times: np.ndarray) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Weights and costates of the ascent: tan u = c0 - c1 t is the ratio of the costates of vy and vx, of which the second is that of the
    objective; the Hamiltonian at tf is minus the weight of the flight time (Bryson and Ho, "Applied Optimal Control", 2.7)."""
    a, b = goddard._ends(flight_time)
    p, q = np.sinh(a), np.sinh(b)
    ratio = goddard.THRUST * np.cosh(b) - goddard.GRAVITY * q
    of_speed = 1.0 / (1.0 + ratio)
    z = p + (q - p) * times / flight_time
    one = np.ones_like(times)
    return np.array([ratio * of_speed, of_speed]), {
        "x": 0.0 * one,
        "vx": -of_speed * one,
        "y": of_speed * (q - p) / flight_time * one,
        "vy": -of_speed * z,
    }


@cache
def ascent():
    """The problem with the closed form, whose NLPs are made once."""
    return load("goddard").compile()


@pytest.mark.parametrize("word", WORDS)
def test_the_ascent_has_the_costates_of_the_linear_tangent_law(word):
    flight_time = 130.0
    trajectory, found = adjoint(ascent(), word, reference=np.array([flight_time, 0.0]), weights=np.array([0.0, 1.0]))
    costate, flown = found["ascent"], trajectory["ascent"]
    weights, closed = tangent_law(flown.tf, flown.time)
    tolerance = 1e-4
    assert found.weights == pytest.approx(weights, rel=tolerance)
    for name, values in closed.items():
        assert costate[name] == pytest.approx(values, abs=tolerance * (np.abs(values).max() + 1e-3)), name
    assert costate.hamiltonian == pytest.approx(np.full(len(flown.time), -weights[0]), rel=tolerance)


@pytest.mark.slow
def test_by_the_adjoint_equation_they_are_the_same(monkeypatch):
    for word in ("gauss:8x4", "radau:8x4", "dfet:6x5", "dfet:8x4:bernstein:2"):
        _, own = adjoint(pendulum(0.4), word)
        with monkeypatch.context() as patched:
            patched.setattr(ElementsPhase, "costates", PhaseWriter.costates)
            _, other = adjoint(pendulum(0.4), word)
        assert other["run"].error < 1e-6
        # Polynomials of order 4 on eight elements differ from the integral by 1.1e-5 of the largest.
        assert own["run"].at_nodes == pytest.approx(other["run"].at_nodes, abs=2e-5 * np.abs(own["run"].at_nodes).max())
        assert own["run"].error is None


def test_a_method_that_knows_none_gets_them_by_the_adjoint_equation():
    """Euler's, whose states are straight lines between nodes: with errors of order 1, of which `error` tells."""
    errors = []
    for steps in (50, 100):
        nlp, found = solved(pendulum(0.4), Euler(steps))
        run = costates(nlp, found.z, Conditions.of(nlp, found.z).multipliers())["run"]
        _, fine = adjoint(pendulum(0.4), "dfet:8x5")
        away = np.abs(run.at_nodes - fine["run"].polynomial(nlp.unpack(found.z)["run"].time)).max() / np.abs(run.at_nodes).max()
        errors.append((away, run.error))
    assert np.array(errors[1]) == pytest.approx(0.5 * np.array(errors[0]), rel=0.3)
    assert errors[1][0] < 0.05 and 0.1 * errors[1][0] < errors[1][1] < 10 * errors[1][0]


# What a unit of the initial state is worth: the costate at t0 is the derivative of the optimum.


def pendulum(x0: float) -> Problem:
    """Least effort to bring a pendulum to rest, with a cost on the way and at the end."""
    problem = Problem("pendulum")
    run = problem.phase("run", t0=0, tf=2)
    x = run.state("x", bounds=(-4, 4), initial=x0)
    v = run.state("v", bounds=(-6, 6), initial=0.3, final=0)
    u = run.control("u", bounds=(-20, 20))
    run.dynamics(x=v, v=-ca.sin(x) - 0.1 * v + u)
    problem.minimize("cost", run.integral(u**2 / 2 + x**2) + 3 * (run.final(x) - 0.2) ** 2)
    return problem


def late(x0: float) -> Problem:
    """A free end, a parameter and dynamics that depend on time."""
    problem = Problem("late")
    a = problem.parameter("a", bounds=(0.1, 3))
    run = problem.phase("run", t0=0, tf=(0.5, 6))
    x = run.state("x", bounds=(-5, 5), initial=x0, final=2)
    u = run.control("u", bounds=(-9, 9))
    run.dynamics(x=u * a - 0.2 * x + 0.1 * run.time)
    problem.minimize("cost", run.tf + run.integral(u**2) + a**2)
    return problem


def bounded(x0: float) -> Problem:
    """A budget of effort."""
    problem = Problem("bounded")
    run = problem.phase("run", t0=0, tf=1)
    x = run.state("x", bounds=(-5, 9), initial=x0)
    v = run.state("v", bounds=(-9, 9), initial=0.5)
    u = run.control("u", bounds=(-20, 20))
    run.dynamics(x=v, v=u - 0.3 * v * ca.fabs(v))
    problem.constraint("effort", run.integral(u**2), upper=3.0)
    problem.maximize("way", run.final(x))
    return problem


def below(x0: float) -> Problem:
    """Below a path constraint for a while."""
    problem = Problem("below")
    run = problem.phase("run", t0=0, tf=1)
    x = run.state("x", bounds=(-5, 5), initial=x0, final=1)
    v = run.state("v", bounds=(-9, 9), initial=0, final=0)
    u = run.control("u", bounds=(-40, 40))
    run.dynamics(x=v, v=u)
    run.path("speed", v + 0.1 * x, upper=1.2)
    problem.minimize("effort", run.integral(u**2 / 2))
    return problem


def highest(x0: float) -> Problem:
    """The least of highest speeds and a little effort."""
    problem = Problem("highest")
    run = problem.phase("run", t0=0, tf=1)
    run.state("x", bounds=(-5, 5), initial=x0, final=1)
    v = run.state("v", bounds=(-9, 9), initial=0, final=0)
    u = run.control("u", bounds=(-40, 40))
    run.dynamics(x=v, v=u)
    problem.minimize("cost", 20 * run.peak(v) + run.integral(u**2 / 2))
    return problem


def mixed(x0: float) -> Problem:
    """Below a path constraint on state and control."""
    problem = Problem("mixed")
    run = problem.phase("run", t0=0, tf=1)
    x = run.state("x", bounds=(-5, 5), initial=x0)
    u = run.control("u", bounds=(-9, 9))
    run.dynamics(x=u)
    run.path("both", u + 2 * x, upper=2.0)
    problem.minimize("cost", run.integral((x - 2) ** 2 + u**2 / 10))
    return problem


STATEMENTS = {one.__name__: one for one in (pendulum, late, bounded, below, highest, mixed)}
STARTS = {"late": -0.5}
FINE = {
    "radau": "radau:24x3",
    "chebyshev": "chebyshev:24x3",
    "dfet": "dfet:24x3",
    "single": "shooting:31:linear",
    "multiple": "multiple-shooting:20x2:linear",
}


@cache
def along(name: str, word: str):
    """The trajectory of an optimum and its costates, which several tests look at."""
    return adjoint(STATEMENTS[name](STARTS.get(name, 0.1)), word)


@pytest.mark.slow
@pytest.mark.parametrize("method", FINE)
@pytest.mark.parametrize("name", STATEMENTS)
def test_the_first_costate_is_the_slope_of_the_optimum(name, method):
    """On the mesh itself, so that the slope is exact but for the differences; and but for what a constraint that is active at t0 does
    there, which is a share of a step."""
    statement: Callable[[float], Problem] = STATEMENTS[name]
    x0, step = STARTS.get(name, 0.1), 1e-3
    word = "shooting:61:linear" if (name, method) == ("mixed", "single") else FINE[method]
    _, found = along(name, word)
    low, high = (solved(statement(x0 + d), word)[1].F[0] for d in (-step, step))
    slope = (high - low) / (2 * step)
    (phase,) = found.values()
    assert np.isfinite(phase.hamiltonian).all() and np.isfinite(phase.at_nodes).all()
    assert phase["x"][0] == pytest.approx(slope, rel=2e-2 if name == "mixed" else 2e-3, abs=1e-3)


@pytest.mark.parametrize("name", ["below", pytest.param("highest", marks=pytest.mark.slow), pytest.param("mixed", marks=pytest.mark.slow)])
def test_methods_agree_along_the_whole_way(name):
    """Also where a limit pushes, in the mean over a short while: there costates of a mesh are steps."""
    places = np.linspace(0.025, 0.975, 20)[:, None] + np.linspace(-0.025, 0.025, 26)[:-1]
    means: list[np.ndarray] = []
    for word in FINE.values():
        trajectory, found = along(name, word)
        means.append(found["run"].polynomial(trajectory["run"].tf * places).mean(axis=1))
    size = np.abs(means[0]).max()
    for other in means[1:]:
        assert other == pytest.approx(means[0], abs=0.03 * size)


@pytest.mark.parametrize("word", ["radau:9x3", "lobatto:9x3", "dfet:18x2:bernstein:1", "multiple-shooting:18:linear", "shooting:19:linear"])
def test_costates_jump_where_a_state_enters_and_leaves_its_limit(word):
    """Below a wall at l = 1/9, u = -2/(3 l) (1 - t/(3 l)) up to 3 l, 0 along the wall, and the mirror image after it (Bryson and Ho, 3.11):
    the costate of v is -u, and that of x, its slope reversed, is 2/(9 l^2) = 18, 0 and -18."""
    trajectory, found = adjoint(load("standard/bryson_denham"), word)
    move, time = found["move"], trajectory["move"].time
    before, on, after = time < 1 / 3 - 0.12, (time > 1 / 3 + 0.12) & (time < 2 / 3 - 0.12), time > 2 / 3 + 0.12
    expected = np.select([before, on, after], [18.0, 0.0, -18.0])
    clear = before | on | after
    assert move["x"][clear] == pytest.approx(expected[clear], abs=0.02 * 18)
    u = np.where(time < 1 / 3, -6 * (1 - 3 * time), np.where(time < 2 / 3, 0.0, -6 * (3 * time - 2)))
    assert move["v"][clear] == pytest.approx(-u[clear], abs=0.02 * 6)


@pytest.mark.parametrize(("jump", "error"), [(0.25, 0.0), (0.5, 0.0), (0.2, 0.5), (0.7, 0.5)])
def test_the_error_tells_of_jumps_in_the_wrong_place(jump, error):
    """Costates fall from 2 to 1; those of the method do so between the ends of its first two elements."""
    found = PiecewisePolynomial(np.unique([0.0, 0.25, jump, 0.5, 1.0]), np.empty(0), "lobatto")
    steps = np.where(found.edges[:-1] < jump, 2.0, 1.0)[:, None, None] * np.ones((1, 2, 1))
    own = np.array([2.0, 1.0, 1.0])[:, None, None] * np.ones((1, 2, 1))
    known = PiecewisePolynomial(np.array([0.0, 0.25, 0.5, 1.0]), own, "lobatto")
    adjoints = Adjoint(replace(found, coefficients=steps), 1e-9)
    assert adjoints.beside(known, np.ones(1)).error == pytest.approx(max(error, 1e-9))


@pytest.mark.parametrize("word", ["gauss:8x3", "chebyshev:8x3", "dfet:8x3", "shooting:17:linear"])
def test_costates_jump_at_one_instant(word):
    """At a wall of 0.2, which is touched at 1/2 only, u = a + b t with b = 24 (1 - 4 wall) before, and -b after it."""
    trajectory, found = adjoint(load("standard/bryson_denham", wall=0.2), word)
    move, time = found["move"], trajectory["move"].time
    # Chebyshev's points are too few for the full degree of the controls: see `collocation.py`.
    close = 1e-2 if word.startswith("chebyshev") else 2e-3
    assert move["x"] == pytest.approx(np.where(time < 0.5, 4.8, -4.8), rel=close), "right-continuous at the node itself"
    assert 0.5 in time


def test_a_path_constraint_is_as_good_as_a_bound():
    """The same wall, stated as a path constraint, by single shooting: its multipliers are those of samples."""
    problem = Problem("wall")
    run = problem.phase("run", t0=0.0, tf=1.0)
    x = run.state("x", bounds=(-10, 10), initial=0, final=0)
    v = run.state("v", bounds=(-10, 10), initial=1, final=-1)
    u = run.control("u", bounds=(-20, 20))
    run.dynamics(x=v, v=u)
    run.path("wall", x, upper=0.2)
    problem.minimize("effort", run.integral(u**2 / 2))
    for word in ("shooting:17:linear", "dfet:8x3"):
        trajectory, found = adjoint(problem, word)
        time = trajectory["run"].time
        clear = np.abs(time - 0.5) > 0.13
        assert found["run"]["x"][clear] == pytest.approx(np.where(time < 0.5, 4.8, -4.8)[clear], rel=5e-3)


def two_legs(parts: int) -> Problem:
    """`pendulum` with a force that grows with a parameter, in one phase or in two."""
    problem = Problem("legs")
    a = problem.parameter("a", bounds=(0.0, 2.0))
    legs = []
    for k, (t0, tf) in enumerate([(0.0, 2.0)] if parts == 1 else [(0.0, 0.8), (0.8, 2.0)]):
        leg = problem.phase(f"leg{k}", t0=t0, tf=tf)
        first, last = k == 0, k == parts - 1
        x = leg.state("x", bounds=(-4, 4), initial=0.5 if first else None)
        v = leg.state("v", bounds=(-6, 6), initial=0.3 if first else None, final=0 if last else None)
        u = leg.control("u", bounds=(-20, 20))
        leg.dynamics(x=v, v=a - ca.sin(x) + u)
        legs.append((leg, leg.integral(u**2 / 2 + x**2)))
        if k:
            problem.link(legs[0][0], leg)
    problem.minimize("cost", sum(one for _, one in legs) + a**2)
    return problem


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [("radau:15x4", "radau:10x4"), ("lobatto:15x4", "lobatto:10x4"), ("multiple-shooting:50:linear", "multiple-shooting:40:linear")],
)
def test_costates_go_on_across_links(words):
    whole_trajectory, whole = adjoint(two_legs(1), words[0])
    trajectory, split = adjoint(two_legs(2), words[1])
    assert split["leg0"].at_nodes[-1] == pytest.approx(split["leg1"].at_nodes[0], abs=1e-6)
    assert split["leg0"].hamiltonian[-1] == pytest.approx(split["leg1"].hamiltonian[0], rel=1e-4)
    for name, phase in trajectory.items():
        assert split[name].at_nodes == pytest.approx(whole["leg0"].polynomial(phase.time), abs=2e-3)
    assert whole["leg0"].hamiltonian == pytest.approx(np.full(len(whole_trajectory["leg0"].time), whole["leg0"].hamiltonian[0]), abs=1e-2)
