"""What a search begins with where none of its first candidates is feasible."""

from dataclasses import replace

import numpy as np
import pytest

from macs import MACS, payoff
from macs.evaluation.bilevel import Bilevel
from macs.gradients import multistart
from macs.gradients.multistart import MULTISTART, MultistartSolver
from macs.search import gradient_actions
from macs.search.state import SearchState
from problems import Problem, load
from transcription import DFET, Collocation
from transcription.inner import inner_solver
from transcription.stopping import stopped_by

METHOD = Collocation(2, 4)


def evaluator_of_vectors() -> Bilevel:
    """Candidates are whole vectors: random states do not obey the dynamics."""
    inner = inner_solver("none")
    return Bilevel(inner.program(METHOD.nlp(load("goddard").compile())), inner, 1e-6)


def begun(evaluator: Bilevel, **settings) -> SearchState:
    return MACS(agents=4, **settings).begin(evaluator, 200, np.random.default_rng(0))


def test_the_ends_of_the_front_and_a_compromise() -> None:
    evaluator = evaluator_of_vectors()
    state = begun(evaluator)
    ends = payoff(load("goddard"), METHOD, verify=None, starts=1)
    np.testing.assert_allclose(np.diag(state.optima.F[:2]), np.diag(ends.F), rtol=1e-6)
    assert len(state.optima) == 3 and (state.optima.F[2] > state.optima.F[:2].min(axis=0)).all()
    assert len(state.archive) == 3 and evaluator.counts.gradient_solves >= 5
    assert not len(begun(evaluator_of_vectors(), refine=False).optima)
    evaluator = evaluator_of_vectors()
    evaluator.evaluate(evaluator.first_guess(evaluator.lower[None]))  # builds what it needs, which is not begun either
    with stopped_by(lambda: True):
        state = begun(evaluator)
    assert not len(state.optima) and evaluator.counts.gradient_solves == 0


def recorded(monkeypatch) -> list[np.ndarray]:
    """Where solvers of openings begin from now on."""
    starts: list[np.ndarray] = []

    class Recorded(MultistartSolver):
        def __init__(self, nlp, given, *rest):
            starts.append(given)
            super().__init__(nlp, given, *rest)

    monkeypatch.setattr(gradient_actions, "MultistartSolver", Recorded)
    return starts


def test_they_begin_at_what_was_given_or_guessed_and_not_at_its_propagated_states(monkeypatch) -> None:
    starts = recorded(monkeypatch)
    evaluator = evaluator_of_vectors()
    rng = np.random.default_rng(3)
    worse, better = evaluator.box.to_values(rng.random((2, len(evaluator.free))))
    given = evaluator.first_guess(np.array([worse, better]))
    given = given[np.argsort(-evaluator.evaluate(given).violation)]
    MACS(agents=4).begin(evaluator, 200, rng, given)
    np.testing.assert_array_equal(starts[0], given[1:])
    monkeypatch.setattr(gradient_actions, "guessed_start", lambda nlp: given[:1])
    MACS(agents=4).begin(evaluator_of_vectors(), 200, rng)
    np.testing.assert_array_equal(starts[1], given[:1])
    starts.clear()
    nlp = METHOD.nlp(walk().compile())
    given = np.clip(nlp.first_guess(nlp.lower[nlp.free][None]) + 0.1, nlp.lower, nlp.upper)
    for inner in ("propagate", "auto"):
        MACS(agents=4).begin(Bilevel(nlp, inner_solver(inner), 1e-6), 60, np.random.default_rng(3), given)
    assert len(starts) == 2 and not np.allclose(nlp.propagate(given), given)
    np.testing.assert_array_equal(starts[0], given)
    np.testing.assert_array_equal(starts[1], given)


def projecting(problem: Problem, method) -> Bilevel:
    """An evaluator whose inner level is chosen during the search."""
    return Bilevel(method.nlp(problem.compile()), inner_solver("auto"), 1e-6)


def walk(least: float = -9.0) -> Problem:
    """From 0 to 1 and back to rest; propagated controls miss that. `least` is the lowest place, which the first one may violate."""
    problem = Problem("walk")
    phase = problem.phase("walk", t0=0.0, tf=(0.5, 3.0))
    x, v = phase.state("x", bounds=(-10, 10), initial=0, final=1), phase.state("v", bounds=(-5, 5), initial=0, final=0)
    u = phase.control("u", bounds=(-5, 5))
    phase.dynamics(x=v, v=u)
    phase.path("place", x, lower=least)
    problem.minimize("time", phase.tf)
    problem.minimize("effort", phase.integral(u**2))
    return problem


def test_where_the_way_is_chosen_solves_find_points_along_the_front(monkeypatch) -> None:
    evaluator = projecting(walk(), METHOD)
    state = begun(evaluator, archive=6)
    assert evaluator.counts.evaluations == 6 and evaluator.counts.fallbacks == 0, "candidates were propagated"
    assert len(state.archive) == 6 and (state.archive.violation <= 1e-6).all()
    effort = 12 / 3.0**3  # of the way in 3 seconds, on which the control is a straight line
    assert state.ideal[1] == pytest.approx(effort, rel=1e-4) and len(state.optima) >= 6
    assert state.ideal[0] == pytest.approx(2 / np.sqrt(5), rel=1e-2), "full thrust, then none: 2 sqrt(1 / 5)"
    # Of three solves two are for ends that had not starts enough; no other start finds another optimum.
    memory, tasks, original = state.gradients, [], MultistartSolver.from_vectors
    assert gradient_actions.alike(memory.starts, state.archive.F) and not gradient_actions.unsettled(memory.starts, state.archive.F)
    found, starts = gradient_actions.restart_solves(state.archive, evaluator, 6, 12, 0, (), np.random.default_rng(1))
    assert len(found.F) >= 6 and gradient_actions.alike(np.vstack([memory.starts, starts]), state.archive.F)

    def noted(self, begun):
        tasks.extend(np.flatnonzero(task.weights).tolist() for _, task in begun)
        return original(self, begun)

    monkeypatch.setattr(MultistartSolver, "from_vectors", noted)
    for open_ends, kinds in (((), [[0], [0, 1], [0, 1], [1], [0, 1], [0, 1]]), ((1,), [[1], [1], [0, 1]] * 2)):
        tasks.clear()
        gradient_actions.restart_solves(state.archive, evaluator, 6, 6, 0, open_ends, np.random.default_rng(1))
        assert tasks == kinds


def test_where_solves_for_feasibility_find_nothing_no_candidate_is_projected() -> None:
    evaluator = projecting(walk(least=0.5), METHOD)
    state = begun(evaluator)
    assert not len(state.archive) and not len(state.optima) and MACS().ended(state) == "settled"
    assert evaluator.counts.evaluations == 10 and evaluator.counts.fallbacks == 0 and len(state.closest)


@pytest.mark.slow
def test_what_nothing_makes_feasible_is_projected(monkeypatch) -> None:
    monkeypatch.setattr(multistart, "MULTISTART", replace(MULTISTART, infeasible=(1, 0)))
    evaluator = projecting(walk(least=0.5), METHOD)
    state = begun(evaluator)
    assert not len(state.archive) and not len(state.optima)
    assert evaluator.counts.evaluations == 20 and evaluator.counts.fallbacks == 10 == state.gradients.hopeless
    few = projecting(walk(least=0.5), METHOD)
    MACS().begin(few, 13, np.random.default_rng(0))
    assert few.counts.evaluations == 13, "as far as the budget goes"


def test_optima_that_other_starts_find_are_noticed() -> None:
    evaluator = projecting(load("landing_site", landers=1), DFET(1, 3))
    state = begun(evaluator, archive=6)
    found, starts = gradient_actions.restart_solves(state.archive, evaluator, 6, 12, 0, (), np.random.default_rng(1))
    assert len(starts) == 4 and len(found.F) >= 6
    both = np.vstack([state.gradients.starts, starts])
    assert gradient_actions.unsettled(both, state.archive.F) and not gradient_actions.alike(both, state.archive.F)
