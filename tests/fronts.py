"""How far a front is from the truth: distances normalised by the range of the reference, to the curve through it and from it."""

from __future__ import annotations

import numpy as np


def normalised(F: np.ndarray, reference: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points and reference in units of the reference's range."""
    lower, upper = reference.min(axis=0), reference.max(axis=0)
    return (F - lower) / (upper - lower), (reference - lower) / (upper - lower)


def distance_to_curve(F: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Distance of each point (n, 2) to the polygon through the reference (k, 2), in units of its range."""
    points, curve = normalised(F, reference)
    start, step = curve[:-1], np.diff(curve, axis=0)
    share = ((points[:, None] - start) * step).sum(axis=2) / (step**2).sum(axis=1)
    nearest = start + np.clip(share, 0.0, 1.0)[..., None] * step
    return np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1)


def inverted_distance(F: np.ndarray, reference: np.ndarray, samples: int = 2001) -> float:
    """Mean distance of the curve through the reference, sampled evenly along its length, from the nearest point."""
    points, curve = normalised(F, reference)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], samples)
    even = np.column_stack([np.interp(at, length, column) for column in curve.T])
    return mean_distance(even, points)


def mean_distance(reference: np.ndarray, F: np.ndarray) -> float:
    """Mean distance of the points of the reference (k, m) from the nearest of F (n, m), in the units that they have."""
    return float(np.linalg.norm(reference[:, None] - F, axis=2).min(axis=1).mean())
