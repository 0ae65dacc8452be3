"""Programs for IPOPT: scaling, derivatives from those of the NLP, and early termination."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Mapping
from types import FrameType
from typing import Any

import casadi as ca
import numpy as np

from problems.compiled import remembered
from problems.externals import reraise
from problems.sampling import refuse_peaks

from ..base import INFEASIBLE, NLP, TIMEOUT
from ..stopping import check_stopping, stopping
from .derivatives import gradients, hessian, objective_gradients

UNASKED = {"calc_lam_p": False, "no_nlp_grad": True, "inputs_check": False}
"""Sensitivities to the parameters are not used. They would take longer to derive than some solves take, and where rates are no numbers they
fail, which CasADi prints; so does its check of what goes in, for each program that has more equations than variables."""
STATUS_OF_IPOPT = {
    "Infeasible_Problem_Detected": INFEASIBLE,
    "Maximum_CpuTime_Exceeded": TIMEOUT,
    "Maximum_WallTime_Exceeded": TIMEOUT,
    "User_Requested_Stop": TIMEOUT,
}
"""The status that a return status of IPOPT means, where it is not just a failure."""
Options = tuple[tuple[str, object], ...]
"""Options of IPOPT as pairs, which can be remembered by."""


class Watched:
    """A program for IPOPT, with the call of a `casadi.nlpsol`. Its return status is "User_Requested_Stop" if it was asked to end.

    IPOPT looks at its own limits of time between iterations, too: this ends a solve as soon as these could. A factorisation, and the search
    along one step, cannot be ended.
    """

    def __init__(self, name: str, parts: Any, options: Mapping[str, Any]) -> None:
        check_stopping()
        self._watch, self.iterations = _Watch(), 0  # of all calls so far
        self._solver = ca.nlpsol(name, "ipopt", parts, {**UNASKED, **options, "iteration_callback": self._watch})

    def __call__(self, **inputs: Any) -> dict[str, Any]:
        """The answer, by the names of CasADi. Raises KeyboardInterrupt after Ctrl-C, unless that is handled otherwise."""
        watch, usual = self._watch, signal.default_int_handler
        watch.begin()
        # CasADi would swallow the exception of the usual handler.
        heard = signal.getsignal(signal.SIGINT) is usual and threading.current_thread() is threading.main_thread()
        if heard:
            signal.signal(signal.SIGINT, watch.interrupt)
        try:
            answer = self._solver(**inputs)
        finally:
            if heard:
                signal.signal(signal.SIGINT, usual)
        if watch.raised is not None:
            raise watch.raised
        reraise()
        self.iterations += max(0, self._solver.stats()["iter_count"])
        return answer

    def stats(self) -> dict[str, Any]:
        """Statistics of the last solve, by the names of CasADi."""
        return self._solver.stats()


class _Watch(ca.Callback):
    """Callback of IPOPT after each iteration. It takes no data (its inputs are empty) and, through buffers, no time."""

    def __init__(self) -> None:
        ca.Callback.__init__(self)
        self.begin()
        self.construct("watch", {})

    def begin(self) -> None:
        """Begin a solve."""
        self._asked, self._end = time.monotonic(), False
        self.raised: BaseException | None = None

    def interrupt(self, number: int, frame: FrameType | None) -> None:
        """Handler of Ctrl-C."""
        self.raised = KeyboardInterrupt()

    def get_n_in(self) -> int:
        return ca.nlpsol_n_out()

    def get_n_out(self) -> int:
        return 1

    def get_sparsity_in(self, i: int) -> Any:
        return ca.Sparsity(0, 0)

    def has_eval_buffer(self) -> bool:
        return True

    def eval_buffer(self, inputs: Any, outputs: Any) -> int:
        """EndSlots the solve (1) or not (0)."""
        try:
            now = time.monotonic()
            if now - self._asked >= 0.25:  # s: most solves take less, and need not ask
                self._asked, self._end = now, stopping()
        except BaseException as error:  # CasADi would swallow it
            self.raised = error
        np.frombuffer(outputs[0])[0] = float(self._end or self.raised is not None)
        return 0


def ipopt_options(seconds: float, max_iterations: int) -> dict[str, Any]:
    """Options of a CasADi `nlpsol` with IPOPT that prints nothing, raises nothing and ends in time."""
    return {
        "print_time": False,
        "error_on_fail": False,
        "record_time": False,
        "show_eval_warnings": False,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        # MUMPS asks for so much more memory than it expects to need, each time; ten times more, its default, is an eighth of large solves.
        "ipopt.mumps_mem_percent": 100,
        "ipopt.max_iter": max_iterations,
        "ipopt.max_wall_time": seconds,
    }


def origin(nlp: NLP) -> np.ndarray:
    """The origin (n,) of y = (z - origin) / scale: the lower bounds, so that a narrow range far from zero keeps its digits."""
    return np.where(np.isfinite(nlp.lower), nlp.lower, 0.0)


def scaled_bounds(nlp: NLP, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of y, (n,) each. Periodic variables get one more period on either side, so that a bound never stops them; whole numbers keep
    the values of the start (n,)."""
    zero = origin(nlp)
    lower, upper = (nlp.lower - nlp.period - zero) / nlp.scale, (nlp.upper + nlp.period - zero) / nlp.scale
    lower[nlp.integers] = upper[nlp.integers] = ((start - zero) / nlp.scale)[nlp.integers]
    return lower, upper


def back_in_bounds(nlp: NLP, z: np.ndarray) -> np.ndarray:
    """A vector (n,) within its bounds, periodic variables wrapped, the others clipped, and with whole numbers where they are meant."""
    out = np.flatnonzero((nlp.period > 0) & ((z < nlp.lower) | (z > nlp.upper)))
    z = z.copy()
    z[out] = nlp.lower[out] + np.mod(z[out] - nlp.lower[out], nlp.period[out])
    return nlp.rounded(np.clip(z, nlp.lower, nlp.upper))


@remembered
def nlp_scales(nlp: NLP) -> np.ndarray:
    """Scales of objectives (m,) where no front is known: change by the scales of all variables, median over 31 places; else 1."""
    rng, count = np.random.default_rng(0), 31
    lower, upper = np.where(np.isfinite(nlp.lower), nlp.lower, 0.0), np.where(np.isfinite(nlp.upper), nlp.upper, nlp.scale)
    Z = lower + rng.random((count, len(lower))) * (upper - lower)
    slopes = np.array(objective_gradients(nlp)(Z.T)).reshape(-1, count, len(lower))
    sizes = np.median(np.nan_to_num(np.abs(slopes) @ nlp.scale, posinf=0.0), axis=1)
    # Slopes of an objective that changes by less than this part of its size are rounding errors.
    least = 1e-12 * np.median(np.nan_to_num(np.abs(nlp.evaluate(Z)[0]), posinf=0.0), axis=0)
    return np.where(sizes > least, sizes, 1.0)


@remembered
def _places(nlp: NLP) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the derivatives of g that may differ from 0."""
    i, j = gradients(nlp).sparsity_out(1).get_triplet()
    return np.array(i, dtype=int), np.array(j, dtype=int)


def equilibrated(nlp: NLP, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Scales of the variables (n,) and of the rows (r,) by which the largest derivative in each row and each column is near one at z.

    Ruiz, "A scaling algorithm to equilibrate both rows and columns norms in matrices", RAL-TR-2001-034. Bounds may be much wider than what
    a variable does: its scale may become less than its own, never more.
    """
    sizes = np.abs(np.array(gradients(nlp)(z)[1].nonzeros()))
    sizes[~np.isfinite(sizes)] = 0.0
    i, j = _places(nlp)
    columns, rows = nlp.scale.copy(), nlp.g_scale.copy()
    for _ in range(5):
        for scales, index, power in ((rows, i, 0.5), (columns, j, -0.5)):
            largest = np.zeros(len(scales))
            np.maximum.at(largest, index, sizes * columns[j] / rows[i])
            scales *= np.where(largest > 0, largest, 1.0) ** power
    return np.clip(columns, 1e-3 * nlp.scale, nlp.scale), np.clip(rows, 1e-3 * nlp.g_scale, 1e2 * nlp.g_scale)


def program_parameters(shift: np.ndarray, inverse: np.ndarray, slope: np.ndarray, variables: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """The parameters of `solver`: shift, 1 / scale and slope of the objectives (m,), and the scales of variables (n,) and of rows (r,)."""
    return np.concatenate([shift, inverse, slope, variables, 1.0 / rows])


@remembered
def solver(nlp: NLP, seconds: float, max_iterations: int, options: Options, summed: bool = False) -> Watched:
    """The solver of the program

        minimise a   subject to   (F(z) - shift) / scale <= slope a,   (F(z) - shift) / scale <= top,   rows and bounds,

    in x = (y, a) with z = origin + scales y. Its rows are those of the NLP in their scales, then the objectives moving, then at rest.
    `summed`: what moves is one row, the sum of slope (F(z) - shift) / scale <= a.
    """
    refuse_peaks(nlp.problem)
    n, m, r = len(nlp.variables), len(nlp.problem.goals), len(nlp.g_scale)
    x, p = ca.MX.sym("x", n + 1), ca.MX.sym("p", 3 * m + n + r)
    shift, inverse, slope, scales, rows = ca.vertsplit(p, np.cumsum([0, m, m, m, n, r]).tolist())
    z = origin(nlp) + x[:n] * scales
    F, g = nlp.functions(z)
    above = (F - shift) * inverse
    values = ca.vertcat(g * rows, ca.dot(slope, above) - x[n] if summed else above - x[n] * slope, above)
    dF, dg, _, _ = gradients(nlp)(z)
    check_stopping()
    of_rows, of_objectives = multiplied(dg, rows, scales), multiplied(dF, inverse, scales)
    moving_rows = [slope.T @ of_objectives, ca.MX(-1.0)] if summed else [of_objectives, -slope]
    jacobian = ca.blockcat([[of_rows, ca.MX(r, 1)], moving_rows, [of_objectives, ca.MX(m, 1)]])
    lam_g = ca.MX.sym("lam_g", values.numel())
    of_g, moving, resting = ca.vertsplit(lam_g, [0, r, values.numel() - m, values.numel()])
    moving = moving * slope if summed else moving
    # The program's own objective is linear.
    curvature = multiplied(hessian(nlp)(z, (moving + resting) * inverse, of_g * rows), scales, scales)
    derivatives = derivatives_of_program(x, p, (values, jacobian), lam_g, ca.diagcat(curvature, ca.MX(1, 1)))
    settings = ipopt_options(seconds, max_iterations) | {f"ipopt.{name}": value for name, value in options}
    return Watched("scalarized", {"x": x, "p": p, "f": x[n], "g": values}, settings | derivatives)


def derivatives_of_program(x: ca.MX, p: ca.MX, rows: tuple[ca.MX, ca.MX], lam_g: ca.MX, curvature: ca.MX) -> dict[str, ca.Function]:
    """The options of `nlpsol` that give it the rows with their Jacobian, and the upper triangle of the Hessian of a linear objective."""
    names = ["x", "p", "lam_f", "lam_g"]
    return {
        "jac_g": ca.Function("jac_g", [x, p], list(rows), names[:2], ["g", "jac_g_x"]),
        "hess_lag": ca.Function("hess_lag", [x, p, ca.MX.sym("lam_f"), lam_g], [curvature], names, ["triu_hess_gamma_x_x"]),
    }


def multiplied(matrix: ca.MX, rows: ca.MX, columns: ca.MX) -> ca.MX:
    """A sparse matrix with its rows and columns multiplied by these vectors."""
    sparsity = matrix.sparsity()
    i, j = sparsity.get_triplet()
    return ca.MX(sparsity, ca.vec(matrix.nz[:]) * ca.vec(rows[i]) * ca.vec(columns[j])) if i else matrix
