"""SMS-EMOA, AGE-MOEA-II, RVEA and C-TAEA: known fronts, and what each has of its own. `test_pymoo_adapter` has what all baselines share."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest
from boxes import boxed
from fronts import mean_distance
from plain import dtlz, zdt

from macs import AGEMOEA2, CTAEA, RVEA, SMSEMOA
from macs.solvers.solver import solver, solver_class

CUBE = [(-2.0, 2.0)] * 3


def spheres(X: np.ndarray) -> np.ndarray:
    return np.stack([(X**2).sum(axis=1), ((X - 1) ** 2).sum(axis=1)], axis=1)


def last(settings: Any, function: Any, budget: int, bounds: Any = CUBE) -> Any:
    """The state after the budget is spent."""
    box = boxed(function, bounds)
    state = settings.begin(box, budget, np.random.default_rng(1))
    while box.counts.evaluations < budget:
        settings.advance(state, box, budget)
    return state


@pytest.mark.slow
@pytest.mark.parametrize("name", ["smsemoa", "agemoea2", "rvea", "ctaea"])
@pytest.mark.parametrize(("plain", "evaluations", "limit"), [(zdt(1), 3000, 0.5), (dtlz(2, 3), 2000, 0.15)], ids=["zdt1", "dtlz2"])
def test_they_come_near_known_fronts(name: str, plain: Any, evaluations: int, limit: float) -> None:
    """First points are at a mean distance of more than 1.9 and 0.5."""
    if name == "agemoea2":
        pytest.importorskip("numba")
    function, bounds, truth = plain
    found = solver(name, population=36).minimize(function, bounds, evaluations=evaluations, seed=1)
    assert mean_distance(truth[::5], found.F) < limit


# SMS-EMOA


def test_failed_members_have_no_part_in_the_ranges_of_objectives() -> None:
    """As they are presented, their objectives are huge; beside these, all other points would be one."""
    largest: list[float] = []

    class Watched(SMSEMOA):
        def _restore(self, algorithm: Any, state: Any, individuals: Any) -> None:
            super()._restore(algorithm, state, individuals)
            largest.append(individuals.get("F").max())

    def function(X: np.ndarray) -> np.ndarray:
        F = spheres(X)
        F[X[:, 0] > 0.3] = np.nan
        return F

    settings, box = Watched(population=12), boxed(function, CUBE)
    state = settings.begin(box, 60, np.random.default_rng(1))
    assert 0 < np.isnan(state.members.F[:, 0]).sum() < 12
    settings.advance(state, box, 60)
    assert len(largest) == 2 and max(largest) < 100


# AGE-MOEA-II


@pytest.mark.slow
def test_a_front_whose_points_are_all_equal_is_no_model() -> None:
    pytest.importorskip("numba")
    state = last(AGEMOEA2(population=12), lambda X: np.round(spheres(np.round(X[:, :1]))), 240)
    assert {tuple(F) for F in state.archive.F} == {(0.0, 1.0), (1.0, 0.0)}
    flat = last(AGEMOEA2(population=12), lambda X: np.ones((len(X), 2)), 240)
    assert len(flat.members) == 12 and flat.archive.F.tolist()[0] == [1.0, 1.0]


def test_without_numba_it_is_refused_and_nothing_else_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "numba", None)
    with pytest.raises(ValueError, match=r"AGEMOEA2 needs numba, which is not installed: pip install 'macs-trajectories\[agemoea2\]'"):
        solver("agemoea2")
    assert solver_class("agemoea2") is AGEMOEA2
    assert len(SMSEMOA(population=12).minimize(spheres, CUBE, evaluations=24, seed=1))


# RVEA


def test_progress_is_that_of_pymoo_by_generations_or_by_evaluations() -> None:
    from pymoo.algorithms.moo import rvea
    from pymoo.optimize import minimize
    from pymoo.problems import get_problem
    from pymoo.util.ref_dirs import get_reference_directions

    problem, directions = get_problem("dtlz2"), get_reference_directions("das-dennis", 3, n_partitions=4)
    for n in (4, 7):
        ours = last(RVEA(divisions=4), problem, 15 * n, None)
        for end in (("n_gen", n), ("n_eval", 15 * (n + 1))):
            truth = minimize(problem, rvea.RVEA(directions), end, seed=1)
            assert np.array_equal(ours.members.F, truth.pop.get("F"))
            assert np.array_equal(ours.vectors, truth.algorithm.survival.V)
            assert np.array_equal(ours.ideal, truth.algorithm.survival.ideal)
            assert np.array_equal(ours.nadir, truth.algorithm.survival.nadir)


def test_vectors_are_not_adapted_to_an_objective_that_is_always_the_same() -> None:
    def function(X: np.ndarray) -> np.ndarray:
        return np.hstack([spheres(X), np.ones((len(X), 1))])

    state = last(RVEA(divisions=6), function, 28 * 20)
    assert np.isfinite(state.vectors).all()
    assert len(state.archive) >= 5


# C-TAEA


def test_the_two_archives_are_full_and_only_the_first_has_to_be_feasible() -> None:
    def function(X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return spheres(X), (1.5 - spheres(X)[:, :1])

    state = last(CTAEA(divisions=11), function, 12 * 30)
    assert len(state.members) == len(state.diversity) == 12
    assert (state.members.violation == 0).all()
    assert (state.diversity.violation > 0).any()
    assert np.array_equal(state.ideal, np.minimum(state.ideal, state.diversity.F.min(axis=0)))


@pytest.mark.parametrize("budget", [1, 7, 14])
def test_a_budget_of_less_than_one_population_ends(budget: int) -> None:
    function, bounds, _ = dtlz(2, 3)
    front = CTAEA(divisions=4).minimize(function, bounds, evaluations=budget, seed=1)
    assert front.stats["evaluations"] == budget and len(front)
