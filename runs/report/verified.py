"""Which points of a run count: where a study flies them, those that hold in the air, with what they are there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from macs.evaluation.evaluator import CONVERGED
from macs.front import Front
from macs.fronts.simulated import best, judged

from ..batch.file import told
from ..batch.store import StoredRun
from ..measures.simulation_record import Ends, ends, record
from ..measures.statistics import summarise
from .tables import Cell, Table, table


@dataclass(frozen=True, eq=False)
class Verified:
    """What counts of a run.

    Attributes
    ----------
    front : Front
        The n points that count.
    ends : Ends
        Their states at the end of each phase.
    claimed, held : int
        How many points the solver gave, and how many of these hold, dominated ones included.
    """

    front: Front
    ends: Ends
    claimed: int
    held: int

    @classmethod
    def of(cls, run: StoredRun, tolerance: float | None) -> Verified:
        """Of a finished run, of a study that verifies within a tolerance or not at all.

        Points whose flights are not in the run's record are flown now. Raises ValueError if they cannot be, as their problem is not found.
        """
        front = run.front
        if tolerance is None or not len(front):
            return cls(front, ends(front), len(front), len(front))
        found: Any = run.flown
        if np.shape(found.get("F", ())) != front.F.shape or np.shape(found.get("violation", ())) != front.violation.shape:
            with told(f"the points of run {run.number} of {run.cell.name} cannot be flown"):
                found = record(front, tolerance)
        flown = judged(front, np.array(found["F"], dtype=float), np.array(found["violation"], dtype=float), tolerance)
        rows = best(flown)
        places = {phase: {name: np.array(values)[rows] for name, values in states.items()} for phase, states in found["ends"].items()}
        return cls(flown[rows], places, len(front), int((flown.status == CONVERGED).sum()))


def claims_table(runs: Mapping[str, Sequence[Verified]], tolerance: float, caption: str) -> Table:
    """A row for each solver: how many points of its runs were claimed to be feasible, and how many are, as flown."""
    rows: list[list[Cell]] = []
    for solver, found in runs.items():
        if not found:
            continue
        claimed, held = sum(one.claimed for one in found), sum(one.held for one in found)
        counts = summarise([len(one.front) for one in found], larger=True)
        share = 100.0 * held / claimed if claimed else None
        rows.append([solver, len(found), claimed, held, share, counts.mean, counts.median])
    heads = ["solver", "runs", "points claimed", "hold as flown", "%", "of these not dominated, mean of a run", "median"]
    note = (
        f"All points were flown by DOP853. Those hold that violate no state bound, end, path or constraint by more than {tolerance:g} of "
        "its scale; they alone count in indicators and published statistics, with their objectives as flown, without what is dominated by "
        "others of their run. What is drawn over evaluations, iterations or time is as claimed."
    )
    return table(heads, rows, caption, [note])
