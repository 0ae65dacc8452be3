"""Inner levels: results, the nearest feasible point, what cannot be, names, starts, and what their work is."""

import subprocess
import sys
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from cases import candidates, decay, integrator, oscillator
from scipy.optimize import minimize
from smooth_problems import nlp_of, still

from macs import MACS, NSGA3
from problems import Problem, load
from transcription import DFET, NLP, Collocation, InnerResult, InnerSolver, MultipleShooting, SingleShooting
from transcription.inner import NAMED, Ipopt, Newton, Projection, Propagate, Whole, inner_solver, levels
from transcription.inner.base import evaluation_work, propagation_work, scored, solves_charge, spent, started

NAMES = ("auto", "propagate", "ipopt", "ipopt-feasibility")


def violation(nlp, z: np.ndarray) -> float:
    """The largest scaled residual, written once more."""
    F, g = (np.array(v).ravel() for v in nlp.functions(z))
    worst = [0.0]
    for v, value in zip(nlp.variables, z, strict=True):
        worst += [(v.lower - value) / v.scale, (value - v.upper) / v.scale]
    for low, high, scale, value in zip(nlp.g_lower, nlp.g_upper, nlp.g_scale, g, strict=True):
        worst += [(low - value) / scale, (value - high) / scale]
    return float(np.max(worst)) if np.isfinite(F).all() and np.isfinite(g).all() else np.inf


def hop() -> Problem:
    """x' = u from 0 to 1 in 2 time units."""
    problem, phase = integrator(final=1)
    problem.minimize("effort", phase.integral(phase["u"] ** 2))
    problem.maximize("first", phase.initial(phase["u"]))
    return problem


def hop_nlp() -> NLP:
    return DFET(2, 1).transcribe(hop())


def broken() -> Problem:
    """The square root of a negative number at the start, whatever one does."""
    problem = Problem("broken")
    phase = problem.phase("run", t0=0, tf=(1, 2))
    x = phase.state("x", bounds=(-1, 1), initial=-0.5)
    phase.dynamics(x=ca.sqrt(x) + phase.control("u", bounds=(-1, 1)))
    problem.minimize("time", phase.tf)
    problem.maximize("end", phase.final(x))
    return problem


@pytest.mark.parametrize("inner", NAMES)
@pytest.mark.parametrize("make", [hop, lambda: load("goddard")], ids=["hop", "goddard"])
def test_a_batch_comes_back_as_a_batch_and_means_what_it_says(inner, make):
    nlp = DFET(3, 2).transcribe(make())
    C = candidates(nlp, 4)
    before = C.copy()
    found = inner_solver(inner).solve(nlp, C)
    n, m = len(nlp.variables), len(nlp.problem.goals)
    shapes = {"z": (4, n), "F": (4, m), "violation": (4,), "status": (4,), "moved": (4,), "iterations": (4,)}
    assert {f.name: getattr(found, f.name).shape for f in fields(found) if f.name in shapes} == shapes
    assert found.clocked is False
    assert set(found.status.tolist()) <= {"converged", "infeasible", "failed", "timeout"} and np.array_equal(C, before)
    assert ((found.z >= nlp.lower) & (found.z <= nlp.upper)).all() or inner == "propagate" or "converged" not in found.status
    for i in range(4):
        assert found.violation[i] == pytest.approx(violation(nlp, found.z[i]), rel=1e-9, abs=1e-14)
        assert (found.status[i] == "converged") == (violation(nlp, found.z[i]) <= 1e-6)
    assert pytest.approx(nlp.evaluate(found.z)[0]) == found.F
    if inner == "propagate":
        assert np.array_equal(found.z[:, nlp.free], C) and not found.moved.any()


@pytest.mark.parametrize("inner", ["auto", "ipopt"])
def test_the_projection_is_the_nearest_feasible_point(inner):
    nlp = DFET(3, 1).transcribe(hop())
    C = candidates(nlp, 8, seed=1)
    C[0], C[1] = -1, [1, -1, 1, 1, 1, -1]
    found = inner_solver(inner).solve(nlp, C, tolerance=1e-8)
    assert set(found.status) == {"converged"}
    for c, z, moved in zip(C, found.z, found.moved, strict=True):
        # The final state is the mean of all coefficients times the duration: a plane, and a box.
        plane = {"type": "eq", "fun": lambda u: 2 * np.mean(u) - 1}
        nearest = minimize(
            lambda u, c=c: np.sum((u - c) ** 2), np.full(6, 0.5), bounds=[(-1, 1)] * 6, constraints=plane, options={"ftol": 1e-14}
        )
        assert z[nlp.free] == pytest.approx(nearest.x, abs=2e-5)
        assert moved == pytest.approx(np.linalg.norm(z[nlp.free] - c) / 2, rel=1e-9)


@pytest.mark.parametrize("inner", ["auto", "ipopt"])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-9])
def test_the_tolerance_is_kept(inner, tolerance):
    nlp = DFET(4, 3).transcribe(load("goddard"))
    found = inner_solver(inner).solve(nlp, candidates(nlp, 3), tolerance=tolerance)
    assert set(found.status) == {"converged"}
    assert max(violation(nlp, z) for z in found.z) <= tolerance


@pytest.mark.parametrize("inner", NAMES)
def test_what_cannot_be_is_infeasible_and_says_why(inner):
    problem, phase = integrator(final=5)
    problem.minimize("effort", phase.integral(phase["u"] ** 2))
    nlp = DFET(3, 2).transcribe(problem)
    found = inner_solver(inner).solve(nlp, candidates(nlp, 3))
    assert set(found.status) <= {"infeasible", "failed"} and (found.violation > 1e-3).all() and np.isfinite(found.F).all()
    for z in found.z:
        violations = nlp.violations(z)
        assert max(violations, key=violations.get) == "final value of run.x"


@pytest.mark.parametrize("inner", ["auto", "ipopt-feasibility"])
def test_no_freedom_left(inner):
    """Fixed times, no control: there is nothing to choose, and the final value is right or wrong."""
    for final, feasible in ((np.exp(-1.0), True), (0.5, False)):
        problem, _ = decay(tf=1.0, final=final)
        nlp = DFET(3, 5).transcribe(problem)
        found = inner_solver(inner).solve(nlp, np.empty((2, 0)))
        assert (found.status == "converged").tolist() == [feasible] * 2
        assert found.moved.tolist() == [0, 0]


@pytest.mark.parametrize("inner", NAMES)
def test_dynamics_that_are_no_numbers_fail_and_are_never_feasible(inner, capfd):
    nlp = DFET(2, 2).transcribe(broken())
    C = candidates(nlp, 3)
    found = inner_solver(inner).solve(nlp, C)
    assert set(found.status) == {"failed"}
    assert np.isinf(found.violation).all() and np.isnan(found.F).all()
    assert np.array_equal(found.z[:, nlp.free], C)
    assert capfd.readouterr() == ("", ""), "the library does not print"


@pytest.mark.parametrize("inner", ["auto", "ipopt"])
def test_results_do_not_depend_on_what_was_solved_before(inner):
    problem, solver = load("goddard"), inner_solver(inner)
    fresh, used = (DFET(3, 3).transcribe(problem) for _ in range(2))
    C, other = candidates(fresh, 2), candidates(fresh, 3, seed=9)
    solver.solve(used, other)
    inner_solver("ipopt").solve(used, other[::-1], tolerance=1e-4)
    solver.solve(DFET(2, 2).transcribe(hop()), np.zeros((1, 6)))
    first, second = solver.solve(fresh, C), solver.solve(used, C)
    for field in fields(InnerResult):
        assert np.array_equal(getattr(first, field.name), getattr(second, field.name)), field.name


SCRIPT = """
import sys
sys.path.insert(0, {here!r})
from cases import candidates
from problems import load
from transcription import DFET
from transcription.inner import inner_solver
nlp = DFET(3, 3).transcribe(load("goddard"))
found = inner_solver("auto").solve(nlp, candidates(nlp, 3))
print(found.z.tobytes().hex())
"""


@pytest.mark.slow
def test_two_processes_give_the_same_bits():
    code = SCRIPT.format(here=str(Path(__file__).parent))
    first, second = (subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout for _ in range(2))
    assert first == second and len(first) > 100


@pytest.mark.parametrize("wrong", [{"objective": "projecton"}, {"max_iterations": 0}, {"seconds": -1}])
def test_settings_that_make_no_sense(wrong):
    with pytest.raises(ValueError, match=f"Ipopt: {next(iter(wrong))}"):
        Ipopt(**wrong)


@pytest.mark.slow
def test_a_time_limit_gives_a_timeout():
    nlp = DFET(20, 6).transcribe(load("goddard"))
    found = Ipopt(seconds=1e-6).solve(nlp, candidates(nlp, 2))
    assert found.status.tolist() == ["timeout", "timeout"] and (found.violation > 1e-6).all()
    assert found.clocked


@dataclass(frozen=True)
class Bisection(InnerSolver):
    """A user's own: scales the controls until the final value is met."""

    goal: float = 1.0

    def solve(self, nlp, candidates, warm=None, *, tolerance=1e-6):
        assert warm is None or warm.shape == (len(candidates), len(nlp.variables))
        C = np.clip(candidates + (self.goal / 2 - candidates.mean(axis=1, keepdims=True)), -1, 1)
        Z = nlp.propagate(nlp.first_guess(C))
        F, worst = nlp.evaluate(Z)
        status = np.where(worst <= tolerance, "converged", "infeasible")
        return InnerResult(Z, F, worst, status, np.linalg.norm(C - candidates, axis=1), np.ones(len(C), dtype=int))


@pytest.mark.slow
def test_a_users_own_inner_solver_is_as_good_as_ours():
    front = MACS(agents=4, archive=4).solve(hop(), DFET(2, 1), evaluations=120, seed=1, inner=Bisection())
    assert len(front) > 0 and front.violation.max() <= 1e-6
    assert front.stats["evaluations"] <= 120 and "Bisection" in front.stats["inner"]
    assert front[0].simulate().max_defect < 1e-9


@pytest.mark.parametrize("inner", ["propagate", "none"])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
@pytest.mark.parametrize(("share", "status"), [(0.9, "converged"), (1.1, "infeasible"), (4.5, "infeasible")])
def test_what_misses_by_more_than_the_tolerance_has_not_converged(inner, tolerance, share, status):
    """x' = u from 0 to 1 in 2: with u = (1 + d) / 2 the end is missed by d, of which the span of the bounds of x is the scale."""
    level = inner_solver(inner)
    nlp = DFET(2, 1).transcribe(hop())
    controls = np.full((1, len(nlp.free)), 0.5 * (1.0 + 20.0 * share * tolerance))
    whole = nlp.propagate(nlp.guessed(controls))
    program = level.program(nlp)
    found = level.solve(program, whole[:, program.free], whole, tolerance=tolerance)
    assert found.violation[0] == pytest.approx(share * tolerance, rel=1e-6) and found.status.tolist() == [status]


# Levels that need no file of their own


@pytest.mark.parametrize(("inner", "one"), [("propagate", propagation_work), ("none", evaluation_work)])
def test_each_candidate_takes_the_same_work_and_one_iteration(inner: str, one: Any) -> None:
    level = inner_solver(inner)
    program = level.program(hop_nlp())
    for k in (1, 4):
        found = level.solve(program, candidates(program, k))
        assert found.work == pytest.approx(k * one(program)) and 0.0 < found.work < k, "less than an iteration of IPOPT each"
        assert found.iterations.tolist() == [1] * k and found.iterations.dtype.kind == "i" and found.fallbacks == 0


def test_warm_starts_of_propagation_and_of_no_level_and_names_of_levels() -> None:
    nlp = DFET(2, 2).transcribe(broken())
    C, warm = candidates(nlp, 3), np.full((3, len(nlp.variables)), 0.25)
    found = Propagate().solve(nlp, C, warm)
    assert set(found.status) == {"failed"} and np.array_equal(found.z[:, nlp.free], C)
    assert (np.delete(found.z, nlp.free, axis=1) == 0.25).all()
    # x' = u = 0.5 reaches 1 in 2: with the states of that flight it is feasible, with the guessed ones of 0 everywhere it is not.
    nlp = hop_nlp()
    C = np.full((1, len(nlp.free)), 0.5)
    flown = nlp.propagate(nlp.guessed(C))
    found = Whole().solve(nlp, C, flown)
    assert found.status.tolist() == ["converged"] and np.array_equal(found.z, flown)
    still = flown.copy()
    still[:, np.setdiff1d(np.arange(len(nlp.variables)), nlp.free)] = 0.0
    assert Whole().solve(nlp, C, still).status.tolist() == ["infeasible"]
    for name, level in levels.NAMED.items():
        assert inner_solver(name) is level and inner_solver(level) is level
    for wrong in ("newton", "", None, 3, Propagate, ["auto"]):
        with pytest.raises(
            ValueError, match=r"unknown inner level .*; there are auto, projection, propagate, none, ipopt, ipopt-feasibility$"
        ):
            inner_solver(wrong)  # type: ignore[arg-type]


def test_a_projection_is_newtons_method_and_ipopt_on_what_that_leaves() -> None:
    """Where p = 0 there is no slope for Newton's method to follow."""
    problem = still("root")
    p, q = problem.parameter("p", bounds=(0.0, 1.0)), problem.parameter("q", bounds=(0.0, 2.0))
    problem.constraint("curve", ca.sqrt(p) + q, lower=1.0, upper=1.0, scale=1.0)
    problem.minimize("f", p + q**2)
    nlp, C = nlp_of(problem, DFET(1, 0)), np.array([[0.25, 1.0], [0.0, 0.0], [0.0, 1.0]])
    newton, found = (level.solve(nlp, C, tolerance=1e-8) for level in (Newton(), Projection()))
    assert newton.status.tolist() == ["converged", "infeasible", "converged"] and set(found.status) == {"converged"}
    ipopt = Ipopt(max_iterations=levels.PROJECTION_ITERATIONS).solve(nlp, C[[1]], tolerance=1e-8)
    for name in ("z", "F", "violation", "status", "moved", "residuals"):
        one, other, both = (getattr(result, name) for result in (newton, ipopt, found))
        assert np.array_equal(both, [one[0], other[0], one[2]]), name
    assert np.array_equal(found.iterations, newton.iterations + np.array([0, ipopt.iterations[0], 0]))
    assert found.work == newton.work + ipopt.iterations.sum() and found.fallbacks == 1 and not found.clocked


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


@pytest.mark.parametrize("kind", [float, int])
def test_a_warm_start_gives_the_states_and_is_left_as_it_is(kind: type) -> None:
    """Also where it has whole numbers, which are no reason to round the candidates."""
    nlp, C = hop_nlp(), candidates(hop_nlp(), 2)
    warm = np.full((2, len(nlp.variables)), 3, dtype=kind)
    Z = started(nlp, C, warm)
    states = np.setdiff1d(np.arange(len(nlp.variables)), nlp.free)
    assert np.array_equal(Z[:, nlp.free], C) and len(states) and (Z[:, states] == 3).all()
    assert (warm == 3).all() and np.array_equal(started(nlp, C, None), nlp.guessed(C))


def test_scores_are_of_what_is_within_the_tolerance_and_of_what_is_no_number() -> None:
    """The limit itself is within; what is no number has failed, and is the start again."""
    nlp, violation = hop_nlp(), np.array([-1.0, 1e-3, np.nextafter(1e-3, 1.0), 5.0, np.nan, np.inf, 0.0])
    broken, good = np.arange(7) > 3, np.arange(7) < 2
    start = nlp.guessed(np.zeros((7, len(nlp.free))))
    Z, residuals, F = start.copy(), np.full((7, len(nlp.variables) + len(nlp.g_lower)), -1.0), np.zeros((7, 2))
    Z[:, nlp.free[0]] += 0.5 * nlp.span[nlp.free[0]]
    residuals[:, 2], F[6, 0] = violation, np.nan
    for otherwise in ("infeasible", "timeout"):
        found = scored(nlp, (Z.copy(), F.copy(), residuals), start, np.full(7, otherwise), np.arange(7), 1e-3)
        assert found.status.tolist() == np.select([broken, good], ["failed", "converged"], otherwise).tolist()
        assert np.array_equal(found.violation, np.where(broken, np.inf, np.maximum(violation, 0.0)))
        assert np.array_equal(np.isnan(found.F).all(axis=1), broken) and found.clocked is (otherwise == "timeout")
        assert np.array_equal(found.z, np.where(broken[:, None], start, Z)) and found.moved == pytest.approx(np.where(broken, 0.0, 0.5))
        assert np.array_equal(found.iterations, np.arange(7)) and found.residuals is residuals


def test_what_a_batch_is_charged_is_counted(monkeypatch):
    """Twice the candidates take twice as much beside the batch itself, with a compiler or without; iterations of IPOPT have their price."""
    charged = {}
    for compiled in ("0", "always"):
        monkeypatch.setenv("MACS_COMPILE", compiled)
        nlp = DFET(2, 3).transcribe(load("goddard"))
        some = (nlp.lower + 0.5 * nlp.span)[nlp.free][None].repeat(4, axis=0)
        for count in (2, 4):
            before = spent(nlp)
            inner_solver("propagate").solve(nlp, some[:count])
            charged[compiled, count] = spent(nlp) - before
    assert charged["0", 4] == 2 * charged["0", 2] > 0 and charged["0", 4] == charged["always", 4]
    before, iterations = spent(nlp), inner_solver("ipopt-feasibility").solve(nlp, some[:1]).iterations.sum()
    assert spent(nlp) - before > solves_charge(nlp, 0, int(iterations)) > 0
