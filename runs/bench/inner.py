"""Benchmarks of inner levels on batches of candidates as the search sends them, and of whole populations propagated in one call."""

from __future__ import annotations

import timeit
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import casadi as ca
import numpy as np

from macs.io.console import Steps
from problems import Problem, load
from transcription import DFET, NLP, Smooth, parse
from transcription.base import CONVERGED
from transcription.inner import InnerResult, InnerSolver, Ipopt, Newton, Projection, Propagate
from transcription.numerics.batched import compiler

from .contract import ASKED, Bench, Effort, Row, Target, column, compiling, rounds_of, short, side_by_side

BASELINE, PROJECTION, DEFAULT = "ipopt, constant objective", "ipopt, projection", "projection"
BATCH = 10
"""Candidates in a batch, as the search sends them: one for each agent."""

Batch = tuple[np.ndarray, np.ndarray | None]
"""Candidates (BATCH, d), and the vectors (BATCH, n) that they start from if they are warm."""


@dataclass(frozen=True)
class InnerCase:
    """Batches of candidates on one mesh."""

    name: str
    make: Callable[[], Problem]
    mesh: DFET
    warm: bool = False  # candidates near feasible points, starting from their states; else uniformly random ones, from a first guess
    tolerance: float = 1e-6
    # Every candidate is feasible when it is propagated, within the bounds of states: propagation alone is an inner level here.
    propagates: bool = False
    asked: Mapping[str, float] = field(default_factory=dict)  # target of "projection": "speed" at least, "moved" at most

    def batch(self, nlp: NLP, rng: np.random.Generator) -> Batch:
        """A batch of candidates, with a warm start if the case has one."""
        lower, upper, span = nlp.lower[nlp.free], nlp.upper[nlp.free], nlp.span[nlp.free]
        cold = lower + rng.random((BATCH, len(span))) * span
        if not self.warm:
            return cold, None
        result = Projection().solve(nlp, cold, tolerance=self.tolerance)
        feasible = result.z[result.status == CONVERGED]
        if not len(feasible):
            raise RuntimeError(f"{self.name}: no feasible point to begin with")
        known = feasible[np.arange(BATCH) % len(feasible)]
        # About a twentieth of the bounds away from the feasible point.
        return np.clip(known[:, nlp.free] + 0.05 * span * rng.standard_normal(cold.shape), lower, upper), known


def corridor() -> Problem:
    """Following a bend at speeds to be chosen, between walls so near that one or the other is in the way all along."""
    problem = Problem("corridor")
    walk = problem.phase("walk", t0=0.0, tf=(2.0, 4.0))
    x, y = walk.state("x", bounds=(-1, 9), initial=0), walk.state("y", bounds=(-3, 3), initial=0)
    u, v = walk.control("u", bounds=(0.5, 2.0)), walk.control("v", bounds=(-2.0, 2.0))
    walk.dynamics(x=u, y=v)
    walk.path("walls", y - 0.5 * ca.sin(x), lower=-0.05, upper=0.05)
    problem.minimize("effort", walk.integral(u**2 + v**2))
    problem.maximize("distance", walk.final(x))
    return problem


def needle() -> Problem:
    """Balancing for thirty-two time constants: no propagation reaches the end, whatever the control."""
    problem = Problem("needle")
    hold = problem.phase("hold", t0=0.0, tf=(7.0, 8.0))
    x = hold.state("x", bounds=(-2, 2), initial=0.5, final=0.0)
    u = hold.control("u", bounds=(-10, 10))
    hold.dynamics(x=4 * x + u)
    problem.minimize("effort", hold.integral(u**2))
    problem.minimize("time", hold.tf)
    return problem


GODDARD = InnerCase("goddard, cold", partial(load, "goddard"), DFET(4, 6), asked={"speed": 5})
ORBIT = InnerCase("orbit_rise, cold", partial(load, "orbit_rise"), DFET(30, 1), propagates=True, asked={"speed": 100})
NEEDLE = InnerCase("needle, cold", needle, DFET(8, 3))
SHORT = (
    GODDARD,
    replace(GODDARD, name="goddard, warm", warm=True, asked={"speed": 15, "moved": 0.07}),
    replace(ORBIT, name="orbit_rise, cold, 1e-9", tolerance=1e-9),
    replace(ORBIT, name="orbit_rise, warm, 1e-9", warm=True, tolerance=1e-9),
    NEEDLE,
)
CASES = (
    *SHORT,
    ORBIT,
    replace(ORBIT, name="orbit_rise, warm", warm=True),
    InnerCase("corridor, cold", corridor, DFET(4, 2)),
    InnerCase("corridor, warm", corridor, DFET(4, 2), warm=True),
    replace(NEEDLE, name="needle, warm", warm=True),
)


def inner_rounds(case: InnerCase, effort: Effort, steps: Steps) -> Callable[[int], Iterable[Row]]:
    """Each round solves another batch by all inner levels."""
    solvers: dict[str, InnerSolver] = {BASELINE: Ipopt(objective="constant"), PROJECTION: Ipopt(), "newton": Newton()}
    solvers |= {DEFAULT: Projection()} | ({"propagate": Propagate()} if case.propagates else {})
    when, rng = "always" if compiler() else "0", np.random.default_rng(0)
    with compiling(when):
        nlp = case.mesh.transcribe(case.make())
        batches = [case.batch(nlp, rng) for _ in range(effort.rounds)]
        # Programs are built before the clock runs, and functions compiled for all the numbers of candidates that Newton's method will have.
        for solver in solvers.values():
            solver.solve(nlp, *batches[0], tolerance=case.tolerance)
        began = timeit.default_timer()
        for batch in batches:
            Newton().solve(nlp, *batch, tolerance=case.tolerance)
            if timeit.default_timer() - began > effort.seconds:
                break

    def repeated(solver: InnerSolver, batch: Batch) -> tuple[int, InnerResult]:
        """How often a batch was solved within 5 ms, so that the clock matters less, and its results."""
        began, times = timeit.default_timer(), 0
        while times == 0 or timeit.default_timer() - began < 5e-3:
            result, times = solver.solve(nlp, *batch, tolerance=case.tolerance), times + 1
        return times, result

    def measured(number: int) -> Iterable[Row]:
        with compiling(when):
            timed = side_by_side({who: partial(repeated, solver, batches[number - 1]) for who, solver in solvers.items()}, number)
        seconds = {who: taken / times / BATCH for who, (taken, (times, _)) in timed.items()}
        for who, (_, (_, result)) in timed.items():
            good, speed = result.status == CONVERGED, seconds[BASELINE] / seconds[who]
            moved = result.moved[good].mean() if good.any() else np.nan
            values = {"converged": good.mean(), "moved": moved, "iterations": result.iterations.mean()}
            yield Row.once(case.name, who, speed=speed, seconds=seconds[who], fallbacks=result.fallbacks / BATCH, **values)

    return measured


def overall(row: Row) -> str:
    """The ratio of the sums of all times: a batch that takes long, for one candidate of ten, weighs more in it than in the median."""
    seconds = np.array(row.values["seconds"])
    return short(float((np.array(row.values["speed"]) * seconds).sum() / seconds.sum()))


def inner_targets(rows: Sequence[Row]) -> list[Target]:
    """What is asked of the default inner level: times and distances by the median of the rounds, convergence over all candidates."""
    asked = {case.name: case.asked for case in CASES}
    by_name = {(row.case, row.who): row for row in rows}
    made = []
    for row in [row for row in rows if row.who == DEFAULT]:
        limits, name = asked.get(row.case, {}), f"{row.case}, {DEFAULT}"
        if "speed" in limits:
            value, least = f"{row.spread('speed')}, in all {overall(row)}", limits["speed"]
            made.append(Target(name, f"at least {least:g} times as fast", value, row.of("speed") >= least))
        if "moved" in limits:
            value = f"{row.short('moved')} (nearest: {by_name[row.case, PROJECTION].short('moved')})"
            made.append(Target(name, f"moved by at most {limits['moved']:g}", value, row.of("moved") <= limits["moved"]))
        ours, theirs = row.of("converged", np.mean), by_name[row.case, BASELINE].of("converged", np.mean)
        made.append(Target(name, "converged at least as often", f"{100 * ours:.0f} % to {100 * theirs:.0f} %", ours >= theirs))
    return made


def compiled(rows: Sequence[Row]) -> list[str]:
    """Whether functions are compiled, and by what."""
    used = compiler()
    return [f"Functions are compiled ({Path(used).name})." if used else "No function is compiled.", ""]


INNER = Bench(
    title="inner levels",
    about="INNER LEVELS: candidates a second, as multiples of those of IPOPT's defaults with a constant objective, the paper's inner "
    "level. Batches of 10, the same for all, in turn; median and quartiles over rounds, least and greatest of few; in all: the "
    "ratio of the sums of all times. moved: mean distance from the candidate, in spans. fallbacks: left to IPOPT.",
    full=Effort(CASES, rounds=40, seconds=12.0),
    quick=Effort(SHORT, rounds=6, seconds=1.0),
    prepare=inner_rounds,
    columns=(
        ("times as", "fast", lambda row: row.spread("speed") if row.who != BASELINE else "1"),
        ("in", "all", lambda row: overall(row) if row.who != BASELINE else "1"),
        ("ms a", "candidate", lambda row: short(1e3 * row.of("seconds"))),
        column("con-", "verged", "converged", np.mean, ".0%"),
        column("moved", "", "moved", np.mean),
        column("itera-", "tions", "iterations", np.mean),
        ("fall-", "backs", lambda row: f"{row.of('fallbacks', np.mean):.0%}" if row.who == DEFAULT else ""),
        rounds_of("speed"),
    ),
    targets=inner_targets,
    notes=compiled,
)


SINGLY, TOGETHER, COMPILED = "one by one", "in one call", "in one call, compiled"


@dataclass(frozen=True)
class PopulationCase:
    """So many candidates of the first re-entry case by a transcription."""

    method: str = "shooting:200"
    candidates: int = 120

    @property
    def name(self) -> str:
        """Of its rows."""
        return f"reentry_case1, {self.method}, {self.candidates} candidates"


def population_rounds(case: PopulationCase, effort: Effort, steps: Steps) -> Callable[[int], Iterable[Row]]:
    """Each round propagates all candidates in each way, five times, of which the quickest counts."""
    problem, method = load("reentry_case1"), parse(case.method)
    X = Smooth().draw(problem, method, case.candidates, np.random.default_rng(0))

    def propagator(when: str) -> Callable[[np.ndarray], InnerResult]:
        with compiling(when):
            nlp = method.transcribe(problem)

        def propagate(rows: np.ndarray) -> InnerResult:
            with compiling(when):
                return Propagate().solve(nlp, rows, None, tolerance=1e-6)

        return propagate

    plain = propagator("0")
    ways: dict[str, Callable[[], object]] = {SINGLY: lambda: [plain(x[None]) for x in X], TOGETHER: lambda: plain(X)}
    if compiler():
        ways[COMPILED] = partial(propagator("always"), X)
    for way in ways.values():
        way()  # its functions are made

    def measured(number: int) -> Iterable[Row]:
        timed = side_by_side({who: partial(timeit.repeat, way, number=1, repeat=5) for who, way in ways.items()}, number)
        seconds = {who: min(times) for who, (_, times) in timed.items()}
        return [
            Row.once(case.name, who, speed=seconds[SINGLY] / taken, candidates=case.candidates / taken) for who, taken in seconds.items()
        ]

    return measured


def population_targets(rows: Sequence[Row]) -> list[Target]:
    """One call is so many times as fast as one by one, by the median of the rounds."""
    speed = next(row for row in rows if row.who == TOGETHER).of("speed")
    asked = f"at least {ASKED['population']:g} times as fast"
    return [Target("in one call, without a compiler", asked, short(speed), speed >= ASKED["population"])]


POPULATION = Bench(
    title="populations",
    about="POPULATIONS: the candidates of a population search, propagated and scored in one call, against one after the other, in turn; "
    "median, least and greatest of few rounds. Candidates a second depend on the machine and its load.",
    full=Effort((PopulationCase(),), rounds=5),
    quick=Effort((PopulationCase(),), rounds=2),
    prepare=population_rounds,
    columns=(
        ("times as", "fast", lambda row: "1" if row.who == SINGLY else row.spread("speed")),
        column("candidates", "a second", "candidates"),
        rounds_of("speed"),
    ),
    targets=population_targets,
)
