"""How a study stands, in plain text: a row for each cell, a line for each failure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from macs.fronts.tables import duration, text_table

from .batch.watching import reason

if TYPE_CHECKING:
    from .batch.store import Summary

LINE = 200
"""Longest reason, in characters."""
WORTH = 20
"""Most failures told one by one."""


def summary_text(summary: Summary) -> str:
    """A table of the cells, and why runs failed."""
    rows, reasons = [], []
    for cell, runs in summary.cells.items():
        finished = [run for run in runs if run.finished]
        times = [run.wall_time for run in finished if run.wall_time]
        missing = sum(run.status == "missing" for run in runs)
        failed = len(runs) - len(finished) - missing
        rows.append([*cell.labels, str(len(finished)), str(failed), str(missing), duration(float(np.median(times))) if times else "-"])
        for run in runs:
            if not run.finished and run.status != "missing":
                reasons.append(f"run {run.number} of {cell.name}: {reason(run.status, run.message)}"[:LINE])
    more = [f"and {len(reasons) - WORTH} more"] if len(reasons) > WORTH else []
    table = text_table(
        [["problem", "transcription", "solver", "finished", "failed", "missing", "median time"]], rows, [True] * 3 + [False] * 4
    )
    headline = f"{summary.name}: {summary.finished} of {len(summary.runs)} runs finished"
    failures = ["", *reasons[:WORTH], *more] if reasons else []
    return "\n".join([headline, "", table, *failures])
