"""Starts of gradient solves: of what kinds they are, when there are enough, and that the best of many valleys is found."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from macs import optimize, payoff
from macs.gradients.multistart import MULTISTART, MultistartSolver, MultistartStopping, Starts, is_least
from macs.gradients.scalarised import GradientSolves, Scalarised
from problems import Problem, load
from transcription import DFET
from transcription.nlp.derivatives import convex_objectives
from transcription.nlp.scalarized import Solved


def wells(depths: list[float], width: float = 0.02) -> Problem:
    """A parameter with a valley at each of the places between 0 and 1, as deep as stated, and a shallow bowl for a gradient elsewhere;
    the second objective has its only optimum at 0."""
    problem = Problem("wells")
    p = problem.parameter("p", bounds=(0, 1))
    places = (np.arange(len(depths)) + 0.5) / len(depths)
    problem.minimize("height", -sum(d * ca.exp(-(((p - c) / width) ** 2)) for d, c in zip(depths, places, strict=True)) + (p - 0.5) ** 2)
    problem.minimize("place", p)
    phase = problem.phase("phase", t0=0.0, tf=1.0)
    x = phase.state("x", bounds=(-1, 1), initial=0)
    phase.dynamics(x=0 * x)
    return problem


def after(losses: list[float | None]) -> MultistartStopping:
    rule = MultistartStopping()
    for loss in losses:
        rule.add(loss)
    return rule


@pytest.mark.parametrize(
    ("losses", "last"),
    [
        # With w optima the next start finds a better one with probability w / (k (k - 1)): .0024 for w = 1 and k = 21, or 2 and 29.
        ([1.0] * 20, 1.0),
        ([1.0, 2.0] * 14, 1.0),
        ([1.0, *[2.0] * 34], 2.0),  # that of any other one counts half where the best was found once: 3 / (k (k - 1)) for k = 36
        ([None] * (MULTISTART.fewest - 1), None),
        ([float(-k) for k in range(MULTISTART.many[1] - 1)], -200.0),  # all better than those before
        ([-100.0, *map(float, range(MULTISTART.many[0] - 2))], -3.0),  # many, and nothing better since the first
    ],
)
def test_when_starts_are_enough(losses, last):
    rule = after(losses)
    assert not rule.enough
    rule.add(last)
    assert rule.enough


def test_optima_near_zero_that_differ_by_the_accuracy_of_solves_are_one():
    """A miss that is none: each start leaves another rounding error of it."""
    problem = bounded(miss=lambda p, tf, x: (x - 0.5) ** 2 + (p - 0.3) ** 4)
    stats = optimize(problem, DFET(2, 2)).alone().stats
    assert stats["optima"] == 1 and stats["starts"] == stats["found"] == 21


@pytest.mark.parametrize(
    ("losses", "once"), [([1.0], False), ([1.0, 2.0], True), ([1.0, 2.0, 1.0], False), ([1.0, 1.0, 0.5], True), ([], False)]
)
def test_the_best_of_several_that_was_found_once(losses, once):
    assert after(losses).found_once == once


def test_starts_are_sought_longer_where_the_best_of_several_was_found_once(monkeypatch):
    """Made-up results of one unit of work each: losses that never repeat, or always do."""
    nlp = DFET(1, 1).transcribe(wells([1.0] * 3))
    counted = []
    for losses in (iter(np.arange(-1.0, -99.0, -1.0)), iter([-1.0] * 99)):
        solver = MultistartSolver(nlp, None, None, np.random.default_rng(0), GradientSolves(1e-6))

        def drawn(tasks, known=(), losses=losses, solver=solver):
            solver.solves.counts.work += len(tasks)
            return [Solved(nlp.lower, np.array([next(losses), 0.0]), 0.0, "converged", 1) for _ in tasks]

        monkeypatch.setattr(solver, "from_draws", drawn)
        rule = MultistartStopping()
        (best,) = drawn([None])
        rule.add(best.F[0])
        counted.append(len(solver.drawn(best, Scalarised.single(0, 2), rule, 10.0)[1]))
    assert counted == [10 * MULTISTART.last, 10]


def test_solves_for_times_at_their_bounds():
    """The cost of a linear drive falls with the time, but for a plateau: a solve from there ends on it."""
    problem = Problem("plateau")
    drive = problem.phase("drive", t0=0.0, tf=(1.0, 3.0))
    x = drive.state("x", bounds=(-4, 4), initial=0, final=1)
    drive.dynamics(x=drive.control("u", bounds=(-4, 4)) + 0.0 * x)
    problem.minimize("cost", -((drive.tf - 2.0) ** 3))
    solver = MultistartSolver(DFET(1, 1).nlp(problem), None, 1, np.random.default_rng(0), GradientSolves(1e-6))
    nlp, task = solver.nlp, Scalarised.single(0, 1)
    (column,) = nlp.times
    assert nlp.variables[column].name == "drive.tf"
    start = nlp.first_guess(0.5 * (nlp.lower + nlp.upper)[nlp.free][None])[0]
    held = solver.solves(nlp, start, Scalarised(task.reference, task.weights, held={column: start[column]}))
    assert held.status == "converged" and held.z[column] == 2.0
    assert solver.from_times(start, task, [nlp.upper[nlp.times]])[0].F[0] == pytest.approx(-1.0, abs=1e-6)


def swing(tf: tuple[float, float] | float = (1.0, 20.0), cubic: float = 0.0, t0: tuple[float, float] | float = 0.0, **others) -> Problem:
    """Two masses on springs brought to rest: time and effort, and other objectives of the phase; with a spring that is not linear, if asked
    for."""
    problem = Problem("swing")
    phase = problem.phase("phase", t0=t0, tf=tf)
    x, y, v, w = (phase.state(name, bounds=(-5, 5), initial=float(name == "x"), final=0) for name in "xyvw")
    u = phase.control("u", bounds=(-1, 1))
    phase.dynamics(x=v, y=w, v=y - x + cubic * x**3, w=x - y + u)
    problem.minimize("time", phase.tf)
    problem.minimize("effort", phase.integral(u**2))
    for name, objective in others.items():
        problem.minimize(name, objective(phase))
    return problem


def test_which_objectives_are_convex_for_a_given_time():
    """A concave one is not, one that is not quadratic, and one with a kink; nor any where rates are not linear, two times are free, or
    where a place in a narrow valley is chosen."""
    others = {
        "concave": lambda phase: -phase.integral(phase["u"] ** 2),
        "steep": lambda phase: phase.integral(phase["u"] ** 4),
        "kinked": lambda phase: -phase.integral(ca.fabs(phase["u"])),
    }
    assert convex_objectives(DFET(4, 3).nlp(swing(**others))).tolist() == [True, True, False, False, False]
    assert convex_objectives(DFET(4, 3).nlp(swing(t0=(0.0, 0.5)))).tolist() == [False] * 2
    assert convex_objectives(DFET(4, 3).nlp(swing(cubic=0.1))).tolist() == [False] * 2
    assert convex_objectives(DFET(1, 1).nlp(wells([1.0] * 3))).tolist() == [False, True]


def test_optima_for_several_times_take_the_place_of_other_starts():
    """Effort falls with time, on steps where it hardly depends on it: solves stay on these; that for the longest time is the least."""
    front = payoff(swing(), DFET(10, 3), seed=1)
    assert front.stats["starts"]["effort"] == 1 and "one start" not in front.message
    longest = optimize(swing(tf=20.0), DFET(10, 3), objective="effort")
    assert front.objectives[:, 1].min() == pytest.approx(longest.objectives["effort"], rel=1e-6)


def test_where_the_least_for_a_time_does_not_fall_with_it_other_starts_are_made():
    """To be at a place in mid-swing: it takes no effort each time an oscillator comes by, and more in between."""
    problem = Problem("catch")
    phase = problem.phase("phase", t0=0.0, tf=(1.0, 20.0))
    x, v = phase.state("x", bounds=(-5, 5), initial=1, final=0), phase.state("v", bounds=(-5, 5), initial=0, final=1)
    u = phase.control("u", bounds=(-1, 1))
    phase.dynamics(x=v, v=u - 4 * x)
    problem.minimize("effort", phase.integral(u**2))
    point = optimize(problem, DFET(20, 3), seed=1)
    assert point.alone().stats["starts"] > 1 and point.alone().stats["optima"] > 1


@pytest.mark.slow
@given(st.lists(st.sampled_from([1.0, 2.0, 5.0, None]), min_size=1, max_size=40), st.floats(-8e-6, 8e-6))
def test_counts_of_starts(losses, noise):
    rule = after([None if loss is None else loss * (1.0 + noise * (k % 2)) for k, loss in enumerate(losses)])
    known = [loss for loss in losses if loss is not None]
    assert rule.starts == len(losses) and rule.converged == len(known)
    assert rule.optima() == len(set(known)) and (known or rule.hits() == 0)
    assert rule.hits() == (known.count(min(known)) if known else 0)


def test_starts_are_near_the_best_or_anywhere():
    nlp = DFET(6, 4).transcribe(load("goddard"))
    starts, best = Starts(nlp, np.random.default_rng(0)), nlp.first_guess(nlp.lower[nlp.free][None] + 0.5 * nlp.span[nlp.free])[0]
    drawn = np.array([starts.draw(best)[0] for _ in range(MULTISTART.everywhere + 20)])
    free = (drawn - best)[:, nlp.free] / nlp.span[nlp.free]
    assert (drawn[:, nlp.free] >= nlp.lower[nlp.free]).all() and (drawn[:, nlp.free] <= nlp.upper[nlp.free]).all()
    deviation = np.sqrt((free**2).mean(axis=1))
    near, anywhere = deviation[MULTISTART.everywhere + 1 :: 2], deviation[MULTISTART.everywhere :: 2]
    assert np.median(near) < 0.5 * np.median(anywhere) and near.min() < 0.05
    again = Starts(nlp, np.random.default_rng(0))
    assert np.array_equal([again.draw(best)[0] for _ in range(MULTISTART.everywhere + 20)], drawn)


@pytest.mark.slow
@pytest.mark.parametrize("deepest", [0, 3])
def test_the_deepest_of_eight_wells_is_found(deepest):
    depths = [1.0 + (2.0 if k == deepest else 0.1 * (k % 3)) for k in range(8)]
    point = optimize(wells(depths), DFET(1, 1))
    assert point.parameters["p"] == pytest.approx((deepest + 0.5) / 8, abs=1e-2)
    stats = point.stats
    assert stats["starts"] > stats["optima"] >= 3 and stats["found"] >= 1


@pytest.mark.slow
def test_what_only_one_start_found_is_said():
    """A narrow deep well beside a wide one: how often it was found is in the message, exactly where it was once."""
    seen = set()
    for seed in (0, 3):
        front = payoff(wells([1.0, 3.0, 1.0, 1.0], width=0.004), DFET(1, 1), seed=seed)
        once = front.stats["found"]["height"] == 1
        assert once == ("one start alone found" in front.message and "'height'" in front.message)
        assert front.stats["starts"]["height"] >= front.stats["optima"]["height"] >= 1
        seen.add(once)
    assert seen == {True, False}


@pytest.mark.parametrize("method", [None, DFET(1, 1)])
def test_an_optimum_says_so_too(method):
    for depths in ([1.0, 3.0, 1.0, 1.0], [3.0]):
        point = optimize(wells(depths, width=0.004 if len(depths) > 1 else 1.0), method, objective="height")
        assert ("one start alone found" in point.message) == (point.stats["found"] == 1 < point.stats["starts"])
    assert not point.message


@pytest.mark.slow
def test_a_front_to_start_from_is_never_made_worse():
    """A first solve from a good point may leave its well; the point itself then counts."""
    depths = [1.0, 1.1, 3.0, 1.2, 1.0, 1.3, 1.1, 1.0]
    problem = wells(depths).compile()
    best = payoff(problem, DFET(1, 1))
    again = payoff(problem, DFET(1, 1), start=best, starts=1)
    assert again.F[0, 0] <= best.F[0, 0] + 1e-9 and again.F[1, 1] <= best.F[1, 1] + 1e-9


def bounded(**objectives) -> Problem:
    """Objectives of a parameter in [0, 1], of the duration, which is free in [1, 3], and of where x ends, by names."""
    problem = Problem("bounded")
    p = problem.parameter("p", bounds=(0, 1))
    phase = problem.phase("phase", t0=0.0, tf=(1.0, 3.0))
    x = phase.state("x", bounds=(-4, 4), initial=0)
    phase.dynamics(x=phase.control("u", bounds=(-1, 1)))
    for name, of in objectives.items():
        problem.minimize(name, of(p, phase.tf, phase.final(x)))
    return problem


def test_where_bounds_allow_no_less_no_other_start_is_made():
    """As one objective of two, whose end keeps it and has the least of the other, and alone. Bounds of x would allow less than there is."""
    both = bounded(duration=lambda p, tf, x: 2 * tf - p, reach=lambda p, tf, x: x - 0.1 * x**2)
    front = payoff(both, DFET(2, 2))
    assert front.stats["starts"]["duration"] == 1 < front.stats["starts"]["reach"]
    assert pytest.approx(np.array([[1.0, -1.1], [5.0, -3.9]]), abs=1e-6) == front.F
    point = optimize(both, DFET(2, 2), objective="duration")
    assert point.alone().stats["starts"] == 1 and point.F[0] == pytest.approx(1.0, abs=1e-6)
    alone = optimize(bounded(duration=lambda p, tf, x: 2 * tf - p))
    assert alone.alone().stats["starts"] == 1 and alone.F[0] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("top", [0.3, 0.7])
def test_at_a_bound_there_are_other_starts_unless_an_objective_is_linear(top):
    """Of a hill between two bounds, each bound is an optimum."""
    point = optimize(bounded(hill=lambda p, tf, x: -((p - top) ** 2)), DFET(1, 1))
    assert point.F[0] == pytest.approx(-(max(top, 1 - top) ** 2), abs=1e-6) and point.alone().stats["starts"] > 1


def test_what_bounds_allow():
    """Against the values themselves; what has a period goes on beyond its bounds."""
    problem = bounded(duration=lambda p, tf, x: tf - p, most=lambda p, tf, x: -3 * p, square=lambda p, tf, x: tf**2, end=lambda p, tf, x: x)
    turn = problem.phases["phase"].control("turn", bounds=(0, 1), period=1)
    problem.minimize("turn", problem.phases["phase"].initial(turn))
    solver = MultistartSolver(DFET(1, 1).nlp(problem), None, 1, np.random.default_rng(0), GradientSolves(1e-6))
    names = [v.name.split("[")[0] for v in solver.nlp.variables]
    place, end, last = names.index("p"), names.index("phase.tf"), [v.name for v in solver.nlp.variables].index("phase.turn[0,1]")

    def least(p: float, tf: float, status: str = "converged") -> list[bool]:
        z = solver.nlp.lower.copy()
        z[[place, end, last]] = p, tf, 1.0  # the turn at the beginning grows with its first node, and falls with its last
        solved = Solved(z, *solver.nlp.evaluate(z[None])[0], 0.0, status, 1)
        return [solver.is_least(solved, Scalarised.single(i, 5)) for i in range(5)]

    assert least(1.0, 1.0) == [True, True, False, True, False]
    assert least(1.0, 1.001) == [False, True, False, True, False]
    assert least(0.999, 1.0) == [False, False, False, True, False]
    assert least(1.0 - 1e-9, 1.0 + 1e-9) == [True, True, False, True, False]
    assert not any(least(1.0, 1.0, "failed"))
    best = solver.nlp.lower.copy()
    best[[place, end]] = 1.0, 1.0
    one, two = (np.where(np.arange(5) < k, 0.0, np.inf) for k in (1, 2))
    assert is_least(solver.nlp, best, Scalarised(one, np.ones(5))) and not is_least(solver.nlp, best, Scalarised(two, np.ones(5)))
