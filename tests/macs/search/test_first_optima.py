"""What a search begins with where none of its first candidates is feasible."""

from __future__ import annotations

import numpy as np

from macs import MACS, payoff
from macs.evaluation.bilevel import Bilevel
from macs.gradients.multistart import MultistartSolver
from macs.search import gradient_action
from macs.search.state import SearchState
from problems import load
from transcription import Collocation
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
    ends = payoff(load("goddard"), METHOD, verify=None)
    np.testing.assert_allclose(np.diag(state.optima[:2]), np.diag(ends.F), rtol=1e-6)
    assert len(state.optima) == 3 and (state.optima[2] > state.optima[:2].min(axis=0)).all()
    assert len(state.archive) == 3 and evaluator.counts.gradient_solves >= 5


def test_without_gradients_or_time_there_are_none() -> None:
    assert not len(begun(evaluator_of_vectors(), refine=False).optima)
    evaluator = evaluator_of_vectors()
    evaluator.evaluate(evaluator.first_guess(evaluator.lower[None]))  # builds what it needs, which is not begun either
    with stopped_by(lambda: True):
        state = begun(evaluator)
    assert not len(state.optima) and evaluator.counts.gradient_solves == 0


def test_they_are_sought_from_what_was_given_or_guessed(monkeypatch) -> None:
    starts = []

    class Recorded(MultistartSolver):
        def __init__(self, nlp, given, *rest):
            starts.append(given)
            super().__init__(nlp, given, *rest)

    monkeypatch.setattr(gradient_action, "MultistartSolver", Recorded)
    evaluator = evaluator_of_vectors()
    rng = np.random.default_rng(3)
    worse, better = evaluator.box.to_values(rng.random((2, len(evaluator.free))))
    given = evaluator.first_guess(np.array([worse, better]))
    given = given[np.argsort(-evaluator.evaluate(given).violation)]
    MACS(agents=4).begin(evaluator, 200, rng, given)
    np.testing.assert_array_equal(starts[0], given[1:])
    monkeypatch.setattr(gradient_action, "guessed_start", lambda nlp: given[:1])
    MACS(agents=4).begin(evaluator_of_vectors(), 200, rng)
    np.testing.assert_array_equal(starts[1], given[:1])
