"""Trajectories that begin, end and run on their bounds: nothing is strictly inside, and gradient solves converge all the same."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import casadi as ca
import numpy as np
import pytest

from problems import Problem
from transcription import parse
from transcription.nlp import scalarized
from transcription.nlp.scalarized import Solved, scalarize


def robot() -> Problem:
    """A free-flying robot, Sakawa, "Trajectory planning of a free-flying robot by using the optimal control", Optimal Control Applications
    and Methods 20, 1999; Betts 2010, section 6.13. It begins at rest on the bounds of its place."""
    problem = Problem("robot")
    flight = problem.phase("flight", t0=0, tf=12)
    flight.state("x", bounds=(-10, 10), initial=-10, final=0)
    flight.state("y", bounds=(-10, 10), initial=-10, final=0)
    angle = flight.state("angle", bounds=(-pi, pi), initial=pi / 2, final=0)
    vx, vy = (flight.state(name, bounds=(-2, 2), initial=0, final=0) for name in ("vx", "vy"))
    turn = flight.state("turn", bounds=(-1, 1), initial=0, final=0)
    u = [flight.control(f"u{k}", bounds=(0, 1)) for k in range(4)]
    first, second = u[0] - u[1], u[2] - u[3]
    push = first + second
    flight.dynamics(x=vx, y=vy, angle=turn, vx=push * ca.cos(angle), vy=push * ca.sin(angle), turn=0.2 * (first - second))
    flight.path("first", u[0] + u[1], upper=1)
    flight.path("second", u[2] + u[3], upper=1)
    problem.minimize("fuel", flight.integral(u[0] + u[1] + u[2] + u[3]))
    return problem


def solved(problem: Problem, word: str, **more: int) -> Solved:
    nlp = parse(word).nlp(problem)
    middle = np.where(np.isnan(nlp.guess), 0.5 * (nlp.lower + nlp.upper)[nlp.free], nlp.guess)
    return scalarize(nlp, nlp.first_guess(middle[None])[0], reference=np.zeros(1), weights=np.ones(1), **more)


def test_a_robot_that_begins_on_its_bounds() -> None:
    found = solved(robot(), "dfet:20x3:bernstein:1", max_iterations=150)
    assert found.status == "converged" and found.violation < 1e-7
    assert found.F[0] > 7.91  # the optimum, Betts 2010: no control on this mesh is better


@pytest.mark.parametrize("wide", [1.0, 1e4])
def test_the_widths_of_bounds_do_not_matter(wide: float) -> None:
    # x' = u from 0 to 1 with the least integral of x^2 + u^2: its value is coth(1).
    problem = Problem("regulator")
    phase = problem.phase("phase", t0=0, tf=1)
    x, u = phase.state("x", bounds=(-5 * wide, 5 * wide), initial=0, final=1), phase.control("u", bounds=(-10 * wide, 10 * wide))
    phase.dynamics(x=u)
    problem.minimize("effort", phase.integral(x**2 + u**2))
    found = solved(problem, "dfet:4x5", max_iterations=60)
    assert found.status == "converged" and abs(found.F[0] - 1 / np.tanh(1)) < 1e-6


def test_what_is_solved_to_a_useful_accuracy_has_not_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    # As above: the last iterations are quick, so that few limits end a solve where it is nearly done.
    problem = Problem("regulator")
    phase = problem.phase("phase", t0=0, tf=1)
    x, u = phase.state("x", bounds=(-5, 5), initial=0, final=1), phase.control("u", bounds=(-10, 10))
    phase.dynamics(x=u)
    problem.minimize("effort", phase.integral(x**2 + u**2))
    failed = solved(problem, "dfet:4x5", max_iterations=4, persistent=False)
    assert failed.status == "failed" and failed.message == "the limit of 4 iterations was reached"
    monkeypatch.setattr(scalarized, "SOLVE", replace(scalarized.SOLVE, useful=1e-2))
    useful = solved(problem, "dfet:4x5", max_iterations=4, persistent=False)
    assert useful.status == "converged" and "the limit of 4 iterations" in useful.message and "optimality hold to" in useful.message
    assert abs(useful.F[0] - 1 / np.tanh(1)) < 1e-6
    assert solved(problem, "dfet:4x5", max_iterations=2, persistent=False).status == "failed"
