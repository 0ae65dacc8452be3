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
        self._known = np.zeros((k, 1), dtype=bool)
        self._slot = 0

    def keep(self, rows: np.ndarray) -> None:
        """Go on with some of the iterations only."""
        for name in ("_dx", "_ds", "_x", "_s", "_known"):
            setattr(self, name, getattr(self, name)[rows])

    def improve(self, x: np.ndarray, s: np.ndarray, good: np.ndarray) -> np.ndarray:
        """Better steps (k, d) than s, at x; iterations whose steps are not `good` (k,) begin anew."""
        if not good.all():
            self._dx[~good], self._ds[~good], self._known[~good] = 0.0, 0.0, False
        dx, ds, slot = self._dx, self._ds, self._slot
        dx[:, slot], ds[:, slot] = (x - self._x) * self._known, (s - self._s) * self._known
        self._x, self._s, self._slot = x, s, (slot + 1) % dx.shape[1]
        self._known[good] = True
        gram = ds @ ds.transpose(0, 2, 1)
        diagonal = np.einsum("kii->ki", gram)
        diagonal += REGULAR * diagonal.max(axis=1, keepdims=True) + 1e-300
        share = np.linalg.solve(gram, ds @ s[:, :, None])
        return s - ((dx + ds).transpose(0, 2, 1) @ share)[:, :, 0]
