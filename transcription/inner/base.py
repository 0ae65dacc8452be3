"""The contract of the inner level: a batch of candidates in, the nearest feasible points out; and what its work is counted in."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from problems.checks import short_repr
from problems.compiled import remembered

from ..base import CONVERGED, FAILED, NLP, TIMEOUT, largest
from ..nlp.derivatives import gradients, hessian, too_dense
from ..nlp.program import Watched
from ..numerics.batched import PRICES, Batched, work


@dataclass(frozen=True, eq=False, repr=False)
class InnerResult:
    """Feasible points near k candidates, as far as they were found.

    Attributes
    ----------
    z : array (k, n)
        Feasible vectors where the status is "converged", else the best that was found; where that is no number, the start.
    F : array (k, m)
        Objectives there, all minimised; NaN where they are no numbers.
    violation : array (k,)
        Largest scaled residual there; infinite where it is no number.
    status : array (k,) of str
        "converged" (violation within the tolerance, also where the solver reports a failure), "infeasible", "failed" or "timeout".
    moved : array (k,)
        Euclidean distance of the free variables from the candidate, in spans of their bounds.
    iterations : array (k,) of int
        Of the solver; a propagation counts as one.
    clocked : bool
        Whether a clock ended any of the work: then the same candidates need not give the same result again.
    fallbacks : int
        How many candidates a faster method left to a slower one.
    residuals : array (k, n + r), optional
        What `NLP.residuals` returns there, from which the violation of each constraint follows; None: to be computed from z.
    work : float, optional
        What all of it took, in iterations of IPOPT on the same program; None: all iterations were of IPOPT.

    Examples
    --------
    >>> import numpy as np
    >>> from problems import load
    >>> from transcription import DFET
    >>> from transcription.inner import inner_solver
    >>> nlp = DFET(4, 6).transcribe(load("goddard"))
    >>> candidates = (nlp.lower + 0.5 * nlp.span)[nlp.free][None]
    >>> inner_solver("projection").solve(nlp, candidates).status.shape
    (1,)
    """

    z: np.ndarray
    F: np.ndarray
    violation: np.ndarray
    status: np.ndarray
    moved: np.ndarray
    iterations: np.ndarray
    clocked: bool = False
    fallbacks: int = 0
    residuals: np.ndarray | None = None
    work: float | None = None

    def __repr__(self) -> str:
        found, counts = np.unique(self.status, return_counts=True)
        shown = ", ".join(f"{count} {status}" for status, count in zip(found, counts, strict=True))
        return f"InnerResult({len(self.z)} candidates{': ' * bool(shown)}{shown})"


class InnerSolver(ABC):
    """Makes candidates feasible. An implementation is a frozen dataclass of its settings; nothing that it keeps between two calls
    changes a result.

    The result for one candidate depends on that candidate, its warm start and the composition of the batch, and on nothing else.

    Parameters
    ----------
    **settings
        Those of each class.

    Attributes
    ----------
    moves : bool
        Whether candidates that are not feasible are moved to points nearby. If not, what is found for them says how they violate the
        constraints.

    Examples
    --------
    >>> from transcription.inner import InnerSolver, inner_solver
    >>> isinstance(inner_solver("projection"), InnerSolver)
    True
    """

    moves: ClassVar[bool] = True

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls.__repr__ = short_repr  # type: ignore[method-assign]

    @property
    def ways(self) -> tuple[InnerSolver, ...]:
        """The solvers between which a search may choose for each batch, those first that take least; none where there is no choice."""
        return ()

    def program(self, nlp: NLP) -> NLP:
        """The NLP whose free variables are to be searched with this inner level: as it is, unless candidates have more."""
        return nlp

    @abstractmethod
    def solve(self, nlp: NLP, candidates: np.ndarray, warm: np.ndarray | None = None, *, tolerance: float = 1e-6) -> InnerResult:
        """Find feasible points near candidates.

        Parameters
        ----------
        nlp : NLP
        candidates : array (k, d)
            Values of the free variables, within their bounds.
        warm : array (k, n), optional
            Vectors whose other entries (states) are good to start from; by default the NLP's first guess.
        tolerance : float
            Largest scaled residual of a feasible point.
        """


def started(nlp: NLP, candidates: np.ndarray, warm: np.ndarray | None) -> np.ndarray:
    """Vectors (k, n) to start from: the candidates with the states of `warm`, or with guessed ones; peaks need not fit to these."""
    if warm is None:
        return nlp.rounded(nlp.guessed(candidates))
    Z = np.array(warm, dtype=float)
    Z[:, nlp.free] = candidates
    return nlp.rounded(Z)


def scored(
    nlp: NLP,
    found: tuple[np.ndarray, np.ndarray, np.ndarray],
    start: np.ndarray,
    otherwise: np.ndarray,
    iterations: np.ndarray,
    tolerance: float,
) -> InnerResult:
    """The result that `found`, vectors, objectives (k, m) and residuals (k, n + r), is; `otherwise` (k,): statuses of the infeasible."""
    Z, F, residuals = found
    violation = largest(residuals)
    finite = np.isfinite(violation) & np.isfinite(F).all(axis=1)
    status = np.where(violation <= tolerance, CONVERGED, otherwise)
    moved = nlp.distance(Z, start)
    if not finite.all():
        broken = ~finite
        Z = np.where(finite[:, None], Z, start)
        F[broken], violation[broken], moved[broken], status[broken] = np.nan, np.inf, 0.0, FAILED
    return InnerResult(Z, F, violation, status, moved, iterations, clocked=TIMEOUT in otherwise, residuals=residuals)


# Work is counted in iterations of IPOPT on the same program, from the program's sizes, so that it is the same on all machines. In
# instructions of compiled functions such an iteration takes those of the program's rows, several times for derivatives and the line search,
# what its linear algebra does for each entry of the Jacobian, and a fixed part. The constants are fitted to measured times of six problems,
# which they meet within a third (those of Newton's method on the three on which its steps needed no least squares with signs).


@remembered
def propagation_work(nlp: NLP) -> float:
    """Of a propagation whose objectives and constraints are evaluated."""
    return (nlp.reduced.instructions + 8_000) / iteration_work(nlp)


@remembered
def evaluation_work(nlp: NLP) -> float:
    """Of an evaluation of the objectives and constraints alone."""
    return (work(nlp.functions) + 8_000) / iteration_work(nlp)


@remembered
def newton_work(nlp: NLP) -> float:
    """Of a step of Newton's method, its propagation included."""
    return propagation_work(nlp) + (nlp.reduced.instructions_of_derivatives + 20_000) / iteration_work(nlp)


@remembered
def iteration_work(nlp: NLP) -> float:
    """Instructions that take as long as an iteration of IPOPT: by these, programs of different kinds are comparable."""
    entries = nlp.dense if too_dense(nlp) else nlp.functions.jac_sparsity(1, 0).nnz()
    return 6 * work(nlp.functions) + 70_000 + 22 * entries


# Charges compare costs of different kinds, and of different programs: nanoseconds by `PRICES`, from counts and sizes alone.


def spent(nlp: NLP) -> int:
    """Charged for all propagations, evaluations, their derivatives, and iterations of IPOPT so far."""
    reduced = nlp.__dict__.get("reduced")
    steps, more = (reduced.differentiated, reduced.derived.values()) if reduced is not None else (np.zeros(2), ())
    known = [*nlp.__dict__.values(), *nlp.derived.values(), *more]
    calls = sum(one.calls * one.nanoseconds for one in known if isinstance(one, Batched) and one.calls)
    iterations = sum(one.iterations for one in known if isinstance(one, Watched))
    return int(steps @ (PRICES["steps"], PRICES["step"])) + calls + solves_charge(nlp, 0, iterations)


def batch_charge(nlp: NLP, count: int) -> int:
    """Of a batch of candidates, beside what is spent on them."""
    return round(PRICES["batch"] + count * (PRICES["candidate"] + PRICES["number"] * (len(nlp.variables) + len(nlp.g_scale))))


@remembered
def iteration_charge(nlp: NLP) -> int:
    """Of an iteration of IPOPT with exact derivatives."""
    first, second = gradients(nlp), hessian(nlp)
    entries = first.nnz_out("dg") + second.nnz_out("H") + len(nlp.variables) + len(nlp.g_scale)
    return round(PRICES["iteration"] + PRICES["entry"] * entries + PRICES["derivative"] * (work(first) + work(second)))


def solves_charge(nlp: NLP, count: int, iterations: int) -> int:
    """Of gradient solves with so many iterations together."""
    return round(PRICES["solve"] * count) + (iterations and iterations * iteration_charge(nlp))
