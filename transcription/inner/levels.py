"""The inner levels by name: IPOPT, the default, which tries Newton's method first, propagation alone, and none."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import casadi as ca
import numpy as np

from problems.checks import check_choice, check_count, check_positive
from problems.compiled import remembered

from ..base import CONVERGED, FAILED, INFEASIBLE, NLP, TIMEOUT
from ..nlp.derivatives import refuse_dense
from ..nlp.program import STATUS_OF_IPOPT, Watched, back_in_bounds, ipopt_options, origin, scaled_bounds
from ..numerics.batched import expanded
from ..stopping import Stopped, stopping
from .base import InnerResult, InnerSolver, evaluation_work, propagation_work, scored, started
from .newton import Newton

PROJECTION_ITERATIONS = 150
"""Most iterations of a projection, and of each further try, for what Newton's method leaves: most that succeed take some tens, and those
that fail take all."""


@dataclass(frozen=True)
class Ipopt(InnerSolver):
    """A nonlinear program for each candidate."""

    # Least squares distance of the free variables from the candidate, in spans of their bounds; or nothing, as in the paper, which lets
    # the barrier drag the candidate towards the middle of its bounds.
    objective: str = "projection"
    max_iterations: int = 300  # limit of each solve
    # Safety net for each solve. What it stops has the status "timeout", unless it is feasible all the same, and is not reproducible.
    seconds: float = 60.0

    def __post_init__(self) -> None:
        check_choice("Ipopt: objective", self.objective, ("projection", "constant"))
        check_count("Ipopt: max_iterations", self.max_iterations, 1)
        check_positive("Ipopt: seconds", self.seconds)

    def solve(self, nlp: NLP, candidates: np.ndarray, warm: np.ndarray | None = None, *, tolerance: float = 1e-6) -> InnerResult:
        """See `InnerSolver.solve`.

        A projection that does not converge is tried once more from propagated states. What stays infeasible comes back as it would be
        propagated, so that its violation is that of the user's constraints, not one smeared over the dynamics. If the work is to end early
        (`stopping`), what is left of the batch is not solved any further, and has the status "timeout".
        """
        start = nlp.tighten(started(nlp, candidates, warm))
        Z, status, iterations = self._solve_all(nlp, start, start, tolerance)
        _, violation = nlp.evaluate(Z)
        again = np.flatnonzero(~(violation <= tolerance) & (status != TIMEOUT))
        if len(again) and self.objective == "projection":
            Z[again], status[again], more = self._solve_all(nlp, start[again], nlp.propagate(start[again]), tolerance)
            iterations[again] += more
            _, violation = nlp.evaluate(Z)
        left = np.flatnonzero(~(violation <= tolerance))
        if len(left):
            propagated = nlp.propagate(Z[left])
            usable = np.isfinite(nlp.evaluate(propagated)[1])
            Z[left[usable]] = propagated[usable]
        return scored(nlp, (Z, *nlp.residuals(Z)), start, status, iterations, tolerance)

    def _solve_all(self, nlp: NLP, start: np.ndarray, guess: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """One solve a row: projects onto the free variables of `start`, beginning at `guess`."""
        Z, status, iterations = start.copy(), np.full(len(start), FAILED, dtype="<U10"), np.zeros(len(start), dtype=int)
        try:
            solver = _program(nlp, self, tolerance)
        except Stopped:
            return Z, np.full(len(start), TIMEOUT, dtype="<U10"), iterations
        scale, zero = nlp.scale, origin(nlp)
        _, violation = nlp.evaluate(guess)
        for row in range(len(start)):
            if not np.isfinite(guess[row]).all():
                continue
            if violation[row] <= tolerance and self.objective == "projection":
                Z[row] = guess[row]
                continue
            if stopping():
                status[row] = TIMEOUT
                continue
            lower, upper = scaled_bounds(nlp, start[row])
            y0 = np.clip((guess[row] - zero) / scale, lower, upper)
            answer = solver(
                x0=y0, p=start[row, nlp.free], lbx=lower, ubx=upper, lbg=nlp.g_lower / nlp.g_scale, ubg=nlp.g_upper / nlp.g_scale
            )
            stats = solver.stats()
            Z[row] = back_in_bounds(nlp, zero + np.array(answer["x"]).ravel() * scale)
            status[row] = STATUS_OF_IPOPT.get(stats["return_status"], FAILED)
            iterations[row] = stats["iter_count"]
        return nlp.tighten(Z), status, iterations


@remembered
def _program(nlp: NLP, settings: Ipopt, tolerance: float) -> Watched:
    """The nonlinear program in scaled variables y = (z - origin) / scale, with the candidate as its parameter."""
    refuse_dense(nlp)
    y, candidate = ca.MX.sym("y", len(nlp.variables)), ca.MX.sym("candidate", len(nlp.free))
    z = origin(nlp) + y * nlp.scale
    _, g = nlp.functions(z)
    projection = settings.objective == "projection"
    f = ca.sumsqr((ca.vec(z[nlp.free.tolist()]) - candidate) / nlp.span[nlp.free]) if projection else ca.MX(1)
    parts = expanded(ca.Function("program", [y, candidate], [f, g / nlp.g_scale], ["x", "p"], ["f", "g"]))
    options = ipopt_options(settings.seconds, settings.max_iterations)
    options |= {"ipopt.tol": 0.1 * tolerance, "ipopt.constr_viol_tol": 0.1 * tolerance}
    if projection:
        # The candidate is nearly feasible and often on its bounds: a small barrier and a small push keep IPOPT near it.
        options |= {
            "ipopt.mu_init": 1e-8,
            "ipopt.warm_start_init_point": "yes",
            "ipopt.bound_push": 1e-8,
            "ipopt.bound_frac": 1e-8,
            "ipopt.bound_relax_factor": 0.0,
            "ipopt.nlp_scaling_method": "none",
            # The objective is the distance from the candidate: without this, objectives of the problem would be off by 1e-4 of their
            # ranges where the constraints are met already.
            "ipopt.tol": min(1e-10, 0.1 * tolerance),
            "ipopt.acceptable_tol": 0.1 * tolerance,
            "ipopt.acceptable_iter": 5,
        }
    return Watched("inner", parts, options)


@dataclass(frozen=True)
class Projection(InnerSolver):
    """Newton's method over propagated states, and a projection by IPOPT of what it leaves infeasible."""

    def solve(self, nlp: NLP, candidates: np.ndarray, warm: np.ndarray | None = None, *, tolerance: float = 1e-6) -> InnerResult:
        found = Newton().solve(nlp, candidates, warm, tolerance=tolerance)
        rest = np.flatnonzero(found.status != CONVERGED)
        if not len(rest) or found.clocked:
            return found
        start = started(nlp, candidates, warm)
        repaired = Ipopt(max_iterations=PROJECTION_ITERATIONS).solve(nlp, candidates[rest], start[rest], tolerance=tolerance)
        for name in ("z", "F", "violation", "status", "moved", "residuals"):
            getattr(found, name)[rest] = getattr(repaired, name)
        found.iterations[rest] += repaired.iterations
        return replace(found, clocked=repaired.clocked, fallbacks=len(rest), work=(found.work or 0.0) + int(repaired.iterations.sum()))


@dataclass(frozen=True)
class Auto(Projection):
    """The same for those who do not choose. MACS divides its effort among propagation, some steps of Newton's method, of which most of what
    it makes feasible takes no more, and a projection by IPOPT, by what each has brought for its work, see `macs.search.trials`."""

    @property
    def ways(self) -> tuple[InnerSolver, ...]:
        return Propagate(), Newton(max_iterations=25, exact=1), Ipopt(max_iterations=PROJECTION_ITERATIONS)


@dataclass(frozen=True)
class Propagate(InnerSolver):
    """Propagates the states from the free variables and changes nothing else; what constraints are left show in the violation."""

    moves: ClassVar[bool] = False

    def solve(self, nlp: NLP, candidates: np.ndarray, warm: np.ndarray | None = None, *, tolerance: float = 1e-6) -> InnerResult:
        start = started(nlp, candidates, warm)
        k = len(start)
        found = scored(nlp, nlp.propagate_and_score(start), start, np.full(k, INFEASIBLE), np.ones(k, dtype=int), tolerance)
        return replace(found, work=k * propagation_work(nlp))


@dataclass(frozen=True)
class Whole(InnerSolver):
    """No inner level: a candidate is the whole vector of the NLP, states and all, and is scored as it is. The dynamics are constraints like
    others, which the search itself has to satisfy, as population searches on collocation do in the literature."""

    moves: ClassVar[bool] = False

    def program(self, nlp: NLP) -> NLP:
        return nlp.whole

    def solve(self, nlp: NLP, candidates: np.ndarray, warm: np.ndarray | None = None, *, tolerance: float = 1e-6) -> InnerResult:
        start = nlp.tighten(started(nlp, candidates, warm))
        k = len(start)
        found = scored(nlp, (start, *nlp.residuals(start)), start, np.full(k, INFEASIBLE), np.ones(k, dtype=int), tolerance)
        return replace(found, work=k * evaluation_work(nlp))


NAMED: dict[str, InnerSolver] = {
    "auto": Auto(),
    "projection": Projection(),
    "propagate": Propagate(),
    "none": Whole(),
    "ipopt": Ipopt(),
    "ipopt-feasibility": Ipopt(objective="constant"),
}
"""Those of the literature are among them: "ipopt-feasibility" of MACS's paper, "none" of population searches on collocation."""


def inner_solver(inner: str | InnerSolver) -> InnerSolver:
    """An inner solver by name, or as it is given. Raises ValueError for an unknown name."""
    if isinstance(inner, InnerSolver):
        return inner
    if not isinstance(inner, str) or inner not in NAMED:
        raise ValueError(f"unknown inner level {inner!r}; there are {', '.join(NAMED)}")
    return NAMED[inner]
