"""The contract of a preference: what a person wants, by name of objectives, in the user's units and senses; and points in its order."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from problems.checks import short_repr
from problems.compiled import Objective

from ..fronts.point import Point
from ..fronts.points import Points
from ..fronts.verified import VERIFY
from ..io.text import counted, numbers, text_table
from .ranges import Ranges, confidence, places, sense_and_unit
from .stage import LIMIT_TOL, Stage, check_limits, exceeded, ordering

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CONFIRMED, DOUBTFUL, BEYOND, BEYOND_AND_DOUBTFUL, INFEASIBLE = range(5)
"""Standings of points, see `standing`."""


class Preference(ABC):
    """What a person wants. Its classes are frozen dataclasses; each says in its docstring what its degrees are.

    The same formulas rank points that exist (`rank`) and are minimised on the problem itself (`macs.decisions.decide`): they are applied to
    numbers and to symbols of CasADi alike.

    Parameters
    ----------
    **settings
        Those of each class.

    Examples
    --------
    >>> from macs.decisions import Preference, WeightedSum
    >>> isinstance(WeightedSum({"flight time": 1, "horizontal speed": 3}), Preference)
    True
    """

    DEGREE: ClassVar[str] = "degree"
    """What a degree is, for axes of figures."""
    SMALLER: ClassVar[bool] = False
    """Whether smaller degrees are better."""
    MARKS: ClassVar[tuple[tuple[float, str], ...]] = ()
    """Degrees that mean something, with the words, for axes of figures."""

    __repr__ = short_repr

    @property
    def title(self) -> str:
        """The name of the method, for figures."""
        return re.sub("(?<=[a-z])(?=[A-Z])", " ", type(self).__name__).lower()

    @property
    def words(self) -> str:
        """The name of the method, and the objectives that it speaks of."""
        return f"{self.title} of {', '.join(self.names)}"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the objectives that it speaks of: by default, those by which its settings are given."""
        return tuple(dict.fromkeys(name for settings in vars(self).values() if isinstance(settings, Mapping) for name in settings))

    def check(self, goals: Sequence[Objective]) -> None:
        """Raise ValueError for what can be told to be wrong without ranges: names that are none of these goals'."""
        places(self.names, goals)

    @abstractmethod
    def stages(self, goals: Sequence[Objective], ranges: Ranges | None) -> tuple[Stage, ...]:
        """The scalar functions that are minimised, one after the other: mostly one, several where the preference is lexicographic.

        Parameters
        ----------
        goals : m Objectives
            Of the problem.
        ranges : Ranges or None
            By which objectives are normalised. Physical programming needs none.

        Raises
        ------
        ValueError
            For unknown names of objectives, targets beyond the ranges, and missing ranges.
        """

    @abstractmethod
    def degrees(self, goals: Sequence[Objective], ranges: Ranges | None, objectives: np.ndarray) -> np.ndarray:
        """How well each objective is satisfied (n, m) at objectives (n, m); NaN for one that does not enter the preference.

        The objectives may be any, for example those that another preference chose.
        """

    def rank(self, front: Points, ranges: Ranges | None = None) -> Ranking:
        """The points of a front in the order of this preference. Instant: no problem is solved, so that black boxes have it, too.

        Points within the hard limits of the preference come first: those that a simulation confirms, or that were not simulated, then the
        others; then points that exceed a hard limit, the same way, which have the value infinity and are ordered by how much they exceed
        it; at last those that are not feasible. See `macs.preferences.preference.standing`; `decide` has the same order. Where values are
        equal, the point with the smaller sum of normalised objectives is first.

        Parameters
        ----------
        front : Front
        ranges : Ranges, optional
            Default: those of the front. Give them if the front does not have its ends, or to compare several fronts.

        Raises
        ------
        ValueError
            For a front without a feasible point, and where `stages` raises one.
        """
        if not isinstance(front, Points):
            raise ValueError(f"a front is ranked, not {front!r}")
        if (confidence(front) == 2).all():
            raise ValueError(f"the front has no feasible point to rank{f': {front.message}' if front.message else ''}")
        ranges = Ranges.of(front) if ranges is None else ranges
        stages: Sequence[Stage] = self.stages(front.goals, ranges)
        check_limits(stages)
        J, rank = front.objectives, standing(stages[0], front)
        with np.errstate(invalid="ignore"):
            tie = np.sum(ranges.normalised(front.goals, list(J.T)), axis=0)
        order, values = ordering(stages, J, rank, tie)
        return Ranking(
            front,
            self,
            ranges,
            values,
            self.degrees(front.goals, ranges, J),
            order,
            _message(stages[0], front, rank, order),
            tuple(stage.name for stage in stages),
        )

    def plot_degrees(self, choices: Mapping[str, Any], ranges: Ranges | None = None, ax: Axes | None = None) -> Axes:
        """Axes with the degrees of several choices as bars side by side, a group of bars for each objective.

        Parameters
        ----------
        choices : dict
            Points, or what `decide` returns, by the name that the legend shows, of the same problem. They need not be chosen by this
            preference.
        ranges : Ranges, optional
            Needed by all but physical programming.
        ax : Axes, optional
            Default: those of a new figure.
        """
        from .pictures import draw_degrees

        points: dict[str, Any] = {name: getattr(one, "point", one) for name, one in choices.items()} if isinstance(choices, Mapping) else {}
        if not points or not all(isinstance(point, Point) for point in points.values()):
            raise ValueError(f"choices must be a dict of points by name, not {choices!r}")
        goals = next(iter(points.values())).goals
        for name, point in points.items():
            if point.goals != goals:
                raise ValueError(f"'{name}' is a point of another problem: its objectives are {', '.join(point.objectives)}")
        J = np.array([[*point.objectives.values()] for point in points.values()])
        found = dict(zip(points, self.degrees(goals, ranges, J), strict=True))
        return draw_degrees(found, [goal.name for goal in goals], self.DEGREE, self.MARKS, self.SMALLER, ax=ax)

    def plot_functions(self, front: Any, ranges: Ranges | None = None, best: int | None = None, figure: Any = None) -> np.ndarray:
        """Axes, one for each objective, with what the preference makes of it, and the points of a front on it.

        Physical programming shows its preference functions; the others show the degrees.

        Parameters
        ----------
        front : Front
        ranges : Ranges, optional
            Default: those of the front.
        best : int, optional
            The point of the front that is marked.
        figure : Figure, optional
            Default: a new one.
        """
        from .pictures import draw_functions

        curves = self._curves(front.goals, Ranges.of(front) if ranges is None else ranges)
        return draw_functions(curves, self.title, self._curve_label(), self.SMALLER, front.objectives, best, figure)

    def _curve_label(self) -> str:
        """Label of the vertical axes of `plot_functions`."""
        return self.DEGREE

    def _curves(self, goals: Sequence[Objective], ranges: Ranges) -> list[Any]:
        """What `plot_functions` draws."""
        from .pictures import Curve

        best, worst = ranges.ends(goals)
        middle, margin = 0.5 * (best + worst), 0.05 * ranges.spans(goals)
        low, high = np.minimum(best, worst) - margin, np.maximum(best, worst) + margin
        enters = ~np.isnan(self.degrees(goals, ranges, middle[None])[0])

        def degree(place: int) -> Callable[[np.ndarray], np.ndarray]:
            def of(x: np.ndarray) -> np.ndarray:
                J = np.tile(middle, (len(x), 1))
                J[:, place] = x
                return self.degrees(goals, ranges, J)[:, place]

            return of

        return [Curve(goal, k, ((self.DEGREE, degree(k)),), float(low[k]), float(high[k])) for k, goal in enumerate(goals) if enters[k]]


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
    >>> import macs, problems
    >>> front = macs.sweep(problems.load("goddard"), points=3, starts=1)
    >>> from macs.decisions import WeightedSum
    >>> ranking = WeightedSum({"flight time": 1, "horizontal speed": 0}).rank(front)
    >>> print(ranking.order[0])
    0
    """

    front: Points
    preference: Preference
    ranges: Ranges
    stage_values: np.ndarray
    degrees: np.ndarray
    order: np.ndarray
    message: str = ""
    stage_names: tuple[str, ...] = ()

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

    def table(self, rows: int | None = 20) -> str:
        """The best points as plain text: objectives, value, and the degree of each objective.

        Parameters
        ----------
        rows : int or None
            Most points to show; None: all.
        """
        front, shown = self.front, self.order[:rows]
        titles, units, cells = ["rank", "#"], ["", ""], [[str(k + 1) for k in range(len(shown))], [str(i) for i in shown]]
        for goal, column, tolerance in zip(front.goals, front.objectives[shown].T, front.resolution, strict=True):
            titles.append(goal.name)
            units.append(sense_and_unit(goal))
            cells.append(numbers(column, tolerance))
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
        from .pictures import draw_ranking

        doubtful = confidence(self.front) > 0
        apart = {"exceeds a hard limit": ~np.isfinite(self.values) & ~doubtful, "not feasible or not verified": doubtful}
        return draw_ranking(self.front, self.order, apart, self.preference.title, ax)

    def plot_degrees(self, count: int = 3, ax: Axes | None = None) -> Axes:
        """Axes with the degrees of the best points as bars side by side."""
        rows = [int(i) for i in self.order[:count]]
        return self.preference.plot_degrees({f"rank {k + 1} (#{i})": self.front[i] for k, i in enumerate(rows)}, self.ranges, ax)

    def plot_functions(self, figure: Any = None) -> np.ndarray:
        """Axes, one for each objective, with what the preference makes of it, the points of the front on it, and the best marked."""
        return self.preference.plot_functions(self.front, self.ranges, self.best.index, figure)


def needed(ranges: Ranges | None, preference: Preference) -> Ranges:
    """The ranges, which this preference needs."""
    if not isinstance(ranges, Ranges):
        raise ValueError(f"{type(preference).__name__} needs the ranges of the objectives: Ranges.of(front), not {ranges!r}")
    return ranges


def standing(limits: Stage, points: Points, verify: float | None = None) -> np.ndarray:
    """What comes before all preference: the standing (n,) of each point among others; less is better.

    0: within the hard limits, and no simulation contradicts it; 1: within them, but a simulation contradicts it; 2, 3: the same beyond
    them; 4: not feasible. A point beyond a hard limit is no choice, whatever confirms it; one within that is not confirmed is a doubtful
    choice. So a limit that is said to be hard is not given up for an error that is known. What a simulation contradicts is within the
    limits only if what was simulated is, too, but for `verify`.
    """
    sure, missed = confidence(points), verify or points.stats.get("verify") or VERIFY
    claimed, simulated = limits.excess(points.objectives), limits.excess(points.simulated_F * points.signs)
    beyond = (claimed > LIMIT_TOL) | ((sure == DOUBTFUL) & (simulated > missed))
    return np.where(sure <= DOUBTFUL, sure + np.where(beyond, BEYOND, CONFIRMED), INFEASIBLE)


def within_limits(limits: Stage, point: Point) -> bool:
    """Whether a point is within the limits of a stage."""
    return bool(limits.excess(np.array([[*point.objectives.values()]]))[0] <= LIMIT_TOL)


def keeps_limits(limits: Stage, point: Point, verify: float) -> bool:
    """Whether a feasible point is within the limits of a stage, as far as `standing` tells."""
    return bool(standing(limits, point.alone(), verify)[0] < BEYOND)


def _message(limits: Stage, front: Points, rank: np.ndarray, order: np.ndarray) -> str:
    """What is to be known about the best point."""
    best, parts = rank[order[0]], []
    if best >= BEYOND:
        J = front.objectives[rank < INFEASIBLE]
        least = np.min(limits.excesses(J), axis=0)
        never = [name for value, name in zip(least, limits.titles(len(least)), strict=True) if value > LIMIT_TOL]
        claimed = (limits.excess(J) <= LIMIT_TOL).any()
        how = "; none has " + ", nor ".join(never) if never else " when simulated" if claimed else " together"
        parts.append(f"No point meets all hard limits{how}.")
    nearest = [int(i) for i in order if rank[i] == BEYOND]
    if best == DOUBTFUL and nearest:
        missed = exceeded(limits, front.goals, front.objectives[nearest[0]])
        parts.append(f"The best point is not confirmed by a simulation; confirmed ones exceed hard limits: of the nearest, {missed}.")
    elif best in (DOUBTFUL, BEYOND_AND_DOUBTFUL):
        parts.append("No point was confirmed by a simulation.")
    return " ".join(parts)
