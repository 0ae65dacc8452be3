"""MOPSO-CD: a swarm whose leaders are the least crowded points of an archive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..evaluation.evaluator import Evaluator
from .population import Members, State
from .pymoo_adapter import Baseline, rows_of


@dataclass(repr=False)
class SwarmState(State):
    """State of MOPSO-CD. The members are the particles, in their order."""

    SHAPES: ClassVar[dict[str, str]] = {"velocity": "n d"}

    best: Members  # best position of each particle
    leaders: Members  # archive of the algorithm, in its order, from which leaders are drawn
    velocity: np.ndarray  # (n, d): In the user's units


@dataclass(frozen=True)
class MOPSOCD(Baseline):
    """MOPSO-CD (Raquel and Naval 2005), pymoo's implementation; see `Baseline`. For any number of objectives.

    MOPSO-CD compares objectives only, so constraints become part of them, see `handling`. The front is its archive. There are two
    differences from pymoo; neither changes the positions of the particles:

    - pymoo evaluates and counts a first swarm that it does not use. Here that swarm is drawn, for the same random numbers, but neither
      evaluated nor counted: n generations need fewer evaluations, by the number of particles.
    - pymoo offers the archive a second time the points that crowding has just rejected. If the archive overflows by that, pymoo drops a
      random half of it, independent of any seed. Here these points stay out. So the results are equal until the archive is full; from then
      on those of pymoo are not reproducible.

    Parameters
    ----------
    particles : int, default 100
        Number of particles, at least 2.
    archive : int, default 200
        Largest number of points in the archive, and so on the front, at least 1.
    inertia, cognitive, social : float, default 0.6, 2 and 2
        Weights of the velocity, of the step to a particle's own best position and of that to its leader; at least 0.
    max_velocity : float, default 0.5
        Largest step in a variable, in spans of it, in (0, 1].
    handling, penalty, degree
        As for `NSGA2`.

    Raises
    ------
    ValueError
        If a setting is outside its range; the message names it.

    Examples
    --------
    >>> import numpy as np
    >>> from macs import MOPSOCD
    >>> schaffer = lambda X: np.hstack([X**2, (X - 2) ** 2])
    >>> front = MOPSOCD(particles=20, archive=20).minimize(schaffer, [(-10, 10)], evaluations=200, seed=1)
    >>> front.objectives.shape[1]
    2
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
    _compares_violations = False

    def __post_init__(self) -> None:
        weights = dict.fromkeys(("inertia", "cognitive", "social"), "[0, inf)")
        self._check({"particles": 2, "archive": 1}, {**weights, "max_velocity": "(0, 1]"})

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

    def _draw(self, evaluator: Evaluator, count: int, rng: np.random.Generator) -> np.ndarray:
        super()._draw(evaluator, count, rng)  # the swarm that pymoo does not use
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

    def _restore(self, algorithm: Any, state: SwarmState, individuals: Any) -> None:
        from pymoo.util.archive import MultiObjectiveArchive

        n = len(state.members)
        algorithm.pop, algorithm.pbest, leaders = individuals[:n], individuals[n : 2 * n], individuals[2 * n :]
        algorithm.pbest_f = algorithm.pbest.get("F")
        algorithm.archive = MultiObjectiveArchive(individuals=leaders, max_size=self.archive)
        algorithm.velocities = state.velocity.copy()

    def _keep(self, algorithm: Any, state: SwarmState, table: Members) -> None:
        state.best, state.leaders = table.take(rows_of(algorithm.pbest)), table.take(rows_of(algorithm.archive))
        state.velocity = algorithm.velocities


def _keep_out(algorithm: Any) -> None:
    """Set the truncation of pymoo's archive: if the points that are offered a second time are too many, those already in it stay."""
    algorithm.archive.truncation = lambda points, count: points[: algorithm.archive_size]
