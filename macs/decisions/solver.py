"""DecisionSolver: what is known of a problem, and the gradient solves that lead from it to choices."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from typing import Any, NoReturn, TypeVar

import numpy as np

from problems.compiled import CompiledProblem
from problems.problem import Problem
from transcription.base import FAILED, Transcription, check_freedom
from transcription.catalogue import from_dict
from transcription.meshed import Meshed
from transcription.stopping import Stopped

from ..evaluation.evaluator import CONVERGED
from ..fronts.builders import CERTIFIED, certified, from_vectors, nearest_violation
from ..fronts.point import Point
from ..fronts.points import Points
from ..fronts.provenance import costs, more_costs
from ..fronts.verified import MISSES, VERIFY, objective_scales, verified
from ..gradient_tools import AUTO, Terms, payoff
from ..gradients.front_polish import KEPT_INSIDE
from ..gradients.scalarised import GradientSolves
from ..io.console import working
from ..preferences.preference import BEYOND, CONFIRMED, Preference, keeps_limits, standing, within_limits
from ..preferences.ranges import Ranges, shown
from ..preferences.stage import LIMIT_TOL, Stage, check_limits, conflict_message, exceeded, excess_stage, ordering
from ..refinement.mesh_search import coarse_meshes
from ..solvers.start import beginning
from .choice import Choice, Step
from .stages import ONLY_NEAR, SAME_VALUE, StageBound, StageSolution, StageSolver, StartVectors

NO_OPTIMUM = "it is feasible, but where a solve ended before its optimum"
"""Note of a point at which a solve failed."""
NOTHING_BETTER = "no better point was found than the best that was known"
"""Message where a known point is the choice."""
Result = TypeVar("Result")


class DecisionSolver:
    """What is known of a problem, and the solves made so far, of one call of `decide`, `satisfy` or the solver `Decide`."""

    known: Points  # the points of `start`, or of the payoff table
    ranges: Ranges  # those that were given, or of the points that are known
    _preference: Preference  # of the choice that is made, with the numbers that its steps record
    _about: Mapping[str, float]

    def __init__(
        self,
        statement: Problem | CompiledProblem,
        transcription: Transcription | None,
        ranges: Ranges | None,
        terms: Terms,
        resolves: bool = False,
    ) -> None:
        self.problem = statement.compile()
        self._resolves = (resolves or transcription is None) and terms.verify is not None
        self._statement, self._transcription, self._given, self._terms = statement, transcription, ranges, terms
        self._start: Points | None = terms.start.alone() if isinstance(terms.start, Point) else terms.start
        if self._start is not None:
            _check_start(self._start, self.problem)
        if ranges is not None:
            ranges.ends(self.problem.goals)
        self.history: list[Step] = []
        self.solves = GradientSolves(float(terms.tolerance), int(terms.max_iterations))
        self._verify = VERIFY if terms.verify is None else terms.verify
        self._seed = secrets.randbits(63) if terms.seed is None else int(terms.seed)
        self._reason: Callable[[], str] = str
        self._began, self._costs = time.perf_counter(), dict[str, Any]()

    def run(self, task: Callable[[], Result]) -> Result:
        """What a task returns for which points and ranges are known, and which Ctrl-C and the time limit ask to end."""
        with working(self._terms.time_limit, self._terms.progress, self._terms.workers) as (show, interrupts):
            self._reason = lambda: interrupts.reason
            self.solves.before = lambda: show(f"decide: {self.solves.counts.gradient_solves} gradient solves done")
            try:
                self.known = self._payoff_table() if self._start is None else self._start
            except Stopped as reason:
                self._end(str(reason))
            if not (self.known.status == CONVERGED).any():
                if self.stopped:
                    self._end(self._reason())
                if self._given is None and self.known.closest is not None:
                    raise ValueError(f"no feasible point is known, and so no ranges; {nearest_violation(self.known.closest)}")
            self.ranges = Ranges.of(self.known) if self._given is None else self._given
            best, worst = self.ranges.ends(self.problem.goals)
            self._solver = StageSolver(self.problem, best, worst, self.solves, np.random.default_rng(self._seed))
            return task()

    def _payoff_table(self) -> Points:
        # Time is limited and Ctrl-C heard around it.
        terms = replace(self._terms, seed=self._seed, time_limit=None)
        ends = payoff(self._statement, self._transcription, **asdict(terms))
        if self._resolves and self._transcription is not None:
            ends = ends.mended(progress=terms.progress)
        self._costs = dict(ends.stats)
        return ends

    @property
    def stopped(self) -> bool:
        """Whether the work is to end."""
        return bool(self._reason())

    @staticmethod
    def _end(reason: str) -> NoReturn:
        """Raise what says that there is no result."""
        words = f"decide: {reason} before the first solve"
        raise (KeyboardInterrupt(words) if reason == "interrupted" else TimeoutError(words)) from None

    def choose(
        self,
        preference: Preference,
        about: Mapping[str, float] | None = None,
        also: Sequence[Point] = (),
        stages: Sequence[Stage] | None = None,
    ) -> Choice:
        """The choice by a preference, never worse than a known point or one of `also`; `stages` may be given in place of its own.

        The point that solves lead to and those that are known are put in the order of a ranking, see `standing`; the message says what is
        to be known of the first.
        """
        self._preference, self._about = preference, about or {}
        stages = stages or preference.stages(self.problem.goals, self.ranges)
        check_limits(stages)
        limits = stages[0]
        candidates = [*also, *self._ranked()]
        try:
            new, message = self._solve(stages, candidates)
        except Stopped as reason:
            new, message = None, f"{reason}: no stage was solved to its end"
            if not candidates:
                self._end(str(reason))
        points = [*([] if new is None else [new]), *candidates]
        objectives = np.array([[*point.objectives.values()] for point in points])
        standings = np.concatenate([standing(limits, point.alone(), self._terms.verify) for point in points])
        order, values = ordering(stages, objectives, standings, same=SAME_VALUE)
        first = int(order[0])
        said = [message] if message else []
        if new is not None and points[first] is not new and not message:
            better = ordering(stages, objectives, np.zeros(len(points)), same=SAME_VALUE)[0][0] == 0
            said.append(f"a better point was found, but not confirmed: {new.note}" if better else NOTHING_BETTER)
        others = [i for i in order if standings[i] in (CONFIRMED, BEYOND)]
        said += self._messages(limits, points[first], points[first] is new, message, objectives[others[:1]])
        attained = np.nan_to_num(values[first], posinf=np.inf).tolist()
        degrees, history = self._degrees(objectives[[first]]), tuple(self.history)
        return Choice(points[first], tuple(attained), degrees, history, preference, self.ranges, "; ".join(said), self._reason())

    def _messages(self, limits: Stage, chosen: Point, is_new: bool, message: str, confirmed: np.ndarray) -> list[str]:
        """What is to be known of the chosen point beside the message of its solves; `confirmed` are the objectives (k, m) of the best point
        that a simulation confirms, if there is one."""
        goals, J, said = self.problem.goals, np.array([*chosen.objectives.values()]), []
        if not within_limits(limits, chosen) and not (message and is_new):
            said.append(f"of the best that was known, {exceeded(limits, goals, J)}" if message else conflict_message(limits, goals, J))
        if chosen.verified is False and chosen.status == CONVERGED:
            said.append(f"not confirmed by a simulation: {chosen.note}")
            if len(confirmed):
                amounts = exceeded(limits, goals, confirmed[0])
                said.append(f"no point that one confirms is within the hard limits: of the nearest, {amounts}")
        said += [words for words in (ONLY_NEAR, NO_OPTIMUM) if words in chosen.note]
        if is_new and not message and (chosen.optimality or 0.0) > CERTIFIED:
            why = f", since it is {KEPT_INSIDE}" if KEPT_INSIDE in chosen.note else ""
            said.append(f"{self._not_optimal(chosen.optimality or 0.0)}{why}")
        return said

    def _not_optimal(self, residual: float) -> str:
        """What the residual of the conditions of optimality says."""
        if not np.isfinite(residual):
            return "whether it is Pareto-optimal is not known: a derivative is no number, or its equations do not determine the states"
        each = f"by {residual:.1e} of their scales"
        if len(self.known):
            gains = zip(self.problem.goals, (residual * objective_scales(self.known)).tolist(), strict=True)
            each = ", ".join(f"'{goal.name}' by {shown(gain, goal)}" for goal, gain in gains)
        return f"not Pareto-optimal: to first order all objectives can get better together, for each span of the free variables {each}"

    def _degrees(self, J: np.ndarray) -> dict[str, float]:
        """Degrees by name at objectives (1, m)."""
        degrees = self._preference.degrees(self.problem.goals, self.ranges, J)[0]
        return dict(zip((goal.name for goal in self.problem.goals), degrees.tolist(), strict=True))

    def _ranked(self) -> list[Point]:
        """The feasible points that are known, the best first; of a `start` no more than solves begin at."""
        feasible = self.known.status == CONVERGED
        if not feasible.any():
            return []
        order = [int(i) for i in self._preference.rank(self.known, self.ranges).order if feasible[int(i)]]
        # By default solves begin at the three best of a start.
        most = len(order) if self._start is None else 3 if self._terms.starts == AUTO else int(self._terms.starts)
        chosen, verify = self.known[order[:most]], self._terms.verify
        # Compared with what is found and simulated.
        return list(chosen if chosen.was_simulated.all() or verify is None else verified(chosen, verify, objective_scales(self.known)))

    def _solve(self, stages: Sequence[Stage], candidates: Sequence[Point]) -> tuple[Point, str]:
        """The point that solves of all stages lead to, and what is to be said of it."""
        limits = stages[0]
        begun: StageSolution | None = None
        nearest: Point | None = None
        if limits.limited and not any(within_limits(limits, point) for point in candidates):
            begun = self._least_excess(limits, candidates)
            if begun.status == CONVERGED and limits.excess((begun.F * self.problem.signs)[None])[0] > LIMIT_TOL:
                nearest = self._confirmed([excess_stage(limits)], begun)
                if not within_limits(limits, nearest):
                    return nearest, conflict_message(limits, self.problem.goals, np.array([*nearest.objectives.values()]))
                # On its own mesh there is room.
                candidates, begun = [nearest, *candidates], None
        solution, message = self._solve_stages(stages, lambda stage: self._first(stage, candidates, begun))
        if solution.status != CONVERGED:
            # What is within the limits stands.
            if nearest is not None:
                return nearest, message
            solution = self._best_feasible(stages, solution, begun)
        point = self._confirmed(stages, solution)
        missed = f"; {nearest_violation(point)}" if message and point.violation > self.solves.tolerance else ""
        return point, f"{message}{missed}"

    def _best_feasible(self, stages: Sequence[Stage], failed: StageSolution, begun: StageSolution | None) -> StageSolution:
        """What stands where a solve failed: where it ended, if that is feasible and better than what was begun within the hard limits."""
        F, violation = failed.nlp.evaluate(failed.z[None])
        feasible = failed.status == FAILED and np.isfinite(F).all() and violation[0] <= self.solves.tolerance
        rivals = [replace(failed, status=CONVERGED, note=f"{failed.note}; {NO_OPTIMUM}")] if feasible else []
        rivals += [begun] if begun is not None and begun.status == CONVERGED else []
        J = np.array([one.F * self.problem.signs for one in rivals])
        return rivals[ordering(stages, J, np.zeros(len(J)), same=SAME_VALUE)[0][0]] if rivals else failed

    def _solve_stages(self, stages: Sequence[Stage], first: Callable[[Stage], StageSolution]) -> tuple[StageSolution, str]:
        """What solves of all stages lead to, each after the first on the mesh of that, and what is to be said of it."""
        solution = first(stages[0])
        attained: list[StageBound] = [(stages[0], self._record_step(stages[0], solution))]
        if solution.status != CONVERGED:
            return solution, f"{stages[0].name}: {solution.note}"
        for stage in stages[1:]:
            if stage.after_zero and attained[-1][1] > SAME_VALUE:
                break
            reached = self._solver.on_mesh(stage, attained, solution.known, 1)
            attained.append((stage, self._record_step(stage, reached)))
            if reached.status != CONVERGED:
                # What the stages before attained stands.
                return solution, f"{stage.name}: {reached.note}"
            solution = reached
        return solution, ""

    def _confirmed(self, stages: Sequence[Stage], solution: StageSolution) -> Point:
        """A solution as a point; solved again if a simulation does not confirm it, where points are solved again.

        The first stage is solved again for its value. What later ones led to, or where that is not confirmed either, is solved again in the
        objectives themselves, from where it is on; and all stages once more on the mesh which that leads to.
        """
        point = self._point(solution)
        if not self._resolves or not self._contradicted(point):
            return point
        # Asked to end in the middle of it, the point stays as it is.
        with suppress(Stopped):
            solution, point = self._resolve_value(solution, point)
            if self._contradicted(point):
                point = self._resolve_objectives(stages, solution, point)
        # With what led nowhere.
        return point.alone().replace(stats={**point.alone().stats, **self.stats()})[0]

    def _resolve_value(self, solution: StageSolution, point: Point) -> tuple[StageSolution, Point]:
        """The solution of a first stage, solved again for its value where a simulation does not confirm it."""
        again = self._solver.again(solution, self._verify) if self._contradicted(point) else solution
        if again is solution or solution.epigraph is None:
            return solution, point
        self._record_step(solution.epigraph.stage, again, _again(point))
        return again, self._point(again)

    def _resolve_objectives(self, stages: Sequence[Stage], solution: StageSolution, point: Point) -> Point:
        """A solution, solved again in its objectives, and on the mesh of that for the preference; the point itself where that leads
        nowhere, or beyond the hard limits that it keeps."""
        limits = stages[0]
        near = self._solver.nearest(solution, self._verify, self.known)
        rival = point if near is solution else self._point(near)
        if not rival.verified or (keeps_limits(limits, point, self._verify) and not keeps_limits(limits, rival, self._verify)):
            return point
        self._record_step(stages[-1] if solution.epigraph is None else solution.epigraph.stage, near, _again(point))
        steps = len(self.history)
        with suppress(Stopped):
            best, message = self._solve_stages(stages, lambda stage: self._solver.on_mesh(stage, (), near.known, 1))
            if not message:
                _, reached = self._resolve_value(best, self._point(best))
                if reached.verified:
                    return reached
        del self.history[steps:]
        return rival

    def _contradicted(self, point: Point) -> bool:
        """Whether a simulation contradicts a point, and there is time."""
        return point.verified is False and point.status == CONVERGED and not self.stopped

    def _record_step(self, stage: Stage, solution: StageSolution, words: str = "") -> float:
        """The value of a stage, of which the step becomes a part of the history."""
        J = (solution.F * self.problem.signs)[None]
        value = float(stage.numbers(J)[0])
        objectives = dict(zip((goal.name for goal in self.problem.goals), J[0].tolist(), strict=True))
        note = solution.note if solution.status != CONVERGED else words
        self.history.append(Step(stage.name, value, objectives, self._degrees(J), solution.status, dict(self._about), note))
        return value

    def _least_excess(self, limits: Stage, candidates: Sequence[Point]) -> StageSolution:
        """The least excess over the hard limits, on the first mesh."""
        known = self._known(self._meshes(candidates, None)[0], candidates, None)
        stage = excess_stage(limits)
        solution = self._solver.on_mesh(stage, (), known, self._count(known, candidates))
        self._record_step(stage, solution)
        return solution

    def _first(self, stage: Stage, candidates: Sequence[Point], begun: StageSolution | None) -> StageSolution:
        """A stage solved from what is known, or from a vector that was begun."""
        methods = self._meshes(candidates, begun)
        by_method: dict[Transcription, StartVectors] = {}

        def known_on(method: Transcription) -> StartVectors:
            if method not in by_method:
                by_method[method] = self._known(method, candidates, begun)
            return by_method[method]

        known = known_on(methods[0])
        check_freedom(known.nlp)
        count = 1 if begun is not None else self._count(known, candidates)
        if self._transcription is not None:
            return self._solver.on_mesh(stage, (), known, count)
        meshes = [method for method in methods if isinstance(method, Meshed)]
        return self._solver.on_found_mesh(stage, meshes, known_on, count, self._verify)

    def _meshes(self, candidates: Sequence[Point], begun: StageSolution | None) -> list[Transcription]:
        """The transcription that was given, or those to begin on: first that of the vector that was begun, or of the best point."""
        if self._transcription is not None:
            return [self._transcription]
        own = [from_dict(point.transcription) for point in candidates[:1] if point.transcription is not None]
        first = own if begun is None else [begun.nlp.transcription]
        usual = coarse_meshes(self._statement)
        return list(dict.fromkeys([*(method for method in first if isinstance(method, Meshed)), *usual]))

    def _count(self, known: StartVectors, candidates: Sequence[Point]) -> int:
        """Number of starts."""
        if self._terms.starts != AUTO:
            return int(self._terms.starts)
        # The guess is the last of those known.
        return max(1, len(known.Z) if self._start is None else len(candidates))

    def _known(self, method: Transcription, candidates: Sequence[Point], begun: StageSolution | None) -> StartVectors:
        """The vectors to begin at, on a transcription: candidates, best first, then the guess; or alone that which was begun."""
        if begun is not None and begun.nlp.transcription == method:
            return begun.known
        nlp = method.nlp(self.problem)
        if begun is not None:
            Z = nlp.interpolate(begun.nlp.unpack(begun.z))[None]
        else:
            rows = [*(beginning(point, nlp, guess=False) for point in candidates), beginning(None, nlp)]
            Z = np.vstack([np.empty((0, len(nlp.variables))), *(row for row in rows if row is not None)])
        return StartVectors(nlp, Z, nlp.evaluate(Z)[0] if len(Z) else np.empty((0, len(self.problem.goals))))

    def _point(self, solution: StageSolution) -> Point:
        """A solution as a point of the problem: certified and simulated."""
        scales = objective_scales(self.known) if len(self.known) else None
        points = from_vectors(
            solution.nlp,
            solution.z[None],
            {"name": "decide", "settings": {"starts": self._terms.starts}},
            self.stats(),
            status=[solution.status],
            notes=[solution.note],
            **certified(solution.nlp, solution.z[None], scales),
        )
        return verified(points, self._terms.verify, scales)[0]

    def stats(self) -> dict[str, Any]:
        """Costs so far, those of the payoff table included; the seed, and more, as of a front."""
        counts, elapsed, stopped = self.solves.counts, time.perf_counter() - self._began, self._reason()
        if self._costs:
            return more_costs(self._costs, counts, elapsed - self._costs["wall_time"], stopped)
        return costs(
            counts,
            wall_time=elapsed,
            seed=self._seed,
            tolerance=self.solves.tolerance,
            reproducible=not (counts.clocked or stopped),
            **({"stopped": stopped} if stopped else {}),
        )


def _again(point: Point) -> str:
    """Why a point was solved again."""
    return f"solved again: {'; '.join(part for part in point.note.split('; ') if part.startswith(MISSES))}"


def _check_start(start: Points, problem: CompiledProblem) -> None:
    """Raise ValueError if points are not of a problem."""
    if start.source is None:
        raise ValueError("start is a front of a black box, which has no derivatives; preference.rank(front) needs none")
    if start.source.fingerprint != problem.fingerprint:
        raise ValueError(f"start: these are points of another problem, '{start.source.name}', not of '{problem.name}'")
