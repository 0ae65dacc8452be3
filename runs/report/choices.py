"""The choices of runs that decide: what was chosen, how well it satisfies each objective, the steps of loops, and the flights."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from typing import TYPE_CHECKING, Any

import numpy as np

from macs.decisions import FuzzySatisfactory, Preference, Ranges, from_dict
from macs.fronts.pictures.style import COLORS
from macs.fronts.point import Point
from macs.io.text import label
from macs.preferences.pictures import draw_degrees

from .comparison import Comparison
from .flights import case_figures, flights_figure
from .plots import COLUMN, PAGE, legend, new_figure, style
from .tables import Cell, Head, Table, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from problems.compiled import Objective

SINGLE = ("Decide", "Optimum", "Payoff")
"""Solvers that return single points, and no front, by the names that cells record."""
SIDE_BY_SIDE = 5
"""Most choices of one figure, of degrees or of flights: more would be too narrow on a page."""


@dataclass(frozen=True, eq=False)
class RunChoice:
    """One choice of a run."""

    solver: str
    label: str
    point: Point
    objectives: np.ndarray  # (m,): As simulated where the point is verified, else as the transcription has them
    preference: Preference
    ranges: Ranges  # by which objectives were normalised
    steps: Sequence[Mapping[str, Any]]  # of the solves that led to it, see `macs.decisions.Step`
    message: str

    def degrees(self, by: Preference | None = None, ranges: Ranges | None = None) -> np.ndarray:
        """How well each objective is satisfied (m,), by its own preference or another one."""
        return (by or self.preference).degrees(self.point.goals, ranges or self.ranges, self.objectives[None])[0]


def chosen(comparison: Comparison) -> list[RunChoice]:
    """All choices of a comparison, solver by solver and run by run. Empty where nothing was chosen."""
    found = []
    for solver, runs in comparison.runs.items():
        for run in runs:
            stats = run.front.stats
            for point, about in zip(run.front, stats["choices"], strict=True) if "choices" in stats else ():
                values = point.simulated if point.verified and point.simulated is not None else point.objectives
                name = about["label"] if len(runs) == 1 else f"{about['label']} (run {run.number})"
                made = from_dict(about["preference"])
                J, ranges = np.array(list(values.values())), Ranges(**stats["ranges"])
                found.append(RunChoice(solver, name, point, J, made, ranges, about["steps"], about["message"]))
    return found


def only_single_points(comparison: Comparison) -> bool:
    """Whether all its solvers return single points, so that there are no fronts to compare."""
    return all(run.cell.details["solver"]["name"] in SINGLE for runs in comparison.runs.values() for run in runs)


def choices_tables(comparison: Comparison, study: Mapping[str, Any]) -> dict[str, Table]:
    """The choices, and the steps of those that took several. Empty where nothing was chosen."""
    every = chosen(comparison)
    if not every:
        return {}
    goals, first = every[0].point.goals, {one.solver: one for one in reversed(every)}
    verified = {True: "yes", False: "no", None: "-"}
    heads: list[Head | str] = [Head("solver", grouped=True), "choice", *_objectives(goals), *_degrees(goals), "verified"]
    rows = [[one.solver, one.label, *one.objectives.tolist(), *_numbers(one.degrees()), verified[one.point.verified]] for one in every]
    notes = ["Degrees are those of the preference that chose. " + " ".join(map(_ranges, reversed(first.values())))]
    notes += [f"{one.solver}, {one.label}: {one.message}." for one in every if one.message]
    found = {"choices": table(heads, rows, f"{comparison.name}: what was chosen.", notes)}
    steps = [(one, step) for one in every if len(one.steps) > 1 for step in one.steps]
    if steps:
        about = list(dict.fromkeys(name for _, step in steps for name in step["about"]))
        heads = [Head("solver", grouped=True), Head("choice", grouped=True), "step", *(Head(name, digits=4) for name in about)]
        heads += [Head("value", digits=5), *_objectives(goals), *_degrees(goals), "status"]
        rows = [
            [
                *(one.solver, one.label, step["name"]),
                *(step["about"].get(name) for name in about),
                *(step["value"], *(step["objectives"][goal.name] for goal in goals)),
                *_numbers(step["degrees"][goal.name] for goal in goals),
                step["status"],
            ]
            for one, step in steps
        ]
        note = "Objectives are what the solve of a step found; kappa is that of the best point known by then, which may be another."
        found["steps"] = table(heads, rows, f"{comparison.name}: steps of the choices that took several.", [note])
    return found


def choices_figures(comparison: Comparison) -> dict[str, Figure]:
    """{name of a file: figure} of the degrees of choices by one preference, and of their flights, beside each other."""
    every, found = chosen(comparison), dict[str, Any]()
    for solver in dict.fromkeys(one.solver for one in every):
        mine = [one for one in every if one.solver == solver]
        found |= {f"lambda-{solver}-{k}": figure for k, figure in enumerate(lambda_figures(mine), 1)}
        size = ceil(len(mine) / ceil(len(mine) / SIDE_BY_SIDE))
        for number, part in enumerate((mine[k : k + size] for k in range(0, len(mine), size)), 1):
            stem = solver if len(mine) == size else f"{solver}-{number}"
            found[f"degrees-{stem}"] = degrees_figure(part, mine[0])
            if all(one.point.trajectory is not None for one in part):
                points = [one.point for one in part]
                found[f"flights-{stem}"] = flights_figure(points, names=[one.label for one in part])
                found |= {f"{name}-{stem}": figure for name, figure in case_figures(points).items()}
    return found


def lambda_figures(every: Sequence[RunChoice]) -> list[Figure]:
    """Memberships and kappa over lambda, a figure for each order of priority of which there are at least three choices."""
    by_order = dict[Any, dict[float, np.ndarray]]()
    for one in every:
        if isinstance(by := one.preference, FuzzySatisfactory) and not by.ordered:
            kappa = by.kappa(one.point.goals, one.ranges, one.objectives[None])
            by_order.setdefault(by.priorities, {}).setdefault(by.regulating, np.concatenate([one.degrees(), kappa]))
    found = []
    for priorities, values in by_order.items():
        if len(values) >= 3:
            with style():
                figure = new_figure(COLUMN, 2.7)
                ax = figure.subplots()
                names, weights = [*(goal.name for goal in every[0].point.goals), "kappa"], sorted(values)
                for name, color, line in zip(names, COLORS, zip(*(values[weight] for weight in weights), strict=True), strict=False):
                    ax.plot(weights, line, "o-", ms=3, lw=1.2, color=color, label=name)
                ax.axhline(0.0, color="black", lw=0.6)
                ax.set(xlabel="lambda", ylabel="membership, kappa")
                legend(figure, ax, f"first priority: {' and '.join(priorities[0])}")
            found.append(figure)
    return found


def degrees_figure(every: Sequence[RunChoice], first: RunChoice) -> Figure:
    """Degrees of some choices as bars beside each other, by the preference of the first of all."""
    by, goals = first.preference, first.point.goals
    with style():
        figure = new_figure(PAGE, 3.0)
        degrees = {one.label: one.degrees(by, first.ranges) for one in every}
        ax = draw_degrees(degrees, [goal.name for goal in goals], by.DEGREE, by.MARKS, by.SMALLER, ax=figure.subplots())
        if (beside := ax.get_legend()) is not None:
            beside.remove()  # its columns do not know how long names are
        legend(figure, ax)
    return figure


def _objectives(goals: Sequence[Objective]) -> list[Head]:
    return [Head(goal.name, goal.unit, digits=5) for goal in goals]


def _degrees(goals: Sequence[Objective]) -> list[Head]:
    return [Head(f"degree of {goal.name}", digits=4) for goal in goals]


def _numbers(degrees: Iterable[float]) -> list[Cell]:
    return [None if np.isnan(one) else float(one) for one in degrees]


def _ranges(first: RunChoice) -> str:
    """The ranges by which a solver normalised objectives."""
    best, worst = first.ranges.best, first.ranges.worst
    ends = [f"{label(goal.name, goal.unit)} {best[goal.name]:.5g} to {worst[goal.name]:.5g}" for goal in first.point.goals]
    return f"Ranges of {first.solver}, best to worst: {', '.join(ends)}."
