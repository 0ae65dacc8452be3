"""Credit of the operators that breed: by how much of their offspring the archive keeps.

With many objectives nearly every new point is non-dominated, so that what the archive keeps at first tells little. Offspring is then judged
some iterations later, by what has stayed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..pareto.niches import MANY

LEAST_SHARE, FORGET = 0.05, 0.1
"""Least share of an operator in the offspring, so that it can succeed later; fraction of the credit that is forgotten in each iteration."""


LATER, CLEARLY = 10, 3.0
"""With many objectives: offspring is judged so many iterations after its birth; power of the success rates to which shares are
proportional. With few, it is judged at once, and shares are proportional to the rates."""


@dataclass(frozen=True)
class Offspring:
    """Offspring that is not judged yet.

    Attributes
    ----------
    F : array (k, m)
        Objectives.
    operator : array (k,) of int
        Row in `breeding.OPERATORS` of the operator that made each.
    born : array (k,) of int
        Iteration.
    """

    SHAPES: ClassVar[dict[str, str]] = {"F": "k m", "operator": "k int", "born": "k int"}

    F: np.ndarray
    operator: np.ndarray
    born: np.ndarray

    @classmethod
    def none(cls, m: int) -> Offspring:
        """No offspring, of m objectives."""
        return cls(np.empty((0, m)), np.empty(0, dtype=int), np.empty(0, dtype=int))

    def joined(self, others: Offspring) -> Offspring:
        """This offspring, then the others."""
        return Offspring(
            np.vstack([self.F, others.F]),
            np.concatenate([self.operator, others.operator]),
            np.concatenate([self.born, others.born]),
        )

    def take(self, rows: np.ndarray) -> Offspring:
        """The offspring of `rows` (indices or mask)."""
        return Offspring(self.F[rows], self.operator[rows], self.born[rows])


def no_credit(count: int) -> np.ndarray:
    """Initial credit (count, 2), equal for all operators: one success in five trials."""
    return np.tile([1.0, 5.0], (count, 1))


def updated_credit(credit: np.ndarray, operator: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Credit of the operators (o, 2): number of offspring that stayed in the archive, and of all offspring; older ones count less.

    Parameters
    ----------
    credit : array (o, 2)
        Credit so far.
    operator, kept : arrays (k,) of int and bool
        Operator of each child, and whether the child stayed.
    """
    tried = np.bincount(operator, minlength=len(credit))
    won = np.bincount(operator, weights=kept, minlength=len(credit))
    return (1.0 - FORGET) * credit + np.stack([won, tried], axis=1)


def operator_shares(credit: np.ndarray, m: int) -> np.ndarray:
    """Probabilities (o,) of the operators for m objectives: by their success rates, with a least share for each (Thierens 2005)."""
    rate = ((credit[:, 0] + 0.1) / (credit[:, 1] + 1.0)) ** (CLEARLY if m > MANY else 1.0)
    return LEAST_SHARE + (1.0 - LEAST_SHARE * len(rate)) * rate / rate.sum()


def judged(young: Offspring, credit: np.ndarray, archive: np.ndarray, iteration: int) -> tuple[Offspring, np.ndarray]:
    """The offspring that is still too young to be judged, and the credit (o, 2) after the rest was: what is among the objectives (a, m) of
    the archive has stayed."""
    old = young.born <= iteration - (LATER if archive.shape[1] > MANY else 0)
    if not old.any():
        return young, credit
    those = young.take(old)
    stayed = (those.F[:, None] == archive).all(axis=2).any(axis=1)
    return young.take(~old), updated_credit(credit, those.operator, stayed)
