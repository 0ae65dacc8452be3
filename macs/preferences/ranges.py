"""Objectives by name: checks of what is given for them, and their ranges from the best to the worst value."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from problems.checks import number, unknown
from problems.compiled import Objective

from ..evaluation.evaluator import CONVERGED
from ..fronts.points import Points
from ..pareto.dominance import SAME, nondominated

PAYOFF = "payoff"
"""The solver of a payoff table."""


def named(values: Any, what: str) -> dict[str, Any]:
    """A dict by name of objectives that is not empty."""
    if not isinstance(values, Mapping) or not values:
        raise ValueError(f"{what} must be a dict by name of objectives, such as {{'flight time': 150.0}}, not {values!r}")
    for name in values:
        if not isinstance(name, str):
            raise ValueError(f"{what} must be a dict by name of objectives, but {name!r} is no name")
    return dict(values)


def named_numbers(values: Any, what: str) -> dict[str, float]:
    """A dict of finite numbers by name of objectives."""
    return {name: number(value, f"{what} of '{name}'") for name, value in named(values, what).items()}


def named_weights(values: Any, what: str = "weights") -> dict[str, float]:
    """A dict of numbers by name of objectives, none negative, not all zero."""
    weights = named_numbers(values, what)
    for name, weight in weights.items():
        if weight < 0:
            raise ValueError(f"{what} of '{name}' must not be negative, not {weight:g}")
    if not any(weights.values()):
        raise ValueError(f"{what} must not all be zero")
    return weights


def names_of(values: Any, what: str) -> tuple[str, ...]:
    """A tuple of different names."""
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise ValueError(f"{what} must be a list of names of objectives, not {values!r}")
    names = tuple(values)
    for name in names:
        if not isinstance(name, str):
            raise ValueError(f"{what} must be a list of names of objectives, but {name!r} is no name")
        if names.count(name) > 1:
            raise ValueError(f"{what}: '{name}' is named twice")
    return names


def check_among(names: Iterable[str], known: Iterable[str], has: str, lacks: str, all_of: str) -> None:
    """Raise ValueError for a name that has something but is not among those known."""
    for name in names:
        if name not in known:
            raise ValueError(f"'{name}' has a {has} but no {lacks}; there are {all_of} of {', '.join(known)}")


def places(names: Iterable[str], goals: Sequence[Objective]) -> dict[str, int]:
    """The place of each of these objectives among the goals."""
    known = [goal.name for goal in goals]
    for name in names:
        if name not in known:
            raise ValueError(unknown("objective", name, known))
    return {name: known.index(name) for name in names}


def shown(value: float, goal: Objective) -> str:
    """A value with its unit."""
    return f"{value:.6g}{f' {goal.unit}' if goal.unit else ''}"


def limit_name(goal: Objective, side: float, limit: float) -> str:
    """What a limit of an objective says: that it is at most this large, or on the negative side at least."""
    return f"{goal.name} {'at most' if side > 0 else 'at least'} {shown(limit, goal)}"


def sense_and_unit(goal: Objective) -> str:
    """What stands below the name of an objective in a table."""
    return f"{goal.sense[:3]} [{goal.unit or '-'}]"


def levels(priorities: Any) -> tuple[tuple[str, ...], ...]:
    """Levels of priority, most important first, each a tuple of names; no name occurs twice."""
    if isinstance(priorities, str) or not isinstance(priorities, Sequence) or not priorities:
        raise ValueError(f"priorities must be a list of names of objectives, most important first, not {priorities!r}")
    found = tuple(names_of([level] if isinstance(level, str) else level, "priorities") for level in priorities)
    names_of([name for level in found for name in level], "priorities")
    return found


@dataclass(frozen=True)
class Ranges:
    """The best and the worst value of each objective, by name, in the user's units and senses.

    Preferences are normalised by them: 0 is the best, 1 the worst. An objective whose best and worst values are equal is divided by its
    size instead, by 1 if that is zero.

    Attributes
    ----------
    best, worst : dict

    Examples
    --------
    >>> from macs.decisions import Ranges
    >>> Ranges({"cost": 1.0}, {"cost": 5.0}).worst
    {'cost': 5.0}
    """

    best: Mapping[str, float]
    worst: Mapping[str, float]

    def __post_init__(self) -> None:
        for name in ("best", "worst"):
            object.__setattr__(self, name, named_numbers(getattr(self, name), name))
        for name in sorted({*self.best} ^ {*self.worst}):
            raise ValueError(f"ranges need the best and the worst value of '{name}'")

    @classmethod
    def of(cls, front: Points) -> Ranges:
        """The ranges of a front, or of a payoff table: the best and the worst values over its feasible, non-dominated points.

        Points that a simulation did not confirm do not count, but for two cases. A payoff table keeps all its ends: without one of them it
        has no ranges. And where fewer than two confirmed points are left, all feasible points count.

        Raises ValueError if no point is feasible.
        """
        if not isinstance(front, Points):
            raise ValueError(f"ranges are those of a front or a payoff table, not of {front!r}")
        doubt = confidence(front)
        feasible = doubt < 2
        kept = feasible if front.solver.get("name") == PAYOFF else doubt == 0
        if not feasible.any():
            raise ValueError(f"the front has no feasible point, so that it has no ranges{f': {front.message}' if front.message else ''}")
        F = front.F[kept][nondominated(front.F[kept])]
        if len(F) < 2:
            F = front.F[feasible][nondominated(front.F[feasible])]
        return cls.over(front.goals, F * front.signs)

    @classmethod
    def over(cls, goals: Sequence[Objective], objectives: np.ndarray) -> Ranges:
        """The best and the worst values of goals over objectives (n, m), n > 0, in the user's units and senses."""
        best, worst = {}, {}
        for goal, column in zip(goals, objectives.T, strict=True):
            ends = float(column.min()) + 0.0, float(column.max()) + 0.0
            best[goal.name], worst[goal.name] = ends if goal.sign > 0 else ends[::-1]
        return cls(best, worst)

    def to_dict(self) -> dict[str, dict[str, float]]:
        """As plain data: `Ranges(**data)` makes them again."""
        return {"best": dict(self.best), "worst": dict(self.worst)}

    def ends(self, goals: Sequence[Objective]) -> tuple[np.ndarray, np.ndarray]:
        """The best and the worst values (m,) of these goals.

        Raises ValueError if a goal has no range, if a range is of none of the goals, and if a worst value is better than the best.
        """
        places(self.best, goals)
        for goal in goals:
            if goal.name not in self.best:
                raise ValueError(f"the ranges have no '{goal.name}'; they have {', '.join(self.best)}")
            low, high = self.best[goal.name], self.worst[goal.name]
            if (high - low) * goal.sign < 0:
                raise ValueError(
                    f"'{goal.name}' is {goal.sense}d, so that its best value, {shown(low, goal)}, cannot be worse than {shown(high, goal)}"
                )
        return np.array([self.best[goal.name] for goal in goals]), np.array([self.worst[goal.name] for goal in goals])

    def spans(self, goals: Sequence[Objective]) -> np.ndarray:
        """The widths (m,) of the ranges of these goals, all positive: that of a range without width is the size of its value, or 1."""
        best, worst = self.ends(goals)
        span, size = np.abs(worst - best), np.abs(best)
        return np.where(span > 0.0, span, np.where(size > 0.0, size, 1.0))

    def normalised(self, goals: Sequence[Objective], J: Sequence[Any]) -> list[Any]:
        """The m objectives, numbers or symbols, scaled so that the best value of each is at 0 and the worst at 1."""
        best, spans = self.ends(goals)[0], self.spans(goals)
        return [(goal.sign / span) * (value - low) for goal, value, low, span in zip(goals, J, best.tolist(), spans.tolist(), strict=True)]

    def check(self, value: float, goal: Objective, what: str) -> None:
        """Raise ValueError if a value of a goal lies beyond its range by more than solves miss its ends by.

        A range without width says nothing.
        """
        low, high = sorted((self.best[goal.name], self.worst[goal.name]))
        slack = SAME * max(high - low, abs(low), abs(high))
        if low < high and not low - slack <= value <= high + slack:
            best, worst = shown(self.best[goal.name], goal), shown(self.worst[goal.name], goal)
            raise ValueError(f"{what} of '{goal.name}', {shown(value, goal)}, lies beyond its range: best {best}, worst {worst}")


def confidence(front: Points) -> np.ndarray:
    """How far each point (n,) is to be believed: 0 feasible, and no simulation contradicts it; 1 feasible; 2 neither."""
    feasible = (front.status == CONVERGED) & np.isfinite(front.F).all(axis=1)
    return np.where(feasible, front.was_simulated & ~front.verified, 2)
