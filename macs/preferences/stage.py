"""Stage: one scalar function of the objectives that is minimised, for numbers and for symbols alike; and the order of points by stages."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np

from problems.compiled import Objective

from .ranges import shown

Operand = Any
"""A number, an array (n,), or a symbol of CasADi: only operators and the functions below are applied to it."""
NUMERIC = (int, float, np.number, np.ndarray)


def exp(x: Any) -> Any:
    """e to the power x."""
    return np.exp(x) if isinstance(x, NUMERIC) else x.exp()


def log10(x: Any) -> Any:
    """Logarithm of x to base 10."""
    return np.log10(x) if isinstance(x, NUMERIC) else x.log10()


def greatest(x: Any, bound: float) -> Any:
    """The larger of x and a number."""
    return np.fmax(x, bound) if isinstance(x, NUMERIC) else x.fmax(bound)


def least(x: Any, bound: float) -> Any:
    """The smaller of x and a number."""
    return np.fmin(x, bound) if isinstance(x, NUMERIC) else x.fmin(bound)


def clipped(x: Any, lower: float, upper: float) -> Any:
    """x, but at least `lower` and at most `upper`."""
    return least(greatest(x, lower), upper)


LIMIT_TOL = 1e-6
"""A hard limit counts as met by points that exceed it by less than this, in its own scale: optima lie on limits up to rounding."""
ATTAINED = 1e-9
"""A value that is not larger counts as zero."""


def no_limits(J: Sequence[Operand]) -> list[Any]:
    """No limits, and no groups."""
    return []


@dataclass(frozen=True)
class Stage:
    """One scalar that is minimised: `value(J, peaks)`.

    A preference is a sequence of stages. Each after the first keeps what those before attained.

    Attributes
    ----------
    name : str
        For messages.
    value : callable (J, peaks) -> Operand
        J is the list of the m objectives, in the user's units and senses, in declared order. The value rises with each of `peaks`, so that
        gradient solves may use a variable that is not less than any of a group for its peak.
    groups : callable (J) -> list of lists of Operand
        `peaks[k]` is the largest of `groups[k]`.
    limits : callable (J) -> list of Operand
        Hard limits, each at most 0, without dimension. Of several stages the first has them all.
    limit_names : tuple of str
        What each limit says; none: they are called by their numbers, see `titles`.
    after_zero : bool
        Whether the stage follows only if the value of the stage before is zero. Then every target is met and many points are equally good;
        the stage chooses among them.

    Examples
    --------
    >>> import numpy as np
    >>> from macs.decisions import Stage
    >>> Stage("sum", lambda J, peaks: J[0] + J[1], limits=lambda J: [J[0] - 2]).numbers(np.array([[1.0, 5.0], [3.0, 1.0]]))
    array([ 6., inf])
    """

    name: str
    value: Callable[[Sequence[Operand], Sequence[Operand]], Operand]
    groups: Callable[[Sequence[Operand]], list[list[Operand]]] = no_limits
    limits: Callable[[Sequence[Operand]], list[Operand]] = no_limits
    limit_names: tuple[str, ...] = ()
    after_zero: bool = False

    @property
    def limited(self) -> bool:
        """Whether it has hard limits."""
        return self.limits is not no_limits

    def numbers(self, objectives: np.ndarray) -> np.ndarray:
        """Values (n,) at objectives (n, m); infinite where an objective is not finite or a limit is exceeded."""
        J, good = _columns(objectives)
        with np.errstate(all="ignore"):
            peaks = [reduce(np.maximum, [np.asarray(operand, dtype=float) for operand in group]) for group in self.groups(J)]
            values = np.asarray(self.value(J, peaks), dtype=float) + np.zeros(len(objectives))
        return np.where(good & (self.excess(objectives) <= LIMIT_TOL), values, np.inf)

    def excess(self, objectives: np.ndarray) -> np.ndarray:
        """Largest amount (n,) by which a limit is exceeded at objectives (n, m), at least 0; infinite where an objective is not finite."""
        return np.max(self.excesses(objectives), axis=1, initial=0.0)

    def excesses(self, objectives: np.ndarray) -> np.ndarray:
        """Amounts (n, number of limits) by which each limit is exceeded, negative where it is met; infinite where an objective is not."""
        J, good = _columns(objectives)
        with np.errstate(all="ignore"):
            rows = [np.asarray(limit, dtype=float) + np.zeros(len(objectives)) for limit in self.limits(J)]
        found = np.stack(rows, axis=1) if rows else np.zeros((len(objectives), 0))
        return np.where(good[:, None], found, np.inf)

    def titles(self, count: int) -> tuple[str, ...]:
        """What each of its limits says, of which there are so many."""
        return self.limit_names or tuple(f"limit {k + 1} of {self.name}" for k in range(count))


def exceeded(limits: Stage, goals: Sequence[Objective], J: np.ndarray) -> str:
    """Text with each limit that objectives (m,) exceed, and by how much."""
    unknown = [f"'{goal.name}'" for goal, value in zip(goals, J, strict=True) if not np.isfinite(value)]
    if unknown:
        return f"{', '.join(unknown)} is no number"
    excess = limits.excesses(J[None])[0]
    return ", ".join(
        f"'{name}' is missed by {_amount(limits, k, goals, J)}"
        for k, (name, one) in enumerate(zip(limits.titles(len(excess)), excess, strict=True))
        if one > LIMIT_TOL
    )


def _amount(limits: Stage, k: int, goals: Sequence[Objective], J: np.ndarray) -> str:
    """By how much objectives (m,) exceed a limit: in the unit of its objective, where it is a limit of one."""
    here = float(limits.excesses(J[None])[0, k])
    # Moving one objective at a time shows which the limit is of, and in which unit.
    steps = 1e-4 * np.maximum(np.abs(J), 1.0)
    slopes = (limits.excesses(J + np.diag(steps))[:, k] - here) / steps
    (own,) = np.nonzero(slopes)
    return f"{here:.3g}" if len(own) != 1 else shown(here / abs(float(slopes[own[0]])), goals[own[0]])


def _columns(objectives: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """The m columns of objectives (n, m), with 0 in rows that are not finite, and the mask (n,) of the rows that are."""
    good = np.isfinite(objectives).all(axis=1)
    return list(np.where(good[:, None], objectives, 0.0).T), good


def excess_stage(limits: Stage) -> Stage:
    """The stage of which the value is the largest excess over the limits of another."""
    return Stage("largest excess over hard limits", lambda J, peaks: peaks[0], lambda J: [limits.limits(J)])


def conflict_message(limits: Stage, goals: Sequence[Objective], J: np.ndarray) -> str:
    """Text with the limits that cannot be met, by objectives (m,) that exceed them as little as possible: those in conflict are exceeded
    alike there, by half of the largest excess at least."""
    excess = limits.excesses(J[None])[0]
    names = [limits.titles(len(excess))[k] for k in np.flatnonzero(excess >= 0.5 * excess.max())]
    nearest = ", ".join(f"{goal.name} {shown(float(value), goal)}" for goal, value in zip(goals, J, strict=True))
    what = f"all of: {', '.join(names)}" if len(names) > 1 else names[0]
    return f"no point was found that meets {what}; the nearest has {nearest}: {exceeded(limits, goals, J)}"


def check_limits(stages: Sequence[Stage]) -> None:
    """Raise ValueError for stages after the first with hard limits."""
    for stage in stages[1:]:
        if stage.limited:
            raise ValueError(f"hard limits are those of the first stage, which all stages keep: state those of '{stage.name}' there")


def ordering(
    stages: Sequence[Stage], objectives: np.ndarray, kind: np.ndarray, tie: np.ndarray | None = None, same: float = ATTAINED
) -> tuple[np.ndarray, np.ndarray]:
    """Rows (n,) of points in the order of a preference, best first: by their kind, then by the excess over hard limits, then by the stages,
    each as far as those before tell no difference; and the values (n, number of stages), see `Ranking`. objectives (n, m), kind (n,), tie
    (n,)."""
    columns: list[np.ndarray] = []
    for stage in stages:
        found = stage.numbers(objectives)
        follows = columns[-1] <= same if columns and stage.after_zero else np.ones(len(found), dtype=bool)
        columns.append(np.where(follows, found, np.nan))
    excess = stages[0].excess(objectives)
    excess = np.where(excess > LIMIT_TOL, excess, 0.0)
    keys = [*((kind, 0.0), (excess, 0.0)), *((one, same) for one in columns[:-1]), (columns[-1], 0.0)]
    if tie is not None:
        keys.append((tie, 0.0))
    order = _sorted(np.arange(len(excess)), [(np.where(np.isnan(key), 0.0, key), slack) for key, slack in keys])
    return order, np.stack(columns, axis=1)


def _sorted(rows: np.ndarray, keys: Sequence[tuple[np.ndarray, float]]) -> np.ndarray:
    """Rows, given in their order, by the first key; those that are as good as the least of them, within its slack, by the next keys, and so
    on."""
    if not keys or len(rows) < 2:
        return rows
    if not any(slack for _, slack in keys):
        return rows[np.lexsort([key[rows] for key, _ in reversed(keys)])]
    key, slack = keys[0]
    rows = rows[np.argsort(key[rows])]
    values = key[rows]
    found, begin = [], 0
    while begin < len(rows):
        least, end = values[begin], len(rows)
        if np.isfinite(least):
            end = int(np.searchsorted(values, least + slack * max(abs(least), 1.0), side="right"))
        # Equal values keep their places, so that the next key is what counts.
        found.append(_sorted(np.sort(rows[begin:end]), keys[1:]))
        begin = end
    return np.concatenate(found)
