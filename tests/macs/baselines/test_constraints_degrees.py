"""Violation degrees against hand-computed cases of eqs. (16)-(18), and each constraint's own violation, from functions and trajectories."""

from __future__ import annotations

import numpy as np
import pytest
from boxes import boxed
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from macs import MOPSO, NSGA2
from macs.baselines.constraints import DEGREES, degree, excess, presented, problem_type
from macs.evaluation.bilevel import Bilevel
from problems import Problem, load
from transcription import DFET, InnerResult, InnerSolver
from transcription.inner import inner_solver

VIOLATIONS = st.sampled_from([0.0, 1e-9, 0.25, 0.5, 1.0, 1.5, 3.0, 100.0])


def test_a_heating_rate_and_a_pressure_by_hand() -> None:
    """Limits 200 and 280: rates of 250, 300, 500 and 900, pressures of 280, 350, 560 and 1400."""
    v = np.array([[250, 280], [300, 350], [500, 560], [900, 1400]]) / [200, 280] - 1
    worst = v.max(axis=1)

    def by(name: str) -> np.ndarray:
        return degree(name, worst, lambda: v, 1e-6)

    assert by("largest").tolist() == pytest.approx([0.25, 0.5, 1.5, 4.0])
    assert by("sum").tolist() == pytest.approx([0.25, 0.75, 2.5, 7.5])
    assert by("log").tolist() == pytest.approx([np.log(1.25), np.log(1.5) + np.log(1.25), np.log(2.5 * 2), np.log(4.5 * 5)])
    assert by("printed").tolist() == pytest.approx([0.25, 0.75, 2.0, 2.0])  # eq. (16) saturates at twice the limit


def test_what_is_within_the_tolerance_or_failed() -> None:
    v = np.array([[5e-7, 0.3], [5e-7, 1e-7], [np.nan, 0.1], [np.inf, 0.1]])
    worst = np.array([0.3, 5e-7, np.inf, np.inf])
    for name in DEGREES[1:]:
        found = degree(name, worst, lambda: v, 1e-6)
        assert found[0] == pytest.approx(np.log1p(0.3) if name == "log" else 0.3)
        assert found[1] == 0
        assert np.isinf(found[2:]).all()


@given(arrays(float, (5, 3), elements=VIOLATIONS), st.sampled_from(DEGREES))
def test_a_degree_is_none_exactly_where_a_point_is_feasible_and_never_falls_with_a_violation(v, name) -> None:
    found = degree(name, v.max(axis=1), lambda: v, 1e-6)
    assert np.array_equal(excess(np.zeros((5, 2)), v.max(axis=1), 1e-6, found) > 0, v.max(axis=1) > 1e-6)
    more = degree(name, (v + 1).max(axis=1), lambda: v + 1, 1e-6)
    assert (more >= found).all()
    if name in ("sum", "log"):
        assert (more > found).all()


def test_problem_types_of_algorithm_1() -> None:
    assert problem_type(np.array([0.1, 2.0])) == 0
    assert problem_type(np.array([0.1, 0.0])) == 0.5
    assert problem_type(np.array([0.0, 0.0])) == 1


def test_algorithms_get_the_degree_in_place_of_the_violation() -> None:
    F, violation, degrees = np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([0.0, 0.5]), np.array([0.0, 0.75])
    assert presented("feasible-first", 10, F, violation, 1e-6, degrees)[1].tolist() == [0, 0.75]
    assert presented("penalty", 10, F, violation, 1e-6, degrees)[0].tolist() == [[1, 2], [10.5, 11.5]]
    assert presented("objective", 10, F, violation, 1e-6, degrees)[0].tolist() == [[1, 2, 0], [3, 4, 0.75]]


# Each constraint's own violation


def test_those_of_a_function_are_its_columns() -> None:
    def function(X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return X, np.stack([X[:, 0] - 1, 1 - X[:, 0]], axis=1)

    seen = boxed(function, [(0, 4)] * 2, constraints=lambda X: X[:, 1] - 2).evaluate(np.array([[3.0, 1.0], [0.5, 4.0]]))
    assert seen.violations.tolist() == [[2, 0, 0], [0, 0.5, 2]]
    assert seen.violation.tolist() == [2, 2]
    assert boxed(lambda X: X, [(0, 1)] * 2).evaluate(np.zeros((3, 2))).violations.shape == (3, 0)


class Foreign(InnerSolver):
    """An inner solver with nothing beyond the contract."""

    def solve(self, nlp, candidates, warm=None, *, tolerance=1e-6) -> InnerResult:
        found = inner_solver("propagate").solve(nlp, candidates, warm, tolerance=tolerance)
        return InnerResult(found.z, found.F, found.violation, found.status, found.moved, found.iterations)


@pytest.mark.slow
@pytest.mark.parametrize("inner", ["propagate", "auto", Foreign()], ids=["propagate", "auto", "own"])
def test_those_of_a_trajectory_are_what_its_point_tells(inner) -> None:
    nlp = DFET(2, 3).transcribe(load("orbit_rise"))
    evaluator = Bilevel(nlp, inner_solver(inner), 1e-6)
    rng = np.random.default_rng(0)
    seen = evaluator.evaluate(evaluator.first_guess(evaluator.lower + (evaluator.upper - evaluator.lower) * rng.random((4, len(nlp.free)))))
    assert seen.violations.shape == (4, len(nlp.constraints))
    assert seen.violations.max(axis=1) == pytest.approx(seen.violation, abs=1e-15)
    for z, row in zip(seen.Z, seen.violations, strict=True):
        assert dict(zip(nlp.constraints, row.tolist(), strict=True)) == nlp.violations(z)


def test_a_peak_without_bounds_is_no_violation() -> None:
    problem = Problem("peak")
    phase = problem.phase("slide", t0=0, tf=1)
    x, u = phase.state("x", bounds=(-2, 2), initial=0), phase.control("u", bounds=(-1, 1))
    phase.dynamics(x=u)
    problem.minimize("peak", phase.peak(x))
    problem.minimize("effort", phase.integral(u**2))
    nlp = DFET(2, 2).transcribe(problem)
    z = nlp.propagate(nlp.first_guess(np.zeros((1, len(nlp.free)))))[0]
    assert max(nlp.violations(z).values()) <= 1e-9


# Solvers


def two_limits(X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Far from feasible almost everywhere: both limits are missed by many times their size."""
    F = np.stack([(X**2).sum(axis=1), ((X - 1) ** 2).sum(axis=1)], axis=1)
    return F, np.stack([20 * (np.abs(X[:, 0] - 0.6) - 0.01), 20 * (np.abs(X[:, 1] - 0.3) - 0.01)], axis=1)


@pytest.mark.parametrize("name", DEGREES[:3])  # the printed one does not distinguish better from worse where both are missed by their size
@pytest.mark.parametrize("solver", [NSGA2, MOPSO], ids=lambda kind: kind.__name__)
def test_solvers_rank_by_the_degree_and_show_the_violation(solver, name) -> None:
    size = {"particles": 20} if solver is MOPSO else {"population": 20}
    front = solver(**size, degree=name).minimize(two_limits, [(-2, 2)] * 2, evaluations=1000, seed=3)
    seen = front.stats["population"]
    assert len(front) and (np.abs(front.decision - [0.6, 0.3]) <= 0.01 + 1e-6).all()
    assert 1 <= seen["first_feasible"] <= seen["generations"]


def test_how_feasible_populations_are_is_counted_generation_by_generation() -> None:
    generations: list[int] = []

    def function(X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Only what is evaluated from the third generation on is feasible."""
        generations.append(len(X))
        return X, np.full((len(X), 1), 1.0 if len(generations) < 3 else -1.0)

    front = NSGA2(population=10).minimize(function, [(0, 1)] * 2, evaluations=60, seed=1)
    seen = front.stats["population"]
    assert (seen["first_feasible"], seen["all_feasible"], seen["generations"], seen["size"], seen["feasible"]) == (
        3,
        3,
        6,
        10,
        10,
    )
    assert seen["nondominated"] == len(front)

    front = NSGA2(population=10).minimize(lambda X: (X, X[:, :1] + 1), [(0, 1)] * 2, evaluations=60, seed=1)
    seen = front.stats["population"]
    assert (seen["first_feasible"], seen["all_feasible"], seen["feasible"], seen["nondominated"]) == (None, None, 0, 0)
