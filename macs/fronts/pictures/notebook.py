"""A point as HTML for notebooks: its objectives, its state and a small picture."""

from __future__ import annotations

from typing import Any

from ...io.html import html_block, html_table
from .flight_plot import draw_flight, quantities
from .kinds import hollow
from .style import blank_figure, rendered

MOST = 24
"""Most panels of a picture: a point with more is shown by its table alone."""


def point_html(point: Any) -> str:
    """HTML of a point: a row for each objective, as found and as simulated, and its states, controls and path constraints over time."""
    simulated = point.simulated
    heads = ["objective", "", "value", *(["simulated"] if simulated is not None else [])]
    rows = [
        [goal.name, f"{goal.sense[:3]} [{goal.unit or '-'}]", f"{value:.6g}", *([f"{simulated[goal.name]:.6g}"] if simulated else [])]
        for goal, value in zip(point.goals, point.objectives.values(), strict=True)
    ]
    state = {None: "not simulated", True: "verified", False: "not verified"}[point.verified]
    about = [f"{point.status}, {state}; violation {point.violation:.1e}"]
    if point.parameters and point.trajectory is not None:
        about.append("parameters: " + ", ".join(f"{name} {value:.6g}" for name, value in point.parameters.items()))
    about += [point.note] if point.note else []
    picture, figure = b"", blank_figure()
    if point.trajectory is not None and len(quantities(point.trajectory)) <= MOST:
        draw_flight(point.trajectory, "", figure, hollow=hollow(point))
        picture = rendered(figure, "png", 55)
    elif not point.dynamic:
        point.plot(figure)
        picture = rendered(figure, "png", 55)
    table = html_table([heads], rows, [True, True, *[False] * (len(heads) - 2)])
    return html_block(f"Point {point.index}", table, about, picture, f"point {point.index}: {point.title}")
