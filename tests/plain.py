"""Plain functions with known fronts: Zitzler, Deb and Thiele 2000; Deb, Thiele, Laumanns and Zitzler 2005; three of CEC 2009."""

from collections.abc import Callable

import numpy as np

from macs.pareto.directions import simplex_lattice
from macs.pareto.dominance import nondominated

Plain = tuple[Callable[[np.ndarray], np.ndarray], list[tuple[float, float]], np.ndarray]
"""A function, its bounds, and some 1000 (3 objectives: 5000) points of its front, evenly spread."""


def zdt(kind: int) -> Plain:
    """ZDT1-4 and 6, of two objectives."""
    d = 10 if kind in (4, 6) else 30

    def function(X: np.ndarray) -> np.ndarray:
        x, rest = X[:, 0], X[:, 1:]
        g = 1 + 9 * rest.mean(axis=1) ** (0.25 if kind == 6 else 1.0)
        if kind == 4:
            g = 1 + 10 * (d - 1) + (rest**2 - 10 * np.cos(4 * np.pi * rest)).sum(axis=1)
        first = 1 - np.exp(-4 * x) * np.sin(6 * np.pi * x) ** 6 if kind == 6 else x
        share = first / g
        h = 1 - (share**2 if kind in (2, 6) else np.sqrt(share)) - (share * np.sin(10 * np.pi * first) if kind == 3 else 0)
        return np.stack([first, g * h], axis=1)

    if kind == 6:
        x = np.linspace(0.2807753191, 1, 1000)
        front = np.stack([x, 1 - x**2], axis=1)
    else:
        x = np.linspace(0, 1, 20_000 if kind == 3 else 1000)
        front = function(np.hstack([x[:, None], np.zeros((len(x), d - 1))]))
        front = front[nondominated(front)]
        front = front[np.linspace(0, len(front) - 1, 1000).astype(int)]
    return function, [(0, 1)] + [(-5, 5) if kind == 4 else (0, 1)] * (d - 1), front


def dtlz(kind: int, m: int) -> Plain:
    """DTLZ1-4 and 7, of m objectives."""
    distant = {1: 5, 7: 20}.get(kind, 10)

    def function(X: np.ndarray) -> np.ndarray:
        place, rest = X[:, : m - 1], X[:, m - 1 :] - 0.5
        if kind == 7:
            g = 1 + 9 * X[:, m - 1 :].mean(axis=1, keepdims=True)
            h = m - (place / (1 + g) * (1 + np.sin(3 * np.pi * place))).sum(axis=1, keepdims=True)
            return np.hstack([place, (1 + g) * h])
        g = (rest**2).sum(axis=1)
        if kind in (1, 3):
            g = 100 * (distant + g - np.cos(20 * np.pi * rest).sum(axis=1))
        angle = (place**100 if kind == 4 else place) * np.pi / 2
        along, across = (place, 1 - place) if kind == 1 else (np.cos(angle), np.sin(angle))
        scale = (1 + g) * (0.5 if kind == 1 else 1.0)
        columns = [scale * along[:, : m - 1 - i].prod(axis=1) * (across[:, m - 1 - i] if i else 1.0) for i in range(m)]
        return np.stack(columns, axis=1)

    if kind == 7:
        sides = [np.linspace(0, 1, 20_000 if m == 2 else 400)] * (m - 1)
        place = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, m - 1)
        front = function(np.hstack([place, np.zeros((len(place), distant))]))
        front = front[nondominated(front)]
        front = front[np.random.default_rng(0).permutation(len(front))[:5000]]
    else:
        lattice = simplex_lattice(m, {2: 999, 3: 99}.get(m, 7))
        front = lattice / 2 if kind == 1 else lattice / np.linalg.norm(lattice, axis=1, keepdims=True)
    return function, [(0, 1)] * (m - 1 + distant), front


def uf(kind: int) -> Plain:
    """UF1-3 of CEC 2009 (Zhang and others 2008), 30 variables, two objectives."""
    d = 30
    j = np.arange(2, d + 1)
    odd = j % 2 == 1

    def function(X: np.ndarray) -> np.ndarray:
        x, rest = X[:, :1], X[:, 1:]
        phase = 6 * np.pi * x + j * np.pi / d
        if kind == 1:
            y = rest - np.sin(phase)
        elif kind == 2:
            width = 0.3 * x**2 * np.cos(24 * np.pi * x + 4 * j * np.pi / d) + 0.6 * x
            y = rest - width * np.where(odd, np.cos(phase), np.sin(phase))
        else:
            y = rest - x ** (0.5 * (1 + 3 * (j - 2) / (d - 2)))
        far = []
        for part in (odd, ~odd):
            total = (y[:, part] ** 2).sum(axis=1)
            if kind == 3:
                total = 4 * total - 2 * np.cos(20 * y[:, part] * np.pi / np.sqrt(j[part])).prod(axis=1) + 2
            far.append(2 * total / part.sum())
        return np.stack([x[:, 0] + far[0], 1 - np.sqrt(x[:, 0]) + far[1]], axis=1)

    x = np.linspace(0, 1, 1000)
    return function, [(0, 1)] + [(0, 1) if kind == 3 else (-1, 1)] * (d - 1), np.stack([x, 1 - np.sqrt(x)], axis=1)
