"""Settings of MACS, and the variants of its search: the default and that of the paper."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from math import ceil
from typing import Any, Self

import numpy as np

from problems.checks import check_choice, check_count, check_interval, short_repr
from transcription.catalogue import parse

from ..pareto.dominance import CURVE
from ..pareto.niches import MANY
from ..preferences.catalogue import from_dict
from ..preferences.preference import Preference

MESH_WORDS = ("mended", "fixed", "adaptive")
"""What may be done with points that a simulation does not confirm."""
LEAST_COUNTS = {"agents": 3, "archive": 1, "polish_every": 1, "ceiling": 1}
"""Least value of each whole number."""
ELSEWHERE = "it is that of the search, see macs.search.settings.Variant; MACS.paper() has that of the paper"
GONE = {
    **dict.fromkeys(
        ("rho", "F", "CR", "contraction", "max_contractions", "adaptive_coordinates", "redraw", "reseed", "shorten"), ELSEWHERE
    ),
    **dict.fromkeys(
        ("momentum", "keep_velocity", "experience", "social_moves", "breeding", "restore", "exponent", "lone", "directions", "sample"),
        ELSEWHERE,
    ),
    **dict.fromkeys(("concentration", "memory"), "it brought no more than noise; leave it out"),
    "social": "all agents do social actions; leave it out",
    "coordinates": "leave it out, or use MACS.paper(), which scans all coordinates",
    "refine_every": "one gradient solve of an agent follows every 200 evaluations; use polish_every for their largest number",
}
"""Settings of former versions, and what to use instead."""


def refuse_gone(settings: Iterable[str]) -> None:
    """Raise ValueError that says what to use, if one of these names is a setting of an earlier version."""
    for name in settings:
        if name in GONE:
            raise ValueError(f"MACS: {name} is no setting any more: {GONE[name]}")


@dataclass(frozen=True, repr=False)
class Variant:
    """How agents move and what the archive keeps; the defaults are those of `MACS()`. `docs/method/parts.md` has what each part brings."""

    F: float = 0.9  # weight of differences of points, probability that a coordinate takes part (Table I of the paper)
    CR: float = 0.9
    rho: float = 1.0  # radius of the pattern search, in half spans, at the beginning (Table I)
    contraction: float = 0.5  # its factor after a failure of all actions (Table I)
    max_contractions: int = 5  # their number after which the radius is reset (Table I)
    # Part of the last velocity that is added to the displacement by a success; 0: only pattern search gives a velocity, as in the paper.
    momentum: float = 0.7
    experience: float = 0.3  # probability that a social action repeats past improvements of all agents
    adaptive_coordinates: bool = True  # pattern search tries the fewer coordinates, the fuller the archive (the authors' later code)
    redraw: bool = True  # directions are drawn anew in each iteration, from 100 for each objective (the authors' later code)
    shorten: bool = False  # steps of inertia end in the box, as in the paper; else each variable is clipped
    social_moves: bool = True  # agents move to the points of successful social actions; in the paper these go to the archive only
    refine_every: int = 200  # evaluations for each of which one gradient solve of an agent follows
    breeding: bool = True  # points of the archive have offspring
    repair: bool = True  # infeasible points move to where linear models of the constraints vanish
    undirected: bool = True  # long searches have agents without a direction
    energy_alone: bool = False  # the archive is spread by the energy of power 2, as in the paper, without volume and niches

    def __repr__(self) -> str:
        return next((repr(name) for name, one in VARIANTS.items() if one == self), short_repr(self))

    @property
    def energy_exponent(self) -> float | None:
        """The power of the distance in the energy that spreads the archive; None: what suits the number of objectives."""
        return 2.0 if self.energy_alone else None


PAPER = Variant(
    momentum=0.0,
    experience=0.0,
    adaptive_coordinates=False,
    redraw=False,
    shorten=True,
    social_moves=False,
    breeding=False,
    repair=False,
    undirected=False,
    energy_alone=True,
)
"""The search of Ricciardi and Vasile (2015)."""
VARIANTS = {"default": Variant(), "paper": PAPER}
"""Variants by their names in files."""


@dataclass(frozen=True)
class Undirected:
    """When agents without a direction join (measured on UF1 to UF10 of CEC 2009)."""

    long: int = 30_000  # evaluations up to which all agents have a direction
    each: int = 6_000  # evaluations beyond that for each of which there is one without, where the front is a curve
    each_surface: int = 12_000  # the same where it is a surface
    few_points: int = 10  # points of an archive up to which there is none


UNDIRECTED = Undirected()


@dataclass(frozen=True)
class Offspring:
    """Number of offspring of each point of the archive in an iteration (measured on ZDT, UF, DTLZ and MW)."""

    curve: float = 0.15  # with up to two objectives, or beside agents without a direction: most of the budget is left to the agents
    surface: float = 1.0
    infeasible: float = 2.0  # of the least violated points, as long as nothing is feasible


OFFSPRING = Offspring()


@dataclass(frozen=True)
class Settings:
    """Multi-Agent Collaborative Search: global search for the Pareto front by a few agents, refined by gradients.

    In each iteration the agents look for better points: first each by itself (individual actions), then with the information of all (social
    actions). The best trade-offs are kept in an archive and spread evenly along the front; offspring of the archive's points add to the
    search. If the problem has derivatives, gradient solves find the ends of the front at the beginning, refine agents during the search and
    polish the archive at its end.

    `MACS()` suits most problems. Five settings matter first: `agents`, `archive`, `refine`, `mesh` and `prefer`. `MACS(refine=False)` makes
    no gradient solves. `MACS.paper()` is the search of the paper (Ricciardi and Vasile 2015; with trajectories: Ricciardi, Vasile and
    Maddock 2016).

    Parameters
    ----------
    agents : int, default 10
        Number of agents, at least 3, as differential evolution needs.
    archive : int, default 10
        Largest number of points in the archive, and so on the front. At least the number of objectives; the best point of each objective is
        always kept (with more than three objectives, to a millionth of its range).
    refine : bool, default True
        Use derivatives, if the problem has them (a black box has none): gradient solves of single agents during the search, one for 200
        evaluations, and a polish of the archive at its end, see `polish_every`. Points then have their `optimality`.
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
        not reach the values that the preference names, points are spread uniformly; in the end `stats["prefer"]` says so.

    Other Parameters
    ----------------
    polish_on : str, optional
        Another transcription for all gradient solves, such as "dfet:30x3:bernstein:1": search where candidates are evaluated quickly
        (shooting), and polish where the problem is sparse. The front is then polished after the search, see `Front.polished`, and single
        agents are not refined. A search that was ended by Ctrl-C, a time limit or a callback is not polished. A finished checkpoint is
        polished again each time.
    mesh_tolerance : float, default 1e-7
        With `mesh="adaptive"`: largest difference of a simulated state from the transcription, relative to its range on the trajectory, in
        [1e-10, 1].
    polish_every : int, default 20
        With `evaluations`, at most one gradient solve, search and polish together, for every so many of them; where the search chooses its
        inner level, `inner="auto"`, a polish may always make 60. It needs about six for each point of the archive; with more than two
        objectives, one more for each point that the archive may contain. Not among these are the solves for the ends of the front, and
        points between them, with which a search begins if it chooses its inner level, or if none of its first candidates is feasible.
    ceiling : int, default 100 000
        Largest number of evaluations of a search without one of its own (`evaluations=None`), which otherwise ends when it is done.
    variant : Variant or {"default", "paper"}, default "default"
        How agents move and what the archive keeps, see `MACS.paper`.

    Raises
    ------
    ValueError
        If a setting is outside its range, or one of a former version; the message names it.

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
    prefer: Preference | None = None
    polish_every: int = 20
    ceiling: int = 100_000
    variant: Variant = Variant()

    def __post_init__(self) -> None:
        for name, least in LEAST_COUNTS.items():
            check_count(f"MACS: {name}", getattr(self, name), least)
        if not isinstance(self.refine, bool | np.bool_):
            raise ValueError(f"MACS: refine must be True or False, not {self.refine!r}")
        check_choice("MACS: mesh", self.mesh, MESH_WORDS)
        check_interval("MACS: mesh_tolerance", self.mesh_tolerance, "[1e-10, 1]")
        if isinstance(self.variant, str):
            check_choice("MACS: variant", self.variant, tuple(VARIANTS))
            object.__setattr__(self, "variant", VARIANTS[self.variant])
        if not isinstance(self.variant, Variant):
            raise ValueError(f"MACS: variant must be 'default', 'paper' or a Variant, not {self.variant!r}")
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

        There are as many directions as agents, and these keep theirs; the first population has as many points as there are agents.
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
        paper: dict[str, Any] = {"refine": False, "mesh": "fixed", "variant": PAPER}
        return cls(**(paper | overrides))

    def as_data(self) -> dict[str, Any]:
        """The settings as plain data, without the preference; the variant by its name, if it has one."""
        data: dict[str, Any] = asdict(replace(self, prefer=None))
        del data["prefer"]
        name = next((name for name, one in VARIANTS.items() if one == self.variant), None)
        return data | {"variant": name or data["variant"]}

    @property
    def refines(self) -> bool:
        """Whether the search makes gradient solves on its own transcription."""
        return self.refine and self.polish_on is None

    def undirected_agents(self, m: int, budget: int) -> int:
        """Number of agents without a direction beside `agents`, for m objectives, if the first population has points enough."""
        if not self.variant.undirected or m > MANY:
            return 0
        each = UNDIRECTED.each if m <= CURVE else UNDIRECTED.each_surface
        return min(max(self.archive - UNDIRECTED.few_points, 0) // 2, max(budget - UNDIRECTED.long, 0) // each)

    def coordinates_to_scan(self, d: int, archived: int, m: int, budget: int) -> int:
        """Number of the d coordinates that pattern search tries: all while the archive is empty, one when it is full, and in an iteration
        at most for an eighth of the budget. With m = 1 objective the archive is full with one point."""
        if not self.variant.adaptive_coordinates:
            return d
        limit = self.archive if m > 1 else 1
        wanted = ceil(d * (1.0 - (1.0 - 1.0 / d) * archived / limit) - 1e-9)
        return max(1, min(wanted, budget // (2 * 8 * self.agents)))  # two sides

    def points_to_sample(self, budget: int) -> int:
        """Number of points of the first population."""
        return self.agents if self.variant == PAPER else max(self.agents, min(self.archive, budget // 20))

    def offspring(self, parents: int, m: int, undirected: int = 0, feasible: bool = True) -> int:
        """Number of offspring of so many parents in an iteration with m objectives and so many acting agents without a direction: at least
        one for each agent; 0 without parents."""
        if not (self.variant.breeding and parents):
            return 0
        each = OFFSPRING.curve if m <= CURVE or (m <= MANY and undirected > 0) else OFFSPRING.surface
        return max(self.agents + undirected, round((each if feasible else OFFSPRING.infeasible) * parents))

    def directions_to_draw_from(self, m: int) -> int:
        """Size of the pool of directions."""
        return 100 * m if self.variant.redraw else self.agents

    def social_agents(self, m: int) -> int:
        """Number of agents with a direction, for m objectives: 0 if they are too few for all orthogonal directions."""
        return self.agents if self.agents >= m else 0
