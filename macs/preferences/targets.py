"""Targets of objectives, and by how much objectives miss them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from problems.checks import number, positive
from problems.compiled import Objective

from .checks import named, places, shown
from .operands import greatest
from .ranges import Ranges
from .stage import Operand, Stage


@dataclass(frozen=True)
class Around:
    """A target that an objective is to be near to, on either side.

    Parameters
    ----------
    value : float
        In the objective's unit.
    tolerance : float or pair of floats, optional
        How far below and above the membership of a fuzzy goal is zero. Default: the ends of the objective's range.

    Examples
    --------
    >>> from macs import sweep
    >>> from problems import load
    >>> from transcription import DFET
    >>> front = sweep(load("goddard"), DFET(6, 6, basis="bernstein"), points=3, starts=1)
    >>> from macs.decisions import Around, FuzzyGoal
    >>> wish = FuzzyGoal({"flight time": Around(180.0, tolerance=50.0)})
    >>> print(wish.rank(front).order)  # best first
    [1 2 0]
    """

    value: float
    tolerance: float | tuple[float, float] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "value", number(self.value, "the value of Around"))
        given = self.tolerance
        if isinstance(given, Sequence) and not isinstance(given, str):
            if len(given) != 2:
                raise ValueError(f"the tolerance of Around must be a number or a pair (below, above), not {given!r}")
            both = (positive(given[0], "the tolerance of Around below"), positive(given[1], "the tolerance of Around above"))
            object.__setattr__(self, "tolerance", both)
        elif given is not None:
            object.__setattr__(self, "tolerance", positive(given, "the tolerance of Around"))

    @property
    def sides(self) -> tuple[float, float] | None:
        """The tolerance below and above."""
        if self.tolerance is None or isinstance(self.tolerance, tuple):
            return self.tolerance
        return self.tolerance, self.tolerance


Target = float | Around


def named_targets(values: Any, what: str = "the target") -> dict[str, Target]:
    """Targets by name: a number, which a minimised objective is not to exceed and a maximised one is to reach, or `Around`."""
    given = named(values, f"{what}s")
    return {name: value if isinstance(value, Around) else number(value, f"{what} of '{name}'") for name, value in given.items()}


@dataclass(frozen=True)
class Aim:
    """A target of one objective, with what counts as one in missing it."""

    place: int  # of the objective among the goals
    # Each slope * (J - target) is positive where the target is missed on this side; one side, or two for `Around`.
    sides: tuple[tuple[float, float], ...]
    best: bool = False  # whether the target is the best value of the range, so that nothing is better

    def excesses(self, J: Sequence[Operand]) -> list[Operand]:
        """Excess over the target on each side; the largest of them and 0 is the deviation."""
        return [slope * (J[self.place] - target) for slope, target in self.sides]

    def parts(self, J: Sequence[Operand]) -> list[Operand]:
        """Of which the largest is the deviation."""
        return self.excesses(J) if self.best else [0.0, *self.excesses(J)]

    def deviation(self, J: Sequence[Operand]) -> Operand:
        """The deviation from the target; not cut off at zero, where it would have a kink, if nothing is better than the target."""
        if self.best:
            return self.excesses(J)[0]
        return sum(greatest(excess, 0.0) for excess in self.excesses(J))


def aims(
    targets: Mapping[str, Target],
    goals: Sequence[Objective],
    ranges: Ranges,
    tolerances: Mapping[str, float] | None = None,
    to_worst: bool = False,
) -> dict[str, Aim]:
    """Aims by name, for targets that lie within the ranges."""
    found, spans = places(targets, goals), ranges.spans(goals)
    given = tolerances or {}
    result = {}
    for name, target in targets.items():
        place = found[name]
        goal, span = goals[place], float(spans[place])
        value = target.value if isinstance(target, Around) else target
        ranges.check(value, goal, "the target")
        best, worst = ranges.best[name], ranges.worst[name]
        if isinstance(target, Around):
            below, above = target.sides or ((value - min(best, worst), max(best, worst) - value) if to_worst else (span, span))
            ends = [(-1.0, below), (1.0, above)]
        else:
            ends = [(goal.sign, given.get(name, goal.sign * (worst - value) if to_worst else span))]
        for _, width in ends:
            if width <= 0 and best != worst:
                raise ValueError(
                    f"the target of '{name}', {shown(value, goal)}, is the end of its range: give a tolerance, or another target"
                )
        sides = tuple((sign / (width if width > 0 else span), value) for sign, width in ends)
        result[name] = Aim(place, sides, not isinstance(target, Around) and goal.sign * (value - best) <= 0)
    return result


def memberships(aims_of: Mapping[str, Aim], objectives: np.ndarray, m: int) -> np.ndarray:
    """Memberships (n, m) of the fuzzy sets of points that meet each target: 1 where it is met, 0 where it is missed by one or more; NaN
    for an objective without a target."""
    J = list(np.asarray(objectives, dtype=float).T)
    result = np.full((len(objectives), m), np.nan)
    for aim in aims_of.values():
        result[:, aim.place] = 1.0 - np.clip(np.max(aim.excesses(J), axis=0), 0.0, 1.0)
    return result


def tolerance_limits(
    aims_of: Mapping[str, Aim], goals: Sequence[Objective]
) -> tuple[Callable[[Sequence[Operand]], list[Operand]], tuple[str, ...]]:
    """Hard limits where memberships become zero, and what each says."""
    names = []
    for aim in aims_of.values():
        goal = goals[aim.place]
        for slope, target in aim.sides:
            names.append(f"{goal.name} {'at most' if slope > 0 else 'at least'} {shown(target + 1.0 / slope, goal)}")

    def limits(J: Sequence[Operand]) -> list[Operand]:
        return [excess - 1.0 for aim in aims_of.values() for excess in aim.excesses(J)]

    return limits, tuple(names)


def sum_of_all(goals: Sequence[Objective], ranges: Ranges) -> Stage:
    """The stage that chooses among points which meet all targets: the least sum of all normalised objectives, which is not dominated."""
    return Stage("sum of all", lambda J, peaks: sum(ranges.normalised(goals, J)), after_zero=True)
