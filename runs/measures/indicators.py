"""Quality indicators of fronts: distances to a reference and from it, and the dominated volume.

Objectives are normalised by the range of the reference, 0 at its ideal and 1 at its nadir, unless `normalise` is False; `Scale` states
it for the caption of a table. Of a `Front`, the minimised objectives of its converged points are taken; an array next to one
is in the user's units and senses, like `Front.objectives`. Of two arrays, all columns are minimised.

A reference of two objectives is a curve where its points tell enough of it, see `pieces`; those packages have no curves. There `gd` is less
than theirs, by up to half the spacing of the points, and `igd` and `igd_plus` weigh each piece of the curve by its length rather than by
how many points lie on it. Against other references all five are as moocore and pymoo compute them."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import moocore
import numpy as np

from macs.evaluation.evaluator import CONVERGED
from macs.front import Front
from macs.fronts.curve import FrontCurve, distances
from macs.io.text import counted, label
from macs.pareto.dominance import nondominated
from problems.compiled import Objective

VOLUME_CORNER = 1.1
"""Of the hypervolume in each objective, in ranges of the reference from its ideal: as published comparisons have it."""
CURVE_SAMPLES = 2001
"""Number of points along a reference that is a curve, which stand for it."""

Points = Front | np.ndarray
Measure = TypeVar("Measure", bound=Callable[..., float])


def _documented(measure: Measure) -> Measure:
    """An indicator whose docstring says what all of them take."""
    takes = inspect.cleandoc(
        """
        Parameters
        ----------
        front, reference : Front or array (n, m)
        normalise : bool
            Whether objectives are divided by the ranges of the reference.
        """
    )
    curve = "curve : bool\n    Whether a reference of two objectives is a curve where its points tell enough of it."
    imports = "Examples\n--------\n>>> import numpy as np\n>>> truth = np.array([[0.0, 1.0], [1.0, 0.0]])"
    text = inspect.cleandoc(measure.__doc__ or "")
    for mark, words in (("[parameters]", takes), ("[curve]", curve), ("[examples]", imports)):
        text = text.replace(mark, words)
    measure.__doc__ = text
    return measure


@_documented
def gd(front: Points, reference: Points, *, normalise: bool = True, curve: bool = True) -> float:
    """Generational distance: mean distance of the front's points from the reference. NaN for an empty front.

    A reference of two objectives is the curve through its points, where they have rates (see `Front.curve`) or are dense: against points
    alone no front could be nearer than about a quarter of their spacing. With `curve=False` it is its points alone, always, as most
    published tables have it.

    [parameters]
    [curve]

    [examples]
    >>> from runs import gd
    >>> round(gd(np.array([[0.1, 1.0]]), truth), 3)
    0.1
    """
    F, R, lines = _pair(front, reference, normalise, curve)
    return float((distances(F, lines) if lines else np.linalg.norm(F[:, None] - R, axis=2).min(axis=1)).mean()) if len(F) else np.nan


@_documented
def igd(front: Points, reference: Points, *, normalise: bool = True, curve: bool = True) -> float:
    """Inverted generational distance: mean distance of the reference from the nearest point of the front. Infinite for an empty front.

    Where the reference is a curve (see `gd`), the mean is taken evenly along its length.

    [parameters]
    [curve]

    [examples]
    >>> from runs import igd
    >>> round(igd(truth, truth), 3)
    0.0
    """
    F, R, lines = _pair(front, reference, normalise, curve)
    return float(moocore.igd(F, ref=_evenly(lines) if lines else R)) if len(F) else np.inf


@_documented
def igd_plus(front: Points, reference: Points, *, normalise: bool = True, curve: bool = True) -> float:
    """As `igd`, but an objective counts only where a point is worse than the reference in it (Ishibuchi et al. 2015).

    [parameters]
    [curve]

    [examples]
    >>> from runs import igd_plus
    >>> round(igd_plus(truth, truth), 3)
    0.0
    """
    F, R, lines = _pair(front, reference, normalise, curve)
    return float(moocore.igd_plus(F, ref=_evenly(lines) if lines else R)) if len(F) else np.inf


@_documented
def additive_epsilon(front: Points, reference: Points, *, normalise: bool = True) -> float:
    """By how much the front would have to improve in every objective to be nowhere worse than the reference. Infinite if it is empty.

    [parameters]

    [examples]
    >>> from runs import additive_epsilon
    >>> round(additive_epsilon(truth + 0.1, truth), 3)
    0.1
    """
    F, R, _ = _pair(front, reference, normalise, curve=False)
    return float(moocore.epsilon_additive(F, ref=R)) if len(F) else np.inf


@_documented
def hypervolume(front: Points, reference: Points, *, point: float = VOLUME_CORNER, normalise: bool = True) -> float:
    """Volume that the front dominates, up to `point` in each objective, in which the reference reaches from 0 to 1. 0 if it is empty.

    With `normalise=False` the volume is in the objectives' own units; `point` still counts from the ideal: 1.1 is beyond the nadir by
    a tenth of the reference's range.

    [parameters]
    point : float
        Corner in each objective, in ranges of the reference from its ideal.

    [examples]
    >>> from runs import hypervolume
    >>> round(hypervolume(truth, truth), 3)
    0.21
    """
    F, R, _ = _pair(front, reference, normalise, curve=False)
    if not len(F):
        return 0.0
    ideal, unit = extent(R)
    return float(moocore.hypervolume(np.ascontiguousarray(F), ref=ideal + point * unit))


def hypervolume_at(front: Points, point: Sequence[float]) -> float:
    """Volume that the front dominates, in the objectives' own units, up to a point (m,) in the users' units and senses. 0 if it is
    empty."""
    F = minimised(front, None)
    signs = [goal.sign for goal in front.goals] if isinstance(front, Front) else np.ones(len(point))
    return float(moocore.hypervolume(np.ascontiguousarray(F), ref=np.multiply(point, signs))) if len(F) else 0.0


def extent(R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ideal (m,) of the rows of R (k, m), minimised, and how far it is from there to their nadir; 1 where all are the same."""
    range_ = np.ptp(R, axis=0)
    return R.min(axis=0), np.where(range_ > 0, range_, 1.0)


def normalised(F: np.ndarray, reference: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points and reference in units of the reference's range."""
    lower, unit = extent(reference)
    return (F - lower) / unit, (reference - lower) / unit


def minimised(points: Points, goals: Sequence[Objective] | None, name: str = "the front") -> np.ndarray:
    """Minimised objectives (n, m): of a front those of its converged points, of an array in the senses of `goals`, if any."""
    if isinstance(points, Front):
        if goals is not None and described(points.goals) != described(goals):
            raise ValueError(f"{name} has other objectives: {described(points.goals)}, not {described(goals)}")
        return points.F[points.status == CONVERGED]
    rows = np.asarray(points, dtype=float)
    if rows.ndim != 2:
        raise ValueError(f"objectives must be an array (n, m), not one of shape {rows.shape}")
    bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if len(bad):
        raise ValueError(f"row {bad[0]} of {name} is not finite: {rows[bad[0]].tolist()}; a failed point is no point of a front")
    if not rows.size:
        return rows if goals is None else np.empty((0, len(goals)))
    if goals is None:
        return rows
    if rows.shape[1] != len(goals):
        raise ValueError(f"{name} has {rows.shape[1]} objectives, the other {len(goals)}: {', '.join(goal.name for goal in goals)}")
    return rows * [goal.sign for goal in goals]


def described(goals: Sequence[Objective]) -> str:
    """Objectives by what has to agree for their values to be compared: sense, name and unit of each."""
    return ", ".join(f"{goal.sense} {label(goal.name, goal.unit)}" for goal in goals)


def goals_of(points: Iterable[Points]) -> tuple[Objective, ...] | None:
    """The objectives of the first Front; None if all are arrays."""
    return next((one.goals for one in points if isinstance(one, Front)), None)


def truth(reference: Points, goals: Sequence[Objective] | None = None) -> np.ndarray:
    """Minimised objectives (k, m) of a reference, without dominated points, in the order of the first objective."""
    R = minimised(reference, goals, "the reference")
    if not len(R):
        raise ValueError("the reference has no points")
    R = R[nondominated(R)]
    return R[np.lexsort(R.T[::-1])]


def _pair(front: Points, reference: Points, normalise: bool, curve: bool) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Minimised objectives of both, (n, m) and (k, m), and the lines that the reference is as a curve, if wanted."""
    goals = goals_of((front, reference))
    F, R = minimised(front, goals), truth(reference, goals)
    if len(F) and F.shape[1] != R.shape[1]:
        raise ValueError(f"the front has {F.shape[1]} objectives, the reference {R.shape[1]}")
    lines = pieces(reference, goals) if curve else []
    if normalise and len(F):
        return normalised(F, R)[0], normalised(R, R)[0], [normalised(line, R)[0] for line in lines]
    return F, R, lines


def pieces(reference: Points, goals: Sequence[Objective] | None = None) -> list[np.ndarray]:
    """The lines (k, 2), minimised, that a reference of two objectives is: along its curve, where that is known from rates, or from point to
    point, where these are dense. None if neither is so."""
    R = truth(reference, goals)
    if R.shape[1] != 2:
        return []
    if isinstance(reference, Front) and (known := _known(reference)):
        rows = known.sample(CURVE_SAMPLES) * reference.signs
        return [part[~np.isnan(part[:, 0])] for part in np.split(rows, np.flatnonzero(np.isnan(rows[:, 0])))]
    gaps = np.linalg.norm(np.diff(normalised(R, R)[0], axis=0), axis=1)
    parts = np.split(R, np.flatnonzero(gaps > 0.02) + 1)  # nearer neighbours, in ranges, are points of one curve
    return parts if all(len(part) > 1 for part in parts) else []


@lru_cache(maxsize=16)
def _known(reference: Front) -> FrontCurve | None:
    """The curve of a reference; None if it errs by too much, or a point is off its pieces, or better by more than it errs."""
    try:
        curve = reference.curve()
    except ValueError:
        return None
    F = truth(reference)
    places, heights = curve.placed(F)
    doubtful = F[~(curve.at(places)[0] - heights <= curve.error)]
    known = len(curve.within().parts) == len(curve.parts) and (curve.distances(doubtful * reference.signs) <= curve.error).all()
    return curve if known else None


def _evenly(lines: Sequence[np.ndarray]) -> np.ndarray:
    """Points evenly along some polygons."""
    lengths = np.array([np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in lines])
    counts = np.maximum(2, np.round(CURVE_SAMPLES * lengths / lengths.sum()).astype(int))
    return np.vstack([_along(line, count) for line, count in zip(lines, counts, strict=True)])


def _along(curve: np.ndarray, samples: int) -> np.ndarray:
    """Points evenly along the length of a polygon."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], samples)
    return np.column_stack([np.interp(at, length, column) for column in curve.T])


@dataclass(frozen=True)
class Scale:
    """The normalisation of indicators by a reference, in the user's units and senses, in words for captions of tables."""

    ideal: tuple[float, ...]  # ideal, nadir: best and worst value of each objective on the reference, dominated points left out
    nadir: tuple[float, ...]
    corner: tuple[float, ...]  # the reference point of the hypervolume
    goals: tuple[Objective, ...]
    what: str  # name of the reference: "the closed form", "the union of 60 runs"
    count: int  # how many points it has
    curve: str  # whether it is the curve through them, in words

    @classmethod
    def of(cls, reference: Front, *, what: str = "the reference", curve: bool = True) -> Scale:
        """The normalisation by a reference."""
        goals, R = reference.goals, truth(reference)
        ideal, unit = extent(R)
        sign = np.array([goal.sign for goal in goals])
        best, worst, corner = (tuple((sign * values + 0.0).tolist()) for values in (ideal, R.max(axis=0), ideal + VOLUME_CORNER * unit))
        known = _known(reference) if len(goals) == 2 else None
        words = f", the curve through them, known to about {known.error:.0e}" if known else ", the curve through them"
        return cls(best, worst, corner, goals, what, len(R), words if curve and pieces(reference) else "")

    def describe(self) -> str:
        """Two sentences for a caption."""
        ends = f"0 at the ideal ({self._all(self.ideal)}) and 1 at the nadir ({self._all(self.nadir)})"
        volume = f"Hypervolume up to {VOLUME_CORNER:g} in each objective ({self._all(self.corner)})."
        return f"Objectives normalised to {ends} of {self.what} ({counted(self.count, 'point')}{self.curve}). {volume}"

    def _all(self, values: tuple[float, ...]) -> str:
        return ", ".join(f"{goal.name} {value:.6g} {goal.unit}".rstrip() for goal, value in zip(self.goals, values, strict=True))
