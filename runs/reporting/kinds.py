"""What a published table may be of: which figures it has, and how ours are made from the fronts of a ground."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from macs.front import Front

from ..measures.indicators import hypervolume_at
from ..measures.scale import Scale
from ..measures.statistics import summarise
from .ground import Ground
from .measuring import samples, spent
from .tables import Cell, Column

Figures = Mapping[str, Cell]
"""A row's figures by key."""
STATISTICS: Mapping[str, Callable[[np.ndarray], float]] = {
    "greatest": np.max,
    "least": np.min,
    "mean": np.mean,
    "standard deviation": lambda values: np.std(values, ddof=1) if len(values) > 1 else np.nan,
    "variance": lambda values: np.var(values, ddof=1) if len(values) > 1 else np.nan,
}


@dataclass(frozen=True)
class Kind:
    """Attributes
    ----------
    columns : mapping
        Key of a figure -> head of its column; None where the keys are names of objectives.
    ours : callable
        (ground, the published table) -> solver -> rows of figures.
    note : callable
        (ground, the published table) -> what there is to say of ours.
    statistics : bool
        Whether each row is one of `STATISTICS`, named by its key "statistic".
    needs : tuple of str
        What else the published table has to say.
    """

    columns: Mapping[str, Column] | None
    ours: Callable[[Ground, Mapping[str, Any]], Mapping[str, Sequence[Figures]]]
    note: Callable[[Ground, Mapping[str, Any]], str]
    statistics: bool = False
    needs: tuple[str, ...] = ()


def _indicators(ground: Ground, paper: Mapping[str, Any]) -> dict[str, list[Figures]]:
    """GD and IGD to the points of the union of all runs, and the time of a run."""
    found, times = samples(ground, ground.union(), curve=False), spent(ground)["time [s]"]
    rows: dict[str, list[Figures]] = {}
    for solver in ground.runs:
        if solver in found["GD"]:
            gd, igd = summarise(found["GD"][solver]), summarise(found["IGD"][solver])
            figures = {"gd_mean": gd.mean, "gd_variance": gd.variance, "igd_mean": igd.mean, "igd_variance": igd.variance}
            seconds = {"seconds": float(np.mean(times[solver]))} if solver in times else {}
            rows[solver] = [figures | seconds]
    return rows


def _against_union(ground: Ground, paper: Mapping[str, Any]) -> str:
    union = ground.union()
    scale = Scale.of(union.front, like=ground.known, what=union.what).describe().split(". Hypervolume")[0]
    return f"{scale[0].lower()}{scale[1:]}; GD and IGD to its points. Variance with divisor n - 1."


def _hypervolume(ground: Ground, paper: Mapping[str, Any]) -> dict[str, list[Figures]]:
    """The volume up to a point in the users' units: best, median and worst of all runs; a failed one has none."""
    rows: dict[str, list[Figures]] = {}
    for solver, fronts in ground.fronts.items():
        values = [hypervolume_at(front, paper["point"]) for front in fronts] + [0.0] * ground.failures.get(solver, 0)
        if values:
            rows[solver] = [{"best": max(values), "median": float(np.median(values)), "worst": min(values)}]
    return rows


def _point(ground: Ground, paper: Mapping[str, Any]) -> str:
    goals = ground.known.goals
    words = ", ".join(
        f"{goal.name} {value:g}{f' {goal.unit}' if goal.unit else ''}" for goal, value in zip(goals, paper["point"], strict=True)
    )
    return f"hypervolume in the objectives' units, up to {words}."


def _objectives(ground: Ground, paper: Mapping[str, Any]) -> dict[str, list[Figures]]:
    """Statistics of each objective over the points of all runs."""
    rows: dict[str, list[Figures]] = {}
    for solver, fronts in ground.fronts.items():
        values = _together(fronts)
        if len(values):
            rows[solver] = [
                {"statistic": name, **{goal.name: float(of(column)) for goal, column in zip(ground.known.goals, values.T, strict=True)}}
                for name, of in STATISTICS.items()
            ]
    return rows


def _together(fronts: Sequence[Front]) -> np.ndarray:
    """Objectives (n, m) of all points, in the users' units and senses."""
    return np.concatenate([front.objectives for front in fronts if len(front)] or [np.empty((0, 0))])


KINDS: Mapping[str, Kind] = {
    "indicators": Kind(
        {
            "gd_mean": Column("mean GD", digits=4),
            "gd_variance": Column("variance", digits=4),
            "igd_mean": Column("mean IGD", digits=4),
            "igd_variance": Column("variance", digits=4),
            "seconds": Column("time", "s", digits=4),
        },
        _indicators,
        _against_union,
    ),
    "hypervolume": Kind({key: Column(key, digits=5) for key in ("best", "median", "worst")}, _hypervolume, _point, needs=("point",)),
    "objectives": Kind(
        None, _objectives, lambda ground, paper: "over the points of all runs; deviation and variance with divisor n - 1.", statistics=True
    ),
}
