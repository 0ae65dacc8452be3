"""Any point of a front: against closed forms, what lies off the front, valleys, and what stands in the way."""

import logging
from functools import cache

import numpy as np
import pytest
from rest_to_rest import MESH, balanced, cart, crossing, effort
from scipy.optimize import minimize

from macs import NSGA2, Front, Point, sweep
from macs.gradients.predictor import shares
from problems import Problem
from transcription import DFET


@cache
def front() -> Front:
    """Effort 12 / T^3 against T, from 0.5 to 4."""
    return sweep(cart(), MESH, points=9, starts=1)


def known_optimum(point: Point, T: float) -> None:
    assert point.objectives["time"] == pytest.approx(T, abs=3e-6)
    assert point.objectives["effort"] == pytest.approx(effort(T), rel=1e-5)
    assert point.verified and point.optimality < 1e-6
    assert point.weights["effort"] / point.weights["time"] == pytest.approx(T**4 / 36, rel=1e-3)


@pytest.mark.parametrize("T", [0.55, 1.234, 3.7])
def test_a_point_has_the_value_that_is_asked_for_and_the_best_other_one(T):
    point = front().at({"time": T})
    known_optimum(point, T)
    known_optimum(front().at({"effort": effort(T)}), T)
    assert point.note == "" and point.stats["gradient_solves"] <= 2
    assert point.trajectory["trip"].at(0.0)["u"] == pytest.approx(6 / T**2, rel=1e-3)


def test_a_solve_that_begins_with_multipliers_takes_few_iterations():
    assert front().at({"time": 2.5}).stats["inner_iterations"] <= 3, "4 without the prediction, more without multipliers"


@pytest.mark.parametrize(("e", "t"), [(1.0, 1.0), (1.0, 10.0), (0.05, 1.0)])
def test_the_least_weighted_sum_in_ranges(e, t):
    F = front().objectives
    T = balanced(e / np.ptp(F[:, 0]), t / np.ptp(F[:, 1]))
    known_optimum(front().at(weights={"effort": e, "time": t}), T)


@pytest.mark.parametrize(("reference", "off"), [({"effort": 5.0, "time": 0.9}, "misses"), ({"effort": 30.0, "time": 2.0}, "better in all")])
def test_the_nearest_point_lies_along_the_ranges_from_a_reference(reference, off):
    widths = np.ptp(front().objectives, axis=0)
    point = front().nearest(reference)
    known_optimum(point, crossing((reference["effort"], widths[0]), (reference["time"], widths[1])))
    assert off in point.note
    on = front().nearest(point.objectives)
    assert on.note == "" and on.objectives == pytest.approx(point.objectives, rel=1e-5)


@pytest.mark.parametrize(
    ("goals", "T", "words"),
    [({"time": 0.3}, 0.5, "time 0.3 is out of reach"), ({"time": 9.0}, 4.0, "time 9:"), ({"effort": 0.1}, 4.0, "out of")],
)
def test_what_lies_off_the_front_gets_the_nearest_point_on_it_and_is_told_so(goals, T, words, caplog):
    with caplog.at_level(logging.INFO, "macs.refinement.places"):
        point = front().at(goals)
    assert point.objectives["time"] == pytest.approx(T, abs=2e-5) and point.objectives["effort"] == pytest.approx(effort(T), rel=1e-4)
    assert words in point.note and words in caplog.text and point.verified


def test_points_on_meshes_of_their_own():
    fine = sweep(cart(), DFET(6, 3), points=4, starts=1)
    mixed = Front.merge([front()[::4], fine[1:-1]])
    assert len({str(one.transcription) for one in mixed}) == 2
    for T in (0.8, 2.5):
        known_optimum(mixed.at({"time": T}), T)


def test_a_dense_front_has_even_steps_and_is_exact():
    dense = front().dense(33)
    F = dense.objectives
    assert len(dense) == 33 and dense.verified.all() and dense.message == ""
    assert F[:, 0] == pytest.approx([effort(T) for T in F[:, 1]], rel=1e-4)
    steps = np.diff((F / np.ptp(front().objectives, axis=0)) @ [1.0, -1.0])
    assert steps == pytest.approx(np.full(32, 2 / 32), rel=1e-3)
    solves, iterations = (dense.stats[name] - front().stats[name] for name in ("gradient_solves", "inner_iterations"))
    assert solves == 31 and iterations <= 80, "more where places are not taken from the middle of gaps on"


# Two valleys


def cost(s, b):
    """What a place s costs with a design b, which has wells at 1 and -1: beyond 0.5 that at -1 is the lower one."""
    return 4.0 * (b**2 - 1) ** 2 + 0.5 * (1 + b) * (0.8 - 0.6 * s) + 0.5 * (1 - b) * (1.2 - 1.4 * s)


def least_cost(s: float) -> float:
    return min(minimize(lambda b: cost(s, b[0]), [start], tol=1e-12).fun for start in (1.0, -1.0))


@cache
def valleys() -> Front:
    problem = Problem("two designs")
    run = problem.phase("run", t0=0, tf=1)
    x, u = run.state("x", bounds=(-1, 2), initial=0), run.control("u", bounds=(0, 1))
    run.dynamics(x=u)
    b = problem.parameter("b", bounds=(-2, 2))
    problem.minimize("place", run.final(x))
    problem.minimize("cost", cost(run.final(x), b))
    return sweep(problem, DFET(1, 1), points=6, starts=6)


@pytest.mark.parametrize("s", [0.44, 0.47, 0.49, 0.51, 0.53, 0.56])
def test_between_two_valleys_the_better_one_counts(s):
    designs = [point.parameters["b"] for point in valleys()]
    assert min(designs) < -0.9 and max(designs) > 0.9
    assert valleys().at({"place": s}).objectives["cost"] == pytest.approx(least_cost(s), abs=1e-6)


def test_places_that_were_not_begun_are_said_to_be_that():
    assert front().dense(33, time_limit=1e-9).message == "31 of 33 places were not begun"


def test_a_dense_front_of_two_valleys():
    dense = valleys().dense(21)
    assert len(dense) == 21
    assert dense.objectives[:, 1] == pytest.approx([least_cost(s) for s in dense.objectives[:, 0]], abs=1e-6)


# Three objectives

CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.3, 0.9]])


@cache
def triangle() -> Front:
    """Squared distances of a place from three corners: every place of the triangle is optimal."""
    problem = Problem("places")
    run = problem.phase("run", t0=0, tf=1)
    x, y = (run.state(name, bounds=(-1, 2), initial=0) for name in "xy")
    u, w = (run.control(name, bounds=(-1, 2)) for name in "uw")
    run.dynamics(x=u, y=w)
    for name, (a, b) in zip("abc", CORNERS, strict=True):
        problem.minimize(name, (run.final(x) - a) ** 2 + (run.final(y) - b) ** 2)
    return sweep(problem, DFET(1, 1, control_order=0), points=15, starts=1)


def squared(place: np.ndarray) -> np.ndarray:
    return ((place - CORNERS) ** 2).sum(axis=1)


def in_triangle(point: Point) -> np.ndarray:
    end = point.trajectory["run"].at(1.0)
    place = np.array([end["x"], end["y"]])
    inside = np.linalg.solve(np.vstack([CORNERS.T, np.ones(3)]), [*place, 1.0])
    assert (inside > -1e-6).all()
    return squared(place)


def test_goals_for_some_of_three_objectives():
    F = in_triangle(triangle().at({"a": 0.3, "b": 0.4}))
    assert F[:2] == pytest.approx([0.3, 0.4], abs=1e-5)
    F, widths, best = in_triangle(triangle().at({"a": 0.3})), np.ptp(triangle().F, axis=0), triangle().F.min(axis=0)
    assert F[0] == pytest.approx(0.3, abs=1e-5)
    assert ((F - best) / widths)[1] == pytest.approx(((F - best) / widths)[2], abs=1e-5), "the others give way alike"


def test_goals_that_do_not_go_together():
    point = triangle().at({"a": 0.1, "b": 0.1})
    F, widths = in_triangle(point), np.ptp(triangle().F, axis=0)
    assert "a 0.1, b 0.1 is out of reach" in point.note
    assert (F[0] - 0.1) / widths[0] == pytest.approx((F[1] - 0.1) / widths[1], abs=1e-5)


def test_weights_and_a_reference_for_three_objectives():
    weights, widths = {"a": 1.0, "b": 2.0, "c": 3.0}, np.ptp(triangle().F, axis=0)
    shares = np.array([*weights.values()]) / widths
    F = in_triangle(triangle().at(weights=weights))
    assert pytest.approx(squared(shares @ CORNERS / shares.sum()), abs=1e-5) == F, "the weighted mean of the corners"
    reference = np.array([0.2, 0.3, 0.1])
    F = in_triangle(triangle().nearest(dict(zip("abc", reference.tolist(), strict=True))))
    assert np.ptp((F - reference) / widths) == pytest.approx(0.0, abs=1e-5)


def test_a_dense_surface():
    dense = triangle().dense(60)
    assert 50 < len(dense) <= 60 and dense.verified.all()
    for point in dense:
        in_triangle(point)


def test_the_simplex_around_a_place():
    X = np.array([[1.0, 0.0], [-1.0, 0.5], [-1.0, -0.5], [3.0, 3.0], [-4.0, 0.0]])
    parts = shares(X)
    assert parts @ X == pytest.approx([0.0, 0.0], abs=1e-9) and parts.sum() == pytest.approx(1.0)
    assert np.flatnonzero(parts).tolist() == [0, 1, 2], "the nearest around it"
    assert shares(X + 2.5).tolist() == [0, 0, 1, 0, 0], "the nearest of all where none lies around"
    assert shares(np.array([[-1.0], [3.0], [-2.0], [7.0]])).tolist() == [0.75, 0.25, 0, 0]


# What stands in the way


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda f: f.at(), "say where"),
        (lambda f: f.at({"time": 1.0}, weights={"time": 1.0}), "say where"),
        (lambda f: f.at({"tme": 1.0}), "time"),
        (lambda f: f.at({"time": np.nan}), "time"),
        (lambda f: f.at({"time": 1.0, "effort": 12.0}), "nearest"),
        (lambda f: f.at(weights={"time": -1.0}), "negative"),
        (lambda f: f.nearest({"time": 1.0}), "'effort'"),
        (lambda f: f[3:4].at({"time": 1.0}), "1 feasible point"),
        (lambda f: f.dense(1), "at least 2"),
    ],
)
def test_what_is_asked_for_wrongly(ask, words):
    with pytest.raises(ValueError, match=words):
        ask(front())


def test_a_black_box_and_a_problem_that_is_not_at_hand(tmp_path):
    found = NSGA2(20).minimize(lambda X: np.column_stack([X[:, 0], 1 - X[:, 0]]), [(0, 1)], evaluations=40, seed=1)
    with pytest.raises(ValueError, match="evaluate it instead"):
        found.at({"f1": 0.5})
    front().save(tmp_path / "front.nc")
    with pytest.raises(ValueError, match="problem=problem"):
        Front.load(tmp_path / "front.nc").at({"time": 1.0})
    known_optimum(Front.load(tmp_path / "front.nc", problem=cart()).at({"time": 1.0}), 1.0)
