"""Statements: what is refused, by the user's own names, and what is read back."""

import itertools
import math

import casadi as ca
import numpy as np
import pytest
from statements import INF, NAN, bare, glider, refused

from problems import Phase, Problem

BAD_BOUNDS = [(1, 0), (0, INF), (NAN, 1), (0, None), None, 3, (0, 1, 2), ("0", "1"), (0, 1j), (0, 10**400), (0, ca.MX.sym("q")), {"a": 1}]
BAD_GUESSES = [
    NAN,
    "5",
    None,
    (1, 2, 3),
    ([0, 1], [1]),
    ([0], [1]),
    ([1, 0], [1, 2]),
    ([0, 1], [1, NAN]),
    ([0, 1], ["a", "b"]),
    (1, [2, 3]),
    {},
]
MISTAKES = [
    *[(lambda p, f, b=b: f.state("speed", bounds=b), ("speed", "descent")) for b in [*BAD_BOUNDS, (2, 2)]],
    *[(lambda p, f, b=b: f.control("brake", bounds=b), ("brake", "descent")) for b in BAD_BOUNDS],
    *[(lambda p, f, b=b: p.parameter("mass", bounds=b), ("mass", "glider")) for b in BAD_BOUNDS],
    *[(lambda p, f, v=v: f.state("speed", bounds=(0, 10), initial=v), ("speed", "initial")) for v in (11, (0, 11), NAN, (6, 5), "5")],
    *[(lambda p, f, v=v: f.state("speed", bounds=(0, 10), final=v), ("speed", "final")) for v in (11, (0, 11), NAN, (6, 5), "5")],
    *[(lambda p, f, s=s: f.state("speed", bounds=(0, 1), scale=s), ("speed",)) for s in (0, -1, NAN, "1")],
    *[(lambda p, f, s=s: f.path("load", f["flap"], upper=1, scale=s), ("load",)) for s in (0, NAN)],
    *[(lambda p, f, s=s: p.parameter("mass", bounds=(0, 1), scale=s), ("mass",)) for s in (0, NAN)],
    *[(lambda p, f, s=s: p.minimize("cost", f.tf, scale=s), ("cost",)) for s in (0, NAN)],
    *[(lambda p, f, w=w: f.control("bank", bounds=(-1, 1), period=w), ("bank",)) for w in (0, 3, NAN, "2")],
    *[(lambda p, f, w=w: p.phase("late", t0=0, tf=w), ("late", "tf")) for w in (INF, (0, INF), None, "5", [1])],
    *[(lambda p, f, w=w: p.phase("late", t0=w, tf=1), ("late", "t0")) for w in (NAN, (2, 1))],
    *[(lambda p, f, w=w: p.phase("late", t0=0, tf=(1, 2), duration=w), ("late", "duration")) for w in (-1, 0, (-1, 2), (2, 1), INF)],
    *[
        (lambda p, f, w=w: f.path("load", f["flap"], **w), ("load", "descent"))
        for w in ({}, {"lower": 2, "upper": 1}, {"lower": NAN}, {"upper": "3"}, {"lower": ca.MX.sym("q")})
    ],
    *[(lambda p, f, w=w: p.constraint("fuel", f.tf, **w), ("fuel", "glider")) for w in ({}, {"upper": INF})],
    # Names are words, which are used once, and texts that a file can hold, as units are.
    *[(lambda p, f, n=n: Problem(n), ("name",)) for n in ("", " ", None, 3, "a\0b", "a\ud800b")],
    *[(lambda p, f, n=n: p.phase(n, t0=0, tf=1), ("glider",)) for n in ("", None, "a\0b", "descent")],
    *[(lambda p, f, n=n: p.parameter(n, bounds=(0, 1)), ("glider",)) for n in ("", None, "a\ud800b", "wind")],
    *[(lambda p, f, n=n: p.maximize(n, f.tf), ("glider",)) for n in ("", None, "a\0b", "time")],
    *[(lambda p, f, n=n: f.state(n, bounds=(0, 1)), ("descent",)) for n in ("", None, "a\0b", "height", "flap", "lift", "time", "t0")],
    *[(lambda p, f, n=n: f.path(n, f["flap"], upper=1), ("descent",)) for n in (" ", 3, "a\0b", "height", "flap", "lift", "tf")],
    *[(lambda p, f, u=u: p.parameter("mass", bounds=(0, 1), unit=u), ("mass", "unit")) for u in ("a\0b", "a\ud800b", 3)],
    *[(lambda p, f, u=u: f.control("brake", bounds=(0, 1), unit=u), ("brake", "unit")) for u in ("a\0b", 3)],
    (lambda p, f: p.phase("landing", t0=0, tf=1, time_unit="a\0b"), ("landing", "NUL")),
    *[(lambda p, f, g=g: f.guess(height=g), ("height", "descent", "guess")) for g in [*BAD_GUESSES, 11, (5, -1)]],
    *[(lambda p, f, g=g: f.guess(tf=g), ("tf", "descent")) for g in (3, (1, 2))],
    (lambda p, f: f.guess(flap=([0, 1], [0, 2])), ("flap", "descent")),
    (lambda p, f: f.guess(speed=1), ("speed", "descent", "height")),
    (lambda p, f: p.guess(weight=1), ("weight", "glider", "wind")),
    *[(lambda p, f, g=g: p.guess(wind=g), ("wind", "glider", word)) for g, word in ((NAN, "finite"), (3, "(0, 1)"))],
]


@pytest.mark.parametrize(("mistake", "words"), MISTAKES, ids=[f"{i}-{words[0]}" for i, (_, words) in enumerate(MISTAKES)])
def test_mistakes_are_refused_by_the_users_own_names(mistake, words):
    problem, phase = glider()
    problem.parameter("wind", bounds=(0, 1))
    phase.path("lift", phase["flap"], upper=1)
    refused(lambda: mistake(problem, phase), *words)


@pytest.mark.parametrize("bounds", [[0, 1], np.array([0, 1]), (np.float32(0), np.int64(1)), (ca.DM(0), ca.DM(1)), (ca.MX(0), 1)], ids=str)
def test_numbers_of_every_kind_are_bounds(bounds):
    problem, phase = glider()
    phase.state("speed", bounds=bounds, initial=bounds[0], final=bounds)
    phase._rates |= {"speed": ca.MX(0)}
    (own,) = problem.compile().phases
    assert (own.states[1].lower, own.states[1].upper) == own.final[1] == (0.0, 1.0) and own.initial[1] == (0.0, 0.0)


@pytest.mark.parametrize(
    ("times", "word"),
    [
        ({"tf": 0}, "descent"),
        ({"t0": 3}, "descent"),
        ({"t0": (2, 3), "tf": (0, 2)}, "descent"),
        ({"duration": 3}, "duration"),
        ({"duration": (2.5, 3)}, "duration"),
        ({"duration": (0.1, 0.5)}, "duration"),
    ],
    ids=str,
)
def test_a_phase_must_last_as_long_as_it_says(times, word):
    refused(lambda: glider(**times)[0].compile(), "descent", word)


def test_names_of_one_kind_do_not_disturb_another():
    problem, phase = glider()
    problem.constraint("fuel", phase.tf, upper=9)
    refused(lambda: problem.constraint("fuel", phase.tf, upper=1), "fuel", "twice")
    problem.minimize("fuel", phase.tf)
    problem.constraint("descent", phase.tf, upper=9)
    problem.phase("landing", t0=0, tf=1).state("height", bounds=(0, 1))
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


def test_what_was_stated_can_be_read_back():
    problem, phase = glider()
    mass = problem.parameter("mass", bounds=(0, 1))
    gain = phase.final(phase["height"] * 2)
    problem.maximize("gain", gain, unit="m")
    assert problem.name == "glider"
    assert problem.phases["descent"] is phase and list(problem.phases) == ["descent"]
    assert problem.parameters["mass"] is mass and problem.objectives["gain"] is gain
    assert phase.name == "descent"
    assert phase["height"].name() == "height" and phase["flap"].name() == "flap"
    assert all(ca.MX.is_symbolic(symbol) for symbol in (phase.time, phase.t0, phase.tf))
    assert glider(t0=3, tf=4)[1].t0.is_symbolic(), "a fixed time is a symbol, too"
    with pytest.raises(KeyError, match=r"speed.*height"):
        phase["speed"]
    with pytest.raises(TypeError):
        problem.phases["other"] = phase
    assert "descent" in repr(problem) and "height" in repr(phase)
    problem, phase = glider()
    problem.maximize("late", phase.tf, unit="s")
    compiled = problem.compile()
    assert compiled.signs.tolist() == [1, -1]
    assert np.array(compiled.objectives([0, 1.5], [])).ravel().tolist() == [1.5, -1.5]
    assert [(goal.name, goal.sense, goal.unit) for goal in compiled.goals] == [("time", "minimize", ""), ("late", "maximize", "s")]
    problem, phase = glider()
    problem.parameter("mass", bounds=(1, 2))
    phase.guess(height=(0, 10), flap=1, tf=2, t0=0)
    problem.guess(mass=1)
    compiled = problem.compile()
    assert compiled.guesses == {"mass": 1.0} and compiled.phases[0].guesses == {"height": (0.0, 10.0), "flap": 1.0, "tf": 2.0, "t0": 0.0}


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


def test_links_take_phases_and_states_of_this_problem_without_circles_or_jumps():
    problem, legs = relay()
    _, stranger = glider()
    for pair in ((legs[0], stranger), (stranger, legs[0]), ("leg 0", legs[1]), (legs[0], None)):
        refused(lambda pair=pair: problem.link(*pair), "relay", "link")
    problem, legs = relay()
    refused(lambda: problem.link(legs[0], legs[1], states=["own 0"]), "own 0", "leg 0", "leg 1")
    refused(lambda: problem.link(legs[0], legs[1], states="y"), "y", "leg 0", "leg 1")
    problem.link(legs[0], legs[1], states="x")
    problem.link(legs[1], legs[2], states=())
    assert [link.states for link in problem.compile().links] == [("x",), ()]
    problem, legs = relay()
    refused(lambda: problem.link(legs[0], legs[0]), "leg 0")
    problem.link(legs[0], legs[1])
    refused(lambda: problem.link(legs[0], legs[1]), "leg 0", "leg 1", "twice")
    refused(lambda: problem.link(legs[1], legs[0]), "leg 0", "leg 1", "circle")
    problem.link(legs[1], legs[2])
    refused(lambda: problem.link(legs[2], legs[0]), "leg 2", "leg 0", "circle")
    problem = Problem("relay")
    first, second = problem.phase("up", t0=0, tf=1), problem.phase("down", t0=1, tf=2)
    problem.link(first, second)
    for phase in (first, second):
        phase.state("x", bounds=(0, 1))
        phase.dynamics(x=1)
    problem.minimize("time", second.tf)
    assert problem.compile().links[0].states == ("x",)
    problem, legs = relay()
    problem.link(legs[0], legs[1])
    problem.constraint("drop", legs[0].final(legs[0]["x"]) - legs[1].initial(legs[1]["x"]), lower=2.0)
    refused(problem.compile, "drop", "link", "at least 2")
    problem, legs = relay()
    problem.link(legs[0], legs[1], states=[])
    problem.constraint("drop", legs[0].final(legs[0]["x"]) - legs[1].initial(legs[1]["x"]), lower=2.0)
    problem.constraint("as before", legs[0].final(legs[0]["x"]) - legs[0].final(legs[0]["x"]), upper=0.0)
    problem.compile()
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


def test_a_problem_needs_a_phase_an_objective_and_states_each_with_a_rate():
    _, phase = bare()
    phase.state("height", bounds=(0, 1))
    phase.state("speed", bounds=(0, 1))
    refused(lambda: phase.dynamics(height=1), "descent", "[height]", "[height, speed]")
    refused(lambda: phase.dynamics(height=1, speed=1, mass=1), "descent", "mass")
    phase.dynamics(speed=1, height=2)
    refused(lambda: phase.dynamics(height=1, speed=1), "descent", "twice")
    problem, phase = glider()
    phase.state("speed", bounds=(0, 1))
    refused(problem.compile, "descent", "speed")
    problem, phase = bare()
    phase.state("height", bounds=(0, 1))
    problem.minimize("time", phase.tf)
    refused(problem.compile, "descent", "height")
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


def test_raw_states_controls_and_time_are_refused_in_objectives_and_constraints():
    problem, phase = glider()
    for symbol, name in ((phase["height"], "height"), (phase["flap"], "flap"), (phase.time, "time of descent")):
        refused(lambda s=symbol: problem.minimize("cost", phase.tf + s), name, "cost", "final(...)")
        refused(lambda s=symbol: problem.constraint("fuel", s, upper=1), name, "fuel", "final(...)")
    _, phase = glider()
    for kind in ("initial", "final", "integral", "peak"):
        quantity = getattr(phase, kind)(phase["height"])
        refused(lambda q=quantity: phase.path("load", q - phase["height"], upper=1), f"{kind}(height)", "load")
        refused(lambda q=quantity: phase.integral(q * phase.time), f"{kind}(height)", "integral")
        refused(lambda q=quantity: bare_dynamics(q), f"{kind}(height)")


@pytest.mark.parametrize("value", [None, "1", NAN, ca.MX(1) / 0, [1], ca.MX.sym("v", 2), ca.MX(0, 0), ca.SX.sym("s"), np.ones(2)], ids=str)
def test_expressions_are_scalars_and_numbers(value):
    problem, phase = glider()
    refused(lambda: phase.path("load", value, upper=1), "load")
    refused(lambda: phase.final(value), "final", "descent")
    refused(lambda: problem.minimize("cost", value), "cost")
    refused(lambda: problem.constraint("fuel", value, upper=1), "fuel")
    refused(lambda: bare_dynamics(value), "height")


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


@pytest.mark.parametrize(
    "rate", [lambda f, x: 1 / (f.tf - f.time), lambda f, x: 1 / f.time, lambda f, x: ca.sqrt(x - 0.9), lambda f, x: 1 / x]
)
def test_rates_that_are_numbers_somewhere_are_welcome(rate):
    problem, phase = bare()
    x = phase.state("height", bounds=(0, 1), initial=0)
    phase.dynamics(height=rate(phase, x))
    problem.minimize("time", phase.final(x))
    problem.compile()


@pytest.mark.parametrize("value", [lambda phase, x: 0 * x + 3, lambda phase, x: phase.final(3.0) + 1, lambda phase, x: phase.peak(x - x)])
def test_an_objective_that_is_a_constant_is_refused_alone_too(value):
    problem, phase = bare()
    x = phase.state("height", bounds=(0, 1))
    phase.dynamics(height=np.float64(1))
    problem.minimize("nothing", value(phase, x))
    refused(problem.compile, "objective 'nothing'", "is a constant")


@pytest.mark.parametrize("compare", [lambda x: x <= 3, lambda x: -(x == 3), lambda x: ca.logic_or(x <= 3, x > 4), lambda x: True])
def test_a_comparison_is_no_expression(compare):
    problem, phase = bare()
    x = phase.state("x", bounds=(0, 1))
    refused(lambda: phase.path("sum", compare(x), upper=0), "path 'sum' of phase", "is a comparison", "upper=")
    refused(lambda: phase.dynamics(x=compare(x)), "the rate of 'x'", "is a comparison")
    refused(lambda: phase.final(compare(x)), "final(...)", "is a comparison")
    refused(lambda: problem.constraint("c", compare(phase.tf), upper=0), "constraint 'c'", "is a comparison")
    refused(lambda: problem.minimize("f", compare(phase.tf)), "objective 'f'", "is a comparison")
    phase.dynamics(x=ca.if_else(x <= 0.5, 1, 0))


def test_a_problem_with_some_of_its_objectives_needs_nothing_of_the_others():
    problem, phase = bare()
    x, u = phase.state("x", bounds=(0, 1)), phase.control("u", bounds=(-1, 1))
    phase.dynamics(x=u)
    problem.minimize("end", phase.final(x))
    problem.minimize("top", phase.peak(x))
    problem.maximize("effort", phase.integral(u**2), unit="N")
    problem.constraint("area", phase.integral(x), upper=1)
    two, all_three = problem.with_objectives("effort", "end").compile(), problem.compile()
    assert [goal.name for goal in two.goals] == ["effort", "end"] and two.goals[0] == all_three.goals[2]
    assert two.phases[0].peaks.size1_out(0) == 0 and all_three.phases[0].peaks.size1_out(0) == 1
    # t0, tf, final x, integrals of u**2 and x.
    q = [0.0, 1.0, 0.25, 7.0, 0.5]
    assert np.array(two.objectives(q, [])).ravel().tolist() == [-7.0, 0.25] and float(two.constraints(q, [])) == 0.5
    refused(lambda: problem.with_objectives("end", "efort"), "unknown objective 'efort', did you mean effort?")
