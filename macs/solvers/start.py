"""Checks of a solver's arguments, and the first vectors of a search."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np

from problems.checks import check_count, check_positive, unknown
from problems.compiled import CompiledPhase, CompiledProblem, Variable
from transcription.base import NLP
from transcription.phases.writer import along
from transcription.smooth import Smooth
from transcription.trajectories.trajectory import PhaseTrajectory, PiecewisePolynomial, Trajectory

from ..fronts.point import Point
from ..fronts.points import Points
from ..gradients.multistart import guessed_start
from ..io.atomic import check_target
from ..io.workers import Workers, check_workers
from .progress import Progress

STARTS = ("uniform", "smooth")
"""Words for the way first candidates are drawn."""


OTHER = "start: the points have other variables; a start belongs to one problem, with these data or others"


@dataclass(frozen=True)
class Call:
    """The arguments that `Solver.solve`, `Solver.minimize` and gradient tools share, checked; see `Solver.solve`.

    Raises ValueError for one that is not valid, OSError for a checkpoint that cannot be written.
    """

    evaluations: int | None
    seed: int | None
    tolerance: float
    time_limit: float | None
    workers: Workers | None = None
    progress: bool | None = None
    callback: Callable[[Progress], Any] | None = None
    checkpoint: str | PathLike[str] | None = None
    cache: str | PathLike[str] | None = None

    def __post_init__(self) -> None:
        if self.evaluations is not None:
            check_count("evaluations", self.evaluations, 1)
        seed = self.seed
        if seed is not None and (isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0):
            raise ValueError(f"seed must be a whole number of at least 0, or None, not {seed!r}")
        check_positive("tolerance", self.tolerance)
        object.__setattr__(self, "tolerance", float(self.tolerance))
        if self.time_limit is not None:
            check_positive("time_limit", self.time_limit)
        check_workers(self.workers)
        if self.callback is not None and not callable(self.callback):
            raise ValueError(f"callback must be callable, not {self.callback!r}")
        for name, path in (("checkpoint", self.checkpoint), ("cache", self.cache)):
            if path is not None:
                if not isinstance(path, str | PathLike) or not str(path):
                    raise ValueError(f"{name} must be a path, not {path!r}")
                check_target(path)


def drawing(start: Any) -> Smooth | str | None:
    """The way first candidates are drawn, a `Smooth` or "uniform", if `start` is a word or a `Smooth`; else None."""
    if not isinstance(start, str):
        return start if isinstance(start, Smooth) else None
    if start not in STARTS:
        raise ValueError(f"{unknown('start', start, STARTS)}; or give a Front, Points or an array of decisions")
    return Smooth() if start == "smooth" else start


def beginning(start: Any, nlp: NLP, *, guess: bool = True) -> np.ndarray | None:
    """First full vectors (k, D) of a search: with `guess` the problem's guess, then the vectors of `start`; None if there are none.

    `start` is a Front, Points, or an array (k, n) of decisions, or (k, d) of their free variables. Points on other meshes are
    interpolated; those of the problem with other data, such as other bounds, are moved into the bounds; and of those of a variant with
    other phases or quantities, what has the same name.
    """
    rows = []
    own = guessed_start(nlp) if guess else None
    if own is not None:
        rows.append(own)
    points = _points(start)
    if points:
        rows.append(np.array([_on_mesh(point, nlp) for point in points]))
    elif start is not None:
        given = _array(start)
        if given.shape[1] == len(nlp.free) != len(nlp.variables):
            rows.append(nlp.first_guess(decisions(given, [nlp.variables[i] for i in nlp.free])))
        else:
            rows.append(decisions(given, nlp.variables))
    return np.vstack(rows) if rows else None


def decisions(start: Any, variables: Sequence[Variable]) -> np.ndarray:
    """First decisions (k, D) of a search, within their bounds. Points may come from other bounds, and are moved into these.

    Raises
    ------
    ValueError
        If they have another length, are not numbers, or, in an array, are outside the bounds; the message names the variable.
    """
    points = _points(start)
    for point in points:
        if [v.name for v in point.variables] != [v.name for v in variables]:
            raise ValueError(OTHER)
    Z = _array([point.decision for point in points] or start)
    if Z.shape[1] != len(variables):
        raise ValueError(f"start: decisions have {Z.shape[1]} entries, {len(variables)} expected")
    lower, upper, scale = (np.array([getattr(v, name) for v in variables]) for name in ("lower", "upper", "scale"))
    outside = (lower - 1e-6 * scale > Z) | (upper + 1e-6 * scale < Z)
    wrong = ~np.isfinite(Z) if points else ~np.isfinite(Z) | outside
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        v = variables[column]
        raise ValueError(f"start: decision {row} has {v.name} = {Z[row, column]:g}, outside its bounds ({v.lower:g}, {v.upper:g})")
    return np.clip(Z, lower, upper)


def _points(start: Any) -> list[Point]:
    """The list of Points in a start; empty if it is an array."""
    points = [start] if isinstance(start, Point) else list(start) if isinstance(start, Points | list | tuple) else []
    return points if all(isinstance(point, Point) for point in points) else []


def _on_mesh(point: Point, nlp: NLP) -> np.ndarray:
    """The decision vector (n,) of a point, within the bounds, interpolated if the point is on another mesh."""
    if [v.name for v in point.variables] == [v.name for v in nlp.variables] and point.transcription == nlp.transcription.to_dict():
        return decisions([point], nlp.variables)[0]
    if point.trajectory is None:
        raise ValueError(OTHER)
    same = _named(point.trajectory) == _named(nlp.problem)
    return nlp.interpolate(point.trajectory if same else _recast(point.trajectory, nlp.problem))


def check_start(start: Any, problem: CompiledProblem) -> None:
    """Raise ValueError for an unknown word, and for points of a problem without a state in common; no mesh is needed."""
    drawing(start)
    states = {v.name for phase in problem.phases for v in phase.states}
    for point in _points(start):
        if point.trajectory is not None and not states.intersection(
            v.name for phase in point.trajectory.phases for v in phase.state_variables
        ):
            raise ValueError(f"{OTHER}, or to one that has states of the same names")


def _recast(trajectory: Trajectory, problem: CompiledProblem) -> Trajectory:
    """A trajectory as one of another problem: parameters, and states and controls of the same names at the same times; others as guessed,
    or in the middle of their bounds. Phases of other names share its duration, as far as their times are free."""
    begin, end, n = trajectory.phases[0].t0, trajectory.phases[-1].tf, len(problem.phases)
    known, found = all(phase.name in trajectory for phase in problem.phases), list[PhaseTrajectory]()
    for k, phase in enumerate(problem.phases):
        old = trajectory[phase.name] if known else None
        times = (old.t0, old.tf) if old else (begin + (end - begin) * k / n, begin + (end - begin) * (k + 1) / n)
        t0, tf = (float(np.clip(time, v.lower, v.upper)) for time, v in zip(times, (phase.t0, phase.tf), strict=True))
        edges = np.linspace(t0, max(tf, t0), 201)  # linear pieces, many for any mesh
        states, controls = (
            np.column_stack([np.empty((len(edges), 0)), *(_values(v, phase, trajectory, edges) for v in group)])
            for group in (phase.states, phase.controls)
        )
        state, control = (PiecewisePolynomial(edges, np.stack([one[:-1], one[1:]], axis=1), "lobatto") for one in (states, controls))
        none = np.empty((len(edges), 0))
        found.append(
            PhaseTrajectory(phase.name, phase.time_unit, edges, states, controls, none, state, control, phase.states, phase.controls, ())
        )
    middles = {v.name: 0.5 * (v.lower + v.upper) for v in problem.parameters}
    return Trajectory(tuple(found), {name: trajectory.parameters.get(name, value) for name, value in middles.items()})


def _values(variable: Variable, phase: CompiledPhase, trajectory: Trajectory, times: np.ndarray) -> np.ndarray:
    """Values (k,) of a state or control of a phase at times (k,), from the phases of a trajectory that have one of its name."""
    guess = phase.guesses.get(variable.name, 0.5 * (variable.lower + variable.upper))
    values = along(guess, times[:1], times[-1:], np.linspace(0.0, 1.0, len(times)))[0]
    first = True
    for old in trajectory.phases:
        names = [v.name for v in (*old.state_variables, *old.control_variables)]
        if variable.name in names:
            later = np.full(len(times), True) if first else times >= old.t0
            values[later] = np.hstack([old.state(times[later]), old.control(times[later])])[:, names.index(variable.name)]
            first = False
    return np.clip(values, variable.lower, variable.upper)


def _named(what: Trajectory | CompiledProblem) -> tuple[Any, ...]:
    """The names of parameters, and of the states and controls of each phase."""
    if isinstance(what, CompiledProblem):
        given: Iterable[Any] = (v.name for v in what.parameters)
        phases = [(phase.name, phase.states, phase.controls) for phase in what.phases]
    else:
        given, phases = what.parameters, [(phase.name, phase.state_variables, phase.control_variables) for phase in what.phases]
    return frozenset(given), *((name, *([v.name for v in part] for part in parts)) for name, *parts in phases)


def _array(start: Any) -> np.ndarray:
    try:
        Z = np.atleast_2d(np.array(start, dtype=float))
    except (TypeError, ValueError):
        raise ValueError("start must be a Front, Points or an array of decisions, all of one length") from None
    if Z.ndim != 2:
        raise ValueError(f"start must have two dimensions (points, variables), not {Z.ndim}")
    return Z
