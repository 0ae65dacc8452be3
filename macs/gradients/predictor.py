"""Where solves between the points of a front begin: vectors and multipliers, predicted from the points around a place on it.

Where a front is smooth, so are both along it, and a warm start from what is between the points around a place takes few iterations.
Between different valleys nothing lies: then each of these points is a start.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from scipy.optimize import linprog

from problems.compiled import remembered
from transcription.base import NLP
from transcription.nlp.optimality import Conditions, Multipliers
from transcription.nlp.program import back_in_bounds

from ..pareto.directions import across
from ..pareto.dominance import BETTER
from .scalarised import END, Scalarised, Start


@dataclass(frozen=True, eq=False)
class Neighbour:
    """A point near a place: its vector z (n,) on the mesh of the solve, its objectives F (m,) and its multipliers, if known. Those of
    the objectives have a sum of 1 in their units."""

    z: np.ndarray
    F: np.ndarray
    multipliers: Multipliers | None


@remembered
def multipliers_at(nlp: NLP, z: bytes, units: tuple[float, ...]) -> Multipliers | None:
    """The multipliers of an optimal vector, which points of a front do not keep; None where there are none."""
    conditions = Conditions.of(nlp, np.frombuffer(z), np.array(units))
    return None if conditions is None else conditions.multipliers()


def in_units(found: Multipliers | None, units: np.ndarray) -> Multipliers | None:
    """Multipliers of which those of the objectives have a sum of 1 in units (m,); None where they are nothing."""
    total = 0.0 if found is None else float(found.of_objectives @ units)
    return _sum([(1.0 / total, found)]) if found is not None and total > 0.0 else None


def coordinates(task: Scalarised, F: np.ndarray) -> np.ndarray:
    """Where points F (k, m) lie along the front (k, p), seen from the place that a task asks for, which is at 0."""
    if task.summed:
        value = task.alpha(F)
        return np.asarray(value - value.min())[:, None]
    moving, hard = task.moving, task.hard
    units = np.broadcast_to(task.units, task.weights.shape)
    places = across((F - task.reference)[:, moving] / task.weights[moving])
    # Across the diagonal of a plane there is one direction, and of a line none.
    kept = places if moving.sum() > 2 else places[:, 1:]
    return np.hstack([(F - task.reference)[:, hard] / units[hard], kept])


def shares(X: np.ndarray) -> np.ndarray:
    """The shares (k,) of points X (k, p) whose weighted mean is the origin: of the Delaunay simplex around it, in one dimension of the
    nearest on both sides. Where nothing lies around it, the nearest point alone. That simplex has the least mean of squared distances."""
    squares = (X**2).sum(axis=1)
    alone = np.eye(len(X))[squares.argmin()]
    if squares.min() == 0.0 or len(X) == 1:
        return alone
    if X.shape[1] == 1 and X.min() < 0.0 < X.max():
        x, found = X[:, 0], np.zeros(len(X))
        below, above = np.where(x < 0, x, -np.inf).argmax(), np.where(x > 0, x, np.inf).argmin()
        found[[below, above]] = np.array([x[above], -x[below]]) / (x[above] - x[below])
        return found
    scale = np.sqrt(squares.max())
    program = linprog(squares / scale**2, A_eq=np.vstack([X.T / scale, np.ones(len(X))]), b_eq=np.append(np.zeros(X.shape[1]), 1.0))
    if program.status != 0:
        return alone
    kept = np.where(program.x > 1e-6, program.x, 0.0)
    return np.asarray(kept / kept.sum())


def predicted(task: Scalarised, nlp: NLP, around: Sequence[Neighbour], parts: np.ndarray) -> tuple[list[Start], float]:
    """Starts for a task, in turn, and the loss that a good result has at most, from the points around its place and their shares (k,)."""
    Z, F, found = np.array([one.z for one in around]), np.array([one.F for one in around]), list[Start]()
    near = np.argsort(np.linalg.norm(coordinates(task, F), axis=1), kind="stable").tolist()
    if len(around) > 1 and (Z[:, nlp.integers] == Z[0, nlp.integers]).all():
        z = back_in_bounds(nlp, parts @ Z)
        if nlp.evaluate(z[None])[1][0] <= END.close:
            found.append(Start(z, True, BETTER, _mixed(around, parts)))
    return [*found, *(Start(around[i].z, True, BETTER, around[i].multipliers) for i in near)], promised(task, around, parts)


def promised(task: Scalarised, around: Sequence[Neighbour], parts: np.ndarray) -> float:
    """The loss at a place at most, as far as the points around it tell: where a front is convex, that of their mean, and where it is not,
    as between two valleys, that on the best of their tangents."""
    F, units = np.array([one.F for one in around]), np.broadcast_to(task.units, task.weights.shape)
    within = ((F - task.reference)[:, task.hard] <= BETTER * units[task.hard]).all(axis=1)
    known = min((task.loss(one) for one in F[within]), default=np.inf)
    if len(around) == 1 or task.summed:
        return known
    tangents = []
    for one in around:
        weights = np.zeros(len(units)) if one.multipliers is None else one.multipliers.of_objectives
        slope = float(weights[task.moving] @ task.weights[task.moving])
        if slope > 1e-6 * float(weights @ units):
            above = np.where(task.used, one.F - task.reference, 0.0)
            tangents.append(float(weights @ above) / slope)
    losses = [float(task.alpha(parts @ F)), *tangents]
    return min(known, max(losses[0], min(losses[1:], default=-np.inf)) + END.unsure * float(np.ptp(losses)))


def _mixed(around: Sequence[Neighbour], parts: np.ndarray) -> Multipliers | None:
    """The mean of the multipliers that are known, of the objectives' own units each."""
    known = [(part, one.multipliers) for part, one in zip(parts, around, strict=True) if one.multipliers is not None]
    total = sum(part for part, _ in known)
    return _sum([(part / total, one) for part, one in known]) if known else None


def _sum(parts: Sequence[tuple[float, Multipliers]]) -> Multipliers:
    return Multipliers(*(sum(part * getattr(one, field.name) for part, one in parts) for field in fields(Multipliers)))
