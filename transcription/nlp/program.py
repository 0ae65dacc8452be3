"""The program of a scalarisation for IPOPT, with its derivatives, made from those of the NLP."""

from __future__ import annotations

import casadi as ca
import numpy as np

from problems.compiled import remembered
from problems.sampling import refuse_peaks

from ..base import NLP
from ..stopping import check_stopping
from .derivatives import gradients, hessian
from .scaling import ipopt_options, origin
from .watched import Watched

Options = tuple[tuple[str, object], ...]
"""Options of IPOPT as pairs, which can be remembered by."""


def program_parameters(shift: np.ndarray, inverse: np.ndarray, slope: np.ndarray, variables: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """The parameters of `solver`: shift, 1 / scale and slope of the objectives (m,), and the scales of variables (n,) and of rows (r,)."""
    return np.concatenate([shift, inverse, slope, variables, 1.0 / rows])


@remembered
def solver(nlp: NLP, seconds: float, max_iterations: int, options: Options) -> Watched:
    """The solver of the program

        minimise a   subject to   (F(z) - shift) / scale <= slope a,   (F(z) - shift) / scale <= top,   rows and bounds,

    in x = (y, a) with z = origin + scales y. Its rows are those of the NLP in their scales, then the objectives moving, then at rest.
    """
    refuse_peaks(nlp.problem)
    n, m, r = len(nlp.variables), len(nlp.problem.goals), len(nlp.g_scale)
    x, p = ca.MX.sym("x", n + 1), ca.MX.sym("p", 3 * m + n + r)
    shift, inverse, slope, scales, rows = ca.vertsplit(p, np.cumsum([0, m, m, m, n, r]).tolist())
    z = origin(nlp) + x[:n] * scales
    F, g = nlp.functions(z)
    above = (F - shift) * inverse
    values = ca.vertcat(g * rows, above - x[n] * slope, above)
    dF, dg, _, _ = gradients(nlp)(z)
    check_stopping()
    of_rows, of_objectives = multiplied(dg, rows, scales), multiplied(dF, inverse, scales)
    jacobian = ca.blockcat([[of_rows, ca.MX(r, 1)], [of_objectives, -slope], [of_objectives, ca.MX(m, 1)]])
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", r + 2 * m)
    of_g, moving, resting = ca.vertsplit(lam_g, [0, r, r + m, r + 2 * m])
    # The program's own objective is linear.
    curvature = multiplied(hessian(nlp)(z, (moving + resting) * inverse, of_g * rows), scales, scales)
    curvature = ca.diagcat(curvature, ca.MX(1, 1))
    derivatives = {
        "jac_g": ca.Function("jac_g", [x, p], [values, jacobian], ["x", "p"], ["g", "jac_g_x"]),
        "hess_lag": ca.Function("hess_lag", [x, p, lam_f, lam_g], [curvature], ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"]),
    }
    settings = ipopt_options(seconds, max_iterations) | {f"ipopt.{name}": value for name, value in options}
    return Watched("scalarized", {"x": x, "p": p, "f": x[n], "g": values}, settings | derivatives)


def multiplied(matrix: ca.MX, rows: ca.MX, columns: ca.MX) -> ca.MX:
    """A sparse matrix with its rows and columns multiplied by these vectors."""
    sparsity = matrix.sparsity()
    i, j = sparsity.get_triplet()
    return ca.MX(sparsity, ca.vec(matrix.nz[:]) * ca.vec(rows[i]) * ca.vec(columns[j])) if i else matrix
