"""Base of the baselines whose tournaments compare ranks and crowding distances."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..evaluation.evaluator import Evaluator
from .population import Members, State
from .pymoo_adapter import Baseline

UNRANKED = -1
"""In place of the rank of an infeasible member."""


@dataclass(repr=False)
class RankedState(State):
    """State with the quantities that tournaments compare."""

    SHAPES: ClassVar[dict[str, str]] = {"rank": "members int", "crowding": "members"}

    rank: np.ndarray  # (n,): Rank of each member's front, 0 for the best; -1 for an infeasible member
    # (n,): Distances from other members, as the algorithm measures them; a larger one wins. NaN for an infeasible member.
    crowding: np.ndarray


class Ranked(Baseline):
    """Baseline whose individuals have ranks and crowding distances."""

    def _first(self, members: Members, common: dict[str, Any], evaluator: Evaluator) -> RankedState:
        return RankedState(**common, rank=np.full(len(members), UNRANKED), crowding=np.full(len(members), np.nan))

    def _restore(self, algorithm: Any, state: RankedState, individuals: Any) -> None:
        individuals.set("rank", state.rank, "crowding", state.crowding)
        algorithm.pop = individuals

    def _keep(self, algorithm: Any, state: RankedState, table: Members) -> None:
        state.rank = _numbers(algorithm.pop, "rank", UNRANKED).astype(int)
        state.crowding = _numbers(algorithm.pop, "crowding", np.nan)


def _numbers(individuals: Any, key: str, missing: float) -> np.ndarray:
    """Values (n,) of an attribute of individuals; `missing` for an individual without it."""
    values = [one.get(key) for one in individuals]
    return np.array([missing if value is None else value for value in values], dtype=float)
