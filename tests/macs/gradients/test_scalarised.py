"""The end of a front on another mesh, by solves that are made up: which of them is taken."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass, field

import numpy as np
import pytest

from macs.gradients.scalarised import LexicographicEnd
from transcription.nlp.scalarized import Solved

UNITS, KNOWN = np.array([1.0, 10.0]), np.array([2.0, 5.0])
Answer = tuple[str, tuple[float, float]]


@dataclass
class Solves:
    """Answers in their order, and what was asked: the ceiling and the start of each solve."""

    answers: list[Answer]
    ceilings: list[np.ndarray | None] = field(default_factory=list)
    starts: list[float] = field(default_factory=list)

    def __call__(self, nlp, start, task, near=False) -> Solved:
        self.ceilings.append(task.ceiling)
        self.starts.append(float(start[0]))
        status, F = self.answers[(k := len(self.starts) - 1)]
        return Solved(np.array([float(k)]), np.array(F), 0.0, status, 1)

    def at_most(self, iterations: int) -> nullcontext:
        return nullcontext()


@dataclass
class Mesh:
    """An NLP that knows the objectives and the violation of the start alone."""

    F: tuple[float, float] = (0.0, 0.0)
    violation: float = 1.0

    def evaluate(self, Z):
        return np.array([self.F]), np.array([self.violation])


FAR = Mesh()
"""On it the start violates constraints by much, and is good for nothing else."""
STAYS: list[Answer] = [("converged", (1.9, 5.1)), ("converged", (1.9, 5.04)), ("converged", (1.9, 5.05))]
HELD: list[Answer] = [("converged", (2.0, 5.2)), ("converged", (2.0, 4.9)), ("converged", (2.0, 5.0))]
MOVES: list[Answer] = [("converged", (1.5, 90.0)), ("converged", (2.0, 5.2)), ("converged", (1.5, 79.0)), ("converged", (1.5, 80.0))]
ALONE: list[Answer] = [("converged", (1.9, 5.1)), ("converged", (1.9, 5.1 - 1e-5))]


@pytest.mark.parametrize(
    ("answers", "mesh", "taken", "starts", "ceiling"),
    [
        pytest.param(STAYS, FAR, 2, [-1, 0, 1], [1.90001, np.inf], id="with slack, then without"),
        pytest.param(ALONE, FAR, 0, [-1, 0], [1.90001, np.inf], id="the slack alone gains"),
        pytest.param([*STAYS[:2], ("failed", (1.9, 9.9))], FAR, 1, [-1, 0, 1], [1.90001, np.inf], id="without slack it fails"),
        pytest.param(
            [*STAYS[:2], *STAYS[1:]], Mesh((1.9, 5.0), 1e-5), 3, [-1, 0, -1, 1], [1.90001, np.inf], id="the start was nearly the end"
        ),
        pytest.param(STAYS, Mesh((1.9, 5.2), 1e-5), 2, [-1, 0, 1], [1.90001, np.inf], id="the start is worse in the other"),
        pytest.param(STAYS, Mesh((1.91, 5.0), 1e-5), 2, [-1, 0, 1], [1.90001, np.inf], id="the start is worse in the one"),
        # The other objective by no more than a twentieth of its unit.
        pytest.param([("converged", (2.0, 90.0)), *HELD], FAR, 3, [-1, -1, 1, 2], [np.inf, 5.5], id="of equal ends that near the known"),
        pytest.param([("failed", (2.0, 5.0)), *HELD], FAR, 3, [-1, -1, 1, 2], [np.inf, 5.5], id="the first fails"),
        pytest.param(MOVES, FAR, 3, [-1, -1, 0, 2], [np.inf, 5.5], id="better elsewhere"),
        pytest.param([("failed", (2.0, 5.0)), ("infeasible", (2.0, 5.2))], FAR, 0, [-1, -1], [np.inf, 5.5], id="nothing converges"),
    ],
)
def test_which_result_is_the_end(answers, mesh, taken, starts, ceiling):
    solves = Solves(answers)
    found = LexicographicEnd.of(0, UNITS, KNOWN).solve(solves, mesh, np.array([-1.0]))  # type: ignore[arg-type]
    assert (found.status, tuple(found.F.tolist())) == answers[taken]
    assert solves.starts == starts and solves.ceilings[1].tolist() == ceiling
