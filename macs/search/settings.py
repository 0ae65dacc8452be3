"""Settings of MACS: each parameter with its range, its default and its value in the paper."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import ceil
from typing import Any, Self

import numpy as np

from problems.checks import check_choice, check_count, check_interval
from transcription.catalogue import parse

from ..pareto.dominance import CURVE
from ..pareto.niches import MANY
from ..preferences.catalogue import from_dict
from ..preferences.preference import Preference

SOME, GENERATION, GENERATIONS = 0.15, 1.0, 2.0
"""Defaults of `breeding`: few offspring, which leave most of the budget to the agents; one of each point; two of each."""
FEW_POINTS = 10
"""Points of an archive up to which, by default, all agents have a direction."""
LONG, ALONE, ALONE_SURFACE = 30_000, 6000, 12_000
"""Budget up to which, by default, all agents have a direction; evaluations beyond it for each of which there is one without, where the
front is a curve or a surface."""
SHARE = 8
"""Pattern search takes at most this part, one eighth, of the budget in one iteration."""
LEAST = {"agents": 3, "archive": 1, "max_contractions": 0, "memory": 1, "refine_every": 1, "polish_every": 1, "ceiling": 1}
"""Least value of each whole number."""
INTERVALS = {
    "rho": "(0, 1]",
    "F": "(0, 2]",
    "CR": "[0, 1]",
    "social": "[0, 1]",
    "contraction": "(0, 1)",
    "coordinates": "(0, 1]",
    "momentum": "[0, 1)",
    "concentration": "[1, 10]",
    "experience": "[0, 1]",
    "breeding": "[0, 10]",
    "mesh_tolerance": "[1e-10, 1]",
    "exponent": "[1, 16]",
}
"""Interval of each number."""
MESHES = ("mended", "fixed", "adaptive")
"""Kinds of mesh."""
OPTIONAL = ("breeding", "exponent")
"""Numbers that may be None."""


@dataclass(frozen=True)
class Settings:
    """Multi-Agent Collaborative Search: global search for the Pareto front by a few agents, refined by gradients.

    In each iteration the agents look for better points: first each by itself (individual actions), then with the information of all (social
    actions). The best trade-offs are kept in an archive and spread evenly along the front; offspring of the archive's points add to the
    search. If the problem has derivatives, gradient solves refine agents during the search and polish the archive at its end.

    `MACS()` suits most problems. Five settings matter first: `agents`, `archive`, `refine`, `mesh` and `prefer`; all others are further
    settings, under Other Parameters. `MACS(refine=False)` makes no gradient solves. `MACS.paper()` has the settings of the paper (Ricciardi
    and Vasile 2015; with trajectories: Ricciardi, Vasile and Maddock 2016); values of its Table I are given below.

    Parameters
    ----------
    agents : int, default 10
        Number of agents, at least 3, as differential evolution needs.
    archive : int, default 10
        Largest number of points in the archive, and so on the front. At least the number of objectives; the best point of each objective is
        always kept (with more than three objectives, to a millionth of its range).
    refine : bool, default True
        Use derivatives, if the problem has them (a black box has none): gradient solves of single agents during the search, see
        `refine_every`, and a polish of the archive at its end, see `polish_every`. Points then have their `optimality`.
        `stats["gradient_solves"]` counts all solves.
    mesh : {"mended", "fixed", "adaptive"}, default "mended"
        What is done after the search, unless it was ended by Ctrl-C, a time limit or a callback, for optimal control problems. "mended":
        points that a simulation does not confirm are solved again on finer meshes, see `Front.mended`. "fixed": all points stay on the mesh
        of the search. "adaptive": each point is solved on a mesh of its own until a simulation confirms it, see `Front.refine_mesh`.
        With `refine=False` points are not mended.
    prefer : Preference or dict, optional
        What you want of the objectives, see `macs.decisions`, or as plain data: the search goes where it is good. The archive is dense in
        the region of interest, where the value of the preference is within a twentieth of its spread along the front from the best, and
        sparse elsewhere, with the ends of the front; so are the directions of agents and gradient solves. As long as the front at hand does
        not reach the values that the preference names, the search is even; in the end `stats["prefer"]` says so.

    Other Parameters
    ----------------
    polish_on : str, optional
        Another transcription for all gradient solves, such as "dfet:30x3:bernstein:1": search where candidates are evaluated quickly
        (shooting), and polish where the problem is sparse. The front is then polished after the search, see `Front.polished`, and single
        agents are not refined. A search that was ended by Ctrl-C, a time limit or a callback is not polished. A finished checkpoint is
        polished again each time.
    mesh_tolerance : float, default 1e-7
        With `mesh="adaptive"`: largest difference between a simulated state and that of the transcription, in spans of its bounds, in
        [1e-10, 1].
    rho : float, default 1.0
        Initial radius of the pattern search, in (0, 1], as a fraction of half the span of each variable (Table I: 1).
    F : float, default 0.9
        Weight of the differences in differential evolution, in (0, 2] (Table I: 0.9).
    CR : float, default 0.9
        Probability that a coordinate changes in differential evolution, in [0, 1] (Table I: 0.9).
    social : float, default 1.0
        Fraction of the agents that do social actions, each for a direction of its own, in [0, 1] (Table I: 1). If they would be fewer than
        the objectives, no agent does.
    contraction : float, default 0.5
        Factor by which the radius shrinks when all actions of an agent failed, in (0, 1) (Table I: 0.5).
    max_contractions : int, default 5
        Number of contractions after which the radius is reset, at least 0 (Table I: 5).
    coordinates : float, default 1.0
        Fraction of the coordinates that pattern search tries, in (0, 1], if `adaptive_coordinates` is off (Table I: 1).
    adaptive_coordinates : bool, default True
        Pattern search tries all coordinates while the archive is empty, and one when it is full (the authors' later code). As long as
        nothing is feasible the least violated points, as many as the archive may have, stand for it, unless `breeding` is 0. An iteration
        takes at most an eighth of the budget for it.
    lone : int, optional
        Number of further agents, which have no direction, at least 0: they do individual actions only, and stay where these lead. So they
        reach parts of the front that the archive, which keeps what is non-dominated at the moment, has lost. In an iteration as many of
        them act as there are `agents`, as long as they gain as much in an evaluation; the less they gain, the rarer. Default: one for each
        6000 evaluations of the budget beyond 30 000, with three objectives 12 000, at most half as many as the points of `archive` beyond
        10, and none with more than three objectives. 0 in the paper. There are never more agents than points in the first population.
    directions : int, optional
        Number of directions that those of the agents are drawn from, at least 1. Default: 100 for each objective (the authors' later code).
    redraw : bool, default True
        Draw the agents' directions anew in each iteration. False: they keep their first directions, as in the paper.
    reseed : {"all", "spread"}, default "all"
        Points of the archive that agents are moved to: all, or only as many as there are agents, well spread. With "spread", agents are
        also moved to an archive with fewer points than objectives, the nearest agents first (the authors' later code).
    momentum : float, default 0.7
        Part of the last velocity that is added to the displacement of a success, in [0, 1). 0 in the paper.
    concentration : float, default 1.5
        Exponent of the step lengths of pattern search, in [1, 10]: the radius times a uniform number to this power. A higher value gives
        more short steps. 1 in the paper.
    experience : float, default 0.3
        Probability that a social agent repeats past improvements of all agents, in [0, 1]. 0 in the paper.
    memory : int, default 100
        Number of improvements that are kept for `experience`, at least 1.
    shorten : bool, default False
        Shorten steps of inertia so that they end in the box, as in the paper. False: each variable is clipped to its bounds.
    social_moves : bool, default True
        Agents move to the points of successful social actions. False as in the paper: these points are only offered to the archive.
    keep_velocity : bool, default True
        Every success gives its agent a velocity. False: only a success of pattern search does (the authors' later code).
    refine_every : int, default 200
        During the search, one gradient solve of an agent for so many evaluations, at least 1.
    polish_every : int, default 20
        At most one gradient solve, those during the search included, for so many evaluations, at least 1; where the search chooses its
        inner level, `inner="auto"`, a polish may always make 60. It needs about six for each point of the archive; with more than two
        objectives, one more for each point that the archive may contain. Not among these are the solves for the ends of the front, and
        points between them, with which a search begins if it chooses its inner level, or if none of its first candidates is feasible.
    breeding : float, optional
        Number of offspring of each point of the archive in an iteration, in [0, 10]; if positive, at least as many offspring as agents.
        More offspring escape from more local fronts, and leave less of the budget for the agents. Default: 0.15 with up to two
        objectives, and with three where there are `lone` agents; otherwise 1; and 2 as long as nothing is feasible. If positive,
        infeasible points with better objectives than the archive's have one child each, where the inner level does not move candidates.
        0 in the paper.
    restore : bool, default True
        Move infeasible points that the archive does not dominate towards feasible ones, by linear models of the constraints, where the
        inner level does not move candidates and constraints are known one by one. False in the paper.
    sample : int, optional
        Number of points of the first population, at least that of the agents. Default: the size of the archive, but at most a twentieth of
        the budget and at least the number of agents. In the paper: the number of agents.
    exponent : float, optional
        Power of the distance in the energy that spreads the archive, in [1, 16]. Default: 2, as in the paper, with two objectives, and 8
        with three: on a surface, a low power drives the points to the edges. By default a point also takes the place of the nearest one
        if it adds more to the dominated volume, see `macs.pareto.spread`; with a power given, and with `prefer`, energy alone decides. With
        more than three objectives the default is no energy: the archive has the best points near evenly spread directions, see
        `macs.pareto.niches`, unless there is a preference.
    ceiling : int, default 100 000
        Largest number of evaluations of a search without one of its own (`evaluations=None`), which otherwise ends when it is done.

    Raises
    ------
    ValueError
        If a setting is outside its range; the message names it.

    Examples
    --------
    >>> from macs import MACS
    >>> from problems import load
    >>> from transcription import DFET
    >>> front = MACS(archive=5).solve(load("goddard"), DFET(4, 6), evaluations=100, seed=1)
    >>> print(len(front), front.verified.all())
    5 True
    """

    agents: int = 10
    archive: int = 10
    refine: bool = True
    polish_on: str | None = None
    mesh: str = "mended"
    mesh_tolerance: float = 1e-7
    rho: float = 1.0
    F: float = 0.9
    CR: float = 0.9
    social: float = 1.0
    contraction: float = 0.5
    max_contractions: int = 5
    coordinates: float = 1.0
    adaptive_coordinates: bool = True
    lone: int | None = None
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
    breeding: float | None = None
    restore: bool = True
    sample: int | None = None
    exponent: float | None = None
    ceiling: int = 100_000
    prefer: Preference | None = None

    def __post_init__(self) -> None:
        for name, least in LEAST.items():
            check_count(f"MACS: {name}", getattr(self, name), least)
        for name, least in (("directions", 1), ("lone", 0), ("sample", self.agents)):
            if getattr(self, name) is not None:
                check_count(f"MACS: {name}", getattr(self, name), least)
        for name in ("refine", "adaptive_coordinates", "redraw", "shorten", "social_moves", "keep_velocity", "restore"):
            if not isinstance(getattr(self, name), bool | np.bool_):
                raise ValueError(f"MACS: {name} must be True or False, not {getattr(self, name)!r}")
        for name, interval in INTERVALS.items():
            if name not in OPTIONAL or getattr(self, name) is not None:
                check_interval(f"MACS: {name}", getattr(self, name), interval)
        check_choice("MACS: reseed", self.reseed, ("all", "spread"))
        check_choice("MACS: mesh", self.mesh, MESHES)
        self._check_polish()
        self._read_preference()

    def _check_polish(self) -> None:
        if self.polish_on is None:
            return
        if not isinstance(self.polish_on, str):
            raise ValueError(f"MACS: polish_on must be a word such as 'dfet:30x3', not {self.polish_on!r}")
        try:
            parse(self.polish_on)
        except ValueError as error:
            raise ValueError(f"MACS: polish_on: {error}") from error
        if not self.refine:
            raise ValueError("MACS: polish_on makes no sense with refine=False, which makes no gradient solves")
        if self.mesh == "adaptive":
            raise ValueError("MACS: polish_on makes no sense with mesh='adaptive': its points are on the mesh that it names")

    def _read_preference(self) -> None:
        if isinstance(self.prefer, Mapping):
            try:
                object.__setattr__(self, "prefer", from_dict(self.prefer))
            except ValueError as error:
                raise ValueError(f"MACS: prefer: {error}") from error
        if self.prefer is not None and not isinstance(self.prefer, Preference):
            raise ValueError(f"MACS: prefer must be a preference of macs.decisions, such as ReferencePoint, not {self.prefer!r}")

    @classmethod
    def paper(cls, **overrides: Any) -> Self:
        """The settings of the paper: Table I, and its choices where the defaults differ. `overrides` are settings of MACS.

        There are as many directions as social agents, and these keep theirs; the first population has as many points as there are agents.
        The following deliberately differs from the paper:

        - Feasible points come before infeasible ones, which are ordered by their violation. No penalty enters an objective.
        - The budget is never exceeded. The best point of each objective never leaves the archive.
        - The scalarisation is normalised by feasible points only: the best values ever found, and the worst values in the archive.
        - A success is dominance, or a better value for the agent's direction. A point with equal objectives is no success.
        - After a success the agent moves at once, and the next actions of other agents use its new position.
        - Velocities are the displacements after the inner level. The radius expands only after a success that kept most of the proposed
          step.
        - The parents in differential evolution differ from the agent; in social actions also from its copies in the archive.
        - Inertia shortens its step, not the velocity. In differential evolution at least one coordinate changes.
        """
        settings: dict[str, Any] = {
            "refine": False,
            "mesh": "fixed",
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
            "restore": False,
            "lone": 0,
            "exponent": 2.0,
        }
        paper = cls(**(settings | overrides))
        counts: dict[str, Any] = {"directions": max(1, round(paper.social * paper.agents)), "sample": paper.agents}
        return replace(paper, **{name: count for name, count in counts.items() if name not in overrides})

    @property
    def refines(self) -> bool:
        """Whether the search makes gradient solves on its own transcription."""
        return self.refine and self.polish_on is None

    def lone_agents(self, m: int, budget: int) -> int:
        """Number of agents without a direction beside `agents`, for m objectives, if the first population has points enough."""
        if self.lone is not None:
            return self.lone
        if m > MANY:
            return 0
        return min(max(self.archive - FEW_POINTS, 0) // 2, max(budget - LONG, 0) // (ALONE if m <= CURVE else ALONE_SURFACE))

    def coordinates_to_scan(self, d: int, archived: int, m: int, budget: int) -> int:
        """Number of the d coordinates that pattern search tries; with m = 1 objective the archive is full with one point."""
        if not self.adaptive_coordinates:
            return max(1, ceil(d * self.coordinates - 1e-9))
        limit = self.archive if m > 1 else 1
        wanted = ceil(d * (1.0 - (1.0 - 1.0 / d) * archived / limit) - 1e-9)
        return max(1, min(wanted, budget // (2 * SHARE * self.agents)))

    def points_to_sample(self, budget: int) -> int:
        """Number of points of the first population."""
        return max(self.agents, min(self.archive, budget // 20)) if self.sample is None else self.sample

    def offspring(self, parents: int, m: int, lone: int = 0, feasible: bool = True) -> int:
        """Number of offspring of so many parents in an iteration, with m objectives, in which so many lone agents act; 0 without
        parents."""
        each = SOME if m <= CURVE or (m <= MANY and lone > 0) else GENERATION
        each = (each if feasible else GENERATIONS) if self.breeding is None else self.breeding
        return max(self.agents + lone, round(each * parents)) if each and parents else 0

    def social_agents(self, m: int) -> int:
        """Number of agents with a direction, for m objectives: 0 if they are too few for all orthogonal directions."""
        count = round(self.social * self.agents)
        return count if count >= m else 0
