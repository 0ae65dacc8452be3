"""Points that stand for a front: trajectories, beside known optimal laws and each objective optimised alone, or variables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np

from macs.evaluation.evaluator import CONVERGED
from macs.front import Front
from macs.fronts.pictures.flight_plot import along
from macs.fronts.pictures.front_plot import draw_designs
from macs.fronts.pictures.style import blank_figure
from macs.fronts.point import Point
from macs.gradient_tools import payoff
from macs.io.text import label
from macs.refinement.search_mesh import default_transcription
from problems import load
from transcription import SingleShooting, from_dict, word

from ..measures.indicators import pieces, truth
from ..measures.references import Reference, module_of
from .comparison import Comparison
from .flight_plots import Law, flights_figure, paths_figure, representatives
from .plots import front_figure, style
from .tables import Cell, Head, Table, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GRADIENT_TOOLS = ("optimize", "payoff", "sweep")
"""Names of solvers whose points are optima."""
MANY = 100
DESIGNS = 6
"""Points of a vector problem in the table."""
LAW, ALONE = "known law", "single objective"
"""Names of the dashed and dotted lines; a case may have a `LAW` of its own."""
OBLONG = 4.0
"""Tracks whose sides have one unit are drawn to one scale, unless one is longer than this many times the other."""
BETTER = 1e-6
"""Shares of a range by which a point may be better than the truth before that wants a word."""


@dataclass(frozen=True, eq=False)
class Flights:
    """Representative trajectories of the front of one solver."""

    comparison: Comparison
    reference: Reference
    solver: str  # the first solver that found points; the front is that of all its runs together
    points: tuple[Point, ...]
    many: Sequence[Point]  # up to a hundred of that front, for pictures of a population
    case: SimpleNamespace | None  # the module of the problem, see `references.module_of`
    laws: Mapping[str, Sequence[Law | None]]  # one for each point, None where there is none
    # The optimum of each objective alone, by gradients, on the same transcription unless it is unsuited to them; empty if there is none.
    ends: Front
    note: str  # why there are no ends; usually empty

    @classmethod
    def of(cls, comparison: Comparison) -> Flights | None:
        """The representatives of a comparison; None if no solver found a trajectory."""
        for solver in comparison.runs:
            fronts = [front for front in comparison.fronts[solver] if len(front)]
            if fronts and fronts[0][0].trajectory is not None:
                front = Front.merge(fronts) if len(fronts) > 1 else fronts[0]
                points, many = (tuple(front[i] for i in representatives(front, count)) for count in (4, MANY))
                address = front.source.address if front.source is not None else ""
                place = module_of(address) if address and not address.rpartition(":")[0].endswith(".py") else None
                known = _known_ends(comparison)
                ends, note = (known, "") if known is not None else _ends(front)
                laws = {getattr(place, "LAW", LAW): _laws(place, points), ALONE: _alone(points, ends)}
                return cls(comparison, comparison.against, solver, points, many, place, laws, ends, note)
        return None

    def table(self) -> Table:
        """Their objectives; with two of them, the best of the second that is known for the first; and each objective alone."""
        goals = self.comparison.known.goals
        curve = self._curve()
        heads: list[Head | str] = ["solution", *(Head(label(goal.name, goal.unit), digits=7) for goal in goals)]
        if curve is not None:
            heads += [Head(label(f"{goals[1].name} of {self._truth}", goals[1].unit), digits=7), "short of it, of the range"]
        names = [*(f"point {number}" for number in range(1, len(self.points) + 1)), *(f"{goal.name} alone" for goal in goals)]
        # There may be no ends.
        named = zip(names, (*self.points, *self.ends), strict=False)
        rows: list[list[Cell]] = [[name, *point.objectives.values(), *self._beside(point, curve)] for name, point in named]
        notes = [f"Of {self.solver}, all runs together."]
        if len(self.ends):
            method = from_dict(self.ends[0].transcription or {})
            notes[0] += f" Alone: one objective optimised by gradients on {word(method) or 'the same mesh'}."
        if curve is not None and any(isinstance(row[-1], float) and row[-1] < -BETTER for row in rows):
            notes.append(
                f"Negative: better than the {self._truth}, by the errors of the mesh and of the curve through it; see macs verify."
            )
        notes += [self.note] if self.note else []
        return table(heads, rows, f"{self.comparison.name}: representative solutions of the front.", notes)

    def figures(self) -> dict[str, Figure]:
        """Name of a file -> figure."""
        found = {
            "representatives": front_figure(
                {self.solver: self.comparison.fronts[self.solver]},
                goals=self.comparison.known.goals,
                reference=self.reference.front,
                marked=np.array([list(point.objectives.values()) for point in self.points]),
                truth_name=self._truth,
            ),
            "flights": flights_figure(self.points, laws=self.laws, solver=self.solver),
        }
        plot = getattr(self.case, "plot", None)
        if plot is not None and self.many:
            with style():
                found |= plot(self.many)
        track = getattr(self.case, "track", None)
        if track is not None:
            laws = {name: flights for name, flights in self.laws.items() if name != ALONE}
            alike = _alike([track(time_histories(point)) for point in self.points])
            found["paths"] = paths_figure(self.points, track, laws=laws, equal=alike)
        return found

    @property
    def _truth(self) -> str:
        return "truth" if self.reference.true else "reference"

    def _curve(self) -> np.ndarray | None:
        """The reference, minimised, where it is one curve of two objectives."""
        R = truth(self.reference.front)
        return R if len(pieces(R)) == 1 else None

    def _beside(self, point: Point, curve: np.ndarray | None) -> list[Cell]:
        """The second objective of the reference at the first of a point, and how much worse the point is, in ranges."""
        if curve is None:
            return []
        signs = [goal.sign for goal in self.comparison.known.goals]
        first, second = (sign * value for sign, value in zip(signs, point.objectives.values(), strict=True))
        known = float(np.interp(first, *curve.T))
        return [signs[1] * known, (second - known) / float(np.ptp(curve[:, 1]))]


def _alike(tracks: Sequence[Mapping[str, np.ndarray]]) -> bool:
    """Whether tracks are to be drawn to one scale."""
    across, up = tracks[0]
    lengths = [float(np.ptp(np.concatenate([one[side][np.isfinite(one[side])] for one in tracks]))) for side in (across, up)]
    units = {side.rpartition("[")[2] for side in (across, up)}
    return len(units) == 1 and max(lengths) <= OBLONG * min(lengths)


def time_histories(point: Point) -> dict[str, np.ndarray]:
    """States and controls of a point by name, and "time", from end to end; NaN between elements, and in phases that do not have them."""
    phases = point.trajectory.phases if point.trajectory is not None else ()
    names = list(dict.fromkeys(v.name for phase in phases for v in (*phase.state_variables, *phase.control_variables)))
    parts: dict[str, list[np.ndarray]] = {name: [] for name in ("time", *names)}
    for phase in phases:
        own = [v.name for v in (*phase.state_variables, *phase.control_variables)]
        times = along(phase, own[0])[0]
        parts["time"].append(times)
        for name in names:
            parts[name].append(along(phase, name)[1] if name in own else np.full(len(times), np.nan))
    return {name: np.concatenate(values) for name, values in parts.items()}


def _known_ends(comparison: Comparison) -> Front | None:
    """The ends that a solver of the comparison found, in the order of the objectives; none where all solvers are gradient tools, whose
    points are optima themselves; None where they are to be found."""
    found = [front for fronts in comparison.fronts.values() for front in fronts if len(front)]
    for front in found:
        if front.solver.get("name") == "payoff" and len(front) == len(front.goals):
            return front[front.F.argmin(axis=0)]
    return found[0][:0] if all(front.solver.get("name") in GRADIENT_TOOLS for front in found) else None


def _ends(front: Front) -> tuple[Front, str]:
    """Each objective optimised alone, on the transcription of a front or, if that is single shooting, on the case's own; or why not."""
    try:
        problem, method = front.compiled(), from_dict(front[0].transcription or {})
        if isinstance(method, SingleShooting):
            # Its derivatives are dense: with hundreds of nodes they take minutes, and lead nowhere where flights are unstable.
            source = front.source
            if source is None or not source.address:
                return front[:0], "Objectives were not optimised alone: single shooting is not suited to gradients."
            method = default_transcription(load(source.address, **source.data))
    except ValueError as error:
        return front[:0], f"Objectives were not optimised alone: {error}."
    found = payoff(problem, method)
    failed = [goal.name for goal, status in zip(front.goals, found.status, strict=True) if status != CONVERGED]
    return found, f"Alone, {', '.join(failed)} did not converge." if failed else ""


def _laws(place: SimpleNamespace | None, points: Sequence[Point]) -> list[Law | None]:
    """The best flights of the same durations, where the case knows them."""
    law: Callable[[float], Law] | None = getattr(place, "optimal_flight", None)
    if law is None:
        return [None] * len(points)
    return [law(float(point.trajectory.phases[-1].time[-1])) if point.trajectory is not None else None for point in points]


def _alone(points: Sequence[Point], ends: Front) -> list[Law | None]:
    """Beside the best point of each objective, that objective optimised alone."""
    found: list[Law | None] = [None] * len(points)
    for k, end in enumerate(ends):
        if end.status == CONVERGED:
            found[int(np.argmin([point.F[k] for point in points]))] = time_histories(end)
    return found


@dataclass(frozen=True, eq=False)
class Designs:
    """The variables along the front of one solver on a vector problem."""

    solver: str  # the first solver that found points
    front: Front  # that of all its runs together
    numbers: Sequence[int]  # of the points in the table

    @classmethod
    def of(cls, comparison: Comparison) -> Designs | None:
        """The front of a comparison; None if no solver found a point of a vector problem."""
        for solver in comparison.runs:
            fronts = [front for front in comparison.fronts[solver] if len(front)]
            if fronts and fronts[0].source is not None and fronts[0].source.vector:
                front = Front.merge(fronts) if len(fronts) > 1 else fronts[0]
                return cls(solver, front, representatives(front, DESIGNS))
        return None

    def table(self) -> Table:
        """Objectives and variables of a few points."""
        names = [label(goal.name, goal.unit) for goal in self.front.goals]
        names += [label(variable.name, variable.unit) for variable in self.front.variables]
        heads: list[Head | str] = ["solution", *(Head(name, digits=5) for name in names)]
        rows: list[list[Cell]] = [
            [f"point {i}", *self.front.objectives[i].tolist(), *self.front.decision[i].tolist()] for i in self.numbers
        ]
        return table(heads, rows, f"Points that stand for the front of {self.solver}.", [])

    def figures(self) -> dict[str, Figure]:
        """{name of a file: figure}: each variable along the front."""
        figure = blank_figure()
        draw_designs(self.front, f"{self.solver}: variables along the front of all runs", figure)
        return {"variables": figure}
