from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from statements import INF, NAN, bare, glider, refused

from problems import Problem

# Expressions


def test_every_state_needs_a_rate_and_nothing_else_has_one():
    _, phase = bare()
    phase.state("height", bounds=(0, 1))
    phase.state("speed", bounds=(0, 1))
    refused(lambda: phase.dynamics(height=1), "descent", "[height]", "[height, speed]")
    refused(lambda: phase.dynamics(height=1, speed=1, mass=1), "descent", "mass")
    phase.dynamics(speed=1, height=2)
    refused(lambda: phase.dynamics(height=1, speed=1), "descent", "twice")


def test_dynamics_may_come_in_any_order():
    problem, phase = bare()
    phase.state("height", bounds=(0, 1))
    phase.state("speed", bounds=(0, 1))
    phase.dynamics(speed=1, height=2)
    problem.minimize("time", phase.tf)
    rates = problem.compile().phases[0].dynamics([0, 0], [], 0, [0, 1])
    assert np.array(rates).ravel().tolist() == [2, 1]


def test_a_state_after_the_dynamics_is_missed_when_the_problem_is_compiled():
    problem, phase = glider()
    phase.state("speed", bounds=(0, 1))
    refused(problem.compile, "descent", "speed")


def test_dynamics_must_be_given():
    problem, phase = bare()
    phase.state("height", bounds=(0, 1))
    problem.minimize("time", phase.tf)
    refused(problem.compile, "descent", "height")


def test_a_problem_needs_a_phase_an_objective_and_states():
    refused(lambda: Problem("empty").compile(), "empty", "phase")
    problem, phase = bare()
    refused(problem.compile, "glider", "objective")
    problem.minimize("time", phase.tf)
    refused(problem.compile, "descent", "state")


def strangers() -> dict[str, ca.MX]:
    other_problem, other = glider()
    return {
        "q": ca.MX.sym("q"),
        "height": other["height"],
        "mass": other_problem.parameter("mass", bounds=(0, 1)),
        "tf of descent": other.tf,
        "final(height)": other.final(other["height"]),
    }


@pytest.mark.parametrize("name", strangers())
def test_symbols_of_another_problem_are_refused(name):
    problem, phase = glider()
    alien = strangers()[name]
    for expression in (alien, phase.tf * alien, ca.if_else(alien > 0, 1, phase.tf)):
        refused(lambda e=expression: phase.path("load", e, upper=1), name, "load", "descent")
        refused(lambda e=expression: problem.constraint("fuel", e, upper=1), name, "fuel", "glider")
        refused(lambda e=expression: problem.minimize("cost", e), name, "cost", "glider")
        for kind in ("initial", "final", "integral", "peak"):
            refused(lambda e=expression, kind=kind: getattr(phase, kind)(e), name, "descent", kind)
    refused(lambda: bare_dynamics(alien), name, "height", "descent")


def bare_dynamics(rate):
    _, phase = bare()
    phase.state("height", bounds=(0, 1))
    phase.dynamics(height=rate)


def test_symbols_of_another_phase_are_refused_along_a_phase():
    problem, phase = glider()
    second = problem.phase("landing", t0=2, tf=3)
    distance = second.state("distance", bounds=(0, 1))
    refused(lambda: second.dynamics(distance=phase["height"]), "height", "distance", "landing")
    refused(lambda: second.path("load", phase.time, upper=1), "time of descent", "landing")
    refused(lambda: second.integral(phase.tf), "tf of descent", "landing")
    refused(lambda: phase.peak(distance), "distance", "descent")


def test_raw_states_controls_and_time_are_refused_in_objectives_and_constraints():
    problem, phase = glider()
    for symbol, name in ((phase["height"], "height"), (phase["flap"], "flap"), (phase.time, "time of descent")):
        refused(lambda s=symbol: problem.minimize("cost", phase.tf + s), name, "cost", "final(...)")
        refused(lambda s=symbol: problem.constraint("fuel", s, upper=1), name, "fuel", "final(...)")


def test_quantities_are_refused_along_a_phase():
    _, phase = glider()
    for kind in ("initial", "final", "integral", "peak"):
        quantity = getattr(phase, kind)(phase["height"])
        refused(lambda q=quantity: phase.path("load", q - phase["height"], upper=1), f"{kind}(height)", "load")
        refused(lambda q=quantity: phase.integral(q * phase.time), f"{kind}(height)", "integral")
        refused(lambda q=quantity: bare_dynamics(q), f"{kind}(height)")


@pytest.mark.parametrize(
    "value",
    [None, "1", NAN, INF, ca.MX(NAN), ca.MX(1) / 0, [1], ca.MX.sym("v", 2), ca.MX(0, 0), ca.SX.sym("s"), ca.DM([1, 2]), np.ones(2)],
    ids=str,
)
def test_expressions_are_scalars_and_numbers(value):
    problem, phase = glider()
    refused(lambda: phase.path("load", value, upper=1), "load")
    refused(lambda: phase.final(value), "final", "descent")
    refused(lambda: problem.minimize("cost", value), "cost")
    refused(lambda: problem.constraint("fuel", value, upper=1), "fuel")
    refused(lambda: bare_dynamics(value), "height")


def test_vectors_are_refused_with_their_name():
    problem, phase = glider()
    refused(lambda: problem.minimize("cost", ca.vertcat(phase.tf, phase.t0)), "cost", "(2, 1)")
    problem.minimize("norm", ca.norm_2(ca.vertcat(phase.tf, phase.t0)))


def broken(kind: str, value) -> Problem:
    problem, phase = glider()
    x = phase["height"]
    bad = value(x)
    if kind in ("initial", "final", "integral", "peak"):
        problem.minimize("cost", getattr(phase, kind)(bad))
    elif kind == "path":
        phase.path("load", bad, upper=1)
    elif kind == "objective":
        problem.maximize("cost", value(phase.final(x)))
    else:
        problem.constraint("fuel", value(phase.final(x)), upper=1)
    return problem


@pytest.mark.parametrize("kind", ["initial", "final", "integral", "peak", "path", "objective", "constraint"])
@pytest.mark.parametrize("value", [lambda x: x * NAN, lambda x: x + INF, lambda x: ca.sqrt(-1 - x), lambda x: 1 / ca.fmin(x, 0)])
def test_expressions_that_are_nowhere_numbers_are_found_before_any_work(kind, value):
    name = {"path": "load", "objective": "cost", "constraint": "fuel"}.get(kind, f"{kind}(")
    refused(broken(kind, value).compile, name)


@pytest.mark.parametrize("rate", [lambda x: x * NAN, lambda x: ca.log(-1 - x), lambda x: 1 / ca.fmin(x, 0)])
def test_rates_that_are_nowhere_numbers_are_found_before_any_work(rate):
    problem, phase = bare()
    x = phase.state("height", bounds=(0, 1))
    phase.dynamics(height=rate(x))
    problem.minimize("time", phase.final(x))
    refused(problem.compile, "descent", "height")


@pytest.mark.parametrize(
    "rate", [lambda f, x: 1 / (f.tf - f.time), lambda f, x: 1 / f.time, lambda f, x: ca.sqrt(x - 0.9), lambda f, x: 1 / x]
)
def test_rates_that_are_numbers_somewhere_are_welcome(rate):
    problem, phase = bare()
    x = phase.state("height", bounds=(0, 1), initial=0)
    phase.dynamics(height=rate(phase, x))
    problem.minimize("time", phase.final(x))
    problem.compile()


def test_plain_numbers_are_expressions():
    problem, phase = bare()
    phase.state("height", bounds=(0, 1))
    phase.dynamics(height=np.float64(1))
    phase.path("load", ca.DM(0.5), upper=1)
    problem.constraint("fuel", 3, lower=2)
    problem.minimize("time", phase.final(2) + phase.integral(1))
    problem.compile()


def test_an_objective_that_depends_on_nothing_may_only_be_the_only_one():
    problem, phase = bare()
    x = phase.state("height", bounds=(0, 1))
    phase.dynamics(height=np.float64(1))
    problem.minimize("nothing", 0 * x + 3)
    problem.compile()
    problem.minimize("time", phase.final(x))
    refused(problem.compile, "nothing", "constant")
