"""MACS: Multi-Agent Collaborative Search, its settings and its hooks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil
from numbers import Real
from typing import Any

import numpy as np

from problems.compiled import CompiledProblem
from transcription.base import Transcription

from .. import ending
from ..evaluation.evaluator import Evaluator
from ..front import Front
from ..solvers.solver import Solver
from . import loop as search
from .state import SearchState

SHARE = 8
"""Of the budget, this part is the most that an iteration's scan of the coordinates may take."""


@dataclass(frozen=True)
class MACS(Solver):
    """Multi-Agent Collaborative Search (Ricciardi and Vasile 2015; Ricciardi, Vasile and Maddock 2016).

    A few agents look for better points, each by itself and then with what all have found; an archive keeps the best trade-offs,
    evenly spread.

    Parameters
    ----------
    agents : int, default 10
        Number of agents, at least 3: differential evolution takes its parents among the others.
    archive : int, default 10
        Largest number of points in the archive, and so on the front; at least the number of objectives, whose best points are always kept.
    refine : bool, default True
        Use derivatives, where the problem has them (a black box has none): one gradient solve of an agent for every `refine_every`
        evaluations, and at the end of the search a polish of the archive, of about six solves for each of its points, as far as one for
        every `polish_every` evaluations goes; with more than two objectives it first goes down to the front from places all over it, once
        for each point that the archive may hold. They are counted in `stats["gradient_solves"]`, and points then carry their `optimality`.
        False: the derivative-free method.
    polish_on : str, optional
        A transcription, said as on the command line ("dfet:30x3:bernstein:1"), on which the archive is polished instead, see
        `Front.polished`: a search wants what is scored quickly, such as shooting, gradients what is sparse. There are no gradient solves of
        agents then. Not after Ctrl-C, a time limit or a callback ended the search; of a finished checkpoint the polish is made again.
    verify : float, optional
        For `polish_on`: by how much, in their scales, constraints may be missed when a point is flown. Points that miss more are moved
        inside, by solves that come beside, or left out.
    mesh : {"fixed", "adaptive"}, default "fixed"
        "adaptive": at its end, the search refines the mesh of each point of its front until what the point promises can be flown, see
        `Front.refine_mesh`; points that turn out to be dominated are left out. Not after Ctrl-C, a time limit or a callback ended it. Black
        boxes have no mesh.
    mesh_tolerance : float, default 1e-7
        For an adaptive mesh: largest difference of a flown state from the transcription's, in spans of its bounds.
    rho : float, default 1.0
        Radius of the pattern search to begin with, in (0, 1], as a fraction of half the span of each variable (Table I: 1).
    F : float, default 0.9
        Weight of the differences in differential evolution, in (0, 2] (Table I: 0.9).
    CR : float, default 0.9
        Probability that a coordinate takes part in a step of differential evolution, in [0, 1] (Table I: 0.9).
    social : float, default 1.0
        Fraction of the agents that own a direction and act socially, in [0, 1] (Table I: 1). Fewer than there are objectives: none do.
    contraction : float, default 0.5
        By how much the radius shrinks when everything an agent tried failed, in (0, 1) (Table I: 0.5).
    max_contractions : int, default 5
        After how many contractions the radius starts anew, at least 0 (Table I: 5).
    coordinates : float, default 1.0
        Fraction of the coordinates that pattern search goes through, in (0, 1]; used if `adaptive_coordinates` is off (Table I: 1).
    adaptive_coordinates : bool, default True
        Go through all coordinates while the archive is empty and through one when it is full (the authors' later code); but not through so
        many that, if all fail, an iteration takes more than an eighth of the budget.
    directions : int, optional
        How many directions the agents' own are drawn from, at least 1. Default: 100 for each objective (the authors' later code).
    redraw : bool, default True
        Draw the agents' directions anew in every iteration; otherwise they keep those they were given first, as in the paper.
    reseed : {"all", "spread"}, default "all"
        Which points of the archive agents may be sent to: all, or only as many as there are agents, well spread. With "spread", agents are
        also sent to an archive of fewer points than objectives: those nearest to them (the authors' later code).
    momentum : float, default 0.7
        How much of the last velocity stays when a success adds its displacement to it, in [0, 1). 0 as in the paper: it is replaced.
    concentration : float, default 1.5
        Exponent of the lengths of pattern search, in [1, 10]: radius times a uniform number to this power. Higher: more short steps. 1 in
        the paper.
    experience : float, default 0.3
        Probability that a social agent moves as others did when they improved, in [0, 1]. 0 in the paper, where it only uses positions.
    memory : int, default 100
        How many of the last improvements are remembered for that, at least 1.
    shorten : bool, default False
        Shorten inertia's steps until they stay in the box, as in the paper; otherwise they are clipped to it, variable by variable.
    social_moves : bool, default True
        Agents go where a social action was a success. False as in the paper: social actions only offer points to the archive.
    refine_every : int, default 200
        How many evaluations there are, at least 1, for each gradient solve of an agent.
    polish_every : int, default 20
        How many evaluations there are, at least 1, for each gradient solve in all.
    keep_velocity : bool, default True
        Every success gives its agent a velocity. Otherwise only one of pattern search does, and the others leave it at rest (the authors'
        later code).
    breeding : float, default 0.15
        How many offspring each point of the archive has in an iteration, in [0, 10]; altogether at least one for each agent. More of them
        get out of more local fronts, fewer leave the agents more to spend on convergence. 0 in the paper: there are none.
    sample : int, optional
        How many points are drawn to begin with, at least as many as agents. Default: as many as the archive holds, if these are more, but
        of the budget no more than a twentieth. In the paper there are as many as agents.
    exponent : float, optional
        By which power of the distance the charges of the archive repel each other, in [1, 16]. Default: 2 as in the paper with two
        objectives, 8 with more: on a surface a lower one drives the points to its edges.

    Raises
    ------
    ValueError
        Where a setting is out of its range; the message names it.
    """

    agents: int = 10
    archive: int = 10
    refine: bool = True
    polish_on: str | None = None
    verify: float | None = None
    mesh: str = "fixed"
    mesh_tolerance: float = 1e-7
    rho: float = 1.0
    F: float = 0.9
    CR: float = 0.9
    social: float = 1.0
    contraction: float = 0.5
    max_contractions: int = 5
    coordinates: float = 1.0
    adaptive_coordinates: bool = True
    directions: int | None = None
    redraw: bool = True
    reseed: str = "all"
    momentum: float = 0.7
    concentration: float = 1.5
    experience: float = 0.3
    memory: int = 100
    shorten: bool = False
    social_moves: bool = True
    keep_velocity: bool = True
    refine_every: int = 200
    polish_every: int = 20
    breeding: float = 0.15
    sample: int | None = None
    exponent: float | None = None

    def __post_init__(self) -> None:
        self._check_count("agents", self.agents, 3)
        self._check_count("archive", self.archive, 1)
        self._check_count("max_contractions", self.max_contractions, 0)
        self._check_count("memory", self.memory, 1)
        self._check_count("refine_every", self.refine_every, 1)
        self._check_count("polish_every", self.polish_every, 1)
        if self.directions is not None:
            self._check_count("directions", self.directions, 1)
        if self.sample is not None:
            self._check_count("sample", self.sample, self.agents)
        if self.exponent is not None:
            self._check_range("exponent", "[1, 16]", lambda x: 1 <= x <= 16)
        for name in ("refine", "adaptive_coordinates", "redraw", "shorten", "social_moves", "keep_velocity"):
            if not isinstance(getattr(self, name), bool | np.bool_):
                raise ValueError(f"MACS: {name} must be True or False, not {getattr(self, name)!r}")
        ending.check(self)
        self._check_range("mesh_tolerance", "[1e-10, 1]", lambda x: 1e-10 <= x <= 1)
        if self.verify is not None:
            self._check_range("verify", "(0, inf)", lambda x: 0 < x < np.inf)
        if self.reseed not in ("all", "spread"):
            raise ValueError(f"MACS: reseed must be 'all' or 'spread', not {self.reseed!r}")
        self._check_range("rho", "(0, 1]", lambda x: 0 < x <= 1)
        self._check_range("F", "(0, 2]", lambda x: 0 < x <= 2)
        self._check_range("CR", "[0, 1]", lambda x: 0 <= x <= 1)
        self._check_range("social", "[0, 1]", lambda x: 0 <= x <= 1)
        self._check_range("contraction", "(0, 1)", lambda x: 0 < x < 1)
        self._check_range("coordinates", "(0, 1]", lambda x: 0 < x <= 1)
        self._check_range("momentum", "[0, 1)", lambda x: 0 <= x < 1)
        self._check_range("concentration", "[1, 10]", lambda x: 1 <= x <= 10)
        self._check_range("experience", "[0, 1]", lambda x: 0 <= x <= 1)
        self._check_range("breeding", "[0, 10]", lambda x: 0 <= x <= 10)

    @classmethod
    def paper(cls, **overrides: Any) -> MACS:
        """The settings of Table I of the paper, and what it does where the defaults do otherwise; `overrides` as for MACS itself.

        There are as many directions as social agents, and these keep theirs; as many points are sampled as there are agents. What
        deliberately stays different:

        - Feasible points come before infeasible ones, and these by their violation; no penalty enters an objective.
        - The budget is met exactly. The best point of each objective never leaves the archive.
        - The scalarisation is normalised by feasible points only: the best values ever, and the worst ones in the archive.
        - Success is dominance, or a better value for the direction; a point with equal objectives is none.
        - A success puts its agent there at once, where the next actions of the others find it as a parent.
        - Velocities are displacements that the inner level left, and the radius is credited with a success only for most of its own step.
        - The parents in differential evolution are others than the agent, in social actions also other than its copies in the archive.
        - Inertia shortens the step that it takes, not the velocity. One coordinate of differential evolution always takes part.
        """
        settings: dict[str, Any] = {
            "refine": False,
            "adaptive_coordinates": False,
            "redraw": False,
            "reseed": "spread",
            "momentum": 0.0,
            "concentration": 1.0,
            "experience": 0.0,
            "shorten": True,
            "social_moves": False,
            "keep_velocity": False,
            "breeding": 0.0,
            "exponent": 2.0,
        }
        paper = cls(**(settings | overrides))
        counts: dict[str, Any] = {"directions": max(1, round(paper.social * paper.agents)), "sample": paper.agents}
        return replace(paper, **{name: count for name, count in counts.items() if name not in overrides})

    def begin(self, evaluator: Evaluator, budget: int, rng: np.random.Generator, start: np.ndarray | None = None) -> SearchState:
        """Sample, evaluate and archive the first population.

        Parameters
        ----------
        evaluator : Evaluator
        budget : int
            How many evaluations the evaluator may have counted in the end; never exceeded.
        rng : numpy.random.Generator
            The one source of chance; it becomes part of the state.
        start : array (k, D), optional
            Full vectors to begin with, evaluated first. Missing agents are sampled, and of too many the best become agents.

        Returns
        -------
        SearchState

        Raises
        ------
        ValueError
            Where the archive is smaller than the number of objectives, or the budget leaves nothing to evaluate.
        """
        return search.begin(self, evaluator, budget, rng, start)

    def advance(self, state: SearchState, evaluator: Evaluator, budget: int) -> None:
        """One iteration, of some tens of evaluations; changes `state`. With the budget spent it does nothing."""
        search.advance(self, state, evaluator, budget)

    def conclude(self, state: SearchState, evaluator: Evaluator) -> None:
        """Polish the archive by gradients, where there are any. Asked to end early, it leaves what it has; called again, it goes on."""
        search.conclude(self, state, evaluator)

    @property
    def certifies(self) -> bool:
        """See `Solver.certifies`."""
        return self.refines

    @property
    def refines(self) -> bool:
        """Whether there are gradient solves on the transcription that is searched."""
        return self.refine and self.polish_on is None

    def check_objectives(self, m: int) -> None:
        """Refuse an archive that could not keep the best points of all m objectives."""
        if self.archive < m:
            raise ValueError(f"MACS: archive must hold at least one point for each of the {m} objectives, not {self.archive}")

    def check_transcription(self, transcription: Transcription, problem: CompiledProblem) -> None:
        """Refuse to adapt meshes of methods whose meshes nobody knows how to refine, and to polish where gradients make no sense."""
        ending.check_transcription(self, transcription, problem)

    def finish(self, front: Front, time_limit: float | None, progress: bool) -> Front:
        """The front polished on another transcription, or with its meshes refined, where that is wanted."""
        return ending.finish(self, front, time_limit, progress)

    def coordinates_to_scan(self, d: int, archived: int, m: int, budget: int) -> int:
        """How many of d coordinates pattern search goes through; with one objective the archive is full with one point."""
        if not self.adaptive_coordinates:
            return max(1, ceil(d * self.coordinates - 1e-9))
        limit = self.archive if m > 1 else 1
        wanted = ceil(d * (1.0 - (1.0 - 1.0 / d) * archived / limit) - 1e-9)
        return max(1, min(wanted, budget // (2 * SHARE * self.agents)))

    def points_to_sample(self, budget: int) -> int:
        """How many points are drawn to begin with."""
        return max(self.agents, min(self.archive, budget // 20)) if self.sample is None else self.sample

    def offspring(self, archived: int) -> int:
        """How many offspring an archive of so many points has in an iteration: none if there are no points."""
        return max(self.agents, round(self.breeding * archived)) if self.breeding and archived else 0

    def social_agents(self, m: int) -> int:
        """How many agents own a direction, with m objectives: none, if they could not own all the orthogonal ones."""
        count = round(self.social * self.agents)
        return count if count >= m else 0

    def _check_count(self, name: str, value: Any, least: int) -> None:
        if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < least:
            raise ValueError(f"MACS: {name} must be a whole number of at least {least}, not {value!r}")

    def _check_range(self, name: str, interval: str, inside: Any) -> None:
        value = getattr(self, name)
        if not isinstance(value, Real) or isinstance(value, bool) or not inside(value):
            raise ValueError(f"MACS: {name} must be in {interval}, not {value!r}")
