"""Tables of fronts as plain text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..io.text import call, counted, duration, numbers, text_table

if TYPE_CHECKING:
    from .points import Point, Points


def front_table(front: Points, defects: Sequence[float] | None = None, columns: Mapping[str, Sequence[Any]] | None = None) -> str:
    """Text with a headline, a row for each point and a footer; see `Front.table`."""
    more = {**({} if defects is None else {"defect": defects}), **(columns or {})}
    for header, values in more.items():
        if len(values) != len(front):
            raise ValueError(f"column '{header}' has {len(values)} entries, the front has {len(front)} points")
    if not len(front):
        return "\n".join([headline(front), "", *_nothing(front)])
    titles, units, cells, left = ["#"], [""], [[str(i) for i in range(len(front))]], [False]

    def add(title: str, unit: str, column: list[str], flush: bool = False) -> None:
        titles.append(title)
        units.append(unit)
        cells.append(column)
        left.append(flush)

    for goal, values in zip(front.goals, front.objectives.T, strict=True):
        add(goal.name, f"{goal.sense[:3]} [{goal.unit or '-'}]", numbers(values))
    add("violation", "", [f"{value:.1e}" for value in front.violation])
    for header, values in more.items():
        add(header, "", [value if isinstance(value, str) else f"{value:.1e}" for value in values])
    certified = [point.optimality for point in front]
    if any(value is not None for value in certified):
        add("optimality", "", ["-" if value is None else f"{value:.1e}" for value in certified])
    add("status", "", front.status.tolist(), True)
    if len({id(one) for one in front.transcriptions}) > 1:
        add("elements", "", [_elements(point) for point in front])
    if front.source is not None:
        add("between nodes", "leaves bounds", [_excursion(point.excursions) for point in front], True)
    table = text_table([titles, units], list(zip(*cells, strict=True)), left)
    return "\n".join([headline(front), "", table, "", *_footer(front)]).rstrip()


def headline(front: Points) -> str:
    """Problem, number of points, transcription and costs in one line."""
    seed, count = front.stats["seed"], len(front)
    parts = [
        counted(count, "point") if count else "no feasible point",
        _transcribed(front),
        front.solver.get("name", ""),
        counted(front.stats["evaluations"], "evaluation"),
        counted(front.stats["gradient_solves"], "gradient solve") if front.stats["gradient_solves"] else "",
        "" if seed is None else f"seed {seed}" if not isinstance(seed, list) else f"{len(seed)} seeds",
        duration(front.stats["wall_time"]),
    ]
    return f"{front.source.name if front.source else 'black box'}: " + ", ".join(part for part in parts if part)


def _transcribed(front: Points) -> str:
    """Transcription of the points, or of the least infeasible one if there are none."""
    given = front if len(front) or front.closest is None else front.closest.alone()
    distinct = list({id(one): one for one in given.transcriptions if one is not None}.values())
    if not distinct:
        return ""
    if len(distinct) == 1 and not distinct[0]["settings"].get("mesh"):
        return call(distinct[0]["method"], distinct[0]["settings"])
    methods = ", ".join(dict.fromkeys(one["method"] for one in distinct))
    return f"{methods} on {'one refined mesh' if len(distinct) == 1 else f'{len(distinct)} meshes'}"


def _elements(point: Point) -> str:
    """Number of elements of each phase."""
    trajectory = point.trajectory
    return "?" if trajectory is None else "+".join(str(len(phase.state.edges) - 1) for phase in trajectory.values())


def _excursion(found: Mapping[str, float] | None) -> str:
    if found is None:
        return "?"
    if not found:
        return "-"
    name = max(found, key=lambda key: found[key])
    rest = f", {len(found) - 1} more" if len(found) > 1 else ""
    return f"{name} by {found[name]:.2g}{rest}"


def _footer(front: Points) -> list[str]:
    lines = []
    leaving = [
        (max(found.values()), max(found, key=lambda key: found[key]), i) for i, point in enumerate(front) if (found := point.excursions)
    ]
    if leaving:
        amount, name, index = max(leaving)
        verb = "leaves its" if len(leaving) == 1 else "leave their"
        worst = f"{name} of point {index} by {amount:.2g} of its scale at most"
        lines.append(f"{len(leaving)} of {counted(len(front), 'point')} {verb} bounds between nodes: {worst}.")
    elif front.source is not None and all(point.excursions is not None for point in front):
        lines.append("No point leaves its bounds between nodes.")
    bad = int((front.status != "converged").sum())
    if bad:
        lines.append(f"{bad} of {counted(len(front), 'point')} did not converge.")
    if front.stats["fallbacks"]:
        lines.append(f"{counted(front.stats['fallbacks'], 'candidate')} went to IPOPT, because the fast inner level failed.")
    if not front.stats["reproducible"]:
        why = front.stats.get("stopped", "budget")
        ended = f"The search was ended early ({why})" if why != "budget" else "An inner solve reached its time limit"
        lines.append(f"{ended}: the same seed may give another front.")
    lines += [f"Point {point.index}: {point.note}" for point in front if point.note]
    if front.message:
        lines.append(front.message)
    return lines


def _nothing(front: Points) -> list[str]:
    lines = [front.message or "There is no point."]
    if front.closest is not None:
        lines += ["", "The least infeasible point:", "", front_table(front.closest.alone()).split("\n", 2)[2]]
    return lines
