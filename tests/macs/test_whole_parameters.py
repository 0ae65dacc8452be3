"""Whole numbers among the parameters of trajectories: known optima for each value, which solves hold, searches move and files keep."""

import casadi as ca
import numpy as np
import pytest

from macs import MACS, Front, optimize, payoff, sweep
from problems import Problem
from transcription import DFET, SingleShooting
from transcription.inner.levels import inner_solver

MESH = DFET(6, 4)


def engines(price: float = 0.3) -> Problem:
    """Rest to rest over one unit in `time`, by n equal engines that cost `price` each, with least effort."""
    problem = Problem("engines")
    n = problem.parameter("engines", bounds=(1, 6), integer=True)
    slide = problem.phase("slide", t0=0, tf=(0.8, 6))
    x = slide.state("x", bounds=(-1, 2), initial=0, final=1)
    v = slide.state("v", bounds=(-10, 10), initial=0, final=0)
    u = slide.control("u", bounds=(-1, 1))
    slide.dynamics(x=v, v=10 * n * u)
    problem.minimize("time", slide.tf)
    problem.minimize("cost", price * n + slide.integral(100 * u**2))
    assert x is not None
    return problem


def costs(time: float, price: float = 0.3) -> np.ndarray:
    """The least cost by the number of engines, (6,): the control is a line in time, of 6 / (10 n time**2) at the ends."""
    n = np.arange(1, 7)
    return np.where(6 / time**2 <= 10 * n, price * n + 12 / (n**2 * time**3), np.inf)


def turns(most: int) -> Problem:
    """A wheel that ends 0.3 rad after a whole number of turns; 6.55 of them would take the least effort, and more cost more than fewer."""
    problem = Problem("turns")
    n = problem.parameter("turns", bounds=(0, most), integer=True)
    spin = problem.phase("spin", t0=0, tf=10)
    angle = spin.state("angle", bounds=(-10, 7 * most), initial=0, unit="rad")
    rate = spin.control("rate", bounds=(2, 5))
    spin.dynamics(angle=rate)
    problem.constraint("place", spin.final(angle) - 0.3 - 2 * np.pi * n, lower=0, upper=0, scale=1.0)
    away = (10 * rate - 0.3) / (2 * np.pi) - 6.55
    problem.minimize("effort", spin.integral(ca.exp(3 * away) - 3 * away))
    return problem


def check(front: Front) -> None:
    """Each point has the number of engines that is best for its time, exactly, and the cost that belongs to it."""
    for point in front:
        least = costs(point.objectives["time"])
        n = point.parameters["engines"]
        assert type(n) is int and n == 1 + np.argmin(least) and point.objectives["cost"] == pytest.approx(least.min(), abs=1e-4)
        assert point.decision[[v.name for v in point.variables].index("engines")] == n
    assert front.verified.all()


def test_a_front_has_pieces_of_several_values_each_the_best_one():
    front = sweep(engines(), MESH, points=5)
    assert len(front) == 5 and len({point.parameters["engines"] for point in front}) >= 4
    check(front)
    ends = payoff(engines(), MESH)
    check(ends)
    assert [point.parameters["engines"] for point in ends] == [5, 1]  # with 4 engines the least time is as short, at a higher cost
    assert max(point.optimality for point in front) < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize(("mesh", "evaluations"), [(MESH, 1500), (None, None)])
def test_a_search_moves_among_values_and_polishes_with_those_beside(mesh, evaluations):
    front = MACS().solve(engines(), mesh, evaluations=evaluations, seed=1)
    assert len(front) == 10 and len({point.parameters["engines"] for point in front}) >= 4
    check(front)


@pytest.mark.parametrize("inner", ["projection", "ipopt"])
def test_inner_levels_keep_the_whole_numbers_of_candidates(inner):
    nlp, rng = MESH.nlp(engines()), np.random.default_rng(1)
    X = nlp.lower[nlp.free] + nlp.span[nlp.free] * rng.random((12, len(nlp.free)))
    (place,) = (k for k, i in enumerate(nlp.free) if nlp.variables[i].integer)
    X[:, place] = rng.integers(1, 7, 12)
    found = inner_solver(inner).solve(nlp, X)
    assert np.array_equal(found.z[:, nlp.free[place]], X[:, place]) and (found.status == "converged").sum() >= 6


@pytest.mark.parametrize("most", [10, 1000])
def test_of_few_values_each_is_solved_and_of_many_those_about_the_optimum_for_real_numbers(most):
    best = optimize(turns(most), SingleShooting(4), starts=1)
    away = np.arange(11) - 6.55  # 7 is nearer, and 6 is better
    assert best.parameters == {"turns": 6}
    assert best.objectives["effort"] == pytest.approx(10 * (np.exp(3 * away) - 3 * away).min(), rel=1e-6)


def test_values_without_a_feasible_trajectory_are_left_out():
    problem = Problem("lift")
    n = problem.parameter("n", bounds=(1, 8), integer=True)
    up = problem.phase("up", t0=0, tf=(0.5, 20))
    h = up.state("h", bounds=(0, 3), initial=0, final=1)
    v = up.state("v", bounds=(-5, 5), initial=0)
    up.dynamics(h=v, v=0.3 * n * up.control("u", bounds=(0, 1)) - 1)  # less than four do not lift
    problem.minimize("engines", n + 1e-3 * up.tf)
    best = optimize(problem, MESH)
    assert best.parameters["n"] == 4 and best.objectives["engines"] == pytest.approx(4 + 1e-3 * 10**0.5, abs=1e-6)
    assert h is not None


def test_files_tables_and_messages(tmp_path):
    front = sweep(engines(), MESH, points=3, starts=1)
    front.save(tmp_path / "front.nc")
    again = Front.load(tmp_path / "front.nc")
    numbers = [point.parameters["engines"] for point in front]
    assert [point.parameters["engines"] for point in again] == numbers and all(type(point.parameters["engines"]) is int for point in again)
    assert f"engines={numbers[0]})" in repr(again[0].trajectory)
    front.to_csv(tmp_path / "front.csv")
    assert f",{numbers[0]}," in (tmp_path / "front.csv").read_text()
    real = engines()
    real._parameters["engines"] = type(real._parameters["engines"])("engines", 1.0, 6.0, "", 5.0)
    assert real.compile().fingerprint != engines().compile().fingerprint


def test_what_is_no_whole_number_is_refused():
    problem = Problem("p")
    with pytest.raises(ValueError, match=r"must be whole numbers, not \(0.5, 3\)"):
        problem.parameter("n", bounds=(0.5, 3), integer=True)
    problem.parameter("n", bounds=(1, 3), integer=True)
    with pytest.raises(ValueError, match=r"guess of parameter 'n' must be a whole number, not 1\.5"):
        problem.guess(n=1.5)
