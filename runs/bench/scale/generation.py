"""Benchmark of one generation of NSGA-III: how its time grows with the population, the nodes of shooting and the constraints."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from macs import NSGA3
from macs.io.console import Steps
from problems import Problem, load
from transcription import Smooth, parse

from ..measured import Column, Row, Target, short, table, verdicts
from .growth import exponent

SOURCE = (
    "R. Chai et al., Solving multiobjective constrained trajectory optimization problem by an extended evolutionary algorithm,",
    "IEEE Transactions on Cybernetics 50(4), 2020, section IV-D",
)
GENERATIONS, REPEATS = 8, 3
"""After the first: their time is the difference of a run of so many more and one of the first alone, so that set-up is not in it. Each is
measured so often in a round, and the quickest counts."""
NOISE = 0.15
"""What noise may add to the median of exponents."""
HANDLING = {"SF": "feasible-first", "PF": "penalty", "MOCH": "objective"}
"""The paper's ways of handling constraints."""


@dataclass(frozen=True)
class Growing:
    """A run at several sizes."""

    name: str  # name, unit: What is searched, and what is counted
    unit: str
    paper: str  # the order of the paper, in which Np is the population, Nk the nodes, I the constraints and M the objectives
    power: float  # the largest power of the size in it, logarithms left out
    prepare: Callable[[int], Callable[[int], object]]  # size -> a function of the number of generations that runs them
    sizes: tuple[int, ...]
    quick: tuple[int, ...]


@dataclass(frozen=True)
class Effort:
    """Rounds, in each of which all sizes are measured once; whether sizes are the quick ones."""

    rounds: int = 5
    quick: bool = False


FULL, QUICK = Effort(), Effort(rounds=2, quick=True)


def flights(problem: Problem, nodes: int, population: int) -> Callable[[int], object]:
    """Runs on shooting."""
    method, scheme = NSGA3(population=population, degree="sum"), parse(f"shooting:{nodes}")

    def run(generations: int) -> object:
        budget = population * generations
        return method.solve(problem, scheme, evaluations=budget, seed=1, inner="propagate", start=Smooth(), verify=None, progress=False)

    return run


def limited(count: int) -> Problem:
    """A ride of a point mass with so many path constraints."""
    problem = Problem(f"ride with {count} limits")
    ride = problem.phase("ride", t0=0.0, tf=(1.0, 5.0))
    x = ride.state("x", bounds=(-10.0, 10.0), initial=0.0)
    v = ride.state("v", bounds=(-10.0, 10.0), initial=0.0)
    u = ride.control("u", bounds=(-1.0, 1.0))
    ride.dynamics(x=v, v=u)
    for i in range(count):
        ride.path(f"limit {i}", v + 0.01 * i * x * x, upper=5.0)
    problem.minimize("time", ride.tf)
    problem.maximize("way", ride.final(x))
    return problem


def selections(handling: str) -> Callable[[int], Callable[[int], object]]:
    """Runs on a plain function of four objectives, which takes no time: what is left is the selection."""

    def prepare(population: int) -> Callable[[int], object]:
        method = NSGA3(population=population, handling=handling)

        def run(generations: int) -> object:
            return method.minimize(four_goals, [(0.0, 1.0)] * 8, evaluations=population * generations, seed=1, constraints=near)

        return run

    return prepare


def four_goals(X: np.ndarray) -> np.ndarray:
    """Objectives (k, 4) of vectors (k, d) in the unit box: distances from four of its corners."""
    corners = np.eye(X.shape[1])[:4]
    return np.linalg.norm(X[:, None] - corners, axis=2)


def near(X: np.ndarray) -> np.ndarray:
    """Constraints (k, 1), at most 0, that about half of the vectors of a population do not meet in the beginning."""
    return X.sum(axis=1, keepdims=True) - 0.5 * X.shape[1]


POPULATIONS, SMALL = (120, 240, 480, 960), (60, 120, 240)
NODES, LIMITS = (100, 200, 400, 800), (50, 100, 200, 400)
SERIES = (
    Growing(
        "re-entry, 200 nodes", "individuals", "Np Nk + M Np^2", 2, lambda n: flights(load("reentry_case1"), 200, n), POPULATIONS[:3], SMALL
    ),
    Growing("re-entry, 120 individuals", "nodes", "Np Nk", 1, lambda n: flights(load("reentry_case1"), n, 120), NODES, (80, 160, 320)),
    Growing("ride, 240 individuals, 50 nodes", "constraints", "Np I", 1, lambda n: flights(limited(n), 50, 240), LIMITS, (20, 40, 80)),
    *(
        Growing(f"selection, {name}", "individuals", f"M Np^2 + Np log^{order} Np", 2, selections(handling), POPULATIONS, SMALL)
        for (name, handling), order in zip(HANDLING.items(), ("(M-2)", "(M-2)", "(M-1)"), strict=True)
    ),
)


@contextmanager
def interpreted() -> Iterator[None]:
    """A context in which no function is compiled: a compiler's time is not proportional to anything."""
    before = os.environ.get("MACS_COMPILE")
    os.environ["MACS_COMPILE"] = "0"
    try:
        yield
    finally:
        if before is None:
            del os.environ["MACS_COMPILE"]
        else:
            os.environ["MACS_COMPILE"] = before


def bench_generation(rows: list[Row], effort: Effort, series: Sequence[Growing] = SERIES) -> None:
    """Measure all series; `rows` are filled as values become known, also if `Stopped` ends it."""
    with Steps("generation", effort.rounds * len(series)) as steps, interpreted():
        for one in series:
            sizes = one.quick if effort.quick else one.sizes
            runs = {size: one.prepare(size) for size in sizes}
            row = Row(one.name, one.unit)
            rows.append(row)
            for i in range(effort.rounds):
                steps.begin(f"{one.name}, round {i + 1}")
                taken = [generation(runs[size]) for size in sizes]
                row.add(size=sizes[-1], seconds=taken[-1], exponent=exponent(np.array(sizes, dtype=float), np.array(taken)))


def generation(run: Callable[[int], object]) -> float:
    """CPU seconds of one generation."""
    first, more = (min(_seconds(run, count) for _ in range(REPEATS)) for count in (1, 1 + GENERATIONS))
    return (more - first) / GENERATIONS


def _seconds(run: Callable[[int], object], generations: int) -> float:
    began = time.process_time()
    run(generations)
    return time.process_time() - began


def targets(rows: Sequence[Row]) -> list[Target]:
    """No time grows faster than the paper's order says, by the median of its exponents and up to what noise makes."""
    powers = {one.name: one.power for one in SERIES}
    made = []
    for row in rows:
        if row.case in powers:
            measured, limit = row.of("exponent"), powers[row.case] + NOISE
            made.append(Target(row.case, f"a power of at most {limit:g}", short(measured), measured <= limit))
    return made


def report(rows: Sequence[Row]) -> str:
    """The measured exponents beside the orders of the paper."""
    orders = {one.name: one.paper for one in SERIES}
    columns: tuple[Column, ...] = (
        ("largest", "size", lambda row: f"{row.of('size'):g}" if row.values.get("size") else "-"),
        ("seconds of a", "generation", lambda row: short(row.of("seconds"))),
        ("exponent", "measured", lambda row: row.spread("exponent")),
        ("order", "of the paper", lambda row: orders.get(row.case, "-")),
    )
    lines = [
        "GENERATION: CPU time of one generation of NSGA-III at increasing sizes, and the power of the size with which it grows: 1 for a",
        "time that is proportional to it. Selection: of a plain function of M = 4 objectives, with constraints handled in three ways. The",
        "orders are of",
        *SOURCE,
        "",
        table(rows, columns),
        "",
        "Np: individuals, Nk: nodes, I: constraints, M: objectives. The orders are limits for large sizes: here costs that do not grow,",
        "and work on whole arrays, make the measured exponents smaller.",
        "",
        *verdicts(targets(rows)),
    ]
    return "\n".join(lines)
