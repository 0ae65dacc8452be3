"""Benchmark of one optimum beside peers: the examples of YAPSS, from statement to solution, here, in YAPSS and in rockit, in turn.

The peers are optional: `pip install 'macs-trajectories[peers]'`. Where they are not installed, only ours is measured, and a line says so.
"""

from __future__ import annotations

import importlib
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec

import casadi as ca
import numpy as np

from macs import optimize
from macs.io.console import Steps
from problems import Problem, load
from problems.cases.standard import delta_iii as launcher
from transcription import parse

from .measured import Column, Row, Target, short, table, verdicts
from .rivals import by_rockit

OURS, YAPSS, ROCKIT = "MACS", "YAPSS", "rockit"
ASKED = 1.5
"""Times YAPSS's time, at most."""


@dataclass(frozen=True)
class Example:
    """One problem in all programs."""

    name: str
    problem: Callable[[], Problem]  # ours
    # The transcription of ours: so fine that the optimum is that of YAPSS, or the exact one, to six digits or as many as can be had.
    word: str
    module: str  # module, setup: The example of YAPSS, and its function
    setup: str = "setup"
    rockit: Callable[[], float] | None = None  # its solution in rockit: the optimum


def goddard() -> Problem:
    """Goddard's rocket in one phase, as in the example of YAPSS."""
    problem = Problem("goddard, one phase")
    flight = problem.phase("flight", t0=0.0, tf=(20.0, 100.0))
    h = flight.state("h", bounds=(0, 30000), initial=0, unit="ft", scale=18000.0)
    v = flight.state("v", bounds=(0, 15000), initial=0, unit="ft/s", scale=800.0)
    m = flight.state("m", bounds=(1, 3), initial=3, final=1, unit="slug", scale=3.0)
    thrust = flight.control("thrust", bounds=(0, 193.044), unit="lbf")
    drag = 5.49153484923381010e-05 * v**2 * ca.exp(-h / 23800.0)
    flight.dynamics(h=v, v=(thrust - drag) / m - 32.174, m=-thrust / 1580.9425279876559)
    flight.guess(h=(0, 30000), v=0, m=(3, 1), thrust=(193.044, 0), tf=100.0)
    problem.maximize("height", flight.final(h), unit="ft")
    return problem


def delta_iii() -> Problem:
    """The Delta III with the guess of YAPSS: round the earth at a steady rate, from the pad to the perigee; velocities on a line."""
    problem = load("standard/delta_iii")
    phases = list(problem.phases.values())
    ends = np.array([list(launcher.START.values()), list(launcher.perigee().values())])
    place, speed = ends[:, :3], ends[:, 3:]
    radius = np.linalg.norm(place, axis=1)
    latitude, longitude = np.arcsin(place[:, 2] / radius), np.arctan2(place[:, 1], place[:, 0])
    edges = launcher.TIMES
    for phase, first, last in zip(phases, edges[:-1], edges[1:], strict=True):
        t = np.linspace(first, last, 9)
        r, phi, lam = (np.interp(t, [0.0, edges[-1]], pair) for pair in (radius, latitude, longitude))
        way = (r * np.cos(phi) * np.cos(lam), r * np.cos(phi) * np.sin(lam), r * np.sin(phi))
        pace = [np.interp(t, [0.0, edges[-1]], pair) for pair in speed.T]
        phase.guess(**{axis: (t, along) for axis, along in zip(("x", "y", "z", "vx", "vy", "vz"), (*way, *pace), strict=True)})
    phases[-1].guess(tf=edges[-1])
    return problem


def _standard(name: str, **data: bool) -> Callable[[], Problem]:
    return lambda: load(f"standard/{name}", **data)


EXAMPLES = (
    Example("Delta III", delta_iii, "dfet:5x4", "delta_iii_ascent"),
    Example("minimum time to climb", _standard("climb"), "dfet:15x4", "minimum_time_to_climb"),
    Example("Goddard, one phase", goddard, "dfet:20x4", "goddard_problem_1_phase", rockit=by_rockit.goddard),
    Example("Goddard, three phases", _standard("sounding_rocket", constrained=True), "dfet:6x4", "goddard_problem_3_phase"),
    Example("orbit raising", _standard("orbit_raising"), "dfet:15x4", "orbit_raising", rockit=by_rockit.orbit_raising),
    Example("dynamic soaring", _standard("dynamic_soaring"), "dfet:20x4", "dynamic_soaring"),
    Example("isoperimetric", _standard("isoperimetric"), "dfet:10x4", "isoperimetric", rockit=by_rockit.isoperimetric),
    Example("Newton's nose", _standard("newton_nose"), "dfet:10x4", "newton", "setup2", rockit=by_rockit.newton),
)


@dataclass(frozen=True)
class Effort:
    """Size of a measurement: rounds, and which examples."""

    rounds: int = 5
    examples: tuple[Example, ...] = EXAMPLES


QUICK = Effort(rounds=1, examples=EXAMPLES[4:5] + EXAMPLES[6:])


def missing() -> list[str]:
    """The peers that are not installed."""
    return [name for name in ("yapss", "rockit") if find_spec(name) is None]


def bench_peers(rows: list[Row], effort: Effort) -> None:
    """Measure; `rows` are filled as values become known, also if `Stopped` ends it."""
    with Steps("examples", effort.rounds * len(effort.examples)) as steps:
        for example in effort.examples:
            contenders = list(_contenders(example))
            own = {who: Row(example.name, who) for who, _ in contenders}
            rows += own.values()
            for number in range(effort.rounds):
                steps.begin(f"{example.name}, round {number + 1}")
                for who, solve in contenders:
                    began = time.perf_counter()
                    optimum = solve()
                    seconds = time.perf_counter() - began
                    own[who].add(optimum=optimum, seconds=seconds)
            for row in own.values():
                row.add(ratio=row.of("seconds") / own[YAPSS].of("seconds") if YAPSS in own else np.nan)


def _contenders(example: Example) -> Iterator[tuple[str, Callable[[], float]]]:
    """Names of programs, and what states and solves the example in each."""
    absent = missing()
    yield OURS, lambda: _ours(example)
    if "yapss" not in absent:
        # Imported before the clock starts: it holds tables and pictures, too.
        module = importlib.import_module(f"yapss.examples.{example.module}")
        yield YAPSS, lambda: _yapss(getattr(module, example.setup))
    if "rockit" not in absent and example.rockit is not None:
        solve = example.rockit
        yield ROCKIT, lambda: _silently(solve)


def _ours(example: Example) -> float:
    """The optimum as this program finds it; not a number where it does not converge."""
    # Without a simulation, which the others do not make either.
    point = optimize(example.problem(), parse(example.word), verify=None)
    return next(iter(point.objectives.values())) if point.status == "converged" else np.nan


def _yapss(setup: Callable) -> float:
    problem = setup()
    problem.ipopt_options.print_level = 0
    return _silently(lambda: float(problem.solve().objective))


def _silently(work: Callable[[], float]) -> float:
    with silence():
        return work()


@contextmanager
def silence() -> Iterator[None]:
    """Nothing on the standard output, also from libraries in C."""
    kept, nothing = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nothing, 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nothing)


COLUMNS: tuple[Column, ...] = (
    ("seconds", "statement to solution", lambda row: row.spread("seconds")),
    ("times", "YAPSS's", lambda row: short(row.of("ratio"))),
    ("optimum", "", lambda row: f"{row.of('optimum'):.9g}"),
)


def report(rows: Sequence[Row]) -> str:
    """The table, the targets, and which peers are missing."""
    lines = [
        "PEERS: one optimum from its statement to its solution, in each program in turn; median and quartiles of the rounds.",
        "",
        table(rows, COLUMNS),
        "",
        *verdicts(targets(rows)),
    ]
    absent = missing()
    if absent:
        lines.append(f"not installed: {', '.join(absent)}; for a comparison: pip install 'macs-trajectories[peers]'")
    return "\n".join(lines)


def targets(rows: Sequence[Row]) -> list[Target]:
    """Ours takes little more time than YAPSS, where that is installed, and converges."""
    asked, made = f"at most {ASKED:g} times YAPSS's time", []
    for row in rows:
        if row.who == OURS and row.values.get("ratio"):
            converged = len(row.values["optimum"]) == len(row.values["seconds"])
            value = f"{short(row.of('ratio'))} times" + ("" if converged else ", not converged")
            made.append(Target(row.case, asked, value, converged and row.of("ratio") <= ASKED))
    return made
