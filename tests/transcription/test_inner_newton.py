"""Newton's method on what propagation leaves: against differences, IPOPT, and small programs whose nearest feasible point is known."""

import shutil
import warnings
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest
from cases import candidates, total_derivatives
from euler import Euler
from hypothesis import given, settings
from hypothesis import strategies as st
from smooth_problems import nlp_of, still

from problems import Problem, load
from transcription import DFET, NLP, InnerResult
from transcription.inner import Newton
from transcription.inner.base import newton_work
from transcription.inner.least_distance import least_distance
from transcription.inner.newton import NEAREST_ITERATIONS, Anderson
from transcription.stopping import stopped_by


def two_phases():
    """A glider with a linked second phase, a parameter, a path constraint, an integral constraint and a bounded peak."""
    problem = Problem("relay")
    drag = problem.parameter("drag", bounds=(0.1, 0.3))
    first = problem.phase("first", t0=0.0, tf=(0.5, 2.0))
    second = problem.phase("second", t0=(0.5, 2.0), tf=(2.0, 5.0))
    for phase in (first, second):
        phase.state("x", bounds=(-5, 5), initial=0.0 if phase is first else None, final=None if phase is first else 1.0)
        phase.state("v", bounds=(-5, 5), initial=0.0 if phase is first else None)
        phase.control("u", bounds=(-2, 2))
        phase.dynamics(x=phase["v"], v=phase["u"] - drag * phase["v"] * ca.fabs(phase["v"]) + 0.1 * ca.sin(phase.time))
    problem.link(first, second)
    second.path("speed", second["v"] ** 2, upper=4.0)
    problem.constraint("work", first.integral(first["u"] ** 2) + second.integral(second["u"] ** 2), upper=3.0)
    problem.constraint("strain", second.peak(second["u"] * second["v"]), upper=1.0)
    problem.minimize("time", second.tf)
    problem.minimize("effort", second.integral(second["u"] ** 2))
    return problem


@pytest.mark.slow
@pytest.mark.parametrize(
    ("problem", "mesh"),
    [(load("goddard"), DFET(3, 3, control_order=4, basis="bernstein")), (two_phases(), DFET(3, 2)), (two_phases(), Euler(6))],
    ids=["bernstein", "two phases", "default derivatives"],
)
def test_total_derivatives_are_those_of_differences(problem, mesh):
    nlp = mesh.transcribe(problem)
    inner = nlp.lower[nlp.free] + 0.1 * nlp.span[nlp.free] + 0.8 * (candidates(nlp, 2) - nlp.lower[nlp.free])
    total_derivatives(nlp, nlp.first_guess(inner))


def test_what_propagation_leaves_is_what_the_nlp_says():
    nlp = DFET(3, 2).transcribe(two_phases())
    propagated = nlp.reduced.propagate(nlp.first_guess(candidates(nlp, 4)))
    reduced = nlp.reduced
    outside = np.maximum(np.maximum(reduced.lower - propagated.values, propagated.values - reduced.upper) / reduced.scale, 0).max(axis=1)
    assert outside == pytest.approx(nlp.evaluate(propagated.Z)[1], rel=1e-9)


@pytest.mark.slow
@pytest.mark.skipif(not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="no C compiler")
def test_compiled_functions_give_the_same_bits(monkeypatch):
    problem = load("goddard")
    monkeypatch.setenv("MACS_COMPILE", "0")
    C = candidates(DFET(3, 3).transcribe(problem), 12)
    expected = Newton().solve(DFET(3, 3).transcribe(problem), C)
    monkeypatch.setenv("MACS_COMPILE", "always")
    nlp = DFET(3, 3).transcribe(problem)
    for _ in range(2):
        found = Newton().solve(nlp, C)
        assert np.array_equal(found.z, expected.z) and np.array_equal(found.iterations, expected.iterations)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 6), st.integers(1, 3))
def test_least_distance_satisfies_the_conditions_of_a_nearest_point(seed, d, r):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((1, r, d))
    inside = rng.uniform(0.2, 0.8, (1, d))
    b = (A @ inside[:, :, None])[:, :, 0]
    gap = np.where(rng.random((1, r)) < 0.5, 0.0, 0.1)
    center = rng.uniform(-1, 2, (1, d))
    x, met, _ = least_distance(center, A, b - gap, b + gap, (np.zeros((1, d)), np.ones((1, d))), np.zeros((1, r)))
    if met[0]:
        # No feasible direction, of many, leads nearer to the centre.
        others = inside + 0.2 * rng.standard_normal((200, d))
        values = others @ A[0].T
        fine = ((others >= 0) & (others <= 1)).all(axis=1) & (np.abs(values - b) <= gap + 1e-12).all(axis=1)
        fine = np.vstack([others[fine], inside])
        assert np.linalg.norm(x - center) <= np.linalg.norm(fine - center, axis=1).min() + 1e-6


@pytest.mark.parametrize("broken", [np.nan, np.inf, -np.inf])
def test_derivatives_that_are_no_numbers_stop_no_search(broken):
    A, b, box = np.array([[[1.0, 2.0]], [[broken, 1.0]]]), np.full((2, 1), 1.2), (np.zeros((2, 2)), np.ones((2, 2)))
    center = np.array([[0.2, 0.3], [0.4, 1.5]])
    with np.errstate(invalid="ignore"):
        x, met, multipliers = least_distance(center, A, b, b, box, np.zeros((2, 1)))
    alone, _, _ = least_distance(center[:1], A[:1], b[:1], b[:1], (box[0][:1], box[1][:1]), np.zeros((1, 1)))
    assert met.tolist() == [True, False] and np.isfinite(multipliers).all()
    assert x == pytest.approx(np.array([alone[0], [0.4, 1.0]]), abs=1e-9)


SMALLEST = DFET(1, 0)
"""One coefficient of each control."""


def plane(limits: Callable[[Any, Any], list[tuple[Any, dict[str, float]]]], bounds: Any = ((-2.0, 2.0), (-2.0, 2.0))) -> NLP:
    """Two parameters p and q within bounds, and limits of expressions of them."""
    problem = still("plane")
    p, q = (problem.parameter(name, bounds=one) for name, one in zip("pq", bounds, strict=True))
    for k, (expression, sides) in enumerate(limits(p, q)):
        problem.constraint(f"limit {k}", expression, scale=1.0, **sides)
    problem.minimize("f", p)
    problem.minimize("g", q)
    return nlp_of(problem, SMALLEST)


def circle(radius: float, others: Callable[[Any, Any], list[tuple[Any, dict[str, float]]]] = lambda p, q: []) -> NLP:
    return plane(lambda p, q: [(p**2 + q**2, {"lower": radius**2, "upper": radius**2}), *others(p, q)])


def solve(nlp: NLP, candidates: Any, **settings: Any) -> tuple[np.ndarray, InnerResult]:
    """The free variables of what is found, and all else."""
    found = Newton(**settings).solve(nlp, np.array(candidates, dtype=float))
    return found.z[:, nlp.free], found


@pytest.mark.parametrize("width", [1.0, 50.0])
def test_the_nearest_point_of_a_line_is_nearest_in_spans_and_in_the_box(width: float) -> None:
    # p + q = 1 in spans: half of what is missing is added to each, as far as the box goes.
    nlp = plane(lambda p, q: [(p + q / width, {"lower": 1.0, "upper": 1.0})], ((0, 1), (0, width)))
    x, found = solve(nlp, np.array([[0.2, 0.3], [1.0, 0.9], [0.0, 0.0], [0.95, 0.05]]) * [1, width])
    assert x == pytest.approx(np.array([[0.45, 0.55], [0.55, 0.45], [0.5, 0.5], [0.95, 0.05]]) * [1, width], abs=1e-9 * width)
    assert set(found.status) == {"converged"}
    assert found.moved == pytest.approx(np.sqrt(2) * np.array([0.25, 0.45, 0.5, 0.0]), abs=1e-9)
    # Steps are no longer than 0.3 spans: so many lead there, one more is nothing, and then it is seen.
    assert (found.iterations <= [4, 5, 5, 1]).all()


def test_a_bound_keeps_the_nearest_point_where_it_is() -> None:
    # On q - 3 p = 1, from (-2, -2) the nearest is at p = (-2 + 3 (-3))/10 = -1.1: it has q = -2.3, and the box ends at -2.
    nlp = plane(lambda p, q: [(q - 3 * p, {"lower": 1.0, "upper": 1.0})])
    x, found = solve(nlp, [[-2, -2], [2, 2]])
    assert x == pytest.approx(np.array([[-1.0, -2.0], [1 / 3, 2.0]]), abs=1e-9) and set(found.status) == {"converged"}


@pytest.mark.parametrize("radius", [1.0, 0.1, 0.01])
def test_the_nearest_point_of_a_circle(radius: float) -> None:
    """However much its curvature makes the plain steps diverge: from afar, in radii, they overshoot more the farther it is."""
    C = np.array([[1.5, 0.5], [0.3, 0.4], [-2.0, 1.0], [0.5, -1.5]])
    x, found = solve(circle(radius), C)
    assert set(found.status) == {"converged"} and found.iterations.max() <= 20
    assert x == pytest.approx(radius * C / np.linalg.norm(C, axis=1)[:, None], abs=5e-6)


def test_an_inequality_stands_where_the_circle_alone_would_be_nearer() -> None:
    # The arc with p + q >= 1.2 ends where p is 0.6 +- sqrt(0.14).
    nlp = circle(1.0, lambda p, q: [(p + q, {"lower": 1.2})])
    end = np.sqrt(0.14)
    x, found = solve(nlp, [[0.55, -0.92], [0.17, 1.74], [1.26, -1.99], [1.5, 1.5]])
    assert x == pytest.approx(np.array([[0.6 + end, 0.6 - end], [0.6 - end, 0.6 + end], [0.6 + end, 0.6 - end], [0.5**0.5] * 2]), abs=1e-5)
    assert set(found.status) == {"converged"}


def test_steps_are_found_exactly_as_often_as_is_allowed() -> None:
    """On three half-planes, of which steps that guess what is active go round in circles: the nearest point to (1, 0) is (0, 1/2)."""
    sides = lambda p, q: [(q - 2 * p, {"lower": -1.0}), (-2 * p - q, {"lower": -0.5}), (3 * p + 3 * q, {"lower": 1.5})]  # noqa: E731
    statuses, nlp = {}, plane(sides, ((0.0, 1.0), (0.0, 1.0)))
    for exact in (0, 1, 1000):
        x, found = solve(nlp, [[1.0, 0.0]], exact=exact)
        statuses[exact] = found.status[0]
    assert statuses == {0: "infeasible", 1: "infeasible", 1000: "converged"}
    assert x == pytest.approx(np.array([[0.0, 0.5]]), abs=1e-9)


@pytest.mark.parametrize("turn", [2 * np.pi, 1.0, 360.0])
def test_a_periodic_control_goes_the_short_way_round(turn: float) -> None:
    # x' = cos(u - 1/2) for 2 time units comes to -2 cos(0.3) where u is 1/2 + pi - 0.3, which lies beyond pi, or less than that by 5.7.
    problem = Problem("round")
    rest, unit = problem.parameter("rest", bounds=(0, 1)), turn / (2 * np.pi)
    run = problem.phase("run", t0=0, tf=2)
    run.state("x", bounds=(-5, 5), initial=0, final=-2 * np.cos(0.3))
    u = run.control("u", bounds=(-turn / 2, turn / 2), period=turn)
    run.dynamics(x=ca.cos(u / unit - 0.5))
    problem.minimize("drift", run.integral(u) + rest)
    nlp = nlp_of(problem, SMALLEST)
    starts = np.array([3.1, 2.9, -3.1])
    candidates = np.ones((3, 2))
    own = [nlp.variables[i].name for i in nlp.free].index("rest")
    candidates[:, 1 - own] = unit * starts
    x, found = solve(nlp, candidates)
    assert set(found.status) == {"converged"}
    assert x[:, 1 - own] / unit == pytest.approx([0.2 - np.pi] * 3, abs=1e-6)
    assert found.moved * 2 * np.pi == pytest.approx([np.pi + 0.2 - 3.1, np.pi + 0.2 - 2.9, 0.2 - np.pi + 3.1], abs=1e-6)
    assert x[:, own] == pytest.approx(1.0), "what has no period stays at its bound"


def test_at_a_kink_no_point_is_the_nearest_and_after_patience_a_feasible_one_will_do() -> None:
    # Of q = |p|/20, seen from below, the kink is nearest; on either side the tangent leads across it.
    nlp = plane(lambda p, q: [(q - 0.05 * ca.fabs(p), {"lower": 0.0, "upper": 0.0})])
    C = [[0.01, -1.0], [0.003, -0.5], [-0.02, -1.5]]
    _, early = solve(nlp, C, max_iterations=NEAREST_ITERATIONS + 1)
    assert set(early.status) == {"infeasible"} and early.iterations.tolist() == [NEAREST_ITERATIONS + 1] * 3
    _, late = solve(nlp, C, max_iterations=NEAREST_ITERATIONS + 4)
    assert set(late.status) == {"converged"} and late.violation.max() <= 1e-7 and (late.iterations > NEAREST_ITERATIONS).all()
    assert late.moved == pytest.approx(np.array([1.0, 0.5, 1.5]) / 4, rel=0.05), "near the nearest all the same"


def test_the_best_point_is_kept_when_iterations_run_out() -> None:
    C = [[1.5, 0.5], [0.3, 0.4], [-2.0, 1.0]]
    worst = np.array([solve(circle(1.0), C, max_iterations=n)[1].violation for n in range(1, 8)])
    assert (np.diff(worst, axis=0) <= 1e-6).all() and (worst[0] > 0.1).all() and (worst[-1] <= 1e-6).all()
    x, found = solve(circle(1.0), C, max_iterations=1)
    assert x == pytest.approx(np.array(C)) and set(found.status) == {"infeasible"} and found.iterations.tolist() == [1] * 3


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
def test_feasible_is_what_is_within_the_tolerance(tolerance: float) -> None:
    found = Newton().solve(circle(1.0), np.array([[1.5, 0.5], [0.3, 0.4]]), tolerance=tolerance)
    assert set(found.status) == {"converged"} and found.violation.max() <= tolerance
    # What is a little off is left where it is, or not, by what counts as off.
    near = np.array([[1 + 0.02 * tolerance, 0.0], [1 + 2 * tolerance, 0.0]])
    found = Newton().solve(circle(1.0), near, tolerance=tolerance)
    assert set(found.status) == {"converged"} and found.iterations[0] == 1 < found.iterations[1]
    assert found.moved[0] < 1e-15 < 0.4 * tolerance < found.moved[1]


def test_what_is_not_done_when_the_work_ends_says_so_and_work_is_counted_by_steps() -> None:
    nlp = circle(1.0)
    with stopped_by(lambda: True):
        x, found = solve(nlp, [[1.0, 0.0], [1.5, 0.5], [0.0, -1.0]])
    assert found.status.tolist() == ["converged", "timeout", "converged"]
    assert x == pytest.approx(np.array([[1.0, 0.0], [1.5, 0.5], [0.0, -1.0]])) and found.iterations.tolist() == [1, 1, 1]
    for C, iterations in (([[1.0, 0.0]], 1), ([[1.0, 0.0]] * 3, 3), ([[1.5, 0.5]], 5)):
        found = Newton().solve(nlp, np.array(C))
        assert found.iterations.sum() == pytest.approx(iterations, abs=1 if iterations > 3 else 0)
        assert found.work == pytest.approx(found.iterations.sum() * newton_work(nlp)) and found.work > 0


def test_overflow_and_slopes_that_are_no_numbers_show_in_the_results_and_warn_nobody() -> None:
    steep = plane(lambda p, q: [(1e300 * p**9 * ca.exp(5 * q), {"lower": 0.0, "upper": 1e-10})])
    root = plane(lambda p, q: [(ca.sqrt(p) + q, {"lower": 1.0, "upper": 1.0})], ((0.0, 1.0), (0.0, 2.0)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        _, overflown = solve(steep, [[2.0, 2.0], [-2.0, 2.0], [1.9, 1.8], [0.0, 1.0]])
        x, other = solve(root, [[0.0, 0.0], [0.25, 1.0], [0.0, 1.0]])
    assert overflown.status.tolist() == ["infeasible"] * 3 + ["converged"] and (overflown.violation[:3] > 1e290).all()
    # At p = 0 there is no slope to follow; elsewhere the nearest point has one of 1/(2 sqrt(p)).
    assert other.status.tolist() == ["infeasible", "converged", "converged"] and x[0].tolist() == [0.0, 0.0]


@pytest.mark.parametrize("size", [1e-8, 1.0, 1e8])
@pytest.mark.parametrize("d", [1, 2, 4])
def test_linear_iterations_end_once_all_directions_are_known(d: int, size: float) -> None:
    rng = np.random.default_rng(d)
    A, root = -np.eye(d) + 0.5 * rng.standard_normal((d, d)), size * rng.standard_normal((3, d))
    anderson, points = Anderson(3, d, d), [root + size * rng.standard_normal((3, d))]
    for _ in range(d + 3):
        points.append(points[-1] + anderson.improve(points[-1], (points[-1] - root) @ A.T, np.ones(3, dtype=bool)))
    plain = points[0] + (points[0] - root) @ A.T
    assert points[1] == pytest.approx(plain, rel=1e-12), "the first step is the plain one"
    assert np.abs(points[d] - root).max() > 1e-3 * size
    assert points[d + 1] == pytest.approx(root, abs=1e-5 * size) and points[-1] == pytest.approx(root, abs=1e-8 * size)
