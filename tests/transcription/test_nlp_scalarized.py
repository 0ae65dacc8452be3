"""One gradient solve: known answers for every form of scalarisation, and what it does where there is none."""

from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from smooth_problems import compass, nlp_of, shuttle, slide, two_wells, vector, with_peak

from problems import Problem, load
from problems.cases.goddard import reference
from transcription import DFET, NLP, Collocation, MultipleShooting
from transcription.inner import inner_solver
from transcription.nlp import scalarized
from transcription.nlp.program import nlp_scales
from transcription.nlp.scalarized import Solved, scalarize

INF = np.inf
RANGES = np.array([141.0, 0.9])


@cache
def goddard() -> NLP:
    return DFET(4, 6).transcribe(load("goddard"))


@cache
def orbit() -> NLP:
    return DFET(30, 1).transcribe(load("orbit_rise_full"))


def feasible(nlp: NLP, seed: int) -> np.ndarray:
    """A feasible vector (n,) from random controls."""
    rng = np.random.default_rng(seed)
    candidates = nlp.lower[nlp.free] + rng.random((1, len(nlp.free))) * nlp.span[nlp.free]
    found = inner_solver("auto").solve(nlp, candidates)
    assert found.status[0] == "converged"
    return found.z[0]


def close(solved: Solved, F: object, miss: float) -> bool:
    return bool(np.allclose(solved.F, F, rtol=0, atol=miss))


def solve(nlp: NLP, reference: list[float], weights: list[float], start: np.ndarray | None = None, **more: object) -> Solved:
    first = nlp.propagate(nlp.first_guess(0.5 * (nlp.lower[nlp.free] + nlp.upper[nlp.free])[None]))[0] if start is None else start
    return scalarize(nlp, first, reference=np.array(reference), weights=np.array(weights), **more)  # type: ignore[arg-type]


def test_scalarisations_go_along_weights_to_hard_limits_and_below_ceilings() -> None:
    # Along the diagonal from (0, 0): p^2 = (p - 1)^2.
    solved = solve(nlp_of(two_wells()), [0, 0], [1, 1])
    assert solved.status == "converged" and solved.violation <= 1e-6
    assert close(solved, [0.25, 0.25], 1e-8)
    steep = solve(nlp_of(two_wells()), [0, 0], [1, 4])
    assert close(steep, [1 / 9, 4 / 9], 1e-8)
    solved = solve(nlp_of(two_wells()), [0, 0.36], [1, 0])
    assert solved.status == "converged" and close(solved, [0.16, 0.36], 1e-8)
    solved = solve(nlp_of(two_wells()), [INF, 0], [1, 1])
    assert solved.status == "converged" and close(solved, [1, 0], 1e-7)
    solved = solve(nlp_of(two_wells()), [0, 0], [1, 1], ceiling=np.array([INF, 0.04]))
    assert solved.status == "converged" and close(solved, [0.64, 0.04], 1e-7)


def test_the_answer_does_not_depend_on_where_alpha_is_zero_or_what_it_measures() -> None:
    nlp = nlp_of(slide())
    answers = [solve(nlp, [0, a], [w, w]).F for a, w in ((0, 1), (0, 1e-6), (0, 1e6))]
    far = solve(nlp, [-1e6, -1e6], [1, 1]).F
    for F in (*answers, far):
        assert np.allclose(answers[0], F, rtol=0, atol=1e-7)


@pytest.mark.slow
def test_goddard_meets_the_linear_tangent_law() -> None:
    truth = reference(401)
    for tf in (115.0, 180.0, 250.0):
        solved = solve(goddard(), [tf, 0], [0, 1], feasible(goddard(), 0))
        assert solved.status == "converged" and solved.violation <= 1e-6
        miss = 1e-6 if tf > 115 else 2e-6
        assert -solved.F[1] == pytest.approx(np.interp(solved.F[0], *truth.T), abs=10 * miss)


def test_the_same_solve_gives_the_same_bits() -> None:
    nlp, start = goddard(), feasible(goddard(), 2)
    one, two = (solve(nlp, [150, -1], [1, 0.01], start) for _ in range(2))
    assert np.array_equal(one.z, two.z) and one.iterations == two.iterations and not one.clocked


@pytest.mark.slow
@settings(max_examples=15, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10_000), orbits=st.booleans())
def test_a_guarded_solve_makes_no_objective_worse(seed: int, orbits: bool) -> None:
    nlp, ranges = (orbit(), np.array([60.0, 0.34])) if orbits else (goddard(), RANGES)
    start = feasible(nlp, seed)
    (F,), _ = nlp.evaluate(start[None])
    solved = scalarize(nlp, start, reference=F, weights=ranges)
    assert solved.status == "converged" and solved.violation <= 1e-6
    assert np.all((solved.F - F) / ranges <= 1e-7)
    # Once more, from the front, with the front as ceiling: nothing is lost, whatever IPOPT does inside.
    again = scalarize(nlp, solved.z, reference=solved.F, weights=ranges, ceiling=solved.F)
    assert again.status == "converged" and np.all((again.F - solved.F) / ranges <= 1e-7)


@pytest.mark.parametrize(("first", "second"), [(1.0, 1.0), (3.0, 1.0), (1e-6, 3e-6), (0.0, 2.0)])
def test_the_least_weighted_sum(first: float, second: float) -> None:
    # first p^2 + second (p - 1)^2 is least at second / (first + second).
    p = second / (first + second)
    solved = solve(nlp_of(two_wells()), [0, 0], [first, second], summed=True)
    assert solved.status == "converged" and close(solved, [p**2, (p - 1) ** 2], 1e-7)
    found = solved.multipliers.of_objectives
    assert found / found.sum() == pytest.approx([first / (first + second), p], abs=1e-6)


@pytest.mark.parametrize("summed", [False, True])
def test_a_start_with_multipliers_takes_fewer_iterations_to_the_same(summed: bool) -> None:
    nlp, reference = goddard(), np.array([150.0, -0.3])
    known = scalarize(nlp, feasible(nlp, 1), reference=reference, weights=RANGES if not summed else 1 / RANGES, summed=summed)
    task = {"reference": np.array([155.0, -0.3]), "weights": RANGES if not summed else [1.1, 1.0] / RANGES, "summed": summed}
    cold, warm = (scalarize(nlp, known.z, near=True, warm=one, **task) for one in (None, known.multipliers))
    assert warm.status == "converged" and warm.iterations < cold.iterations
    assert pytest.approx(cold.F, rel=1e-6) == warm.F


@pytest.mark.parametrize("course", [2.8, -2.8, 0.3, 3.1415])
def test_a_periodic_control_passes_the_end_of_its_box(course: float) -> None:
    nlp = nlp_of(compass())
    solved = solve(nlp, [0, INF], [1, 1], vector(nlp, u=course))
    assert solved.status == "converged" and solved.F[0] == pytest.approx(-2, abs=1e-8)
    assert np.all((solved.z >= nlp.lower) & (solved.z <= nlp.upper))
    # South-west, seen from the north: the way leads over the end of the box.
    south = solve(nlp, [0, 0], [1, 1], vector(nlp, u=2.5))
    assert close(south, [-np.sqrt(2), -np.sqrt(2)], 1e-8)


def test_a_peak_is_minimised_in_epigraph_form() -> None:
    nlp = nlp_of(shuttle())
    solved = solve(nlp, [2, 0], [0, 1])
    # Bang-bang, with the switch at an end of an element: thrust 4/tf^2.
    assert solved.status == "converged" and close(solved, [2, 1], 1e-6)
    ignored = solve(nlp, [0, INF], [1, 1])
    assert ignored.status == "converged" and ignored.F[0] == pytest.approx(1)
    assert ignored.F[1] >= 16 - 1e-5 and np.array_equal(nlp.tighten(ignored.z[None])[0], ignored.z)


@pytest.mark.parametrize(
    ("use", "name"),
    [
        ("maximised", "objective 'speed'"),
        ("minimum minimised", "objective 'least speed'"),
        ("bounded below", "constraint 'fast enough'"),
        ("equal", "constraint 'just so'"),
    ],
)
def test_other_uses_of_peaks_are_refused(use: str, name: str) -> None:
    nlp = nlp_of(with_peak(use))
    with pytest.raises(ValueError, match=f"{name} of problem 'shuttle' .* of phase 'trip'"):
        solve(nlp, [0] * len(nlp.problem.goals), [1] * len(nlp.problem.goals))


def test_what_cannot_be_reached_is_infeasible() -> None:
    problem = slide()
    problem.constraint("too far", problem.phases["run"].final(problem.phases["run"]["x"]), lower=4.5)
    solved = solve(nlp_of(problem), [0, 0], [1, 1])
    assert solved.status in ("infeasible", "failed") and solved.violation > 1e-3
    contradictory = solve(nlp_of(two_wells()), [0.01, 0], [0, 1], ceiling=np.array([INF, 0.01]))
    assert contradictory.status != "converged"


def test_a_solve_says_which_limit_ended_it() -> None:
    solved = solve(goddard(), [150, -0.5], RANGES.tolist(), feasible(goddard(), 1), max_iterations=6)
    assert solved.status == "failed" and solved.message == "the limit of 6 iterations was reached" and solved.iterations <= 6
    assert solve(goddard(), [150, -0.5], RANGES.tolist(), feasible(goddard(), 1)).message == ""


def test_a_solve_that_ends_in_its_boxes_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    # Each of four boxes lets p move by a tenth of its span: not from 2 to 0, where the left well is.
    monkeypatch.setattr(scalarized, "_strategies", lambda *_: (scalarized.NEAR,))
    nlp = nlp_of(two_wells())
    solved = solve(nlp, [0, INF], [1, 1], vector(nlp, p=2.0, q=0.0))
    assert solved.status == "failed" and solved.message == scalarized.IN_BOX and solved.violation <= 1e-6
    assert solved.z[0] == pytest.approx(2.0 - 4 * 0.1 * nlp.span[0], abs=0.01 * nlp.span[0])


def test_what_is_solved_to_ipopt_but_not_feasible_says_by_how_much(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scalarized._Task, "excess", lambda *_: 8.9e-4)
    solved = solve(nlp_of(two_wells()), [0, 0.36], [1, 0])
    assert solved.status == "infeasible" and solved.message == "it ended where limits are exceeded by 8.9e-04 of their scales"


@pytest.mark.slow
def test_an_objective_is_not_lost_in_the_scale_of_an_explosion_elsewhere():
    """Shooting into states where exp(25 x) grows without limit: the slopes of the cost over the box have a median of 1e100 or more."""
    problem = load("standard/stirred_tank").compile()
    known = Collocation(16, 4, points="gauss").nlp(problem)
    optimum = scalarize(known, known.first_guess(np.full((1, len(known.free)), 1.0))[0], reference=np.zeros(1), weights=np.ones(1))
    nlp = MultipleShooting(120, steps=2, control="linear").nlp(problem)
    start = nlp.interpolate(known.unpack(optimum.z))
    assert nlp_scales(nlp)[0] > 1e50
    solved = scalarize(nlp, start, reference=np.zeros(1), weights=np.ones(1))
    assert solved.status == "converged" and solved.F[0] == pytest.approx(0.1330957, rel=1e-5)


def test_where_a_peak_is_infinite_no_solve_begins():
    problem = Problem("logarithm")
    phase = problem.phase("p", t0=0.0, tf=1.0)
    x, u = phase.state("x", bounds=(-1, 1), initial=0.0), phase.control("u", bounds=(-1, 1))
    phase.dynamics(x=u)
    problem.minimize("largest", phase.peak(ca.log(x)))
    nlp = DFET(2, 1).transcribe(problem)
    start = nlp.tighten(nlp.first_guess(np.zeros((1, len(nlp.free)))))[0]
    assert start.min() == -np.inf
    solved = scalarized.scalarize(nlp, start, reference=np.zeros(1), weights=np.ones(1))
    assert solved.status == "failed" and not solved.begun and not solved.clocked


def regulated(wide: float = 1.0, **more: int) -> Solved:
    """x' = u from 0 to 1 with the least integral of x^2 + u^2: its value is coth(1)."""
    problem = Problem("regulator")
    phase = problem.phase("phase", t0=0, tf=1)
    x, u = phase.state("x", bounds=(-5 * wide, 5 * wide), initial=0, final=1), phase.control("u", bounds=(-10 * wide, 10 * wide))
    phase.dynamics(x=u)
    problem.minimize("effort", phase.integral(x**2 + u**2))
    nlp = DFET(4, 5).nlp(problem)
    return solve(nlp, [0.0], [1.0], nlp.first_guess(np.zeros((1, len(nlp.free))))[0], **more)


@pytest.mark.parametrize("wide", [1.0, 1e4])
def test_the_widths_of_bounds_do_not_matter(wide: float) -> None:
    found = regulated(wide, max_iterations=60)
    assert found.status == "converged" and abs(found.F[0] - 1 / np.tanh(1)) < 1e-6


def test_what_is_solved_to_a_useful_accuracy_has_not_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    # The last iterations are quick, so that few limits end a solve where it is nearly done.
    failed = regulated(max_iterations=4, persistent=False)
    assert failed.status == "failed" and failed.message == "the limit of 4 iterations was reached"
    monkeypatch.setattr(scalarized, "SOLVE", replace(scalarized.SOLVE, useful=1e-2))
    useful = regulated(max_iterations=4, persistent=False)
    assert useful.status == "converged" and "the limit of 4 iterations" in useful.message and "optimality hold to" in useful.message
    assert abs(useful.F[0] - 1 / np.tanh(1)) < 1e-6
    assert regulated(max_iterations=2, persistent=False).status == "failed"
