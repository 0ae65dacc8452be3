from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest
from statements import INF, NAN, bare, glider, refused

from problems import Problem

# Numbers


@pytest.mark.parametrize(
    "bounds",
    [
        (1, 0),
        (0, INF),
        (-INF, 0),
        (NAN, 1),
        (0, None),
        None,
        3,
        (0, 1, 2),
        "01",
        ("0", "1"),
        (0, 1j),
        (0, 10**400),
        (0, ca.MX.sym("q")),
        ca.DM([0, 1, 2]),
        (0, np.array([1.0, 2.0])),
        {"a": 1, "b": 2},
        (0, ca.SX.sym("s")),
        (),
        [[0, 1], [2, 3]],
        np.ones((2, 40)),
    ],
    ids=str,
)
def test_bad_bounds_are_refused_with_the_name_of_the_variable(bounds):
    problem, phase = bare()
    refused(lambda: phase.state("height", bounds=bounds), "height", "descent")
    refused(lambda: phase.control("flap", bounds=bounds), "flap", "descent")
    refused(lambda: problem.parameter("mass", bounds=bounds), "mass", "glider")


@pytest.mark.parametrize(
    "bounds",
    [(0, 1), [0, 1], np.array([0, 1]), (np.float32(0), np.int64(1)), (ca.DM(0), ca.DM(1)), (np.array(0.0), np.array(1)), (ca.MX(0), 1)],
    ids=str,
)
def test_numbers_of_every_kind_are_bounds(bounds):
    _, phase = bare()
    phase.state("height", bounds=bounds, initial=bounds[0], final=bounds)
    compiled_state = phase._states["height"]
    assert (compiled_state.lower, compiled_state.upper) == (0.0, 1.0)
    assert phase._initial["height"] == (0.0, 0.0) and phase._final["height"] == (0.0, 1.0)


def test_a_state_of_one_value_only_is_refused():
    refused(lambda: bare()[1].state("height", bounds=(2, 2)), "height")


@pytest.mark.parametrize("word", ["initial", "final"])
@pytest.mark.parametrize("value", [11, -0.1, (0, 11), (-1, 5), NAN, INF, (6, 5), "5", (1, 2, 3), ca.MX.sym("q")], ids=str)
def test_values_outside_bounds_are_refused(word, value):
    refused(lambda: bare()[1].state("height", bounds=(0, 10), **{word: value}), "height", "descent", word)


@pytest.mark.parametrize("scale", [0, -1, NAN, INF, "1", ca.MX.sym("q")], ids=str)
def test_scales_are_positive_numbers(scale):
    problem, phase = glider()
    refused(lambda: phase.state("speed", bounds=(0, 1), scale=scale), "speed")
    refused(lambda: phase.control("brake", bounds=(0, 1), scale=scale), "brake")
    refused(lambda: phase.path("load", phase["flap"], upper=1, scale=scale), "load")
    refused(lambda: problem.parameter("mass", bounds=(0, 1), scale=scale), "mass")
    refused(lambda: problem.constraint("fuel", phase.tf, upper=1, scale=scale), "fuel")
    refused(lambda: problem.minimize("cost", phase.tf, scale=scale), "cost")


@pytest.mark.parametrize(
    "times", [{"t0": NAN}, {"t0": (2, 1)}, {"tf": INF}, {"tf": (0, INF)}, {"tf": None}, {"tf": "5"}, {"tf": [1]}], ids=str
)
def test_bad_times_are_refused(times):
    refused(lambda: glider(**times), "descent", next(iter(times)))


@pytest.mark.parametrize("duration", [-1, (-2, -1), 0, (-1, 2), (0, 0), (2, 1), INF, NAN])
def test_durations_are_positive(duration):
    refused(lambda: glider(duration=duration), "descent", "duration")


@pytest.mark.parametrize("times", [{"tf": 0}, {"tf": (-2, -1)}, {"t0": 3}, {"t0": (2, 3), "tf": (0, 2)}], ids=str)
def test_a_phase_must_last(times):
    refused(lambda: glider(**times)[0].compile(), "descent")


@pytest.mark.parametrize("duration", [3, (2.5, 3), (0.1, 0.5)])
def test_a_duration_that_the_times_do_not_allow_is_refused(duration):
    refused(lambda: glider(duration=duration)[0].compile(), "descent", "duration")


@pytest.mark.parametrize("period", [0, -6, 3, NAN, INF, "2", 2.01])
def test_a_period_is_the_width_of_the_bounds(period):
    refused(lambda: bare()[1].control("bank", bounds=(-1, 1), period=period), "bank")


def test_a_period_may_differ_from_the_width_by_rounding():
    bare()[1].control("bank", bounds=(-math.pi, math.pi), period=math.tau)
    bare()[1].control("bank", bounds=(0.1, 0.3), period=0.2)


@pytest.mark.parametrize(
    "limits", [{}, {"lower": 2, "upper": 1}, {"lower": NAN}, {"upper": "3"}, {"upper": INF}, {"lower": ca.MX.sym("q")}], ids=str
)
def test_bad_limits_are_refused(limits):
    problem, phase = glider()
    refused(lambda: phase.path("load", phase["flap"], **limits), "load", "descent")
    refused(lambda: problem.constraint("fuel", phase.tf, **limits), "fuel", "glider")


# Names


@pytest.mark.parametrize("name", ["", " ", None, 3, ca.MX.sym("x")], ids=str)
def test_names_are_words(name):
    problem, phase = glider()
    refused(lambda: Problem(name))
    refused(lambda: problem.phase(name, t0=0, tf=1), "glider")
    refused(lambda: problem.parameter(name, bounds=(0, 1)), "glider")
    refused(lambda: problem.minimize(name, phase.tf), "glider")
    refused(lambda: problem.constraint(name, phase.tf, upper=1), "glider")
    refused(lambda: phase.state(name, bounds=(0, 1)), "descent")
    refused(lambda: phase.control(name, bounds=(0, 1)), "descent")
    refused(lambda: phase.path(name, phase["flap"], upper=1), "descent")


@pytest.mark.parametrize(("text", "wrong"), [("a\0b", "NUL"), ("a\ud800b", "surrogate")])
def test_names_and_units_are_texts_that_a_file_can_hold(text, wrong):
    problem, phase = glider()
    refused(lambda: Problem(text), wrong)
    refused(lambda: problem.phase(text, t0=0, tf=1), "glider", wrong)
    refused(lambda: problem.phase("landing", t0=0, tf=1, time_unit=text), "landing", wrong)
    refused(lambda: phase.path(text, phase["flap"], upper=1), "descent", wrong)
    for name, unit, words in ((text, "", ("name",)), ("new", text, ("unit", "new"))):
        refused(lambda name=name, unit=unit: problem.parameter(name, bounds=(0, 1), unit=unit), "glider", wrong, *words)
        refused(lambda name=name, unit=unit: problem.minimize(name, phase.tf, unit=unit), "glider", wrong, *words)
        refused(lambda name=name, unit=unit: phase.state(name, bounds=(0, 1), unit=unit), "descent", wrong, *words)
        refused(lambda name=name, unit=unit: phase.control(name, bounds=(0, 1), unit=unit), "descent", wrong, *words)


@pytest.mark.parametrize("name", ["height", "flap", "load", "time", "t0", "tf"])
def test_a_phase_uses_a_name_once(name):
    _, phase = glider()
    phase.path("load", phase["flap"], upper=1)
    refused(lambda: phase.state(name, bounds=(0, 1)), name, "descent", "twice")
    refused(lambda: phase.control(name, bounds=(0, 1)), name, "descent", "twice")
    refused(lambda: phase.path(name, phase["flap"], upper=1), name, "descent", "twice")


def test_a_problem_uses_a_name_once_in_each_kind():
    problem, phase = glider()
    problem.parameter("mass", bounds=(0, 1))
    problem.constraint("fuel", phase.tf, upper=9)
    refused(lambda: problem.phase("descent", t0=0, tf=1), "descent", "twice")
    refused(lambda: problem.parameter("mass", bounds=(0, 1)), "mass", "twice")
    refused(lambda: problem.constraint("fuel", phase.tf, upper=1), "fuel", "twice")
    refused(lambda: problem.minimize("time", phase.tf), "time", "twice")
    refused(lambda: problem.maximize("time", phase.tf), "time", "twice")
    # Kinds do not disturb each other, and neither do phases.
    problem.minimize("fuel", phase.tf)
    problem.constraint("descent", phase.tf, upper=9)
    problem.phase("landing", t0=0, tf=1).state("height", bounds=(0, 1))


def test_what_was_refused_leaves_nothing_behind():
    problem, phase = glider()
    before = problem.compile().fingerprint
    for action in (
        lambda: problem.phase("landing", t0=2, tf=NAN),
        lambda: problem.parameter("mass", bounds=(1, 0)),
        lambda: problem.constraint("fuel", ca.MX.sym("q"), upper=1),
        lambda: problem.minimize("cost", ca.MX.sym("q")),
        lambda: phase.state("speed", bounds=(1, 0)),
        lambda: phase.state("speed", bounds=(0, 1), final=2),
        lambda: phase.path("load", ca.MX.sym("q"), upper=1),
        lambda: phase.integral(ca.MX.sym("q")),
    ):
        refused(action)
    assert problem.compile().fingerprint == before


# Afterwards


def test_what_was_stated_can_be_read_back():
    problem, phase = glider()
    mass = problem.parameter("mass", bounds=(0, 1))
    gain = phase.final(phase["height"] * 2)
    problem.maximize("gain", gain, unit="m")
    assert problem.name == "glider"
    assert problem.phases["descent"] is phase and list(problem.phases) == ["descent"]
    assert problem.parameters["mass"] is mass
    assert problem.objectives["gain"] is gain
    assert phase.name == "descent"
    assert phase["height"].name() == "height" and phase["flap"].name() == "flap"
    assert all(ca.MX.is_symbolic(symbol) for symbol in (phase.time, phase.t0, phase.tf))
    assert glider(t0=3, tf=4)[1].t0.is_symbolic(), "a fixed time is a symbol, too"
    with pytest.raises(KeyError, match=r"speed.*height"):
        phase["speed"]
    with pytest.raises(TypeError):
        problem.phases["other"] = phase
    assert "descent" in repr(problem) and "height" in repr(phase)


def test_signs_are_those_of_the_senses():
    problem, phase = glider()
    problem.maximize("late", phase.tf, unit="s")
    compiled = problem.compile()
    assert compiled.signs.tolist() == [1, -1]
    assert np.array(compiled.objectives([0, 1.5], [])).ravel().tolist() == [1.5, -1.5]
    assert [(goal.name, goal.sense, goal.unit) for goal in compiled.goals] == [("time", "minimize", ""), ("late", "maximize", "s")]


def test_limits_have_units_which_are_labels():
    """They change no fingerprint: fronts from before limits had units still belong to their problems."""

    def limited(**units):
        problem, phase = glider()
        phase.path("load", phase["flap"], upper=3, **units)
        problem.constraint("fuel", phase.tf, upper=5, **units)
        return problem.compile()

    with_units, without = limited(unit="kN"), limited()
    assert [one.unit for one in (*with_units.phases[0].paths, *with_units.limits)] == ["kN", "kN"]
    assert [one.unit for one in (*without.phases[0].paths, *without.limits)] == ["", ""]
    assert with_units.fingerprint == without.fingerprint
    problem, phase = glider()
    refused(lambda: phase.path("load", phase["flap"], upper=1, unit=3), "load", "unit", "string")
    refused(lambda: problem.constraint("fuel", phase.tf, upper=1, unit="a\0b"), "fuel", "unit", "NUL")


def test_default_scales_are_spans():
    problem, phase = glider()
    phase.path("load", phase["flap"], lower=-2, upper=3)
    phase.path("lift", phase["flap"], lower=-2)
    phase.path("heat", phase["flap"] * 1e6, upper=3e6)
    phase.path("trim", phase["flap"], lower=1, upper=1)
    phase.state("speed", bounds=(-4, 4), scale=100)
    phase._rates |= {"speed": ca.MX(0)}
    problem.constraint("fuel", phase.tf, lower=0, upper=5)
    problem.constraint("exact", phase.tf, lower=2, upper=2, scale=9)
    compiled = problem.compile()
    assert [v.scale for v in compiled.phases[0].states] == [10, 100]
    assert [v.scale for v in compiled.phases[0].paths] == [5, 1, 3000, 1]
    assert [v.scale for v in compiled.limits] == [5, 9]


def test_names_may_hold_spaces_and_any_letters():
    problem = Problem("Höhe über Grund")
    phase = problem.phase("Phase α", t0=0, tf=1)
    x = phase.state("h [km]", bounds=(0, 1))
    u = phase.control("δ*", bounds=(0, 1))
    phase.dynamics(**{"h [km]": u})
    phase.path("q̇ ≤ 1", x, upper=1)
    problem.minimize("Δ v'\"", phase.final(x))
    assert problem.compile().fingerprint


def test_bounds_that_rounding_cannot_tell_apart_are_one_value():
    def pair(value):
        return value, math.nextafter(value, INF)

    problem, phase = glider(tf=pair(3.0))
    refused(lambda: phase.state("speed", bounds=pair(5.0)), "speed", "one value only")
    phase.control("trim", bounds=pair(0.1))
    problem.parameter("mass", bounds=pair(7.0))
    phase.path("load", phase["flap"], lower=pair(0.5)[0], upper=pair(0.5)[1])
    problem.constraint("fuel", phase.tf, lower=3.0, upper=math.nextafter(3.0, INF))
    compiled = problem.compile()
    (own,) = compiled.phases
    ranges = [own.tf, next(v for v in own.controls if v.name == "trim"), compiled.parameters[-1], own.paths[-1], compiled.limits[-1]]
    assert [(one.lower, one.scale) for one in ranges] == [(3.0, 1.0), (0.1, 1.0), (7.0, 1.0), (0.5, 1.0), (3.0, 1.0)]
    assert all(one.lower == one.upper for one in ranges)


def test_times_that_durations_narrow_to_one_value_are_fixed():
    """Within (0.3, 5), a start at 0.1 and a duration of 0.2 leave 0.1 + 0.2 alone, which is more than 0.3 by rounding."""
    problem, _ = glider(t0=0.1, tf=(0.3, 5), duration=(0.2, math.nextafter(0.2, INF)))
    (own,) = problem.compile().phases
    assert own.tf.lower == own.tf.upper and own.tf.scale == 1.0
