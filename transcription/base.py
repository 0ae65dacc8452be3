"""The contract of this floor: a transcription turns a problem into an NLP, and the NLP's vectors into trajectories."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from dataclasses import MISSING, dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from problems.checks import settings_of, short_repr
from problems.compiled import CompiledProblem, Deriving, Variable, computed, remembered
from problems.problem import Problem
from problems.vector import CompiledVectorProblem, VectorProblem, without_dynamics

from .numerics.batched import Batched
from .phases.adjoint import Adjoint
from .phases.reduced import Reduced
from .phases.rows import Parts
from .trajectories.trajectory import PiecewisePolynomial, Trajectory

CONVERGED, INFEASIBLE, FAILED, TIMEOUT = "converged", "infeasible", "failed", "timeout"
"""The statuses of candidates and solves: feasible within the tolerance (and optimal, where that is asked for), or the reason why not."""


class Transcription(ABC):
    """A way to write a continuous problem with finitely many numbers.

    An implementation is a frozen dataclass of its settings, in a file of its own, with the method `transcribe`. Solvers of NLPs,
    searches and trajectories need nothing else. One that has a `word` is registered: it is found in files and on the
    command line.

    Attributes
    ----------
    word : str or tuple of str
        What the method is called on the command line, in lower case; several words, where the first of its `options` is chosen by them.
    examples : str
        How it is written there, for messages.
    further : tuple of str
        Settings that may be written as numbers after those that have no default value: dfet:4x6 has its two, shooting:200x2 one more.
    options : dict
        Settings that may be written after a colon, in any order: name -> their words; none for a number.
    registered : dict
        The methods that have a word, by name of the class.

    Examples
    --------
    >>> from transcription import DFET, Transcription
    >>> isinstance(DFET(4, 6), Transcription)
    True
    """

    word: ClassVar[str | tuple[str, ...]] = ""
    examples: ClassVar[str] = ""
    further: ClassVar[tuple[str, ...]] = ()
    options: ClassVar[Mapping[str, Collection[str]]] = {}
    registered: ClassVar[dict[str, type[Transcription]]] = {}

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if "__repr__" not in vars(cls):
            cls.__repr__ = short_repr  # type: ignore[method-assign]
        if vars(cls).get("word"):
            Transcription.registered[cls.__name__] = cls

    @abstractmethod
    def transcribe(self, problem: Problem | CompiledProblem) -> NLP:
        """Write `problem` as an NLP. Raises ValueError if the problem is stated wrongly or the method cannot express it."""

    def nlp(self, problem: Problem | CompiledProblem) -> NLP:
        """The NLP that `transcribe` makes, kept with the compiled problem: all that use both share it, and what is compiled of it."""
        return _transcribed(problem.compile(), self)

    def to_dict(self) -> dict[str, Any]:
        """Name and settings as plain data, for files."""
        return {"method": type(self).__name__, "settings": {one.name: getattr(self, one.name) for one in settings_of(self)}}

    @classmethod
    def from_word(cls, word: str, numbers: tuple[int, ...], options: tuple[str, ...]) -> Transcription:
        """A method as it is written on the command line: dfet:4x6:bernstein has numbers (4, 6) and options ("bernstein",).

        Raises
        ------
        ValueError
            If it makes no sense.
        """
        needed = [one.name for one in settings_of(cls) if one.default is MISSING]
        if not len(needed) <= len(numbers) <= len(needed) + len(cls.further):
            raise ValueError(f"write it as {cls.examples}")
        settings: dict[str, Any] = dict(zip((*needed, *cls.further), numbers, strict=False))
        for option in (*(() if word == cls.word else (word,)), *options):
            kinds = (name for name, words in cls.options.items() if (option in words if words else option.isdecimal()))
            name = next(kinds, None)
            if name is None:
                known = "; ".join(", ".join(words) for words in cls.options.values() if words)
                raise ValueError(f"'{option}' is none of its words ({known}); write it as {cls.examples}")
            if name in settings:
                raise ValueError(f"'{option}': {name} is given twice; write it as {cls.examples}")
            settings[name] = option if cls.options[name] else int(option)
        return cls(**settings)

    def to_word(self) -> str:
        """The method as it is written on the command line, as far as that is possible: not all settings have a place there."""
        given = {one.name: (getattr(self, one.name), one.default) for one in settings_of(self)}
        numbers = [value for name, (value, default) in given.items() if default is MISSING or (name in self.further and value != default)]
        options = {name: str(given[name][0]) for name in self.options if given[name][0] != given[name][1]}
        word = self.word
        if isinstance(word, tuple):
            setting = next(iter(self.options))
            word = given[setting][0]
            options.pop(setting, None)
        return ":".join([word, "x".join(map(str, numbers)), *options.values()])


@remembered
def _transcribed(problem: CompiledProblem, transcription: Transcription) -> NLP:
    return transcription.transcribe(problem)


def kept_nlp(problem: CompiledProblem, transcription: Transcription) -> NLP | None:
    """What `Transcription.nlp` has made of a problem and keeps with it; None if it was not asked for."""
    return computed(_transcribed, problem, transcription)


def _unpickled(problem: CompiledProblem, transcription: Transcription, widened: bool) -> NLP:
    nlp = transcription.transcribe(problem)
    return nlp.whole if widened else nlp


@dataclass(frozen=True, eq=False)
class ControlProfile:
    """The free variables that are one control of one phase."""

    name: str  # "phase.control"
    columns: np.ndarray  # (k,): Which of the free variables they are, in their order in time
    places: np.ndarray  # (k,): Where along the phase they lie: 0 at t0, 1 at tf


@dataclass(frozen=True, eq=False, repr=False)
class NLP(Deriving):
    """Objectives F(z) and constraints g_lower <= g(z) <= g_upper of a vector z of n variables, in the user's units.

    Attributes
    ----------
    problem : CompiledProblem
    transcription : Transcription
    variables : tuple of Variable (n)
        Names, bounds, units, scales and periods.
    free : array (d,) of int
        Variables that an outer search may alter: parameters, free times, free initial states, coefficients of controls. What the others
        are follows from them.
    functions : Function
        z -> (F, g): all objectives minimised (m), all constraints (r). Exact sparse derivatives come from it.
    g_lower, g_upper, g_scale : arrays (r,)
        Limits of g, and what counts as one in each row.
    g_labels : tuple of str (r)
        What the row is, in the user's names. Rows of one thing share one label.
    guess : array (d,)
        What the user guessed of the free variables; NaN where nothing.
    profiles : tuple of ControlProfile
        Which of the free variables are the controls, and where in time.
    guessed : callable
        Candidates (k, d) of the free variables -> vectors (k, n): the states by the user's guess, or on a line, or at their first value;
        peaks and absolute values are 0.
    reduce : callable
        () -> Reduced: what propagation leaves to satisfy, as functions of the free variables alone; see `reduced`.
    tighten : callable
        Vectors (k, n) -> vectors (k, n): peaks set to the largest value that they bound, and what stands for absolute values to these.
    unpack : callable
        A vector (n,) -> Trajectory.
    interpolate : callable
        A Trajectory of the same problem, by any method and mesh -> the vector (n,) nearest to it: its times and parameters, its states
        and controls where this mesh has its own, within bounds. In general it satisfies the equations only as well as both meshes do.
    widen : callable
        NLP -> the same one with all variables free that have bounds; see `whole`.
    costates : callable
        A vector (n,) and multipliers (r,) of the rows -> phase: its costates, a `PiecewisePolynomial`; without the phases of methods whose
        multipliers say nothing between their places.
    adjoint : callable
        A vector (n,), multipliers (r,) of the rows and (n,) of the bounds of variables, and what a unit of each integral counts, by phase
        -> phase: its costates, an `Adjoint`; by the adjoint equation where the method's multipliers say nothing between their places, or
        limits of states have multipliers.
    measure : callable
        () -> `quantities`.
    dense : int
        About how many derivatives of rows by free variables there are because states depend on all controls before them; 0 where
        derivatives are sparse.
    parts : Parts, optional
        The same functions as affine maps of what is evaluated at points, where they have that structure: derivatives follow at less cost.
    widened : bool
        Whether this is the `whole` of another one.

    Examples
    --------
    >>> from problems import load
    >>> from transcription import DFET
    >>> nlp = DFET(4, 6).transcribe(load("goddard"))
    >>> len(nlp.free)  # what a search may alter: 28 coefficients of the control, and tf
    29
    """

    problem: CompiledProblem
    transcription: Transcription
    variables: tuple[Variable, ...]
    free: np.ndarray
    functions: ca.Function
    g_lower: np.ndarray
    g_upper: np.ndarray
    g_scale: np.ndarray
    g_labels: tuple[str, ...]
    guess: np.ndarray
    profiles: tuple[ControlProfile, ...]
    guessed: Callable[[np.ndarray], np.ndarray]
    reduce: Callable[[], Reduced]
    tighten: Callable[[np.ndarray], np.ndarray]
    unpack: Callable[[np.ndarray], Trajectory]
    interpolate: Callable[[Trajectory], np.ndarray]
    widen: Callable[[NLP], NLP]
    costates: Callable[[np.ndarray, np.ndarray], dict[str, PiecewisePolynomial]]
    adjoint: Callable[..., dict[str, Adjoint]]
    measure: Callable[[], ca.Function]
    dense: int = 0
    parts: Parts | None = None
    widened: bool = False

    def __reduce__(self) -> tuple[Any, ...]:
        """As its problem and method: what is compiled does not pickle, and is soon made again."""
        return _unpickled, (self.problem, self.transcription, self.widened)

    def __repr__(self) -> str:
        sizes = f"{len(self.variables)} variables ({len(self.free)} free), {len(self.g_lower)} rows"
        return f"NLP('{self.problem.name}', {self.transcription!r}: {sizes})"

    @cached_property
    def reduced(self) -> Reduced:
        """What propagation leaves to satisfy: made where something is propagated, which gradient solves need not do."""
        return self.reduce()

    @cached_property
    def whole(self) -> NLP:
        """The same NLP for a search over whole vectors: states are free, too, and among its profiles. Only what has no bounds (peaks,
        absolute values) follows from the rest."""
        return self.widen(self)

    @cached_property
    def quantities(self) -> ca.Function:
        """z -> what objectives and constraints see of each phase: t0, tf, initials, finals, integrals, peaks; a column a phase."""
        return self.measure()

    @cached_property
    def lower(self) -> np.ndarray:
        """Lower bounds (n,)."""
        return np.array([v.lower for v in self.variables])

    @cached_property
    def upper(self) -> np.ndarray:
        """Upper bounds (n,)."""
        return np.array([v.upper for v in self.variables])

    @cached_property
    def span(self) -> np.ndarray:
        """Widths of the bounds (n,), always positive."""
        return self.upper - self.lower

    @cached_property
    def times(self) -> np.ndarray:
        """Which variables (k,) are free times."""
        names = {f"{phase.name}.{time.name}" for phase in self.problem.phases for time in (phase.t0, phase.tf)}
        return np.array([i for i in self.free if self.variables[i].name in names], dtype=int)

    @cached_property
    def integers(self) -> np.ndarray:
        """Which variables (k,) are whole numbers: every solve keeps those of its start."""
        return np.flatnonzero([v.integer for v in self.variables])

    @cached_property
    def relaxed(self) -> NLP:
        """The same NLP with real numbers for whole ones."""
        return replace(self, variables=tuple(replace(v, integer=False) for v in self.variables))

    def rounded(self, Z: np.ndarray) -> np.ndarray:
        """Vectors (..., n) with whole numbers where they are meant."""
        if len(self.integers):
            Z = Z.copy()
            Z[..., self.integers] = Z[..., self.integers].round()
        return Z

    @cached_property
    def scale(self) -> np.ndarray:
        """The scales of the variables (n,)."""
        return np.array([v.scale for v in self.variables])

    @cached_property
    def period(self) -> np.ndarray:
        """Periods (n,); 0 where a variable has none."""
        return np.array([v.period or 0.0 for v in self.variables])

    def first_guess(self, candidates: np.ndarray) -> np.ndarray:
        """Vectors (k, n) for a solver to begin from: those `guessed` of candidates (k, d), with the peaks that belong to them."""
        return self.tighten(self.rounded(self.guessed(candidates)))

    def propagate(self, Z: np.ndarray) -> np.ndarray:
        """The states (k, n) that the dynamics give to the free entries of vectors (k, n), by propagation; not numbers, or short of the
        equations, where that fails."""
        return self.reduced.propagate(self.rounded(Z)).Z

    def propagate_and_score(self, Z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Propagated vectors (k, n), their objectives (k, m) and their residuals (k, n + r): `propagate`, then `residuals`, at once where
        the method knows on the way all that these depend on."""
        propagated = self.reduced.propagate(Z)
        if propagated.scores is None:
            return propagated.Z, *self.residuals(propagated.Z)
        F, g = propagated.scores
        return propagated.Z, F, self._residuals(propagated.Z, g)

    def evaluate(self, Z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Objectives (k, m), all minimised, and violations (k,) of vectors (k, n): the largest scaled residual of bounds and rows of g."""
        F, residuals = self.residuals(Z)
        return F, largest(residuals)

    def violations(self, z: np.ndarray) -> dict[str, float]:
        """The largest scaled residual of each constraint of a vector (n,), by its label; bounds are labelled by phase and variable."""
        _, residuals = self.residuals(z[None])
        return dict(zip(self.constraints, self.by_constraint(residuals)[0].tolist(), strict=True))

    def by_constraint(self, residuals: np.ndarray) -> np.ndarray:
        """Violations (k, c) of each of the `constraints`, at least 0, of what `residuals` returned: infinite where it is no number."""
        _, order, starts = self._rows_by_label
        worst = np.maximum.reduceat(residuals[:, order], starts, axis=1)
        return np.where(np.isnan(worst), np.inf, np.maximum(worst, 0.0))

    @property
    def constraints(self) -> tuple[str, ...]:
        """Labels (c) of all that can be violated, bounds first: those of `violations`."""
        return self._rows_by_label[0]

    def distance(self, Z: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Euclidean distance (k,) of the free variables of two sets of vectors (k, n), in spans of their bounds, periods taken round."""
        difference, period = Z[:, self.free] - other[:, self.free], self.period[self.free]
        if period.any():
            turns = np.where(period > 0, difference, 0.0) / np.where(period > 0, period, 1.0)
            difference -= period * np.round(turns)
        difference /= self.span[self.free]
        return np.sqrt(np.einsum("kd,kd->k", difference, difference))

    def residuals(self, Z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Objectives (k, m), and scaled residuals (k, n + r) of bounds and rows of g: negative inside, NaN where they are no numbers."""
        F, g = self._batched(Z)
        return F, self._residuals(Z, g)

    def _residuals(self, Z: np.ndarray, g: np.ndarray) -> np.ndarray:
        """Scaled residuals (k, n + r) of bounds and rows of g (k, r)."""
        lower, upper, scale = self._limits
        residuals = np.hstack([Z, g])
        # Overflow shows in the results; warnings would add nothing.
        with np.errstate(invalid="ignore"):
            below = lower - residuals
            residuals -= upper
            np.maximum(residuals, below, out=residuals)
        residuals /= scale
        return residuals

    @cached_property
    def _limits(self) -> np.ndarray:
        """Lower and upper limits and scales (3, n + r) of the variables and of g."""
        return np.hstack([[self.lower, self.upper, self.scale], [self.g_lower, self.g_upper, self.g_scale]])

    @cached_property
    def _batched(self) -> Batched:
        return Batched(self.functions)

    @cached_property
    def _rows_by_label(self) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
        """The labels (c), the residuals in their order (n + r,), and where those of each begin there (c,)."""
        of_bounds = [f"bounds of {v.name.split('[')[0]}" for v in self.variables]
        place: dict[str, int] = {}
        labels = np.array([place.setdefault(label, len(place)) for label in (*of_bounds, *self.g_labels)])
        order = np.argsort(labels, kind="stable")
        return tuple(place), order, np.searchsorted(labels[order], np.arange(len(place)))


def largest(residuals: np.ndarray) -> np.ndarray:
    """Violations (k,) of what `NLP.residuals` returned (k, n + r): the largest of each row, at least 0; infinite where it is no number."""
    violation = residuals.max(axis=1, initial=0.0)
    return np.where(np.isfinite(violation), violation, np.inf)


def check_problem(problem: Any, transcription: Any = None) -> None:
    """Raise ValueError if these are no problem with dynamics and, unless it is None, no transcription."""
    if isinstance(problem, VectorProblem | CompiledVectorProblem):
        raise ValueError(f"{without_dynamics(problem.name)}: use a search, such as MACS().solve(problem)")
    if not isinstance(problem, Problem | CompiledProblem):
        others = "problems.load makes one from a name, and minimize(...) searches a plain function or a problem of pymoo"
        raise ValueError(f"problem must be a Problem, not {type(problem).__name__}; {others}")
    check_method(transcription)


def check_method(transcription: Any) -> None:
    """Raise ValueError if this is no transcription; None is one that is to be found."""
    if transcription is not None and not isinstance(transcription, Transcription):
        others = "; transcription.parse makes one from a word" if isinstance(transcription, str) else ""
        raise ValueError(f"transcription must be a Transcription such as DFET(elements=4, order=6), not {transcription!r}{others}")


def check_freedom(nlp: NLP) -> None:
    """Raise ValueError if there is nothing to search."""
    if not len(nlp.free):
        raise ValueError(
            f"problem '{nlp.problem.name}' leaves nothing to decide: no control, no parameter, no free time and no free initial state"
        )
