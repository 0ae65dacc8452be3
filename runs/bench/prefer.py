"""Benchmark of preferences that guide a search: MACS with one and without, at equal evaluations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.interpolate import PchipInterpolator

from macs import MACS, Front, sweep
from macs.io.console import Steps
from macs.io.interrupts import Stopped
from macs.pareto.directions import simplex_lattice
from macs.preferences import Preference, Ranges, ReferencePoint, WeightedSum
from macs.search.guide import PART, Region
from problems import load
from problems.cases import goddard
from problems.compiled import Objective
from transcription import parse

from ..measures.interest import Interest
from ..measures.references import union
from .measured import Column, Row, Target, short, table, verdicts

GUIDED, EVEN = "guided", "even"
ASKED = 1 / 3
"""What is missing of the region's hypervolume, at most, as a multiple of what an even search misses."""
VARIABLES = 10
"""Of black boxes."""
DENSE = 2001
"""Points of a dense front of two objectives."""
SWEPT = 25
"""Points of a sweep that it goes through, where no closed form is known."""
SURVEYED = 165
"""Points, at most, of each sweep over a surface."""
NARROWED = 2
"""Sweeps of a surface in its region of interest."""


@dataclass(frozen=True)
class Guided:
    """A search to be guided."""

    name: str
    search: Callable[[MACS, int, int], Front]  # (MACS, evaluations, seed) -> Front
    dense: Callable[[], np.ndarray]  # () -> points (k, m) of the true front, or what comes nearest to it, in the user's units and senses
    preference: Preference
    evaluations: int
    quick: bool = False  # whether it belongs to the quick benchmark
    archive: int = 10  # points of the front
    refine: bool = True  # whether derivatives are used
    known: bool = True  # whether the front is known. If not, the points that are found belong to the dense front, too.


def zdt1(X: np.ndarray) -> np.ndarray:
    """A convex front, f2 = 1 - sqrt(f1) (Zitzler, Deb and Thiele 2000)."""
    g = 1.0 + 9.0 * X[:, 1:].mean(axis=1)
    return np.stack([X[:, 0], g * (1.0 - np.sqrt(X[:, 0] / g))], axis=1)


def zdt2(X: np.ndarray) -> np.ndarray:
    """A front that bows inward, f2 = 1 - f1^2."""
    g = 1.0 + 9.0 * X[:, 1:].mean(axis=1)
    return np.stack([X[:, 0], g * (1.0 - (X[:, 0] / g) ** 2)], axis=1)


def dtlz2(X: np.ndarray) -> np.ndarray:
    """An eighth of a sphere (Deb, Thiele, Laumanns and Zitzler 2002)."""
    a, b = 0.5 * np.pi * X[:, 0], 0.5 * np.pi * X[:, 1]
    r = 1.0 + ((X[:, 2:] - 0.5) ** 2).sum(axis=1)
    return r[:, None] * np.stack([np.cos(a) * np.cos(b), np.cos(a) * np.sin(b), np.sin(a)], axis=1)


def sphere() -> np.ndarray:
    """The front of `dtlz2`."""
    lattice = simplex_lattice(3, 60)
    return lattice / np.linalg.norm(lattice, axis=1, keepdims=True)


def curve(power: float) -> np.ndarray:
    """The front f2 = 1 - f1^power."""
    f = np.linspace(0.0, 1.0, DENSE)
    return np.stack([f, 1.0 - f**power], axis=1)


def through(points: np.ndarray) -> np.ndarray:
    """A dense front of two objectives through points that are less dense, monotone between them."""
    points = points[np.argsort(points[:, 0])]
    values = np.linspace(points[0, 0], points[-1, 0], DENSE)
    return np.stack([values, PchipInterpolator(*points.T)(values)], axis=1)


def black_box(function: Callable[[np.ndarray], np.ndarray], solver: MACS, evaluations: int, seed: int) -> Front:
    """The front of a function of so many variables between 0 and 1."""
    return solver.minimize(function, [(0.0, 1.0)] * VARIABLES, evaluations=evaluations, seed=seed)


def flights(name: str, word: str | None, solver: MACS, evaluations: int, seed: int) -> Front:
    """The front of a case, on its own mesh or, as the search found it, on another one."""
    if word is None:
        return solver.solve(load(name), evaluations=evaluations, seed=seed)
    return replace(solver, mesh="fixed").solve(load(name), parse(word), evaluations=evaluations, seed=seed, verify=None)


def swept(name: str, word: str) -> np.ndarray:
    """The front of a case with two objectives on a mesh, by gradients."""
    return through(sweep(load(name), parse(word), points=SWEPT, starts=1, verify=None).objectives)


def surveyed(name: str, word: str, preference: ReferencePoint) -> np.ndarray:
    """The front of a case with more objectives on a mesh, by gradients: sparse everywhere, and dense in the region of interest.

    A sweep of the whole front has the ranges. Then others go over what is left of it if no objective may be worse than in the region, as
    far as that is known: the first finds better points in it, so that it is smaller for the next.
    """
    whole = sweep(load(name), parse(word), points=SURVEYED, starts=1, verify=None)
    goals, found = whole.goals, whole.objectives
    spans = Ranges.over(goals, found).spans(goals)
    for _ in range(NARROWED):
        problem, worst = load(name), worst_inside(preference, goals, found)
        for goal, value, span in zip(goals, worst, spans, strict=True):
            limit = {"upper": value} if goal.sign > 0 else {"lower": value}
            problem.constraint(f"limit of {goal.name}", problem.objectives[goal.name], scale=span, **limit)
        nearest = whole[int(Region.of(preference, goals, found).away(whole.objectives).argmin())]
        inside = sweep(problem, parse(word), points=SURVEYED, start=nearest.decision[None], starts=1, verify=None)
        found = np.vstack([found, inside.objectives])
    return found


def worst_inside(preference: ReferencePoint, goals: Sequence[Objective], front: np.ndarray) -> list[float]:
    """The worst value of each objective in the region of interest on a front (n, m)."""
    ranges, region = Ranges.over(goals, front), Region.of(preference, goals, front)
    best, worst = (np.array([values[goal.name] for goal in goals]) for values in (ranges.best, ranges.worst))
    upper, lower = preference.degrees(goals, ranges, np.stack([best, worst]))  # linear
    least = 1.0 - (region.best + PART * region.spread)
    return (best + (worst - best) * (upper - least) / (upper - lower)).tolist()


SKIP = "dfet:6x4:bernstein:1"
"""A coarse mesh, on which a gradient solve takes a tenth of the time."""
ENTRY = "dfet:8x4:bernstein:1"
"""Likewise."""
DESCENT = "dfet:12x3:bernstein:1"
"""Likewise."""
RANGE = ReferencePoint({"cross-range": 28.0, "heat load": 80.0, "oscillation": 0.2, "peak heating rate": 85.0})
MASS = ReferencePoint({"terminal mass": 65e3, "terminal speed": 6500.0})
CARGO = ReferencePoint({"flight time": 580.0, "heat load": 60.0, "terminal speed": 5700.0, "terminal mass": 60e3})
SPEED = ReferencePoint({"flight time": 150.0, "horizontal speed": 0.6})
CASES = (
    Guided("zdt1", partial(black_box, zdt1), partial(curve, 0.5), ReferencePoint({"f1": 0.2, "f2": 0.2}), 3000, True),
    Guided("zdt1, weighted", partial(black_box, zdt1), partial(curve, 0.5), WeightedSum({"f1": 1.0, "f2": 1.0}), 3000, archive=20),
    Guided("zdt2", partial(black_box, zdt2), partial(curve, 2.0), ReferencePoint({"f1": 0.5, "f2": 0.2}), 3000),
    Guided("dtlz2", partial(black_box, dtlz2), sphere, ReferencePoint({"f1": 0.2, "f2": 0.4, "f3": 0.5}), 5000, archive=20),
    Guided("goddard", partial(flights, "goddard", None), goddard.reference, SPEED, 1000, True),
    Guided("goddard, no derivatives", partial(flights, "goddard", None), goddard.reference, SPEED, 10_000, refine=False),
    Guided("skip", partial(flights, "skip", SKIP), partial(swept, "skip", SKIP), MASS, 1500),
    Guided(
        "reentry_case1",
        partial(flights, "reentry_case1", ENTRY),
        partial(surveyed, "reentry_case1", ENTRY, RANGE),
        RANGE,
        1000,
        archive=20,
        known=False,
    ),
    # This region is a piece of a space of three dimensions, which few points cannot cover.
    Guided("smv", partial(flights, "smv", DESCENT), partial(surveyed, "smv", DESCENT, CARGO), CARGO, 2000, archive=40, known=False),
)


def bench_prefer(rows: list[Row], seeds: Sequence[int], quick: bool, cases: Sequence[Guided] | None = None) -> None:
    """Measure all cases, with each seed; `rows` are filled as values become known, also if `Stopped` ends it."""
    cases = [case for case in (CASES if cases is None else cases) if case.quick or not quick]
    with Steps("guided searches", 2 * len(seeds) * len(cases)) as steps:
        for case in cases:
            fronts: dict[str, list[Front]] = {EVEN: [], GUIDED: []}
            for seed in seeds:
                for who, found in fronts.items():
                    steps.begin(f"{case.name}, {who}, seed {seed}")
                    solver = MACS(archive=case.archive, refine=case.refine, prefer=case.preference if who == GUIDED else None)
                    found.append(case.search(solver, case.evaluations, seed))
                    if found[-1].stats["stopped"] == "interrupted":
                        raise Stopped("interrupted")
            rows += compared(case, fronts)


def compared(case: Guided, fronts: dict[str, list[Front]]) -> list[Row]:
    """The rows of a case from its fronts, one for each seed."""
    goals, dense = fronts[EVEN][0].goals, case.dense()
    known = dense if case.known else union([dense, *(front for found in fronts.values() for front in found)])
    interest = Interest.of(case.preference, goals, known)
    rows = {who: Row(case.name, who) for who in fronts}
    missing = {who: [interest.missing(front) for front in found] for who, found in fronts.items()}
    for who, row in rows.items():
        for front, one, even in zip(fronts[who], missing[who], missing[EVEN], strict=True):
            row.add(missing=one, ratio=one / even, worse=interest.worse(front), part=interest.part)
            row.add(inside=interest.inside(front), points=len(front))
            row.add(**{key: front.stats[key] for key in ("evaluations", "gradient_solves")}, seconds=front.stats["wall_time"])
    return list(rows.values())


def report(rows: Sequence[Row]) -> str:
    """The measured values, and the target."""
    lines = [
        "PREFERENCES: MACS guided by a preference, and even, at equal evaluations. Missing: what a front does not dominate of the",
        "hypervolume that the region of interest of a dense front does, up to the nadir of that region. The region is where the value",
        "of the preference is within a twentieth of its spread along the front from the best. Worse: the best value of the front, from",
        "that of the dense front, in that spread. Part: of the dense front's points that are in the region. Median and quartiles over",
        "seeds.",
        "",
        table(rows, COLUMNS),
        "",
        *verdicts(targets(rows)),
    ]
    return "\n".join(lines)


def targets(rows: Sequence[Row]) -> list[Target]:
    """A guided search misses little of what an even one misses, on each case."""
    asked = f"missing, guided: at most {ASKED:.2f} of what an even search misses"
    return [Target(row.case, asked, row.spread("ratio"), row.of("ratio") <= ASKED) for row in rows if row.who == GUIDED]


COLUMNS: tuple[Column, ...] = (
    ("missing", "", lambda row: row.spread("missing")),
    ("ratio", "", lambda row: "1" if row.who == EVEN else row.spread("ratio")),
    ("worse", "", lambda row: row.spread("worse")),
    ("points", "inside", lambda row: f"{row.of('inside'):.0f} of {row.of('points'):.0f}"),
    ("part", "", lambda row: f"{row.of('part'):.2g}"),
    ("evalua-", "tions", lambda row: f"{row.of('evaluations'):.0f}"),
    ("gradient", "solves", lambda row: f"{row.of('gradient_solves'):.0f}"),
    ("s", "", lambda row: short(row.of("seconds"))),
    ("", "seeds", lambda row: str(len(row.values["missing"]))),
)
