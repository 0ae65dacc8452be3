"""Box of the free variables, scaled to the unit cube; periodic variables wrap around."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist


@dataclass(frozen=True)
class Box:
    """Bounds of the free variables, and the arithmetic of points and steps inside them.

    Points are rows X in unit coordinates: 0 at the lower bound, 1 at the upper one. So distances are in spans, whatever the units of the
    variables.
    """

    lower: np.ndarray  # lower, upper: (d,): Bounds in the user's units
    upper: np.ndarray
    # (d,): True for a periodic variable: its bounds are one period wide, and a point that leaves through one re-enters through the other.
    wraps: np.ndarray

    @property
    def span(self) -> np.ndarray:
        """Sides of the box, (d,), in the user's units."""
        return self.upper - self.lower

    def to_unit(self, values: np.ndarray) -> np.ndarray:
        """Unit coordinates (..., d) of values in the user's units; values outside the bounds are put back."""
        return self.put_back((values - self.lower) / self.span)

    def to_values(self, X: np.ndarray) -> np.ndarray:
        """Values (..., d) in the user's units, inside the bounds to the last bit."""
        return np.clip(self.lower + X * self.span, self.lower, self.upper)

    def confine(self, values: np.ndarray) -> np.ndarray:
        """The values (..., d), in the user's units, with those outside the bounds put back; the others are unchanged to the last bit."""
        outside = (values < self.lower) | (values > self.upper)
        return np.where(outside, self.to_values(self.to_unit(values)), values)

    def put_back(self, X: np.ndarray) -> np.ndarray:
        """The points X (..., d), wrapped where periodic and clipped elsewhere."""
        inside = np.clip(X, 0.0, 1.0)
        return np.where(self.wraps, X - np.floor(X), inside) if self.wraps.any() else inside

    def difference(self, X: np.ndarray, origin: np.ndarray) -> np.ndarray:
        """The step (..., d) from `origin` to X; periodic variables take the shorter way."""
        step = X - origin
        return np.where(self.wraps, step - np.round(step), step) if self.wraps.any() else step

    def squared_distances(self, X: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Squared distances (k, n) of X (k, d) to `others` (n, d), the shorter way in periodic variables; 0 between equal points."""
        even = ~self.wraps
        squares = cdist(X[:, even], others[:, even], "sqeuclidean") if even.any() else np.zeros((len(X), len(others)))
        if self.wraps.any():
            step = X[:, None, self.wraps] - others[:, self.wraps]
            step -= np.round(step)
            squares += np.einsum("knd,knd->kn", step, step)
        return squares

    def stop_outward(self, X: np.ndarray, step: np.ndarray) -> np.ndarray:
        """The step (..., d) without the components that lead from a bound out of the box."""
        outward = ((X <= 0.0) & (step < 0.0)) | ((X >= 1.0) & (step > 0.0))
        return np.where(outward & ~self.wraps, 0.0, step)

    def reach(self, X: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Largest fraction (...,), at most 1, of the step (..., d) that stays in the box; periodic variables do not limit it."""
        bound = np.where(step > 0.0, 1.0 - X, X)
        size = np.abs(step)
        limited = (size > 0.0) & ~self.wraps
        fraction = np.divide(bound, size, out=np.ones_like(size), where=limited)
        return np.clip(fraction.min(axis=-1, initial=1.0), 0.0, 1.0)

    def sample(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Latin hypercube of `count` points, (count, d) (McKay, Beckman and Conover 1979)."""
        strata = rng.permuted(np.tile(np.arange(count), (len(self.lower), 1)), axis=1).T
        return (strata + rng.random(strata.shape)) / count
