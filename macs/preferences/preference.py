"""The contract of a preference: what a person wants, by name of objectives, in the user's units and senses."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from problems.compiled import Objective

from ..fronts.point import Point
from .checks import places
from .ranges import Ranges
from .ranking import Ranking, ranked
from .stage import Stage

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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
    >>> from macs import sweep
    >>> from problems import load
    >>> from transcription import DFET
    >>> front = sweep(load("goddard"), DFET(6, 6, basis="bernstein"), points=3, starts=1)
    >>> from macs.decisions import Preference, WeightedSum
    >>> wish = WeightedSum({"flight time": 1, "horizontal speed": 3})
    >>> print(isinstance(wish, Preference), len(wish.rank(front).order))
    True 3
    """

    DEGREE: ClassVar[str] = "degree"
    """What a degree is, for axes of figures."""
    SMALLER: ClassVar[bool] = False
    """Whether smaller degrees are better."""
    MARKS: ClassVar[tuple[tuple[float, str], ...]] = ()
    """Degrees that mean something, with the words, for axes of figures."""

    @property
    def title(self) -> str:
        """The name of the method, for figures."""
        return re.sub("(?<=[a-z])(?=[A-Z])", " ", type(self).__name__).lower()

    @property
    def words(self) -> str:
        """The name of the method, and the objectives that it speaks of."""
        return f"{self.title} of {', '.join(self.names)}"

    @property
    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """Names of the objectives that it speaks of."""

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

    def rank(self, front: Any, ranges: Ranges | None = None) -> Ranking:
        """The points of a front in the order of this preference. Instant: no problem is solved, so that black boxes have it, too.

        Points within the hard limits of the preference come first: those that a simulation confirms, or that were not simulated, then the
        others; then points that exceed a hard limit, the same way, which have the value infinity and are ordered by how much they exceed
        it; at last those that are not feasible. See `macs.preferences.ranking.standing`; `decide` has the same order. Where values are
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
        return ranked(self, front, ranges)

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
        from .pictures.degree_plot import draw_degrees

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
        from .pictures.function_plot import draw_functions

        curves = self._curves(front.goals, Ranges.of(front) if ranges is None else ranges)
        return draw_functions(curves, self.title, self._curve_label(), self.SMALLER, front.objectives, best, figure)

    def _curve_label(self) -> str:
        """Label of the vertical axes of `plot_functions`."""
        return self.DEGREE

    def _curves(self, goals: Sequence[Objective], ranges: Ranges) -> list[Any]:
        """What `plot_functions` draws."""
        from .pictures.function_plot import Curve

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


def needed(ranges: Ranges | None, preference: Preference) -> Ranges:
    """The ranges, which this preference needs."""
    if not isinstance(ranges, Ranges):
        raise ValueError(f"{type(preference).__name__} needs the ranges of the objectives: Ranges.of(front), not {ranges!r}")
    return ranges
