"""Kinds of points, as pictures distinguish them: those drawn in full, those that are not verified, and those that are not feasible."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...evaluation.evaluator import CONVERGED

NOT_VERIFIED, NOT_FEASIBLE, NOT_SIMULATED = "not verified", "not feasible", "not simulated"
"""Words of legends."""


def kinds(front: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Masks (n,) of the points that are drawn in full, of those that were simulated and are not verified, and of those not feasible."""
    feasible = front.status == CONVERGED
    apart = feasible & front.was_simulated & ~front.verified
    return feasible & ~apart, apart, ~feasible


def hollow(point: Any) -> bool:
    """Whether a point is drawn hollow: it is not feasible, or was simulated and is not verified."""
    return point.status != CONVERGED or point.verified is False


def remark(point: Any) -> str:
    """What a title says of a point: "not feasible", "not verified" or "not simulated"; empty if there is nothing to say."""
    if point.status != CONVERGED:
        return NOT_FEASIBLE
    if point.verified is None:
        return NOT_SIMULATED if point.trajectory is not None else ""
    return "" if point.verified else NOT_VERIFIED
