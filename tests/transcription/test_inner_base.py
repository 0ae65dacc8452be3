"""What all inner levels share: their results, their starts, and how these are scored."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from cases import candidates, integrator

from transcription import DFET, NLP, InnerResult, InnerSolver
from transcription.inner import Newton, Projection
from transcription.inner.base import scored, started


def line() -> NLP:
    """x' = u, x(0) = 0; the end is to be small."""
    problem, phase = integrator(final=1)
    problem.minimize("effort", phase.integral(phase["u"] ** 2))
    return DFET(2, 1).transcribe(problem)


def result(*status: str) -> InnerResult:
    k = len(status)
    return InnerResult(np.zeros((k, 2)), np.zeros((k, 1)), np.zeros(k), np.array(status, dtype=str), np.zeros(k), np.zeros(k, dtype=int))


def test_a_result_says_how_many_candidates_had_which_status() -> None:
    assert repr(result("failed", "converged", "converged")) == "InnerResult(3 candidates: 2 converged, 1 failed)"
    assert repr(result("timeout")) == "InnerResult(1 candidates: 1 timeout)"
    assert repr(result()) == "InnerResult(0 candidates)"


def test_a_solver_is_shown_as_it_is_made_also_one_of_a_users_own() -> None:
    @dataclass(frozen=True)
    class Mine(InnerSolver):
        trust: float = 0.5
        steps: int = 7

        def solve(self, nlp, candidates, warm=None, *, tolerance=1e-6):
            raise NotImplementedError

    assert repr(Mine(steps=9)) == "Mine(steps=9)" and eval(repr(Newton(max_iterations=9))) == Newton(9)
    assert repr(Projection()) == "Projection()"
    assert Mine().ways == () and Mine().program(nlp := line()) is nlp


# Starts


def test_without_a_warm_start_the_states_are_guessed() -> None:
    nlp, C = line(), candidates(line(), 3)
    Z = started(nlp, C, None)
    assert np.array_equal(Z, nlp.guessed(C)) and np.array_equal(Z[:, nlp.free], C)


@pytest.mark.parametrize("kind", [float, int])
def test_a_warm_start_gives_the_states_and_is_left_as_it_is(kind: type) -> None:
    """Also where it has whole numbers, which are no reason to round the candidates."""
    nlp, C = line(), candidates(line(), 2)
    warm = np.full((2, len(nlp.variables)), 3, dtype=kind)
    Z = started(nlp, C, warm)
    states = np.setdiff1d(np.arange(len(nlp.variables)), nlp.free)
    assert np.array_equal(Z[:, nlp.free], C) and len(states) and (Z[:, states] == 3).all()
    assert (warm == 3).all()


# Scores


def scores(
    violation: list[float], F: list[float] | None = None, otherwise: str = "infeasible"
) -> tuple[InnerResult, np.ndarray, np.ndarray]:
    """Vectors that were moved by half a span in one free variable, with these violations and objectives, scored; with their starts."""
    nlp, k = line(), len(violation)
    start = nlp.guessed(np.zeros((k, len(nlp.free))))
    Z = start.copy()
    Z[:, nlp.free[0]] += 0.5 * nlp.span[nlp.free[0]]
    residuals = np.full((k, len(nlp.variables) + len(nlp.g_lower)), -1.0)
    residuals[:, 2] = violation
    objectives = np.zeros((k, 1)) if F is None else np.array(F)[:, None]
    found = scored(nlp, (Z.copy(), objectives, residuals), start, np.full(k, otherwise), np.arange(k), 1e-3)
    return found, Z, start


def test_what_is_within_the_tolerance_has_converged_and_nothing_else() -> None:
    """The limit itself is within."""
    found, Z, _ = scores([-1.0, 0.0, 1e-3, np.nextafter(1e-3, 1.0), 5.0])
    assert found.status.tolist() == ["converged"] * 3 + ["infeasible"] * 2
    assert found.violation.tolist() == [0.0, 0.0, 1e-3, np.nextafter(1e-3, 1.0), 5.0]
    assert np.array_equal(found.z, Z) and found.moved == pytest.approx(np.full(5, 0.5)) and not found.clocked
    assert found.iterations.tolist() == [0, 1, 2, 3, 4] and found.residuals is not None
    assert np.array_equal(np.maximum(found.residuals.max(axis=1), 0.0), found.violation)


def test_what_is_no_number_has_failed_and_is_the_start_again() -> None:
    found, Z, start = scores([0.0, np.nan, 0.0, np.inf, 5.0], [1.0, 1.0, np.nan, 1.0, 2.0])
    assert found.status.tolist() == ["converged", "failed", "failed", "failed", "infeasible"]
    assert found.violation.tolist() == [0.0, np.inf, np.inf, np.inf, 5.0]
    assert np.isnan(found.F).all(axis=1).tolist() == [False, True, True, True, False]
    for i, broken in enumerate([False, True, True, True, False]):
        assert np.array_equal(found.z[i], start[i] if broken else Z[i]) and found.moved[i] == pytest.approx(0.0 if broken else 0.5)


def test_a_clock_that_ended_the_work_is_told_whatever_came_out() -> None:
    found, *_ = scores([0.0, 5.0], otherwise="timeout")
    assert found.clocked and found.status.tolist() == ["converged", "timeout"]
