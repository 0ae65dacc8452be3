"""Anderson acceleration of many fixed-point iterations at once."""

from __future__ import annotations

import numpy as np

REGULAR = 1e-10


class Anderson:
    """Remembers the last steps of k iterations x -> x + s(x) and combines them so that the linear part of s vanishes soonest.

    Anderson, "Iterative procedures for nonlinear integral equations", 1965; in the form of Walker and Ni, 2011.

    Parameters
    ----------
    k, d : int
        How many iterations, of how many variables.
    memory : int
        How many differences are kept.
    """

    def __init__(self, k: int, d: int, memory: int) -> None:
        self._dx, self._ds = np.zeros((k, memory, d)), np.zeros((k, memory, d))
        self._x, self._s = np.zeros((k, d)), np.zeros((k, d))
        self._known = np.zeros(k, dtype=bool)

    def forget(self, rows: np.ndarray) -> None:
        """Begin anew with some of the iterations."""
        self._dx[rows], self._ds[rows], self._known[rows] = 0.0, 0.0, False

    def improve(self, rows: np.ndarray, x: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Better steps (len(rows), d) of the iterations `rows` than s, at x."""
        for history, last, new in ((self._dx, self._x, x), (self._ds, self._s, s)):
            difference = np.where(self._known[rows, None], new - last[rows], 0.0)
            history[rows] = np.concatenate([history[rows, 1:], difference[:, None]], axis=1)
            last[rows] = new
        self._known[rows] = True
        dx, ds = self._dx[rows], self._ds[rows]
        gram = ds @ ds.transpose(0, 2, 1)
        diagonal = np.einsum("kii->ki", gram)
        diagonal += REGULAR * diagonal.max(axis=1, keepdims=True) + 1e-300
        share = np.linalg.solve(gram, ds @ s[:, :, None])
        return s - ((dx + ds).transpose(0, 2, 1) @ share)[:, :, 0]
