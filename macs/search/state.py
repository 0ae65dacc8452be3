"""The state of a search: agents, archive, and what else has to be known between two iterations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..evaluation.evaluator import Evaluation, Evaluator
from ..gradients.polish import PolishLog
from ..pareto import archive as archives
from ..pareto.archive import Archive
from .settings import Settings

NO_DIRECTION = -1


@dataclass
class Agents:
    """The population of a search.

    Attributes
    ----------
    Z : array (n, D)
        Positions: full vectors, in the user's units.
    F : array (n, m)
        Objectives, all minimised; NaN where the evaluation failed.
    violation : array (n,)
        Infinite where the evaluation failed.
    velocity : array (n, d)
        The free displacement that the last success achieved, in units of span; zero where there is none.
    rho : array (n,)
        Relative radius of the pattern search.
    contractions : array (n,) of int
        How many times the radius has been contracted.
    direction : array (n,) of int
        Row, in the pool of directions, of the sub-problem that the agent owns; -1 where it owns none.
    """

    Z: np.ndarray
    F: np.ndarray
    violation: np.ndarray
    velocity: np.ndarray
    rho: np.ndarray
    contractions: np.ndarray
    direction: np.ndarray

    def __len__(self) -> int:
        return len(self.Z)

    def place(self, rows: np.ndarray, Z: np.ndarray, F: np.ndarray, violation: np.ndarray) -> None:
        """Put the agents `rows` on evaluated points."""
        self.Z[rows], self.F[rows], self.violation[rows] = Z, F, violation

    def adapt_radius(self, success: np.ndarray, rho: float, contraction: float, limit: int) -> None:
        """Contract the radius of the agents that failed, widen that of those that succeeded; past either end it starts anew.

        Parameters
        ----------
        success : array (n,) of bool
        rho : float
            The radius to start with.
        contraction : float
            By how much it shrinks.
        limit : int
            How many contractions in a row are allowed.
        """
        self.contractions += np.where(success, -1, 1)
        self.rho *= np.where(success, 1.0 / contraction, contraction)
        anew = (self.contractions < 0) | (self.contractions > limit)
        self.contractions[anew] = 0
        self.rho[anew] = rho


@dataclass
class SearchState:
    """Everything a search knows between two iterations: with it, and the same evaluator and settings, it goes on as if never stopped.

    Attributes
    ----------
    agents : Agents
    archive : Archive
    closest : Archive
        The least violated point seen, one row, as long as none was feasible; no row before and after.
    ideal, nadir : arrays (m,)
        The best feasible values ever seen; the worst ones in the archive. NaN before there are any.
    directions : array (k, m)
        The pool that the agents' directions are drawn from.
    experience : array (k, d)
        The displacements of the last improvements of any agent, in units of span, oldest first.
    credit : array (o, 2)
        Of the operators that breed from the archive: how many of their offspring it kept, and how many there were, the older the less.
    iteration, evaluations, refinements : int
        Iterations done; evaluations spent by the evaluator so far; gradient solves of agents.
    rng : numpy.random.Generator
        Its `bit_generator.state` is data, and all there is to keep of it.
    polishing : PolishLog, optional
        Of a polish that has begun and is not finished: where to go on.
    """

    agents: Agents
    archive: Archive
    closest: Archive
    ideal: np.ndarray
    nadir: np.ndarray
    directions: np.ndarray
    experience: np.ndarray
    credit: np.ndarray
    iteration: int
    evaluations: int
    rng: np.random.Generator
    refinements: int = 0
    polishing: PolishLog | None = None


def remember(state: SearchState, seen: list[Evaluation], settings: Settings, evaluator: Evaluator) -> None:
    """Offer what was seen to the archive, and keep the ideal and nadir points, or else the least violated point."""
    if not seen:
        return
    Z, F = np.vstack([e.Z for e in seen]), np.vstack([e.F for e in seen])
    violation = np.concatenate([e.violation for e in seen])
    limit, tolerance = settings.archive, evaluator.tolerance
    state.archive = archives.insert(state.archive, Z, F, violation, limit=limit, tolerance=tolerance, exponent=settings.exponent)
    if len(state.archive):
        state.ideal = np.fmin(state.ideal, state.archive.F.min(axis=0))
        state.nadir = state.archive.F.max(axis=0)
        state.closest = state.closest.take(np.arange(0))
        return
    state.closest = archives.least_violated(state.closest, Z, F, violation)


def agents_at(seen: Evaluation, rows: np.ndarray, d: int, settings: Settings) -> Agents:
    """Agents at rest on the evaluated points `rows`."""
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
