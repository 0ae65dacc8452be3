"""What a choice costs the others: how objectives trade off at one point of a front, to first order.

The rates follow from the weights of the point, which are multipliers of its conditions of optimality. The matrix is that of Tappeta and
others (AIAA Journal 38(5), 2000), eqs. (26)-(33) of Chai, Savvaris, Tsourdos and Xia (IEEE T. Aerospace and Electronic Systems 53(5),
2017), where the outer product of eq. (31), which is singular, is replaced by dx = d_j (d_j'd_j)^-1 dJ_j, and the metric of the projection
by one of the controls that does not depend on the mesh and on the scales of variables (`transcription.nlp.projection`).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from problems.compiled import CompiledProblem, Objective
from problems.problem import Problem
from transcription import from_dict
from transcription.nlp.optimality import ratio_bounds, ratio_residual
from transcription.nlp.projection import TangentProjection, projection

from ..fronts.builders import CERTIFIED
from ..fronts.point import Point
from ..fronts.points import Points
from ..io.text import text_table
from ..preferences.ranges import sense_and_unit
from ..refinement.mesh_loop import latest_programs

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NO_GRADIENT = 1e-3
"""Part of a gradient that counts as none: of the weighted sum, as a part of the longest, at a Pareto-optimal point; and of one objective
within what is active."""
SOLVED_TO = 1e-6
"""Residual of the conditions of optimality that weights may leave at a point that is solved."""


def trade_offs(point: Point, *, problem: Problem | CompiledProblem | None = None) -> TradeOffs:
    """How the objectives trade off at a point of a front.

    Parameters
    ----------
    point : Point
        Of any solver; rates need its `weights`, or its problem, and the matrix its problem.
    problem : Problem, optional
        The problem of the point. Default: the one that its front knows, or finds when it is first needed.

    Returns
    -------
    TradeOffs

    Raises
    ------
    ValueError
        If the point has neither weights nor a trajectory, as those of black boxes, or `problem` is another one.

    Examples
    --------
    >>> import macs, problems
    >>> front = macs.sweep(problems.load("goddard"), points=3, starts=1)
    >>> from macs.decisions import trade_offs
    >>> trade_offs(front[1]).rate("horizontal speed", "flight time") > 0  # km/s for a second more
    True
    """
    if point.source is None:
        raise ValueError(f"point {point.index} is of a black box: without derivatives there are no trade-offs")
    if point.weights is None and (point.trajectory is None or not np.isfinite(point.F).all()):
        raise ValueError(f"point {point.index} has no trajectory: its status is '{point.status}'")
    if len(point.goals) < 2:
        raise ValueError(f"point {point.index} has one objective, '{point.goals[0].name}': there is nothing to trade it for")
    return TradeOffs(point, None if problem is None else point.source.check(problem, f"point {point.index}"))


@dataclass(frozen=True, eq=False, repr=False)
class TradeOffs:
    """How the objectives trade off at one point, to first order. Numbers are in the user's units and senses; objectives are given by name
    or by number.

    What needs the problem is computed when it is first asked for.

    Attributes
    ----------
    point : Point
    problem : CompiledProblem or None
        None: the one that the front of the point knows, or finds.

    Examples
    --------
    >>> import macs, problems
    >>> front = macs.sweep(problems.load("goddard"), points=3, starts=1)
    >>> from macs.decisions import trade_offs
    >>> found = trade_offs(front[1])
    >>> found.rate("flight time", "horizontal speed") > 0
    True
    """

    point: Point
    problem: CompiledProblem | None = None

    def __repr__(self) -> str:
        return f"<TradeOffs of point {self.point.index}: {self.point.title}>"

    @property
    def goals(self) -> tuple[Objective, ...]:
        """The objectives."""
        return self.point.goals

    @cached_property
    def weights(self) -> dict[str, float]:
        """The weights of the objectives, all minimised, of the sum that the point minimises: not negative, of sum 1 in their own units.

        Those of the point, or where it has none those that leave least of the gradients.

        Raises
        ------
        ValueError
            Where the point has none and they cannot be computed, or it is not Pareto-optimal.
        """
        if self.point.weights is not None:
            return self.point.weights
        if self.left > NO_GRADIENT:
            raise ValueError(f"point {self.point.index} is not on a front, so that there are no rates along one: {self._not_optimal}")
        w = self._projection.weights / self._projection.scales
        return dict(zip((goal.name for goal in self.goals), (w / w.sum()).tolist(), strict=True))

    @property
    def rates(self) -> np.ndarray:
        """All rates (m, m), see `rate`."""
        return rates(np.array(list(self.weights.values())), self._signs, np.nan_to_num(self.point.ranges))

    def rate(self, i: str | int, j: str | int) -> float:
        """dJ_i/dJ_j along the front, the other objectives held: -w_j/w_i for minimised objectives. Of two, it is the front's slope.

        It is infinite where objective i has weight 0, as the others have at the end of a front, and not a number where both have. At a
        corner, as at an end of a front where limits hold all that could vary, several weights do as well, and the rates are those of one of
        them: see `bounds`.

        It is a derivative, of the local optima that this point is one of. How far it holds is another question: fronts of flights with
        many active limits bend sharply, and other optima nearby, which may be better, have rates of their own.

        Raises ValueError if there is no such objective, and as `weights` does."""
        return float(self.rates[self._number(i), self._number(j)])

    def bounds(self, i: str | int, j: str | int) -> tuple[float, float]:
        """The least and the largest dJ_i/dJ_j of all weights with which the point is as optimal as points are, to `SOLVED_TO`, or as it is
        with its own. At a corner of the front, these are the rates of its sides; where it bends sharply, they say how well the rate is
        known. Raises ValueError as `rate` and `matrix` do."""
        one, other = self._number(i), self._number(j)
        if one == other:
            return 1.0, 1.0
        _, found = self.weights, self._projection
        ends = np.array(ratio_bounds(found.conditions, one, other, self._residual))
        low, high = sorted(-self._signs[one] * self._signs[other] * found.scales[one] / found.scales[other] * ends)
        return float(low), float(high)

    @property
    def matrix(self) -> np.ndarray:
        """The trade-off matrix (m, m): row i has dJ_k/dJ_i along the direction in which objective i gets better fastest within what is
        active. Active constraints with a multiplier stay so; others may be left.

        Of two objectives it has the rates; of more, the others are not held, and the direction depends on how variations are measured: see
        `transcription.nlp.projection`. Where controls are on their bounds for a while, it is known to about an element of the mesh.

        For minimised objectives a negative entry says that k gets worse while i gets better, a positive one that both get better; where one
        of the two is maximised the sign is the other one. A row of an objective that can get no better within what is active is no number.

        Raises ValueError if the problem is not at hand, or the derivatives are no numbers.
        """
        falls = self._falls / np.where(self._fixed, np.nan, np.diag(self._falls))[:, None]
        np.fill_diagonal(falls, 1.0)
        return np.outer(self._signs, self._signs) * falls

    @property
    def directions(self) -> np.ndarray:
        """The directions (m, n) of the matrix: variations of the point's decision vector in the user's units, to first order, by which
        objective i gets better by one unit. Not numbers where the row of the matrix is none. Raises ValueError as `matrix` does."""
        found = self._projection
        size = np.where(self._fixed, np.nan, np.diag(self._falls))
        return np.array([found.descent(one) for one in np.eye(len(size))]) / size[:, None]

    @property
    def left(self) -> float:
        """How much the weighted sum of the projected gradients keeps of the longest one before the projection: 0 at a Pareto-optimal point.
        Raises ValueError as `matrix` does."""
        found = self._projection
        if self.point.weights is None:
            return found.left(found.weights)
        weights = np.array(list(self.point.weights.values())) * found.scales
        return found.left(weights / weights.sum())

    @cached_property
    def messages(self) -> tuple[str, ...]:
        """What the projection says of the point: that it is not Pareto-optimal, which objectives can get better together with all others,
        and which can get no better along what is active; or why there is none. And whether weights that differ do as well, see `bounds`."""
        violation = self.point.violation
        found = [] if violation <= CERTIFIED else [f"not feasible: the violation is {violation:.1e}"]
        try:
            found += [f"not Pareto-optimal: {self._not_optimal}"] if self.left > NO_GRADIENT else []
        except ValueError as reason:
            return (*found, f"no trade-off matrix: {reason}")
        gains = self._gains
        for i, goal in enumerate(self.goals):
            if self._fixed[i]:
                found.append(f"the row of '{goal.name}' is degenerate: within what is active it can get no better")
            elif (np.delete(gains[i], i) > NO_GRADIENT).all():
                found.append(f"the row of '{goal.name}' has no negative entry: it and all others can get better together")
        return (*found, *self._corner)

    def table(self) -> str:
        """What all objectives change by when one gets better by one unit, as plain text: along the front with the others held; of more than
        two, also where it gets better fastest; and the `messages`."""
        lines = [f"Trade-offs at point {self.point.index}: {self.point.title}", ""]
        try:
            lines += [self.rates_table(), ""]
        except ValueError as reason:
            lines += [f"No rates: {reason}.", ""]
        # Where there is none, the messages have the reason.
        with suppress(ValueError):
            table = self._changes(self.matrix)
            lines += ["Where it gets better fastest, all others giving way:", table, ""] if len(self.goals) > 2 else []
        return "\n".join([*lines, *(f"{message[0].upper()}{message[1:]}." for message in self.messages)]).rstrip()

    def rates_table(self) -> str:
        """What all objectives change by along the front when one gets better by one unit, and their weights, as plain text.
        Raises ValueError as `weights` does."""
        weights = ["weight", *(f"{value:.4g}" for value in self.weights.values())]
        return f"Along the front, one other objective giving way and the rest held:\n{self._changes(self.rates.T, weights)}"

    def _changes(self, by_one: np.ndarray, *above: list[str]) -> str:
        """A table of what all objectives change by (m, m), from derivatives by the objective of the row, when that gets better by one."""
        titles = ["one better in", *(goal.name for goal in self.goals)]
        cells = [[goal.name, *(_signed(-goal.sign * value) for value in row)] for goal, row in zip(self.goals, by_one, strict=True)]
        return text_table([titles, ["", *map(sense_and_unit, self.goals)]], [*above, *cells], [True, *[False] * len(self.goals)])

    def plot(self, figure: object = None) -> Sequence[Axes]:
        """Axes with what all objectives change by when one gets better by a tenth of its range: along the front with the others held; of
        more than two, with the problem at hand, also where it gets better fastest. Darker is more of a range.
        Raises ValueError as `weights` does."""
        from .figures import draw_trade_offs

        tables = {"along the front, the rest held": self.rates.T}
        if len(self.goals) > 2:
            with suppress(ValueError):
                tables["where it gets better fastest"] = self.matrix
        return draw_trade_offs(self.goals, np.nan_to_num(self.point.ranges), tables, figure)

    @property
    def _corner(self) -> list[str]:
        """What is to be said where weights that differ do as well."""
        found = self._projection
        if self.left > NO_GRADIENT:
            return []
        heaviest = int(np.argmax(found.weights))
        for k, weight in enumerate(found.weights):
            ratio = weight / found.weights[heaviest]
            # Weights that differ by a tenth.
            trials = (ratio / 1.1, ratio * 1.1) if weight > 0.1 * NO_GRADIENT else (NO_GRADIENT,)
            if k != heaviest and any(ratio_residual(found.conditions, heaviest, k, one) <= self._residual for one in trials):
                return [self._between(heaviest, k)]
        return []

    def _between(self, i: int, j: int) -> str:
        """Text with the bounds of a rate."""
        low, high = self.bounds(i, j)
        name, other = self.goals[i].name, self.goals[j].name
        left = self._projection.conditions.residual
        why = (
            "an end, a corner or a sharp bend of the front"
            if left <= SOLVED_TO
            else f"its conditions of optimality hold to {left:.1e} only"
        )
        return f"{why}: one more in '{other}' changes '{name}' by {low + 0.0:.4g} to {high + 0.0:.4g}"

    @property
    def _residual(self) -> float:
        """What weights that do as well may leave."""
        return max(SOLVED_TO, 1.01 * self._projection.conditions.residual)

    @property
    def _signs(self) -> np.ndarray:
        return np.array([goal.sign for goal in self.goals])

    @cached_property
    def _falls(self) -> np.ndarray:
        """By how much all objectives, minimised, fall (m, m) along the steepest descent of that of the row."""
        found = self._projection
        return np.array([found.fall(one) for one in np.eye(len(found.scales))]) * found.scales

    @cached_property
    def _slopes(self) -> np.ndarray:
        """How fast each objective can fall (m,), as a part of its own gradient."""
        return np.array([self._projection.slope(one) for one in np.eye(len(self.goals))])

    @property
    def _gains(self) -> np.ndarray:
        """How fast all objectives fall (m, m) along the steepest descent of that of the row, as parts of their own gradients."""
        falls, free = self._falls / self._projection.scales, self._projection.free
        lengths = np.sqrt(np.maximum(np.diag(falls), 0.0))
        return falls / np.maximum(np.outer(lengths, free), np.finfo(float).tiny)

    @property
    def _fixed(self) -> np.ndarray:
        """Mask (m,) of the objectives that can get no better within what is active."""
        return self._slopes <= NO_GRADIENT

    @property
    def _not_optimal(self) -> str:
        left, most = 100 * self.left, 100 * NO_GRADIENT
        return f"the weighted sum of the gradients keeps {left:.2g} % of the longest of them (on a front at most {most:g} %)"

    @cached_property
    def _projection(self) -> TangentProjection:
        point = self.point
        if point.trajectory is None or point.transcription is None:
            raise ValueError(f"point {point.index} has no trajectory: its status is '{point.status}'")
        try:
            problem = self.problem or point.compiled()
        except ValueError as reason:
            raise ValueError(f"the gradients at point {point.index} need its problem, and {reason}") from None
        nlp = latest_programs(problem)(from_dict(point.transcription))
        found = projection(nlp, point.decision, point.ranges) if len(nlp.variables) == len(point.decision) else None
        if found is None:
            raise ValueError(f"the gradients of the objectives at point {point.index} are no numbers, or have no multipliers")
        return found

    def _number(self, objective: str | int) -> int:
        names = [goal.name for goal in self.goals]
        if isinstance(objective, str) and objective in names:
            return names.index(objective)
        if isinstance(objective, int | np.integer) and not isinstance(objective, bool) and 0 <= objective < len(names):
            return int(objective)
        raise ValueError(f"there is no objective {objective!r}; there are {', '.join(names)}")


def rates(weights: np.ndarray, signs: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    """dJ_i/dJ_j (..., m, m) of objectives with weights (..., m), see `TradeOffs.rate`; `signs` (m,) are -1 for maximised ones. Weights
    below 1e-6 of the largest, in `ranges` (m,) as far as these are known, are round-off and count as 0."""
    worth = weights * np.where(ranges > 0, ranges, 0.0)
    nothing = (ranges > 0) & (worth < 1e-6 * worth.max(axis=-1, keepdims=True))
    weights = np.where(nothing, 0.0, weights)
    with np.errstate(divide="ignore", invalid="ignore"):
        found = -np.outer(signs, signs) * (weights[..., None, :] / weights[..., :, None])
    found[..., np.eye(len(signs), dtype=bool)] = 1.0
    return found


def front_rates(front: Points) -> np.ndarray:
    """dJ_i/dJ_j (n, m, m) at all points of a front, the other objectives held, in the user's units and senses; see `TradeOffs.rate`. Not
    numbers at points without `weights`.

    Parameters
    ----------
    front : Front
        Points with their `weights`.

    Examples
    --------
    >>> import macs, problems
    >>> front = macs.sweep(problems.load("goddard"), points=3, starts=1)
    >>> from macs.decisions import front_rates
    >>> front_rates(front).shape
    (3, 2, 2)
    """
    m = len(front.goals)
    weights = [np.full(m, np.nan) if point.weights is None else np.array(list(point.weights.values())) for point in front]
    ranges = np.nan_to_num(np.ptp(front.F, axis=0)) if len(front) else np.zeros(m)
    return rates(np.array(weights).reshape(-1, m), front.signs, ranges)


def plot_rates(front: Points, figure: object = None) -> Sequence[Axes]:
    """Axes with the trade-off rates along a front. Of two objectives: the front with its slope at each point, and below the slopes, beside
    those of the chords between neighbours. Of more: for each pair, the front with its slope at each point when the others are held.

    Parameters
    ----------
    front : Points
        Those without `weights` have no slope.
    figure : matplotlib Figure, optional
        Empty figure to draw into. Default: a new one.

    Raises
    ------
    ValueError
        If there is only one objective, or no point has weights.

    Examples
    --------
    >>> import macs, problems
    >>> front = macs.sweep(problems.load("goddard"), points=3, starts=1)
    >>> from macs.decisions import plot_rates
    >>> axes = plot_rates(front)
    >>> len(axes) > 0
    True
    """
    from .figures import draw_rates

    return draw_rates(front, front_rates(front), figure)


def _signed(value: float) -> str:
    return "-" if np.isnan(value) else f"{value + 0.0:+.4g}"
