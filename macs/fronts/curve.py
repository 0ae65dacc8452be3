"""A front of two objectives as a curve: any point between those that were solved, its rates, and an estimate of the error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Self

import numpy as np

from problems.compiled import Objective

from ..evaluation.evaluator import CONVERGED
from ..io.text import counted
from ..pareto.dominance import BETTER, nondominated, separate
from .pieces import CurvePiece, pieces

GAPS = "gaps"
"""Entry of `stats`: pairs of values of the first objective, in the user's units, between which a front has no points."""


@dataclass(frozen=True, eq=False, repr=False)
class FrontCurve:
    """A front of two objectives as a curve: cubic pieces through its points and their slopes, which are the ratios of their `weights`.

    Objectives, both minimised, are scaled to u in [0, 1] between the two ends of the front. The curve is a function of the place along the
    line between the ends, s = (1 + u1 - u2) / 2, which is the parameter of Pascoletti and Serafini (1984): its value is the height
    h = (u1 + u2 - 1) / 2 over that line. Slopes of h are in [-1, 1], also where the front is vertical or horizontal.

    Examples
    --------
    >>> import macs, problems
    >>> curve = macs.sweep(problems.load("goddard"), points=7, starts=1).curve()
    >>> curve(175.0).shape, curve.error < 1e-3, len(curve.pieces)
    ((2,), True, 1)
    """

    goals: tuple[Objective, ...]
    least: np.ndarray  # (2,): best values, all minimised
    ranges: np.ndarray  # (2,)
    parts: tuple[CurvePiece, ...]
    message: str  # which points were left out; empty if none

    @classmethod
    def through(cls, goals: Sequence[Objective], F: np.ndarray, weights: np.ndarray, gaps: Sequence[float], message: str = "") -> Self:
        """The curve through points of a front with objectives, all minimised, and weights (n, 2); `gaps` has a first objective in each."""
        order = np.argsort(F[:, 0])
        curve = cls(tuple(goals), F.min(axis=0), np.ptp(F, axis=0), (), message)
        worth = (weights * curve.ranges)[order].T
        parts = pieces(*curve.placed(F[order]), (worth[1] - worth[0]) / worth.sum(axis=0), np.searchsorted(F[order, 0], gaps).tolist())
        return replace(curve, parts=tuple(parts))

    def placed(self, F: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places and heights (...,) of points with objectives (..., 2), all minimised."""
        u = (F - self.least) / self.ranges
        return 0.5 * (1.0 + u[..., 0] - u[..., 1]), 0.5 * (u[..., 0] + u[..., 1] - 1.0)

    def __repr__(self) -> str:
        left = f"; {self.message}" if self.message else ""
        names = " against ".join(f"'{goal.name}'" for goal in self.goals)
        return f"<FrontCurve: {names}, {counted(len(self.parts), 'piece')}, error about {self.error:.1e} of the ranges{left}>"

    def __call__(self, value: Any, objective: str | int | None = None) -> np.ndarray:
        """Objectives on the curve where one of them has a value.

        Parameters
        ----------
        value : float or array (...,)
            In the user's unit.
        objective : str or int, optional
            The name or number of the objective that has this value. Default: the first one. Raises ValueError if there is no such one.

        Returns
        -------
        array (2,) or (..., 2)
            In the user's units and senses; NaN off the front and in its gaps.
        """
        return self.at_parameter(self.parameter(value, objective))

    def rates(self, value: Any, objective: str | int | None = None) -> np.ndarray:
        """How much the other objective changes along the front for a unit more of this one, where this has a value (...,), in the user's
        units; infinite where the front is vertical, NaN off it. See `TradeOffs.rate`. Raises ValueError if there is no such objective."""
        i = self._number(objective)
        slopes = self.at(self.parameter(value, i))[1] * (1 - 2 * i)
        with np.errstate(divide="ignore"):
            falls = (1.0 - slopes) / (1.0 + slopes)
        return -falls * self.goals[0].sign * self.goals[1].sign * self.ranges[1 - i] / self.ranges[i]

    @property
    def error(self) -> float:
        """An estimate of the largest distance of the curve from the front, along its normal, in ranges of the objectives, from interpolants
        of different orders. It knows of no kinks, gaps and valleys that no point tells of, and nothing of other meshes."""
        return max((float(one.max()) for one in self.errors if len(one)), default=BETTER)

    @property
    def errors(self) -> tuple[np.ndarray, ...]:
        """The same between the nodes of each piece."""
        return tuple(part.errors for part in self.parts)

    def wanting(self, error: float, tried: Sequence[float]) -> list[float]:
        """The middles, but for those that were tried, of where the curve errs by more, those of the largest errors first."""
        ends = [zip(pairwise(part.places.tolist()), part.errors.tolist(), strict=True) for part in self.parts]
        found = [(-estimate, 0.5 * (start + end)) for part in ends for (start, end), estimate in part if estimate > error]
        return [place for _, place in sorted(found) if not np.isclose(place, tried).any()]

    @property
    def pieces(self) -> np.ndarray:
        """Objectives (k, 2, 2) at both ends of each piece, in the user's units and senses."""
        return np.array([self._objectives(part.places[[0, -1]], part.heights[[0, -1]]) for part in self.parts])

    def within(self, error: float = 0.02) -> Self:
        """The curve where its estimated error is at most this, in ranges: what a picture may show. Elsewhere it has gaps."""
        parts = [
            CurvePiece(part.places[a:b], part.heights[a:b], part.slopes[a:b], part.errors[a : b - 1])
            for part in self.parts
            for a, b in pairwise([0, *(np.flatnonzero(part.errors > error) + 1).tolist(), len(part.places)])
        ]
        return replace(self, parts=tuple(parts))

    def sample(self, count: int = 200) -> np.ndarray:
        """Objectives (k, 2) at about so many places along the curve, in the user's units and senses, with a row of NaN in each gap."""
        rows: list[np.ndarray] = []
        for k, part in enumerate(self.parts):
            start, end = part.interval
            if k and start > self.parts[k - 1].interval[1]:
                rows.append(np.full((1, 2), np.nan))
            places = part.spread(2 + int(count * (end - start)))
            rows.append(self._objectives(places, part(places)[0]))
        return np.concatenate(rows)

    def distances(self, objectives: np.ndarray) -> np.ndarray:
        """Distances (n,) of points from the curve, in its ranges; objectives (n, 2) in the user's units and senses."""
        points = np.column_stack(self.placed(np.asarray(objectives) * [goal.sign for goal in self.goals]))
        lines = []
        for part in self.parts:
            places = np.unique(np.concatenate([part.spread(2001), part.places]))
            lines.append(np.column_stack([places, part(places)[0]]))
        return np.sqrt(2.0) * distances(points, lines)

    @cached_property
    def knee(self) -> np.ndarray:
        """Objectives (2,) of the knee: the point of the curve farthest below the line between its ends, in ranges (Das, "On characterizing
        the 'knee' of the Pareto curve based on normal-boundary intersection", Structural Optimization 18, 1999)."""
        places = np.concatenate([part.spread(2001) for part in self.parts])
        return self.at_parameter(places[np.nanargmin(self.at(places)[0])])

    def parameter(self, value: Any, objective: str | int | None = None) -> np.ndarray:
        """Places (...,) where an objective has a value, as for a call; NaN off the front and in its gaps."""
        i = self._number(objective)
        u = (np.asarray(value, dtype=float) * self.goals[i].sign - self.least[i]) / self.ranges[i]
        found = np.full(u.shape, np.nan)
        for part in self.parts:
            low, high = sorted(_scaled(part.places[[0, -1]], part.heights[[0, -1]])[..., i])
            here = (u >= low - 1e-9) & (u <= high + 1e-9)  # with what rounding leaves
            start, end = (np.full(u.shape, one) for one in part.interval)
            for _ in range(60):
                middle = 0.5 * (start + end)
                after = (_scaled(middle, part(middle)[0])[..., i] < u) == (i == 0)
                start, end = np.where(after, middle, start), np.where(after, end, middle)
            found = np.where(here, 0.5 * (start + end), found)
        return found

    def at_parameter(self, places: Any) -> np.ndarray:
        """Objectives (..., 2) at places (...,), in the user's units and senses; NaN off the front and in its gaps."""
        return self._objectives(np.asarray(places, dtype=float), self.at(places)[0])

    def at(self, places: Any) -> np.ndarray:
        """Heights, slopes and errors (3, ...) at places (...,); NaN where there are none."""
        places = np.asarray(places, dtype=float)
        found = np.full((3, *places.shape), np.nan)
        for part in self.parts:
            start, end = part.interval
            inside = np.clip(places, start, end)
            found = np.where((places >= start) & (places <= end), [*part(inside), part.errors_at(inside)], found)
        found[1] = np.clip(found[1], -1.0, 1.0)
        return found

    def _objectives(self, places: np.ndarray, heights: np.ndarray) -> np.ndarray:
        """Objectives (..., 2), in the user's units and senses, of places and heights."""
        return (self.least + self.ranges * _scaled(places, heights)) * np.array([goal.sign for goal in self.goals])

    def _number(self, objective: str | int | None) -> int:
        names = [goal.name for goal in self.goals]
        if objective not in (None, 0, 1, *names):
            raise ValueError(f"there is no objective {objective!r}; there are {', '.join(names)}")
        return names.index(objective) if isinstance(objective, str) else objective or 0


def _scaled(places: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Objectives (..., 2) in ranges, of places and heights."""
    return np.stack([places + heights, 1.0 - places + heights], axis=-1)


def distances(points: np.ndarray, lines: Sequence[np.ndarray]) -> np.ndarray:
    """Distances (n,) of points (n, 2) to the nearest of some polygons (k, 2), in their order; one of them may be a point."""
    found = np.full(len(points), np.inf)
    for line in lines:
        steps = np.diff(line, axis=0, append=line[-1:])
        share = ((points[:, None] - line) * steps).sum(axis=2) / np.maximum((steps**2).sum(axis=1), np.finfo(float).tiny)
        away = points[:, None] - line - np.clip(share, 0.0, 1.0)[..., None] * steps
        found = np.minimum(found, np.linalg.norm(away, axis=2).min(axis=1))
    return found


def curve_of(front: Any) -> FrontCurve:
    """The curve of a front; see `Front.curve`."""
    if len(front.goals) != 2:
        names = ", ".join(f"'{name}'" for name in front.names)
        raise ValueError(f"a curve is a front of two objectives, and this one has {len(front.goals)}: {names}")
    weights = np.array([np.full(2, np.nan) if one is None else one.weights for one in front.costates]).reshape(-1, 2)
    masks = {
        "not feasible": (front.status == CONVERGED) & np.isfinite(front.F).all(axis=1),
        "not verified": front.verified | ~front.was_simulated,
        "without weights": ~np.isnan(weights).any(axis=1),
    }
    good = np.all([*masks.values()], axis=0)
    masks["dominated or equal"] = np.zeros(len(front), dtype=bool)
    masks["dominated or equal"][good] = alone(front.F[good], np.ptp(front.F[good], axis=0) if good.any() else np.ones(2))
    kept, left = np.ones(len(front), dtype=bool), list[str]()
    for word, mask in masks.items():
        left += [f"{np.count_nonzero(kept & ~mask)} {word}"] if (kept & ~mask).any() else []
        kept &= mask
    message = f"of {counted(len(front), 'point')} left out: {', '.join(left)}" if left else ""
    if kept.sum() < 2:
        rest = f": {message or front.message}".removesuffix(": ")
        raise ValueError(f"a curve goes through two points of a front at least, whose weights are its slopes{rest}")
    gaps = front.signs[0] * np.reshape(front.stats.get(GAPS, []), (-1, 2)).mean(axis=1)
    return FrontCurve.through(front.goals, front.F[kept], weights[kept], gaps.tolist(), message)


def alone(F: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    """Mask (n,) of points (n, m) that no other dominates or equals, to the accuracy of solves. ranges (m,)."""
    kept = np.zeros(len(F), dtype=bool)
    rows = np.flatnonzero(nondominated(F))
    kept[rows[separate(F[rows], ranges)]] = True
    return kept
