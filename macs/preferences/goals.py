"""Preferences by targets: goal programming (Charnes and Cooper 1961), the best memberships of fuzzy goals (Zimmermann 1978; Tiwari, Dharmar
and Rao 1987), and memberships with an order of priority that is relaxed (Hu and Li 2006; Bae and others)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain, pairwise
from typing import Any, ClassVar

import numpy as np

from problems.checks import check_choice, check_interval, number, positive
from problems.compiled import Objective

from .preference import Preference, needed
from .ranges import Ranges, check_among, levels, limit_name, named, named_weights, places, shown
from .stage import Operand, Stage, greatest


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
    >>> from macs.decisions import Around, FuzzyGoal
    >>> FuzzyGoal({"flight time": Around(180.0, tolerance=50.0)}).targets["flight time"].sides
    (50.0, 50.0)
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


def tolerance_limits(aims_of: Mapping[str, Aim], J: Sequence[Operand]) -> list[Operand]:
    """Hard limits where memberships become zero."""
    return [excess - 1.0 for aim in aims_of.values() for excess in aim.excesses(J)]


def tolerance_names(aims_of: Mapping[str, Aim], goals: Sequence[Objective]) -> tuple[str, ...]:
    """What each of these limits says."""
    every = ((goals[aim.place], slope, target) for aim in aims_of.values() for slope, target in aim.sides)
    return tuple(limit_name(goal, slope, target + 1.0 / slope) for goal, slope, target in every)


def sum_of_all(goals: Sequence[Objective], ranges: Ranges) -> Stage:
    """The stage that chooses among points which meet all targets: the least sum of all normalised objectives, which is not dominated."""
    return Stage("sum of all", lambda J, peaks: sum(ranges.normalised(goals, J)), after_zero=True)


@dataclass(frozen=True, repr=False)
class GoalProgramming(Preference):
    """Minimises the weighted sum of deviations from targets, each in units of its objective's range.

    A deviation counts on the worse side of a target only, on both sides for `Around`. With priorities, the deviations of the first level
    are minimised first, and then those of each further level, while those before keep what they attained. Where all targets are met, the
    point with the least sum of all normalised objectives is chosen, so that it is not dominated.

    Degrees: 1 where the target is met, falling to 0 at a range's width from it.

    Parameters
    ----------
    targets : dict
        By name: a number, or `Around(value)`. An objective that is not named has no target.
    weights : dict, optional
        By name of those that have targets, not negative. One that is not named has weight 1.
    priorities : sequence, optional
        Names of those that have targets, most important first; a tuple of names is one level.

    Examples
    --------
    >>> from macs.decisions import GoalProgramming
    >>> GoalProgramming({"flight time": 150.0, "horizontal speed": 0.7}, weights={"flight time": 2.0}).words
    'goal programming of flight time, horizontal speed'
    """

    targets: Mapping[str, Target]
    weights: Mapping[str, float] | None = None
    priorities: Sequence[str | Sequence[str]] | None = None

    DEGREE: ClassVar[str] = "degree (1: target met)"

    def __post_init__(self) -> None:
        targets = named_targets(self.targets)
        object.__setattr__(self, "targets", targets)
        for name, target in targets.items():
            if isinstance(target, Around) and target.tolerance is not None:
                raise ValueError(f"goal programming has no tolerances: give '{name}' the target Around({target.value:g})")
        if self.weights is not None:
            weights = named_weights(self.weights)
            check_among(weights, targets, "weight", "target", "targets")
            object.__setattr__(self, "weights", weights)
        if self.priorities is not None:
            given = levels(self.priorities)
            named_in = [name for level in given for name in level]
            check_among(named_in, targets, "priority", "target", "targets")
            for name in targets:
                if name not in named_in:
                    raise ValueError(f"'{name}' has a target but no priority")
            object.__setattr__(self, "priorities", given)

    def stages(self, goals: Sequence[Objective], ranges: Ranges | None) -> tuple[Stage, ...]:
        spans = needed(ranges, self)
        found, given = aims(self.targets, goals, spans), self.weights or {}
        ordered = levels(self.priorities) if self.priorities is not None else (tuple(self.targets),)

        def stage(title: str, level: Sequence[str]) -> Stage:
            """The weighted sum of the deviations of one level."""
            weights = [given.get(name, 1.0) for name in level]
            return Stage(
                title,
                lambda J, peaks: sum(weight * peak for weight, peak in zip(weights, peaks, strict=True)),
                lambda J: [[0.0, *found[name].excesses(J)] for name in level],
            )

        titles = ["deviations"] if len(ordered) == 1 else [f"priority {k + 1}" for k in range(len(ordered))]
        return (*map(stage, titles, ordered), sum_of_all(goals, spans))

    def degrees(self, goals: Sequence[Objective], ranges: Ranges | None, objectives: np.ndarray) -> np.ndarray:
        return memberships(aims(self.targets, goals, needed(ranges, self)), objectives, len(goals))


@dataclass(frozen=True, repr=False)
class FuzzyGoal(Preference):
    """Maximises the memberships of fuzzy goals: the least of them, or their sum.

    A membership is 1 where the target is met and falls linearly to 0 at the tolerance, which is a hard limit (eqs. 1-4 of Bae and others).
    The value is 1 - the least membership, or the sum of 1 - membership. Where all targets are met, the point with the least sum of all
    normalised objectives is chosen, so that it is not dominated.

    Degrees: the memberships.

    Parameters
    ----------
    targets : dict
        By name: a number, or `Around(value, tolerance)`. An objective that is not named has no goal.
    tolerances : dict, optional
        By name, in the objective's unit: how far from the target the membership is 0. Default: at the worst value of the range.
    aggregate : "min" or "sum"
        Whether the least membership is maximised (Zimmermann) or their sum (Tiwari and others).

    Examples
    --------
    >>> from macs.decisions import FuzzyGoal
    >>> FuzzyGoal({"flight time": 150.0, "horizontal speed": 0.7}, tolerances={"flight time": 30.0}).words
    'fuzzy goal of flight time, horizontal speed'
    """

    targets: Mapping[str, Target]
    tolerances: Mapping[str, float] | None = None
    aggregate: str = "min"

    DEGREE: ClassVar[str] = "membership"

    def __post_init__(self) -> None:
        targets = named_targets(self.targets)
        object.__setattr__(self, "targets", targets)
        check_choice("aggregate", self.aggregate, ("min", "sum"))
        if self.tolerances is None:
            return
        widths = {}
        for name, width in named(self.tolerances, "tolerances").items():
            check_among([name], targets, "tolerance", "target", "targets")
            if isinstance(targets[name], Around):
                raise ValueError(f"the tolerance of '{name}' belongs into its target: Around(value, tolerance)")
            widths[name] = positive(width, f"the tolerance of '{name}'")
        object.__setattr__(self, "tolerances", widths)

    def _aims(self, goals: Sequence[Objective], ranges: Ranges | None) -> dict[str, Aim]:
        return aims(self.targets, goals, needed(ranges, self), self.tolerances, to_worst=True)

    def stages(self, goals: Sequence[Objective], ranges: Ranges | None) -> tuple[Stage, ...]:
        found, least = self._aims(goals, ranges), self.aggregate == "min"

        def groups(J: Sequence[Operand]) -> list[list[Operand]]:
            each = [aim.excesses(J) for aim in found.values()]
            return [[0.0, *chain(*each)]] if least else [[0.0, *one] for one in each]

        name = "largest 1 - membership" if least else "sum of 1 - membership"
        limits = partial(tolerance_limits, found), tolerance_names(found, goals)
        return Stage(name, lambda J, peaks: sum(peaks), groups, *limits), sum_of_all(goals, needed(ranges, self))

    def degrees(self, goals: Sequence[Objective], ranges: Ranges | None, objectives: np.ndarray) -> np.ndarray:
        return memberships(self._aims(goals, ranges), objectives, len(goals))


@dataclass(frozen=True, repr=False)
class FuzzySatisfactory(Preference):
    """Minimises the mean of 1 - membership, and by how much the memberships violate an order of priority.

    The value is sum(d_i) / m + regulating * kappa with d = 1 - membership and kappa the largest d_s - d_r of goals s of one level and r of
    the next, less important one (eqs. 7-11 of Bae and others). The order is kept where kappa <= 0. Memberships are those of `FuzzyGoal`
    with the ranges' worst values as tolerances, hard limits.

    For two goals the value is (1/2 + regulating) d_1 + (1/2 - regulating) d_2 (their eq. 53), so that from 1/m on a worse second objective
    makes it better: `satisfy` raises `regulating` below 1/m only.

    Degrees: the memberships.

    Parameters
    ----------
    targets : dict
        By name: a number, or `Around(value, tolerance)`. A goal that is named in `priorities` only has the best value of its range as its
        target.
    priorities : sequence
        Names of all goals, most important first; a tuple of names is one level. At least two levels.
    regulating : float
        Weight of kappa, at least 0.
    ordered : bool
        Whether the order is a hard limit, kappa <= 0.

    Examples
    --------
    >>> from macs.decisions import FuzzySatisfactory
    >>> FuzzySatisfactory({"flight time": 150.0}, priorities=["horizontal speed", "flight time"]).words
    'fuzzy satisfactory of horizontal speed, flight time'
    """

    targets: Mapping[str, Target]
    priorities: Sequence[str | Sequence[str]]
    regulating: float = 0.1
    ordered: bool = False

    DEGREE: ClassVar[str] = "membership"

    def __post_init__(self) -> None:
        targets = {} if self.targets == {} else named_targets(self.targets)
        given = levels(self.priorities)
        if len(given) < 2:
            raise ValueError("priorities must have at least two levels: what is most important, and what is less")
        for name in targets:
            if all(name not in level for level in given):
                raise ValueError(f"'{name}' has a target but no priority")
        check_interval("regulating", self.regulating, "[0, inf)")
        if not isinstance(self.ordered, bool):
            raise ValueError(f"ordered must be True or False, not {self.ordered!r}")
        object.__setattr__(self, "targets", targets)
        object.__setattr__(self, "priorities", given)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(name for level in levels(self.priorities) for name in level)

    def _aims(self, goals: Sequence[Objective], ranges: Ranges | None) -> dict[str, Aim]:
        spans = needed(ranges, self)
        self.check(goals)
        spans.ends(goals)
        return aims({name: self.targets.get(name, spans.best[name]) for name in self.names}, goals, spans, to_worst=True)

    @property
    def pairs(self) -> list[tuple[str, str]]:
        """All goals s of one level and r of the next."""
        return [(s, r) for more, less in pairwise(levels(self.priorities)) for s in more for r in less]

    def _excesses_of_order(self, found: Mapping[str, Aim], J: Sequence[Operand]) -> list[Operand]:
        """d_s - d_r of all goals s of one level and r of the next."""
        return [found[s].deviation(J) - found[r].deviation(J) for s, r in self.pairs]

    def stages(self, goals: Sequence[Objective], ranges: Ranges | None) -> tuple[Stage, ...]:
        found = self._aims(goals, ranges)

        def value(J: Sequence[Operand], peaks: Sequence[Operand]) -> Operand:
            return sum(peaks[1:]) / len(found) + self.regulating * peaks[0]

        def groups(J: Sequence[Operand]) -> list[list[Operand]]:
            # The largest of these is kappa. Without a kink in what rises: a solve would not end at an optimum that lies there.
            order = [part - found[r].deviation(J) for s, r in self.pairs for part in found[s].parts(J)]
            return [order, *([0.0, *aim.excesses(J)] for aim in found.values())]

        def limits(J: Sequence[Operand]) -> list[Operand]:
            return [*tolerance_limits(found, J), *(self._excesses_of_order(found, J) if self.ordered else ())]

        order = [f"{s} satisfied at least as {r}" for s, r in self.pairs] if self.ordered else []
        return (Stage("1 - membership, order", value, groups, limits, (*tolerance_names(found, goals), *order)),)

    def kappa(self, goals: Sequence[Objective], ranges: Ranges | None, objectives: np.ndarray) -> np.ndarray:
        """By how much the memberships violate the order of priority, (n,), at objectives (n, m); not above 0 where they keep it."""
        J = list(np.asarray(objectives, dtype=float).T)
        return np.max(self._excesses_of_order(self._aims(goals, ranges), J), axis=0)

    def degrees(self, goals: Sequence[Objective], ranges: Ranges | None, objectives: np.ndarray) -> np.ndarray:
        return memberships(self._aims(goals, ranges), objectives, len(goals))
