"""Sparse derivatives of NLPs: assembled from derivatives at points if an NLP has such parts, else from one long list of operations."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import casadi as ca
import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.sparse.csgraph import connected_components

from problems.compiled import remembered

from ..base import NLP
from .from_points import FromPoints, kind_of

MOST_GIGABYTES = 2.0
"""Most memory that the derivatives of one NLP may take."""


@remembered
def gradients(nlp: NLP) -> ca.Function:
    """z -> (dF/dz (m, n), dg/dz (r, n), both sparse, F, g). Raises ValueError where they are too many; see `refuse_dense`."""
    refuse_dense(nlp)
    whole = _from_points(nlp)
    if whole is not None:
        z, values = whole.z, whole.gradients()
    else:
        z = _symbol(nlp, "z", len(nlp.variables))
        F, g = nlp.functions(z)
        values = [ca.jacobian(F, z), _jacobian(g, z), F, g]
    return ca.Function("gradients", [z], values, ["z"], ["dF", "dg", "F", "g"])


@remembered
def objective_gradients(nlp: NLP) -> ca.Function:
    """z -> dF/dz (m, n), sparse. Raises as `gradients`."""
    refuse_dense(nlp)
    whole = _from_points(nlp)
    if whole is not None:
        return ca.Function("slopes", [whole.z], whole.gradients()[:1], ["z"], ["dF"])
    z = _symbol(nlp, "z", len(nlp.variables))
    return ca.Function("slopes", [z], [ca.jacobian(nlp.functions(z)[0], z)], ["z"], ["dF"])


@remembered
def linear_objectives(nlp: NLP) -> np.ndarray:
    """Mask (m,) of the objectives with constant slopes, such as a duration; False where the sparsity does not show it."""
    m = len(nlp.problem.goals)
    places, _ = objective_gradients(nlp).jac_sparsity(0, 0).get_triplet()
    return ~np.isin(np.arange(m), np.array(places, dtype=int) % m)


@remembered
def convex_objectives(nlp: NLP) -> np.ndarray:
    """Mask (m,) of the objectives that are quadratic and convex for given free times, of which there is at most one, with rows that are
    linear then: each has one optimum for each time. Integrands and dynamics are tried at places, as many as a mesh has."""
    m, kept, problem = len(nlp.problem.goals), np.setdiff1d(np.arange(len(nlp.variables)), nlp.times), nlp.problem
    inputs = ca.veccat(*(symbols := problem.objectives.mx_in()))
    F, rows = problem.objectives(*symbols), problem.constraints(*symbols)
    if len(nlp.times) > 1 or (nlp.period > 0).any() or any(ca.which_depends(rows, inputs, 2, True)):
        return np.zeros(m, dtype=bool)
    found = np.array([not any(ca.which_depends(ca.gradient(F[i], inputs), inputs, 2, True)) for i in range(m)])
    rng, second = np.random.default_rng(0), hessian(nlp)
    lower, upper = np.where(np.isfinite(nlp.lower), nlp.lower, 0.0), np.where(np.isfinite(nlp.upper), nlp.upper, nlp.scale)
    first, other = lower + rng.random((2, len(lower))) * (upper - lower)
    other[nlp.times] = first[nlp.times]

    def curved(z: np.ndarray, of_F: np.ndarray, of_g: Any) -> csr_matrix:
        return csr_matrix(second(z, of_F, of_g).sparse())[kept][:, kept]

    if np.abs(curved(first, np.zeros(m), rng.standard_normal(len(nlp.g_scale))).data).max(initial=0.0) > 0.0:
        return np.zeros(m, dtype=bool)
    for i in np.flatnonzero(found):
        H = curved(first, np.eye(m)[i], 0.0)
        slight = 1e-9 * np.abs(H.data).max(initial=0.0)
        alike = np.abs((H - curved(other, np.eye(m)[i], 0.0)).data).max(initial=0.0) <= slight
        found[i] = alike and all(least >= -slight for least in _least_eigenvalues(H))
    # A kink is in no second derivative: between two places, no objective may be larger than on the line that joins its values there.
    Z = lower + rng.random((16, len(lower))) * (upper - lower)
    Z[:, nlp.times] = first[nlp.times]
    ends, between = nlp.evaluate(Z)[0], nlp.evaluate(0.5 * (Z[1:] + Z[:-1]))[0]
    return found & ~(between > 0.5 * (ends[1:] + ends[:-1]) + 1e-9 * np.abs(ends).max(axis=0)).any(axis=0)


def _least_eigenvalues(upper: csr_matrix) -> Iterator[float]:
    """The least eigenvalue of each block of a symmetric matrix, given by its upper triangle, of which no block is coupled to another."""
    whole = upper + upper.T - diags(upper.diagonal())
    some = np.flatnonzero(np.diff(whole.indptr))
    whole = whole[some][:, some]
    labels = connected_components(whole, directed=False)[1]
    for rows in np.split(np.argsort(labels, kind="stable"), np.cumsum(np.bincount(labels))[:-1]):
        yield float(np.linalg.eigvalsh(whole[rows][:, rows].toarray()).min(initial=0.0))


@remembered
def hessian(nlp: NLP) -> ca.Function:
    """z, lambda (m,), mu (r,) -> the upper triangle of the Hessian of lambda'F + mu'g, sparse. Raises as `gradients`."""
    refuse_dense(nlp)
    whole, sizes = _from_points(nlp), {"of_F": len(nlp.problem.goals), "of_g": len(nlp.g_scale)}
    if whole is not None:
        z, (of_F, of_g) = whole.z, (ca.MX.sym(name, size) for name, size in sizes.items())
        H: Any = whole.hessian(of_F, of_g)
    else:
        z, of_F, of_g = (_symbol(nlp, name, size) for name, size in {"z": len(nlp.variables), **sizes}.items())
        F, g = nlp.functions(z)
        H = ca.triu(ca.hessian(ca.dot(of_F, F) + ca.dot(of_g, g), z)[0])
    return ca.Function("hessian", [z, of_F, of_g], [H], ["z", *sizes], ["H"])


@remembered
def _from_points(nlp: NLP) -> FromPoints | None:
    return None if nlp.parts is None else FromPoints(nlp, nlp.parts)


def _symbol(nlp: NLP, name: str, size: int) -> Any:
    return kind_of(nlp.functions).sym(name, size)


def _jacobian(rows: Any, z: Any) -> Any:
    """Derivatives of the rows; dense ones, those of integrals, apart: one sweep for many columns is lost where there is one such row."""
    counts = np.diff(ca.jacobian_sparsity(rows, z).T.colind())
    dense = np.flatnonzero(counts > 0.25 * max(z.numel(), 1))
    if not len(dense) or len(dense) == len(counts):
        return ca.jacobian(rows, z)
    sparse = np.setdiff1d(np.arange(len(counts)), dense)
    blocks = ca.vertcat(*(ca.jacobian(rows[which.tolist()], z) for which in (sparse, dense)))
    return blocks[np.argsort(np.concatenate([sparse, dense])).tolist(), :]


def too_dense(nlp: NLP) -> bool:
    """Whether the derivatives of an NLP would take more memory than `MOST_GIGABYTES`."""
    return _gigabytes(nlp) > MOST_GIGABYTES


def refuse_dense(nlp: NLP) -> None:
    """Raise ValueError if the derivatives of an NLP would take too much memory: how much, and what to use instead."""
    if too_dense(nlp):
        raise ValueError(
            f"problem '{nlp.problem.name}', {nlp.transcription!r}: derivatives would take about {_gigabytes(nlp):.3g} GB, more than "
            f"{MOST_GIGABYTES:g} GB, since the states depend on all controls before them: use MultipleShooting with as many intervals, "
            "whose derivatives are sparse, or fewer nodes, or a search without derivatives, inner='propagate'"
        )


def _gigabytes(nlp: NLP) -> float:
    """Memory until a program is ready: 120 bytes a derivative, measured on ascents with 800 and 1600 nodes."""
    return 120 * nlp.dense / 1e9
