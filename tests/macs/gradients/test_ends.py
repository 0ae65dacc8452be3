"""Ends of fronts whose own best value leaves the other objective open."""

from contextlib import nullcontext
from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from macs import optimize, payoff
from macs.gradients import scalarised
from macs.gradients.ends import ENDS, lexicographic_ends, moved_along, proper_ends
from macs.gradients.multistart import MultistartSolver
from macs.gradients.scalarised import WEAK, GradientSolves, LexicographicEnd, Scalarised, without_loss
from problems import Problem
from transcription import DFET
from transcription.nlp.scalarized import Solved

GOOD, POOR = -1.0, 1.0


def solver_of_two_valleys(more: bool = False) -> MultistartSolver:
    """Objective 0 depends on the control alone; objective 1 on the control and on a parameter with valleys near -1 and 1; two `more` on
    another parameter: where the one is least, the front is vertical."""
    problem = Problem("valleys")
    run = problem.phase("run", t0=0.0, tf=1.0)
    x, p = run.state("x", bounds=(-2, 2), initial=0), problem.parameter("p", bounds=(-2, 2))
    run.dynamics(x=run.control("u", bounds=(-1, 1)))
    problem.minimize("miss", (run.final(x) - 0.5) ** 2)
    problem.minimize("cost", (p**2 - 1) ** 2 + 0.2 * p + (run.final(x) + 0.5) ** 2)
    if more:
        q = problem.parameter("q", bounds=(-1, 1))
        problem.minimize("steep", q**4)
        problem.minimize("level", -q)
    return MultistartSolver(DFET(1, 1).nlp(problem), None, 1, np.random.default_rng(0), GradientSolves(1e-6))


def optimum_from(solver: MultistartSolver, i: int, p: float):
    place = [v.name for v in solver.nlp.variables].index("p")
    start = solver.nlp.first_guess(np.zeros((1, len(solver.nlp.free))))[0]
    start[place] = p
    return solver.from_vector(start, Scalarised.single(i, len(solver.nlp.problem.goals))), place


@pytest.mark.parametrize("other", [GOOD, POOR])
def test_an_end_lies_in_the_best_valley_that_is_known(other):
    solver = solver_of_two_valleys()
    (first, place), (second, _) = optimum_from(solver, 0, 0.9 * POOR), optimum_from(solver, 1, other)
    end = lexicographic_ends(solver, [first, second].__getitem__)[0]
    valley = min(np.roots([4, 0, -4, 0.2]).real, key=lambda p: abs(p - other))
    assert end.z[place] == pytest.approx(valley, abs=1e-5)
    assert end.F[0] <= first.F[0] + 1e-12 and end.F[1] == pytest.approx((valley**2 - 1) ** 2 + 0.2 * valley + 1.0, abs=1e-5)


def test_ends_of_a_surface_give_up_little_for_much_and_lie_in_the_best_valley_that_is_known():
    solver = solver_of_two_valleys(more=True)
    optima = [optimum_from(solver, i, p)[0] for i, p in enumerate([0.9 * POOR, GOOD, GOOD, GOOD])]
    before, spans = solver.solves.counts.gradient_solves, np.ptp([one.F for one in optima], axis=0)
    ends = proper_ends(solver, optima.__getitem__)
    p, q = ([v.name for v in solver.nlp.variables].index(name) for name in "pq")
    valley = np.roots([4, 0, -4, 0.2]).real.min()
    assert [end.z[p] for end in ends] == pytest.approx([valley] * 4, abs=1e-3) and optima[0].z[p] > 0
    # The least of q^4 / span - 0.01 q / span, and not q = 0.
    assert ends[2].z[q] == pytest.approx(np.cbrt(ENDS.loose / 4 * spans[2] / spans[3]), rel=1e-3)
    assert solver.solves.counts.gradient_solves == before + 8
    assert proper_ends(solver, [replace(optima[0], status="failed"), *optima[1:]].__getitem__)[1] is optima[1]


def test_optima_that_are_not_given_are_found():
    solver = solver_of_two_valleys()
    both = lexicographic_ends(solver)
    assert len(both) == 2 and both[0].F[0] < 1e-10 and both[1].F[0] == pytest.approx(1.0, abs=1e-5)


def test_an_end_is_also_sought_from_those_of_the_others():
    problem = Problem("valleys of one")
    run = problem.phase("run", t0=0.0, tf=1.0)
    x, p = run.state("x", bounds=(-2, 2), initial=0), problem.parameter("p", bounds=(-2, 2))
    run.dynamics(x=run.control("u", bounds=(-1, 1)))
    problem.minimize("valleys", (p**2 - 1) ** 2 + 0.2 * p + run.final(x) ** 2)
    problem.minimize("bowl", (p + 1.5) ** 2 + (run.final(x) - 0.5) ** 2)
    solver = MultistartSolver(DFET(1, 1).nlp(problem), None, 1, np.random.default_rng(0), GradientSolves(1e-6))
    (poor, place), (other, _) = optimum_from(solver, 0, 0.9 * POOR), optimum_from(solver, 1, GOOD)
    assert poor.z[place] > 0 > other.z[place], "the one that was found is in the poor valley"
    end = lexicographic_ends(solver, [poor, other].__getitem__)[0]
    assert end.z[place] == pytest.approx(np.roots([4, 0, -4, 0.2]).real.min(), abs=1e-5) and end.F[0] < poor.F[0] - 0.3


@pytest.mark.parametrize("power", [2, 4])
def test_what_a_slack_gains_at_a_vertical_end_is_not_taken_for_a_tie(power):
    """Of p^power and -p, the first has one optimum: with a slack s of a range of 1, the second gains s^(1 / power), for the slack alone."""
    problem = Problem("vertical")
    run = problem.phase("run", t0=0.0, tf=1.0)
    x, p = run.state("x", bounds=(-2, 2), initial=0), problem.parameter("p", bounds=(-1, 1))
    run.dynamics(x=run.control("u", bounds=(-1, 1)))
    problem.minimize("steep", p**power + run.final(x) ** 2)
    problem.minimize("level", -p + 0.0 * run.final(x))
    solver = MultistartSolver(DFET(1, 1).nlp(problem), None, 1, np.random.default_rng(0), GradientSolves(1e-6))
    (one, place), (other, _) = optimum_from(solver, 0, 0.0), optimum_from(solver, 1, 0.9)
    assert np.abs(one.F).max() < 1e-6 and np.abs(other.F - [1, -1]).max() < 1e-6
    task, slack = Scalarised.single(1, 2, np.array([one.F[0], np.inf])), np.full(2, 1e-5)
    near = solver.from_vector(one.z, replace(task, ceiling=task.ceiling + slack), near=True)
    assert near.F[1] == pytest.approx(-(1e-5 ** (1 / power)), rel=0.01)
    before = solver.solves.counts.gradient_solves
    end = without_loss(solver.from_vector, solver.nlp, 1e-6, one, task, slack, [other.z])
    assert end.F[0] <= one.F[0] + 1e-8 and abs(end.z[place]) < 1e-2
    assert power == 4 or (end is one and solver.solves.counts.gradient_solves == before + 1)


def test_an_end_that_cannot_be_improved_with_slack_either_says_so():
    solver = solver_of_two_valleys()
    (first, _), (second, _) = optimum_from(solver, 0, 0.9 * POOR), optimum_from(solver, 1, GOOD)
    task = Scalarised.single(1, 2, np.array([first.F[0], np.inf]))
    failing = replace(second, status="failed")
    assert without_loss(lambda z, task, near: failing, solver.nlp, 1e-6, first, task, np.full(2, 1e-5)).message == WEAK

    def only_with_slack(z, asked, near):
        return second if asked.ceiling[0] > task.ceiling[0] else failing

    assert without_loss(only_with_slack, solver.nlp, 1e-6, first, task, np.full(2, 1e-5)) is second


def test_an_objective_at_its_bound_is_held_there_and_not_limited():
    run = (problem := Problem("bound")).phase("run", t0=0.0, tf=1.0)
    x, u = run.state("x", bounds=(-2, 0.5), initial=0), run.control("u", bounds=(-1, 1))
    run.dynamics(x=u)
    problem.maximize("end", run.final(x))
    problem.minimize("effort", run.integral(u**2))
    nlp, solves = DFET(2, 2).nlp(problem), GradientSolves(1e-6)
    first, tasks = solves(nlp, nlp.first_guess(np.linspace(1, 0, len(nlp.free))[None])[0], Scalarised.single(0, 2)), list[Scalarised]()
    task, slack = Scalarised.single(1, 2, np.array([first.F[0], np.inf])), np.full(2, 1e-5)
    end = without_loss(lambda z, one, near: tasks.append(one) or solves(nlp, z, one), nlp, 1e-6, first, task, slack, [nlp.lower])
    assert first.F[1] > 0.26 and np.abs(end.F - [-0.5, 0.25]).max() < 1e-6
    assert [(one.ceiling.min(), [*one.held.values()]) for one in tasks] == [(np.inf, [0.5])] * 2
    assert without_loss(lambda z, one, near: solves(nlp, z, one), nlp, 1e-6, end, task, slack) is end, "nothing is gained"
    begun, short = list[float](), replace(end, z=nlp.upper, status="failed")
    without_loss(lambda z, one, near: begun.append(z[0]) or short, nlp, 1e-6, end, task, slack)
    assert begun == [end.z[0], nlp.upper[0]], "what ran out of iterations goes on"
    again = LexicographicEnd.of(0, np.ones(2), first.F).solve(solves, nlp, first.z)
    assert np.abs(again.F - end.F).max() < 1e-6 and solves.counts.gradient_solves == 5, "on another mesh by one"


def test_no_end_takes_the_work_of_the_others(monkeypatch):
    solver, given = solver_of_two_valleys(), list[float]()
    with solver.solves.within(5.0), solver.solves.within(9.0):
        assert solver.solves._most_work == 5.0
    monkeypatch.setattr(solver.solves, "within", lambda work: given.append(work) or nullcontext())
    assert len(lexicographic_ends(solver, most=3e6)) == 2 and given[:3] == [3e6, 1e6, 1e6]


@pytest.mark.slow
def test_what_is_least_stays_so_where_a_slack_would_gain_more_than_its_multiplier_says():
    """A quick drive around an obstacle, whose effort falls with less than the root of the time that is lost."""
    problem = Problem("drive")
    drive = problem.phase("drive", t0=0.0, tf=(1.0, 20.0))
    x = drive.state("x", bounds=(-2, 12), initial=0, final=10)
    y = drive.state("y", bounds=(-5, 5), initial=0, final=0)
    v = drive.state("v", bounds=(0, 3), initial=0.5)
    heading = drive.state("heading", bounds=(-3, 3), initial=0)
    thrust, turn = drive.control("thrust", bounds=(-1, 1)), drive.control("turn", bounds=(-1, 1))
    drive.dynamics(x=v * ca.cos(heading), y=v * ca.sin(heading), v=thrust, heading=turn)
    drive.path("obstacle", (x - 5) ** 2 + (y - 0.3) ** 2, lower=4.0)
    problem.minimize("time", drive.tf)
    problem.minimize("effort", drive.integral(thrust**2 + turn**2))
    mesh = DFET(40, 3)
    quickest = optimize(problem, mesh, objective="time", starts=3, seed=1)
    end = payoff(problem, mesh, starts=3, seed=1)[0]
    assert end.objectives["time"] == pytest.approx(quickest.objectives["time"], abs=1e-7 * 15.4)
    assert end.objectives["effort"] < quickest.objectives["effort"] - 0.1


numbers, spans = st.floats(-100, 100), st.floats(1.0, 100)


@given(a=numbers, b=numbers, before=st.tuples(spans, spans), after=st.tuples(spans, spans), share=st.floats(0, 1))
def test_points_move_along_with_the_ends(a, b, before, after, share):
    """Points on the line between two ends are on the line between these in their new places, at the same share of it."""
    old = np.array([[a, b + before[1]], [a + before[0], b]])
    new = np.array([[b, a + after[1]], [b + after[0], a]])
    F = old[:1] + share * (old[1:] - old[:1])
    references, weights = moved_along(F, old, new, np.array(before))
    if np.abs((new - old) / before).max() > ENDS.moved:
        assert references == pytest.approx(new[:1] + share * (new[1:] - new[:1]), abs=1e-9) and weights == pytest.approx(after)
    else:
        assert references is F and weights == pytest.approx(before)
    for missing in ((F[:0], F[:0]), (old, np.full((2, 2), b))):
        assert moved_along(F, *missing, np.ones(2))[0] is F, "without both ends, or where they are one"


# The end of a front on another mesh, by solves that are made up: which of them is taken


UNITS, KNOWN = np.array([1.0, 10.0]), np.array([2.0, 5.0])
Answer = tuple[str, tuple[float, float]]


@dataclass
class Solves:
    """Answers in their order, and what was asked: the ceiling and the start of each solve."""

    answers: list[Answer]
    tolerance: float = 1e-6
    ceilings: list[np.ndarray | None] = field(default_factory=list)
    starts: list[float] = field(default_factory=list)

    def __call__(self, nlp, start, task, near=False) -> Solved:
        self.ceilings.append(task.ceiling)
        self.starts.append(float(start[0]))
        status, F = self.answers[(k := len(self.starts) - 1)]
        return Solved(np.array([float(k)]), np.array(F), 0.0, status, 1)

    def at_most(self, iterations: int) -> nullcontext:
        return nullcontext()


@dataclass
class Mesh:
    """An NLP that knows the objectives and the violation of the start alone."""

    F: tuple[float, float] = (0.0, 0.0)
    violation: float = 1.0

    def evaluate(self, Z):
        return np.array([self.F]), np.array([self.violation])


FAR = Mesh()
"""On it the start violates constraints by much, and is good for nothing else."""
STAYS: list[Answer] = [("converged", (1.9, 5.1)), ("converged", (1.9, 5.05))]
HELD: list[Answer] = [("converged", (2.0, 5.2)), ("converged", (2.0, 5.0))]
MOVES: list[Answer] = [("converged", (1.5, 90.0)), ("converged", (2.0, 5.2)), ("converged", (1.5, 80.0))]


@pytest.mark.parametrize(
    ("answers", "mesh", "taken", "starts", "ceiling"),
    [
        pytest.param(STAYS, FAR, 1, [-1, 0], [1.9, np.inf], id="one solve for each objective"),
        pytest.param(STAYS, Mesh((1.9, 5.0), 1e-5), 1, [-1, -1], [1.9, np.inf], id="the start was nearly the end"),
        pytest.param(STAYS, Mesh((1.9, 5.2), 1e-5), 1, [-1, 0], [1.9, np.inf], id="the start is worse in the other"),
        pytest.param(STAYS, Mesh((1.91, 5.0), 1e-5), 1, [-1, 0], [1.9, np.inf], id="the start is worse in the one"),
        # The other objective by no more than a twentieth of its unit.
        pytest.param([("converged", (2.0, 90.0)), *HELD], FAR, 2, [-1, -1, 1], [np.inf, 5.5], id="of equal ends that near the known"),
        pytest.param([("failed", (2.0, 5.0)), *HELD], FAR, 2, [-1, -1, 1], [np.inf, 5.5], id="the first fails"),
        pytest.param(MOVES, FAR, 2, [-1, -1, 0], [np.inf, 5.5], id="better elsewhere"),
        pytest.param([("failed", (2.0, 5.0)), ("infeasible", (2.0, 5.2))], FAR, 0, [-1, -1], [np.inf, 5.5], id="nothing converges"),
    ],
)
def test_which_result_is_the_end(answers, mesh, taken, starts, ceiling, monkeypatch):
    monkeypatch.setattr(scalarised, "at_bounds", lambda nlp, z, i: None)
    solves = Solves(answers)
    found = LexicographicEnd.of(0, UNITS, KNOWN).solve(solves, mesh, np.array([-1.0]))  # type: ignore[arg-type]
    assert (found.status, tuple(found.F.tolist())) == answers[taken]
    assert solves.starts == starts and solves.ceilings[1].tolist() == ceiling
