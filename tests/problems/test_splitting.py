"""Phases that are split where a condition switches, against closed forms; stated without a split, the same problems are not verified."""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from macs import optimize
from problems import Phase, Problem
from transcription import DFET


def media(split: bool = True) -> Problem:
    """The least time from one medium into another."""
    problem = Problem("media")
    path = problem.phase("path", t0=0, tf=(0.5, 10))
    x, _ = path.state("x", bounds=(-2, 2), initial=-1, final=1), path.state("y", bounds=(-2, 2), initial=0, final=1)
    angle, speed = path.control("angle", bounds=(-1.5, 1.5)), ca.if_else(x > 0, 2.0, 0.5)
    path.dynamics(x=speed * ca.cos(angle), y=speed * ca.sin(angle))
    problem.minimize("time", (path.split(x > 0) if split else path).tf)
    return problem


def gears(split: bool = True) -> Problem:
    """v' = u below v = 1 and u / 2 above it, from 0 to 3 in a time of 4: 1 / t + 16 / (4 - t) is least, 6.25, at t = 0.8."""
    problem = Problem("gears")
    drive = problem.phase("drive", t0=0, tf=4)
    v, u = drive.state("v", bounds=(0, 4), initial=0, final=3), drive.control("u", bounds=(0, 9))
    drive.dynamics(v=ca.if_else(v < 1, u, 0.5 * u))
    parts = [(drive, u)]
    if split:
        after = drive.split(v < 1, name="second gear")
        parts.append((after, after["u"]))
    problem.minimize("effort", sum(phase.integral(control**2) for phase, control in parts))
    return problem


def stewart(split: bool = True) -> Problem:
    """x' = 3 below 0 and 1 above it, from an x0 that is sought, min int x^2 + (x(2) - 5/3)^2: x0 = (9 - sqrt(417)) / 8 (D. E. Stewart and
    M. Anitescu, "Optimal control of systems with discontinuous differential equations", Numer. Math. 114, 2010)."""
    problem = Problem("stewart")
    run = problem.phase("run", t0=0, tf=2)
    x = run.state("x", bounds=(-5, 5), initial=(-2, -1))
    run.dynamics(x=ca.if_else(x > 0, 1.0, 3.0))
    last = run.split(x > 0) if split else run
    squares = sum(phase.integral(phase["x"] ** 2) for phase in {run.name: run, last.name: last}.values())
    problem.minimize("value", squares + (last.final(last["x"]) - 5 / 3) ** 2)
    return problem


def snell() -> float:
    return minimize_scalar(lambda y: np.hypot(1, y) / 0.5 + np.hypot(1, 1 - y) / 2, bounds=(0, 1), method="bounded").fun


def value_of(x0: float) -> float:
    return -(x0**3) / 9 + (2 + x0 / 3) ** 3 / 3 + (1 / 3 + x0 / 3) ** 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("problem", "best"), [(media, snell()), (gears, 6.25), (stewart, value_of((9 - np.sqrt(417)) / 8))], ids=["media", "gears", "stewart"]
)
def test_a_split_phase_has_the_optimum_that_a_switch_hides(problem, best):
    point = optimize(problem(), DFET(4, 4))
    assert next(iter(point.objectives.values())) == pytest.approx(best, rel=2e-6) and point.verified
    whole = optimize(problem(split=False), DFET(4, 4))
    assert whole.verified is False and "is not to be trusted" in whole.note


def carrying() -> tuple[Problem, Phase, Phase]:
    problem = Problem("carrying")
    a = problem.parameter("a", bounds=(0, 1))
    phase = problem.phase("p", t0=(0, 1), tf=(5, 6), duration=(4.5, 5), time_unit="min")
    x, y = phase.state("x", bounds=(-9, 9), initial=(-9, -1), final=2, unit="m", scale=3.0), phase.state("y", bounds=(0, 1))
    u = phase.control("u", bounds=(0, 7), unit="rad", period=7)
    phase.dynamics(x=ca.if_else(x > 0, a * u, phase.time), y=y)
    phase.path("level", x + ca.if_else(x > 0, 1.0, 2.0), upper=8)
    phase.guess(x=(-4, 2), y=0.5, tf=5.5)
    return problem, phase, phase.split(x > 0)


def test_both_parts_have_what_the_phase_had():
    problem, _, second = carrying()
    problem.minimize("end", second.tf)
    one, two = problem.compile().phases
    assert (one.states, one.controls) == (two.states, two.controls) and [one.name, two.name] == ["p", "p after"]
    assert (one.initial[0], one.final[0], two.final[0]) == ((-9, -1), (-9, 9), (2, 2)) and one.time_unit == two.time_unit == "min"
    assert (one.t0.lower, one.t0.upper, two.tf.lower, two.tf.upper) == (0, 1, 5, 6)
    assert dict(one.guesses) == {"y": 0.5} and dict(two.guesses) == {"y": 0.5, "tf": 5.5}
    # t, u, s with a = 0.5
    at = [-1.0, 0.3], 6.0, 2.0, [0, 5, 0.5]
    assert [np.array(phase.dynamics(*at)).ravel().tolist() for phase in (one, two)] == [[2.0, 0.3], [3.0, 0.3]]
    assert [np.array(phase.path(*at)).ravel().tolist() for phase in (one, two)] == [[1.0, 1.0], [0.0, 1.0]]
    assert [phase.paths[1].name for phase in (one, two)] == ["side of (0<x)"] * 2
    assert [(phase.paths[1].lower, phase.paths[1].upper) for phase in (one, two)] == [(0, np.inf), (-np.inf, 0)]
    compiled = problem.compile()
    assert {limit.name for limit in compiled.limits} == {"phase 'p' ends at (0<x)", "duration of p"} and len(compiled.links) == 1
    assert one.switching is None and two.switching is None


def test_a_time_is_a_break():
    problem = Problem("breaks")
    run = problem.phase("run", t0=0, tf=(1, 3))
    x = run.state("x", bounds=(-9, 9), initial=0)
    run.dynamics(x=ca.if_else(run.time < 0.3, 2.0, 0.0) + ca.if_else(run.time < 0.6, 1.0, 0.0))
    phases = [run, middle := run.break_at(0.3), middle.break_at(0.6)]
    problem.minimize("end", phases[-1].final(phases[-1]["x"]) + phases[-1].tf)
    compiled = problem.compile()
    assert [float(phase.dynamics(0, [], 0.45, [0, 1])) for phase in compiled.phases] == [3.0, 1.0, 0.0]
    assert all((one.tf.lower, one.tf.upper) == (two.t0.lower, two.t0.upper) for one, two in pairwise(compiled.phases))
    assert optimize(problem, DFET(1, 2)).objectives["end"] == pytest.approx(0.3 * 3 + 0.3 + 1)
    assert x is run["x"]


@pytest.mark.parametrize(
    ("work", "words"),
    [
        (lambda p, h, x: h.split(x > 1), "no rate and no path constraint has the condition"),
        (lambda p, h, x: h.split(x), "where one comparison switches"),
        (lambda p, h, x: h.split(x > 0), "say it: split"),
        (lambda p, h, x: (p.minimize("end", h.tf), h.split(x > 0, first=False)), "before its times"),
        (lambda p, h, x: (h.final(x), h.split(x > 0, first=False)), "before its times"),
        (lambda p, h, x: h.break_at(0.0), "need not last"),
        (lambda p, h, x: h.break_at(1.5), "need not last"),
    ],
)
def test_what_cannot_be_cut_is_refused(work, words):
    problem = Problem("refused")
    phase = problem.phase("h", t0=0, tf=(1, 2))
    x = phase.state("x", bounds=(-1, 1))
    phase.dynamics(x=ca.if_else(x > 0, 1.0, 2.0))
    with pytest.raises(ValueError, match=words):
        work(problem, phase, x)
