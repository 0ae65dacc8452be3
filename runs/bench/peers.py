"""Benchmark of one optimum beside peers: the examples of YAPSS, from statement to solution, here, in YAPSS and in rockit, in turn.

The peers are optional: `pip install 'macs-trajectories[peers]'`. Where they are not installed, only ours is measured, and a line says so.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from math import pi
from typing import Any

import casadi as ca
import numpy as np

from macs import optimize
from macs.io.console import Steps
from problems import Problem, load
from problems.cases.standard import delta_iii as launcher
from transcription import parse

from .contract import ASKED, Bench, Column, Effort, Row, Target, column, short, side_by_side

OURS, YAPSS, ROCKIT = "MACS", "YAPSS", "rockit"


@dataclass(frozen=True)
class Example:
    """One problem in all programs."""

    name: str
    problem: Callable[[], Problem]  # ours
    # The transcription of ours: so fine that the optimum is that of YAPSS, or the exact one, to six digits or as many as can be had.
    word: str
    module: str  # module, setup: the example of YAPSS, and its function
    setup: str = "setup"
    rockit: Callable[[Any], float] | None = None  # rockit -> the optimum, by its solution there


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


# Two of the examples as a user of rockit states them: direct collocation of degree 4, IPOPT as it comes.


def ocp_of(rockit: Any, rates: Sequence[tuple[Any, Any]], starts: Sequence[tuple[Any, float]], ocp: Any) -> None:
    """State rates and initial values."""
    for state, rate in rates:
        ocp.set_der(state, rate)
    for state, value in starts:
        ocp.subject_to(ocp.at_t0(state) == value)


def solved_by(rockit: Any, ocp: Any, objective: Any, guesses: Sequence[tuple[Any, Any]]) -> float:
    """The optimum of what is to be minimised, on 40 elements."""
    for symbol, guess in guesses:
        ocp.set_initial(symbol, guess)
    ocp.add_objective(objective)
    ocp.solver("ipopt", {"ipopt.print_level": 0, "print_time": False})
    ocp.method(rockit.DirectCollocation(N=40))
    return float(ocp.solve().value(objective))


def rockit_goddard(rockit: Any) -> float:
    """Height of Goddard's rocket, in one phase; mass and height in units near one."""
    ocp = rockit.Ocp(t0=0, T=rockit.FreeTime(40))
    h, v, m, thrust = ocp.state(scale=18000), ocp.state(scale=800), ocp.state(scale=3), ocp.control(scale=193.044)
    drag = 5.49153484923381010e-05 * v**2 * ca.exp(-h / 23800.0)
    rates = [(h, v), (v, (thrust - drag) / m - 32.174), (m, -thrust / 1580.9425279876559)]
    ocp_of(rockit, rates, [(h, 0), (v, 0), (m, 3)], ocp)
    ocp.subject_to(ocp.at_tf(m) == 1)
    for value, low, high in ((h, 0, 30000), (v, 0, 15000), (m, 1, 3), (thrust, 0, 193.044)):
        ocp.subject_to(low <= (value <= high))
    ocp.subject_to((ocp.T <= 100) >= 20)
    return -solved_by(rockit, ocp, -ocp.at_tf(h), [(h, 400 * ocp.t), (v, 400), (m, 2), (thrust, 90)])


def rockit_circle(rockit: Any) -> float:
    """The largest area within a closed curve of length 1, which may begin anywhere."""
    ocp = rockit.Ocp(t0=0, T=1)
    x, y = ocp.state(), ocp.state()
    angle = ocp.control(order=1)
    ux, uy = ca.cos(angle), ca.sin(angle)
    ocp_of(rockit, [(x, ux), (y, uy)], [(angle, 0)], ocp)
    for state in (x, y):
        ocp.subject_to(ocp.at_t0(state) == ocp.at_tf(state))
        ocp.subject_to(ocp.integral(state) == 0)
    return -solved_by(rockit, ocp, -ocp.integral((y * ux - x * uy) / 2), [(angle, -2 * pi * ocp.t)])


def standard(name: str, **data: bool) -> Callable[[], Problem]:
    """A published problem."""
    return partial(load, f"standard/{name}", **data)


EXAMPLES = (
    Example("Delta III", delta_iii, "dfet:5x4", "delta_iii_ascent"),
    Example("minimum time to climb", standard("climb"), "dfet:15x4", "minimum_time_to_climb"),
    Example("Goddard, one phase", goddard, "dfet:20x4", "goddard_problem_1_phase", rockit=rockit_goddard),
    Example("Goddard, three phases", standard("sounding_rocket", constrained=True), "dfet:6x4", "goddard_problem_3_phase"),
    Example("orbit raising", standard("orbit_raising"), "dfet:15x4", "orbit_raising"),
    Example("dynamic soaring", standard("dynamic_soaring"), "dfet:20x4", "dynamic_soaring"),
    Example("isoperimetric", standard("isoperimetric"), "dfet:10x4", "isoperimetric", rockit=rockit_circle),
    Example("Newton's nose", standard("newton_nose"), "dfet:10x4", "newton", "setup2"),
)


def missing() -> list[str]:
    """The peers that are not installed."""
    return [name for name in ("yapss", "rockit") if find_spec(name) is None]


def rounds(example: Example, effort: Effort, steps: Steps) -> Callable[[int], Iterable[Row]]:
    """Each round states and solves the example in each program."""
    # Imported before the clock runs: the modules of YAPSS hold tables and pictures, too.
    programs: dict[str, Callable[[], float]] = {OURS: partial(by_macs, example)}
    absent = missing()
    if "yapss" not in absent:
        module = importlib.import_module(f"yapss.examples.{example.module}")
        programs[YAPSS] = partial(by_yapss, getattr(module, example.setup))
    if "rockit" not in absent and example.rockit is not None:
        programs[ROCKIT] = partial(silently, partial(example.rockit, importlib.import_module("rockit")))

    def measured(number: int) -> Iterable[Row]:
        timed = side_by_side(programs, number)
        return [Row.once(example.name, who, seconds=seconds, optimum=optimum) for who, (seconds, optimum) in timed.items()]

    return measured


def by_macs(example: Example) -> float:
    """The optimum as this program finds it, without a simulation, which the others do not make either; NaN where it does not converge."""
    point = optimize(example.problem(), parse(example.word), verify=None)
    return next(iter(point.objectives.values())) if point.status == "converged" else np.nan


def by_yapss(setup: Callable[[], Any]) -> float:
    """The optimum of an example of YAPSS."""
    problem = setup()
    problem.ipopt_options.print_level = 0
    return silently(lambda: float(problem.solve().objective))


def silently(work: Callable[[], float]) -> float:
    """The result of work that prints nothing."""
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


def ratio(rows: Sequence[Row], row: Row) -> float:
    """Median time as a multiple of YAPSS's on the same example; NaN without YAPSS."""
    return next((row.of("seconds") / other.of("seconds") for other in rows if (other.case, other.who) == (row.case, YAPSS)), np.nan)


def targets(rows: Sequence[Row]) -> list[Target]:
    """Ours takes little more time than YAPSS, where that is installed, and converges in every round."""
    made = []
    for row in rows:
        times = ratio(rows, row)
        if row.who == OURS and np.isfinite(times):
            converged = len(row.values["optimum"]) == len(row.values["seconds"])
            value = f"{short(times)} times" + ("" if converged else ", not converged")
            asked = f"at most {ASKED['peers']:g} times YAPSS's time"
            made.append(Target(row.case, asked, value, converged and times <= ASKED["peers"]))
    return made


def absent_peers(rows: Sequence[Row]) -> list[str]:
    """Which peers are missing."""
    absent = missing()
    return [f"not installed: {', '.join(absent)}; for a comparison: pip install 'macs-trajectories[peers]'"] if absent else []


def columns(rows: Sequence[Row]) -> tuple[Column, ...]:
    """The columns of the table, of which one has ratios to another row."""
    return (
        ("seconds", "statement to solution", lambda row: row.spread("seconds")),
        ("times", "YAPSS's", lambda row: short(ratio(rows, row))),
        column("optimum", "", "optimum", form=".9g"),
    )


PEERS = Bench(
    title="examples",
    about="PEERS: one optimum from its statement to its solution, in each program in turn; median and quartiles of the rounds.",
    full=Effort(EXAMPLES, rounds=5),
    quick=Effort(EXAMPLES[4:5] + EXAMPLES[6:]),
    prepare=rounds,
    columns=columns,
    targets=targets,
    notes=absent_peers,
)
