"""MACS: Multi-Agent Collaborative Search, its iterations (Algorithm 1 of Ricciardi, Vasile and Maddock 2016) and its final steps."""

from __future__ import annotations

import inspect
import logging
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.random import Generator

from problems.checks import unknown
from problems.compiled import CompiledProblem, Objective
from problems.sampling import refuse_peaks
from problems.vector import CompiledVectorProblem, without_dynamics
from transcription.base import Transcription
from transcription.catalogue import parse
from transcription.meshed import Meshed

from ..evaluation.evaluator import CONVERGED, Evaluation, Evaluator
from ..front import Front
from ..fronts.builders import best_rows
from ..gradients.front_polish import polished
from ..gradients.multistart import Rules
from ..pareto import directions
from ..pareto.archive import Archive
from ..pareto.dominance import dominates, nondominated
from ..pareto.spread import Guide, spread
from ..refinement.mending import mended
from ..refinement.mesh_search import SearchMeshes
from ..solvers.solver import Solver
from .breeding import breed_archive, try_neighbours
from .gradient_actions import Opening, begin_round, gradient_actions, polish_archive, unsettled
from .guide import PreferenceGuide, check_preference, guide_of, written
from .individual import individual_actions
from .repair import repair
from .rounds import PLANNED_EVALUATIONS, Rounds, next_round
from .settings import GONE, Settings, refuse_gone
from .social import assign, social_actions
from .state import Agents, Credit, GradientMemory, ResidualSamples, SearchState, update_archives
from .trials import EVALUATIONS, FEASIBLE, WORK, Trials, initial_credit

log = logging.getLogger(__name__)

HOPELESS_CANDIDATES = 30
"""Candidates without a feasible point nearby after which a search that has none at all ends; solves for feasibility by which the opening
found this count as so many."""


class MACS(Settings, Solver):
    __doc__ = Settings.__doc__
    __signature__ = inspect.signature(Settings)
    gone = GONE

    if not TYPE_CHECKING:

        def __init__(self, *args: Any, **settings: Any) -> None:
            refuse_gone(settings)
            for name in set(settings) - {one.name for one in fields(Settings)}:
                raise TypeError(unknown("setting of MACS", name, (one.name for one in fields(Settings))))
            super().__init__(*args, **settings)

    def begin(
        self, evaluator: Evaluator, budget: int | None, rng: Generator, start: np.ndarray | None = None, rules: Rules | None = None
    ) -> SearchState:
        """The state of a search after its first population has been sampled, evaluated and archived.

        Parameters
        ----------
        evaluator : Evaluator
        budget : int or None
            Number of evaluations that the evaluator may have counted at the end; never exceeded. None: the search goes on in rounds until
            it is done, see `rounds`.
        rng : numpy.random.Generator
            The only source of randomness; it becomes part of the state.
        start : array (k, D), optional
            Full vectors that are evaluated first. If they are fewer than the points to sample, the rest is sampled; the best of all become
            agents.
        rules : mapping, optional
            What starts on another mesh found for each objective; the best of them are in `start`.

        Returns
        -------
        SearchState

        Raises
        ------
        ValueError
            If the archive is smaller than the number of objectives, or the budget leaves nothing to evaluate.
        """
        in_rounds, budget = budget is None, min(PLANNED_EVALUATIONS, self.ceiling) if budget is None else budget
        evaluator.check_budget(budget)
        given = 0 if start is None else len(start)
        Z = self._first_vectors(evaluator, budget, rng, start)
        gradients = self.refines and evaluator.has_gradients
        opening = Opening(evaluator, Z, given, gradients, self.archive if self.prefer is None else 0, budget, rng, rules or {})
        seen = opening.population.joined(opening.optima)
        m, d, none = seen.F.shape[1], len(evaluator.free), Archive.of(seen, np.arange(0))
        self.check_objectives(m)
        if self.prefer is not None:
            self.check_goals(evaluator.goals)
        guide = guide_of(self.prefer, evaluator)
        inner, spent = initial_credit(evaluator, Z.shape[1], gradients)
        state = SearchState(
            agents=Agents.at(seen, np.arange(0), d, self.variant.rho),
            archive=none,
            infeasible=none,
            optima=Archive.of(opening.optima, opening.optima.status == CONVERGED),
            ideal=np.full(m, np.nan),
            nadir=np.full(m, np.nan),
            directions=directions.pool(m, self.directions_to_draw_from(m)),
            experience=np.empty((0, d)),
            samples=ResidualSamples.none(d),
            operators=Credit.equal(2),
            repairs=Credit.equal(2),
            undirected=Credit(np.zeros(2), np.zeros(2)),
            excess=0.0,
            inner=inner,
            spent=spent,
            gradients=GradientMemory(0, opening.starts, 0),
            rng=rng,
            evaluations=evaluator.counts.evaluations,
            rounds=Rounds.first(m, gradients, self.ceiling) if in_rounds else None,
        )
        update_archives(state, [*opening.evaluations, opening.optima, opening.closest], self, evaluator)
        if len(opening.closest.F):
            state.gradients.hopeless = HOPELESS_CANDIDATES
        Z = np.vstack([Z, opening.optima.Z])
        seen = replace(seen, Z=np.where(np.isfinite(seen.Z), seen.Z, Z))  # after a failure, an agent is where its candidate was
        count = self.agents + self.undirected_agents(m, budget)
        chosen = _choose(seen, count, evaluator.tolerance, self.variant.energy_exponent, guide)
        state.agents = Agents.at(seen, chosen, d, self.variant.rho)
        assign(state, self, guide)
        return state

    def _first_vectors(self, evaluator: Evaluator, budget: int, rng: Generator, start: np.ndarray | None) -> np.ndarray:
        """Full vectors (k, D) of the first population: the given ones, then a Latin hypercube, within the budget."""
        box = evaluator.box
        missing = self.points_to_sample(budget) - (0 if start is None else len(start))
        batches = [] if start is None else [np.asarray(start, dtype=float)]
        if missing > 0:
            batches.append(evaluator.first_guess(evaluator.opening(box.to_values(box.sample(missing, rng)))))
        Z = np.vstack(batches)[: budget - evaluator.counts.evaluations]
        Z[:, evaluator.free] = box.confine(Z[:, evaluator.free])
        return Z

    def advance(self, state: SearchState, evaluator: Evaluator, budget: int) -> None:
        """Do one iteration, of some tens of evaluations; changes `state`. Once the budget is spent it does nothing."""
        if state.evaluations >= budget:
            return
        begin_round(state, self, evaluator)
        seen: list[Evaluation] = []
        for actions in (individual_actions, social_actions):
            trials = Trials(self, state, evaluator, budget)
            actions(trials)
            update_archives(state, trials.seen, self, evaluator, bred=False)
            seen += trials.seen
        offspring = Trials(self, state, evaluator, budget)
        breed_archive(offspring)
        neighbours = Trials(self, state, evaluator, budget)
        try_neighbours(neighbours)
        repair(Trials(self, state, evaluator, budget), [*seen, *offspring.seen, *neighbours.seen])
        guide = guide_of(self.prefer, evaluator)
        gradient_actions(state, self, evaluator, guide)
        assign(state, self, guide)
        state.iteration += 1

    def conclude(self, state: SearchState, evaluator: Evaluator) -> None:
        """Polish the archive by gradients, if the problem has them; of a search in rounds, end the round. If asked to end early, the polish
        continues at the next call."""
        if objection := self._objection(state, evaluator):
            log.warning("the preference did not guide the search: %s", objection)
        gradients, guide = self.refines and evaluator.has_gradients, guide_of(self.prefer, evaluator)
        found = polish_archive(state, self, evaluator, guide) if gradients else state.archive.F
        if found is None or state.rounds is None:
            return
        agents = state.agents
        state.rounds = next_round(
            state.rounds,
            found,
            agents.F[agents.violation <= evaluator.tolerance],
            float(state.closest.violation.min(initial=np.inf)),
            state.directions,
            state.evaluations,
            evaluator.counts.work,
            gradients,
            bool(unsettled(state.gradients.starts, state.archive.F)),
            self.ceiling,
        )
        if len(state.archive):
            state.ideal, state.nadir = np.fmin(state.ideal, state.archive.F.min(axis=0)), state.archive.F.max(axis=0)
        assign(state, self, guide)

    @property
    def searches_until_done(self) -> bool:
        """Whether a search needs no number of evaluations."""
        return True

    def round_end(self, state: SearchState) -> int:
        """Number of evaluations at which the current round ends."""
        assert state.rounds is not None
        return state.rounds.end

    def ended(self, state: SearchState) -> str:
        """See `SearchMethod.ended`: "settled" if feasibility solves from many places all end at local minima of the violation, since more
        of them would take long and find nothing."""
        if not len(state.archive) and state.gradients.hopeless >= HOPELESS_CANDIDATES:
            return "settled"
        return "" if state.rounds is None else state.rounds.stopped

    @property
    def remeshes(self) -> bool:
        """Whether points are solved on finer meshes than that of the search."""
        return (self.mesh == "mended" and self.refines) or self.mesh == "adaptive"

    def finish(self, front: Front, verify: float | None, progress: bool | None, chosen: SearchMeshes | None = None) -> Front:
        """The front, marked by a simulation of its points; polished on another transcription, with refined meshes, or mended, as the
        settings ask for it."""
        guide = None if self.prefer is None else PreferenceGuide(self.prefer, front.goals)
        if self.polish_on is not None:
            solves = front.stats["evaluations"] // self.polish_every
            more = polished(
                front,
                parse(self.polish_on),
                solves=solves,
                limit=self.archive,
                time_limit=None,
                verify=verify,
                progress=progress,
                guide=guide,
            )
            return Front.of(more).verify(front.stats.get("verify") if verify is None else verify)
        if self.mesh == "adaptive" and len(front):
            refined = front.refine_mesh(tolerance=self.mesh_tolerance, progress=progress).verify(verify)
            return refined[best_rows(refined)]
        if not self.remeshes or verify is None:
            return front.verify(verify)
        fine, ends = (None, None) if chosen is None else (chosen.fine, chosen.ends)
        return Front.of(mended(front, verify, None, progress, fine, ends, guide, self.archive))

    def check_objectives(self, m: int) -> None:
        """Raise ValueError if the archive is smaller than the number m of objectives, whose best points it keeps."""
        if self.archive < m:
            raise ValueError(f"MACS: archive must have at least one point for each of the {m} objectives, not {self.archive}")

    def check_goals(self, goals: Sequence[Objective]) -> None:
        """Raise ValueError for a preference that is not one of these objectives."""
        if self.prefer is not None:
            check_preference(self.prefer, goals)

    def check_transcription(self, transcription: Transcription, problem: CompiledProblem) -> None:
        """Raise ValueError for `mesh="adaptive"` with a method whose mesh cannot be refined, and for `polish_on` without gradients."""
        if self.mesh == "adaptive" and not isinstance(transcription, Meshed):
            raise ValueError(f"MACS: mesh='adaptive' needs DFET or another method on elements, not {type(transcription).__name__}")
        if self.polish_on is not None:
            refuse_peaks(problem)

    def check_vector(self, problem: CompiledVectorProblem) -> None:
        """Raise ValueError for `mesh="adaptive"` and `polish_on`: there is no mesh and nothing to polish."""
        for setting, asked in {"mesh='adaptive'": self.mesh == "adaptive", "polish_on": self.polish_on is not None}.items():
            if asked:
                raise ValueError(f"MACS: {setting} does not apply, since {without_dynamics(problem.name)}")

    def extra_stats(self, state: SearchState, evaluator: Evaluator) -> dict[str, Any]:
        """Where the inner level was chosen during the search, "ways" are the evaluations and the work of each solver. With a preference
        that the archive's ranges do not contain, "prefer" is the reason why it did not guide the search."""
        stats: dict[str, Any] = {}
        if len(state.spent):
            columns = {"evaluations": EVALUATIONS, "feasible": FEASIBLE, "work": WORK}
            ways = zip(evaluator.ways, state.spent.astype(int).tolist(), strict=False)
            stats["ways"] = {name: {what: row[k] for what, k in columns.items()} for name, row in ways}
        if state.rounds is not None:
            stats["rounds"] = state.rounds.finished
        if objection := self._objection(state, evaluator):
            stats["prefer"] = f"not followed: {objection}"
        return stats

    def _objection(self, state: SearchState, evaluator: Evaluator) -> str:
        """Why the preference says nothing on the archive, if that is so."""
        if self.prefer is None or not len(state.archive):
            return ""
        return PreferenceGuide(self.prefer, evaluator.goals).objection(state.archive.F)

    def about(self) -> dict[str, Any]:
        """See `SearchMethod.about`; with the preference, if there is one."""
        given = {} if self.prefer is None else {"prefer": written(self.prefer)}
        return {"name": type(self).__name__, "settings": self.as_data() | given}

    @property
    def certifies(self) -> bool:
        """Whether the points of its fronts get their `optimality`."""
        return self.refines


def _choose(seen: Evaluation, count: int, tolerance: float, exponent: float | None, guide: Guide | None) -> np.ndarray:
    """Rows, in increasing order, of the points that become agents: all of them, or the best `count`.

    Feasible points come before infeasible ones; infeasible ones are ordered by their violation. Of the feasible ones, the non-dominated
    come first (well spread, if they are more than `count`), then those that the fewest points dominate.
    """
    if len(seen.F) <= count:
        return np.arange(len(seen.F))
    feasible = np.flatnonzero(seen.violation <= tolerance)
    front = feasible[nondominated(seen.F[feasible])]
    if len(front) > count:
        return front[spread(seen.F[front], count, exponent=exponent, guide=guide)]
    worth = np.where(seen.violation <= tolerance, 0.0, seen.violation)
    dominators = [np.count_nonzero(dominates(seen.F[feasible], F)) for F in seen.F]
    return np.sort(np.lexsort((dominators, ~np.isin(np.arange(len(seen.F)), front), worth))[:count])
