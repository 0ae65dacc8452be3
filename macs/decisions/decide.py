"""decide: the point of a problem that suits a preference best, by gradients."""

from __future__ import annotations

import secrets
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from problems.compiled import CompiledProblem
from problems.problem import Problem
from transcription.base import Transcription, check_freedom
from transcription.catalogue import from_dict
from transcription.meshed import Meshed
from transcription.stopping import Stopped

from ..evaluation.evaluator import CONVERGED
from ..fronts.builders import certified, vectors_points
from ..fronts.point import Point
from ..fronts.points import Points
from ..fronts.provenance import costs, more_costs
from ..fronts.verified import VERIFY, objective_scales, verified
from ..gradient_tools import Terms, meshes_to_begin_on, payoff
from ..gradients.multistart import MOST_ITERATIONS, GradientSolves
from ..io.console import working
from ..preferences import Preference, Ranges, Stage
from ..preferences.stage import SLACK as MET
from ..solvers.start import beginning
from .choice import Choice, Step
from .stages import KEEPS, Kept, Known, Outcome, StageSolver

BEST = 3
"""Points of `start` that solves begin at by default, the best-ranked."""
LEAST_EXCESS = "least excess over hard limits"
"""Name of the step that looks for a point within all hard limits."""


def decide(
    problem: Problem | CompiledProblem,
    transcription: Transcription | Preference | None = None,
    preference: Preference | None = None,
    *,
    ranges: Ranges | None = None,
    start: Points | Point | None = None,
    starts: int | str = "auto",
    seed: int | None = 0,
    tolerance: float = 1e-6,
    verify: float | None = VERIFY,
    max_iterations: int = MOST_ITERATIONS,
    time_limit: float | None = None,
    progress: bool | None = None,
) -> Choice:
    """The point of a problem that suits a preference best, by gradients: a local optimum, and never worse than the best of `start`.

    Each stage of the preference is minimised as the one objective of a problem that has the user's objectives as parameters. Of several
    stages, each keeps what those before attained, but for a part of 1e-6 of its size, and of 1 at least. The vector that is found is one of
    the problem itself: the point is certified and simulated as all points are.

    Parameters
    ----------
    problem : Problem
    transcription : Transcription, optional
        It may be left out: `decide(problem, preference)`. Default: a mesh that is found, as by `optimize`; stages after the first are solved
        on the mesh of that.
    preference : Preference
    ranges : Ranges, optional
        By which objectives are normalised. Default: those of `start`, or of the payoff table, which is found first.
    start : Front or Point, optional
        Points of the problem to begin at. Default: those of the payoff table.
    starts : int or "auto"
        Number of starts: the best-ranked points of `start`, the problem's guess, then random ones. "auto": the three best points of a
        `start` that is given; else all of the payoff table, and the guess if there is one.
    seed, tolerance, verify, max_iterations, time_limit, progress
        As for `optimize`.

    Returns
    -------
    Choice
        Its `message` says what is to be known: hard limits that no point was found to meet together, a solve that did not converge.

    Raises
    ------
    ValueError
        For a black box, which has no derivatives; a preference with unknown names or targets beyond the ranges; points of another problem;
        peaks that would have to be raised; and as `optimize`.
    """
    if preference is None and isinstance(transcription, Preference):
        transcription, preference = None, transcription
    check_statement(problem, transcription, preference, start)
    assert not isinstance(transcription, Preference) and preference is not None
    terms = Terms(start, starts, seed, tolerance, verify, max_iterations, time_limit, progress)
    desk = Desk(problem, transcription, ranges, terms)
    return desk.work(lambda: desk.decided(preference))


def check_statement(problem: Any, transcription: Any, preference: Any, start: Any) -> None:
    """Raise ValueError for arguments of `decide` of the wrong type."""
    if isinstance(problem, Points) or not hasattr(problem, "compile"):
        raise ValueError(
            f"decide needs derivatives, and so a Problem with dynamics, not {type(problem).__name__}; preference.rank(front) needs none"
        )
    if transcription is not None and not isinstance(transcription, Transcription):
        raise ValueError(f"transcription must be a Transcription such as DFET(elements=4, order=6), not {transcription!r}")
    if not isinstance(preference, Preference):
        raise ValueError(f"preference must be a Preference such as WeightedSum({{'flight time': 1.0}}), not {preference!r}")
    if start is not None and not isinstance(start, Points | Point):
        raise ValueError(f"start must be a Front or a Point, not {type(start).__name__}")


@dataclass(eq=False)
class Desk:
    """One call of `decide` or `satisfy`: what is known of the problem, and the solves made so far.

    Attributes
    ----------
    known : Points
        The points of `start`, or of the payoff table.
    history : list of Step
    """

    statement: Problem | CompiledProblem
    transcription: Transcription | None
    given: Ranges | None
    terms: Terms
    known: Points = field(init=False)
    ranges: Ranges = field(init=False)
    history: list[Step] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.problem = self.statement.compile()
        start = self.terms.start.alone() if isinstance(self.terms.start, Point) else self.terms.start
        if start is not None:
            _check_start(start, self.problem)
        self._start, self._costs = start, dict[str, Any]()
        self.seed = secrets.randbits(63) if self.terms.seed is None else int(self.terms.seed)
        self.solves = GradientSolves(float(self.terms.tolerance), int(self.terms.max_iterations))
        self._began = time.perf_counter()
        self._stopped = ""

    def work(self, task: Any) -> Any:
        """What a task returns, for which points and ranges are known, and which Ctrl-C and the time limit ask to end."""
        with working(self.terms.time_limit, self.terms.progress) as (show, interrupts):
            self._reason = lambda: interrupts.reason
            self.solves.before = lambda: show(f"decide: {self.solves.counts.gradient_solves} gradient solves done")
            self.known = self._start if self._start is not None else self._ends()
            self.ranges = Ranges.of(self.known) if self.given is None else self.given
            best, worst = self.ranges.ends(self.problem.goals)
            self.solver = StageSolver(self.problem, best, worst, self.solves, np.random.default_rng(self.seed))
            return task()

    def _ends(self) -> Points:
        """The payoff table."""
        terms = self.terms
        ends = payoff(
            self.statement,
            self.transcription,
            seed=terms.seed,
            tolerance=terms.tolerance,
            verify=terms.verify,
            max_iterations=terms.max_iterations,
            progress=terms.progress,
        )
        self._costs = dict(ends.stats)
        return ends

    def decided(self, preference: Preference, about: Mapping[str, float] | None = None, also: Sequence[Point] = ()) -> Choice:
        """The choice by a preference; each of its steps has these further numbers. `also` are points to begin at beside those that are known."""
        stages = preference.stages(self.problem.goals, self.ranges)
        candidates = [*self._ranked(preference), *also]
        try:
            found, steps, message = self._solved(preference, stages, candidates, dict(about or {}))
        except Stopped as reason:
            found, steps, message = None, [], str(reason)
        self._stopped = self._reason()
        self.history += steps
        points = [*([] if found is None else [found]), *candidates]
        if not points:
            raise TimeoutError(f"decide: {message} before the first solve")
        chosen = min(points, key=_Merit(stages, points))
        if found is None or (chosen is not found and found.status == CONVERGED):
            words = "no better point was found than one that was known at the start"
            message = "; ".join(filter(None, [message, words]))
        elif chosen.verified is False:
            message = "; ".join(filter(None, [message, f"not confirmed by a simulation: {chosen.note}"]))
        J = np.array([list(chosen.objectives.values())])
        degrees = preference.degrees(self.problem.goals, self.ranges, J)[0]
        names = [goal.name for goal in self.problem.goals]
        values = stage_values(stages, J)[0]
        return Choice(
            chosen,
            tuple(values.tolist()),
            dict(zip(names, degrees.tolist(), strict=True)),
            tuple(self.history),
            preference,
            self.ranges,
            message=message,
        )

    def _ranked(self, preference: Preference) -> list[Point]:
        """The feasible points that are known, the best first."""
        if not (self.known.status == CONVERGED).any():
            return []
        ranking = preference.rank(self.known, self.ranges)
        order = [int(i) for i in ranking.order if self.known.status[int(i)] == CONVERGED]
        most = len(order) if self._start is None else BEST if self.terms.starts == "auto" else int(self.terms.starts)
        return [self.known[i] for i in order[:most]]

    def _solved(
        self, preference: Preference, stages: Sequence[Stage], candidates: Sequence[Point], about: Mapping[str, float]
    ) -> tuple[Point, list[Step], str]:
        """The point that solves of all stages lead to, the steps, and what is to be said."""
        stages, limits = _with_all_limits(stages)
        steps: list[Step] = []
        message = ""

        def step(stage: Stage, outcome: Outcome) -> float:
            J = (outcome.F * self.problem.signs)[None]
            value = float(stage.numbers(J)[0])
            names = [goal.name for goal in self.problem.goals]
            degrees = preference.degrees(self.problem.goals, self.ranges, J)[0].tolist()
            objectives = dict(zip(names, J[0].tolist(), strict=True))
            said = outcome.note if outcome.status != CONVERGED else ""
            steps.append(Step(stage.name, value, objectives, dict(zip(names, degrees, strict=True)), outcome.status, about, said))
            return value

        outcome: Outcome | None = None
        if limits is not None and not any(_meets(limits, point) for point in candidates):
            outcome = self._first(replace(limits, name=LEAST_EXCESS, limits=_none), candidates, None)
            excess = step(replace(limits, name=LEAST_EXCESS, limits=_none), outcome)
            if excess > MET:
                return self._point(outcome), steps, _unmet(limits, outcome.F * self.problem.signs)
        kept: list[Kept] = []
        for stage in stages:
            if stage.after_zero and kept and kept[-1].value > KEEPS:
                break
            if not kept:
                reached = self._first(stage, candidates, outcome)
            else:
                assert outcome is not None
                reached = self.solver.on_mesh(stage, kept, outcome.known, 1)
            value = step(stage, reached)
            if reached.status != CONVERGED and outcome is not None:
                message = f"{stage.name}: {reached.note}"
                break
            outcome = reached
            if reached.status != CONVERGED:
                message = f"{stage.name}: {reached.note}"
                break
            kept.append(Kept(stage, value))
        assert outcome is not None
        return self._point(outcome), steps, message

    def _first(self, stage: Stage, candidates: Sequence[Point], begun: Outcome | None) -> Outcome:
        """A stage solved from what is known."""
        count = self._starts(len(candidates), begun)
        if self.transcription is not None:
            known = self._known(self.transcription, candidates, begun)
            check_freedom(known.nlp)
            return self.solver.on_mesh(stage, (), known, count(known))
        if begun is not None:
            own: list[Any] = [begun.nlp.transcription]
        else:
            own = [from_dict(point.transcription) for point in candidates[:1] if point.transcription is not None]
        meshes = [one for one in own if isinstance(one, Meshed)] + meshes_to_begin_on(self.statement, self.problem)
        meshes = list(dict.fromkeys(meshes))
        remembered: dict[Meshed, Known] = {}

        def known_on(method: Meshed) -> Known:
            if method not in remembered:
                remembered[method] = self._known(method, candidates, begun)
            return remembered[method]

        first = known_on(meshes[0])
        check_freedom(first.nlp)
        return self.solver.on_found_mesh(stage, meshes, known_on, count(first), self.terms.verify or VERIFY)

    def _starts(self, candidates: int, begun: Outcome | None) -> Any:
        """How many starts there are, given the vectors that are known."""
        if begun is not None:
            return lambda known: 1
        if self.terms.starts != "auto":
            return lambda known: int(self.terms.starts)
        # The guess, if there is one, is the last of those known.
        return lambda known: max(1, len(known.Z) if self._start is None else min(BEST, candidates))

    def _known(self, method: Transcription, candidates: Sequence[Point], begun: Outcome | None) -> Known:
        """The vectors to begin at, on a transcription: candidates, best first, then the guess; alone that which was begun, if any was."""
        if begun is not None and begun.nlp.transcription == method:
            return begun.known
        nlp = method.nlp(self.problem)
        if begun is not None:
            Z = nlp.interpolate(begun.nlp.unpack(begun.z))[None]
        else:
            rows = [beginning(point, nlp, guess=False) for point in candidates]
            rows.append(beginning(None, nlp))
            Z = np.vstack([np.empty((0, len(nlp.variables))), *(row for row in rows if row is not None)])
        return Known(nlp, Z, nlp.evaluate(Z)[0] if len(Z) else np.empty((0, len(self.problem.goals))))

    def _point(self, outcome: Outcome) -> Point:
        """What was found, as a point of the problem: certified and simulated."""
        scales = objective_scales(self.known) if len(self.known) else None
        Z = outcome.z[None]
        points = vectors_points(
            outcome.nlp, Z, {"name": "decide", "settings": {"starts": self.terms.starts}}, self._stats(), status=[outcome.status],
            notes=[outcome.note], **certified(outcome.nlp, Z, scales),
        )  # fmt: skip
        return verified(points, self.terms.verify, scales)[0]

    def _stats(self) -> dict[str, Any]:
        counts, elapsed = self.solves.counts, time.perf_counter() - self._began
        if self._costs:
            return more_costs(self._costs, counts, elapsed - self._costs["wall_time"], self._reason())
        stopped = self._reason()
        return costs(
            counts,
            wall_time=elapsed,
            seed=self.seed,
            tolerance=self.solves.tolerance,
            reproducible=not (counts.clocked or stopped),
            **({"stopped": stopped} if stopped else {}),
        )


def stage_values(stages: Sequence[Stage], objectives: np.ndarray) -> np.ndarray:
    """Values (n, number of stages) at objectives (n, m); 0 for a stage that does not follow, since the one before is not zero."""
    columns: list[np.ndarray] = []
    for stage in stages:
        found = stage.numbers(objectives)
        follows = columns[-1] <= KEEPS if columns and stage.after_zero else np.ones(len(found), dtype=bool)
        columns.append(np.where(follows | np.isinf(found), found, 0.0))
    return np.stack(columns, axis=1)


class _Merit:
    """How good a point is among others, less is better: feasible and confirmed first, then by the stages, each as far as those before tell
    no difference."""

    def __init__(self, stages: Sequence[Stage], points: Sequence[Point]) -> None:
        self._stages = stages
        self._least: list[float] = []
        values = stage_values(stages, np.array([list(point.objectives.values()) for point in points]))
        kinds = np.array([_kind(point) for point in points])
        values = values[kinds == kinds.min()]
        for column in range(len(stages)):
            least = float(values[:, column].min())
            self._least.append(least)
            same = values[:, column] <= least + KEEPS * max(abs(least), 1.0) if np.isfinite(least) else np.ones(len(values), dtype=bool)
            values = values[same] if column + 1 < len(stages) else values

    def __call__(self, point: Point) -> tuple[float, ...]:
        J = np.array([list(point.objectives.values())])
        values = stage_values(self._stages, J)[0].tolist()
        rounded = [
            0.0 if value <= least + KEEPS * max(abs(least), 1.0) else value for value, least in zip(values, self._least, strict=True)
        ]
        excess = max(float(stage.excess(J)[0]) for stage in self._stages)
        return (float(_kind(point)), excess if excess > MET else 0.0, *rounded[:-1], values[-1])


def _kind(point: Point) -> int:
    """0: feasible, and a simulation agrees if there was one; 1: feasible; 2: neither."""
    return 2 if point.status != CONVERGED else int(point.verified is False)


def _check_start(start: Points, problem: CompiledProblem) -> None:
    """Raise ValueError if points are not of a problem."""
    if start.source is None:
        raise ValueError("start is a front of a black box, which has no derivatives; preference.rank(front) needs none")
    if start.source.fingerprint != problem.fingerprint:
        raise ValueError(f"start: these are points of another problem, '{start.source.name}', not of '{problem.name}'")


def _with_all_limits(stages: Sequence[Stage]) -> tuple[list[Stage], Stage | None]:
    """The stages, of which the first alone has all limits, each once; and a stage of which the value is their largest excess, None without
    any. A stage that keeps others has the limits of these."""
    limits: dict[str, tuple[Stage, int]] = {}
    for stage in stages:
        for k, name in enumerate(stage.limit_names):
            limits.setdefault(name, (stage, k))
    if not limits:
        return list(stages), None
    chosen = tuple(limits.values())

    def every(J: Sequence[Any]) -> list[Any]:
        found = {id(stage): stage.limits(J) for stage, _ in chosen}
        return [found[id(stage)][k] for stage, k in chosen]

    bare = [replace(stage, limits=_none, limit_names=()) for stage in stages]
    bare[0] = replace(bare[0], limits=every, limit_names=tuple(limits))
    excess = Stage(LEAST_EXCESS, _only, lambda J: [every(J)], every, tuple(limits))
    return bare, excess


def _only(J: Sequence[Any], peaks: Sequence[Any]) -> Any:
    return peaks[0]


def _none(J: Sequence[Any]) -> list[Any]:
    return []


def _meets(limits: Stage, point: Point) -> bool:
    return bool(limits.excess(np.array([list(point.objectives.values())]))[0] <= MET)


def _unmet(limits: Stage, J: np.ndarray) -> str:
    """Which limits cannot be met, by the point that exceeds them least: there, those in conflict are exceeded alike."""
    excess = limits.excesses(J[None])[0]
    worst = [name for name, one in zip(limits.limit_names, excess, strict=True) if one > 0.5 * excess.max()]
    words = " and ".join(worst)
    together = " together" if len(worst) > 1 else ""
    return f"no point was found that meets {words}{together}: the nearest exceeds {'them' if together else 'it'} by {excess.max():.2g}"
