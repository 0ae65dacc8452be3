"""Preferences by normalised objectives: the weighted sum, the achievement scalarising function of reference points (Wierzbicki 1980, 1982),
and NIMBUS, which says which objectives may change, and how, from a current point (Miettinen and Mäkelä 2006)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from problems.checks import check_interval
from problems.compiled import Objective

from ..fronts.point import Point
from .preference import Preference, needed
from .ranges import Ranges, limit_name, named_numbers, named_weights, names_of, places, shown
from .stage import LIMIT_TOL, Operand, Stage

AUGMENTATION = 1e-4
"""Weight of the sum of all objectives beside the largest, so that the point is properly Pareto-optimal: of the size that the books use."""


@dataclass(frozen=True, repr=False)
class WeightedSum(Preference):
    """Minimises the weighted sum of objectives that are 0 at the best and 1 at the worst value of their ranges.

    It finds no point of a part of the front that bows inward.

    Degrees: 1 at the best, 0 at the worst value of the range, linear between and beyond.

    Parameters
    ----------
    weights : dict
        By name of objectives, not negative. An objective that is not named has weight 0.

    Examples
    --------
    >>> from macs.decisions import WeightedSum
    >>> WeightedSum({"flight time": 1, "horizontal speed": 3}).words
    'weighted sum of flight time, horizontal speed'
    """

    weights: Mapping[str, float]

    DEGREE: ClassVar[str] = "degree (1: best, 0: worst)"

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", named_weights(self.weights))

    def stages(self, goals: Sequence[Objective], ranges: Ranges | None) -> tuple[Stage, ...]:
        found, spans = places(self.weights, goals), needed(ranges, self)

        def value(J: Sequence[Operand], peaks: Sequence[Operand]) -> Operand:
            normal = spans.normalised(goals, J)
            return sum(weight * normal[found[name]] for name, weight in self.weights.items())

        return (Stage("weighted sum", value),)

    def degrees(self, goals: Sequence[Objective], ranges: Ranges | None, objectives: np.ndarray) -> np.ndarray:
        return 1.0 - np.stack(needed(ranges, self).normalised(goals, list(np.asarray(objectives, dtype=float).T)), axis=1)


@dataclass(frozen=True, repr=False)
class ReferencePoint(Preference):
    """Minimises the largest distance from an aspiration, and a little of the sum of all: max_i a_i + augmentation * sum_i a_i.

    a_i is 0 at the aspiration and 1 at the reservation of objective i, linear between and beyond. It is negative where the objective is
    better than its aspiration, so that the point is Pareto-optimal whether or not the aspirations can be met.

    Degrees: 1 - a_i: 1 at the aspiration, 0 at the reservation, linear beyond.

    Parameters
    ----------
    aspiration : dict
        Values that are hoped for, by name. An objective that is not named has the best value of its range.
    reservation : dict, optional
        Values that are still acceptable, by name. An objective that is not named has the one that is a range's width worse than its
        aspiration.
    augmentation : float
        Above 0, the point is properly Pareto-optimal: no trade-off is beyond 1 / augmentation, in units of a_i.

    Examples
    --------
    >>> from macs.decisions import ReferencePoint
    >>> ReferencePoint({"flight time": 150.0}, reservation={"flight time": 180.0}).words
    'reference point of flight time'
    """

    aspiration: Mapping[str, float]
    reservation: Mapping[str, float] | None = None
    augmentation: float = AUGMENTATION

    DEGREE: ClassVar[str] = "degree (1: aspiration, 0: reservation)"

    def __post_init__(self) -> None:
        object.__setattr__(self, "aspiration", named_numbers(self.aspiration, "the aspiration"))
        if self.reservation is not None:
            object.__setattr__(self, "reservation", named_numbers(self.reservation, "the reservation"))
        check_interval("augmentation", self.augmentation, "[0, 1]")

    def lines(self, goals: Sequence[Objective], ranges: Ranges | None) -> list[tuple[float, float]]:
        """The slope of a_i and its aspiration, for each goal."""
        spans, lines = needed(ranges, self), []
        reservation = self.reservation or {}
        self.check(goals)
        for goal, span in zip(goals, spans.spans(goals).tolist(), strict=True):
            name, hoped = goal.name, self.aspiration.get(goal.name, spans.best[goal.name])
            spans.check(hoped, goal, "the aspiration")
            if name in reservation:
                spans.check(reservation[name], goal, "the reservation")
                span = goal.sign * (reservation[name] - hoped)
                if span <= 0:
                    least = f"the reservation of '{name}', {shown(reservation[name], goal)}"
                    raise ValueError(f"{least}, must be worse than its aspiration, {shown(hoped, goal)}")
            lines.append((goal.sign / span, hoped))
        return lines

    def stages(self, goals: Sequence[Objective], ranges: Ranges | None) -> tuple[Stage, ...]:
        lines = self.lines(goals, ranges)

        def distances(J: Sequence[Operand]) -> list[Operand]:
            return [slope * (value - hoped) for value, (slope, hoped) in zip(J, lines, strict=True)]

        def value(J: Sequence[Operand], peaks: Sequence[Operand]) -> Operand:
            return peaks[0] + self.augmentation * sum(distances(J))

        return (Stage("achievement", value, lambda J: [distances(J)]),)

    def degrees(self, goals: Sequence[Objective], ranges: Ranges | None, objectives: np.ndarray) -> np.ndarray:
        slopes, hoped = np.array(self.lines(goals, ranges)).T
        return 1.0 - slopes * (np.asarray(objectives, dtype=float) - hoped)


@dataclass(frozen=True, repr=False)
class Nimbus(Preference):
    """Moves from a current point: each objective is in one of five classes.

    The value is the largest of the normalised objectives of `improve`, counted from their best values, and of `to`, counted from the values
    asked for, plus `augmentation` times the sum of all normalised objectives. Those of `improve`, `to` and `keep` may not become worse than
    they are, those of `until` not worse than their limits: these are hard limits (the standard scalarisation of Miettinen and Mäkelä).

    Degrees: for `improve` and `to` the part of the way, between 0 and 1, from the current value to the best one, or to the one asked for;
    for `keep` and `until` 1 where the limit is met, else 0; NaN for `free`.

    Parameters
    ----------
    current : Point or dict
        The current point, what `decide` returned, or the objectives by name.
    improve : names, optional
        Objectives that are to improve as much as possible.
    to : dict, optional
        Objectives that are to improve to these values, which are better than the current ones.
    keep : names, optional
        Objectives that are good as they are.
    until : dict, optional
        Objectives that may become worse until these values, which are not better than the current ones.
    free : names, optional
        Objectives that may change as they will.
    augmentation : float
        See `ReferencePoint`.
    enough : bool
        Whether the values of `to` are enough. By default better ones still count. If they are enough, the largest excess over them is
        minimised, at least 0; where all are reached, the largest loss of the others is minimised, counted from their current values.
        `improve` has to be empty.

    Examples
    --------
    >>> from macs.decisions import Nimbus
    >>> now = {"flight time": 180.0, "horizontal speed": 0.6}  # or a point of a front
    >>> Nimbus(now, improve=["horizontal speed"], until={"flight time": 200.0}).words
    'nimbus of horizontal speed, flight time'
    """

    current: Mapping[str, float]
    improve: Sequence[str] = ()
    to: Mapping[str, float] = field(default_factory=dict)
    keep: Sequence[str] = ()
    until: Mapping[str, float] = field(default_factory=dict)
    free: Sequence[str] = ()
    augmentation: float = AUGMENTATION
    enough: bool = False

    DEGREE: ClassVar[str] = "part of what was asked for"

    def __post_init__(self) -> None:
        point = getattr(self.current, "point", self.current)
        given = point.objectives if isinstance(point, Point) else point
        object.__setattr__(self, "current", named_numbers(given, "the current value"))
        for name in ("improve", "keep", "free"):
            object.__setattr__(self, name, names_of(getattr(self, name), name))
        for name in ("to", "until"):
            found = getattr(self, name)
            object.__setattr__(self, name, {} if found is None or found == {} else named_numbers(found, f"'{name}'"))
        check_interval("augmentation", self.augmentation, "[0, 1]")
        if not isinstance(self.enough, bool):
            raise ValueError(f"enough must be True or False, not {self.enough!r}")
        if self.enough and self.improve:
            raise ValueError("values of `to` cannot be enough while others are to `improve` as much as possible")
        for name in self.names:
            if self.names.count(name) > 1:
                raise ValueError(f"'{name}' is in two classes of Nimbus")
        if not self.improve and not self.to:
            raise ValueError("Nimbus needs an objective that is to become better, in `improve` or `to`")
        if not self.until and not self.free:
            raise ValueError("Nimbus needs an objective that may become worse, in `until` or `free`")

    @property
    def names(self) -> tuple[str, ...]:
        return (*self.improve, *self.to, *self.keep, *self.until, *self.free)

    def check(self, goals: Sequence[Objective]) -> None:
        """Raise ValueError if an objective is in no class, one that is none is in a class, or the values of a class make no sense."""
        places([*self.current, *self.names], goals)
        for goal in goals:
            name = goal.name
            if name not in self.current:
                raise ValueError(f"the current point of Nimbus has no '{name}'")
            if name not in self.names:
                raise ValueError(f"'{name}' is in no class of Nimbus: improve, to, keep, until or free")
            now = shown(self.current[name], goal)
            if name in self.to and goal.sign * (self.to[name] - self.current[name]) >= 0:
                raise ValueError(f"'{name}' is to improve to {shown(self.to[name], goal)}, which is not better than {now}")
            if name in self.until and goal.sign * (self.until[name] - self.current[name]) < 0:
                raise ValueError(f"'{name}' may become worse until {shown(self.until[name], goal)}, which is better than {now}")

    def _checked(self, goals: Sequence[Objective], ranges: Ranges | None) -> Ranges:
        """The ranges, if each objective is in a class whose values make sense, and what is asked for lies in them."""
        spans = needed(ranges, self)
        self.check(goals)
        for goal in goals:
            if goal.name in self.to:
                spans.check(self.to[goal.name], goal, "the value in `to`")
        return spans

    @property
    def _limits(self) -> dict[str, float]:
        """The value that each limited objective may not exceed."""
        return {**{name: self.current[name] for name in (*self.improve, *self.to, *self.keep)}, **self.until}

    def stages(self, goals: Sequence[Objective], ranges: Ranges | None) -> tuple[Stage, ...]:
        spans = self._checked(goals, ranges)
        found, widths = places(self.current, goals), spans.spans(goals).tolist()
        limited, asked = self._limits, {**{name: spans.best[name] for name in self.improve}, **self.to}
        others = {name: now for name, now in self.current.items() if name not in asked}

        def excesses(J: Sequence[Operand], values: Mapping[str, float]) -> list[Operand]:
            """Over these values, in widths of ranges."""
            every = ((found[name], value) for name, value in values.items())
            return [goals[place].sign / widths[place] * (J[place] - value) for place, value in every]

        def value(J: Sequence[Operand], peaks: Sequence[Operand]) -> Operand:
            return peaks[0] + self.augmentation * sum(spans.normalised(goals, J))

        limits = (
            (lambda J: excesses(J, limited)),
            tuple(limit_name(goals[found[name]], goals[found[name]].sign, limit) for name, limit in limited.items()),
        )
        if not self.enough:
            return (Stage("achievement", value, lambda J: [excesses(J, asked)], *limits),)
        return (
            Stage("missing", lambda J, peaks: peaks[0], lambda J: [[0.0, *excesses(J, asked)]], *limits),
            Stage("loss of others", value, lambda J: [excesses(J, others)], after_zero=True),
        )

    def degrees(self, goals: Sequence[Objective], ranges: Ranges | None, objectives: np.ndarray) -> np.ndarray:
        spans, J = self._checked(goals, ranges), np.asarray(objectives, dtype=float)
        result = np.full(J.shape, np.nan)
        for place, (goal, width) in enumerate(zip(goals, spans.spans(goals), strict=True)):
            name = goal.name
            if name in self.improve or name in self.to:
                way = goal.sign * (self.current[name] - self.to.get(name, spans.best[name]))
                done = goal.sign * (self.current[name] - J[:, place])
                result[:, place] = np.clip(done / way, 0.0, 1.0) if way > 0 else 1.0
            elif name in self._limits:
                result[:, place] = np.where(goal.sign * (J[:, place] - self._limits[name]) <= LIMIT_TOL * width, 1.0, 0.0)
        return result
