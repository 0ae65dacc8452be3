"""Which points of a run count: where a study flies them, those that hold in the air, with what they are there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from macs.evaluation import CONVERGED
from macs.flown import best, judged
from macs.front import Front

from ..measures.statistics import summarise
from ..store import Run
from .tables import Cell, Table, table

Ends = Mapping[str, Mapping[str, np.ndarray]]
"""Phase -> state -> its values at the end (n,)."""


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
    def of(cls, run: Run, tolerance: float | None) -> Verified:
        """Of a finished run, of a study that verifies within a tolerance or not at all. Raises ValueError if its points were not flown."""
        front = run.front
        if tolerance is None or not len(front):
            return cls(front, _ends(front), len(front), len(front))
        F, violation = (np.array(run.flown.get(key, []), dtype=float) for key in ("F", "violation"))
        if F.shape != front.F.shape or violation.shape != front.violation.shape:
            raise ValueError(f"{run.path.with_suffix('.json')} does not say how the points of run {run.number} of {run.cell.name} fly")
        flown = judged(front, F, violation, tolerance)
        rows = best(flown)
        ends = {phase: {name: np.array(values)[rows] for name, values in states.items()} for phase, states in run.flown["ends"].items()}
        return cls(flown[rows], ends, len(front), int((flown.status == CONVERGED).sum()))


def _ends(front: Front) -> Ends:
    """As the transcription has them."""
    flights = [point.trajectory for point in front]
    if not flights or any(flight is None for flight in flights):
        return {}
    return {
        name: {
            v.name: np.array([flight[name].edge_states[-1, k] for flight in flights if flight is not None])
            for k, v in enumerate(phase.state_variables)
        }
        for name, phase in (flights[0] or {}).items()
    }


def claims_table(runs: Mapping[str, Sequence[Verified]], tolerance: float, caption: str) -> Table:
    """A row for each solver: how many points of its runs were claimed to be feasible, and how many are, as flown."""
    rows: list[list[Cell]] = []
    for solver, found in runs.items():
        claimed, held = sum(one.claimed for one in found), sum(one.held for one in found)
        counts = summarise([len(one.front) for one in found], larger=True)
        share = 100.0 * held / claimed if claimed else None
        rows.append([solver, len(found), claimed, held, share, counts.mean, counts.median])
    heads = ["solver", "runs", "points claimed", "hold as flown", "%", "of these not dominated, mean of a run", "median"]
    told = (
        f"All points were flown by DOP853. Those that violate nothing by more than {tolerance:g} of its scale hold; they alone are in all "
        "other tables and figures, with their objectives as flown, without what is dominated by others of their run."
    )
    return table(heads, rows, caption, [told])
