"""Gradient actions: the first solves of a search, those of single agents, those of later rounds, and the polish at its end.

This module has all calls of gradient solves from the search. A solve of an agent leads from a point to the front by the scalarisation of
Pascoletti and Serafini (1984): minimise alpha subject to F - reference <= alpha weights. If the reference is the objectives of the point
itself, no objective may get worse, wherever the solve begins: such a solve is called guarded. Its result is used only if it is feasible and
no worse.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from transcription.nlp.derivatives import convex_objectives
from transcription.nlp.scalarized import Solved
from transcription.stopping import stopping

from ..evaluation.bilevel import Bilevel
from ..evaluation.evaluator import CONVERGED, Evaluation, Evaluator
from ..gradients.ends import METHODS, lexicographic_ends, proper_ends, solve_tasks, tasks_between
from ..gradients.multistart import MULTISTART, MultistartSolver, MultistartStopping, Rules, Starts, guessed_start
from ..gradients.polish import BudgetedSolves, PolishLog, polish
from ..gradients.scalarised import MOST_ITERATIONS, WORK, GradientSolves, Scalarised
from ..io.interrupts import spending
from ..io.workers import TOGETHER
from ..pareto.archive import Archive
from ..pareto.dominance import CURVE, among, extremes, feasible_and_no_worse, nearest, ranges
from ..pareto.spread import Guide
from . import social
from .settings import Settings
from .state import NO_DIRECTION, SearchState, update_archives
from .trials import Gains, give_credit


@dataclass(frozen=True)
class GradientRules:
    """How many gradient solves a search makes, and from where (measured on the catalogue's problems)."""

    first_points: int = 10  # most points of the front that are found before the search begins
    better: float = 0.05  # probability of a better optimum below which there are starts enough to begin with, if all led to one
    evaluations_per_start: int = 20  # at the beginning, one start may be drawn for so many evaluations
    flat: float = 0.05  # least component of a direction in the weights: a smaller one would leave its objective without control
    least_polish: int = 60  # solves that a polish may always make if proposals are mostly propagated: solves then find the points
    polish_per_point: int = 8  # most solves in the polish of a round, for each point that the archive may have


GRADIENT_RULES = GradientRules()


class Opening:
    """The points with which a search begins: its first population at Z (k, D) and, with gradients, the ends of the front and points between
    them.

    Where the search chooses its inner solver, the first population is only propagated, but for what the user gave: gradient solves from as
    many starts as pay find more for their work. If neither finds anything feasible, the population is projected.
    """

    def __init__(
        self, evaluator: Evaluator, Z: np.ndarray, given: int, gradients: bool, points: int, budget: int, rng: Generator, rules: Rules
    ) -> None:
        self._evaluator, self._Z, self._given, self._budget, self._rng, self._rules = evaluator, Z, given, budget, rng, rules
        self._points = min(points, GRADIENT_RULES.first_points)
        gradients = gradients and isinstance(evaluator, Bilevel)
        quick = gradients and bool(evaluator.ways)
        self.population = evaluator.evaluate(Z, 0) if quick and not given else evaluator.evaluate(Z[:given] if quick else Z)
        if quick and 0 < given < len(Z):
            self.population = self.population.joined(evaluator.evaluate(Z[given:], 0))
        self.evaluations, self.optima = [self.population], self.population.take(np.arange(0))
        self.closest, self.starts = self.optima, np.empty((0, 2))
        solver = self._solver() if quick or (gradients and not self._feasible.any()) else None
        if quick and not self._feasible.any() and not self._decided(solver) and evaluator.counts.evaluations < budget:
            self._project()
            solver = self._solver()
        if solver is not None and solver.closest is not None:
            assert isinstance(evaluator, Bilevel)
            self.closest = _evaluation([solver.closest], evaluator)
        elif solver is not None and not stopping():
            self.optima = self._solved(solver)

    @property
    def _feasible(self) -> np.ndarray:
        return self.population.violation <= self._evaluator.tolerance

    def _project(self) -> None:
        """Make the population feasible by the fixed rule, as far as the budget goes."""
        found = self._evaluator.evaluate(self._Z[: max(0, self._budget - self._evaluator.counts.evaluations)])
        rows = np.arange(len(self._Z))
        rows[: len(found.F)] += len(self._Z)
        self.population = self.population.joined(found).take(rows)
        self.evaluations.append(found)

    def _solver(self) -> MultistartSolver | None:
        """Solver that begins at the best given vector; without any, at the problem's guess, as gradient tools do; without a guess, at the
        least violated candidate. None if none is finite."""
        assert isinstance(self._evaluator, Bilevel)
        seen, given = self.population, slice(self._given)
        known = np.isfinite(seen.F).all(axis=1) & np.isfinite(seen.Z).all(axis=1)
        violation = np.where(known, seen.violation, np.inf)
        start = guessed_start(self._evaluator.nlp)
        if known[given].any():
            # As they were given: propagated states may be far from those.
            start = self._Z[given][known[given]] if self._rules else self._Z[[np.argmin(violation[given])]]
        elif start is None and known.any():
            start = seen.Z[[np.argmin(violation)]]
        if start is None:
            return None
        count = None if self._evaluator.ways else 1
        solves, most = _counted_by(self._evaluator), self._budget // GRADIENT_RULES.evaluations_per_start
        solver = MultistartSolver(self._evaluator.nlp, start, count, self._rng, solves, GRADIENT_RULES.better, most)
        solver.stopping.update({} if count else self._rules)
        return solver

    @spending("starts")
    def _decided(self, solver: MultistartSolver | None) -> bool:
        """Whether a gradient solve for the first objective ends at an optimum, or solves for feasibility find that there is none."""
        if solver is None:
            return False
        task = Scalarised.single(0, len(self._evaluator.goals))
        with solver.solves.at_most(MULTISTART.iterations):
            solved = solver.solve(task)
        return solver.with_feasible_start(solved, task).status == CONVERGED or solver.closest is not None

    def _solved(self, solver: MultistartSolver) -> Evaluation:
        """The ends of the front and a compromise between them; where the search chooses its inner solvers, points along the front instead,
        each by multistart. Fewer if asked to end early, or if solves fail."""
        # The polish improves ends, too; where few starts are worth making, long solves are not, either.
        with solver.solves.at_most(MULTISTART.iterations if solver.starts else MOST_ITERATIONS):
            first = self._single(solver, 0)
            if solver.starts and first.status != CONVERGED:
                return self.optima  # agents' own solves begin elsewhere
            surface = len(self._evaluator.goals) > CURVE
            ends, most = (proper_ends, WORK.search) if surface else (lexicographic_ends, WORK.most)
            found = ends(solver, lambda i: self._single(solver, i) if i else first, most)
            rows = [(i, loss) for i, one in solver.stopping.items() for loss in [*one.results, *[-np.inf] * one.convex]]
            self.starts = np.array(rows).reshape(-1, 2)
            if alike(self.starts, np.array([one.F for one in found])):
                solver.most = 0  # nothing else is expected between the ends, either
            if 1 < len(found) == sum(one.status == CONVERGED for one in found):
                F = np.array([one.F for one in found])
                if self._evaluator.ways:
                    found += solve_tasks(solver, tasks_between(F, ranges(F), max(self._points, len(F) + 1), METHODS[0]))
                else:
                    with spending("points between"):
                        found.append(solver.solve(Scalarised(F.min(axis=0), ranges(F))))
        assert isinstance(self._evaluator, Bilevel)
        return _feasible_of(found, self._evaluator)

    @staticmethod
    @spending("ends")
    def _single(solver: MultistartSolver, i: int) -> Solved:
        """The optimum of objective i, from other starts, too, if that known on another mesh leads to none."""
        solved = solver.single(i)
        if solved.status != CONVERGED and i in solver.stopping:
            del solver.stopping[i]
            solved = solver.single(i)
        return solved


def _rules(starts: np.ndarray, F: np.ndarray, better: float) -> list[MultistartStopping]:
    """What starts (k, 2), see `GradientMemory.starts`, say of each objective of a front (n, m)."""
    rules = [MultistartStopping(better) for _ in range(F.shape[1])]
    for rule, span in zip(rules, np.ptp(F, axis=0).tolist() if len(F) else [0.0] * len(rules), strict=True):
        rule.accuracy = MULTISTART.same * span
    for i, loss in starts.tolist():
        rules[int(i)].convex |= loss == -np.inf
        rules[int(i)].add(loss)
    return rules


def alike(starts: np.ndarray, F: np.ndarray) -> bool:
    """Whether starts enough to begin with led to one optimum of each objective."""
    return all(one.enough and one.converged and not one.several for one in _rules(starts, F, GRADIENT_RULES.better))


def unsettled(starts: np.ndarray, F: np.ndarray) -> list[int]:
    """Objectives with several optima that had not starts enough."""
    return [i for i, one in enumerate(_rules(starts, F, MULTISTART.better)) if one.several and not one.enough]


def restart_solves(
    archive: Archive, evaluator: Bilevel, points: int, count: int, drawn: int, open_ends: Sequence[int], rng: Generator
) -> tuple[Evaluation, np.ndarray]:
    """The results of `count` gradient solves from other starts, for points along the front and its ends in turn, fewer if asked to end
    early; and what ends were found from them, see `GradientMemory.starts`. Of three solves two are for `open_ends`; without any, one is for
    an end."""
    solver = MultistartSolver(evaluator.nlp, archive.Z, 1, rng, _counted_by(evaluator))
    m, ends = archive.F.shape[1], archive.F[extremes(archive.F)]
    singles = open_ends or range(m)
    between = tasks_between(ends, np.ptp(ends, axis=0), max(min(points, GRADIENT_RULES.first_points), m + 1), METHODS[0]) if m > 1 else []
    found, starts, share = list[Solved](), list[tuple[int, float]](), 2 if open_ends else 1
    while len(found) < count and not stopping():
        begun = list[tuple[np.ndarray, Scalarised]]()
        for k in range(drawn + len(found), drawn + min(len(found) + TOGETHER, count)):
            round_of_three, place = divmod(k, 3)
            inner = bool(between) and place >= share
            number = k if not between else round_of_three * (3 - share if inner else share) + place - share * inner
            turn, which = divmod(number, len(between) if inner else len(singles))
            task = between[which] if inner else Scalarised.single(singles[which], m)
            begun.append((Starts(evaluator.nlp, rng, MULTISTART.everywhere + turn + which).draw(solver.nearest(task))[0], task))
        with solver.solves.at_most(MULTISTART.iterations):
            solved = solver.from_vectors(begun)
        found += solved
        for (_, task), one in zip(begun, solved, strict=True):
            if np.count_nonzero(task.used) == 1:
                optimum = task.optimum(one)
                starts.append((int(np.argmax(task.used)), np.nan if optimum is None else optimum))
    return _feasible_of(found, evaluator), np.array(starts).reshape(-1, 2)


@spending("starts")
def begin_round(state: SearchState, settings: Settings, evaluator: Evaluator) -> None:
    """Make the gradient solves from other starts at the beginning of a round, where the search chooses its inner solver."""
    rounds = state.rounds if evaluator.has_gradients else None
    if rounds is None or not (settings.refines and isinstance(evaluator, Bilevel) and evaluator.ways and len(state.archive)):
        return
    memory, F = state.gradients, state.archive.F
    if (count := rounds.due - rounds.restarts) > 0 and not (alike(memory.starts, F) and convex_objectives(evaluator.nlp).all()):
        open_ends = unsettled(memory.starts, F)
        solved, starts = restart_solves(state.archive, evaluator, settings.archive, count, rounds.restarts, open_ends, state.rng)
        memory.starts, rounds.restarts = np.vstack([memory.starts, starts]), rounds.due
        state.add_optima(Archive.of(solved, solved.status == CONVERGED))
        update_archives(state, [solved], settings, evaluator)
        evaluator.counts.keep(among(solved.F, state.archive.F))


@spending("agents")
def gradient_actions(state: SearchState, settings: Settings, evaluator: Evaluator, guide: Guide | None) -> None:
    """Make the gradient solves of agents that are due, if the problem has derivatives."""
    if not (settings.refines and evaluator.has_gradients):
        return
    due = max(state.evaluations // settings.variant.refine_every - state.gradients.solves, 0)
    solves = [turn for _ in range(due) if (turn := _next_solve(state, evaluator, settings.variant.F, guide)) is not None]
    if not solves:
        return
    gains, before, agents, span = Gains(state, evaluator.tolerance), evaluator.counts.work, state.agents, ranges_of(state)
    found = evaluator.descend(*(np.array(part) for part in zip(*(task for _, task in solves), strict=True)))
    for k, (i, _) in enumerate(solves[: len(found.F)]):
        one = found.take(slice(k, k + 1))
        limit = agents.F[i] if agents.violation[i] <= evaluator.tolerance else np.full(agents.F.shape[1], np.inf)
        if feasible_and_no_worse(one, limit[None], agents.violation[i : i + 1], span)[0]:
            agents.place(np.array([i]), one.Z, one.F, one.violation)
            evaluator.counts.keep(1)
    give_credit(state, -1, gains.of(found), evaluator.counts.work - before, len(found.F))
    update_archives(state, [found], settings, evaluator)


def polish_archive(state: SearchState, settings: Settings, evaluator: Evaluator, guide: Guide | None) -> np.ndarray | None:
    """Polish the archive, at the end of the search or of a round, unless the round found nothing new. Returns the objectives (k, m) of all
    new points; None if the polish was asked to end early: it then continues at the next call."""
    memory, rounds = state.gradients, state.rounds
    if memory.polishing is None:
        if rounds is not None and memory.polished is not None and not rounds.has_improvement(state.archive.F):
            state.archive = memory.polished
            return state.archive.F
        memory.polishing = PolishLog.of(state.archive)
    log = memory.polishing
    if rounds is None:
        least = GRADIENT_RULES.least_polish if evaluator.ways else 0
        count = max(state.evaluations // settings.polish_every - memory.solves, least)
    else:
        count = GRADIENT_RULES.polish_per_point * settings.archive
    solves = BudgetedSolves(evaluator, count, log, memory.failed_pairs, np.inf if rounds is None else WORK.search)
    # A later round is polished if it found something new: not all starts are alike.
    same = memory.polished is None and alike(memory.starts, state.archive.F)
    exponent = settings.variant.energy_exponent
    state.archive = polish(log.archive, solves, settings.archive, exponent, guide, state.optima, same)
    evaluator.counts.kept_for += solves.results.kept_for
    if solves.stopped:
        return None
    memory.polishing, memory.polished, memory.failed_pairs = None, state.archive, solves.failed_pairs
    solved = log.take(slice(None))
    state.add_optima(Archive.of(solved, solved.status == CONVERGED))
    return np.vstack([log.archive.F, solved.F[solves.feasible(solved)], state.archive.F])


def _next_solve(
    state: SearchState, evaluator: Evaluator, F: float, guide: Guide | None
) -> tuple[int, tuple[np.ndarray, np.ndarray, np.ndarray]] | None:
    """The agent whose turn it is, and the start, reference and weights of its gradient solve, along its own direction.

    For a feasible agent the solve is guarded. Its start changes from turn to turn: the position of the agent, that of its nearest neighbour
    in the archive, or the proposal of a social action. The last two allow the agent to leave its basin of attraction. For an infeasible
    agent the solve starts at its position and makes it feasible as well.

    In the first turn, an agent whose direction is a single objective minimises that objective alone, without regard to the others: the
    archive needs the ends of the front to be spread along it. After the first turn the ends are known, and with more than two objectives
    such an agent gets a random direction. With more than two objectives, all other solves start their line at the ideal point instead of
    the agent's objectives: a surface is too large to be covered from the positions of the agents alone.
    """
    agents, m = state.agents, state.directions.shape[1]
    turn, i = divmod(state.gradients.solves, len(agents))
    state.gradients.solves += 1
    feasible = agents.violation[i] <= evaluator.tolerance
    if not np.isfinite(agents.F[i]).all():
        return None
    start = agents.Z[i].copy()
    others = np.flatnonzero((agents.F[i] != state.archive.F).any(axis=1) & feasible)
    if turn % 3 == 1 and others.size:
        start = state.archive.Z[others[nearest(agents.F[i], state.archive.F[others], ranges_of(state))[0]]]
    elif turn % 3 == 2 and feasible:
        box = evaluator.box
        pool = box.to_unit(state.archive.Z[:, evaluator.free])
        X = box.to_unit(start[evaluator.free])[None]
        start[evaluator.free] = box.to_values(social.current_to_rand(box, X, pool, max(len(pool), 4), F, state.rng)[0])
    direction = np.ones(m) if agents.direction[i] == NO_DIRECTION else state.directions[agents.direction[i]]
    if m > CURVE and turn and np.count_nonzero(direction) == 1:
        direction = state.directions[_any_inner(state, guide)]
    weights = np.where(direction > 0, ranges_of(state) / np.maximum(direction, GRADIENT_RULES.flat), 0.0)
    alone = turn == 0 and m > 1 and np.count_nonzero(direction) == 1
    reference = state.ideal if m > CURVE and len(state.archive) >= m and not (weights == 0.0).any() else agents.F[i]
    reference = np.where(direction > 0, reference, np.inf) if alone else reference
    return i, (start, reference, weights)


def _any_inner(state: SearchState, guide: Guide | None) -> int:
    """The row of a random direction that is not a single objective."""
    m, count = state.directions.shape[1], len(state.directions)
    wanted = social.direction_shares(state, guide)
    if wanted is None:
        return int(state.rng.integers(m, count))
    return int(state.rng.choice(np.arange(m, count), p=wanted[m:] / wanted[m:].sum()))


def ranges_of(state: SearchState) -> np.ndarray:
    """The `ranges` (m,) of the archive, or of the agents while the archive is empty."""
    return ranges(state.archive.F if len(state.archive) else state.agents.F[np.isfinite(state.agents.F).all(axis=1)])


def _counted_by(evaluator: Evaluator) -> GradientSolves:
    """Gradient solves that the evaluator counts, and before each of which it does its work before a batch."""
    solves = GradientSolves(evaluator.tolerance)
    solves.before, solves.counts = evaluator.before_batch, evaluator.counts
    return solves


def _feasible_of(found: list[Solved], evaluator: Bilevel) -> Evaluation:
    return _evaluation([one for one in found if one.violation <= evaluator.tolerance], evaluator)


def _evaluation(found: list[Solved], evaluator: Bilevel) -> Evaluation:
    return Evaluation(
        Z=np.array([one.z for one in found]).reshape(-1, len(evaluator.nlp.variables)),
        F=np.array([one.F for one in found]).reshape(-1, len(evaluator.goals)),
        violation=np.array([one.violation for one in found]),
        status=np.array([one.status for one in found], dtype="<U10"),
    )
