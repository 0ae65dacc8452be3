"""Benchmark of density meshes: multiple shooting on equal intervals, and on as many that follow the density of the trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from macs import Front, Point, optimize
from macs.io.console import Steps
from problems import Problem, load
from problems.cases import goddard
from problems.cases.standard import published
from problems.catalogue import STANDARD
from transcription import parse
from transcription.meshes.errors import state_scales
from transcription.trajectories.trajectory import PhaseTrajectory

from .measured import Column, Row, Target, short, table

EQUAL, DENSE = "equal", "density"
MESHES = 3
"""Most meshes that follow the density, each that of the trajectory before."""
ACCURACY = 1e-11
"""Of the simulations."""
TURN = 0.05
"""Part of its range by which a control has to go back to have turned round."""


@dataclass(frozen=True)
class Flight:
    """An optimum to be found on meshes: the problem, the objective (the first one if empty), the words of the transcriptions, and the true
    value where it is known by other means than `published`."""

    problem: str
    words: tuple[str, ...]
    objective: str = ""
    truth: float = np.nan

    @property
    def name(self) -> str:
        """Of its rows."""
        return self.problem.removeprefix(STANDARD) + (f", {self.objective}" if self.objective else "")

    def true(self) -> float:
        """The true value, as the user sees it; NaN if it is not known."""
        known = published(self.problem.removeprefix(STANDARD)) if self.problem.startswith(STANDARD) else ()
        return known[0].value if known else self.truth


def on(*counts: int, steps: int = 1) -> tuple[str, ...]:
    """Words for so many intervals of each phase, with linear controls."""
    return tuple(f"multiple-shooting:{count}{f'x{steps}' if steps > 1 else ''}:linear" for count in counts)


CASES = (
    Flight(STANDARD + "hypersensitive", on(20, 40, steps=7)),
    Flight(STANDARD + "van_der_pol", on(20, 40, 80)),
    Flight(STANDARD + "climb", on(20, 40, 80)),
    Flight(STANDARD + "catalyst_mixing", on(20, 40, 80)),
    Flight(STANDARD + "rayleigh", on(20, 40, 80)),
    Flight(STANDARD + "batch_reactor", on(20, 40, 80)),
    Flight(STANDARD + "rocket", on(20, 40, 80)),
    Flight(STANDARD + "robot_arm", on(20, 40)),
    Flight("goddard", on(20, 40), "horizontal speed", float(goddard.reference(2)[-1, 1])),
    Flight("goddard", on(20, 40), "flight time", goddard.shortest_time()),
)
QUICK = (Flight(STANDARD + "van_der_pol", on(20)), Flight(STANDARD + "hypersensitive", on(20, steps=7)))


def bench_density(rows: list[Row], cases: Sequence[Flight] = CASES) -> None:
    """Measure all cases; `rows` are filled as values become known, also if `Stopped` ends it."""
    tasks = [(case, word) for case in cases for word in case.words]
    with Steps("density meshes", len(tasks)) as steps:
        for case, word in tasks:
            steps.begin(f"{case.name}, {word}")
            rows += compared(case, word)


def compared(case: Flight, word: str) -> list[Row]:
    """The rows of one transcription: the optimum on equal intervals and, if it was found, from there on those by the density."""
    problem, found = load(case.problem), [Row(f"{case.name}, {word}", EQUAL), Row("", DENSE)]
    goal = case.objective or next(iter(problem.objectives))
    point = optimize(problem, parse(word), objective=goal, verify=None)
    found[0].add(**measured(problem, point, goal, case.true()))
    found[1].case = found[0].case
    if point.status == "converged":
        again = Front.of(point.alone()).refine_mesh(more=False, limit=MESHES)[0]
        found[1].add(**measured(problem, again, goal, case.true()))
    return found


def measured(problem: Problem, point: Point, goal: str, truth: float) -> dict[str, float]:
    """What a simulation shows of an optimum: the largest defect of all states, and of each, in units of what it does; the error of the
    objective, relative to its true value; how often controls turn round."""
    if point.trajectory is None or point.status != "converged":
        return {}
    check = point.simulate(rtol=ACCURACY, atol=1e-2 * ACCURACY)
    defects: dict[str, float] = {}
    for name, phase in point.trajectory.items():
        away = np.abs(check.trajectory[name].edge_states - phase.edge_states).max(axis=0) / state_scales(phase)
        defects |= {f"defect of {name}.{v.name}": float(one) for v, one in zip(phase.state_variables, away, strict=True)}
    value = point.objectives[goal]
    return {
        "defect": max(defects.values()),
        "objective": value,
        "error": (value - truth) / abs(truth) if truth else value - truth,
        "violation": check.violation,
        "turns": float(sum(turns(phase) for phase in point.trajectory.values())),
        **defects,
    }


def turns(phase: PhaseTrajectory) -> int:
    """How often the controls of a phase turn round, by at least a part `TURN` of their range: a few times where they follow an optimum,
    from node to node where they chatter."""
    values = phase.control.ends()[0]
    found = 0
    for one in values.T:
        needed, direction, last = TURN * float(np.ptp(one)), 0, float(one[0])
        for value in one[1:].tolist():
            if abs(value - last) < needed or needed == 0.0:
                # It goes on in its direction, or has not gone back far enough.
                last = value if direction * (value - last) > 0 else last
                continue
            now = 1 if value > last else -1
            found += direction * now < 0
            direction, last = now, value
    return found


def report(rows: Sequence[Row]) -> str:
    """The measured values."""
    pairs = [(one, other) for one, other in zip(rows[::2], rows[1::2], strict=False) if one.values and other.values]
    ratios = np.array([one.of("defect") / other.of("defect") for one, other in pairs])
    better = int((ratios > 1.0).sum())
    lines = [
        "DENSITY MESHES: multiple shooting by one step of rk4 (more where the word says so) on equal intervals, and on as many",
        f"that follow the density of the trajectory, after at most {MESHES} meshes. Defect: of the simulation at the ends of steps, in",
        "units of what states do. Error: of the objective on the mesh, relative to the true one. Turns: how often controls go back by",
        f"{TURN:g} of their range.",
        "",
        table(rows, COLUMNS),
        "",
        f"smaller defect by the density: {better} of {len(pairs)}; median ratio {short(float(np.median(ratios))) if len(pairs) else '-'}",
    ]
    return "\n".join(lines)


def targets(rows: Sequence[Row]) -> list[Target]:
    """None: what the density is worth depends on the trajectory, and on some it is worth nothing."""
    return []


def worst(row: Row) -> str:
    """The state of the largest defect."""
    found = {name: row.of(name) for name in row.values if name.startswith("defect of ")}
    return max(found, key=lambda name: found[name]).removeprefix("defect of ") if found else "-"


COLUMNS: tuple[Column, ...] = (
    ("defect", "", lambda row: row.spread("defect")),
    ("worst", "state", worst),
    ("objective", "", lambda row: f"{row.of('objective'):.8g}"),
    ("error", "", lambda row: row.spread("error")),
    ("violation", "simulated", lambda row: row.spread("violation")),
    ("turns", "", lambda row: row.spread("turns")),
)
