"""Preferences that ask for a better value of one objective than a choice has (steps 5 to 7 of Chai and others 2017)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from problems.checks import number
from problems.compiled import Objective

from ..fronts.point import Point
from ..preferences.achievement import Nimbus, ReferencePoint
from ..preferences.physical import PhysicalProgramming
from ..preferences.preference import Preference
from ..preferences.preference_functions import BOUNDARIES, Larger, ObjectiveClass, Smaller
from ..preferences.ranges import Ranges, named_numbers, places, shown


def improved(
    preference: Preference, ranges: Ranges, point: Point, name: str, to: float | None = None, giving: Mapping[str, float] | None = None
) -> Preference:
    """The preference that asks for a better value of one objective.

    In physical programming the boundaries change: those of the objective go in equal steps from what is asked for to its present value,
    which becomes its hard limit; those of `giving` are stretched, or shrunk, to end at their limits, and those of all others, if something
    is given, at their present values. Where nothing is given, others keep their boundaries. Any other preference becomes a `Nimbus` from
    the present point, by which the value that is asked for is enough: without `giving`, all others are free; with it, those that are not
    named keep their values.
    """
    goals, now = point.goals, point.objectives
    given = {} if giving is None or giving == {} else named_numbers(giving, "giving")
    places([name, *given], goals)
    by_name = {goal.name: goal for goal in goals}
    if name in given:
        raise ValueError(f"'{name}' cannot both improve and give way")
    goal = by_name[name]
    asked = ranges.best[name] if to is None else number(to, f"the value of '{name}'")
    if goal.sign * (now[name] - asked) <= 1e-9 * float(ranges.spans(goals)[goals.index(goal)]):
        what = "is at its best value" if to is None else f"is to improve to {shown(asked, goal)}, which is not better than it is"
        raise ValueError(f"'{name}' {what}: {shown(now[name], goal)}")
    if to is not None:
        ranges.check(asked, goal, "the value asked")
    for other, limit in given.items():
        if by_name[other].sign * (limit - now[other]) < 0:
            raise ValueError(
                f"'{other}' may become worse until {shown(limit, by_name[other])}, which is better than {shown(now[other], by_name[other])}"
            )
    if len(goals) < 2:
        raise ValueError(f"'{name}' is the only objective: nothing can give way for it")
    if isinstance(preference, PhysicalProgramming):
        classes = dict(preference.classes)
        classes[name] = _better(classes.get(name), goal, asked, now[name], to is not None)
        limits = {other.name: given.get(other.name, now[other.name]) for other in goals if given and other.name != name}
        for other, limit in limits.items():
            classes[other] = _ended(classes.get(other), by_name[other], ranges.best[other], limit)
        return replace(preference, classes=classes)
    others = [one.name for one in goals if one.name not in (name, *given)]
    classed = {"keep": others} if given else {"free": others}
    wanted = {"improve": [name]} if to is None else {"to": {name: asked}, "enough": True}
    return Nimbus(now, until=given, **wanted, **classed)  # type: ignore[arg-type]


def neutral(ranges: Ranges) -> ReferencePoint:
    """The preference of one who has said nothing yet: as near as can be to the best values of all objectives."""
    return ReferencePoint(dict(ranges.best))


def around(ranges: Ranges, point: Point, goal: Objective, part: float) -> ReferencePoint | None:
    """A reference point that is the present point, but for one objective which is better by a part of its range; None if it is at its
    best."""
    lows, highs = (np.array(pick) for pick in zip(*(sorted((ranges.best[n], ranges.worst[n])) for n in point.objectives), strict=True))
    J = np.clip(np.array([*point.objectives.values()]), lows, highs)
    place = point.goals.index(goal)
    span = float(ranges.spans(point.goals)[place])
    better = float(np.clip(J[place] - goal.sign * part * span, lows[place], highs[place]))
    if abs(better - J[place]) <= 1e-9 * span:
        return None
    J[place] = better
    return ReferencePoint(dict(zip(point.objectives, J.tolist(), strict=True)))


def _better(old: ObjectiveClass | None, goal: Objective, asked: float, now: float, stated: bool) -> ObjectiveClass:
    """The class of an objective that is to become better than it is now."""
    if old is None or old.SENSE is not None:
        return _even(goal, asked, now)
    if stated:
        raise ValueError(f"'{goal.name}' has values that are ideal, {old!r}: improve it without a value")
    side = next((one for one in old.sides if one.direction * (now - one.boundaries[0]) > 0), None)
    if side is None:
        raise ValueError(f"'{goal.name}' is ideal as it is: {shown(now, goal)}")
    part = abs(now - side.boundaries[0]) / float(side.lengths.sum())
    lower, upper = old.boundaries[:BOUNDARIES], old.boundaries[-BOUNDARIES:]
    boundaries = [*(lower[-1] + part * (b - lower[-1]) for b in lower), *(upper[0] + part * (b - upper[0]) for b in upper)]
    return type(old)(*dict.fromkeys(boundaries))


def _ended(old: ObjectiveClass | None, goal: Objective, best: float, limit: float) -> ObjectiveClass:
    """The class of an objective whose fifth boundary, on the side to which it gives way, is this limit."""
    if old is None:
        return _even(goal, best, limit)
    sides = [side.boundaries for side in old.sides if old.SENSE is not None or side.direction * (limit - side.boundaries[0]) > 0]
    if not sides:
        return old
    first, last = sides[0][0], sides[0][-1]
    ahead = (limit - first) * (last - first) > 0
    # Where the limit is as good as the first boundary, all are moved.
    ended = [first + (b - first) * (limit - first) / (last - first) if ahead else b + limit - last for b in sides[0]]
    ended[-1] = limit
    if len(old.sides) == 1:
        return type(old)(*ended)
    kept = [b for b in old.boundaries if b not in sides[0] or b == first]
    return type(old)(*sorted({*kept, *ended}))


def _even(goal: Objective, first: float, last: float) -> ObjectiveClass:
    """Boundaries in equal steps."""
    if goal.sign * (last - first) <= 0:
        raise ValueError(f"'{goal.name}' has no room between {shown(first, goal)} and {shown(last, goal)}")
    return (Smaller if goal.sign > 0 else Larger).even(first, last)
