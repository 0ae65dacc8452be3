"""Meshes by a density function: many intervals where trajectories bend, the same share of the density's integral on each.

Zhao and Tsiotras, "Density functions for mesh refinement in numerical optimal control", J. Guidance 34(1), 2011; Chai, Savvaris, Tsourdos
and Xia, "An interactive fuzzy physical programming for solving multiobjective skip entry problem", IEEE T. Aerospace and Electronic Systems
53(5), 2017, section IV, eqs. (15)-(19). Eq. (18) is misprinted there: the curvature of a graph is |x''| / (1 + x'^2)^(3/2). The sum in eq.
(19) is taken over the states.

A density is linear on each of k cells of a phase and may jump between them: `places` (k + 1,) where cells begin and end, and `values`
(k, 2) at both ends of each. Only its shape counts.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..trajectories.trajectory import PhaseTrajectory
from .scales import state_scales

FLAT = 0.03
"""Density that is added everywhere: curvatures far below its third power, per length of the phase, are rounding of straight lines."""
LEAST = (0.25, 0.5, 0.75, 1.0)
"""The floor of a density, as a part of its mean, and those that are tried where intervals get too long by it: none is longer than the mean
one divided by this. Where all states are straight lines their curvature is 0, but constraints, peaks and what controls do are still to be
seen there, and decays that have died out must stay stable."""


def curvatures(places: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Curvatures (k + 1, nx) of the graphs of quantities over their places, mended eq. (18), by finite differences.

    Shooting knows the states best at the ends of its steps, and where controls jump at a node, states have a kink there, which no
    derivative inside a step sees but a second difference does. places (k + 1,), x (k + 1, nx).
    """
    h, slopes = np.diff(places)[:, None], np.diff(x, axis=0) / np.diff(places)[:, None]
    bends = 2.0 * np.diff(slopes, axis=0) / (h[1:] + h[:-1])
    # The slope of the parabola through three points in its middle.
    slope = (h[1:] * slopes[:-1] + h[:-1] * slopes[1:]) / (h[1:] + h[:-1])
    inner = np.abs(bends) / (1.0 + slope**2) ** 1.5
    return np.concatenate([inner[:1], inner, inner[-1:]])


def curvature_density(kappa: np.ndarray, c: float | np.ndarray = 1.0) -> np.ndarray:
    """Eq. (19), (k + 1,): the root of the sum over states of (c kappa^(1/3))^2, for curvatures (k + 1, nx)."""
    return np.sqrt(((c * np.cbrt(kappa)) ** 2).sum(axis=1))


def lowered(places: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Quantities (k + 1, nx) in units in which no piece of a graph between two places is steeper than 1.

    The curvature of a graph falls with the third power of its slope: in units of its range, a state would count least just where it changes
    most.
    """
    return x / np.maximum(np.abs(np.diff(x, axis=0) / np.diff(places)[:, None]).max(axis=0), 1.0)


def trajectory_density(phase: PhaseTrajectory) -> tuple[np.ndarray, np.ndarray]:
    """The density of a phase's trajectory, from its states at the ends of elements; places are relative to the phase.

    Controls have no part in it: where they jump, the states on which they act have a kink, and with a lag they are states themselves.
    """
    edges = phase.state.edges
    places = (edges - edges[0]) / (edges[-1] - edges[0])
    if len(places) < 3:
        return places, np.ones((len(places) - 1, 2))
    x = lowered(places, phase.edge_states / state_scales(phase))
    return places, FLAT + continuous(curvature_density(curvatures(places, x)))


def continuous(values: np.ndarray) -> np.ndarray:
    """Values (k, 2) on the cells of a density that is given at their ends, (k + 1,)."""
    return np.stack([values[:-1], values[1:]], axis=-1)


def integrals(places: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Integrals (k + 1,) of a density from the first place to each, not normalised: eq. (16)."""
    return np.append(0.0, np.cumsum(0.5 * np.diff(places) * values.sum(axis=1)))


def normalised(places: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The same density with a mean of 1: eq. (15), if the places go from 0 to 1. One that is zero everywhere becomes constant."""
    total = integrals(places, values)[-1]
    return values * ((places[-1] - places[0]) / total) if total > 0.0 else np.ones_like(values)


def raised(places: np.ndarray, values: np.ndarray, least: float = LEAST[0]) -> np.ndarray:
    """The density with a mean of 1 and nowhere below `least` of that: so much of it everywhere, and the rest in the old shape."""
    return least + (1.0 - least) * normalised(places, values)


def equidistributed(places: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """The ends (count + 1,) of intervals that have the same share of the integral of a density each: eq. (17)."""
    total = integrals(places, values)
    if not (np.isfinite(total).all() and total[-1] > 0.0 and (values >= 0.0).all()):
        raise ValueError("a density must be finite and nowhere negative, and its integral positive")
    wanted = total[-1] * np.arange(1, count) / count
    cell = np.clip(np.searchsorted(total, wanted, side="right") - 1, 0, len(values) - 1)
    left, right = values[cell].T
    h, rest = np.diff(places)[cell], wanted - total[cell]
    # The smaller root s of left s + (right - left) s^2 / (2 h) = rest, without cancellation.
    root = np.sqrt(np.maximum(left**2 + 2.0 * rest * (right - left) / h, 0.0))
    step = np.divide(2.0 * rest, left + root, out=np.zeros_like(rest), where=left + root > 0.0)
    inner = np.minimum(places[cell] + step, places[cell + 1])
    return np.concatenate([places[:1], inner, places[-1:]])


def segmented(places: np.ndarray, values: np.ndarray, ends: Sequence[float], counts: Sequence[int]) -> np.ndarray:
    """The ends of intervals of a phase in segments, each with a number of intervals of its own, equidistributed in it. places (k + 1,),
    values (k, 2)."""
    found = [np.asarray(places[:1])]
    for first, last, count in zip(ends[:-1], ends[1:], counts, strict=True):
        found.append(equidistributed(*between(places, values, first, last), count)[1:])
    return np.concatenate(found)


def between(places: np.ndarray, values: np.ndarray, first: float, last: float) -> tuple[np.ndarray, np.ndarray]:
    """The part of a density from one place to another."""
    inside = (places > first) & (places < last)
    cut = np.concatenate([[first], places[inside], [last]])
    cell = np.clip(np.searchsorted(places, 0.5 * (cut[1:] + cut[:-1]), side="right") - 1, 0, len(values) - 1)
    share = (np.stack([cut[:-1], cut[1:]], axis=-1) - places[cell, None]) / np.diff(places)[cell, None]
    return cut, values[cell, :1] + share * (values[cell, 1:] - values[cell, :1])
