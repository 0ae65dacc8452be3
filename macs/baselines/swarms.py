"""Swarms: MOPSO, led by points in sparsely populated hypercubes of an archive, and pymoo's MOPSO-CD, led by the least crowded ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..evaluation.evaluator import Evaluator, UnitBox
from ..pareto.dominance import dominates, nondominated
from .population import Members, PopulationSolver, State, distinct, evaluate, excess, full_vectors, thinned
from .pymoo_adapter import Baseline

SETTLING = 20
"""Iterations over which the mean of the front is compared, for `settled`."""


@dataclass(repr=False)
class ParticleState(State):
    """State of MOPSO. The members are the particles, in their order."""

    SHAPES: ClassVar[dict[str, str]] = {"velocity": "members d", "means": "k m"}

    best: Members  # best position of each particle
    leaders: Members  # archive of the algorithm, from which leaders are drawn
    velocity: np.ndarray  # (n, d): In spans of the variables
    launched: int  # number of evaluations after which the swarm was complete and began to move; -1 as long as first particles are drawn
    means: np.ndarray  # (k, m): Mean of the front after each of the last iterations of a swarm that moves, at most `SETTLING` and one


@dataclass(frozen=True)
class MOPSO(PopulationSolver):
    """MOPSO after Coello Coello, Pulido and Lechuga (2004), in the variant of Armellin and Lavagna (2008), section 4.1.

    Each particle is attracted by its own best position and by a leader, a point of the archive. A roulette draws leaders, with preference
    for sparsely populated hypercubes of an adaptive grid; a full archive drops points of the most populated ones. The inertia decreases
    linearly. The signs in the velocity formula of the paper, eq. (22), are corrected; see `velocities`. For any number of objectives.

    With handling="feasible-first", the swarm begins with feasible particles only: candidates are drawn, one swarm at a time, until there
    are enough. They count as evaluations, and use at most the fraction `search` of the budget. After that, the least violated candidates
    become particles too, and move towards less violation until they are feasible. A feasible best position is never replaced by an
    infeasible one. If no feasible point is found, the front is empty; see its `message` and `closest`.

    As for the other baselines: a failed evaluation counts as infeasible, behind all others. If the evaluator moves candidates, particles
    take the new positions. If the budget is too small for the last iteration, only the first particles move. Points of a `start` are the
    first particles. Periodic variables wrap around at their bounds.

    Parameters
    ----------
    particles : int, default 100
        Number of particles, at least 1.
    archive : int, default 100
        Largest number of points in the archive, and so on the front, at least 1.
    cells : int, default 30
        Number of parts into which the grid divides each objective, at least 1.
    inertia, final_inertia : float, default 0.4 and 0
        Weight of the velocity when the swarm begins to move, and when the budget is spent; at least 0. With 1.4 and 0.4, as in the paper
        (see `paper`), particles with many variables move from bound to bound most of the time.
    cognitive, social : float, default 2
        Weights of the steps to a particle's own best position and to its leader, each times a random number; at least 0.
    max_velocity : float, default 1
        Largest step in a variable, in spans of it, in (0, 1].
    search : float, default 0.2
        Fraction of the budget, in [0, 1], that may be spent on feasible first particles, the first swarm included. 0: the first swarm is
        used as it is drawn.
    one_leader : bool, default False
        Whether all particles follow the same leader in an iteration. Default: each has one of its own, as Coello Coello and others do.
    printed : bool, default False
        Whether eq. (22) is used as printed, with differences of the wrong sign: particles move away from what is to attract them.
    settled : float, default 0
        The search ends when the mean of the front is, in each objective, within this part of what it was after each of the last 20
        iterations; `stats["stopped"]` is then "settled". 0: the budget is spent.
    handling, penalty, degree
        As for `NSGA2`, errors included. With "penalty" and "objective", the first swarm is used as it is drawn.

    Examples
    --------
    >>> from macs import MOPSO
    >>> from problems import load
    >>> front = MOPSO(particles=20, archive=20).solve(load("four_bar_truss"), evaluations=200, seed=1)
    >>> len(front) > 5
    True
    """

    particles: int = 100
    archive: int = 100
    cells: int = 30
    inertia: float = 0.4
    final_inertia: float = 0.0
    cognitive: float = 2.0
    social: float = 2.0
    max_velocity: float = 1.0
    search: float = 0.2
    one_leader: bool = False
    printed: bool = False
    settled: float = 0.0

    COMPARES_VIOLATIONS = False

    @classmethod
    def paper(cls, **overrides: Any) -> MOPSO:
        """The settings of Armellin and Lavagna: 20 particles, one leader in an iteration, an archive of 100, inertia from 1.4 to 0.4, an
        end when the mean of the front has settled to 1 %. `overrides` are settings of MOPSO.

        Differences that remain: theirs limits neither the search for feasible first particles nor the velocities.
        """
        theirs = {"particles": 20, "archive": 100, "inertia": 1.4, "final_inertia": 0.4, "one_leader": True, "settled": 0.01}
        return cls(**(theirs | overrides))

    def begin(self, evaluator: Evaluator, budget: int, rng: np.random.Generator, start: np.ndarray | None = None) -> ParticleState:
        """The state after a first swarm has been evaluated; see `SearchMethod.begin`."""
        evaluator.check_budget(budget)
        Z = self._candidates(evaluator, thinned(distinct(start), self.particles), self.particles, rng)
        swarm = evaluate(evaluator, Z[: budget - evaluator.counts.evaluations], self.degree)
        state = ParticleState.of(
            swarm,
            rng,
            best=swarm,
            leaders=swarm.take(np.arange(0)),
            velocity=np.zeros((len(swarm), len(evaluator.free))),
            launched=-1,
            means=np.empty((0, swarm.F.shape[1])),
        )
        self._update(state, swarm, evaluator, budget)
        return state

    def advance(self, state: ParticleState, evaluator: Evaluator, budget: int) -> None:
        """Move the swarm once, or draw more first particles, within the budget of evaluations; changes `state`."""
        left = budget - evaluator.counts.evaluations
        if left <= 0:
            return
        if state.launched < 0:
            seen = self._draw_more(state, evaluator, min(left, int(self.search * budget) - evaluator.counts.evaluations))
        else:
            seen = self._move(state, evaluator, left, budget)
        state.iteration += 1
        self._update(state, seen, evaluator, budget)

    def _draw_more(self, state: ParticleState, evaluator: Evaluator, most: int) -> Members:
        """Draw and evaluate at most `most` more first particles; the swarm keeps the feasible ones, then the least violated ones."""
        count = len(state.members)
        seen = evaluate(evaluator, self._candidates(evaluator, np.empty((0, 0)), count, state.rng)[:most], self.degree)
        every = state.members.joined(seen)
        cv = excess(every.F, every.violation, evaluator.tolerance, every.degree)
        state.members = state.best = every.take(np.argsort(cv, kind="stable")[:count])
        return seen

    def _move(self, state: ParticleState, evaluator: Evaluator, left: int, budget: int) -> Members:
        """Move and evaluate the particles, at most the first `left`."""
        box, rng, tolerance, free = evaluator.box, state.rng, evaluator.tolerance, evaluator.free
        swarm, d = len(state.members), len(free)
        share = (evaluator.counts.evaluations - state.launched) / (budget - state.launched)
        count = 1 if self.one_leader else swarm
        followed = np.broadcast_to(roulette(hypercubes(self._goals(state.leaders, tolerance), self.cells), count, rng), swarm)
        chance, rebound, coin = rng.random((2, swarm, d)), -rng.random((swarm, d)), rng.random(swarm) < 0.5

        X, best, leaders = (box.to_unit(some.Z[:, free]) for some in (state.members, state.best, state.leaders.take(followed)))
        sign = -1.0 if self.printed else 1.0
        inertia = self.inertia + (self.final_inertia - self.inertia) * min(max(share, 0.0), 1.0)
        weights = inertia, sign * self.cognitive, sign * self.social
        V = velocities(box, X, state.velocity, best, leaders, weights=weights, chance=chance, largest=self.max_velocity)
        X, V = moved(box, X, V, rebound)

        Z = full_vectors(evaluator, state.members, box.to_values(box.settle(X, rng)))
        seen = evaluate(evaluator, Z[: evaluator.room(Z, left)], self.degree)
        n = len(seen)
        state.members = seen.joined(state.members.take(np.arange(n, swarm)))
        state.velocity = np.concatenate([V[:n], state.velocity[n:]])
        better = improved(self._goals(seen, tolerance), self._goals(state.best, tolerance)[:n], coin[:n])
        rows = np.arange(swarm)
        rows[np.flatnonzero(better)] += swarm
        state.best = state.best.joined(seen).take(rows)
        return seen

    def _update(self, state: ParticleState, seen: Members, evaluator: Evaluator, budget: int) -> None:
        """Offer evaluated points to the archive, and note the number of evaluations once the swarm is complete."""
        tolerance = evaluator.tolerance
        every = state.leaders.joined(seen)
        goals = self._goals(every, tolerance)
        rows = np.flatnonzero(nondominated(goals))
        if len(rows) > self.archive:
            rows = rows[thin_out(hypercubes(goals[rows], self.cells), self.archive, state.rng)]
        state.leaders = every.take(rows)
        state.show(tolerance, seen, state.leaders, state.members)
        state.note(tolerance)
        spent = evaluator.counts.evaluations
        complete = self.handling != "feasible-first" or state.all_feasible or spent >= int(self.search * budget)
        if state.launched < 0 and complete:
            state.launched = spent
        if state.launched >= 0 and len(state.archive):
            state.means = np.vstack([state.means, state.archive.F.mean(axis=0)])[-SETTLING - 1 :]

    def ended(self, state: ParticleState) -> str:
        """See `SearchMethod.ended`."""
        if len(state.means) <= SETTLING:
            return ""
        now = state.means[-1]
        return "settled" if (np.abs(state.means - now) < self.settled * np.abs(now)).all() else ""

    def _goals(self, points: Members, tolerance: float) -> np.ndarray:
        """Objectives (n, m) that include the violation; see `by_objectives`."""
        return self._presented(points, tolerance)[0]


@dataclass(repr=False)
class SwarmState(State):
    """State of MOPSO-CD. The members are the particles, in their order."""

    SHAPES: ClassVar[dict[str, str]] = {"velocity": "n d"}
    CARRIED: ClassVar[dict[str, str]] = {"best": "pbest", "leaders": "archive", "velocity": "velocities"}

    best: Members | None = None  # best position of each particle
    leaders: Members | None = None  # archive of the algorithm, in its order, from which leaders are drawn
    velocity: np.ndarray | None = None  # (n, d): In the user's units


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
        As for `NSGA2`, errors included.

    Examples
    --------
    >>> from macs import MOPSOCD
    >>> from problems import load
    >>> front = MOPSOCD(particles=20, archive=20).solve(load("four_bar_truss"), evaluations=200, seed=1)
    >>> len(front) > 5
    True
    """

    particles: int = 100
    archive: int = 200
    inertia: float = 0.6
    cognitive: float = 2.0
    social: float = 2.0
    max_velocity: float = 0.5

    PYMOO = "mopso_cd:MOPSO_CD"
    STATE = SwarmState
    RANGES: ClassVar[Mapping[str, int | str]] = {**Baseline.RANGES, "particles": 2}
    COMPARES_VIOLATIONS = False

    def _size(self, m: int | None) -> int | None:
        return self.particles

    def _arguments(self, m: int) -> dict[str, Any]:
        weights = {"w": self.inertia, "c1": self.cognitive, "c2": self.social, "max_velocity_rate": self.max_velocity}
        return {"pop_size": self.particles, "archive_size": self.archive, "callback": _keep_out, **weights}

    def _draw(self, evaluator: Evaluator, count: int, rng: np.random.Generator) -> np.ndarray:
        super()._draw(evaluator, count, rng)  # the swarm that pymoo does not use
        self._velocity(evaluator, count, rng)
        return super()._draw(evaluator, count, rng)

    def _velocity(self, evaluator: Evaluator, count: int, rng: np.random.Generator) -> np.ndarray:
        largest = self.max_velocity * (evaluator.upper - evaluator.lower)
        return rng.uniform(-largest, largest, (count, len(largest)))

    def _first(self, members: Members, rng: np.random.Generator, evaluator: Evaluator) -> State:
        return SwarmState.of(members, rng, best=members, velocity=self._velocity(evaluator, self.particles, rng))

    def _restore(self, algorithm: Any, state: SwarmState, individuals: Any) -> None:
        from pymoo.util.archive import MultiObjectiveArchive

        super()._restore(algorithm, state, individuals)
        algorithm.pbest_f = algorithm.pbest.get("F")
        algorithm.archive = MultiObjectiveArchive(individuals=algorithm.archive, max_size=self.archive)


def _keep_out(algorithm: Any) -> None:
    """Set the truncation of pymoo's archive: if the points that are offered a second time are too many, those already in it stay."""
    algorithm.archive.truncation = lambda points, count: points[: algorithm.archive_size]


def hypercubes(F: np.ndarray, cells: int) -> np.ndarray:
    """Number of the hypercube (n,) of each of the points F (n, m); occupied hypercubes are numbered from 0.

    The range of each objective is divided into `cells` equal parts; the largest value belongs to the last one. An objective that does not
    vary has one part.
    """
    low, span = F.min(axis=0), np.ptp(F, axis=0)
    share = np.divide(F - low, span, out=np.zeros_like(F), where=span > 0.0)
    places = np.minimum((share * cells).astype(int), cells - 1)
    return np.unique(places, axis=0, return_inverse=True)[1].reshape(-1)


def roulette(cube: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Rows (count,) of points drawn, with repetition, by their hypercubes (n,).

    A hypercube is drawn with probability inverse to the number of its points, then one of these points uniformly.
    """
    occupancy = np.bincount(cube)
    wheel = np.cumsum(1.0 / occupancy)
    drawn = np.searchsorted(wheel[:-1], wheel[-1] * rng.random(count), side="right")
    first = np.cumsum(occupancy) - occupancy
    within = (rng.random(count) * occupancy[drawn]).astype(int)
    return np.argsort(cube, kind="stable")[first[drawn] + within]


def thin_out(cube: np.ndarray, limit: int, rng: np.random.Generator) -> np.ndarray:
    """Mask (n,) of `limit` points to keep, by their hypercubes (n,).

    Points are left out one at a time, each drawn from the most populated hypercube, which is drawn if there are several. (A roulette by
    occupancy would give all points the same probability.)
    """
    keep, occupancy = np.ones(len(cube), dtype=bool), np.bincount(cube)
    for _ in range(len(cube) - limit):
        fullest = rng.choice(np.flatnonzero(occupancy == occupancy.max()))
        keep[rng.choice(np.flatnonzero(keep & (cube == fullest)))] = False
        occupancy[fullest] -= 1
    return keep


def velocities(
    box: UnitBox,
    X: np.ndarray,
    V: np.ndarray,
    best: np.ndarray,
    leaders: np.ndarray,
    *,
    weights: tuple[float, float, float],
    chance: np.ndarray,
    largest: float,
) -> np.ndarray:
    """New velocities (n, d): w V + c1 r1 (best - X) + c2 r2 (leaders - X), for a time step of 1.

    This is eq. (22) with the sign of its differences corrected; with the printed sign, particles would move away from what attracts them.
    X, V, best, leaders (n, d), chance (2, n, d).
    """
    w, c1, c2 = weights
    V = w * V + c1 * chance[0] * box.difference(best, X) + c2 * chance[1] * box.difference(leaders, X)
    return np.clip(V, -largest, largest)


def moved(box: UnitBox, X: np.ndarray, V: np.ndarray, rebound: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities (n, d) after a time step of 1.

    A coordinate that leaves the box is set to the bound, and its velocity is multiplied by `rebound` (n, d), in [-1, 0]. A periodic
    coordinate re-enters at the other bound with its velocity unchanged.
    """
    there = X + V
    out = ((there < 0.0) | (there > 1.0)) & ~box.wraps
    return box.put_back(there), np.where(out, V * rebound, V)


def improved(F: np.ndarray, best: np.ndarray, coin: np.ndarray) -> np.ndarray:
    """Mask (n,) of the particles whose new objectives F (n, m) replace the old `best` (n, m), eq. (20).

    They do if they dominate; if neither dominates, `coin` (n,) decides.
    """
    return dominates(F, best) | (~dominates(best, F) & coin)
