"""Benchmarks of growth: how time and memory grow with the size of problems, meshes, fronts and populations, as exponents: slopes over size,
both on logarithmic scales, beside a limit."""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from macs import MACS, NSGA3, Front
from macs.fronts.builders import from_vectors
from macs.fronts.files import from_bytes, to_bytes
from macs.io.console import Steps
from macs.solvers import checkpoint
from problems import Problem, load
from problems.phase import Phase
from transcription import Smooth, parse
from transcription.base import NLP
from transcription.nlp.derivatives import gradients, hessian

from ..execution.processes import lines_apart
from ..execution.task import peak_memory
from .contract import ASKED, Bench, Effort, Row, Target, column, compiling, rounds_of, short

Work = Callable[[], object]


# Problems of any size


def ride(phases: int) -> Problem:
    """A ride from rest to rest in so many linked phases, each with a path constraint: its time against its effort."""
    problem, longest = Problem(f"ride of {phases} phases"), 3.0 * phases
    legs: list[Phase] = []
    efforts = []
    for i in range(phases):
        first, last = i == 0, i == phases - 1
        leg = problem.phase(f"leg {i}", t0=0.0 if first else (0.0, longest), tf=(0.5, longest), duration=(0.5, 3.0))
        x = leg.state("x", bounds=(-1.0, phases + 1.0), initial=0.0 if first else None, final=float(phases) if last else None)
        v = leg.state("v", bounds=(-3.0, 3.0), initial=0.0 if first else None, final=0.0 if last else None)
        u = leg.control("u", bounds=(-1.0, 1.0))
        leg.dynamics(x=v, v=u - 0.1 * v * v)
        leg.path("energy", v * v, upper=9.0)
        if legs:
            problem.link(legs[-1], leg)
        legs.append(leg)
        problem.constraint(f"way of leg {i}", leg.final(x) - leg.initial(x), lower=0.1)
        efforts.append(leg.integral(u * u))
    problem.minimize("time", legs[-1].tf)
    problem.minimize("effort", sum(efforts))
    return problem


def masses(count: int) -> Problem:
    """So many masses in a row, each on springs to its neighbours, and a force on each: effort against the way of the last."""
    problem = Problem(f"{count} masses")
    phase = problem.phase("swing", t0=0.0, tf=1.0)
    x = [phase.state(f"x{i}", bounds=(-2.0, 2.0), initial=0.0) for i in range(count)]
    v = [phase.state(f"v{i}", bounds=(-4.0, 4.0), initial=0.0) for i in range(count)]
    u = [phase.control(f"u{i}", bounds=(-1.0, 1.0)) for i in range(count)]
    pulls = [(x[i + 1] if i + 1 < count else 0.0) - 2.0 * x[i] + (x[i - 1] if i else 0.0) for i in range(count)]
    phase.dynamics(**{f"x{i}": v[i] for i in range(count)}, **{f"v{i}": pulls[i] + u[i] for i in range(count)})
    problem.minimize("effort", phase.integral(sum(one * one for one in u)))
    problem.maximize("way", phase.final(x[-1]))
    return problem


def limited(count: int) -> Problem:
    """A ride of a point mass with so many path constraints."""
    problem = Problem(f"ride with {count} limits")
    leg = problem.phase("ride", t0=0.0, tf=(1.0, 5.0))
    x = leg.state("x", bounds=(-10.0, 10.0), initial=0.0)
    v = leg.state("v", bounds=(-10.0, 10.0), initial=0.0)
    u = leg.control("u", bounds=(-1.0, 1.0))
    leg.dynamics(x=v, v=u)
    for i in range(count):
        leg.path(f"limit {i}", v + 0.01 * i * x * x, upper=5.0)
    problem.minimize("time", leg.tf)
    problem.maximize("way", leg.final(x))
    return problem


# Work of a size: each function makes it ready, so that only the work itself is timed


def transcribed(word: str, size: int) -> NLP:
    """Goddard's rocket by a word with a place for the size."""
    return parse(word.format(size)).transcribe(load("goddard").compile())


def setup(word: str, size: int) -> Work:
    """The transcription of a problem: NLP, functions, and what propagation leaves."""
    problem = load("goddard").compile()
    return lambda: parse(word.format(size)).transcribe(problem).reduced


def derivatives(word: str, size: int) -> Work:
    """Gradients and Hessian for gradient solves."""
    nlp = transcribed(word, size)
    return lambda: (gradients(nlp), hessian(nlp))


def candidate(word: str, size: int) -> Work:
    """The propagation of one candidate, from the making of its functions to objectives and residuals, and its trajectory."""
    nlp = transcribed(word, size)
    guess = np.where(np.isfinite(nlp.guess), nlp.guess, 0.5 * (nlp.lower + nlp.upper)[nlp.free])
    return lambda: nlp.unpack(nlp.propagate_and_score(nlp.first_guess(guess[None]))[0][0])


def stated(build: Callable[[int], Problem], word: str, size: int) -> Work:
    """A problem of any size from its statement to its derivatives."""

    def work() -> object:
        nlp = parse(word).transcribe(build(size).compile())
        return gradients(nlp), hessian(nlp)

    return work


def front_of(points: int) -> Front:
    """A front of so many trajectories, which need not be good ones."""
    problem, transcription = load("goddard").compile(), parse("dfet:4x6")
    nlp = transcription.nlp(problem)
    X = Smooth().draw(problem, transcription, points, np.random.default_rng(0))
    Z = nlp.propagate(nlp.first_guess(X))
    return Front.of(from_vectors(nlp, Z, {"name": "drawn", "settings": {}}, {"tolerance": 1e-6, "evaluations": points}))


def saving(points: int) -> Work:
    """The content of a front's file."""
    return partial(to_bytes, front_of(points))


def loading(points: int) -> Work:
    """A front from the content of its file."""
    return partial(from_bytes, to_bytes(front_of(points)))


def simulating(points: int) -> Work:
    """A front simulated."""
    return front_of(points).simulate


def searching(agents: int) -> Work:
    """Iterations of MACS on a plain function, without gradients."""
    solver = MACS(agents=agents, archive=agents, refine=False)
    return lambda: solver.minimize(two_goals, [(0.0, 1.0)] * 8, evaluations=20 * agents, seed=1)


def checkpointing(agents: int) -> Work:
    """The checkpoint of so many agents, of 200 variables each, written and read again."""
    solver = MACS(agents=agents, archive=100, refine=False)

    def begin(path: Path) -> bytes:
        solver.minimize(two_goals, [(0.0, 1.0)] * 200, evaluations=agents, seed=1, checkpoint=path)
        return checkpoint.read_file(path)

    content = in_folder(begin)

    def again(path: Path) -> object:
        path.write_bytes(checkpoint.sealed(content))
        return checkpoint.read_file(path)

    return lambda: in_folder(again)


def two_goals(X: np.ndarray) -> np.ndarray:
    """Zitzler, Deb and Thiele's first function (k, 2) of vectors (k, d) in the unit box."""
    g = 1.0 + 9.0 * X[:, 1:].mean(axis=1)
    return np.column_stack([X[:, 0], g * (1.0 - np.sqrt(X[:, 0] / g))])


def in_folder(work: Callable[[Path], Any]) -> Any:
    """What a function of the path of a file returns, which is then removed."""
    with tempfile.TemporaryDirectory() as folder:
        return work(Path(folder) / "file")


# Time and memory


@dataclass(frozen=True)
class Series:
    """A piece of work at several sizes, increasing; the fit is over the last three."""

    name: str
    unit: str  # what is counted
    prepare: Callable[[int], Any]  # a size -> the work; of `generation`, a function of the number of generations that runs them
    sizes: tuple[int, ...]
    order: str = ""  # of the paper, in which Np is the population, Nk the nodes, I the constraints and M the objectives
    power: int = 1  # the largest power of the size in it, logarithms left out


SIZES = {
    **dict.fromkeys(("elements", "intervals"), (500, 1000, 2000, 4000)),
    "nodes": (2500, 5000, 10000, 20000),
    "phases": (5, 10, 20, 40),
    "masses": (25, 50, 100, 200),
    "points": (250, 500, 1000, 2000),
    "agents": (32, 64, 128, 256),
}
WORDS = {"DFET": "dfet:{}x3", "Radau": "radau:{}x3", "single shooting": "shooting:{}", "multiple shooting": "multiple-shooting:{}"}
UNITS = {"single shooting": "nodes", "multiple shooting": "intervals"}
SERIES = (
    *(
        Series(f"{kind}, {name}", UNITS.get(name, "elements"), partial(work, word), SIZES[UNITS.get(name, "elements")])
        for kind, work, names in (
            ("set-up", setup, tuple(WORDS)),
            ("candidate", candidate, ("DFET", "single shooting", "multiple shooting")),
            ("derivatives", derivatives, ("DFET", "Radau", "multiple shooting")),
        )
        for name, word in WORDS.items()
        if name in names
    ),
    *(
        Series(f"{kind}, {name}", unit, partial(stated, build, word), SIZES[unit])
        for kind, unit, build, words in (
            ("phases", "phases", ride, {"DFET": "dfet:4x3", "multiple shooting": "multiple-shooting:10"}),
            ("variables", "masses", masses, {"DFET": "dfet:10x3", "multiple shooting": "multiple-shooting:20"}),
        )
        for name, word in words.items()
    ),
    Series("front saved", "points", saving, SIZES["points"]),
    Series("front loaded", "points", loading, SIZES["points"]),
    Series("front simulated", "points", simulating, (125, 250, 500, 1000)),
    Series("search", "agents", searching, SIZES["agents"]),
    Series("checkpoint", "agents", checkpointing, (500, 1000, 2000, 4000)),
)
"""Up to 40 phases and 256 agents: from about 100 phases on, what each picks from the vector of all shows, and from about 300 agents on,
that each looks at its distances to all others."""
SHORT = ("set-up, DFET", "candidate, DFET", "derivatives, DFET", "phases, DFET", "variables, DFET", "front saved", "front loaded", "search")
LEAST_MEMORY = 16.0
"""MB by which a process must have grown between the first and the last of three sizes, for its memory to say anything: blocks of the
allocator are that large."""
KINDS = {"time": "seconds", "memory": "MB"}


def exponent(sizes: Sequence[float], costs: Sequence[float]) -> float:
    """The power of the size with which costs grow: the slope of a straight line through their logarithms; costs of 0 count as tiny."""
    return float(np.polyfit(np.log(sizes), np.log(np.maximum(costs, 1e-6)), 1)[0])


def scale_rounds(case: Series, effort: Effort, steps: Steps) -> Callable[[int], Iterable[Row]]:
    """Each round measures the series in a process of its own, whose peak memory is then its own."""

    def measured(number: int) -> Iterable[Row]:
        sizes = case.sizes[:3] if effort.rounds == 1 else case.sizes
        lines, _ = lines_apart(__name__, (case.name, *map(str, sizes)), 600.0, steps)
        return [growth(case, sizes, [json.loads(line) for line in lines])]

    return measured


def growth(case: Series, sizes: Sequence[int], lines: Sequence[tuple[int, float, float]]) -> Row:
    """The repetitions that a process measured, (size, seconds, MB) each, and the exponents of the quickest of each size; a series that did
    not reach its last size has none, and is noted as unfinished. The peak is that of the first repetition: later ones have it from larger
    sizes."""
    quickest = {size: min(one for own, one, _ in lines if own == size) for size, *_ in lines}
    peaks = {size: memory for size, _, memory in reversed(lines)}
    values = {f"{word} at {size}": one[size] for size in quickest for word, one in (("seconds", quickest), ("MB", peaks))}
    if len(quickest) < len(sizes):
        return Row.once(case.name, case.unit, unfinished=1.0, **values)
    largest = sizes[-3:]
    seconds, memory = [quickest[size] for size in largest], [peaks[size] for size in largest]
    values |= {"size": largest[-1], "seconds": seconds[-1], "MB": memory[-1], "time": exponent(largest, seconds)}
    if memory[-1] - memory[0] >= LEAST_MEMORY:
        values["memory"] = exponent(largest, memory)
    return Row.once(case.name, case.unit, **values)


def measure_apart(case: Series, sizes: Sequence[int]) -> None:
    """Print a line of JSON for each repetition: size, CPU seconds, and MB of the peak so far above the beginning."""
    begin = peak_memory()
    case.prepare(sizes[0])()  # whatever is made once is made
    spent = dict.fromkeys(sizes, 0.0)
    for _ in range(5):  # all sizes, then again: if the machine is slow for a while, all sizes suffer alike
        for size in sizes:
            if spent[size] < 4.0:  # seconds: longer work is not repeated
                work = case.prepare(size)
                taken = cpu_seconds(work)
                spent[size] += taken
                print(json.dumps([size, taken, peak_memory() - begin]), flush=True)


def cpu_seconds(work: Callable[..., object], *arguments: Any) -> float:
    """Time of this process in a call."""
    began = time.process_time()
    work(*arguments)
    return time.process_time() - began


def scale_targets(rows: Sequence[Row]) -> list[Target]:
    """No cost grows faster than asked, by the median of its exponents, and all series come to their end."""
    made = []
    for kind in KINDS:
        powers = {row.case: row.of(kind) for row in rows if row.values.get(kind)}
        large = {case: power for case, power in powers.items() if not power <= ASKED["exponent"]}
        worst = large or ({max(powers, key=lambda case: powers[case]): max(powers.values())} if powers else {})
        measured = ", ".join(f"{power:.2f} ({case})" for case, power in worst.items()) or "-"
        made.append(Target(f"exponents of {kind}", f"at most {ASKED['exponent']:g} each", measured, not large))
    unfinished = [row.case for row in rows if row.values.get("unfinished")]
    return [*made, Target("series without an end", "none", ", ".join(unfinished) or "none", not unfinished)]


SCALE = Bench(
    title="growth",
    about="GROWTH: CPU time and peak memory of work at increasing sizes, each series in a process of its own. Exponents: the power of "
    "the size with which they grow over the 3 largest sizes, 1 for a cost that is proportional to it. Memory: above that of a "
    f"process with all modules; no exponent where it grows by less than {LEAST_MEMORY:g} MB.",
    full=Effort(SERIES, rounds=3),
    quick=Effort(
        tuple(
            replace(one, sizes=tuple(size // 8 for size in one.sizes)) if one.unit != "phases" else one
            for one in SERIES
            if one.name in SHORT
        )
    ),
    prepare=scale_rounds,
    columns=(
        column("largest", "size", "size", form="g"),
        column("seconds", "there", "seconds"),
        column("MB", "there", "MB"),
        ("time", "exponent", lambda row: row.spread("time")),
        ("memory", "exponent", lambda row: row.spread("memory")),
    ),
    targets=scale_targets,
)


# A generation of NSGA-III


def flights(build: Callable[[int], Problem], nodes: int | None, population: int | None, size: int) -> Callable[[int], object]:
    """Runs on shooting; what is None is the size."""
    count = population or size
    method, scheme, problem = NSGA3(population=count, degree="sum"), parse(f"shooting:{nodes or size}"), build(size)
    settings: dict[str, Any] = {"seed": 1, "inner": "propagate", "start": Smooth(), "verify": None, "progress": False}
    return lambda generations: method.solve(problem, scheme, evaluations=count * generations, **settings)


def selections(handling: str, population: int) -> Callable[[int], object]:
    """Runs on a plain function of four objectives, which takes no time: what is left is the selection. About half of a population does not
    meet its constraint in the beginning."""
    method = NSGA3(population=population, handling=handling)
    settings: dict[str, Any] = {"seed": 1, "constraints": lambda X: X.sum(axis=1, keepdims=True) - 0.5 * X.shape[1]}
    return lambda generations: method.minimize(four_goals, [(0.0, 1.0)] * 8, evaluations=population * generations, **settings)


def four_goals(X: np.ndarray) -> np.ndarray:
    """Objectives (k, 4) of vectors (k, d) in the unit box: distances from four of its corners."""
    return np.linalg.norm(X[:, None] - np.eye(X.shape[1])[:4], axis=2)


def reentry(size: int) -> Problem:
    """The same at every size."""
    return load("reentry_case1")


GENERATIONS = (
    Series("re-entry, 200 nodes", "individuals", partial(flights, reentry, 200, None), (120, 240, 480), "Np Nk + M Np^2", 2),
    Series("re-entry, 120 individuals", "nodes", partial(flights, reentry, None, 120), (100, 200, 400, 800), "Np Nk"),
    Series("ride, 240 individuals, 50 nodes", "constraints", partial(flights, limited, 50, 240), (50, 100, 200, 400), "Np I"),
    *(
        Series(f"selection, {name}", "individuals", partial(selections, way), (120, 240, 480, 960), f"M Np^2 + Np log^{power} Np", 2)
        for name, way, power in (("SF", "feasible-first", "(M-2)"), ("PF", "penalty", "(M-2)"), ("MOCH", "objective", "(M-1)"))
    ),
)


def generation_rounds(case: Series, effort: Effort, steps: Steps) -> Callable[[int], Iterable[Row]]:
    """Each round measures a generation at all sizes. No function is compiled: a compiler's time is not proportional to anything."""
    with compiling("0"):
        runs = {size: case.prepare(size) for size in case.sizes}

    def measured(number: int) -> Iterable[Row]:
        with compiling("0"):
            taken = [generation(run) for run in runs.values()]
        return [Row.once(case.name, case.unit, size=case.sizes[-1], seconds=taken[-1], exponent=exponent(case.sizes, taken))]

    return measured


def generation(run: Callable[[int], object]) -> float:
    """CPU seconds of one generation: a ninth-generation run less one of the first alone, so that set-up is not in it; the quickest of three
    each."""
    first, more = (min(cpu_seconds(run, count) for _ in range(3)) for count in (1, 9))
    return (more - first) / 8


def generation_targets(rows: Sequence[Row]) -> list[Target]:
    """No time grows faster than the paper's order says, by the median of its exponents and up to what noise makes."""
    powers, made = {one.name: one.power for one in GENERATIONS}, []
    for row in rows:
        if row.case in powers:
            measured, limit = row.of("exponent"), powers[row.case] + ASKED["generation"]
            made.append(Target(row.case, f"a power of at most {limit:g}", short(measured), measured <= limit))
    return made


def symbols(rows: Sequence[Row]) -> list[str]:
    """What the letters of the orders stand for."""
    return [
        "Np: individuals, Nk: nodes, I: constraints, M: objectives. The orders are limits for large sizes: here costs that do not grow,",
        "and work on whole arrays, make the measured exponents smaller.",
        "",
    ]


GENERATION = Bench(
    title="generation",
    about="GENERATION: CPU time of one generation of NSGA-III at increasing sizes, and the power of the size with which it grows: 1 for "
    "a time that is proportional to it. Selection: of a plain function of M = 4 objectives, with constraints handled in three "
    "ways. The orders are of R. Chai et al., Solving multiobjective constrained trajectory optimization problem by an extended "
    "evolutionary algorithm, IEEE Transactions on Cybernetics 50(4), 2020, section IV-D",
    full=Effort(GENERATIONS, rounds=5),
    quick=Effort(tuple(replace(one, sizes=tuple(4 * size // 5 for size in one.sizes[:3])) for one in GENERATIONS), rounds=2),
    prepare=generation_rounds,
    columns=(
        column("largest", "size", "size", form="g"),
        column("seconds of a", "generation", "seconds"),
        ("exponent", "measured", lambda row: row.spread("exponent")),
        ("order", "of the paper", lambda row: next((one.order for one in GENERATIONS if one.name == row.case), "-")),
        rounds_of("exponent"),
    ),
    targets=generation_targets,
    notes=symbols,
)


def main(name: str, sizes: Sequence[int]) -> None:
    """Measure a series in a process that begins as a copy of this one, so that the memory of imports is not its own."""
    os.environ["MACS_COMPILE"] = "0"  # a compiler is a process of its own, and its time not proportional to anything
    case = next(one for one in SERIES if one.name == name)
    process = get_context("fork").Process(target=measure_apart, args=(case, sizes))
    process.start()
    process.join()


if __name__ == "__main__":
    main(sys.argv[1], [int(size) for size in sys.argv[2:]])
