"""What evaluations and gradient solves take is counted alike: iterations of IPOPT times variables of its program."""

from __future__ import annotations

import numpy as np
import pytest

from macs import MACS
from macs.evaluation.bilevel import Bilevel
from macs.fronts.provenance import merged_stats, more_costs
from problems import load
from transcription import DFET
from transcription.inner import Ipopt, Newton, Propagate, inner_solver
from transcription.inner.base import newton_work, propagation_work

METHOD = DFET(3, 3)


def evaluated(inner, count: int = 4) -> tuple[Bilevel, int]:
    """An evaluator after a batch of random candidates, and its number of variables."""
    evaluator = Bilevel(METHOD.nlp(load("goddard")), inner, 1e-6)
    rng = np.random.default_rng(1)
    candidates = evaluator.lower + rng.random((count, len(evaluator.free))) * (evaluator.upper - evaluator.lower)
    evaluator.evaluate(evaluator.first_guess(candidates))
    return evaluator, len(evaluator.nlp.variables)


@pytest.mark.parametrize(("inner", "part"), [(Ipopt(), lambda nlp: 1.0), (Newton(), newton_work), (Propagate(), propagation_work)])
def test_iterations_count_by_what_they_take(inner, part):
    evaluator, n = evaluated(inner)
    each = part(evaluator.nlp)
    assert evaluator.counts.inner_iterations >= 4 and evaluator.counts.work == round(each * n * evaluator.counts.inner_iterations)


def test_less_is_taken_without_derivatives():
    nlp = METHOD.nlp(load("goddard"))
    assert 0.0 < propagation_work(nlp) < newton_work(nlp) < 1.0


def test_what_goes_to_ipopt_counts_more(monkeypatch):
    """Newton's method gives up after one iteration, so that IPOPT does the rest."""
    solve = Newton.solve
    monkeypatch.setattr(Newton, "solve", lambda self, *given, **more: solve(Newton(max_iterations=1), *given, **more))
    evaluator, n = evaluated(inner_solver("auto"))
    counts = evaluator.counts
    light = newton_work(evaluator.nlp)
    assert counts.fallbacks == 4 and counts.work == round(n * (counts.inner_iterations - (1.0 - light) * 4))


def test_gradient_solves_count_all_their_iterations():
    evaluator, n = evaluated(Newton())
    before, iterations = evaluator.counts.work, evaluator.counts.inner_iterations
    start = evaluator.first_guess(0.5 * (evaluator.lower + evaluator.upper)[None])
    evaluator.descend(start, np.zeros((1, 2)), np.ones((1, 2)))
    assert evaluator.counts.work - before == n * (evaluator.counts.inner_iterations - iterations) > 0


@pytest.mark.slow
def test_fronts_say_it_and_add_it_up():
    front = MACS(agents=4, archive=4, mesh="fixed").solve(load("goddard"), METHOD, evaluations=60, seed=1, verify=None)
    work = front.stats["work"]
    assert work > 0 and merged_stats([front.stats, front.stats])["work"] == 2 * work
    evaluator, _ = evaluated(Newton())
    assert more_costs(front.stats, evaluator.counts, 0.0, "")["work"] == work + evaluator.counts.work
    without = {name: value for name, value in front.stats.items() if name != "work"}
    assert merged_stats([without])["work"] == 0, "files from before it was counted"
