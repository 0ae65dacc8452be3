"""Measures of every run of a comparison: its indicators in the end and over its samples, and its costs."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from macs.front import Front

from ..batch.store import StoredRun
from ..execution.samples import COUNTS
from ..measures.convergence import History
from ..measures.indicators import additive_epsilon, gd, hypervolume, igd, igd_plus
from ..measures.references import Reference
from .comparison import Comparison

INDICATORS: Mapping[str, Callable[..., float]] = {
    "GD": gd,
    "IGD": igd,
    "IGD+": igd_plus,
    "hypervolume": hypervolume,
    "additive epsilon": additive_epsilon,
}
CURVED = ("GD", "IGD", "IGD+")
"""Indicators that take a dense reference for a curve, unless `curve` is False."""
AXES: Mapping[str, tuple[str, str]] = {
    "evaluations": ("evaluations", "evaluations"),
    "inner iterations": ("inner_iterations", "inner iterations"),
    "time": ("elapsed", "time [s]"),
}
"""{cost: its column in a history, and the label of its axis}."""


def indicator(name: str, points: Front | np.ndarray, reference: Reference, *, curve: bool = True) -> float:
    """An indicator of a front, or of objectives (n, m) in the user's units and senses."""
    options = {"curve": curve} if name in CURVED else {}
    return INDICATORS[name](points, reference.front, **options)


def samples(comparison: Comparison, reference: Reference, *, curve: bool = True) -> dict[str, dict[str, list[float]]]:
    """{indicator: {solver: a value for each run}}, NaN for a run that failed."""
    return {
        name: {
            solver: [indicator(name, front, reference, curve=curve) for front in fronts] + [np.nan] * comparison.failures.get(solver, 0)
            for solver, fronts in comparison.fronts.items()
            if len(fronts) + comparison.failures.get(solver, 0)
        }
        for name in INDICATORS
    }


def spent(comparison: Comparison) -> dict[str, dict[str, list[float]]]:
    """{cost: {solver: a value for each finished run}}; work of those that record it."""
    keys = {key.replace("_", " "): key for key in COUNTS} | {"work": "work", "time [s]": "wall_time"}
    found = {
        name: {solver: [float(run.front.stats[key]) for run in runs if key in run.front.stats] for solver, runs in comparison.runs.items()}
        for name, key in keys.items()
    }
    return {name: {solver: values for solver, values in solvers.items() if values} for name, solvers in found.items()}


def histories(comparison: Comparison, reference: Reference, name: str, axis: str) -> dict[str, list[History]]:
    """{solver: histories} of an indicator over a cost, of the runs whose history is known and had any of it: a sweep has no evaluations."""
    key, _ = AXES[axis]
    return {
        solver: known
        for solver, runs in comparison.runs.items()
        if (known := [_history(run, reference, name, key) for run in runs if run.history.get("F") and any(run.history[key])])
    }


def _history(run: StoredRun, reference: Reference, name: str, key: str) -> History:
    signs = np.array([goal.sign for goal in reference.front.goals])
    values = [indicator(name, np.reshape(F, (-1, len(signs))) * signs, reference) for F in run.history["F"]]
    return np.array(run.history[key], dtype=float), np.array(values)
