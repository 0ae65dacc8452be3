"""Jumps of rates, integrands, paths and peaks where a state or control crosses something, against their closed forms."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from macs import MACS, optimize
from problems import Phase, Problem
from transcription import DFET
from transcription.trajectories.jumps import Jump
from transcription.trajectories.simulate import simulate

INNER = ca.MX.sym("z")
GAUSS = np.sqrt(0.6)  # controls have their values at Gauss's nodes
NESTED = ca.Function("nested", [INNER], [ca.if_else(INNER > 0.3, 2.0, 1.0)])


def run(state, elements: int = 2, controls=0.5, initial: float = 0.0):
    """The jumps of a problem of one state x' = u on [0, 1]; `state(phase, x, u, t)` states the rest."""
    problem = Problem("jumps")
    phase = problem.phase("run", t0=0, tf=1)
    x, u = phase.state("x", bounds=(-2, 2), initial=initial), phase.control("u", bounds=(-4, 4))
    problem.minimize("end", phase.final(x))
    phase.dynamics(**{"x": u} | (state(phase, x, u, phase.time) or {}))
    nlp = DFET(elements, 2).transcribe(problem)
    candidate = np.resize(controls, (1, len(nlp.free)))
    return simulate(nlp.problem, nlp.unpack(nlp.propagate(nlp.first_guess(candidate))[0])).jumps


def further(rate):
    """States a further state of this rate."""

    def state(phase: Phase, x, u, t):
        phase.state("y", bounds=(-9, 9), initial=0)
        return {"y": rate(x, u, t)}

    return state


@pytest.mark.parametrize(
    ("rate", "time", "words"),
    [
        (lambda x, u, t: ca.if_else(x > 0.3, 2.0, 1.0), 0.6, "(0.3-x)"),
        (lambda x, u, t: ca.if_else(x > 0.3, x, 2.0, True), 0.6, "(0.3-x)"),
        (lambda x, u, t: NESTED(x) * x, 0.6, "(0.3-x)"),
        (lambda x, u, t: NESTED.expand()(x - 0.1 * t) * x, 0.75, "(0.3-(x-(0.1*t)))"),
        (lambda x, u, t: ca.sign(x - 0.3), 0.6, "sign((x-0.3))"),
        (lambda x, u, t: ca.floor(10 * x + 5.5), 0.1, "floor"),
        (lambda x, u, t: ca.conditional(ca.floor(2.5 * x), [1.0, 2.0], 3.0), 0.8, "floor((2.5*x))"),
        (lambda x, u, t: ca.fmod(x, 0.3), 0.6, "fmod(x,0.3)"),
        (lambda x, u, t: x * ca.fmod(x - 1.0, 0.6), 0.8, "fmod("),  # of a negative number
        (lambda x, u, t: ca.remainder(x, 0.3), 0.3, "remainder(x,0.3)"),
        (lambda x, u, t: ca.fmod(1.0 + ca.fmod(x, 0.3), 5.0), 0.6, "fmod(x,0.3)"),
    ],
)
def test_a_rate_that_jumps_is_found_where_it_does(rate, time, words):
    first, *_ = run(further(rate))
    assert first.time == pytest.approx(time, abs=1e-9) and first.how == "crosses" and first.phase == "run"
    assert words.replace("(0.1*t)", "(0.1*time of run)") in str(first)


@pytest.mark.parametrize("kind", ["integral", "peak", "path"])
def test_integrands_peaks_and_paths_may_jump(kind):
    def state(phase: Phase, x, u, t):
        jump = ca.if_else(x > 0.3, 2.0, 1.0)
        if kind == "path":
            phase.path("limit", jump, upper=3)
        else:
            phase._quantity(kind, jump)

    assert [jump.time for jump in run(state)] == pytest.approx([0.6])


def test_a_control_may_cross_where_it_jumps():
    (jump,) = run(further(lambda x, u, t: ca.if_else(u > 0, 1.0, 0.0)), controls=[1, 1, 1, -1, -1, -1])
    assert jump.time == pytest.approx(0.5)


@pytest.mark.parametrize(
    "rate",
    [
        lambda x, u, t: ca.fabs(x - 0.3) + ca.fmin(x, 0.2) + ca.fmax(x, 0.1),
        lambda x, u, t: ca.if_else(x > 0.3, x, 2 * x - 0.3),
        lambda x, u, t: ca.if_else(x > 0.7, 2.0, 1.0),
        lambda x, u, t: ca.if_else(x < 0.0, 2.0, 1.0),
        lambda x, u, t: ca.sign(x - 0.3) * (x - 0.3),
        lambda x, u, t: ca.if_else(t > 0.3, 2.0, 1.0),
        lambda x, u, t: ca.fabs(ca.remainder(x, 0.3)) + ca.sin(2 * ca.pi * ca.fmod(x, 0.3) / 0.3),
        lambda x, u, t: ca.fmod(x - 0.3, 2.0) + ca.fmod(t, 0.3),
    ],
)
def test_kinks_sides_that_are_not_left_and_times_are_no_jumps(rate):
    assert run(further(rate)) == ()


@pytest.mark.parametrize(("line", "found"), [(0.25 + 1e-9, True), (0.26, False)])
def test_a_line_that_is_touched(line, found):
    """x' = 1 - 2 t: its top is 1/4, at t = 1/2."""
    jumps = run(further(lambda x, u, t: ca.if_else(x > line, 2.0, 1.0)), elements=1, controls=[GAUSS, 0, -GAUSS])
    assert [(jump.how, round(jump.time, 4)) for jump in jumps] == [("touches or slides along", 0.5)] * found


def test_a_line_that_is_slid_along():
    (jump,) = run(further(lambda x, u, t: ca.if_else(x > 0, 2.0, 1.0)), controls=0.0)
    assert jump.how == "touches or slides along"


def media() -> Problem:
    """The least time from one medium into another, with a state line between them: Snell's law has 2.678424."""
    problem = Problem("media")
    path = problem.phase("path", t0=0, tf=(0.5, 10))
    x, _ = path.state("x", bounds=(-2, 2), initial=-1, final=1), path.state("y", bounds=(-2, 2), initial=0, final=1)
    angle, speed = path.control("angle", bounds=(-1.5, 1.5)), ca.if_else(x > 0, 2.0, 0.5)
    path.dynamics(x=speed * ca.cos(angle), y=speed * ca.sin(angle))
    problem.minimize("time", path.tf)
    return problem


def test_what_a_gradient_solver_takes_for_an_optimum_is_not_verified():
    point = optimize(media(), DFET(5, 3))
    assert point.objectives["time"] > 2.7 and point.status == "converged" and point.verified is False
    assert "phase 'path' has a jump at t = 2.2361 s: it crosses (-x) = 0, where (0<x) switches" in point.note
    assert point.note.count("simulated, ") == 1


@pytest.mark.slow
@pytest.mark.parametrize(("unit", "words"), [("s", "at t = 0.3 s: "), ("km", "at distance 0.3 km: "), ("deg", "at angle 0.3 deg: ")])
def test_what_a_phase_runs_over_is_named_by_its_unit(unit, words):
    assert words in str(Jump("run", 0.3, unit, "(0<x)", "x", "crosses"))


def test_a_search_solves_no_jump_again():
    front = MACS().solve(media(), DFET(4, 3), evaluations=20, seed=1)
    assert not front.verified.any() and "mended" not in front.table() and "is not to be trusted" in front.table()
