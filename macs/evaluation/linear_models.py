"""Linear models of the constraints from points that were evaluated already, and the steps to where these models have no residual.

A black box has no derivatives. Residuals at points nearby replace them: the model of a constraint is the linear function that fits these
best, the nearest most; where they are too few for that, the flattest of all (Conn, Scheinberg and Vicente 2009, chapters 4 and 5). The step
is the shortest to the zero of all models, as with gradients in the repair of Chootinan and Chen (2006).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from .evaluator import Box

MEMORY = 500
"""Most points that are kept, the last ones."""
MOST = 40
"""Most points that a model is made of; else two for each variable and two more. Signs are found from twice as many."""
FLAT, ALIKE = 1e-6, 1e-3
"""Singular values below these parts of the largest count as zero: of the points around, of the gradients of unit length."""
POOR, CLEARLY = 1e-4, 0.03
"""A constraint may be a limit on an absolute value where the misfit of its model is more than this part of the squared changes, and counts
as one where this lowers the misfit to this part."""
FOLDS, GUESSES = 5, 300
"""Models of such a constraint, with each of which the signs of its residuals are chosen anew; and how many of the first models go on, of
all such constraints together, but at least three of each."""
BEYOND = 0.02
"""Part of the residuals by which a step goes beyond the zero of their models, so that it ends inside of limits."""


@dataclass(frozen=True, repr=False)
class Samples:
    """Evaluated points with the residuals of all constraints, oldest first."""

    SHAPES: ClassVar[dict[str, str]] = {"X": "s d", "residuals": "s c"}

    X: np.ndarray  # (s, d): In the unit box
    residuals: np.ndarray  # (s, c): See `Evaluation.residuals`

    @classmethod
    def none(cls, d: int) -> Self:
        """No point of d variables; the number of constraints is that of the first points that are added."""
        return cls(np.empty((0, d)), np.empty((0, 0)))

    def __len__(self) -> int:
        return len(self.X)

    def __repr__(self) -> str:
        return f"<Samples: {len(self)} with {self.residuals.shape[1]} residuals>"

    def joined(self, X: np.ndarray, residuals: np.ndarray) -> Self:
        """The last of these points and of others, at most `MEMORY`. Raises ValueError if the others have another number of residuals."""
        if not len(self):
            return type(self)(X[-MEMORY:], residuals[-MEMORY:])
        known, count = self.residuals.shape[1], residuals.shape[1]
        if count != known:
            raise ValueError(f"constraints: the function returned {count} of them, {known} before")
        return type(self)(np.vstack([self.X, X])[-MEMORY:], np.vstack([self.residuals, residuals])[-MEMORY:])


def steps_to_zero(box: Box, X: np.ndarray, residuals: np.ndarray, samples: Samples) -> np.ndarray:
    """Steps (k, d) from points X (k, d) to where the models of their residuals (k, c) are zero, or as near to it as the bounds allow.

    A constraint without a residual at a point has no part in its step. No step is longer than the distance of the farthest point that its
    models are made of. It is zero where no other point is known.
    """
    squared = box.squared_distances(X, samples.X)
    squared[squared == 0.0] = np.inf
    count = min(2 * X.shape[1] + 2, MOST)
    order = np.argsort(squared, axis=1, kind="stable")[:, : 2 * count]
    steps = np.zeros_like(X)
    for row, near in enumerate(order):
        near = near[np.isfinite(squared[row, near])]
        violated = np.flatnonzero(residuals[row])
        if len(near) and len(violated):
            apart, amount = np.sqrt(squared[row, near]), residuals[row, violated]
            with np.errstate(over="ignore", invalid="ignore"):  # a slope that is no finite number is left out
                gradients = _gradients(box.difference(samples.X[near], X[row]), samples.residuals[near][:, violated], amount, apart, count)
                step = _step(box, X[row], amount, gradients)
            steps[row] = step * min(1.0, apart[:count].max() / max(float(np.linalg.norm(step)), np.finfo(float).tiny))
    return steps


def _gradients(steps: np.ndarray, residuals: np.ndarray, amount: np.ndarray, apart: np.ndarray, count: int) -> np.ndarray:
    """Gradients (c, d) of the linear models of residuals (n, c) at steps (n, d) of lengths `apart` (n,) from a point with the residuals
    `amount` (c,); of the first `count` of these.

    A limit such as abs(h(x)) <= 0.0001 has positive residuals on both sides of h(x) = 0. Where no residual is negative, some of them
    therefore count as negative, if a model of all of them fits far better then.
    """
    fit = _Fit(steps[:count], apart[:count])
    slopes = fit(residuals[:count] - amount)[0]
    maybe = np.flatnonzero((residuals >= 0.0).all(axis=0) & (amount > 0.0))
    if maybe.size:
        whole, change = _Fit(steps, apart), residuals[:, maybe] - amount[maybe]
        misfit = whole(change)[1]
        poor = misfit > POOR * np.square(change / apart[:, None]).sum(axis=0)
        maybe, misfit = maybe[poor], misfit[poor]
    if maybe.size:
        signs = _signs(whole, steps, residuals[:, maybe], amount[maybe], CLEARLY * misfit)
        folded = np.flatnonzero((signs < 0.0).any(axis=0))
        which = maybe[folded]
        slopes[:, which] = fit((signs[:, folded] * residuals[:, which])[:count] - amount[which])[0]
    return slopes.T


class _Fit:
    """Linear models by steps (n, d) of lengths `apart` (n,), by the square of which residuals are divided."""

    def __init__(self, steps: np.ndarray, apart: np.ndarray) -> None:
        self._steps, self._apart = steps / apart[:, None], apart[:, None]
        self._inverse = np.linalg.pinv(self._steps, rcond=FLAT)

    def __call__(self, change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gradients (..., d, c) that fit changes (..., n, c) best, and the squared misfits (..., c)."""
        change = change / self._apart
        slopes = self._inverse @ change
        return slopes, np.square(self._steps @ slopes - change).sum(axis=-2)


def _signs(fit: _Fit, steps: np.ndarray, residuals: np.ndarray, amount: np.ndarray, least: np.ndarray) -> np.ndarray:
    """Signs (n, c) of residuals (n, c), 1 or -1, with which models have misfits below `least` (c,); 1 where none have. See `_gradients`.

    Each is that of the model before, from several first guesses, of which the best go on: all points are on the other side, or one is, and
    the model has the slope from here to it.
    """
    signs, columns = np.ones_like(residuals), np.arange(len(amount))
    along = (steps @ steps.T / np.square(steps).sum(axis=1)[:, None])[:, :, None]
    model = np.concatenate([np.full((1, *residuals.shape), -1.0), amount - along * (amount + residuals[:, None])])
    for _ in range(FOLDS):
        tried = np.where(model < 0.0, -1.0, 1.0)
        found, misfits = fit(tried * residuals - amount)
        best = misfits.argmin(axis=0)
        better = misfits[best, columns] < least
        signs[:, better] = tried[best, :, columns][better].T
        least = np.where(better, misfits[best, columns], least)
        go_on = np.argsort(misfits, axis=0)[: max(GUESSES // len(columns), 3)]
        model = amount + steps @ np.moveaxis(found[go_on, :, columns], 2, 1)
    return signs


def _step(box: Box, x: np.ndarray, amount: np.ndarray, gradients: np.ndarray) -> np.ndarray:
    """The shortest step (d,) from x (d,) by which residuals `amount` (c,) with these gradients (c, d) vanish; variables that it would move
    beyond a bound stay there, and the others do more."""
    sizes = np.linalg.norm(gradients, axis=1)
    known = np.isfinite(sizes) & (sizes > 0.0)
    directions, wanted = gradients[known] / sizes[known, None], -(1.0 + BEYOND) * amount[known] / sizes[known]
    step, free = np.zeros(len(x)), np.ones(len(x), dtype=bool)
    while len(wanted) and free.any():
        fixed = np.where(free, 0.0, step)
        step = fixed.copy()
        step[free] = np.linalg.pinv(directions[:, free], rcond=ALIKE) @ (wanted - directions @ fixed)
        end = x + step
        beyond = free & ~box.wraps & ((end < 0.0) | (end > 1.0))
        if not beyond.any():
            break
        step[beyond] = np.clip(end, 0.0, 1.0)[beyond] - x[beyond]
        free &= ~beyond
    return step
