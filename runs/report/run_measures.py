"""Measures of every run of a comparison: its indicators in the end and over its samples, and its costs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from macs.front import Front
from transcription import from_dict, parse
from transcription.inner.base import iteration_work

from ..batch.cells import Cell
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
CHARGED = "charged evaluations"
AXES: Mapping[str, tuple[str, str]] = {
    "evaluations": ("evaluations", "evaluations"),
    CHARGED: ("evaluations", CHARGED),
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


@dataclass(frozen=True)
class Charge:
    """What gradient solves, and evaluations that take more than others, cost in evaluations of the cheapest kind.

    The charged evaluations of a run are all of its counted work divided by `unit`. Work is counted in iterations of IPOPT times variables,
    see `Counts`; these take more or fewer instructions on programs of different kinds, so it is multiplied by `prices`.
    """

    unit: float  # what an evaluation takes, in the mean of its runs, by the solver without gradient solves whose evaluations take least
    solver: str  # that solver
    # Instructions that a unit of work takes on the cell's transcription, and on that of its gradient solves; 1 where all are on one.
    prices: Mapping[Cell, tuple[float, float]]

    @classmethod
    def of(cls, comparison: Comparison) -> Charge | None:
        """The charge of a comparison; None if every solver makes gradient solves, or work was not counted, as for black boxes."""
        runs = [run for ones in comparison.runs.values() for run in ones]
        if not all("gradient_work" in run.front.stats for run in runs):
            return None
        prices = _prices(runs)
        if prices is None:
            return None
        taken = {
            solver: float(np.mean([_evaluated(run.front.stats, prices[run.cell][0]) / run.front.stats["evaluations"] for run in ones]))
            for solver, ones in comparison.runs.items()
            if ones and all(run.front.stats["evaluations"] and not run.front.stats["gradient_solves"] for run in ones)
        }
        taken = {solver: work for solver, work in taken.items() if work > 0.0}
        if not taken:
            return None
        solver = min(taken, key=lambda one: taken[one])
        return cls(taken[solver], solver, prices)

    def __call__(self, cell: Cell, counts: Mapping[str, Any]) -> Any:
        """Charged evaluations of a run of a cell: of its `work` and `gradient_work`, numbers or arrays."""
        price, of_gradients = self.prices[cell]
        return (_evaluated(counts, price) + np.asarray(counts["gradient_work"], dtype=float) * of_gradients) / self.unit


def _evaluated(counts: Mapping[str, Any], price: float) -> Any:
    """What the evaluations took, without gradient solves."""
    return (np.asarray(counts["work"], dtype=float) - np.asarray(counts["gradient_work"], dtype=float)) * price


def _prices(runs: list[StoredRun]) -> dict[Cell, tuple[float, float]] | None:
    """Of the cells of some runs, see `Charge`; None where transcriptions differ and the problem is not found, so that none can be made."""
    schemes = {}
    for cell in {run.cell: None for run in runs}:
        own = cell.details["transcription"]
        other = cell.details["solver"]["settings"].get("polish_on")
        if own is None:
            return None
        schemes[cell] = from_dict(own), parse(other) if other else from_dict(own)
    different = {repr(one): one for pair in schemes.values() for one in pair}
    if len(different) == 1:
        return dict.fromkeys(schemes, (1.0, 1.0))
    source = runs[0].front.source
    if source is None or not source.address:
        return None
    problem = source.load().compile()
    price = {name: iteration_work(nlp) / len(nlp.lower) for name, nlp in ((name, one.nlp(problem)) for name, one in different.items())}
    return {cell: (price[repr(own)], price[repr(other)]) for cell, (own, other) in schemes.items()}


def spent(comparison: Comparison, charge: Charge | None = None) -> dict[str, dict[str, list[float]]]:
    """{cost: {solver: a value for each finished run}}; charged evaluations and work of those that record it."""
    keys = {key.replace("_", " "): key for key in COUNTS} | {"time [s]": "wall_time"}
    found = {
        name: {solver: [float(run.front.stats[key]) for run in runs if key in run.front.stats] for solver, runs in comparison.runs.items()}
        for name, key in keys.items()
    }
    if charge is not None:
        found[CHARGED] = {solver: [float(charge(run.cell, run.front.stats)) for run in runs] for solver, runs in comparison.runs.items()}
    return {name: {solver: values for solver, values in solvers.items() if values} for name, solvers in found.items()}


def histories(comparison: Comparison, reference: Reference, name: str, axis: str, charge: Charge | None = None) -> dict[str, list[History]]:
    """{solver: histories} of an indicator over a cost, of the runs whose history is known and had any of it: a sweep has no evaluations.
    Charged evaluations need a charge, and histories with work."""
    key, _ = AXES[axis]
    if axis == CHARGED and charge is None:
        return {}
    return {
        solver: known
        for solver, runs in comparison.runs.items()
        if (
            known := [
                _history(run, reference, name, charge(run.cell, run.history) if axis == CHARGED and charge else run.history[key])
                for run in runs
                if run.history.get("F") and any(run.history[key]) and (axis != CHARGED or "gradient_work" in run.history)
            ]
        )
    }


def _history(run: StoredRun, reference: Reference, name: str, moments: Any) -> History:
    signs = np.array([goal.sign for goal in reference.front.goals])
    values = [indicator(name, np.reshape(F, (-1, len(signs))) * signs, reference) for F in run.history["F"]]
    return np.maximum.accumulate(np.array(moments, dtype=float)), np.array(values)
