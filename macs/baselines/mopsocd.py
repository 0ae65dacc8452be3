"""MOPSO-CD: a swarm led by the least crowded points of an archive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..evaluation.evaluator import Evaluator
from . import constraints as handlings
from .population import Members, State
from .pymoo_adapter import Baseline, rows_of


@dataclass
class SwarmState(State):
    """The members are the particles, in their order.

    Attributes
    ----------
    best : Members
        The best point that each particle has been at.
    leaders : Members
        What the swarm may follow: the algorithm's own archive, in its order.
    velocity : array (n, d)
        In the user's units.
    """

    best: Members
    leaders: Members
    velocity: np.ndarray


@dataclass(frozen=True)
class MOPSOCD(Baseline):
    """MOPSO-CD (Raquel and Naval 2005), that of pymoo; see `Baseline`. For any number of objectives.

    It knows nothing of constraints; they are handled here, before it is told of a point. The front is its archive. Two things differ from
    pymoo's, neither in the points that it flies through:

    - pymoo evaluates a swarm that it then throws away, and counts it. Here it is drawn, for the sake of the same random numbers, but
      neither evaluated nor counted: n generations cost fewer evaluations, by as many as there are particles.
    - pymoo offers the archive once more what crowding has just kept out of it, and if it overflows by that, throws out a random half of
      it, which no seed governs. Here these points stay out. So the two are equal as long as the archive has room; beyond that pymoo's is
      not even equal to itself.

    Parameters
    ----------
    particles : int, default 100
        At least 2.
    archive : int, default 200
        Largest number of points in the archive, and so on the front.
    inertia, cognitive, social : float, default 0.6, 2 and 2
        Weights of a particle's velocity, of the step to its own best point and of that to its leader; at least 0.
    max_velocity : float, default 0.5
        Largest step in a variable, in spans of it, in (0, 1].
    handling, penalty, degree
        As for `NSGA2`.

    Raises
    ------
    ValueError
        Where a setting is out of its range; the message names it.
    """

    particles: int = 100
    archive: int = 200
    inertia: float = 0.6
    cognitive: float = 2.0
    social: float = 2.0
    max_velocity: float = 0.5
    handling: str = "feasible-first"
    penalty: float = 1000.0
    degree: str = "largest"
    _knows_constraints = False

    def __post_init__(self) -> None:
        weights = dict.fromkeys(("inertia", "cognitive", "social"), (0.0, np.inf))
        self._check({"particles": 2, "archive": 1}, {**weights, "max_velocity": (1e-9, 1)})

    def _size(self, m: int | None) -> int | None:
        return self.particles

    def _algorithm(self, m: int) -> Any:
        from pymoo.algorithms.moo.mopso_cd import MOPSO_CD

        return MOPSO_CD(
            pop_size=self.particles,
            w=self.inertia,
            c1=self.cognitive,
            c2=self.social,
            max_velocity_rate=self.max_velocity,
            archive_size=self.archive,
            callback=_keep_out,
        )

    def _told(self, points: Members, tolerance: float) -> handlings.Told:
        F, cv = super()._told(points, tolerance)
        return handlings.by_objectives(F, cv), np.zeros(len(cv))

    def _draw(self, evaluator: Evaluator, count: int, rng: np.random.Generator) -> np.ndarray:
        super()._draw(evaluator, count, rng)  # the swarm that pymoo throws away
        self._velocity(evaluator, count, rng)
        return super()._draw(evaluator, count, rng)

    def _velocity(self, evaluator: Evaluator, count: int, rng: np.random.Generator) -> np.ndarray:
        largest = self.max_velocity * (evaluator.upper - evaluator.lower)
        return rng.uniform(-largest, largest, (count, len(largest)))

    def _first(self, members: Members, common: dict[str, Any], evaluator: Evaluator) -> SwarmState:
        velocity = self._velocity(evaluator, self.particles, common["rng"])
        return SwarmState(**common, best=members, leaders=members.take(np.arange(0)), velocity=velocity)

    def _table(self, state: SwarmState) -> Members:
        return state.members.joined(state.best).joined(state.leaders)

    def _restore(self, algorithm: Any, state: SwarmState, people: Any) -> None:
        from pymoo.util.archive import MultiObjectiveArchive

        n = len(state.members)
        algorithm.pop, algorithm.pbest, leaders = people[:n], people[n : 2 * n], people[2 * n :]
        algorithm.pbest_f = algorithm.pbest.get("F")
        algorithm.archive = MultiObjectiveArchive(individuals=leaders, max_size=self.archive)
        algorithm.velocities = state.velocity.copy()

    def _keep(self, algorithm: Any, state: SwarmState, table: Members) -> None:
        state.best, state.leaders = table.take(rows_of(algorithm.pbest)), table.take(rows_of(algorithm.archive))
        state.velocity = algorithm.velocities


def _keep_out(algorithm: Any) -> None:
    """Called before pymoo offers the archive, once more, the points just evaluated: if they are too many, those already in it stay."""
    algorithm.archive.truncation = lambda points, count: points[: algorithm.archive_size]
