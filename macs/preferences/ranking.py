"""Ranking: the points of a front in the order of a preference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..fronts.point import Point
from ..fronts.points import Points
from ..fronts.verified import VERIFY
from ..io.text import counted, numbers, text_table
from .ranges import Ranges, confidence, usable
from .stage import SLACK, Stage, exceeded, ordering

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHOWN = 20
"""Rows of a table."""
CONFIRMED, DOUBTFUL, BEYOND, BEYOND_AND_DOUBTFUL, INFEASIBLE = range(5)
"""Standings of points, see `standing`."""


@dataclass(frozen=True, eq=False, repr=False)
class Ranking:
    """The points of a front in the order of a preference.

    Attributes
    ----------
    front : Points
    preference : Preference
    ranges : Ranges
        By which objectives were normalised.
    stage_values : array (n, number of stages)
        Values of the stages of the preference: smaller is better, infinite where a hard limit is exceeded or an objective is not finite,
        NaN where a stage does not follow (see `Stage.after_zero`).
    degrees : array (n, m)
        How well each objective is satisfied; see the class of the preference.
    order : array (n,) of int
        Rows of the front, best first.
    message : str
        What is to be known about the best point: that it exceeds hard limits, as all points do; that no simulation confirms it, and by how
        much confirmed points exceed the hard limits, if there are any.

    Examples
    --------
    >>> from macs import sweep
    >>> from problems import load
    >>> from transcription import DFET
    >>> front = sweep(load("goddard"), DFET(6, 6, basis="bernstein"), points=3, starts=1)
    >>> from macs.decisions import WeightedSum
    >>> ranking = WeightedSum({"flight time": 1, "horizontal speed": 0}).rank(front)
    >>> print(ranking.order[0])
    0
    """

    front: Points
    preference: Any
    ranges: Ranges
    stage_values: np.ndarray
    degrees: np.ndarray
    order: np.ndarray
    message: str = ""
    stage_names: tuple[str, ...] = field(default=())

    @property
    def values(self) -> np.ndarray:
        """Values (n,) of the preference, of its first stage if there are several: smaller is better."""
        return self.stage_values[:, 0]

    @cached_property
    def best(self) -> Point:
        """The best point of the front."""
        return self.front[int(self.order[0])]

    def __len__(self) -> int:
        return len(self.order)

    def __repr__(self) -> str:
        return f"<Ranking of {counted(len(self), 'point')} by {self.preference!r}: best {self.best.title}>"

    def table(self, rows: int | None = SHOWN) -> str:
        """The best points as plain text: objectives, value, and the degree of each objective.

        Parameters
        ----------
        rows : int or None
            Most points to show; None: all.
        """
        front, shown = self.front, self.order[:rows]
        titles, units, cells = ["rank", "#"], ["", ""], [[str(k + 1) for k in range(len(shown))], [str(i) for i in shown]]
        for goal, column in zip(front.goals, front.objectives[shown].T, strict=True):
            titles.append(goal.name)
            units.append(f"{goal.sense[:3]} [{goal.unit or '-'}]")
            cells.append(numbers(column))
        for name, column in zip(self.stage_names, self.stage_values[shown].T, strict=True):
            if not np.isnan(column).all():
                titles.append("value")
                units.append(name)
                cells.append([f"{value:.6g}" if np.isfinite(value) else "-" for value in column])
        for goal, column in zip(front.goals, self.degrees[shown].T, strict=True):
            if not np.isnan(column).all():
                titles.append("degree")
                units.append(goal.name)
                cells.append(["-" if np.isnan(value) else f"{value + 0.0:.3f}" for value in column])
        lines = [repr(self.preference), "", text_table([titles, units], list(zip(*cells, strict=True)), [False] * len(titles))]
        if len(shown) < len(self):
            lines.append(f"... {counted(len(self) - len(shown), 'more point')}")
        return "\n".join([*lines, *(["", self.message] if self.message else [])])

    def plot(self, ax: Axes | None = None) -> Axes:
        """Axes with the front, its points coloured by rank, and the best marked: two objectives as a scatter plot, more as parallel
        coordinates. Points that exceed a hard limit, are not feasible or not verified are hollow, or broken lines."""
        from .pictures.ranking_plot import draw_ranking

        doubtful = ~usable(self.front)[1]
        apart = {"exceeds a hard limit": ~np.isfinite(self.values) & ~doubtful, "not feasible or not verified": doubtful}
        return draw_ranking(self.front, self.order, apart, self.preference.title, ax)

    def plot_degrees(self, count: int = 3, ax: Axes | None = None) -> Axes:
        """Axes with the degrees of the best points as bars side by side."""
        rows = [int(i) for i in self.order[:count]]
        return self.preference.plot_degrees({f"rank {k + 1} (#{i})": self.front[i] for k, i in enumerate(rows)}, self.ranges, ax)

    def plot_functions(self, figure: Any = None) -> np.ndarray:
        """Axes, one for each objective, with what the preference makes of it, the points of the front on it, and the best marked."""
        return self.preference.plot_functions(self.front, self.ranges, self.best.index, figure)


def ranked(preference: Any, front: Points, ranges: Ranges | None = None) -> Ranking:
    """The points of a front in the order of a preference; see `Preference.rank`."""
    if not isinstance(front, Points):
        raise ValueError(f"a front is ranked, not {front!r}")
    if not usable(front)[0].any():
        raise ValueError(f"the front has no feasible point to rank{f': {front.message}' if front.message else ''}")
    ranges = Ranges.of(front) if ranges is None else ranges
    stages: Sequence[Stage] = preference.stages(front.goals, ranges)
    J, rank = front.objectives, standing(stages, front)
    with np.errstate(invalid="ignore"):
        tie = np.sum(ranges.normalised(front.goals, list(J.T)), axis=0)
    found = ordering(stages, J, rank, tie)
    return Ranking(
        front,
        preference,
        ranges,
        found.values,
        preference.degrees(front.goals, ranges, J),
        found.order,
        _message(stages, front, rank, found.order),
        tuple(stage.name for stage in stages),
    )


def standing(stages: Sequence[Stage], points: Points, verify: float | None = None) -> np.ndarray:
    """What comes before all preference: the standing (n,) of each point among others; less is better.

    0: within the hard limits, and no simulation contradicts it; 1: within them, but a simulation contradicts it; 2, 3: the same beyond
    them; 4: not feasible. A point beyond a hard limit is no choice, whatever confirms it; one within that is not confirmed is a doubtful
    choice. So a limit that is said to be hard is not given up for an error that is known. What a simulation contradicts is within the
    limits only if what was simulated is, too, but for `verify`.
    """
    sure, missed = confidence(points), verify or points.stats.get("verify") or VERIFY
    claimed, simulated = (
        np.max([stage.excess(J) for stage in stages], axis=0) for J in (points.objectives, points.simulated_F * points.signs)
    )
    beyond = (claimed > SLACK) | ((sure == DOUBTFUL) & (simulated > missed))
    return np.where(sure <= DOUBTFUL, sure + np.where(beyond, BEYOND, CONFIRMED), INFEASIBLE)


def _message(stages: Sequence[Stage], front: Points, rank: np.ndarray, order: np.ndarray) -> str:
    """What is to be known about the best point."""
    best, parts = rank[order[0]], []
    if best >= BEYOND:
        J = front.objectives[rank < INFEASIBLE]
        most = [(stage, np.min(stage.excesses(J), axis=0)) for stage in stages]
        never = [name for stage, least in most for value, name in zip(least, stage.titles(len(least)), strict=True) if value > SLACK]
        claimed = (np.max([stage.excess(J) for stage in stages], axis=0) <= SLACK).any()
        how = "; none has " + ", nor ".join(dict.fromkeys(never)) if never else " when simulated" if claimed else " together"
        parts.append(f"No point meets all hard limits{how}.")
    nearest = [int(i) for i in order if rank[i] == BEYOND]
    if best == DOUBTFUL and nearest:
        # Stages may share their limits.
        each = dict.fromkeys(exceeded(stage, front.goals, front.objectives[nearest[0]]) for stage in stages)
        missed = ", ".join(filter(None, each))
        parts.append(f"The best point is not confirmed by a simulation; confirmed ones exceed hard limits: of the nearest, {missed}.")
    elif best in (DOUBTFUL, BEYOND_AND_DOUBTFUL):
        parts.append("No point was confirmed by a simulation.")
    return " ".join(parts)
