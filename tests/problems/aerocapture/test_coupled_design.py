"""Shapes of capsules for aerocapture: the statement, its reference front, and what searches find of it."""

from __future__ import annotations

import numpy as np
import pytest

from macs import MACS, MOPSO
from problems import load
from problems.cases.aerocapture.coupled import reference, reference_designs
from problems.cases.aerocapture.designs import BOUNDS, LENGTH, LIFT_TO_DRAG, judged
from problems.cases.aerocapture.passage import passages
from runs.measures.indicators import hypervolume_at

POINT = (1.0, 15.0)
STEP = 1e-3 * np.ptp(reference()[:, 1])
"""Of the table, in the heat shield."""


def feasible(X: np.ndarray, allowed: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    found = judged(X)
    good = (found.reason == "") & (np.abs(found.lift_to_drag) >= LIFT_TO_DRAG - allowed) & (found.length >= LENGTH - allowed)
    return np.stack([found.packing, found.shield], axis=1), good


def test_the_reference_is_a_front_of_the_problem_and_has_a_jump() -> None:
    rows = reference_designs()
    F, good = feasible(rows[:, 2:], 1e-7)
    assert good.all()
    np.testing.assert_allclose(F, rows[:, :2], rtol=2e-7)
    exact = judged(rows[::50, 2:], way=passages)
    np.testing.assert_allclose(exact.shield, rows[::50, 1], rtol=1e-6)
    assert (np.diff(rows[:, 0]) > 0).all() and (np.diff(rows[:, 1]) < 0).all()
    # Slender capsules, then blunt ones: between them the heat shield falls at once.
    assert np.diff(rows[:, 1]).min() < -1.0
    slender = rows[:, 4] < 40.0
    assert 0.5 < rows[slender, 0].max() < 0.52 and not slender[np.argmax(~slender) :].any()


@pytest.mark.parametrize(("counts", "below"), [((9, 5, 11, 9, 13), 0.0), pytest.param((17, 9, 26, 13, 31), STEP, marks=pytest.mark.slow)])
def test_no_point_of_a_grid_is_below_the_reference(counts: tuple[int, ...], below: float) -> None:
    sides = [np.linspace(low, high, count) for (low, high), count in zip(BOUNDS, counts, strict=True)]
    sides[4] = np.linspace(-30.0, 0.0, counts[4])  # the others are mirror images
    front = reference()
    for nose in sides[0]:
        X = np.stack(np.meshgrid([nose], *sides[1:], indexing="ij"), axis=-1).reshape(-1, 5)
        F, good = feasible(X)
        behind = np.searchsorted(front[:, 0], F[good, 0], side="right") - 1
        assert (behind >= 0).all()
        assert (front[np.maximum(behind, 0), 1] - F[good, 1]).max(initial=-1.0) <= below


def test_mirror_images_are_as_good() -> None:
    X = reference_designs()[::40, 2:]
    other = X * [1, 1, 1, 1, -1]
    np.testing.assert_allclose(feasible(other)[0], feasible(X)[0], rtol=1e-12)


def test_a_faster_arrival_needs_a_heavier_shield() -> None:
    X = reference_designs()[::100, 2:]
    names = load("aerocapture").compile()
    usual, faster = names.evaluate(X)[0], load("aerocapture", arrival_speed=5500.0).compile().evaluate(X)[0]
    assert (faster[:, 0] == usual[:, 0]).all() and (faster[:, 1] > 1.02 * usual[:, 1]).all()


def test_shapes_of_which_nothing_can_be_said_are_failed_evaluations() -> None:
    problem = load("aerocapture").compile()
    F, violations = problem.evaluate(np.array([[0.9, 0.2, 20.0, 60.0, 29.0], [np.nan, 0.2, 70.0, 30.0, 19.0]]))
    assert np.isfinite(F[0]).all() and np.isnan(F[1]).all() and np.isnan(violations[1]).all()


@pytest.mark.parametrize(
    ("data", "word"),
    [({"exit_speed": 3600.0}, "exit_speed"), ({"arrival_speed": -1.0}, "arrival_speed"), ({"arrival_speed": np.nan}, "arrival_speed")],
)
def test_speeds_that_cannot_be_are_refused(data: dict[str, float], word: str) -> None:
    with pytest.raises(ValueError, match=word):
        load("aerocapture", **data)


@pytest.mark.slow
def test_searches_of_the_paper_s_budget() -> None:
    whole = hypervolume_at(reference(), POINT)

    def found(solver: MACS | MOPSO) -> float:
        fronts = (solver.solve(load("aerocapture"), evaluations=2000, seed=seed) for seed in range(5))
        return float(np.median([hypervolume_at(front, POINT) for front in fronts])) / whole

    paper, ours = found(MOPSO.paper(settled=0.0)), found(MACS(agents=30, archive=100))
    assert 0.95 < paper < ours and ours > 0.97
