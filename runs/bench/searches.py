"""Benchmarks of searches on trajectories: MACS against gradient sweeps for the same counted work, and, until it is done, against its other
inner levels and sweeps to the same quality."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import casadi as ca
import numpy as np

from macs import MACS, Front, sweep
from macs.io.console import Steps
from macs.pareto.dominance import nondominated
from macs.pareto.spread import spread
from macs.refinement.mesh_search import default_transcription
from problems import Problem, load
from problems.cases import goddard, landing_site, orbit_rise
from problems.catalogue import STANDARD
from problems.phase import Phase
from transcription import Transcription, parse

from ..measures.indicators import gd, hypervolume, igd
from .contract import ASKED, SECONDS, Bench, Column, Effort, Row, Target, column, finished, rounds_of, short

FRONT_SIZE = 10
"""Points of every front."""


@dataclass(frozen=True)
class SearchCase:
    """A problem, and what both kinds of searches on it are given."""

    name: str
    build: Callable[[], Problem]
    word: str = ""  # of its mesh, if that is not its own
    evaluations: int = 2_000
    least: float = 0.999  # ratio of hypervolumes to that of the sweeps that is asked; only with so many evaluations
    reference: Callable[[], np.ndarray] | None = None  # the true front, if it is known

    def stated(self) -> tuple[Problem, Transcription]:
        """A new problem, and the mesh that all work on."""
        problem = self.build()
        return problem, parse(self.word) if self.word else default_transcription(problem)


def cart_pole() -> Problem:
    """Swing-up of a pole of 0.5 m and 0.3 kg on a cart of 1 kg, after Kelly, SIAM Review 59(4), 2017, with a free time and a low roof."""
    M, m, length, g = 1.0, 0.3, 0.5, 9.81
    problem = Problem("cart-pole")
    swing = problem.phase("swing", t0=0.0, tf=(1.0, 4.0))
    x = swing.state("x", bounds=(-2, 2), initial=0, final=1, unit="m")
    angle = swing.state("angle", bounds=(-2 * ca.pi, 2 * ca.pi), initial=0, final=ca.pi, unit="rad")
    v = swing.state("v", bounds=(-10, 10), initial=0, final=0, unit="m/s")
    w = swing.state("w", bounds=(-20, 20), initial=0, final=0, unit="rad/s")
    force = swing.control("force", bounds=(-20, 20), unit="N")
    c, s = ca.cos(angle), ca.sin(angle)
    D = M + m * (1 - c**2)
    turning = -(length * m * c * s * w**2 + force * c + (m + M) * g * s) / (length * D)
    swing.dynamics(x=v, angle=w, v=(length * m * s * w**2 + force + m * g * c * s) / D, w=turning)
    swing.path("place of the tip", x + length * s, lower=-0.6, upper=1.6)
    problem.minimize("time", swing.tf, unit="s")
    problem.minimize("energy", swing.integral(force**2), unit="N^2 s")
    return problem


def bioreactor() -> Problem:
    """Fed batch with inhibited growth, in the manner of Park and Ramirez, AIChE Journal 34(9), 1988: yield against productivity."""
    problem = Problem("fed batch")
    batch = problem.phase("batch", t0=0.0, tf=(5.0, 40.0), time_unit="h")
    cells = batch.state("cells", bounds=(0, 50), initial=1.0, unit="g/L")
    food = batch.state("food", bounds=(0, 50), initial=5.0, unit="g/L")
    made = batch.state("made", bounds=(0, 50), initial=0.0, unit="g/L")
    volume = batch.state("volume", bounds=(1, 10), initial=2.0, unit="L")
    feed = batch.control("feed", bounds=(0, 1.0), unit="L/h")
    growth = 0.4 * food / (0.5 + food + food**2 / 50)
    making = 0.1 * growth + 0.02 * food / (food + 0.1)
    thinning = feed / volume
    batch.dynamics(
        cells=growth * cells - thinning * cells,
        food=-growth * cells / 0.5 - making * cells / 1.2 + thinning * (100 - food),
        made=making * cells - thinning * made,
        volume=feed,
    )
    product = batch.final(made * volume)
    problem.maximize("product", product, unit="g")
    problem.maximize("productivity", product / batch.tf, unit="g/h")
    return problem


def rocket() -> Problem:
    """Payload against time to orbit of a rocket with two stages over a flat earth, with the centrifugal force of a round one."""
    problem, gravity = Problem("two-stage rocket"), 9.80665e-3  # km/s2
    payload = problem.parameter("payload", bounds=(0.5, 8.0), unit="t")
    first = problem.phase("first stage", t0=0.0, tf=(50.0, 150.0))
    second = problem.phase("second stage", t0=(50.0, 150.0), tf=(150.0, 500.0))

    def body(stage: Phase, thrust: float, impulse: float, masses: tuple[float, float], at_rest: bool) -> tuple[ca.MX, ...]:
        """Height, speeds and mass of a stage; thrust in t km/s2, specific impulse in s."""
        begins = {"initial": 0.0} if at_rest else {}
        h = stage.state("h", bounds=(0, 300), unit="km", **begins)
        vx = stage.state("vx", bounds=(-1, 9), unit="km/s", **begins)
        vy = stage.state("vy", bounds=(-2, 4), unit="km/s", **begins)
        mass = stage.state("mass", bounds=masses, unit="t")
        pitch = stage.control("pitch", bounds=(-0.5, 1.6), unit="rad")
        throttle = stage.control("throttle", bounds=(0.3, 1.0))
        push = thrust * throttle / mass
        stage.dynamics(
            h=vy,
            vx=push * ca.cos(pitch),
            vy=push * ca.sin(pitch) - gravity + vx**2 / 6400,
            mass=-thrust * throttle / (impulse * gravity),
        )
        return h, vx, vy, mass

    _, _, _, lower = body(first, 1.9, 300.0, (15, 130), True)
    h, vx, vy, upper = body(second, 0.35, 340.0, (2, 40), False)
    problem.constraint("launch mass", first.initial(lower) - payload, lower=115.0, upper=115.0)
    problem.link(first, second, states=["h", "vx", "vy"])
    problem.constraint("staging", second.initial(upper) - (first.final(lower) - 8.0), lower=0, upper=0)
    problem.constraint("propellant of the first stage", first.final(lower) - payload, lower=30.0)
    problem.constraint("propellant of the second stage", second.final(upper) - payload, lower=2.0)
    problem.constraint("altitude", second.final(h), lower=200, upper=200)
    problem.constraint("orbital speed", second.final(vx), lower=7.6)
    problem.constraint("level", second.final(vy), lower=0, upper=0)
    problem.maximize("payload", payload, unit="t")
    problem.minimize("time to orbit", second.tf, unit="s")
    return problem


def with_second(name: str, phase: str, goal: Callable[[Problem, Phase], None]) -> Callable[[], Problem]:
    """A published problem of one objective with a second one."""

    def build() -> Problem:
        problem = load(STANDARD + name)
        goal(problem, problem.phases[phase])
        return problem

    return build


def effort_of(*controls: str) -> Callable[[Problem, Phase], None]:
    """The second objective is the integral of the squares of some controls."""
    return lambda problem, phase: problem.minimize("effort", phase.integral(sum(phase[name] ** 2 for name in controls)))


def mass(problem: Problem, phase: Phase) -> None:
    """The second objective is the mass that is left."""
    problem.maximize("mass", phase.final(phase["mass"]))


def drug(problem: Problem, phase: Phase) -> None:
    """The second objective is the drug that is used."""
    problem.minimize("drug", phase.final(phase["used"]))


FORCES = effort_of("reach force", "heading force", "elevation force")
ROCKET, CART, REACTOR = (
    SearchCase("rocket", rocket, "dfet:8x4"),
    SearchCase("cart-pole", cart_pole, "dfet:10x5"),
    SearchCase("bioreactor", bioreactor, "dfet:12x3:bernstein"),
)
TUMOUR = SearchCase("tumour, drug", with_second("tumour", "care", drug))
OTHERS = (
    *(ROCKET, CART, REACTOR),
    SearchCase("two_link_arm, effort", with_second("two_link_arm", "move", effort_of("u", "v"))),
    SearchCase("robot_arm, effort", with_second("robot_arm", "turn", FORCES)),
    SearchCase("climb, mass", with_second("climb", "climb", mass)),
    TUMOUR,
)
"""Problems of others, as they state them or with a second objective: chosen before anything was measured."""
GODDARD = SearchCase("goddard", partial(load, "goddard"), "dfet:4x6", 10_000, reference=goddard.reference)
ORBIT = SearchCase("orbit_rise", partial(load, "orbit_rise"), "dfet:30x1", 50_000, reference=orbit_rise.reference)
SITE = SearchCase("landing_site", partial(load, "landing_site"), "dfet:1x3", 20_000, least=1.01, reference=landing_site.reference)
CASES = (GODDARD, ORBIT, replace(ORBIT, name="orbit_rise_full", build=partial(load, "orbit_rise_full"), least=1.01), SITE, *OTHERS)
LESS = {GODDARD: 600, ORBIT: 1_000, SITE: 2_000, TUMOUR: 300}
"""Evaluations of the quick benchmark."""


# For the same work

OURS, THEIRS = "MACS", "sweeps"


def search_rounds(case: SearchCase, effort: Effort, steps: Steps) -> Callable[[int], Iterable[Row]]:
    """Each seed searches, and sweeps for the same work."""
    reference = case.reference() if case.reference else None

    def measured(seed: int) -> Iterable[Row]:
        problem, method = case.stated()
        budget = min(case.evaluations, effort.evaluations or case.evaluations)
        ours = finished(MACS(agents=FRONT_SIZE, archive=FRONT_SIZE).solve(problem, method, evaluations=budget, seed=seed))
        theirs = sweeps(problem, method, ours.stats["work"], seed, steps)
        union = np.vstack([ours.F, theirs.F])
        volumes = [hypervolume(front.F, union) for front in (ours, theirs)]
        for who, front, ratio in ((OURS, ours, volumes[0] / volumes[1]), (THEIRS, theirs, 1.0)):
            values = {key: front.stats[key] for key in ("evaluations", "gradient_solves", "work")}
            if reference is not None:
                values |= {"gd": gd(front, reference), "igd": igd(front, reference)}
            yield Row.once(case.name, who, ratio=ratio, points=len(front), seconds=front.stats["wall_time"], **values)

    return measured


def sweeps(problem: Problem, method: Transcription, work: int, seed: int, steps: Steps) -> Front:
    """Sweeps until they had as much counted work: the plain one, then with 4 random starts, from nothing and from the best known in turn.

    Each gets to its end, since one that is cut short is worth little: they have a little more work, not less.
    """
    front, k = None, 0
    while front is None or front.stats["work"] < work:
        known = front if k % 2 == 0 and front is not None and len(front) else None
        more = swept(problem, method, steps, starts=4 if k else 1, seed=1000 * seed + k, start=known)
        front, k = more if front is None else Front.merge([front, more]), k + 1
    return front[np.flatnonzero(spread(front.F, FRONT_SIZE))] if len(front) > FRONT_SIZE else front


def swept(problem: Problem, method: Transcription, steps: Steps, **settings: object) -> Front:
    """A sweep that Ctrl-C ends."""
    front = sweep(problem, method, points=FRONT_SIZE, **settings)  # type: ignore[arg-type]
    steps.check()
    return front


def search_targets(rows: Sequence[Row]) -> list[Target]:
    """The ratio of hypervolumes of each case, by the median of the seeds; none of a case that had fewer evaluations."""
    cases, made = {case.name: case for case in CASES}, []
    for row in rows:
        case = cases.get(row.case)
        if case and row.who == OURS and row.of("evaluations") >= case.evaluations:
            asked = f"hypervolume at least {case.least:g} times that of the sweeps"
            made.append(Target(case.name, asked, row.spread("ratio"), row.of("ratio") >= case.least))
    return made


COUNTS: tuple[Column, ...] = (
    column("evalua-", "tions", "evaluations", form=".0f"),
    column("gradient", "solves", "gradient_solves", form=".0f"),
)
SEARCH = Bench(
    title="searches",
    about=f"SEARCHES: MACS with its defaults against gradient sweeps from many starts, on the same mesh, {FRONT_SIZE} points, for the "
    "same work. The first sweep has one start, others 4, from nothing and from the best known in turn; their points are thinned by "
    "the archive's rule. Hypervolume: as multiples of that of the sweeps, normalised by ideal and nadir of both, up to 1.1. GD, "
    "IGD: distances to the true front and from it, normalised by its range. Work: as `stats` count it, the same way for both; a "
    "sweep gets to its end, so that the sweeps have more of it. Median and quartiles over seeds, least and greatest of few.",
    full=Effort(CASES, rounds=5),
    quick=Effort(tuple(replace(case, evaluations=budget) for case, budget in LESS.items())),
    prepare=search_rounds,
    columns=(
        ("hypervolume", "ratio", lambda row: row.spread("ratio") if row.who == OURS else "1"),
        ("GD", "", lambda row: row.spread("gd")),
        ("IGD", "", lambda row: row.spread("igd")),
        *COUNTS,
        column("work", "", "work"),
        SECONDS,
        rounds_of("ratio", "seeds"),
    ),
    targets=search_targets,
    seeded=True,
)


# To the same quality

DONE, PROPAGATE, PROJECTION = "until done", "propagate", "projection"
SWEEP, SWEEPS = "sweep", "sweep, ten starts"
BUDGETS = (250, 500, 1000, 2000, 4000)
"""Evaluations that another inner level is given, one number after the other until its front is as good."""


def front_rounds(case: SearchCase, effort: Effort, steps: Steps) -> Callable[[int], Iterable[Row]]:
    """Each seed searches until it is done, with other inner levels until they are as good, and sweeps."""
    problem, method = case.stated()

    def search(seed: int, inner: str, evaluations: int | None) -> Front:
        solver = MACS(archive=FRONT_SIZE, mesh="fixed")
        return finished(solver.solve(problem, method, evaluations=evaluations, seed=seed, inner=inner, verify=None))

    def measured(seed: int) -> Iterable[Row]:
        fronts = {DONE: search(seed, "auto", None)}
        for inner in (PROPAGATE, PROJECTION):
            for budget in [one for one in BUDGETS if one <= (effort.evaluations or one)]:
                fronts[inner] = search(seed, inner, budget)
                if as_good(fronts[inner].F, fronts[DONE].F):
                    break
        for who, starts in ((SWEEP, 1), (SWEEPS, 10)):
            fronts[who] = swept(problem, method, steps, starts=starts, seed=seed, verify=None)
        union = np.vstack([front.F for front in fronts.values()])
        best = union[nondominated(union)]
        most = hypervolume(best[np.flatnonzero(spread(best, FRONT_SIZE))] if len(best) > FRONT_SIZE else best, best)
        for who, front in fronts.items():
            values = {key: front.stats[key] for key in ("evaluations", "work", "gradient_solves")}
            values |= {"volume": hypervolume(front.F, best) / most, "good": as_good(front.F, fronts[DONE].F), "points": len(front)}
            seconds = front.stats["wall_time"]
            yield Row.once(case.name, who, seconds=seconds, ratio=seconds / fronts[DONE].stats["wall_time"], **values)

    return measured


def as_good(F: np.ndarray, other: np.ndarray) -> bool:
    """Whether a front (k, m), all minimised, has 0.99 of the hypervolume of another one (l, m), up to 1.1 of the ranges of both, and ends
    that are worse by no more than 0.001 of the ranges."""
    if not len(F):
        return False
    both = np.vstack([F, other])
    span = np.ptp(both[nondominated(both)], axis=0)
    ends = (F.min(axis=0) <= other.min(axis=0) + 1e-3 * span).all()
    return bool(ends) and hypervolume(F, both) >= 0.99 * hypervolume(other, both)


def by_case(rows: Sequence[Row]) -> dict[str, dict[str, Row]]:
    """Rows by case and contender."""
    grouped: dict[str, dict[str, Row]] = {}
    for row in rows:
        grouped.setdefault(row.case, {})[row.who] = row
    return grouped


def front_targets(rows: Sequence[Row]) -> list[Target]:
    """The search that chooses its inner level takes little more time than the better one of them, where one is as good."""
    made = []
    for case, own in by_case(rows).items():
        others = [own[who].of("ratio") for who in (PROPAGATE, PROJECTION) if own[who].of("good") == 1.0]
        value = f"{short(1 / min(others))} times" if others else "none is as good"
        asked = f"at most {ASKED['front']:g} times as long as the better other inner level"
        made.append(Target(case, asked, value, not others or 1 / min(others) <= ASKED["front"]))
    return made


def beside_sweeps(rows: Sequence[Row]) -> list[str]:
    """What a sweep from one start takes, where its front is as good."""
    lines = []
    for case, own in by_case(rows).items():
        good = own[SWEEP].of("good") == 1.0
        times = f"{short(1 / own[SWEEP].of('ratio'))} times as long as a sweep from one start"
        lines.append(f"{case}: {times if good else 'a sweep from one start is not as good'}")
    return [*lines, ""]


FRONT = Bench(
    title="fronts",
    about=f"FRONTS: MACS with defaults until it is done, {FRONT_SIZE} points, on a given mesh, not simulated. 'propagate' and "
    "'projection': the same search with these inner levels, and the fewest evaluations of a few numbers with which its front is as "
    "good as ours: 0.99 of the hypervolume, ends within 0.001 of the ranges; the time is that of this search alone. Where none is "
    "as good, the time is that of the most evaluations. 'sweep': from the problem's guess, one start or ten a point. Volume: in "
    "that of ten points of the best of all of one seed. Median and quartiles over seeds, least and greatest of few.",
    full=Effort((GODDARD, ORBIT, ROCKET, CART, SITE, REACTOR), rounds=3),
    quick=Effort((GODDARD, SITE), evaluations=500),
    prepare=front_rounds,
    columns=(
        ("time in", "ours", lambda row: "1" if row.who == DONE else row.spread("ratio")),
        column("as good", "as ours", "good", np.mean, ".0%"),
        ("volume", "", lambda row: row.spread("volume")),
        *COUNTS,
        SECONDS,
    ),
    targets=front_targets,
    notes=beside_sweeps,
    seeded=True,
)
