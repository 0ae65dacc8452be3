"""Stage: one scalar function of the objectives that is minimised, for numbers and for symbols alike."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np

Operand = Any
"""A number, an array (n,), or a symbol of CasADi: only operators and the functions of `operands` are applied to it."""

SLACK = 1e-6
"""A hard limit counts as met by points that exceed it by less than this, in its own scale: optima lie on limits up to rounding."""
ATTAINED = 1e-9
"""A value that is not larger counts as zero."""


def _nothing(J: Sequence[Operand]) -> list[Any]:
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
        Hard limits, each at most 0, without dimension.
    limit_names : tuple of str
        What each limit says.
    after_zero : bool
        Whether the stage follows only if the value of the stage before is zero. Then every target is met and many points are equally good;
        the stage chooses among them.
    """

    name: str
    value: Callable[[Sequence[Operand], Sequence[Operand]], Operand]
    groups: Callable[[Sequence[Operand]], list[list[Operand]]] = _nothing
    limits: Callable[[Sequence[Operand]], list[Operand]] = _nothing
    limit_names: tuple[str, ...] = ()
    after_zero: bool = False

    def numbers(self, objectives: np.ndarray) -> np.ndarray:
        """Values (n,) at objectives (n, m); infinite where an objective is not finite or a limit is exceeded."""
        J, good = _columns(objectives)
        with np.errstate(all="ignore"):
            peaks = [reduce(np.maximum, [np.asarray(operand, dtype=float) for operand in group]) for group in self.groups(J)]
            values = np.asarray(self.value(J, peaks), dtype=float) + np.zeros(len(objectives))
        return np.where(good & (self.excess(objectives) <= SLACK), values, np.inf)

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


def _columns(objectives: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """The m columns of objectives (n, m), with 0 in rows that are not finite, and the mask (n,) of the rows that are."""
    good = np.isfinite(objectives).all(axis=1)
    return list(np.where(good[:, None], objectives, 0.0).T), good
