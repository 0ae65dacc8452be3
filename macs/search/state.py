"""State of a search between two iterations: agents, archive, memory, credit, counters and generator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from ..evaluation.evaluator import INFEASIBLE, Evaluation, Evaluator
from ..gradients.polish import PolishLog
from ..io.text import counted
from ..pareto import archive as archives
from ..pareto.archive import Archive
from ..pareto.dominance import nondominated
from .guide import guide_of
from .rounds import Rounds
from .settings import Settings

NO_DIRECTION = -1
"""In place of a row in the pool of directions, for an agent that has none."""
FORGET = 0.1
"""Part of all credit that is forgotten when new is given."""
KEPT_SAMPLES = 500
"""Most points whose residuals are kept, the last ones."""
KEPT_IMPROVEMENTS = 100
"""Most displacements of improvements that are kept, the last ones."""


@dataclass(repr=False)
class Agents:
    """Population of a search: n agents with their positions and velocities."""

    SHAPES: ClassVar[dict[str, str]] = {
        "Z": "n D", "F": "n m", "violation": "n", "velocity": "n d", "rho": "n", "contractions": "n int", "direction": "n int",
    }  # fmt: skip

    Z: np.ndarray  # (n, D): Positions: full vectors, in the user's units
    F: np.ndarray  # (n, m): Objectives, all minimised; NaN where the evaluation failed
    violation: np.ndarray  # (n,): Largest scaled residual; infinite where the evaluation failed
    velocity: np.ndarray  # (n, d): Displacement of the free variables by the last success, in units of span; zero for an agent at rest
    rho: np.ndarray  # (n,): Relative radius of the pattern search
    contractions: np.ndarray  # (n,): Number of contractions of the radius since it was last reset
    direction: np.ndarray  # (n,): Row, in the pool of directions, of the scalar sub-problem of the agent; -1 if it has none

    @classmethod
    def at(cls, seen: Evaluation, rows: np.ndarray, d: int, rho: float) -> Self:
        """Agents at rest at the evaluated points `rows`, with d free variables."""
        n = len(rows)
        return cls(
            Z=seen.Z[rows],
            F=seen.F[rows],
            violation=seen.violation[rows],
            velocity=np.zeros((n, d)),
            rho=np.full(n, rho),
            contractions=np.zeros(n, dtype=int),
            direction=np.full(n, NO_DIRECTION),
        )

    def __len__(self) -> int:
        return len(self.Z)

    def __repr__(self) -> str:
        return f"<Agents: {len(self)}, {np.count_nonzero(self.direction != NO_DIRECTION)} with a direction>"

    def place(self, rows: np.ndarray, Z: np.ndarray, F: np.ndarray, violation: np.ndarray) -> None:
        """Move the agents `rows` to evaluated points Z (k, D), F (k, m), violation (k,)."""
        self.Z[rows], self.F[rows], self.violation[rows] = Z, F, violation

    def adapt_radius(self, rows: np.ndarray, success: np.ndarray, rho: float, contraction: float, limit: int) -> None:
        """Contract the radius of agents without success (n,), and expand that of agents with success; at either limit it is reset."""
        self.contractions[rows] += np.where(success[rows], -1, 1)
        self.rho[rows] *= np.where(success[rows], 1.0 / contraction, contraction)
        reset = (self.contractions < 0) | (self.contractions > limit)
        self.contractions[reset] = 0
        self.rho[reset] = rho


@dataclass
class Credit:
    """Gains and costs of each of k ways of search; older gains count less (compare Thierens 2005)."""

    SHAPES: ClassVar[dict[str, str]] = {"gained": "k", "cost": "k"}

    gained: np.ndarray
    cost: np.ndarray

    @classmethod
    def equal(cls, count: int) -> Self:
        """Initial credit, the same for all: one success in five trials."""
        return cls(np.ones(count), np.full(count, 5.0))

    def add(self, gained: np.ndarray, cost: np.ndarray) -> None:
        """Give credit (k,) to each, after forgetting a part of the earlier credit."""
        self.gained, self.cost = (1.0 - FORGET) * self.gained + gained, (1.0 - FORGET) * self.cost + cost

    def rates(self, prior: float = 0.0) -> np.ndarray:
        """Gain for each unit of cost (k,); with a prior, so that a way without a success gets further trials."""
        return (self.gained + prior) / (self.cost + 1.0)


@dataclass(frozen=True, repr=False)
class ResidualSamples:
    """Evaluated points with the residuals of all constraints, oldest first."""

    SHAPES: ClassVar[dict[str, str]] = {"X": "s d", "residuals": "s c"}

    X: np.ndarray  # (s, d): In the unit box
    residuals: np.ndarray  # (s, c): See `Evaluation.residuals`

    @classmethod
    def none(cls, d: int) -> Self:
        """No point of d variables; the number of constraints is that of the first points that are added."""
        return cls(np.empty((0, d)), np.empty((0, 0)))

    def __len__(self) -> int:
        return len(self.X)

    def __repr__(self) -> str:
        return f"<ResidualSamples: {len(self)} with {self.residuals.shape[1]} residuals>"

    def joined(self, X: np.ndarray, residuals: np.ndarray) -> Self:
        """The last of these points and of others, at most `KEPT_SAMPLES`. Raises ValueError if others have another number of residuals."""
        if not len(self):
            return type(self)(X[-KEPT_SAMPLES:], residuals[-KEPT_SAMPLES:])
        known, count = self.residuals.shape[1], residuals.shape[1]
        if count != known:
            raise ValueError(f"constraints: the function returned {count} of them, {known} before")
        return type(self)(np.vstack([self.X, X])[-KEPT_SAMPLES:], np.vstack([self.residuals, residuals])[-KEPT_SAMPLES:])


@dataclass
class GradientMemory:
    """Results of gradient solves that later ones depend on."""

    SHAPES: ClassVar[dict[str, str]] = {"starts": "k 2", "failed_pairs": "v 2m"}

    solves: int  # of single agents
    # (k, 2): Objectives that were minimised alone, each from another start, and the optima: NaN where a solve failed, -inf where no start
    # finds another one.
    starts: np.ndarray
    hopeless: int  # as long as nothing was feasible: candidates that the inner level left where the violation gets no smaller nearby
    polishing: PolishLog | None = None  # solves of a polish that has begun and is not finished
    polished: Archive | None = None  # what the last polish made
    failed_pairs: np.ndarray | None = None  # (k, 2 m): what polishes need not try again; see `BudgetedSolves`


@dataclass(repr=False)
class SearchState:
    """All data of a search between two iterations: with the same evaluator and settings it continues to the same bits."""

    SHAPES: ClassVar[dict[str, str]] = {"ideal": "m", "nadir": "m", "directions": "k m", "experience": "e d", "spent": "w 3"}
    INDICES: ClassVar[dict[str, str]] = {"agents.direction": "directions"}

    agents: Agents
    archive: Archive
    # As long as nothing is feasible: the least violated points, at most as many as the archive may have, the best first. Then infeasible
    # points with better objectives than the archive's, see `archive.outside`; none where the inner level moves candidates.
    infeasible: Archive
    optima: Archive  # the best of what gradient solves for the whole front have found, non-dominated
    ideal: np.ndarray  # (m,): best feasible values ever evaluated; NaN as long as no point was feasible
    nadir: np.ndarray  # (m,): worst values in the archive
    directions: np.ndarray  # (k, m): pool from which the directions of the agents are drawn
    experience: np.ndarray  # (e, d): displacements of the last improvements of agents, in units of span, oldest first
    samples: ResidualSamples  # the last points with the residuals of all constraints, for `repair`
    operators: Credit  # of crossover, and of differences in the second row: offspring that stayed in the archive, and all of them
    repairs: Credit  # of steps of repair, in the second row, and of all other evaluations
    undirected: Credit  # of agents with a direction, and without one in the second row: what they gained in evaluations
    excess: float  # evaluations that agents without a direction have had beyond their share, at least 0
    inner: Credit  # what the inner solvers and, in the last row, gradient solves brought for their work; no row without a choice
    spent: np.ndarray  # (w, 3): all work, all evaluations and those that were feasible, of each of these
    gradients: GradientMemory
    rng: np.random.Generator
    iteration: int = 0
    evaluations: int = 0
    rounds: Rounds | None = None  # of a search without a number of evaluations

    @property
    def closest(self) -> Archive:
        """The least violated point, as long as no point is feasible; no row once the archive has points."""
        return self.infeasible.take(np.arange(0 if len(self.archive) else min(1, len(self.infeasible))))

    @property
    def parents(self) -> Archive:
        """The points that are bred: the archive, or the least violated points as long as it is empty."""
        return self.archive if len(self.archive) else self.infeasible

    def add_optima(self, optima: Archive) -> None:
        """Keep those of these optima, and of the known ones, that are non-dominated."""
        both = self.optima.joined(optima)
        self.optima = both.take(nondominated(both.F))

    def __repr__(self) -> str:
        counts = {"iteration": self.iteration, "evaluation": self.evaluations, "gradient solve": self.gradients.solves}
        return f"<SearchState: {', '.join(counted(number, what) for what, number in counts.items())}; {self.agents}, {self.archive}>"


def update_archives(state: SearchState, seen: list[Evaluation], settings: Settings, evaluator: Evaluator, bred: bool = True) -> None:
    """Offer evaluated points to the archive and update ideal and nadir; as long as none is feasible, keep the least violated ones.

    Of points that were not `bred` only the least violated one is kept: agents try many points near few good ones, which would soon take all
    places of the parents.
    """
    if not seen:
        return
    Z, F = np.vstack([e.Z for e in seen]), np.vstack([e.F for e in seen])
    violation = np.concatenate([e.violation for e in seen])
    limit, tolerance, variant = settings.archive, evaluator.tolerance, settings.variant
    guide = guide_of(settings.prefer, evaluator)
    state.archive = archives.insert(
        state.archive, Z, F, violation, limit=limit, tolerance=tolerance, exponent=variant.energy_exponent, guide=guide
    )
    if len(state.archive):
        state.ideal = np.fmin(state.ideal, state.archive.F.min(axis=0))
        state.nadir = state.archive.F.max(axis=0)
        if variant.breeding and not evaluator.moves:
            state.infeasible = archives.outside(state.infeasible, state.archive, Z, F, violation, limit=limit, tolerance=tolerance)
        else:
            state.infeasible = state.infeasible.take(np.arange(0))
        return
    rows = slice(None) if bred else [int(np.argmin(np.where(np.isnan(violation), np.inf, violation)))]
    state.infeasible = archives.least_violated(state.infeasible, Z[rows], F[rows], violation[rows], limit)
    state.gradients.hopeless += sum(e.status.tolist().count(INFEASIBLE) for e in seen if e.fallbacks)
