"""A trajectory as HTML for notebooks: a row for each state, control and path constraint, with a small line of its values over time."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np

WIDE, HIGH, SAMPLES = 140, 26, 120
"""Pixels of a line, and most values that it joins."""
CELL = 'style="padding:1px 8px;text-align:'


def trajectory_html(trajectory: Any) -> str:
    """HTML of a `Trajectory`: a table for each phase. Names are escaped."""
    parts = [_phase(phase) for phase in trajectory.phases]
    if trajectory.parameters:
        values = ", ".join(f"{escape(name)} {value:.6g}" for name, value in trajectory.parameters.items())
        parts.append(f"<div>parameters: {values}</div>")
    return f"<div>{''.join(parts)}</div>"


def _phase(phase: Any) -> str:
    """A title and a table of one `PhaseTrajectory`, at its nodes."""
    units = [v.unit for v in (*phase.state_variables, *phase.control_variables, *phase.path_limits)]
    kinds = [*(["state"] * phase.states.shape[1]), *(["control"] * phase.controls.shape[1]), *(["path"] * phase.paths.shape[1])]
    heads = ("", "kind", "unit", "first", "last", "least", "most", "over time")
    rows = [_cells(heads, "th")]
    for name, kind, unit, values in zip(phase.names, kinds, units, np.hstack([phase.states, phase.controls, phase.paths]).T, strict=True):
        numbers = [f"{value + 0.0:.6g}" for value in (values[0], values[-1], values.min(), values.max())]
        cells = _cells((name, kind, unit, *numbers), "td")
        rows.append(f"{cells}<td>{_line(phase.time, values)}</td>")
    table = "".join(f"<tr>{row}</tr>" for row in rows)
    title = f"{escape(phase.name)}: {phase.t0:.6g} to {phase.tf:.6g} {escape(phase.time_unit)}, {len(phase.time)} nodes"
    return f"<div><b>{title}</b></div><table>{table}</table>"


def _cells(cells: tuple[str, ...], tag: str) -> str:
    """Cells of a row: the first three flush left."""
    sides = ("left", "left", "left", *["right"] * len(cells))
    return "".join(f'<{tag} {CELL}{side}">{escape(cell)}</{tag}>' for cell, side in zip(cells, sides, strict=False))


def _line(times: np.ndarray, values: np.ndarray) -> str:
    """An SVG of values over time; a constant, up to round-off, is a level line in the middle."""
    some = np.unique(np.linspace(0, len(times) - 1, min(SAMPLES, len(times))).round().astype(int))
    x, y = times[some], values[some]
    span, height = float(np.ptp(x)), float(np.ptp(y))
    across = 2 + (WIDE - 4) * (x - x[0]) / (span or 1.0)
    flat = height <= 1e-9 * max(float(np.abs(y).max()), 1e-300)
    up = np.full(len(y), 0.5 * HIGH) if flat else HIGH - 3 - (HIGH - 6) * (y - y.min()) / height
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(across, up, strict=True))
    line = f'<polyline points="{points}" fill="none" stroke="#0072B2" stroke-width="1.3"/>'
    return f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDE}" height="{HIGH}" role="img" aria-label="over time">{line}</svg>'
