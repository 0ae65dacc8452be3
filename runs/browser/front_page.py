"""The page of one front."""

from __future__ import annotations

from typing import Any

from macs.front import Front

from .page import packed, page
from .points import about, columns, details, goals_data, samples_of


def front_page(front: Front) -> bytes:
    """The page of a front.

    Its data have the form that those of a study have, with one comparison of one run. Raises ValueError if the drawing package is not
    installed.
    """
    name = front.source.name if front.source is not None else "black box"
    solver = str(front.solver.get("name", "")) or "points"
    run: dict[str, Any] = {"solver": solver, "number": 1, "block": "0", "points": columns(front), "about": about(front)}
    comparison = {"name": name, "goals": goals_data(front.goals), "solvers": [solver], "runs": [run]}
    data = {"title": name, "kind": "front", "comparisons": [comparison]}
    return page(data, {"0": packed(details(front, samples_of([front])))})
