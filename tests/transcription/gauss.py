"""Gauss-Legendre implicit Runge-Kutta, written on its own: to compare with."""

from collections.abc import Callable

import numpy as np
from numpy.polynomial.legendre import leggauss
from scipy.optimize import root


def tableau(stages: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A, b, c: integrals of the Lagrange polynomials on the shifted nodes."""
    nodes, weights = leggauss(stages)
    c = 0.5 * (nodes + 1)
    A = np.empty((stages, stages))
    for j in range(stages):
        others = np.delete(nodes, j)
        for i in range(stages):
            # The integral of the j-th Lagrange polynomial from 0 to c_i, by the same nodes shrunk to there: exact.
            t = c[i] * (nodes + 1) - 1
            A[i, j] = 0.5 * c[i] * weights @ np.prod((t[:, None] - others) / (nodes[j] - others), axis=1)
    return A, 0.5 * weights, c


def integrate(rates: Callable, x0: np.ndarray, edges: np.ndarray, stages: int) -> tuple[np.ndarray, np.ndarray]:
    """States at the edges (N + 1, n) and at the stages (N, stages, n) of `rates(element, t, x)`."""
    A, b, c = tableau(stages)
    ends, inside = [np.asarray(x0, dtype=float)], []
    n = len(x0)
    for j, (t, h) in enumerate(zip(edges[:-1], np.diff(edges), strict=True)):
        left = ends[-1]

        def slopes(Y: np.ndarray, j: int = j, t: float = t, h: float = h) -> np.ndarray:
            return np.array([rates(j, t + ci * h, Yi) for ci, Yi in zip(c, Y, strict=True)])

        def missing(Y: np.ndarray, left: np.ndarray = left, h: float = h, slopes: Callable = slopes) -> np.ndarray:
            Y = Y.reshape(stages, n)
            return (Y - left - h * A @ slopes(Y)).ravel()

        start = np.tile(left, stages)
        found = root(missing, start, tol=1e-14)
        Y = root(missing, found.x, tol=1e-15).x.reshape(stages, n)
        inside.append(Y)
        ends.append(left + h * b @ slopes(Y))
    return np.array(ends), np.array(inside)
