"""Residual of the first-order conditions of Pareto optimality at a feasible vector, the multipliers that minimise it, and its costates."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import cho_factor, cho_solve, lstsq
from scipy.optimize import nnls
from scipy.sparse import bmat, csc_matrix, csr_matrix, diags, hstack, identity, vstack
from scipy.sparse.linalg import SuperLU, splu

from problems.compiled import CompiledPhase, CompiledProblem, remembered

from ..base import NLP
from ..numerics.batched import Batched, expanded
from ..trajectories.costates import Costates, PhaseCostates
from .derivatives import gradients
from .program import nlp_scales

DEPENDENT = 1e-12
"""Weight of dependent variables, where a free one has 1: small enough to be nothing, large enough that all multipliers are determined."""
MOST_BEYOND = 50
"""Equations beyond those of the states for which these are eliminated: each takes a solve, and a column of a dense system."""
SMALL_MULTIPLIERS = 1e-6
"""What a multiplier of a state's limit or of a row counts as a residual of its own where the smallest ones are wanted: far less than any
that the residual asks for, far more than round-off."""


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Multipliers of a vector of an NLP, in the user's units: up to the residual of its `optimality`, the derivatives of the sum of
    objectives, rows and variables, each times its own, vanish."""

    of_objectives: np.ndarray  # (m,): Not negative; in the scales of the objectives they sum to 1
    of_rows: np.ndarray  # of_rows, of_bounds: (r,), (n,): Of the rows and of the variables' bounds, positive at upper limits
    of_bounds: np.ndarray


def optimality(nlp: NLP, z: np.ndarray, F_scales: np.ndarray | None = None) -> float:
    """The scaled residual of the conditions of Pareto optimality at z.

    With objectives in units of `F_scales`, variables in spans of their bounds (peaks in their scales) and rows in their scales, it is the
    smallest Euclidean norm over all multipliers of

    - the derivatives, with respect to the *free* variables, of sum_i mu_i F_i + sum_j lambda_j g_j - sum_k nu_k c_k, and
    - the products nu_k c_k,

    where mu >= 0 sums to 1, lambda belongs to equalities, nu >= 0 to inequalities and bounds with slacks c >= 0, and where the derivatives
    with respect to the other variables, the states, vanish: lambda is the adjoint that the dynamics give, and what is left is the gradient
    in the controls, times and parameters (Fritz John's conditions in the objectives; Karush, Kuhn and Tucker's in the constraints). At a
    local Pareto optimum that is regular it is 0. Elsewhere it is how fast all objectives can fall together, in their scales per span of the
    free variables. It does not include violations; and a point that is optimal in the weak sense only, one objective being at its least
    value while another could still fall, has 0 as well. z (n,), F_scales (m,).
    """
    conditions = Conditions.of(nlp, z, F_scales)
    return np.inf if conditions is None else conditions.residual


@dataclass(frozen=True, eq=False)
class Linearised:
    """First derivatives at a vector of an NLP, in units: variables in `units`, objectives and rows in their scales. z (n,)."""

    nlp: NLP
    z: np.ndarray
    scales: np.ndarray  # (m,): Of the objectives; infinite for those left out
    # of_objectives, of_equations, of_inequalities: (used, n), (equations, n), (k, n): Gradients of the objectives that are not left out,
    # of the equations, and of the inequalities c >= 0 that may have a multiplier.
    of_objectives: np.ndarray
    of_equations: csr_matrix
    of_inequalities: np.ndarray
    near: list[np.ndarray]  # masks of these inequalities: lower and upper bounds (n,), lower and upper limits of rows (r,)
    slack: np.ndarray  # (k,): Of the inequalities

    @classmethod
    def of(cls, nlp: NLP, z: np.ndarray, F_scales: np.ndarray | None = None) -> Linearised | None:
        """Those at z, see `optimality`; None where a derivative, in units, is no number."""
        found = gradients(nlp)(z)
        dF, dg, g = np.array(found[0]), csr_matrix(found[1].sparse()), np.array(found[3]).ravel()
        natural = nlp_scales(nlp)
        scales = natural if F_scales is None else np.where(np.asarray(F_scales) > 0, F_scales, natural)
        unit = units(nlp)
        unit[nlp.integers] = 0.0  # they have no derivatives
        dF = (dF * unit / scales[:, None])[np.isfinite(scales)]
        dg.data *= unit[dg.indices] / np.repeat(nlp.g_scale, np.diff(dg.indptr))
        if not (np.isfinite(dF).all() and np.isfinite(dg.data).all() and np.isfinite(g).all()):
            return None
        near, sides, slack = _inequalities(nlp, z, g, dg)
        return cls(nlp, z, scales, dF, dg[nlp.g_lower == nlp.g_upper], sides, near, slack)


@dataclass(frozen=True, eq=False)
class Conditions:
    """The conditions of Pareto optimality at a vector of an NLP, without the multipliers of its equations, which follow from the others."""

    linear: Linearised
    # reduced, adjoints: (d, k), (equations, k): Reduced gradients of the objectives and of the inequalities, and the multipliers of the
    # equations that belong to them.
    reduced: np.ndarray
    adjoints: np.ndarray

    @classmethod
    def of(cls, nlp: NLP, z: np.ndarray, F_scales: np.ndarray | None = None) -> Conditions | None:
        """Those at z, see `optimality`; None where they cannot be formed."""
        linear = Linearised.of(nlp, z, F_scales)
        if linear is None:
            return None
        try:
            reduced, adjoints = _reduced(nlp, linear.of_equations, np.vstack([linear.of_objectives, -linear.of_inequalities]))
        except RuntimeError:
            return None
        return cls(linear, reduced, adjoints) if np.isfinite(reduced).all() and np.isfinite(adjoints).all() else None

    def alone(self, sole: np.ndarray) -> Conditions:
        """The conditions for the objectives of a mask (m,) alone, without those already left out."""
        linear, mine = self.linear, sole[np.isfinite(self.linear.scales)]
        columns = np.concatenate([mine, np.ones(len(linear.slack), dtype=bool)])
        linear = replace(linear, scales=np.where(sole, linear.scales, np.inf), of_objectives=linear.of_objectives[mine])
        return Conditions(linear, self.reduced[:, columns], self.adjoints[:, columns])

    @cached_property
    def residual(self) -> float:
        try:
            return _least(self.reduced, self.linear.slack)[0]
        except (RuntimeError, np.linalg.LinAlgError):
            return np.inf

    def residual_of(self, mixtures: np.ndarray) -> float:
        """The least residual of weights that are mixtures of those in the columns (used, p), which are not negative and each of sum 1."""
        m = len(self.linear.of_objectives)
        try:
            return _least(np.hstack([self.reduced[:, :m] @ mixtures, self.reduced[:, m:]]), self.linear.slack)[0]
        except (RuntimeError, np.linalg.LinAlgError):
            return np.inf

    @cached_property
    def scaled(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Multipliers (used,) of objectives and (k,) of inequalities, in units, with the least residual; None if the solve fails.

        Where limits depend on each other they are not unique, and round-off would choose: the smallest are taken, and of limits of free
        variables rather than others, first the weights of the objectives, then the multipliers that belong to them.
        """
        m, slack, small = len(self.linear.of_objectives), self.linear.slack, SMALL_MULTIPLIERS * np.concatenate(self._others())
        try:
            # Where a front bends sharply, as that of a flight with hundreds of active limits does, weights would be off by a hundredth with
            # all of `small`; they are by the square of this part less.
            weights = _least(self.reduced, slack, 0.1 * small)[1][:m] if m > 1 else np.ones(m)
            weighted = np.column_stack([self.reduced[:, :m] @ weights, self.reduced[:, m:]])
            return weights, _least(weighted, slack, small)[1][1:]
        except (RuntimeError, np.linalg.LinAlgError):
            return None

    def multipliers(self) -> Multipliers | None:
        """The multipliers with the least residual, see `scaled`; None if the solve fails."""
        if self.scaled is None:
            return None
        nlp, used, n, r = self.linear.nlp, np.isfinite(self.linear.scales), len(self.linear.z), len(self.linear.nlp.g_scale)
        of_objectives, of_equations = np.zeros(len(used)), np.zeros(r)
        of_objectives[used], rest = self.scaled
        of_equations[nlp.g_lower == nlp.g_upper] = -self.adjoints @ np.concatenate(self.scaled)
        of_sides = np.zeros(2 * (n + r))
        of_sides[np.concatenate(self.linear.near)] = rest
        lower, upper, below, above = np.split(of_sides, [n, 2 * n, 2 * n + r])
        return Multipliers(of_objectives / self.linear.scales, (of_equations + above - below) / nlp.g_scale, (upper - lower) / units(nlp))

    def _others(self) -> list[np.ndarray]:
        """Masks, group by group, of the inequalities that are not bounds of free variables."""
        nlp = self.linear.nlp
        kept = np.setdiff1d(np.arange(len(nlp.variables)), nlp.free)
        return [np.isin(np.flatnonzero(one), kept) if k < 2 else one[one] for k, one in enumerate(self.linear.near)]


def units(nlp: NLP) -> np.ndarray:
    """The unit of each variable: the span of its bounds; the scale of a peak, which has none."""
    return np.where(np.isfinite(nlp.span), nlp.span, nlp.scale)


def _inequalities(nlp: NLP, z: np.ndarray, g: np.ndarray, dg: csr_matrix) -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
    """Masks of the lower and upper bounds (n,) and of the lower and upper limits of rows (r,) that may have a multiplier; scaled gradients
    (k, n) and slacks (k,) of these inequalities c >= 0, in that order."""
    bounded, one_way = (nlp.period == 0) & np.isfinite(nlp.span), nlp.g_lower < nlp.g_upper
    slacks = ((z - nlp.lower) / units(nlp), (nlp.upper - z) / units(nlp), (g - nlp.g_lower) / nlp.g_scale, (nlp.g_upper - g) / nlp.g_scale)
    # Those with more slack, in scales, are taken to have no multiplier.
    near = [(slack < 1e-2) & (bounded if k < 2 else one_way) for k, slack in enumerate(slacks)]
    own = identity(len(z), format="csr")
    sides = vstack([own[near[0]], -own[near[1]], dg[near[2]], -dg[near[3]]]).toarray()
    return near, sides, np.maximum(np.concatenate(slacks)[np.concatenate(near)], 0.0)


def _reduced(nlp: NLP, equations: csr_matrix, gradients: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Reduced gradients (d, k) of k functions with gradients (k, n), and the multipliers (equations, k) that leave them.

    Each is W s for the s that minimises s'Ws/2 - gradient's where equations s = 0; W is 1 for free variables and peaks, next to nothing for
    others: the total derivative where these follow from the free ones. Raises RuntimeError where the equations do not determine them.
    """
    measured = np.isinf(nlp.span)
    measured[nlp.free] = True
    found = _by_elimination(csc_matrix(equations[:, ~measured]), equations[:, measured], gradients[:, ~measured], gradients[:, measured])
    if found is not None:
        return found
    s, adjoints = steepest(diags(np.where(measured, 1.0, DEPENDENT)), equations, gradients)
    left = DEPENDENT * s[~measured]
    if not np.abs(left).max(initial=0.0) <= 1e-6 * np.abs(gradients).max(initial=0.0):
        raise RuntimeError("the equations do not determine the states")
    return s[measured], adjoints


def _by_elimination(
    by_states: csc_matrix, by_free: csr_matrix, of_states: np.ndarray, of_free: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """See `_reduced`, from the columns of equations and gradients that belong to states and to what is free; None where the equations do
    not determine the states, or where far more equations than states are left."""
    r, states = by_states.shape
    beyond = r - states
    if not 0 <= beyond <= MOST_BEYOND:
        return None
    # Columns that no structure has make the matrix square; with them, its transpose gives one solution and those of the equations beyond.
    square = hstack([by_states, csc_matrix(np.random.default_rng(0).standard_normal((r, beyond)))], "csc")
    try:
        factors = splu(square)
    except RuntimeError:
        return None
    right = np.vstack([of_states.T, np.zeros((beyond, len(of_states)))])
    adjoints = _solved(factors, square.T, right, "T")
    left = of_free.T - by_free.T @ adjoints
    if not np.isfinite(left).all():
        return None
    if beyond:
        others = _solved(factors, square.T, np.eye(r, beyond, -states), "T")
        taken = np.linalg.lstsq(by_free.T @ others, left, rcond=None)[0]
        adjoints += others @ taken
        left -= by_free.T @ (others @ taken)
    missed = np.abs(by_states.T @ adjoints - of_states.T).max(initial=0.0)
    # Of times and controls alone, objectives have no derivatives by the states.
    size = max(np.abs(of_states).max(initial=0.0), np.abs(of_free).max(initial=0.0))
    return (left, adjoints) if missed <= 1e-9 * size else None


def steepest(metric: Any, equations: Any, gradients: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The s (n, k) that minimise s'metric s/2 - gradient's where equations s = 0, for k gradients (k, n); and the multipliers (r, k) of the
    equations. metric (n, n), equations (r, n)."""
    r, n = equations.shape
    # Rows may be linearly dependent: refinement removes the effect of the regularisation.
    exact, regular = (bmat([[metric, equations.T], [equations, diags(np.full(r, -last))]], "csc") for last in (0.0, 1e-12))
    found = _solved(splu(regular), exact, np.vstack([gradients.T, np.zeros((r, len(gradients)))]))
    return found[:n], found[n:]


def _solved(factors: SuperLU, matrix: Any, right: np.ndarray, side: str = "N") -> np.ndarray:
    """The solution of matrix @ solution = right, by the factors of that matrix or one very near to it (side "T": of its transpose), and by
    three steps of iterative refinement at most."""
    solution = _each(factors, right, side)
    for _ in range(3):
        left = right - matrix @ solution
        if np.abs(left).max(initial=0.0) <= 1e-12 * np.abs(right).max(initial=0.0):
            break
        solution += _each(factors, left, side)
    return solution


def _each(factors: SuperLU, right: np.ndarray, side: str) -> np.ndarray:
    """The solution for each column by itself: for all at once, BLAS starts threads for every small block, which wait for each other."""
    solution = np.zeros_like(right)
    # Many are zero: the derivatives of bounds of controls by the states.
    for k in np.flatnonzero(right.any(axis=0)):
        solution[:, k] = factors.solve(right[:, k], side)
    return solution


def _least(A: np.ndarray, slack: np.ndarray, small: np.ndarray | float = 0.0) -> tuple[float, np.ndarray]:
    """The least norm of (A x, slack nu) over x = (mu, nu) >= 0 with sum mu = 1, and that x; with nu times `small` among the residuals, too.

    Without that last condition, but with (sum mu - 1) among the residuals, the answer is the same up to a factor: the residual of the
    direction of x only shrinks with its length, and the length that is best is a growing function of how small it is.
    """
    k, m = len(slack), A.shape[1] - len(slack)
    M = np.vstack([A, np.hstack([np.zeros((k, m)), np.diag(np.hypot(slack, small))])])
    full = np.vstack([M, np.r_[np.ones(m), np.zeros(k)]])
    right = np.r_[np.zeros(len(M)), 1.0]
    x, taken, lengths = np.zeros(full.shape[1]), np.r_[np.ones(m, dtype=bool), slack <= 1e-4], np.linalg.norm(full, axis=0)
    while True:
        # Of hundreds of limits that a flight is near few are active: others join where they would make the residual smaller.
        rows = full[:, taken].any(axis=1)
        x[taken] = _not_negative(full[np.ix_(rows, taken)], right[rows])
        left = right - full @ x
        missing = ~taken & (full.T @ left > 1e-3 * np.linalg.norm(left) * lengths)
        if not missing.any() or np.linalg.norm(left) <= 1e-10:
            break
        taken |= missing
    # These are solutions of normal equations, which lose half of the digits. Orthogonal factors lose none, and truncate nothing where
    # slacks are tiny, as singular values would.
    passive = x > 0
    polished, columns = np.zeros_like(x), full[:, passive]
    rows = columns.any(axis=1)
    polished[passive] = lstsq(columns[rows], right[rows], lapack_driver="gelsy", check_finite=False)[0]
    candidates = [x, np.maximum(polished, 0.0)]
    found = ((float(np.linalg.norm(M @ c) / c[:m].sum()), c / c[:m].sum()) for c in candidates if c[:m].sum() > 0)
    return min(found, key=lambda one: one[0])


def _not_negative(A: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The x >= 0 with the least norm of A x - right, of hundreds of columns by block principal pivoting from all of them, which takes some
    solves where most are active: Kim and Park, "Fast nonnegative matrix factorization", SIAM J. Sci. Comput. 33(6), 2011. Of few, and where
    that does not end, by `nnls`: of several solutions, it has one with few numbers that are not 0."""
    squares, products = A.T @ A, A.T @ right
    least = 1e-12 * np.linalg.norm(right) * np.sqrt(np.diag(squares))
    passive, fewest, tries = np.ones(len(products), dtype=bool), len(products) + 1, 3
    for _ in range(100 if len(products) > 300 else 0):
        x, own = np.zeros(len(products)), np.flatnonzero(passive)
        try:
            x[own] = cho_solve(cho_factor(squares[np.ix_(own, own)], check_finite=False), products[own], check_finite=False)
        except np.linalg.LinAlgError:
            break
        wrong = np.where(passive, x, squares @ x - products + least) < 0.0
        if not wrong.any():
            return x
        count = int(np.count_nonzero(wrong))
        fewest, tries = (count, 3) if count < fewest else (fewest, tries - 1)
        # Where exchanging all of them does not help, one by one does.
        passive ^= wrong if tries >= 0 else np.arange(len(wrong)) == np.flatnonzero(wrong)[-1]
    return np.asarray(nnls(A, right, maxiter=10 * A.shape[1])[0])


def ratio_bounds(conditions: Conditions, i: int, j: int, residual: float) -> tuple[float, float]:
    """Least and largest ratio of the weights of objectives j and i, in scales, that leave at most `residual`; nan without weights."""
    if conditions.scaled is None or conditions.scaled[0][[i, j]].max() <= 0.0:
        return np.nan, np.nan
    one, other = conditions.scaled[0][[i, j]]

    def largest(i: int, j: int, ratio: float) -> float:
        return _largest(lambda ratio: ratio_residual(conditions, i, j, ratio) <= residual, ratio)

    if one <= 0.0:
        return 1.0 / largest(j, i, 0.0), np.inf
    return 1.0 / largest(j, i, one / other) if other > 0.0 else 0.0, largest(i, j, other / one)


def ratio_residual(conditions: Conditions, i: int, j: int, ratio: float) -> float:
    """The least residual over weights with w_j / w_i equal to the ratio; infinity: w_i is 0."""
    mixed = np.eye(conditions.scaled[0].size if conditions.scaled else 0)
    share = 1.0 if np.isinf(ratio) else ratio / (1.0 + ratio)
    mixed[:, i] = (1.0 - share) * mixed[:, i] + share * mixed[:, j]
    return conditions.residual_of(np.delete(mixed, j, axis=1))


def _largest(good: Callable[[float], bool], ratio: float) -> float:
    """The largest acceptable ratio, from an acceptable one, by growing steps and then bisection; infinite if all larger ones are."""
    if good(np.inf):
        return float("inf")
    last, change = ratio, 1e-3
    for _ in range(12):
        ahead = last * (1.0 + change) if last > 0.0 else change
        if not good(ahead):
            break
        last, change = ahead, 4.0 * change
    low, high = last, ahead
    for _ in range(12):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if good(middle) else (low, middle)
    return low


def hamiltonian(
    phase: CompiledPhase, costates: np.ndarray, weights: np.ndarray, x: np.ndarray, u: np.ndarray, t: np.ndarray, s: np.ndarray
) -> np.ndarray:
    """H (k,) at k places, from costates and states (k, nx), weights of the integrals (nq,), controls (k, nu), times (k,) and s (ns,)."""
    rates, integrands = _rates(phase)(x, u, t, np.tile(s, (len(t), 1)))
    return np.asarray(np.einsum("ki,ki->k", costates, rates) + integrands @ weights)


@remembered
def _rates(phase: CompiledPhase) -> Batched:
    """(states, controls, time, s) -> rates and integrands."""
    inputs = phase.dynamics.mx_in()
    outputs = [ca.densify(function(*inputs)) for function in (phase.dynamics, phase.integrands)]
    return Batched(expanded(ca.Function("rates", inputs, outputs)))


def integral_weights(
    problem: CompiledProblem,
    quantities: Sequence[np.ndarray],
    parameters: np.ndarray,
    of_objectives: np.ndarray,
    of_constraints: np.ndarray,
) -> dict[str, np.ndarray]:
    """The weight of each integral (nq,) in the sum of objectives and constraints, each times its multiplier; by phase. quantities: a column
    q for each phase, as in `NLP.quantities`."""
    slopes = _slopes(problem).call([*quantities, parameters, of_objectives, of_constraints])
    found = {}
    for phase, slope in zip(problem.phases, slopes, strict=True):
        first = 2 + phase.initials.size1_out(0) + phase.finals.size1_out(0)
        found[phase.name] = np.array(slope).ravel()[first : first + phase.integrands.size1_out(0)]
    return found


@remembered
def _slopes(problem: CompiledProblem) -> ca.Function:
    """(q of each phase, parameters, multipliers of objectives and of constraints) -> gradient of their sum by each q."""
    inputs = problem.objectives.mx_in()
    of_objectives, of_constraints = ca.MX.sym("f", len(problem.goals)), ca.MX.sym("c", len(problem.limits))
    total = ca.dot(problem.objectives(*inputs), of_objectives) + ca.dot(problem.constraints(*inputs), of_constraints)
    outputs = [ca.densify(ca.gradient(total, q)) for q in inputs[:-1]]
    return ca.Function("slopes", [*inputs, of_objectives, of_constraints], outputs)


def costates(nlp: NLP, z: np.ndarray, found: Multipliers) -> Costates | None:
    """The costates of an optimal vector (n,), and the Hamiltonian, from its multipliers; None if they are not finite.

    They belong to the weighted sum of the objectives, all minimised, that the vector minimises: the weights are the multipliers of the
    objectives over their sum, so that they are of the objectives' own units. A costate is the derivative of that sum by the state, and H =
    costates' rates + weighted integrands, per unit of the phase's time.
    """
    z = np.asarray(z, dtype=float)
    problem, trajectory, total = nlp.problem, nlp.unpack(z), found.of_objectives.sum()
    of_objectives, of_rows, of_bounds = (one / total for one in (found.of_objectives, found.of_rows, found.of_bounds))
    parameters = np.array([trajectory.parameters[v.name] for v in problem.parameters])
    quantities = [np.array(q).ravel() for q in nlp.quantities.call([z])]
    of_constraints = of_rows[len(of_rows) - len(problem.limits) :]
    weights = integral_weights(problem, quantities, parameters, of_objectives, of_constraints)
    adjoints, phases = nlp.adjoint(z, of_rows, of_bounds, weights), {}
    for phase in problem.phases:
        name, flown, adjoint = phase.name, trajectory[phase.name], adjoints[phase.name]
        values = adjoint.costates(flown.time)
        s = np.array([flown.t0, flown.tf, *parameters])
        H = hamiltonian(phase, values, weights[name], flown.states, flown.controls, flown.time, s)
        if not (np.isfinite(values).all() and np.isfinite(H).all()):
            return None
        phases[name] = PhaseCostates(tuple(v.name for v in phase.states), values, H, adjoint.costates, adjoint.error)
    return Costates(of_objectives, phases)
