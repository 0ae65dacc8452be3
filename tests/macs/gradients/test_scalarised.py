"""The end of a front on another mesh, by solves that are made up: which of them is taken."""

from __future__ import annotations

import numpy as np
import pytest

from macs.gradients.scalarised import LexicographicEnd
from transcription.nlp.scalarized import Solved

UNITS, KNOWN = np.array([1.0, 10.0]), np.array([2.0, 5.0])


class Solves:
    """Answers in their order, and what was asked: ceilings, and the start of each solve."""

    def __init__(self, *answers: tuple[str, tuple[float, float]]) -> None:
        self.answers = [Solved(np.array([float(k)]), np.array(F), 0.0, status, 1) for k, (status, F) in enumerate(answers)]
        self.ceilings: list[np.ndarray | None] = []
        self.starts: list[float] = []

    def __call__(self, nlp, start, task, near=False) -> Solved:
        self.ceilings.append(task.ceiling)
        self.starts.append(float(start[0]))
        return self.answers[len(self.ceilings) - 1]


class Mesh:
    """An NLP that knows the objectives and the violation of the start alone."""

    def __init__(self, F: tuple[float, float], violation: float) -> None:
        self.F, self.violation = F, violation

    def evaluate(self, Z):
        return np.array([self.F]), np.array([self.violation])


FAR = Mesh((0.0, 0.0), 1.0)
"""On it the start violates constraints by much, and is good for nothing else."""


def solved(*answers: tuple[str, tuple[float, float]], mesh: Mesh = FAR) -> tuple[Solved, Solves]:
    solves = Solves(*answers)
    return LexicographicEnd.of(0, UNITS, KNOWN).solve(solves, mesh, np.array([-1.0])), solves  # type: ignore[arg-type]


def test_an_end_that_stays_is_solved_once_for_each_objective():
    found, solves = solved(("converged", (1.9, 5.1)), ("converged", (1.9, 5.05)))
    assert found.F.tolist() == [1.9, 5.05] and len(solves.ceilings) == 2
    assert solves.ceilings[1].tolist() == [1.9, np.inf] and solves.starts == [-1.0, 0.0]


@pytest.mark.parametrize(
    ("mesh", "begins"), [(Mesh((1.9, 5.0), 1e-5), -1.0), (Mesh((1.9, 5.2), 1e-5), 0.0), (Mesh((1.91, 5.0), 1e-5), 0.0), (FAR, 0.0)]
)
def test_a_start_that_is_nearly_the_end_is_where_the_others_are_lowered(mesh, begins):
    found, solves = solved(("converged", (1.9, 5.1)), ("converged", (1.9, 5.05)), mesh=mesh)
    assert found.F.tolist() == [1.9, 5.05] and solves.starts == [-1.0, begins]


@pytest.mark.parametrize("first", [("converged", (2.0, 90.0)), ("failed", (2.0, 5.0))])
def test_of_equal_ones_the_end_near_what_is_known_is_taken(first):
    found, solves = solved(first, ("converged", (2.0, 5.2)), ("converged", (2.0, 5.0)))
    assert found.F.tolist() == [2.0, 5.0]
    assert solves.ceilings[1].tolist() == [np.inf, 5.5], "the other objective by no more than a twentieth of its unit"
    assert solves.starts == [-1.0, -1.0, 1.0]


def test_an_end_that_is_better_elsewhere_moves_there():
    found, solves = solved(("converged", (1.5, 90.0)), ("converged", (2.0, 5.2)), ("converged", (1.5, 80.0)))
    assert found.F.tolist() == [1.5, 80.0] and solves.starts[2] == 0.0


def test_where_nothing_converges_the_first_solve_says_why():
    found, solves = solved(("failed", (2.0, 5.0)), ("infeasible", (2.0, 5.2)))
    assert found is solves.answers[0] and len(solves.ceilings) == 2
