"""UF1 to UF10 of the CEC 2009 competition: functions of 30 variables whose best values are coupled, and their true fronts.

Zhang, Zhou, Zhao, Suganthan, Liu and Tiwari, Multiobjective optimization test instances for the CEC 2009 special session and competition,
University of Essex, CES-487, 2008.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

N = 30
"""Variables."""
J = np.arange(1, N + 1)
"""Their numbers, from 1, as in the report."""
COUNT = 1000
"""Points of a front of two objectives, as in the competition; of three, ten times as many."""
EDGES = 10
"""Half the number of the gaps between the points of UF5's front."""
EPSILON = 0.1
"""Of UF5, UF6 and UF9."""


@dataclass(frozen=True)
class UF:
    """One of the functions."""

    kind: int  # 1 to 10

    @property
    def objectives(self) -> int:
        """Their number, m."""
        return 2 if self.kind < 8 else 3

    @property
    def bounds(self) -> list[tuple[float, float]]:
        """Of each variable."""
        rest = {3: (0.0, 1.0), 4: (-2.0, 2.0)}.get(self.kind, (-1.0, 1.0) if self.kind < 8 else (-2.0, 2.0))
        places = self.objectives - 1
        return [(0.0, 1.0)] * places + [rest] * (N - places)

    def __call__(self, X: np.ndarray) -> np.ndarray:
        """Objectives (k, m) of vectors X (k, 30)."""
        m, x = self.objectives, X[:, 0]
        y = X - self.best(X)
        parts = [(m <= J) & (J % m == (i + 1) % m) for i in range(m)]
        far = np.column_stack([2.0 * self._distances(y[:, part], J[part]) / part.sum() for part in parts])
        if self.kind in (8, 10):
            a, b = 0.5 * np.pi * x, 0.5 * np.pi * X[:, 1]
            return far + np.column_stack([np.cos(a) * np.cos(b), np.cos(a) * np.sin(b), np.sin(a)])
        if self.kind == 9:
            hump = np.maximum(0.0, (1.0 + EPSILON) * (1.0 - 4.0 * (2.0 * x - 1.0) ** 2))
            second = X[:, 1]
            return far + np.column_stack([0.5 * (hump + 2.0 * x) * second, 0.5 * (hump - 2.0 * x + 2.0) * second, 1.0 - second])
        if self.kind == 4:
            return far + np.column_stack([x, 1.0 - x**2])
        if self.kind == 5:
            hump = (0.5 / EDGES + EPSILON) * np.abs(np.sin(2.0 * EDGES * np.pi * x))
            return far + np.column_stack([x + hump, 1.0 - x + hump])
        if self.kind == 6:
            hump = np.maximum(0.0, 2.0 * (0.25 + EPSILON) * np.sin(4.0 * np.pi * x))
            return far + np.column_stack([x + hump, 1.0 - x + hump])
        if self.kind == 7:
            return far + np.column_stack([x**0.2, 1.0 - x**0.2])
        return far + np.column_stack([x, 1.0 - np.sqrt(x)])

    def best(self, X: np.ndarray) -> np.ndarray:
        """The values (k, 30) of the variables on the Pareto set, for the places that the first one or two of X (k, 30) say."""
        x, phase = X[:, :1], 6.0 * np.pi * X[:, :1] + J * np.pi / N
        if self.kind == 3:
            return x ** (0.5 * (1.0 + 3.0 * (J - 2.0) / (N - 2.0)))
        if self.kind == 2:
            width = 0.3 * x**2 * np.cos(4.0 * phase) + 0.6 * x
            return width * np.where(J % 2 == 1, np.cos(phase), np.sin(phase))
        if self.kind >= 8:
            return 2.0 * X[:, 1:2] * np.sin(2.0 * np.pi * x + J * np.pi / N)
        return np.sin(phase)

    def _distances(self, y: np.ndarray, j: np.ndarray) -> np.ndarray:
        """The sum (k,) over the variables of one objective, of which y (k, l) is what they are away from their best."""
        if self.kind == 4:
            return (np.abs(y) / (1.0 + np.exp(2.0 * np.abs(y)))).sum(axis=1)
        if self.kind == 5:
            return (2.0 * y**2 - np.cos(4.0 * np.pi * y) + 1.0).sum(axis=1)
        if self.kind == 10:
            return (4.0 * y**2 - np.cos(8.0 * np.pi * y) + 1.0).sum(axis=1)
        if self.kind in (3, 6):
            return 4.0 * (y**2).sum(axis=1) - 2.0 * np.cos(20.0 * y * np.pi / np.sqrt(j)).prod(axis=1) + 2.0
        return (y**2).sum(axis=1)

    def front(self) -> np.ndarray:
        """Points (k, m) of the true front, evenly in the parameters that the competition's own sampling is even in."""
        if self.kind in (8, 10):
            a, b = (0.5 * np.pi * one.ravel() for one in np.meshgrid(*[np.linspace(0.0, 1.0, 100)] * 2))
            return np.column_stack([np.cos(a) * np.cos(b), np.cos(a) * np.sin(b), np.sin(a)])
        if self.kind == 9:
            sides = np.concatenate([np.linspace(0.0, 0.25, 50), np.linspace(0.75, 1.0, 50)])
            a, b = (one.ravel() for one in np.meshgrid(sides, np.linspace(0.0, 1.0, 100)))
            return np.column_stack([a * b, (1.0 - a) * b, 1.0 - b])
        if self.kind == 5:
            f = np.linspace(0.0, 1.0, 2 * EDGES + 1)
        elif self.kind == 6:
            third = COUNT // 3
            f = np.concatenate([[0.0], np.linspace(0.25, 0.5, third), np.linspace(0.75, 1.0, third)])
        else:
            f = np.linspace(0.0, 1.0, COUNT)
        shape = {4: 1.0 - f**2, 5: 1.0 - f, 6: 1.0 - f, 7: 1.0 - f}.get(self.kind, 1.0 - np.sqrt(f))
        return np.column_stack([f, shape])
