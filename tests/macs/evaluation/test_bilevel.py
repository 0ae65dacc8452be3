"""Trajectories as a search evaluates them: each constraint's violation, and work, which evaluations and gradient solves count alike:
iterations of IPOPT times variables of its program."""

import numpy as np
import pytest

from macs import MACS, Front, sweep
from macs.evaluation import bilevel
from macs.evaluation.bilevel import Bilevel
from macs.evaluation.evaluator import Counts, Evaluation
from macs.fronts.provenance import merged_stats, more_costs
from macs.fronts.tables import solves_table
from macs.io.interrupts import spending
from problems import Problem, load
from transcription import DFET, InnerResult, InnerSolver
from transcription.inner import Ipopt, Newton, Propagate, inner_solver
from transcription.inner.base import newton_work, propagation_work
from transcription.nlp.scalarized import Solved

METHOD = DFET(3, 3)


def evaluated(inner, problem: str = "goddard") -> tuple[Bilevel, int, Evaluation]:
    """An evaluator after a batch of four random candidates, its number of variables, and the batch."""
    evaluator = Bilevel(METHOD.nlp(load(problem)), inner, 1e-6)
    rng = np.random.default_rng(1)
    candidates = evaluator.lower + rng.random((4, len(evaluator.free))) * (evaluator.upper - evaluator.lower)
    return evaluator, len(evaluator.nlp.variables), evaluator.evaluate(evaluator.first_guess(candidates))


@pytest.mark.parametrize(("inner", "part"), [(Ipopt(), lambda nlp: 1.0), (Newton(), newton_work), (Propagate(), propagation_work)])
def test_iterations_count_by_what_they_take(inner, part):
    evaluator, n, _ = evaluated(inner)
    each = part(evaluator.nlp)
    assert evaluator.counts.inner_iterations >= 4 and evaluator.counts.work == round(each * n * evaluator.counts.inner_iterations)


def test_what_goes_to_ipopt_counts_more(monkeypatch):
    """Newton's method gives up after one iteration, so that IPOPT does the rest."""
    solve = Newton.solve
    monkeypatch.setattr(Newton, "solve", lambda self, *given, **more: solve(Newton(max_iterations=1), *given, **more))
    evaluator, n, _ = evaluated(inner_solver("auto"))
    counts = evaluator.counts
    light = newton_work(evaluator.nlp)
    assert counts.fallbacks == 4 and counts.work == round(n * (counts.inner_iterations - (1.0 - light) * 4))


def test_gradient_solves_count_all_their_iterations():
    evaluator, n, _ = evaluated(Newton())
    before, iterations = evaluator.counts.work, evaluator.counts.inner_iterations
    start = evaluator.first_guess(0.5 * (evaluator.lower + evaluator.upper)[None])
    evaluator.descend(start, np.zeros((1, 2)), np.ones((1, 2)))
    assert evaluator.counts.work - before == n * (evaluator.counts.inner_iterations - iterations) > 0
    nlp = METHOD.nlp(load("goddard"))
    assert 0.0 < propagation_work(nlp) < newton_work(nlp) < 1.0


def test_gradient_solves_may_take_longer_where_all_are_long(monkeypatch):
    """Three times the mean of those that converged, from 100 to 500 iterations: failed ones say nothing of what it takes."""
    evaluator, n, _ = evaluated(Newton())
    allowed, outcomes = [], [("converged", 90), ("failed", 500), ("converged", 50), ("converged", 900), ("converged", 1)]

    def scalarize(nlp, start, *, max_iterations, **_) -> Solved:
        status, iterations = outcomes[len(allowed)]
        allowed.append(max_iterations)
        return Solved(start, np.zeros(2), 0.0, status, iterations)

    monkeypatch.setattr(bilevel, "scalarize", scalarize)
    for _ in outcomes:
        evaluator.descend(np.zeros((1, n)), np.zeros((1, 2)), np.ones((1, 2)))
    assert allowed == [100, 270, 270, 210, 500]


def test_what_gradient_solves_were_for_is_counted_added_up_and_read_again(tmp_path):
    first, second = Counts(), Counts()
    with spending("starts"):
        first.add_solves(2, ["converged", "failed"], 30, 0, 5)
        with spending("ends"):
            first.add_solves(1, ["converged"], 8, 0, 5)
            second.add_solves(1, ["converged"], 9, 0, 5)
        first.keep([True, False])
    second.add_solves(1, ["failed"], 7, 0, 5)
    both = first.joined(second)
    assert both.solves_for == {"starts": 2, "ends": 2, "other": 1} and both.iterations_for == {"starts": 30, "ends": 17, "other": 7}
    assert both.kept_for == {"starts": 1}
    front = sweep(load("goddard"), METHOD, points=4, starts=2, verify=None)
    merged = Front.merge([front, front])
    merged.save(tmp_path / "front.nc")
    stats, again = front.stats, Front.load(tmp_path / "front.nc").stats
    assert set(stats["solves_for"]) == set(stats["iterations_for"]) == {"starts", "ends", "points between"}
    assert sum(stats["solves_for"].values()) == stats["gradient_solves"]
    assert sum(stats["iterations_for"].values()) == stats["inner_iterations"]
    assert all(kept <= stats["solves_for"][what] for what, kept in stats["kept_for"].items())
    assert stats["kept_for"]["points between"] == 2 and stats["kept_for"]["starts"] >= 2, "two points, and an optimum of each objective"
    assert again["solves_for"] == {what: 2 * number for what, number in stats["solves_for"].items()}
    number = str(again["solves_for"]["ends"])
    assert [row.split()[1] for row in solves_table(merged).splitlines() if row.startswith("ends")] == [number]


@pytest.mark.slow
def test_fronts_say_it_and_add_it_up():
    front = MACS(agents=4, archive=4, mesh="fixed").solve(load("goddard"), METHOD, evaluations=60, seed=1, verify=None)
    work = front.stats["work"]
    assert work > 0 and merged_stats([front.stats, front.stats])["work"] == 2 * work
    evaluator, _, _ = evaluated(Newton())
    assert more_costs(front.stats, evaluator.counts, 0.0, "")["work"] == work + evaluator.counts.work
    without = {name: value for name, value in front.stats.items() if name != "work"}
    assert merged_stats([without])["work"] == 0, "files from before it was counted"


class Foreign(InnerSolver):
    """An inner solver with nothing beyond the contract."""

    def solve(self, nlp, candidates, warm=None, *, tolerance=1e-6) -> InnerResult:
        found = inner_solver("propagate").solve(nlp, candidates, warm, tolerance=tolerance)
        return InnerResult(found.z, found.F, found.violation, found.status, found.moved, found.iterations)


@pytest.mark.slow
@pytest.mark.parametrize("inner", ["propagate", "auto", Foreign()], ids=["propagate", "auto", "own"])
def test_violations_are_what_a_point_tells(inner):
    evaluator, _, seen = evaluated(inner_solver(inner), "orbit_rise")
    nlp = evaluator.nlp
    assert seen.violations.max(axis=1) == pytest.approx(seen.violation, abs=1e-15)
    for z, row in zip(seen.Z, seen.violations, strict=True):
        assert dict(zip(nlp.constraints, row.tolist(), strict=True)) == nlp.violations(z)


def test_a_peak_without_bounds_is_no_violation():
    problem = Problem("peak")
    phase = problem.phase("slide", t0=0, tf=1)
    x, u = phase.state("x", bounds=(-2, 2), initial=0), phase.control("u", bounds=(-1, 1))
    phase.dynamics(x=u)
    problem.minimize("peak", phase.peak(x))
    problem.minimize("effort", phase.integral(u**2))
    nlp = DFET(2, 2).transcribe(problem)
    z = nlp.propagate(nlp.first_guess(np.zeros((1, len(nlp.free)))))[0]
    assert max(nlp.violations(z).values()) <= 1e-9
