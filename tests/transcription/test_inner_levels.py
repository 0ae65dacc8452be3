"""What all inner levels share, and those that need no file of their own: results, starts, scores, and what their work is."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
import pytest
from cases import candidates, integrator, oscillator

from macs import NSGA3
from problems import Problem, load
from transcription import DFET, NLP, Collocation, InnerResult, InnerSolver, MultipleShooting, SingleShooting
from transcription.inner import NAMED, Newton, Projection, Propagate, Whole, inner_solver, levels
from transcription.inner.base import evaluation_work, propagation_work, scored, started


def line() -> NLP:
    problem, phase = integrator(final=1)
    problem.minimize("effort", phase.integral(phase["u"] ** 2))
    return DFET(2, 1).transcribe(problem)


def no_numbers() -> NLP:
    """The square root of a negative number from the first."""
    problem = Problem("broken")
    phase = problem.phase("run", t0=0, tf=(1, 2))
    x = phase.state("x", bounds=(-1, 1), initial=-0.5)
    phase.dynamics(x=ca.sqrt(x) + phase.control("u", bounds=(-1, 1)))
    problem.minimize("time", phase.tf)
    return DFET(2, 2).transcribe(problem)


# Propagation alone, and none


@pytest.mark.parametrize(("inner", "one"), [("propagate", propagation_work), ("none", evaluation_work)])
def test_each_candidate_takes_the_same_work_and_one_iteration(inner: str, one: Any) -> None:
    level = inner_solver(inner)
    program = level.program(line())
    for k in (1, 4):
        found = level.solve(program, candidates(program, k))
        assert found.work == pytest.approx(k * one(program)) and 0.0 < found.work < k, "less than an iteration of IPOPT each"
        assert found.iterations.tolist() == [1] * k and found.iterations.dtype.kind == "i" and found.fallbacks == 0


def test_a_propagation_that_fails_gives_the_warm_start_back() -> None:
    nlp = no_numbers()
    C, warm = candidates(nlp, 3), np.full((3, len(nlp.variables)), 0.25)
    found = Propagate().solve(nlp, C, warm)
    assert set(found.status) == {"failed"} and np.array_equal(found.z[:, nlp.free], C)
    assert (np.delete(found.z, nlp.free, axis=1) == 0.25).all()


def test_without_an_inner_level_the_states_of_a_warm_start_are_judged_as_they_are() -> None:
    """x' = u = 0.5 reaches 1 in 2: with the states of that flight it is feasible, with the guessed ones of 0 everywhere it is not."""
    nlp = line()
    C = np.full((1, len(nlp.free)), 0.5)
    flown = nlp.propagate(nlp.guessed(C))
    found = Whole().solve(nlp, C, flown)
    assert found.status.tolist() == ["converged"] and np.array_equal(found.z, flown)
    still = flown.copy()
    still[:, np.setdiff1d(np.arange(len(nlp.variables)), nlp.free)] = 0.0
    assert Whole().solve(nlp, C, still).status.tolist() == ["infeasible"]


@pytest.mark.parametrize("inner", ["propagate", "projection", "none"])
def test_by_default_a_millionth_of_a_bound_may_be_missed(inner: str) -> None:
    """What flies to 1 but for shares of that, on a scale of 20, the width of the bounds of x."""
    level = inner_solver(inner)
    nlp = line()
    C = np.array([[0.5 + 10.0 * share * 1e-6] * len(nlp.free) for share in (0.4, 1.5)])
    flown = nlp.propagate(nlp.guessed(C))
    program = level.program(nlp)
    found = level.solve(program, flown[:, program.free], flown)
    projects = inner == "projection"
    assert found.status.tolist() == ["converged", "converged" if projects else "infeasible"]
    assert bool(found.moved[1] > 0.0) is projects


def test_levels_are_found_by_their_names_alone() -> None:
    for name, level in levels.NAMED.items():
        assert inner_solver(name) is level and inner_solver(level) is level
    for wrong in ("newton", "", None, 3, Propagate, ["auto"]):
        with pytest.raises(
            ValueError, match=r"unknown inner level .*; there are auto, projection, propagate, none, ipopt, ipopt-feasibility$"
        ):
            inner_solver(wrong)  # type: ignore[arg-type]


# A projection of what Newton's method leaves


@dataclass(frozen=True)
class Told(InnerSolver):
    """Says what it is told to, and keeps what it was asked."""

    status: tuple[str, ...]
    iterations: int
    sign: float
    work: float | None = None
    clocked: bool = False
    asked: dict[str, Any] = field(default_factory=dict)

    def solve(self, nlp: NLP, candidates: np.ndarray, warm: np.ndarray | None = None, *, tolerance: float = 1e-6) -> InnerResult:
        assert len(candidates) == len(self.status)
        self.asked.update(nlp=nlp, candidates=candidates, warm=warm, tolerance=tolerance)
        each = self.sign * np.arange(1.0, len(self.status) + 1)
        wide = each[:, None] * np.ones(3)
        iterations = np.full(len(each), self.iterations)
        status = np.array(self.status, dtype="<U10")
        return InnerResult(wide, wide[:, :1], each + 0, status, each + 0, iterations, self.clocked, 0, wide + 0, self.work)


def projected(monkeypatch: pytest.MonkeyPatch, newton: Told, ipopt: Told, warm: bool = False) -> tuple[InnerResult, np.ndarray, Any]:
    """What a projection makes of what these two say; with its candidates and warm start."""
    nlp = line()
    C = candidates(nlp, len(newton.status))
    start = np.full((len(C), len(nlp.variables)), 0.25) if warm else None
    monkeypatch.setattr(levels, "Newton", lambda: newton)
    monkeypatch.setattr(levels, "Ipopt", lambda max_iterations: ipopt)
    return inner_solver("projection").solve(nlp, C, start, tolerance=1e-4), C, start


def test_only_what_is_left_is_projected_and_takes_its_place(monkeypatch: pytest.MonkeyPatch) -> None:
    newton, ipopt = Told(("converged", "infeasible", "converged", "failed"), 3, 1.0, 1.5), Told(("converged", "failed"), 20, -1.0)
    found, C, _ = projected(monkeypatch, newton, ipopt)
    assert found.status.tolist() == ["converged", "converged", "converged", "failed"]
    for name in ("violation", "moved"):
        assert getattr(found, name).tolist() == [1.0, -1.0, 3.0, -2.0], name
    for name in ("z", "F", "residuals"):
        assert getattr(found, name)[:, 0].tolist() == [1.0, -1.0, 3.0, -2.0], name
    assert np.array_equal(ipopt.asked["candidates"], C[[1, 3]])
    assert found.fallbacks == 2 and found.clocked is False


def test_the_work_of_both_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """That of Newton's method in iterations of IPOPT, to which those of IPOPT are added."""
    newton, ipopt = Told(("converged", "infeasible", "failed"), 3, 1.0, 1.5), Told(("converged", "failed"), 20, -1.0)
    found, *_ = projected(monkeypatch, newton, ipopt)
    assert found.iterations.tolist() == [3, 23, 23] and found.work == 1.5 + 40


@pytest.mark.parametrize("warm", [True, False])
def test_both_begin_where_they_are_told_to_and_keep_the_tolerance(monkeypatch: pytest.MonkeyPatch, warm: bool) -> None:
    newton, ipopt = Told(("infeasible", "converged", "infeasible"), 3, 1.0, 1.5), Told(("converged", "converged"), 20, -1.0)
    _, C, start = projected(monkeypatch, newton, ipopt, warm)
    assert newton.asked["tolerance"] == ipopt.asked["tolerance"] == 1e-4 and newton.asked["nlp"] is ipopt.asked["nlp"]
    assert newton.asked["warm"] is start and np.array_equal(newton.asked["candidates"], C)
    nlp = line()
    begun = ipopt.asked["warm"]
    assert np.array_equal(begun[:, nlp.free], C[[0, 2]])
    states = np.delete(begun, nlp.free, axis=1)
    assert np.array_equal(states, np.full(states.shape, 0.25) if warm else np.delete(nlp.guessed(C[[0, 2]]), nlp.free, axis=1))


@pytest.mark.parametrize("clocked", [True, False])
def test_a_clock_that_ended_the_projection_is_told(monkeypatch: pytest.MonkeyPatch, clocked: bool) -> None:
    found, *_ = projected(monkeypatch, Told(("failed",), 3, 1.0, 1.5), Told(("timeout",), 20, -1.0, clocked=clocked))
    assert found.clocked is clocked


@pytest.mark.parametrize("newton", [Told(("converged",), 3, 1.0, 1.5), Told(("timeout",), 3, 1.0, 1.5, clocked=True)], ids=["done", "late"])
def test_nothing_is_projected_where_all_is_feasible_or_time_is_up(monkeypatch: pytest.MonkeyPatch, newton: Told) -> None:
    ipopt = Told(("converged",), 20, -1.0)
    found, *_ = projected(monkeypatch, newton, ipopt)
    assert not ipopt.asked and found.z[0, 0] == 1.0 and found.work == 1.5 and found.clocked is newton.clocked and found.fallbacks == 0
    assert found.iterations.tolist() == [3]


METHODS = (
    DFET(2, 3),
    Collocation(2, 4),
    Collocation(1, 8, points="gauss"),
    Collocation(1, 8, points="chebyshev"),
    MultipleShooting(6),
    SingleShooting(9),
)


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_all_variables_with_bounds_are_searched_and_scored_as_they_are(method):
    nlp = method.nlp(load("goddard").compile())
    whole = NAMED["none"].program(nlp)
    assert whole is nlp.whole and len(whole.free) == len(nlp.variables) and not np.array_equal(whole.free, nlp.free)
    X = candidates(whole, 5)
    found = inner_solver("none").solve(whole, X)
    F, residuals = nlp.residuals(X)
    assert np.array_equal(found.z, X) and np.array_equal(found.F, F) and not found.moved.any()
    assert found.violation == pytest.approx(residuals.max(axis=1)) and set(found.status) == {"infeasible"}
    flown = nlp.propagate(nlp.first_guess(candidates(nlp, 1)))
    inside = np.clip(flown, nlp.lower, nlp.upper)
    assert inner_solver("none").solve(whole, inside).violation == pytest.approx(nlp.evaluate(inside)[1]), "nothing is propagated"


@pytest.mark.slow
def test_a_population_search_has_the_dynamics_among_its_constraints():
    method = Collocation(2, 3)
    front = NSGA3(population=20).solve(oscillator(), method, evaluations=2_000, seed=1, inner="none", tolerance=0.05, verify=None)
    assert len(front) and front.violation.max() <= 0.05 and front.stats["inner"] == "none" and front.stats["evaluations"] == 2_000
    flown = front[0].simulate()
    assert 1e-4 < flown.max_defect < 0.5, "nothing has propagated them"
    again = NSGA3(population=20).solve(oscillator(), method, evaluations=2_000, seed=1, inner="none", tolerance=0.05, verify=None)
    assert np.array_equal(front.F, again.F), "the same seed gives the same bits"
    tight = NSGA3(population=20).solve(load("goddard"), method, evaluations=200, seed=1, inner="none", verify=None)
    assert not len(tight) and "violates" in tight.message


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
