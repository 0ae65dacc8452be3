"""The least violation near a vector: every row of an NLP is relaxed by a gap, and the sum of the gaps is minimised.

    minimise sum |gap_i| weight_i   subject to   g_lower <= g(z) + gap <= g_upper,   bounds of the variables.

The relaxed program has an interior at every start, so that IPOPT takes some tens of iterations, even if nothing is feasible; see Nocedal
and Wright, "Numerical Optimization", 2nd edition, section 18.5. The sum of absolute values is 0 if a feasible point is near; else few rows
stay violated: those in conflict. Dynamics weigh more than the user's constraints, so that the result is a trajectory.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from problems.compiled import remembered
from problems.sampling import refuse_peaks

from ..base import CONVERGED, FAILED, INFEASIBLE, NLP
from ..phases.writer import DYNAMICS
from ..stopping import Stopped, check_stopping, stopping
from .derivatives import gradients, hessian
from .optimality import Multipliers
from .program import Watched, back_in_bounds, derivatives_of_program, ipopt_options, multiplied, origin, scaled_bounds
from .scalarized import SOLVE, Solved, ended, not_begun


def least_violation(nlp: NLP, start: np.ndarray, *, tolerance: float = 1e-6, max_iterations: int = 300, seconds: float = 600.0) -> Solved:
    """A vector near a start (n,) that is feasible, or violates least in sum: no smaller change of it violates less."""
    start = back_in_bounds(nlp, start)
    if stopping():
        return not_begun(nlp, start)
    if not np.isfinite(nlp.evaluate(start[None])[1][0]):
        # IPOPT would not begin either.
        return replace(not_begun(nlp, start), status=FAILED, clocked=False)
    try:
        run = _program(nlp, seconds, max_iterations)
    except Stopped:
        return not_begun(nlp, start)
    weights = _weights(nlp)
    gaps = weights * np.maximum(nlp.residuals(start[None])[1][0, len(start) :], 0.0)
    limits = nlp.g_lower * weights / nlp.g_scale, nlp.g_upper * weights / nlp.g_scale
    (lower, upper), none = scaled_bounds(nlp, start), np.zeros(2 * len(weights))
    answer = run(
        # Rows may give way by a hundredth of their scales more than they miss: that is inside.
        x0=np.concatenate([(start - origin(nlp)) / nlp.scale, gaps + 0.01, gaps + 0.01]),
        lbx=np.append(lower, none),
        ubx=np.append(upper, none + np.inf),
        lbg=limits[0],
        ubg=limits[1],
    )
    z = origin(nlp) + np.array(answer["x"]).ravel()[: len(start)] * nlp.scale
    solved, done = ended(nlp, run, z, start, max_iterations)
    if solved.violation <= tolerance:
        solved = replace(solved, status=CONVERGED, message="")
    elif done:
        solved = replace(solved, status=INFEASIBLE, message="the violation can get no smaller nearby")
    # Of the sum of what rows miss, in their weights.
    of_rows, none = np.array(answer["lam_g"]).ravel() * weights / nlp.g_scale, np.zeros(len(start))
    return replace(solved, multipliers=Multipliers(0.0 * solved.F, of_rows, none))


def opposing(nlp: NLP, z: np.ndarray) -> tuple[str, ...]:
    """Labels of satisfied constraints that conflict with the violated ones at a least violating vector (n,); the strongest first.

    Bounds are not among them, nor are the dynamics.
    """
    solved, found = least_violation(nlp, z), dict[str, float]()
    if solved.status != INFEASIBLE or solved.multipliers is None:
        return ()
    missed, strengths = nlp.violations(solved.z), np.abs(solved.multipliers.of_rows) * nlp.g_scale
    for label, strength in zip(nlp.g_labels, strengths.tolist(), strict=True):
        if not label.startswith(DYNAMICS) and missed[label] <= 1e-6:
            found[label] = found.get(label, 0.0) + strength
    # The multiplier of a constraint is how much less the others would miss in sum, were its limit moved by a scale.
    return tuple(sorted((label for label in found if found[label] > 0.01), key=lambda label: -found[label]))


def _weights(nlp: NLP) -> np.ndarray:
    """Weights of the rows (r,) in their scales; equations of the dynamics weigh a hundred times as much as others."""
    return np.array([100.0 if label.startswith(DYNAMICS) else 1.0 for label in nlp.g_labels])


@remembered
def _program(nlp: NLP, seconds: float, max_iterations: int) -> Watched:
    """The program in x = (y, up, down), with z = origin + scale y, and the gaps up - down in weighted scales of their rows."""
    refuse_peaks(nlp.problem)
    n, r = len(nlp.variables), len(nlp.g_scale)
    x, rows = ca.MX.sym("x", n + 2 * r), ca.MX(ca.DM(_weights(nlp) / nlp.g_scale))
    y, up, down = ca.vertsplit(x, [0, n, n + r, n + 2 * r])
    z, scale = origin(nlp) + y * nlp.scale, ca.MX(ca.DM(nlp.scale))
    _, g = nlp.functions(z)
    values = g * rows - up + down
    check_stopping()
    jacobian = ca.horzcat(multiplied(gradients(nlp)(z)[1], rows, scale), -ca.MX.eye(r), ca.MX.eye(r))
    lam_g = ca.MX.sym("lam_g", r)
    curvature = multiplied(hessian(nlp)(z, ca.MX(len(nlp.problem.goals), 1), lam_g * rows), scale, scale)
    derivatives = derivatives_of_program(x, ca.MX(0, 1), (values, jacobian), lam_g, ca.diagcat(curvature, ca.MX(2 * r, 2 * r)))
    options = ipopt_options(seconds, max_iterations)
    options |= {"ipopt.tol": SOLVE.accuracy, "ipopt.nlp_scaling_method": "none", "ipopt.bound_relax_factor": 0.0, "ipopt.mu_init": 0.1}
    return Watched("elastic", {"x": x, "f": ca.sum1(up) + ca.sum1(down), "g": values}, options | derivatives)
