"""Benchmark of searches: MACS against gradient sweeps from many starts, on the same mesh, for the same counted work."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from macs import MACS, Front, sweep
from macs.io.console import Steps
from macs.io.interrupts import Stopped
from macs.pareto.spread import spread
from macs.refinement.search_mesh import default_transcription
from problems import Problem, load
from problems.cases import goddard, landing_site, orbit_rise
from problems.catalogue import STANDARD
from problems.phase import Phase
from transcription import Transcription, parse
from transcription.stopping import stopped_by

from ..measures.indicators import gd, hypervolume, igd
from .fronts import cases as stated
from .measured import Column, Row, Target, short, table, verdicts

POINTS = 10
STARTS = 4
"""From how many vectors a sweep solves each point, once a single one has been tried."""
OURS, THEIRS = "MACS", "sweeps"
AS_GOOD, BETTER = 0.999, 1.01
"""Ratios of hypervolumes."""


@dataclass(frozen=True)
class Search:
    """A case: the budgets of the whole and of the quick benchmark (0: not in it), the least ratio of hypervolumes that is asked of the
    whole one, the true front if it is known, the problem if it is none of the catalogue, and its mesh if that is not its own."""

    name: str
    evaluations: int
    quick: int
    least: float
    reference: Callable[[], np.ndarray] | None = None
    build: Callable[[], Problem] | None = None
    word: str = ""

    def problem(self) -> Problem:
        """A new one."""
        return self.build() if self.build else load(self.name)

    def method(self, problem: Problem) -> Transcription:
        """The mesh that both work on."""
        return parse(self.word) if self.word else default_transcription(problem)


def two_goals(name: str, phase: str, goal: Callable[[Problem, Phase], None]) -> Callable[[], Problem]:
    """A published problem of one objective with a second one."""

    def build() -> Problem:
        problem = load(STANDARD + name)
        goal(problem, problem.phases[phase])
        return problem

    return build


def effort(*controls: str) -> Callable[[Problem, Phase], None]:
    """The second objective is the integral of the squares of some controls."""
    return lambda problem, phase: problem.minimize("effort", phase.integral(sum(phase[name] ** 2 for name in controls)))


def mass(problem: Problem, phase: Phase) -> None:
    """The second objective is the mass that is left."""
    problem.maximize("mass", phase.final(phase["mass"]))


def drug(problem: Problem, phase: Phase) -> None:
    """The second objective is the drug that is used."""
    problem.minimize("drug", phase.final(phase["used"]))


FORCES = effort("reach force", "heading force", "elevation force")
OTHERS = (
    Search("rocket", 2_000, 0, AS_GOOD, build=stated.rocket, word="dfet:8x4"),
    Search("cart-pole", 2_000, 0, AS_GOOD, build=stated.cart_pole, word="dfet:10x5"),
    Search("bioreactor", 2_000, 0, AS_GOOD, build=stated.bioreactor, word="dfet:12x3:bernstein"),
    Search("two_link_arm, effort", 2_000, 0, AS_GOOD, build=two_goals("two_link_arm", "move", effort("u", "v"))),
    Search("robot_arm, effort", 2_000, 0, AS_GOOD, build=two_goals("robot_arm", "turn", FORCES)),
    Search("climb, mass", 2_000, 0, AS_GOOD, build=two_goals("climb", "climb", mass)),
    Search("tumour, drug", 2_000, 300, AS_GOOD, build=two_goals("tumour", "care", drug)),
)
"""Problems of others, as they state them or with a second objective: chosen before anything was measured."""


CASES = (
    Search("goddard", 10_000, 600, AS_GOOD, goddard.reference),
    Search("orbit_rise", 50_000, 1_000, AS_GOOD, orbit_rise.reference),
    Search("orbit_rise_full", 50_000, 0, BETTER, orbit_rise.reference),
    Search("landing_site", 20_000, 2_000, BETTER, landing_site.reference),
    *OTHERS,
)


def bench_search(rows: list[Row], seeds: Sequence[int], quick: bool, cases: Sequence[Search] = CASES) -> None:
    """Measure all cases, with each seed; `rows` are filled as values become known, also if `Stopped` ends it."""
    cases = [case for case in cases if case.quick or not quick]
    with Steps("searches", 2 * len(seeds) * len(cases)) as steps:
        for case in cases:
            reference = case.reference() if case.reference else None
            pair = Row(case.name, OURS), Row(case.name, THEIRS)
            for seed in seeds:
                _measure(case, seed, case.quick if quick else case.evaluations, reference, pair, steps)
                if seed == seeds[0]:
                    rows += pair


def _measure(case: Search, seed: int, evaluations: int, reference: np.ndarray | None, pair: tuple[Row, Row], steps: Steps) -> None:
    problem = case.problem()
    method = case.method(problem)
    steps.begin(f"{case.name}, {OURS}, seed {seed}")
    ours = MACS(agents=POINTS, archive=POINTS).solve(problem, method, evaluations=evaluations, seed=seed)
    if ours.stats["stopped"] == "interrupted":
        raise Stopped("interrupted")
    steps.begin(f"{case.name}, {THEIRS}, seed {seed}")
    theirs = _sweeps(problem, method, ours.stats["work"], seed, steps)
    union = np.vstack([ours.F, theirs.F])
    volumes = [hypervolume(front.F, union) for front in (ours, theirs)]
    for row, front, ratio in zip(pair, (ours, theirs), (volumes[0] / volumes[1], 1.0), strict=True):
        row.add(ratio=ratio, points=len(front), seconds=front.stats["wall_time"])
        row.add(**{key: front.stats[key] for key in ("evaluations", "gradient_solves", "work")})
        if reference is not None:
            row.add(gd=gd(front, reference), igd=igd(front, reference))


def _sweeps(problem: Problem, method: Transcription, work: int, seed: int, steps: Steps) -> Front:
    """Sweeps until they had as much counted work: the plain one, then with random starts, from nothing and from the best known in turn.

    Each gets to its end, since one that is cut short is worth little: they have a little more, not less.
    """
    front, k = None, 0
    while front is None or front.stats["work"] < work:
        known = front if k % 2 == 0 and front is not None and len(front) else None
        with stopped_by(steps.asked):
            more = sweep(problem, method, points=POINTS, starts=STARTS if k else 1, seed=1000 * seed + k, start=known)
        steps.check()
        front, k = more if front is None else Front.merge([front, more]), k + 1
    return front[np.flatnonzero(spread(front.F, POINTS))] if len(front) > POINTS else front


def report(rows: Sequence[Row]) -> str:
    """The measured values, and the targets."""
    lines = [
        f"SEARCHES: MACS with its defaults against gradient sweeps from many starts, on the same mesh, {POINTS} points, for the same work.",
        f"The first sweep has one start, others {STARTS}, from nothing and from the best known in turn; their points are thinned by the",
        "archive's rule. Hypervolume: as multiples of that of the sweeps, normalised by ideal and nadir of both, up to 1.1. GD, IGD:",
        "distances to the true front and from it, normalised by its range. Work: as `stats` count it, the same way for both; a sweep gets",
        "to its end, so that the sweeps have more of it. Median and quartiles over seeds, least and greatest of few.",
        "",
        table(rows, COLUMNS),
        "",
        *verdicts(targets(rows)),
    ]
    return "\n".join(lines)


def targets(rows: Sequence[Row]) -> list[Target]:
    """The ratio of hypervolumes of each case, by the median of the seeds; none of a case that had fewer evaluations."""
    found, asked = {row.case: row for row in rows if row.who == OURS}, "hypervolume at least {:g} times that of the sweeps"
    return [
        Target(case.name, asked.format(case.least), row.spread("ratio"), row.of("ratio") >= case.least)
        for case in CASES
        if (row := found.get(case.name)) and row.of("evaluations") >= case.evaluations
    ]


COLUMNS: tuple[Column, ...] = (
    ("hypervolume", "ratio", lambda row: row.spread("ratio") if row.who == OURS else "1"),
    ("GD", "", lambda row: row.spread("gd")),
    ("IGD", "", lambda row: row.spread("igd")),
    ("evalua-", "tions", lambda row: f"{row.of('evaluations'):.0f}"),
    ("gradient", "solves", lambda row: f"{row.of('gradient_solves'):.0f}"),
    ("work", "", lambda row: f"{row.of('work'):.3g}"),
    ("s", "", lambda row: short(row.of("seconds"))),
    ("", "seeds", lambda row: str(len(row.values["ratio"]))),
)
