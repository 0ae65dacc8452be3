"""Benchmark of density meshes: multiple shooting on equal intervals, and on as many that follow the density of the trajectory."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
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

from .contract import Bench, Effort, Row, column, short

EQUAL, DENSE = "equal", "density"


@dataclass(frozen=True)
class MeshCase:
    """An optimum to be found on a mesh: the problem, the word of its transcription, the objective (the first one if empty), and the true
    value where it is known by other means than `published`."""

    problem: str
    word: str
    objective: str = ""
    known: float = np.nan

    @property
    def name(self) -> str:
        """Of its rows."""
        return f"{self.problem.removeprefix(STANDARD)}{f', {self.objective}' if self.objective else ''}, {self.word}"

    @property
    def truth(self) -> float:
        """The true value, as the user sees it."""
        return published(self.problem.removeprefix(STANDARD))[0].value if self.problem.startswith(STANDARD) else self.known


def word(count: int, steps: int = 1) -> str:
    """Multiple shooting on so many intervals of each phase, by steps of rk4, with linear controls."""
    return f"multiple-shooting:{count}{f'x{steps}' if steps > 1 else ''}:linear"


EASY = ("van_der_pol", "climb", "catalyst_mixing", "rayleigh", "batch_reactor", "rocket")
CASES = (
    *(MeshCase(STANDARD + "hypersensitive", word(count, 7)) for count in (20, 40)),
    *(MeshCase(STANDARD + name, word(count)) for name in EASY for count in (20, 40, 80)),
    *(MeshCase(STANDARD + "robot_arm", word(count)) for count in (20, 40)),
    *(MeshCase("goddard", word(count), "horizontal speed", float(goddard.reference(2)[-1, 1])) for count in (20, 40)),
    *(MeshCase("goddard", word(count), "flight time", goddard.shortest_time()) for count in (20, 40)),
)


def rounds(case: MeshCase, effort: Effort, steps: Steps) -> Callable[[int], Iterable[Row]]:
    """A round finds the optimum on equal intervals and, if that converges, from there on those of at most three meshes by the density."""

    def measured(number: int) -> Iterable[Row]:
        problem = load(case.problem)
        goal = case.objective or next(iter(problem.objectives))
        point = optimize(problem, parse(case.word), objective=goal, verify=None)
        yield Row.once(case.name, EQUAL, **simulated(problem, point, goal, case.truth))
        if point.status == "converged":
            dense = Front.of(point.alone()).refine_mesh(more=False, limit=3)[0]
            yield Row.once(case.name, DENSE, **simulated(problem, dense, goal, case.truth))

    return measured


def simulated(problem: Problem, point: Point, goal: str, truth: float) -> dict[str, float]:
    """What a simulation shows of an optimum: the largest defect of all states, and of each, in units of what it does, and the error of the
    objective, relative to its true value."""
    if point.trajectory is None or point.status != "converged":
        return {}
    check = point.simulate(rtol=1e-11, atol=1e-13)
    defects: dict[str, float] = {}
    for name, phase in point.trajectory.items():
        away = np.abs(check.trajectory[name].edge_states - phase.edge_states).max(axis=0) / state_scales(phase)
        defects |= {f"defect of {name}.{v.name}": float(one) for v, one in zip(phase.state_variables, away, strict=True)}
    value = point.objectives[goal]
    error = (value - truth) / abs(truth) if truth else value - truth
    return {"defect": max(defects.values()), "objective": value, "error": error, "violation": check.violation, **defects}


def worst(row: Row) -> str:
    """The state of the largest defect."""
    defects = {name: row.of(name) for name in row.values if name.startswith("defect of ")}
    return max(defects, key=lambda name: defects[name]).removeprefix("defect of ") if defects else "-"


def better(rows: Sequence[Row]) -> list[str]:
    """On how many meshes the density has the smaller defect. What it is worth depends on the trajectory, so that nothing is asked."""
    defects = {(row.case, row.who): row.of("defect") for row in rows if row.values.get("defect")}
    ratios = [defects[case, EQUAL] / defects[case, DENSE] for case, who in defects if who == DENSE and (case, EQUAL) in defects]
    median = short(float(np.median(ratios))) if ratios else "-"
    return [f"smaller defect by the density: {sum(one > 1.0 for one in ratios)} of {len(ratios)}; median ratio {median}"]


DENSITY = Bench(
    title="density meshes",
    about="DENSITY MESHES: multiple shooting by one step of rk4 (more where the word says so) on equal intervals, and on as many that "
    "follow the density of the trajectory, after at most 3 meshes. Defect: of the simulation at the ends of steps, in units of "
    "what states do. Error: of the objective on the mesh, relative to the true one.",
    full=Effort(CASES),
    quick=Effort((MeshCase(STANDARD + "van_der_pol", word(20)), MeshCase(STANDARD + "hypersensitive", word(20, 7)))),
    prepare=rounds,
    columns=(
        column("defect", "", "defect"),
        ("worst", "state", worst),
        column("objective", "", "objective", form=".8g"),
        column("error", "", "error"),
        column("violation", "simulated", "violation"),
    ),
    notes=better,
)
