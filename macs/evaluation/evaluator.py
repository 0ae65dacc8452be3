"""Contract of an evaluator: it evaluates candidates for a search, and counts evaluations and gradient solves.

A search works with full vectors of D entries, and changes only d of them, the *free* ones. The others belong to the evaluator: for a
trajectory, the states from which the next inner solve starts. A black box has no others.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from scipy.spatial.distance import cdist

from problems.checks import short_repr
from problems.compiled import Objective, Variable
from transcription.base import CONVERGED, FAILED, INFEASIBLE, TIMEOUT

from ..io.interrupts import PURPOSE
from ..io.text import counted

__all__ = ["CONVERGED", "FAILED", "INFEASIBLE", "TIMEOUT", "Counts", "Evaluation", "Evaluator"]


Kinds = tuple[np.ndarray, np.ndarray] | tuple[None, None]


def masks(variables: Sequence[Variable]) -> Kinds:
    """Which variables (d,) are whole numbers, and which of these are numbers of choices; None and None if all are real."""
    whole = np.array([v.integer for v in variables], dtype=bool)
    return (whole, np.array([bool(v.choices) for v in variables])) if whole.any() else (None, None)


@dataclass(frozen=True)
class UnitBox:
    """Bounds of the free variables, and the arithmetic of points and steps inside them.

    Points are rows X in unit coordinates: 0 at the lower bound, 1 at the upper one. So distances are in spans, whatever the units of the
    variables.
    """

    lower: np.ndarray  # lower, upper: (d,): Bounds in the user's units
    upper: np.ndarray
    # (d,): True for a periodic variable: its bounds are one period wide, and a point that leaves through one re-enters through the other.
    wraps: np.ndarray
    whole: np.ndarray | None = None  # (d,): True for whole numbers, and for numbers of choices; None: all are real
    unordered: np.ndarray | None = None  # (d,): True for those of choices

    @property
    def designs(self) -> float:
        """Number of different points; infinite unless all variables are whole numbers."""
        return float(np.prod(self.span + 1.0)) if self.whole is not None and self.whole.all() else np.inf

    @property
    def span(self) -> np.ndarray:
        """Sides of the box, (d,), in the user's units."""
        return self.upper - self.lower

    def to_unit(self, values: np.ndarray) -> np.ndarray:
        """Unit coordinates (..., d) of values in the user's units; values outside the bounds are put back."""
        return self.put_back((values - self.lower) / self.span)

    def to_values(self, X: np.ndarray) -> np.ndarray:
        """Values (..., d) in the user's units, inside the bounds to the last bit."""
        return self.rounded(np.clip(self.lower + X * self.span, self.lower, self.upper))

    def rounded(self, values: np.ndarray) -> np.ndarray:
        """The values (..., d) with whole numbers where they are meant."""
        return values if self.whole is None else np.where(self.whole, values.round(), values)

    def confine(self, values: np.ndarray) -> np.ndarray:
        """The values (..., d), in the user's units, with those outside the bounds put back; the others are unchanged to the last bit."""
        outside = (values < self.lower) | (values > self.upper)
        return self.rounded(np.where(outside, self.to_values(self.to_unit(values)), values))

    def settle(self, X: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """The points X (k, d) with whole numbers where they are meant, drawn from the two beside each, the nearer the likelier, so that
        short steps lead somewhere. A choice has no neighbours: between two, it is drawn from all."""
        if self.whole is None:
            return X
        place = np.where(self.whole, X * self.span, 0.0)
        near = np.abs(place - place.round()) < 1e-6  # exact but for rounding
        drawn = np.where(near, place.round(), np.floor(place) + (rng.random(X.shape) < place - np.floor(place)))
        free = np.floor(rng.random(X.shape) * (self.span + 1.0))
        moved = self.unordered & (np.abs(place - place.round()) > 0.05)
        return np.where(self.whole, np.where(moved, free, drawn) / self.span, X)

    def neighbours(self, X: np.ndarray, reach: int, rng: np.random.Generator) -> np.ndarray:
        """Points near X (k, d), each of which differs in one or a few whole numbers, each by at most `reach`, or in choices."""
        assert self.whole is not None and self.unordered is not None
        moving = self.whole & (rng.random(X.shape) < 1.0 / np.count_nonzero(self.whole))
        moving[np.arange(len(X)), rng.choice(np.flatnonzero(self.whole), len(X))] = True
        step = rng.integers(1, reach + 1, X.shape) * rng.choice([-1.0, 1.0], X.shape)
        place = np.where(self.unordered, np.floor(rng.random(X.shape) * (self.span + 1.0)), np.clip(X * self.span + step, 0.0, self.span))
        return np.where(moving, place / self.span, X)

    def put_back(self, X: np.ndarray) -> np.ndarray:
        """The points X (..., d), wrapped where periodic and clipped elsewhere."""
        inside = np.clip(X, 0.0, 1.0)
        return np.where(self.wraps, X - np.floor(X), inside) if self.wraps.any() else inside

    def difference(self, X: np.ndarray, origin: np.ndarray) -> np.ndarray:
        """The step (..., d) from `origin` to X; periodic variables take the shorter way."""
        step = X - origin
        return np.where(self.wraps, step - np.round(step), step) if self.wraps.any() else step

    def squared_distances(self, X: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Squared distances (k, n) of X (k, d) to `others` (n, d), the shorter way in periodic variables; 0 between equal points."""
        even = ~self.wraps
        squares = cdist(X[:, even], others[:, even], "sqeuclidean") if even.any() else np.zeros((len(X), len(others)))
        if self.wraps.any():
            step = X[:, None, self.wraps] - others[:, self.wraps]
            step -= np.round(step)
            squares += np.einsum("knd,knd->kn", step, step)
        return squares

    def stop_outward(self, X: np.ndarray, step: np.ndarray) -> np.ndarray:
        """The step (..., d) without the components that lead from a bound out of the box."""
        outward = ((X <= 0.0) & (step < 0.0)) | ((X >= 1.0) & (step > 0.0))
        return np.where(outward & ~self.wraps, 0.0, step)

    def reach(self, X: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Largest fraction (...,), at most 1, of the step (..., d) that stays in the box; periodic variables do not limit it."""
        bound = np.where(step > 0.0, 1.0 - X, X)
        size = np.abs(step)
        limited = (size > 0.0) & ~self.wraps
        fraction = np.divide(bound, size, out=np.ones_like(size), where=limited)
        return np.clip(fraction.min(axis=-1, initial=1.0), 0.0, 1.0)

    def sample(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Latin hypercube of `count` points, (count, d) (McKay, Beckman and Conover 1979)."""
        strata = rng.permuted(np.tile(np.arange(count), (len(self.lower), 1)), axis=1).T
        return self.evenly((strata + rng.random(strata.shape)) / count)

    def evenly(self, X: np.ndarray) -> np.ndarray:
        """Points X (k, d) of [0, 1) with whole numbers where they are meant, all of them equally likely."""
        return X if self.whole is None else np.where(self.whole, np.floor(X * (self.span + 1.0)) / self.span, X)


@dataclass(frozen=True, repr=False)
class Evaluation:
    """Batch of k evaluated points.

    Attributes
    ----------
    Z : array (k, D)
        Full vectors, in the user's units, after the evaluation: for trajectories, the nearest feasible points that were found.
    F : array (k, m)
        Objectives, all minimised. NaN in a row whose evaluation failed.
    violation : array (k,)
        Largest scaled residual of any constraint; 0 without constraints, infinite if the evaluation failed.
    status : array (k,) of str
        "converged" (feasible within the tolerance), "infeasible", "failed" or "timeout".
    clocked : bool
        Whether a time limit ended any of the work: then the same vectors may give other results next time.
    fallbacks : int
        Number of vectors that the fast inner level passed to the slow one.
    work, charge : int
        What the evaluation took; see `Counts`.
    itemise : callable, optional
        Function that returns `violations`; called only when they are needed.
    residuals : array (k, c), optional
        Scaled residual of each constraint, positive above an upper limit, negative below a lower one, 0 within both; of what can be
        evaluated anywhere, without an inner level.

    Examples
    --------
    >>> import numpy as np
    >>> from macs import Evaluation
    >>> one = Evaluation(Z=np.zeros((1, 2)), F=np.ones((1, 2)), violation=np.zeros(1), status=np.array(["converged"]))
    >>> one.F.shape
    (1, 2)
    """

    Z: np.ndarray
    F: np.ndarray
    violation: np.ndarray
    status: np.ndarray
    clocked: bool = False
    fallbacks: int = 0
    work: int = 0
    charge: int = 0
    itemise: Callable[[], np.ndarray] | None = field(default=None, repr=False, compare=False)
    residuals: np.ndarray | None = field(default=None, repr=False, compare=False)

    @property
    def violations(self) -> np.ndarray:
        """Largest scaled residual of each constraint (k, c), at least 0; a single column (k, 1) if only the largest of all is known."""
        if self.residuals is not None:
            return np.abs(self.residuals)
        return self.violation[:, None] if self.itemise is None else self.itemise()

    def joined(self, other: Evaluation) -> Evaluation:
        """These points and others; of violations only the largest is known."""
        return Evaluation(
            np.concatenate([self.Z, other.Z]),
            np.concatenate([self.F, other.F]),
            np.concatenate([self.violation, other.violation]),
            np.concatenate([self.status, other.status]),
        )

    def take(self, rows: np.ndarray | slice) -> Evaluation:
        """Some of the points; of violations only the largest is known."""
        return Evaluation(self.Z[rows], self.F[rows], self.violation[rows], self.status[rows])

    def __repr__(self) -> str:
        by_status = ", ".join(f"{number} {status}" for status, number in Counter(self.status.tolist()).items())
        return f"<Evaluation: {counted(len(self.F), 'point')}{by_status and f'; {by_status}'}>"


@dataclass
class Counts:
    """Costs of a run so far."""

    evaluations: int = 0
    inner_iterations: int = 0
    fallbacks: int = 0  # number of candidates that the fast inner level passed to the slow one
    failures: Counter[str] = field(default_factory=Counter)  # number of evaluations and gradient solves that did not converge, by status
    clocked: int = 0  # number of batches and solves that a time limit ended early
    # Iterations of IPOPT times variables of its program, or what takes about as long: the same on all machines, and comparable for
    # programs of all sizes. Plain functions take none.
    work: int = 0
    # Nanoseconds of one processor that all of it takes, by counts and `PRICES`: the same on all machines.
    charge: int = 0
    solved: int = 0  # gradient solves that converged, each by itself or all of a batch, and their iterations
    solved_iterations: int = 0
    # By what they were for, see `spending`: gradient solves, their iterations, and those that gave a new point or a better one.
    solves_for: Counter[str] = field(default_factory=Counter)
    iterations_for: Counter[str] = field(default_factory=Counter)
    kept_for: Counter[str] = field(default_factory=Counter)
    from_cache: int = 0  # evaluations whose values a cache of rows had
    first_failure: str = ""  # of an evaluation of a vector problem: the error, and the design

    __repr__ = short_repr

    @property
    def gradient_solves(self) -> int:
        """Number of gradient solves."""
        return sum(self.solves_for.values())

    def add_solves(self, count: int, status: Sequence[str], iterations: int, clocked: int, variables: int, charge: int = 0) -> None:
        """Count gradient solves with their statuses, iterations and charge, of programs with so many variables; `clocked` of them were
        ended early by a time limit."""
        self.solves_for += Counter({PURPOSE.get(): count})
        self.iterations_for += Counter({PURPOSE.get(): iterations})
        self.failures.update(one for one in status if one != CONVERGED)
        self.inner_iterations += iterations
        self.clocked += clocked
        self.work += iterations * variables
        self.charge += charge
        if all(one == CONVERGED for one in status):
            self.solved += count
            self.solved_iterations += iterations

    def keep(self, results: Any) -> None:
        """Count gradient solves that gave a new point or a better one: a number or a mask."""
        self.kept_for += Counter({PURPOSE.get(): int(np.sum(results))})

    def joined(self, other: Counts) -> Counts:
        """The sums of these and other costs."""
        sums = {one.name: getattr(self, one.name) + getattr(other, one.name) for one in fields(self)}
        return Counts(**(sums | {"first_failure": self.first_failure or other.first_failure}))


class Evaluator(ABC):
    """Problem whose points can be evaluated.

    An implementation sets the attributes below and defines `first_guess` and `_evaluate`; with gradients, also `_descend`. Counting is done
    here.

    Attributes
    ----------
    free : array (d,) of int
        Indices, in the full vector, of the variables that a search may change.
    lower, upper : arrays (d,)
        Finite bounds of the free variables, in the user's units; `lower < upper`.
    period : array (d,)
        Period of a periodic free variable, whose bounds are one period wide; 0 for other variables.
    kinds : pair of arrays (d,) of bool
        See `masks`.
    tolerance : float
        A point whose violation is at most this is feasible.
    has_gradients : bool
        Whether `descend` works.
    moves : bool
        Whether candidates that are not feasible are moved to points nearby. If not, what is found for them says how they violate the
        constraints.
    ways : tuple of str
        Names of the inner solvers between which a search may choose for each batch; none where there is no choice.
    m_known : int or None
        Number of objectives; None if it is not known before the first evaluation.
    counts : Counts
    before_batch : callable
        Function without arguments that is called before each batch; it ends the search by raising an exception.

    Examples
    --------
    >>> from macs import MACS, Evaluator
    >>> from macs.evaluation.blackbox import BlackBox
    >>> issubclass(BlackBox, Evaluator)
    True
    """

    free: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    period: np.ndarray
    kinds: Kinds = (None, None)
    tolerance: float
    has_gradients: bool = False
    moves: bool = False
    ways: tuple[str, ...] = ()
    m_known: int | None = None
    counts: Counts
    before_batch: Callable[[], Any] = staticmethod(lambda: None)

    @property
    def box(self) -> UnitBox:
        """Box of the free variables."""
        return UnitBox(self.lower, self.upper, self.period > 0.0, *self.kinds)

    @property
    def over(self) -> str:
        """Why a search ends: "done" where there is no other point to evaluate, "failed" where a hundred evaluations did; else empty."""
        return ""

    def knows(self, Z: np.ndarray) -> np.ndarray:
        """Which full vectors (k, D) were evaluated already, and are not evaluated again: (k,)."""
        return np.zeros(len(Z), dtype=bool)

    def room(self, Z: np.ndarray, left: int) -> int:
        """How many of the first full vectors (k, D) take no more than `left` evaluations."""
        return min(left, len(Z))

    @property
    def memory(self) -> np.ndarray:
        """What is known of evaluated points that are not evaluated again, a row for each: for `resume`."""
        return np.empty((0, 0))

    @property
    def sizes(self) -> dict[str, int]:
        """Dimensions that are known: "d" free variables, "m" objectives; implementations add "D" entries of a full vector."""
        return {"d": len(self.free)} | ({} if self.m_known is None else {"m": self.m_known})

    @property
    def goals(self) -> tuple[Objective, ...]:
        """The m objectives, in the user's units and senses; needed by searches with a preference only."""
        raise NotImplementedError(f"{type(self).__name__} does not name its objectives")

    def resume(self, counts: Counts, m: int, memory: np.ndarray) -> None:
        """Continue with the counts and the memory of an earlier run with m objectives."""
        self.counts = counts

    def check_budget(self, budget: int) -> None:
        """Raise ValueError if no evaluation is left in the budget."""
        if budget <= self.counts.evaluations:
            raise ValueError(f"evaluations: the budget of {budget} leaves none")

    def opening(self, candidates: np.ndarray) -> np.ndarray:
        """First candidates (k, d) of a search, made from candidates (k, d) drawn uniformly from the box; by default the same."""
        return candidates

    @abstractmethod
    def first_guess(self, candidates: np.ndarray) -> np.ndarray:
        """Full vectors (k, D) for new candidates (k, d)."""

    @abstractmethod
    def _evaluate(self, Z: np.ndarray, way: int | None = None) -> tuple[Evaluation, int]:
        """The evaluation of full vectors (k, D), k > 0, and the number of inner iterations."""

    def evaluate(self, Z: np.ndarray, way: int | None = None) -> Evaluation:
        """Evaluate full vectors (k, D): free entries are the candidates, the inner solve starts from the others. Counts k evaluations.

        Parameters
        ----------
        Z : array (k, D)
        way : int, optional
            Number of the inner solver, of `ways`. Default: the evaluator's rule.
        """
        self.before_batch()
        evaluation, iterations = self._evaluate(Z, way)
        self.counts.evaluations += len(Z)
        self.counts.inner_iterations += iterations
        self.counts.clocked += evaluation.clocked
        self.counts.fallbacks += evaluation.fallbacks
        self.counts.work += evaluation.work
        self.counts.charge += evaluation.charge
        self.counts.failures.update(status for status in evaluation.status.tolist() if status != CONVERGED)
        return evaluation

    def descend(self, starts: np.ndarray, references: np.ndarray, weights: np.ndarray, margins: np.ndarray | None = None) -> Evaluation:
        """Results of k gradient solves: each minimises alpha subject to F - reference <= alpha weights (Pascoletti and Serafini 1984).

        Gradient solves are counted separately from evaluations.

        Parameters
        ----------
        starts : array (k, D)
            Full vectors to start from.
        references, weights : arrays (k, m)
            Weight 0: the reference is a hard limit. Reference +inf: the objective is ignored.
        margins : array (k, r), optional
            Distances, in scales, that the rows of the constraints keep from their limits. Default: 0.

        Returns
        -------
        Evaluation
            Status "converged" for a feasible local optimum. If asked to end early (`transcription.stopping`), only the rows solved until
            then are returned and counted.
        """
        self.before_batch()
        found, iterations = self._descend(starts, references, weights, margins)
        cut_short = found.clocked or len(found.F) < len(starts)
        self.counts.add_solves(len(found.F), found.status.tolist(), iterations, cut_short, starts.shape[1], found.charge)
        return found

    def _descend(
        self, starts: np.ndarray, references: np.ndarray, weights: np.ndarray, margins: np.ndarray | None
    ) -> tuple[Evaluation, int]:
        """The results of the rows in their order, until asked to end early, and the number of iterations."""
        raise NotImplementedError(f"{type(self).__name__} has no gradients")
