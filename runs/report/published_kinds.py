"""What a published table may be of: which figures it has, and how ours are made from the fronts of a comparison."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from macs.front import Front
from problems.checks import unknown

from ..batch.file import is_number
from ..measures.indicators import hypervolume_at
from ..measures.scale import Scale
from ..measures.simulation_record import Ends
from ..measures.statistics import summarise
from .comparison import Comparison
from .run_measures import samples, spent
from .tables import Cell, Column

if TYPE_CHECKING:
    from problems.compiled import CompiledProblem

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
    columns : callable
        the published table -> {key of a figure: head of its column}; None where the keys are names of objectives.
    ours : callable
        (comparison, the published table) -> solver -> rows of figures.
    note : callable
        (comparison, the published table) -> what there is to say of ours.
    statistics : bool
        Whether each row is one of `STATISTICS`, named by its key "statistic".
    needs : mapping
        What else the published table has to say -> what raises ValueError if that makes no sense.
    fits : callable
        (the published table, one of its problems) raises ValueError if what it needs is not of such a problem.
    population : bool
        Whether ours are of solvers with a population alone.
    """

    columns: Callable[[Mapping[str, Any]], Mapping[str, Column] | None]
    ours: Callable[[Comparison, Mapping[str, Any]], Mapping[str, Sequence[Figures]]]
    note: Callable[[Comparison, Mapping[str, Any]], str]
    statistics: bool = False
    needs: Mapping[str, Callable[[Any], None]] = field(default_factory=dict)
    fits: Callable[[Mapping[str, Any], CompiledProblem], None] = lambda paper, problem: None
    population: bool = False


def _indicators(comparison: Comparison, paper: Mapping[str, Any]) -> dict[str, list[Figures]]:
    """GD and IGD to the points of the union of all runs, and the time of a run."""
    union, times = comparison.union(), spent(comparison)["time [s]"]
    found = samples(comparison, union, curve=False) if len(union.front) else {"GD": {}, "IGD": {}}
    rows: dict[str, list[Figures]] = {}
    for solver in comparison.runs:
        if solver in found["GD"]:
            gd, igd = summarise(found["GD"][solver]), summarise(found["IGD"][solver])
            figures = {"gd_mean": gd.mean, "gd_variance": gd.variance, "igd_mean": igd.mean, "igd_variance": igd.variance}
            seconds = {"seconds": float(np.mean(times[solver]))} if solver in times else {}
            rows[solver] = [figures | seconds]
    return rows


def _against_union(comparison: Comparison, paper: Mapping[str, Any]) -> str:
    union = comparison.union()
    if not len(union.front):
        return "no run found a point."
    scale = Scale.of(union.front, like=comparison.known, what=union.what).describe().split(". Hypervolume")[0]
    return f"{scale[0].lower()}{scale[1:]}; GD and IGD to its points. Variance with divisor n - 1."


def _hypervolume(comparison: Comparison, paper: Mapping[str, Any]) -> dict[str, list[Figures]]:
    """The volume up to a point in the users' units: best, median and worst of all runs; a failed one has none."""
    rows: dict[str, list[Figures]] = {}
    for solver, fronts in comparison.fronts.items():
        values = [hypervolume_at(front, paper["point"]) for front in fronts] + [0.0] * comparison.failures.get(solver, 0)
        if values:
            rows[solver] = [{"best": max(values), "median": float(np.median(values)), "worst": min(values)}]
    return rows


def _point(comparison: Comparison, paper: Mapping[str, Any]) -> str:
    goals = comparison.known.goals
    words = ", ".join(
        f"{goal.name} {value:g}{f' {goal.unit}' if goal.unit else ''}" for goal, value in zip(goals, paper["point"], strict=True)
    )
    best = comparison.reference(None)
    return f"hypervolume in the objectives' units, up to {words}; that of {best.what} is {hypervolume_at(best.front, paper['point']):.5g}."


def _over_all(comparison: Comparison, paper: Mapping[str, Any]) -> str:
    """What statistics are over, and of which solvers there are none."""
    without = [solver for solver, fronts in comparison.fronts.items() if fronts and not any(map(len, fronts))]
    none = f" No run of {', '.join(without)} has a point that counts." if without else ""
    return f"over the points of all runs; deviation and variance with divisor n - 1.{none}"


def _objectives(comparison: Comparison, paper: Mapping[str, Any]) -> dict[str, list[Figures]]:
    """Statistics of each objective over the points of all runs."""
    return {
        solver: _statistics({goal.name: column for goal, column in zip(comparison.known.goals, values.T, strict=True)})
        for solver, fronts in comparison.fronts.items()
        if len(values := _together(fronts))
    }


def _together(fronts: Sequence[Front]) -> np.ndarray:
    """Objectives (n, m) of all points, in the users' units and senses."""
    return np.concatenate([front.objectives for front in fronts if len(front)] or [np.empty((0, 0))])


def _statistics(columns: Mapping[str, np.ndarray]) -> list[Figures]:
    """Rows of what there is to say of samples by name."""
    return [{"statistic": name, **{key: float(of(values)) for key, values in columns.items()}} for name, of in STATISTICS.items()]


def _ends(comparison: Comparison, paper: Mapping[str, Any]) -> dict[str, list[Figures]]:
    """Statistics, over the points of all runs, of how far states are at the end from where they were to be."""
    rows: dict[str, list[Figures]] = {}
    for solver, runs in comparison.verified.items():
        found = [one for one in runs if len(one.front)]
        if found:
            errors = {}
            for end in paper["ends"]:
                values = np.concatenate([_end(one.ends, end) for one in found])
                errors[end["name"]] = end.get("factor", 1.0) * np.abs(values - end["at"])
            rows[solver] = _statistics(errors)
    return rows


def _end(ends: Ends, end: Mapping[str, Any]) -> np.ndarray:
    """A state at the end of the last phase that has it."""
    found = [states[end["state"]] for states in ends.values() if end["state"] in states]
    if not found:
        raise ValueError(f"paper: {_no_state(end, [name for states in ends.values() for name in states])}")
    return found[-1]


def _fit_ends(paper: Mapping[str, Any], problem: CompiledProblem) -> None:
    """Raise ValueError unless a problem has the states whose ends a published table has."""
    known = [v.name for phase in problem.phases for v in phase.states]
    for end in paper["ends"]:
        if end["state"] not in known:
            raise ValueError(_no_state(end, known))


def _no_state(end: Mapping[str, Any], known: Sequence[str]) -> str:
    return f"ends: '{end['name']}': {unknown('state', end['state'], dict.fromkeys(known))}"


def _check_ends(ends: Any) -> None:
    """Raise ValueError unless a published table says whose ends it has."""
    keys = ("name", "state", "at", "unit", "factor")
    if not isinstance(ends, Sequence) or isinstance(ends, str) or not ends:
        raise ValueError(f"ends must be a list of tables, not {ends!r}")
    names: list[str] = []
    for end in ends:
        if not isinstance(end, Mapping) or not all(key in end for key in ("name", "state", "at")):
            raise ValueError(f"each of ends must be a table with name, state and at, not {end!r}")
        for key, value in end.items():
            if key not in keys:
                raise ValueError(f"ends: {unknown('key', key, keys)}")
            number = key in ("at", "factor")
            if not (is_number(value) if number else isinstance(value, str)):
                raise ValueError(f"ends: {key} must be a {'finite number' if number else 'text'}, not {value!r}")
        if end["name"] in names:
            raise ValueError(f"ends: '{end['name']}' is there twice")
        names.append(end["name"])


def _check_point(point: Any) -> None:
    """Raise ValueError unless a point is a list of numbers."""
    if not isinstance(point, Sequence) or not point or not all(map(is_number, point)):
        raise ValueError(f"point must be a list of numbers, one for each objective, not {point!r}")


def _fit_point(paper: Mapping[str, Any], problem: CompiledProblem) -> None:
    """Raise ValueError unless a point has a number for each objective of a problem."""
    if len(paper["point"]) != len(problem.goals):
        names = ", ".join(goal.name for goal in problem.goals)
        raise ValueError(f"point: {len(paper['point'])} numbers, but {len(problem.goals)} objectives: {names}")


def _feasibility(comparison: Comparison, paper: Mapping[str, Any]) -> dict[str, list[Figures]]:
    """In which generation one, and all of a population were feasible, and how many points were found; of solvers with a population."""
    rows: dict[str, list[Figures]] = {}
    for solver, runs in comparison.runs.items():
        told = [run.front.stats["population"] for run in runs if "population" in run.front.stats]
        if not told:
            continue
        figures: dict[str, Cell] = {}
        runs_in_all = len(told) + comparison.failures.get(solver, 0)
        for key in ("first_feasible", "all_feasible"):
            reached = [one[key] for one in told if one[key] is not None]
            figures[key] = float(np.mean(reached)) if reached else None
            # A run that failed, or never got there, is later than any other.
            middle = float(np.median([*reached, *[np.inf] * (runs_in_all - len(reached))]))
            figures[f"{key}_median"] = middle if np.isfinite(middle) else None
            figures[f"{key}_never"] = runs_in_all - len(reached)
        figures["points"] = float(np.mean([one["nondominated"] for one in told]))
        figures["held"] = float(np.mean([len(one.front) for one in comparison.verified[solver]]))
        rows[solver] = [figures]
    return rows


KINDS: Mapping[str, Kind] = {
    "indicators": Kind(
        lambda paper: {
            "gd_mean": Column("mean GD", digits=4),
            "gd_variance": Column("variance", digits=4),
            "igd_mean": Column("mean IGD", digits=4),
            "igd_variance": Column("variance", digits=4),
            "seconds": Column("time", "s", digits=4),
        },
        _indicators,
        _against_union,
    ),
    "hypervolume": Kind(
        lambda paper: {key: Column(key, digits=5) for key in ("best", "median", "worst")},
        _hypervolume,
        _point,
        needs={"point": _check_point},
        fits=_fit_point,
    ),
    "objectives": Kind(lambda paper: None, _objectives, _over_all, statistics=True),
    "ends": Kind(
        lambda paper: {end["name"]: Column(end["name"], end.get("unit", ""), digits=4) for end in paper["ends"]},
        _ends,
        _over_all,
        statistics=True,
        needs={"ends": _check_ends},
        fits=_fit_ends,
    ),
    "feasibility": Kind(
        lambda paper: {
            "first_feasible": Column("first feasible, mean", digits=4),
            "first_feasible_median": Column("median", digits=4),
            "first_feasible_never": Column("never"),
            "all_feasible": Column("all feasible, mean", digits=4),
            "all_feasible_median": Column("median", digits=4),
            "all_feasible_never": Column("never"),
            "points": Column("not dominated, claimed", digits=4),
            "held": Column("points of a front that count", digits=4),
        },
        _feasibility,
        lambda comparison, paper: "generations from 1, the first population; means of the runs that got there; points are means of a run.",
        population=True,
    ),
}
