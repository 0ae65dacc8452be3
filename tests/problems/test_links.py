from __future__ import annotations

import itertools

import casadi as ca
import numpy as np
import pytest
from statements import INF, NAN, glider, refused

from problems import Phase, Problem

# Links


def relay(count: int = 3) -> tuple[Problem, list[Phase]]:
    problem = Problem("relay")
    phases = []
    for i in range(count):
        phase = problem.phase(f"leg {i}", t0=(0, 10), tf=(0, 10))
        x = phase.state("x", bounds=(0, 10))
        phase.state(f"own {i}", bounds=(0, 10))
        phase.dynamics(**{"x": 1, f"own {i}": x})
        phases.append(phase)
    problem.minimize("time", phases[-1].tf)
    return problem, phases


def test_links_take_phases_of_this_problem():
    problem, legs = relay()
    _, stranger = glider()
    for pair in ((legs[0], stranger), (stranger, legs[0]), ("leg 0", legs[1]), (legs[0], None)):
        refused(lambda pair=pair: problem.link(*pair), "relay", "link")


def test_links_take_states_of_both_phases():
    problem, legs = relay()
    refused(lambda: problem.link(legs[0], legs[1], states=["own 0"]), "own 0", "leg 0", "leg 1")
    refused(lambda: problem.link(legs[0], legs[1], states="y"), "y", "leg 0", "leg 1")
    problem.link(legs[0], legs[1], states="x")
    problem.link(legs[1], legs[2], states=())
    assert [link.states for link in problem.compile().links] == [("x",), ()]


def test_links_do_not_close_a_circle():
    problem, legs = relay()
    refused(lambda: problem.link(legs[0], legs[0]), "leg 0")
    problem.link(legs[0], legs[1])
    refused(lambda: problem.link(legs[0], legs[1]), "leg 0", "leg 1", "twice")
    refused(lambda: problem.link(legs[1], legs[0]), "leg 0", "leg 1", "circle")
    problem.link(legs[1], legs[2])
    refused(lambda: problem.link(legs[2], legs[0]), "leg 2", "leg 0", "circle")


def test_a_link_stated_before_the_states_still_joins_them():
    problem = Problem("relay")
    first, second = problem.phase("up", t0=0, tf=1), problem.phase("down", t0=1, tf=2)
    problem.link(first, second)
    for phase in (first, second):
        phase.state("x", bounds=(0, 1))
        phase.dynamics(x=1)
    problem.minimize("time", second.tf)
    assert problem.compile().links[0].states == ("x",)


def test_a_jump_of_a_state_that_a_link_continues_is_refused_by_name():
    problem, legs = relay()
    problem.link(legs[0], legs[1])
    problem.constraint("drop", legs[0].final(legs[0]["x"]) - legs[1].initial(legs[1]["x"]), lower=2.0)
    refused(problem.compile, "drop", "link", "at least 2")
    problem, legs = relay()
    problem.link(legs[0], legs[1], states=[])
    problem.constraint("drop", legs[0].final(legs[0]["x"]) - legs[1].initial(legs[1]["x"]), lower=2.0)
    problem.constraint("as before", legs[0].final(legs[0]["x"]) - legs[0].final(legs[0]["x"]), upper=0.0)
    problem.compile()


def test_links_that_leave_nothing_are_refused():
    problem, legs = relay(2)
    third = problem.phase("late", t0=11, tf=12)
    third.state("x", bounds=(0, 1))
    third.dynamics(x=1)
    problem.link(legs[0], third)
    refused(problem.compile, "leg 0", "late", "time")
    problem = Problem("relay")
    first, second = problem.phase("up", t0=0, tf=1), problem.phase("down", t0=1, tf=2)
    for phase, bounds in ((first, (0, 1)), (second, (2, 3))):
        phase.state("x", bounds=bounds)
        phase.dynamics(x=1)
    problem.link(first, second)
    problem.minimize("time", second.tf)
    refused(problem.compile, "up", "down", "'x'")


def ranges(problem: Problem) -> dict[str, tuple[float, float, float, float]]:
    return {p.name: (p.t0.lower, p.t0.upper, p.tf.lower, p.tf.upper) for p in problem.compile().phases}


def test_times_are_narrowed_by_durations():
    assert ranges(glider(tf=(0, 100), duration=(2, 5))[0]) == {"descent": (0, 0, 2, 5)}
    assert ranges(glider(t0=(0, 10), tf=8, duration=3)[0]) == {"descent": (5, 5, 8, 8)}
    assert ranges(glider(t0=(4, 10), tf=(0, 6))[0]) == {"descent": (4, 6, 4, 6)}


def test_times_are_narrowed_along_links_both_ways():
    problem, legs = relay()
    for first, second in itertools.pairwise(legs):
        problem.link(first, second)
    last = problem.phase("last", t0=(0, 10), tf=7, duration=(3, 10))
    last.state("x", bounds=(2, 4), initial=3)
    last.dynamics(x=0)
    problem.link(legs[2], last)
    for times in ranges(problem).values():
        assert times[1] <= 4
    compiled = problem.compile()
    assert compiled.phases[2].final[0] == (3, 3) and compiled.phases[3].initial[0] == (3, 3)


# Guesses


@pytest.mark.parametrize(
    "value",
    [
        NAN,
        INF,
        "5",
        None,
        (1, 2, 3),
        ([0, 1], [1]),
        ([0], [1]),
        ([1, 0], [1, 2]),
        ([0, NAN], [1, 2]),
        ([0, 1], [1, NAN]),
        (1, None),
        ([0, 1], ["a", "b"]),
        ([0, 0], [1, 2]),
        np.ones((2, 2, 2)),
        (1, [2, 3]),
        {},
        ca.MX.sym("q"),
        [[0, 1], [1, 2], [2, 3]],
        (),
    ],
    ids=str,
)
def test_bad_guesses_are_refused(value):
    refused(lambda: glider()[1].guess(height=value), "height", "descent", "guess")


@pytest.mark.parametrize(
    "value",
    [3, 3.5, np.float64(2), np.array(3), (1, 2), [1, 2], np.array([1, 2]), ([0, 1, 2], [5, 4, 3]), (np.arange(3), range(3))],
    ids=str,
)
def test_guesses_of_every_kind_are_taken(value):
    glider()[1].guess(height=value)


def test_guesses_of_unknown_names_and_outside_bounds_are_refused():
    problem, phase = glider()
    problem.parameter("mass", bounds=(1, 2))
    refused(lambda: phase.guess(speed=1), "speed", "descent", "height")
    refused(lambda: problem.guess(weight=1), "weight", "glider", "mass")
    refused(lambda: problem.guess(mass=NAN), "mass", "glider")
    refused(lambda: problem.guess(mass=3), "mass", "glider", "(1, 2)")
    refused(lambda: phase.guess(height=11), "height", "descent")
    refused(lambda: phase.guess(height=(5, -1)), "height", "descent")
    refused(lambda: phase.guess(flap=([0, 1], [0, 2])), "flap", "descent")
    refused(lambda: phase.guess(tf=3), "tf", "descent")
    refused(lambda: phase.guess(tf=(1, 2)), "tf", "descent")
    phase.guess(height=(0, 10), flap=1, tf=2, t0=0)
    problem.guess(mass=1)
