"""The adjoint of a chain of Runge-Kutta steps: exact for the steps themselves, whatever their length."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..numerics.polynomials import lobatto_nodes
from ..trajectories.trajectory import PiecewisePolynomial

CUBIC = 0.5 * (1.0 + lobatto_nodes(4))
"""Places in [0, 1] at which cubic polynomials are kept."""


@dataclass(frozen=True, eq=False)
class Steps:
    """N steps, linearised."""

    # after, integrals, samples: (N, nx, nx), (N, nq, nx), (N, points, rows, nx): Derivatives, by the states before a step, of the states
    # after it, of its integrals, and of samples at its points, the first of which is its beginning.
    after: np.ndarray
    integrals: np.ndarray
    samples: np.ndarray
    at_end: np.ndarray  # (rows, nx): Those of samples at the end of the last step, by the states there


def backward(
    steps: Steps, final: np.ndarray, weights: np.ndarray, of_samples: np.ndarray, of_end: np.ndarray, falls: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Costates (N, nx) at the beginning of each step, and (N, nx) at its end, before they jump there. final (nx,), weights (nq,),
    of_samples (N, points, rows), of_end (rows,), falls (N, nx)."""
    begin, end = np.empty_like(falls), np.empty_like(falls)
    p = final + of_end @ steps.at_end
    for k in range(len(falls) - 1, -1, -1):
        end[k] = p
        inside = np.einsum("pr,prx->x", of_samples[k, 1:], steps.samples[k, 1:])
        begin[k] = p @ steps.after[k] + weights @ steps.integrals[k] + inside
        p = begin[k] + falls[k] + of_samples[k, :1].ravel() @ steps.samples[k, :1].reshape(-1, falls.shape[1])
    return begin, end


def cubics(edges: np.ndarray, begin: np.ndarray, end: np.ndarray, first: np.ndarray, last: np.ndarray) -> PiecewisePolynomial:
    """Hermite's cubic polynomials through values (N, nx) at the beginning and the end of each step with these slopes (N, nx) in time."""
    t, h = CUBIC[:, None], np.diff(edges)[:, None, None]
    begin, end, first, last = (one[:, None, :] for one in (begin, end, first, last))
    values = (1 + 2 * t) * (1 - t) ** 2 * begin + t**2 * (3 - 2 * t) * end + h * t * (1 - t) * ((1 - t) * first - t * last)
    return PiecewisePolynomial(edges, values, "lobatto")
