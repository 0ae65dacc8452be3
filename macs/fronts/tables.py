"""Tables of fronts, as plain text and for notebooks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from problems.compiled import CompiledProblem
from transcription.base import Transcription
from transcription.elements.dfet import DFET
from transcription.trajectories.costates import hamiltonian_variation

from ..evaluation.evaluator import CONVERGED, FAILED
from ..io.text import call, counted, duration, html_block, html_table, numbers, text_table
from .point import Point
from .points import Points
from .provenance import COUNTED_BY
from .verified import AGAIN, MISSES, constant_objectives, missed, untrusted


def front_table(front: Points, columns: Mapping[str, Sequence[Any]] | None = None, details: bool = False) -> str:
    """Text with a headline, a row for each point and a footer; see `Front.table`.

    Points that were simulated and are not verified stand apart, below the others.
    """
    for header, values in (columns or {}).items():
        if len(values) != len(front):
            raise ValueError(f"column '{header}' has {len(values)} entries, the front has {len(front)} points")
    if not len(front):
        return "\n".join([headline(front), "", *_nothing(front)])
    table = _table(front, columns or {}, details)
    lines = text_table(table.headers, table.rows, table.left).split("\n")
    if table.apart:
        lines.insert(len(lines) - table.apart, f"\n{_said_apart(front)}")
    return "\n".join([headline(front), "", *lines, "", *footer(front)]).rstrip()


def front_html(front: Points, picture: bytes, most: int = 30) -> str:
    """HTML of a front for notebooks: headline, table, remarks and a picture of it, a PNG."""
    what = f"front: {headline(front)}"
    if not len(front):
        return html_block(headline(front), "", _nothing(front)[:1], picture, what)
    table = _table(front, {}, details=False)
    dim = range(len(front) - table.apart, len(front))
    shown = html_table(table.headers, table.rows[:most], table.left, dim)
    notes = [f"{counted(len(front) - most, 'more point')}: front.table()"] if len(front) > most else []
    notes += [f"Grey: {_said_apart(front)}"] if table.apart else []
    return html_block(headline(front), shown, [*notes, *footer(front)], picture, what)


@dataclass(frozen=True)
class _Table:
    """Cells of the table of a front; the last `apart` rows are of points that are not verified."""

    headers: Sequence[Sequence[str]]
    rows: Sequence[Sequence[str]]
    left: Sequence[bool]
    apart: int


def _said_apart(front: Points) -> str:
    again = AGAIN if _is_vector(front) else MISSES
    return f"Not verified: {again}these differ by more than {front.stats['verify']:g}."


def _table(front: Points, columns: Mapping[str, Sequence[Any]], details: bool) -> _Table:
    """The cells, a row for each point, with further columns; residuals and the like as `details`, or where a point is not good."""
    was = front.was_simulated
    outside = front.dynamic and any(point.excursions for point in front if point.verified is None)
    details = details or outside or bool((front.status != CONVERGED).any() or (was & ~front.verified).any())
    # Title and unit, cells, and whether they are flush left.
    table: list[tuple[tuple[str, str], Sequence[str], bool]] = [(("#", ""), [str(i) for i in range(len(front))], False)]
    for goal, values, tolerance in zip(front.goals, front.objectives.T, front.resolution, strict=True):
        table.append(((goal.name, f"{goal.sense[:3]} [{goal.unit or '-'}]"), numbers(values, tolerance), False))
    for name, unit, resolution, values in parameters_of(front):
        words = not all(isinstance(value, float) for value in values)
        cells = ["-" if value is None else str(value) for value in values] if words else numbers(values, resolution)
        table.append(((name, f"[{unit or '-'}]"), cells, any(isinstance(value, str) for value in values)))
    table += _residuals(front) if details else []
    for header, given in columns.items():
        table.append(((header, ""), [value if isinstance(value, str) else f"{value:.1e}" for value in given], False))
    table.append((("status", ""), [_status(point) for point in front], True))
    if details and len({id(one) for one in front.transcriptions}) > 1:
        table.append((("elements", ""), [_elements(point) for point in front], False))
    if details and front.dynamic and not was.all():
        table.append((("between nodes", "leaves bounds"), [_excursion(point.excursions) for point in front], True))
    apart = np.flatnonzero(was & ~front.verified)
    order = [*np.setdiff1d(np.arange(len(front)), apart), *apart]
    heads, cells_of, left = zip(*table, strict=True)
    rows = list(zip(*cells_of, strict=True))
    return _Table([*zip(*heads, strict=True)], [rows[i] for i in order], left, len(apart))


def _residuals(front: Points) -> Sequence[tuple[tuple[str, str], Sequence[str], bool]]:
    """Columns of a table: by how much points violate constraints, differ from their simulation, and miss the conditions of an optimum."""
    table = [(("violation", ""), _small(front.violation), False)]
    vector = _is_vector(front)
    if front.was_simulated.any():
        off, how = missed(front) * front.within[:, None], "again" if vector else "simulated"
        table += [] if vector else [(("defect", how), _small(front.defect), False)]
        table.append((("violation", how), _small(front.simulated_violation), False))
        table.append((("objectives", "off by"), _small(off.max(axis=1)), False))
    if any(value is not None for value in front.optimality):
        table.append((("optimality", ""), _small(front.optimality), False))
    return table


def parameters_of(front: Points, few: int = 6) -> list[tuple[str, str, float, list[Any]]]:
    """Name, unit, a ten-thousandth of the bounds and the values of each static parameter, or variable without trajectories, if `few`."""
    each = [point.parameters for point in front]
    most = max(range(len(each)), key=lambda i: len(each[i]), default=0)
    if not each or len(each[most]) > few:
        return []
    known = {variable.name: (variable.unit, 1e-4 * (variable.upper - variable.lower)) for variable in front[most].variables}
    return [(name, *known.get(name, ("", np.nan)), [one.get(name) for one in each]) for name in each[most]]


def _is_vector(front: Points) -> bool:
    """Whether the points are of a vector problem."""
    return front.source is not None and front.source.vector


def _small(values: Iterable[float | None]) -> list[str]:
    """Errors with two digits; - where there is none."""
    return ["-" if value is None or np.isnan(value) else f"{value:.1e}" for value in values]


def _status(point: Point) -> str:
    """The status of a point; whether it is verified, if it converged and was simulated."""
    if point.status != CONVERGED or point.verified is None:
        return point.status
    return "verified" if point.verified else "not verified"


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


def solves_table(front: Points) -> str:
    """What gradient solves were for, see `Counts`: those with most iterations first; "" where there were none."""
    solves, iterations, _ = by = [Counter(front.stats.get(key, {})) for key in COUNTED_BY]
    names = [what for what, _ in iterations.most_common() if solves[what]]
    rows = [[what, *(str(one[what]) for one in by)] for what in names] + [["all", *(str(one.total()) for one in by)]]
    return text_table([("gradient solves for", "number", "iterations", "kept")], rows, [True, False, False, False]) if solves else ""


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


MOST_NAMED = 5
"""Number of points whose misses are given in words, or that are named in a line."""
HAMILTONIAN_VARIES = 0.05
"""Part of its terms by which a Hamiltonian that is to be constant varies where the mesh is said not to resolve the optimum: it varied by
less on all meshes whose optimum was right to 5e-4, and by more on a third of the others (`tests/macs/fronts/test_unresolved.py`)."""


def footer(front: Points) -> list[str]:
    """Lines below the table of a front with points: how many are verified, notes and warnings."""
    lines = _simulated(front) if front.was_simulated.all() else _not_simulated(front) if front.dynamic else []
    seconds = sorted(((what, s) for what, s in front.stats.get("seconds", {}).items() if s >= 0.05), key=lambda one: -one[1])
    lines += ["Time: " + ", ".join(f"{what} {amount:.1f} s" for what, amount in seconds) + "."] if seconds else []
    lines += [*_unresolved(front, front), *_without_conflict(front)]
    bad = int((front.status != CONVERGED).sum())
    if bad:
        lines.append(f"{bad} of {counted(len(front), 'point')} did not converge.")
    if front.stats.get("from_cache"):
        lines.append(f"Of {counted(front.stats['evaluations'], 'evaluation')}, {front.stats['from_cache']} came from the cache.")
    if first := front.stats.get("first_failure"):
        lines.append(f"{counted(front.stats['failures'].get(FAILED, 0), 'evaluation')} failed; the first: {first}.")
    if front.stats["fallbacks"]:
        lines.append(f"{counted(front.stats['fallbacks'], 'candidate')} went to IPOPT, because the fast inner level failed.")
    lines += [_by_inner_solver(name, **one) for name, one in front.stats.get("ways", {}).items() if one["evaluations"]]
    if not front.stats["reproducible"]:
        why = front.stats.get("stopped", "budget")
        ended = f"The search was ended early ({why})" if why != "budget" else "An inner solve reached its time limit"
        lines.append(f"{ended}: the same seed may give another front.")
    missing = [point.index for point in front if MISSES in point.note or AGAIN in point.note]
    lines += [f"Point {point.index}: {point.note}." for point in front if point.note and point.index not in missing[MOST_NAMED:]]
    if len(missing) > MOST_NAMED:
        rest = len(missing) - MOST_NAMED
        lines.append(f"The note{'s' if rest > 1 else ''} of {counted(rest, 'more point')} say{'' if rest > 1 else 's'} what is missed.")
    if front.message:
        lines.append(front.message)
    return lines


def _by_inner_solver(name: str, evaluations: int, feasible: int | None = None, work: int = 0) -> str:
    """How many candidates an inner solver was given, and how many of them were feasible; older files do not say the latter."""
    was = "was" if evaluations == 1 else "were"
    how = "propagated (integrated forward from their controls)" if name == "propagate" else f"solved by {name}"
    known = "" if feasible is None else f"; {feasible:,} {'was' if feasible == 1 else 'were'} feasible".replace(",", " ")
    return f"{counted(evaluations, 'candidate')} {was} {how}{known}."


def explain(point: Point | Points) -> str:
    """What is known of how far a point, or each of a front, can be trusted, and why it is not verified, a sentence a line.

    The first line of a point is its number and objectives. Then follow whether it converged, and the constraint that it violates most if it
    did not; whether it is verified, and what its simulation misses, where, and what to do about it; the remarks of the table of its front
    on this point; and whether its Hamiltonian shows that its mesh does not resolve the optimum.

    Parameters
    ----------
    point : Point or Front
        From a search, a gradient tool, or a file. Nothing is simulated: `Front.verify` does that.

    Returns
    -------
    str

    Raises
    ------
    TypeError
        If it is neither.

    Examples
    --------
    >>> from macs import explain, optimize
    >>> from problems import load
    >>> point = optimize(load("goddard"), objective="horizontal speed", starts=1)
    >>> print(explain(point).split(": ", 1)[1].splitlines()[1])
    It is verified: what a simulation gives differs by no more than its tolerances.
    """
    if isinstance(point, Points):
        return "\n\n".join(map(explain, point)) or point.message
    if not isinstance(point, Point):
        raise TypeError(f"explain takes a point or a front, not {type(point).__name__}")
    lines = [f"Point {point.index}: {point.title}."]
    if point.status != CONVERGED:
        worst = max(point.violations, key=lambda name: point.violations[name], default="")
        most = f"; most violated is {worst}, by {point.violations[worst]:.1e} of its scale" if worst else ""
        lines.append(f"Its status is '{point.status}'{most}.")
    vector = point.source is not None and point.source.vector
    how = "another evaluation" if vector else "a simulation"
    told = {
        True: f"It is verified: what {how} gives differs by no more than its tolerances.",
        False: f"It is not verified: {how} does not confirm it.",
        None: "It was not simulated: Front.verify does that." if point.dynamic or vector else "There is nothing to verify of a black box.",
    }
    lines += [told[point.verified], *(f"{part[:1].upper()}{part[1:]}." for part in point.note.split("; ") if part)]
    return "\n".join([*lines, *_unresolved(point._points, [point])])


def _unresolved(front: Points, points: Iterable[Point]) -> list[str]:
    """On the meshes of which points, that miss nothing, the Hamiltonian shows that these are no optima but of their meshes.

    Only of DFET: at nodes of collocation beside a switch it varies where a mesh is exact.
    """
    if not isinstance(front.problem, CompiledProblem):
        return []
    found = {}
    for point in points:
        method = Transcription.registered.get((point.transcription or {}).get("method", ""), Transcription)
        if point.costates is None or point.trajectory is None or point.verified is False or not issubclass(method, DFET):
            continue
        part = hamiltonian_variation(front.problem, point.trajectory, point.costates)
        if part > HAMILTONIAN_VARIES:
            found[point.index] = part
    if not found:
        return []
    which = f"{len(found)} points" if len(found) > MOST_NAMED else f"point{'s' if len(found) > 1 else ''} {', '.join(map(str, found))}"
    most = max(found.values())
    size = "by more than its terms" if most > 1 else f"by {'up to ' if len(found) > 1 else ''}{100 * most:.2g} % of its terms"
    remedy = "front.refine_mesh() finds meshes that are nearer to that"
    return [
        f"On the mesh{'es' if len(found) > 1 else ''} of {which} the Hamiltonian varies {size}; along an optimum it is constant: {remedy}."
    ]


def _without_conflict(front: Points) -> list[str]:
    """Which of several objectives are not in conflict with the others, as far as these points tell."""
    if len(front.goals) < 2:
        return []
    if len(front) == 1:
        return ["No other point was found that is better in any objective."] if front.stats.get("stopped") != "running" else []
    same = [goal.name for goal, constant in zip(front.goals, constant_objectives(front), strict=True) if constant]
    return [f"'{name}' is the same at all points: it is not in conflict with the other objectives." for name in same]


def _simulated(front: Points) -> list[str]:
    """How many points are verified."""
    count, verify = int(front.verified.sum()), front.stats["verify"]
    points = "The point is" if len(front) == 1 else f"All {len(front)} points are"
    if count == len(front):
        how = "evaluated again" if _is_vector(front) else "simulated by an independent integrator"
        return [f"{points} verified: {how}, nothing differs by more than {verify:g}."]
    remedy = (
        "" if _is_vector(front) or untrusted(front)[~front.verified].all() else " front.mended() solves again where points miss something."
    )
    if not count:
        return [("The point is not verified." if len(front) == 1 else f"None of {len(front)} points is verified.") + remedy]
    return [f"{count} of {counted(len(front), 'point')} {'is' if count == 1 else 'are'} verified.{remedy}"]


def _not_simulated(front: Points) -> list[str]:
    """That trajectories were not simulated, and what does it."""
    count = int((~front.was_simulated).sum())
    which = "The point was" if len(front) == 1 else f"{count} of {len(front)} points were" if count < len(front) else "The points were"
    return [f"{which} not simulated: front.verify() does that, or `macs verify` of the file."]


def _nothing(front: Points) -> list[str]:
    lines = [front.message or "There is no point."]
    if front.closest is not None:
        lines += ["", "The least infeasible point:", "", front_table(front.closest.alone()).split("\n", 2)[2]]
    return lines
