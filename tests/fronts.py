"""How far a front is from the truth, as the tests measure it: objectives as the user sees them, references as curves."""

import numpy as np

from macs.fronts.curve import distances
from runs.measures.indicators import CURVE_SAMPLES, _along, normalised

__all__ = ["distance_to_curve", "inverted_distance", "mean_distance"]


def distance_to_curve(F: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Distance of each point (n, 2) to the polygon through the reference (k, 2), in the order given, in units of its range."""
    points, curve = normalised(F, reference)
    return distances(points, [curve])


def inverted_distance(F: np.ndarray, reference: np.ndarray) -> float:
    """Mean distance of the polygon through the reference, sampled evenly along its length, from the nearest point."""
    points, curve = normalised(F, reference)
    return mean_distance(_along(curve, CURVE_SAMPLES), points)


def mean_distance(reference: np.ndarray, F: np.ndarray) -> float:
    """Mean distance of the points of the reference (k, m) from the nearest of F (n, m), in the units that they have."""
    return float(np.linalg.norm(reference[:, None] - F, axis=2).min(axis=1).mean())
