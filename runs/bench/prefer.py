"""Benchmark of preferences that guide a search: MACS with one and without, at equal evaluations."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Self

import moocore
import numpy as np
from scipy.interpolate import PchipInterpolator

from macs import MACS, Front, sweep
from macs.io.console import Steps
from macs.preferences import Preference, Ranges, ReferencePoint, WeightedSum
from macs.search.guide import REGION_PART, Region
from problems import load
from problems.cases import goddard
from problems.compiled import Objective
from transcription import parse

from ..measures.indicators import Points, extent, minimised, truth
from ..measures.references import union
from . import functions
from .contract import ASKED, SECONDS, Bench, Effort, Row, Target, column, finished, rounds_of
from .functions import from_pymoo, sphere

GUIDED, EVEN = "guided", "even"


@dataclass(frozen=True)
class GuidedCase:
    """A search to be guided."""

    name: str
    search: Callable[[MACS, int, int], Front]  # (MACS, evaluations, seed) -> Front
    dense: Callable[[], np.ndarray]  # () -> points (k, m) of the true front, or what comes nearest to it, in the user's units and senses
    preference: Preference
    evaluations: int
    archive: int = 10
    refine: bool = True  # whether derivatives are used
    known: bool = True  # whether the front is known. If not, the points that are found belong to the dense front, too.


def curve(power: float) -> np.ndarray:
    """The front f2 = 1 - f1^power of ZDT1 and ZDT2."""
    f = np.linspace(0.0, 1.0, 2001)
    return np.stack([f, 1.0 - f**power], axis=1)


def black_box(name: str, sizes: dict[str, int], solver: MACS, evaluations: int, seed: int) -> Front:
    """The front of a function of pymoo."""
    return solver.minimize(*from_pymoo(name, **sizes), evaluations=evaluations, seed=seed)


def flights(name: str, word: str | None, solver: MACS, evaluations: int, seed: int) -> Front:
    """The front of a case on its own mesh, or on another one."""
    if word is None:
        return solver.solve(load(name), evaluations=evaluations, seed=seed)
    return replace(solver, mesh="fixed").solve(load(name), parse(word), evaluations=evaluations, seed=seed, verify=None)


def swept(name: str, word: str) -> np.ndarray:
    """The front of a case with two objectives on a mesh, by gradients: 25 points, and a monotone curve through them."""
    points = sweep(load(name), parse(word), points=25, starts=1, verify=None).objectives
    points = points[np.argsort(points[:, 0])]
    values = np.linspace(points[0, 0], points[-1, 0], 2001)
    return np.stack([values, PchipInterpolator(*points.T)(values)], axis=1)


def surveyed(name: str, word: str, preference: ReferencePoint) -> np.ndarray:
    """The front of a case with more objectives on a mesh, by gradients: sparse everywhere, and dense in the region of interest.

    A sweep of the whole front has the ranges. Two more go over what is left of it if no objective may be worse than in the region, as far
    as that is known: the first finds better points in it, so that it is smaller for the second.
    """
    whole = sweep(load(name), parse(word), points=165, starts=1, verify=None)
    goals, F = whole.goals, whole.objectives
    spans = Ranges.over(goals, F).spans(goals)
    for _ in range(2):
        problem, worst = load(name), worst_inside(preference, goals, F)
        for goal, value, span in zip(goals, worst, spans, strict=True):
            limit = {"upper": value} if goal.sign > 0 else {"lower": value}
            problem.constraint(f"limit of {goal.name}", problem.objectives[goal.name], scale=span, **limit)
        nearest = whole[int(Region.of(preference, goals, F).away(whole.objectives).argmin())]
        inside = sweep(problem, parse(word), points=165, start=nearest.decision[None], starts=1, verify=None)
        F = np.vstack([F, inside.objectives])
    return F


def worst_inside(preference: ReferencePoint, goals: Sequence[Objective], front: np.ndarray) -> list[float]:
    """The worst value of each objective in the region of interest on a front (n, m)."""
    ranges, region = Ranges.over(goals, front), Region.of(preference, goals, front)
    best, worst = (np.array([values[goal.name] for goal in goals]) for values in (ranges.best, ranges.worst))
    upper, lower = preference.degrees(goals, ranges, np.stack([best, worst]))  # linear
    least = 1.0 - (region.best + REGION_PART * region.spread)
    return (best + (worst - best) * (upper - least) / (upper - lower)).tolist()


SKIP, ENTRY, DESCENT = (f"dfet:{mesh}:bernstein:1" for mesh in ("6x4", "8x4", "12x3"))
"""Coarse meshes, on which a gradient solve takes a tenth of the time."""
RANGE = ReferencePoint({"cross-range": 28.0, "heat load": 80.0, "oscillation": 0.2, "peak heating rate": 85.0})
MASS = ReferencePoint({"terminal mass": 65e3, "terminal speed": 6500.0})
CARGO = ReferencePoint({"flight time": 580.0, "heat load": 60.0, "terminal speed": 5700.0, "terminal mass": 60e3})
SPEED = ReferencePoint({"flight time": 150.0, "horizontal speed": 0.6})
TEN = {"n_var": 10}
ZDT1 = GuidedCase("zdt1", partial(black_box, "zdt1", TEN), partial(curve, 0.5), ReferencePoint({"f1": 0.2, "f2": 0.2}), 3000)
GODDARD = GuidedCase("goddard", partial(flights, "goddard", None), goddard.reference, SPEED, 1000)
CASES = (
    ZDT1,
    replace(ZDT1, name="zdt1, weighted", preference=WeightedSum({"f1": 1.0, "f2": 1.0}), archive=20),
    GuidedCase("zdt2", partial(black_box, "zdt2", TEN), partial(curve, 2.0), ReferencePoint({"f1": 0.5, "f2": 0.2}), 3000),
    GuidedCase(
        "dtlz2",
        partial(black_box, "dtlz2", TEN | {"n_obj": 3}),
        partial(sphere, 3),
        ReferencePoint({"f1": 0.2, "f2": 0.4, "f3": 0.5}),
        5000,
        20,
    ),
    GODDARD,
    replace(GODDARD, name="goddard, no derivatives", evaluations=10_000, refine=False),
    GuidedCase("skip", partial(flights, "skip", SKIP), partial(swept, "skip", SKIP), MASS, 1500),
    GuidedCase(
        "reentry_case1",
        partial(flights, "reentry_case1", ENTRY),
        partial(surveyed, "reentry_case1", ENTRY, RANGE),
        RANGE,
        1000,
        archive=20,
        known=False,
    ),
    # This region is a piece of a space of three dimensions, which few points cannot cover.
    GuidedCase("smv", partial(flights, "smv", DESCENT), partial(surveyed, "smv", DESCENT, CARGO), CARGO, 2000, archive=40, known=False),
)


def rounds(case: GuidedCase, effort: Effort, steps: Steps) -> Callable[[int], Iterable[Row]]:
    """Each seed searches with the preference and without."""
    dense = case.dense()

    def measured(seed: int) -> Iterable[Row]:
        fronts: dict[str, Front] = {}
        for who, preference in ((EVEN, None), (GUIDED, case.preference)):
            steps.check()
            solver = MACS(archive=case.archive, refine=case.refine, prefer=preference)
            fronts[who] = finished(case.search(solver, min(case.evaluations, effort.evaluations or case.evaluations), seed))
        goals = fronts[EVEN].goals
        interest = Interest.of(case.preference, goals, dense if case.known else union([dense, *fronts.values()]))
        missing = {who: interest.missing(front) for who, front in fronts.items()}
        for who, front in fronts.items():
            values = {key: front.stats[key] for key in ("evaluations", "gradient_solves")}
            values |= {"worse": interest.worse(front), "part": interest.part, "inside": interest.inside(front), "points": len(front)}
            ratio, seconds = missing[who] / missing[EVEN], front.stats["wall_time"]
            yield Row.once(case.name, who, missing=missing[who], ratio=ratio, seconds=seconds, **values)

    return measured


def targets(rows: Sequence[Row]) -> list[Target]:
    """A guided search misses little of what an even one misses, on each case."""
    asked = f"missing, guided: at most {ASKED['prefer']:.2f} of what an even search misses"
    return [Target(row.case, asked, row.spread("ratio"), row.of("ratio") <= ASKED["prefer"]) for row in rows if row.who == GUIDED]


PREFER = Bench(
    title="guided searches",
    about="PREFERENCES: MACS guided by a preference, and even, at equal evaluations. Missing: what a front does not dominate of the "
    "hypervolume that the region of interest of a dense front does, up to the nadir of that region. The region is where the value "
    "of the preference is within a twentieth of its spread along the front from the best. Worse: the best value of the front, from "
    "that of the dense front, in that spread. Part: of the dense front's points that are in the region. Median and quartiles over "
    "seeds.",
    full=Effort(CASES, rounds=5),
    quick=Effort((ZDT1, GODDARD)),
    prepare=rounds,
    columns=(
        ("missing", "", lambda row: row.spread("missing")),
        ("ratio", "", lambda row: "1" if row.who == EVEN else row.spread("ratio")),
        ("worse", "", lambda row: row.spread("worse")),
        ("points", "inside", lambda row: f"{row.of('inside'):.0f} of {row.of('points'):.0f}"),
        column("part", "", "part", form=".2g"),
        column("evalua-", "tions", "evaluations", form=".0f"),
        column("gradient", "solves", "gradient_solves", form=".0f"),
        SECONDS,
        rounds_of("missing", "seeds"),
    ),
    targets=targets,
    modules=(functions,),
    seeded=True,
)


@dataclass(frozen=True, eq=False)
class Interest:
    """Region of interest on a dense front, by which other fronts are measured."""

    region: Region  # by the values of the preference on the dense front, which is normalised by its own ranges
    goals: tuple[Objective, ...]
    points: np.ndarray  # (k, m): Those of the dense front in the region, minimised
    part: float  # which part they are of the dense front's points

    @classmethod
    def of(cls, preference: Preference, goals: Sequence[Objective], dense: Points) -> Self:
        """The region on a dense front: a Front, or an array (n, m) in the user's units and senses."""
        R = truth(dense, goals)
        signs = np.array([goal.sign for goal in goals])
        region = Region.of(preference, goals, R * signs)
        inside = region.contains(R * signs)
        ideal, unit = extent(R[inside])
        if not _volume_to_one((R[inside] - ideal) / unit) > 0.0:
            raise ValueError(f"the region of interest has only {inside.sum()} points of the dense front: it has to be denser there")
        return cls(region, tuple(goals), R[inside], float(inside.mean()))

    def missing(self, front: Points) -> float:
        """The part of the region's hypervolume that a front does not dominate: 0 all of it is, 1 none.

        The hypervolume is that which the region's points dominate, up to their nadir, in units of their ranges.
        """
        ideal, unit = extent(self.points)
        region = (self.points - ideal) / unit
        F = np.maximum((minimised(front, self.goals) - ideal) / unit, 0.0)
        covered = _volume_to_one(F)
        return (_volume_to_one(np.vstack([region, F])) - covered) / _volume_to_one(region)

    def inside(self, front: Points) -> int:
        """Number of a front's points whose value is as good as that of points in the region."""
        return int(self.region.contains(self._objectives(front)).sum())

    def worse(self, front: Points) -> float:
        """By how much the best value of a front is worse than that of the dense front, in units of the spread of its values; infinite for
        an empty front."""
        return float(self.region.away(self._objectives(front)).min(initial=np.inf))

    def _objectives(self, front: Points) -> np.ndarray:
        return minimised(front, self.goals) * [goal.sign for goal in self.goals]


def _volume_to_one(F: np.ndarray) -> float:
    """Volume that points (n, m) dominate up to 1 in each objective."""
    return float(moocore.hypervolume(np.ascontiguousarray(F), ref=np.ones(F.shape[1]))) if len(F) else 0.0
