"""Sparse derivatives of NLPs: put together from those at points where an NLP has such parts, else of one long list of operations."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from problems.derived import remembered

from ..base import NLP
from .from_points import FromPoints, kind_of
from .pieces import jacobian, weighted_hessian

DENSE = 0.25
"""Share of the variables that a row is dense with."""


@remembered
def gradients(nlp: NLP) -> ca.Function:
    """z -> (dF/dz (m, n), dg/dz (r, n), both sparse, F, g)."""
    names = ["z"], ["dF", "dg", "F", "g"]
    if nlp.parts is not None:
        z = ca.MX.sym("z", len(nlp.variables))
        return ca.Function("gradients", [z], FromPoints(nlp, z).gradients(), *names)
    z = kind_of(nlp.functions).sym("z", len(nlp.variables))
    F, g = nlp.functions(z)
    return ca.Function("gradients", [z], [ca.jacobian(F, z), _jacobian(g, z), F, g], *names)


@remembered
def objective_gradients(nlp: NLP) -> ca.Function:
    """z -> dF/dz (m, n), sparse."""
    if nlp.parts is not None:
        z = ca.MX.sym("z", len(nlp.variables))
        return ca.Function("slopes", [z], [FromPoints(nlp, z).gradients()[0]], ["z"], ["dF"])
    z = kind_of(nlp.functions).sym("z", len(nlp.variables))
    return ca.Function("slopes", [z], [ca.jacobian(nlp.functions(z)[0], z)], ["z"], ["dF"])


@remembered
def hessian(nlp: NLP) -> ca.Function:
    """z, lambda (m,), mu (r,) -> the upper triangle of the Hessian of lambda'F + mu'g, sparse."""
    names, sizes = ["z", "of_F", "of_g"], [len(nlp.variables), len(nlp.problem.goals), len(nlp.g_scale)]
    if nlp.parts is not None:
        z, of_F, of_g = (ca.MX.sym(name, size) for name, size in zip(names, sizes, strict=True))
        H = FromPoints(nlp, z).hessian(of_F, of_g)
    else:
        z, of_F, of_g = (kind_of(nlp.functions).sym(name, size) for name, size in zip(names, sizes, strict=True))
        F, g = nlp.functions(z)
        H = weighted_hessian(g, of_g, z, ca.dot(of_F, F))
    return ca.Function("hessian", [z, of_F, of_g], [H], names, ["H"])


def _jacobian(rows: Any, z: Any) -> Any:
    """Derivatives of the rows; dense ones, those of integrals, apart: one sweep for many columns is lost where there is one such row."""
    counts = np.diff(ca.jacobian_sparsity(rows, z).T.colind())
    dense = np.flatnonzero(counts > DENSE * max(z.numel(), 1))
    if not len(dense) or len(dense) == len(counts):
        return jacobian(rows, z)
    sparse = np.setdiff1d(np.arange(len(counts)), dense)
    blocks = ca.vertcat(*(jacobian(rows[which.tolist()], z) for which in (sparse, dense)))
    return blocks[np.argsort(np.concatenate([sparse, dense])).tolist(), :]
