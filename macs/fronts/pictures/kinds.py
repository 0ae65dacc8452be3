"""Kinds of points, as pictures distinguish them: those drawn in full, those that are not verified, and those that are not feasible."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...evaluation.evaluator import CONVERGED

NOT_VERIFIED, NOT_FEASIBLE = "not verified", "not feasible"
"""Words of legends."""


def kinds(front: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Masks (n,) of the points that are drawn in full, of those that were simulated and are not verified, and of those not feasible.

    Parameters
    ----------
    front : Points
    """
    feasible = front.status == CONVERGED
    apart = feasible & front.was_simulated & ~front.verified
    return feasible & ~apart, apart, ~feasible


def remark(point: Any) -> str:
    """What a title says of a point that is drawn hollow: "not verified" or "not feasible"; empty for the others."""
    if point.status != CONVERGED:
        return NOT_FEASIBLE
    return NOT_VERIFIED if point.verified is False else ""
