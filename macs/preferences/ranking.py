"""Ranking: the points of a front in the order of a preference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..fronts.point import Point
from ..fronts.points import Points
from ..io.text import counted, numbers, text_table
from .ranges import Ranges, confidence, usable
from .stage import SLACK, Stage, ordering

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHOWN = 20
"""Rows of a table."""


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
        What is to be known about the best point: no point meets the hard limits, or none was confirmed by a simulation.
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
        front, shown = self.front, self.order[: len(self) if rows is None else rows]
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
    J, kind = front.objectives, confidence(front)
    with np.errstate(invalid="ignore"):
        tie = np.sum(ranges.normalised(front.goals, list(J.T)), axis=0)
    found = ordering(stages, J, kind, tie)
    best = found.order[0]
    return Ranking(
        front,
        preference,
        ranges,
        found.values,
        preference.degrees(front.goals, ranges, J),
        found.order,
        _message(stages, J[kind < 2], found.excess[best] > 0.0, kind[best] > 0),
        tuple(stage.name for stage in stages),
    )


def _message(stages: Sequence[Stage], J: np.ndarray, exceeded: bool, unconfirmed: bool) -> str:
    """What is to be known about the best point."""
    parts = []
    if exceeded:
        most = [(np.min(stage.excesses(J), axis=0), stage.limit_names) for stage in stages]
        never = [name for least, names in most for value, name in zip(least, names, strict=True) if value > SLACK]
        parts.append(f"No point meets all hard limits{'; none has ' + ', nor '.join(never) if never else ' together'}.")
    if unconfirmed:
        parts.append("No point was confirmed by a simulation.")
    return " ".join(parts)
