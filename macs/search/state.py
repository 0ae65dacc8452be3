"""State of a search between two iterations: agents, archive, ideal and nadir points, memory, counters and generator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..evaluation.evaluator import INFEASIBLE, Evaluation, Evaluator
from ..evaluation.linear_models import Samples
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


@dataclass(repr=False)
class Agents:
    """Population of a search: n agents with their positions and velocities."""

    SHAPES: ClassVar[dict[str, str]] = {
        "Z": "n D", "F": "n m", "violation": "n", "velocity": "n d", "rho": "n", "contractions": "n int", "direction": "n int",
    }  # fmt: skip

    Z: np.ndarray  # (n, D): Positions: full vectors, in the user's units
    F: np.ndarray  # (n, m): Objectives, all minimised; NaN where the evaluation failed
    violation: np.ndarray  # (n,): Largest scaled residual; infinite where the evaluation failed
    velocity: np.ndarray  # (n, d): Displacement of the free variables by the last successes, in units of span; zero for an agent at rest
    rho: np.ndarray  # (n,): Relative radius of the pattern search
    contractions: np.ndarray  # (n,): Number of contractions of the radius since it was last reset
    direction: np.ndarray  # (n,): Row, in the pool of directions, of the scalar sub-problem of the agent; -1 if it has none

    def __len__(self) -> int:
        return len(self.Z)

    def __repr__(self) -> str:
        return f"<Agents: {len(self)}, {np.count_nonzero(self.direction != NO_DIRECTION)} with a direction>"

    def place(self, rows: np.ndarray, Z: np.ndarray, F: np.ndarray, violation: np.ndarray) -> None:
        """Move the agents `rows` to evaluated points Z (k, D), F (k, m), violation (k,)."""
        self.Z[rows], self.F[rows], self.violation[rows] = Z, F, violation

    def adapt_radius(self, rows: np.ndarray, success: np.ndarray, rho: float, contraction: float, limit: int) -> None:
        """Contract the radius of agents without success, and expand that of agents with success; at either limit it is reset. success
        (n,)."""
        self.contractions[rows] += np.where(success[rows], -1, 1)
        self.rho[rows] *= np.where(success[rows], 1.0 / contraction, contraction)
        anew = (self.contractions < 0) | (self.contractions > limit)
        self.contractions[anew] = 0
        self.rho[anew] = rho


@dataclass(repr=False)
class SearchState:
    """All data of a search between two iterations: with the same evaluator and settings it continues to the same bits.

    Attributes
    ----------
    agents : Agents
    archive : Archive
    closest : Archive
        The least violated point evaluated, as long as no point was feasible; no row once the archive has points.
    breeders : Archive
        The least violated of the first population and of offspring, at most as many as the archive may have, the best first, as long as no
        point was feasible. What agents find is not among them: many points near few good ones would soon take all places.
    outside : Archive
        Infeasible points with better objectives than the archive's, see `archive.outside`; none where the inner level moves candidates.
    samples : Samples
        The last points with the residuals of all constraints, for `restoration`; none where nothing is restored.
    restored : array (2, 2)
        Credit of steps of restoration, in the second row, and of all other evaluations.
    progress : array (2, 2)
        What agents with a direction, and lone ones in the second row, have gained, and in how many evaluations; older ones count less.
    ahead : float
        Evaluations that lone agents have had beyond their share, at least 0.
    ideal, nadir : arrays (m,)
        Best feasible values ever evaluated; worst values in the archive. NaN as long as no point was feasible.
    directions : array (k, m)
        Pool from which the directions of the agents are drawn.
    experience : array (k, d)
        Displacements of the last improvements of all agents, in units of span, oldest first.
    credit : array (o, 2)
        For each breeding operator, the number of offspring that stayed in the archive and of all offspring; see `breeding.updated_credit`.
    effort : array (w + 1, 5)
        What the inner solvers, and the gradient solves, have brought for how much work; see `effort`.
    iteration, evaluations, refinements : int
        Iterations done; evaluations counted by the evaluator; gradient solves of agents.
    optima : Archive
        The best of what gradient solves for the whole front have found: when the search, or a round, began, and in polishes.
    rng : numpy.random.Generator
        The generator of all random numbers; a checkpoint keeps its `bit_generator.state`.
    hopeless : int
        As long as no point was feasible: number of candidates that the inner level left where the violation can get no smaller nearby.
    polishing : PolishLog, optional
        Solves of a polish that has begun and is not finished.
    alike : array (m,) of bool
        Whether, when the search began, solves for an objective alone from as many starts as are enough all ended in the same optimum.
    several : bool
        Whether solves from different starts ended in different optima, then or when a round began.
    polished : Archive, optional
        What the last polish made.
    in_vain : array (k, 2 m), optional
        What polishes need not try again; see `BudgetedSolves`.
    rounds : Rounds, optional
        Of a search without a number of evaluations.
    """

    SHAPES: ClassVar[dict[str, str]] = {
        "ideal": "m", "nadir": "m", "directions": "k m", "experience": "e d", "credit": "o 2", "restored": "2 2",
        "progress": "2 2", "effort": "w 5", "alike": "m bool", "in_vain": "v 2m",
    }  # fmt: skip
    INDICES: ClassVar[dict[str, str]] = {"agents.direction": "directions"}

    agents: Agents
    archive: Archive
    closest: Archive
    breeders: Archive
    outside: Archive
    samples: Samples
    restored: np.ndarray
    progress: np.ndarray
    ideal: np.ndarray
    nadir: np.ndarray
    directions: np.ndarray
    experience: np.ndarray
    credit: np.ndarray
    effort: np.ndarray
    iteration: int
    evaluations: int
    optima: Archive
    alike: np.ndarray
    rng: np.random.Generator
    refinements: int = 0
    hopeless: int = 0
    polishing: PolishLog | None = None
    several: bool = False
    polished: Archive | None = None
    in_vain: np.ndarray | None = None
    rounds: Rounds | None = None
    ahead: float = 0.0

    @property
    def parents(self) -> Archive:
        """The points that are bred: the archive, or the breeders as long as it is empty."""
        return self.archive if len(self.archive) else self.breeders

    def learn(self, optima: Archive) -> None:
        """Keep those of these optima, and of the known ones, that are non-dominated."""
        both = self.optima.joined(optima)
        self.optima = both.take(nondominated(both.F))

    def __repr__(self) -> str:
        counts = {"iteration": self.iteration, "evaluation": self.evaluations, "gradient solve": self.refinements}
        return f"<SearchState: {', '.join(counted(number, what) for what, number in counts.items())}; {self.agents}, {self.archive}>"


def remember(state: SearchState, seen: list[Evaluation], settings: Settings, evaluator: Evaluator, bred: bool = True) -> None:
    """Offer evaluated points to the archive and update ideal and nadir; as long as none is feasible, update the least violated point and,
    if they are `bred`, the breeders."""
    if not seen:
        return
    Z, F = np.vstack([e.Z for e in seen]), np.vstack([e.F for e in seen])
    violation = np.concatenate([e.violation for e in seen])
    limit, tolerance = settings.archive, evaluator.tolerance
    guide = guide_of(settings.prefer, evaluator)
    state.archive = archives.insert(
        state.archive, Z, F, violation, limit=limit, tolerance=tolerance, exponent=settings.exponent, guide=guide
    )
    if len(state.archive):
        state.ideal = np.fmin(state.ideal, state.archive.F.min(axis=0))
        state.nadir = state.archive.F.max(axis=0)
        if settings.breeding != 0.0 and not evaluator.moves:
            known = state.outside.joined(state.breeders)
            state.outside = archives.outside(known, state.archive, Z, F, violation, limit=limit, tolerance=tolerance)
        state.closest, state.breeders = (one.take(np.arange(0)) for one in (state.closest, state.breeders))
        return
    state.closest = archives.least_violated(state.closest, Z, F, violation)
    if bred:
        state.breeders = archives.least_violated(state.breeders, Z, F, violation, limit)
    state.hopeless += sum(e.status.tolist().count(INFEASIBLE) for e in seen if e.fallbacks)


def agents_at(seen: Evaluation, rows: np.ndarray, d: int, settings: Settings) -> Agents:
    """Agents at rest at the evaluated points `rows`, with d free variables."""
    count = len(rows)
    return Agents(
        Z=seen.Z[rows],
        F=seen.F[rows],
        violation=seen.violation[rows],
        velocity=np.zeros((count, d)),
        rho=np.full(count, settings.rho),
        contractions=np.zeros(count, dtype=int),
        direction=np.full(count, NO_DIRECTION),
    )
