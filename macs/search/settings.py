"""Settings of MACS: every parameter, its range, its default, and its value in the paper."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil
from numbers import Real
from typing import Any, Self

import numpy as np

from problems.checks import check_count
from transcription.catalogue import parse

SHARE = 8
"""Of the budget, this part is the most that an iteration's scan of the coordinates may take."""
LEAST = {"agents": 3, "archive": 1, "max_contractions": 0, "memory": 1, "refine_every": 1, "polish_every": 1}
OPTIONAL = ("verify", "exponent")
INTERVALS = {
    "rho": ("(0, 1]", lambda x: 0 < x <= 1),
    "F": ("(0, 2]", lambda x: 0 < x <= 2),
    "CR": ("[0, 1]", lambda x: 0 <= x <= 1),
    "social": ("[0, 1]", lambda x: 0 <= x <= 1),
    "contraction": ("(0, 1)", lambda x: 0 < x < 1),
    "coordinates": ("(0, 1]", lambda x: 0 < x <= 1),
    "momentum": ("[0, 1)", lambda x: 0 <= x < 1),
    "concentration": ("[1, 10]", lambda x: 1 <= x <= 10),
    "experience": ("[0, 1]", lambda x: 0 <= x <= 1),
    "breeding": ("[0, 10]", lambda x: 0 <= x <= 10),
    "mesh_tolerance": ("[1e-10, 1]", lambda x: 1e-10 <= x <= 1),
    "verify": ("(0, inf)", lambda x: 0 < x < np.inf),
    "exponent": ("[1, 16]", lambda x: 1 <= x <= 16),
}
"""The interval that each number has to be in; OPTIONAL ones may be None."""


@dataclass(frozen=True)
class Settings:
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
        for name, least in LEAST.items():
            check_count(f"MACS: {name}", getattr(self, name), least)
        for name, least in (("directions", 1), ("sample", self.agents)):
            if getattr(self, name) is not None:
                check_count(f"MACS: {name}", getattr(self, name), least)
        for name in ("refine", "adaptive_coordinates", "redraw", "shorten", "social_moves", "keep_velocity"):
            if not isinstance(getattr(self, name), bool | np.bool_):
                raise ValueError(f"MACS: {name} must be True or False, not {getattr(self, name)!r}")
        for name, (interval, inside) in INTERVALS.items():
            value = getattr(self, name)
            if (value is not None or name not in OPTIONAL) and (
                not isinstance(value, Real) or isinstance(value, bool) or not inside(value)
            ):
                raise ValueError(f"MACS: {name} must be in {interval}, not {value!r}")
        if self.reseed not in ("all", "spread"):
            raise ValueError(f"MACS: reseed must be 'all' or 'spread', not {self.reseed!r}")
        if self.mesh not in ("fixed", "adaptive"):
            raise ValueError(f"MACS: mesh must be 'fixed' or 'adaptive', not {self.mesh!r}")
        self._check_polish()

    def _check_polish(self) -> None:
        if self.polish_on is None:
            if self.verify is not None:
                raise ValueError("MACS: verify makes no sense without polish_on")
            return
        if not isinstance(self.polish_on, str):
            raise ValueError(f"MACS: polish_on must be a word such as 'dfet:30x3', not {self.polish_on!r}")
        try:
            parse(self.polish_on)
        except ValueError as error:
            raise ValueError(f"MACS: polish_on: {error}") from error
        if not self.refine:
            raise ValueError("MACS: polish_on makes no sense with refine=False, which is to use no derivatives")
        if self.mesh == "adaptive":
            raise ValueError("MACS: polish_on makes no sense with mesh='adaptive': points are on the mesh that it says")

    @classmethod
    def paper(cls, **overrides: Any) -> Self:
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

    @property
    def refines(self) -> bool:
        """Whether there are gradient solves on the transcription that is searched."""
        return self.refine and self.polish_on is None

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
