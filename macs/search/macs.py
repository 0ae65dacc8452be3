"""MACS: Multi-Agent Collaborative Search, its iterations and what follows the last of them."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from problems.compiled import CompiledProblem, Objective
from problems.sampling import refuse_peaks
from problems.vector import CompiledVectorProblem, without_dynamics
from transcription.base import Transcription
from transcription.catalogue import parse
from transcription.meshed import Meshed

from ..evaluation.bilevel import Bilevel
from ..evaluation.evaluator import CONVERGED, Evaluation, Evaluator
from ..evaluation.linear_models import Samples
from ..front import Front
from ..fronts.builders import best_rows
from ..gradients.front_polish import polished
from ..gradients.polish import BudgetedSolves, PolishLog, polish
from ..pareto import directions
from ..pareto.archive import Archive
from ..pareto.dominance import dominates, nondominated
from ..pareto.spread import Guide, spread
from ..refinement.mending import mended
from ..refinement.search_mesh import Chosen
from ..solvers.solver import Solver
from . import gradient_action
from .breeding import OPERATORS, breed_archive, no_credit
from .effort import Gains, credited, no_effort, spent
from .guide import PreferenceGuide, check_preference, guide_of, written
from .individual import individual_actions
from .opening import Opening, anew
from .restoration import restore
from .rounds import PLANNED, SOLVES, Rounds, judged, least
from .settings import Settings
from .social import assign, social_actions
from .state import SearchState, agents_at, remember
from .trials import Trials

log = logging.getLogger(__name__)

HOPELESS = 30
"""Candidates without a feasible point nearby after which a search that has none at all ends; solves for feasibility by which the opening
found this count as so many."""
FEWEST = 60
"""Gradient solves that a polish may always make if proposals are only propagated where that is best: solves are then what finds points."""
ITERATIONS = 50
"""Of a gradient solve, about: they are measured once it was made."""


class MACS(Settings, Solver):
    __doc__ = Settings.__doc__

    def begin(self, evaluator: Evaluator, budget: int, rng: np.random.Generator, start: np.ndarray | None = None) -> SearchState:
        """The state of a search after its first population has been sampled, evaluated and archived.

        Parameters
        ----------
        evaluator : Evaluator
        budget : int
            Number of evaluations that the evaluator may have counted at the end; never exceeded.
        rng : numpy.random.Generator
            The only source of randomness; it becomes part of the state.
        start : array (k, D), optional
            Full vectors that are evaluated first. If they are fewer than the points to sample, the rest is sampled; the best of all become
            agents.

        Returns
        -------
        SearchState

        Raises
        ------
        ValueError
            If the archive is smaller than the number of objectives, or the budget leaves nothing to evaluate.
        """
        evaluator.check_budget(budget)
        box = evaluator.box
        missing = self.points_to_sample(budget) - (0 if start is None else len(start))
        batches = [] if start is None else [np.asarray(start, dtype=float)]
        if missing > 0:
            batches.append(evaluator.first_guess(evaluator.opening(box.to_values(box.sample(missing, rng)))))
        Z = np.vstack(batches)[: budget - evaluator.counts.evaluations]
        Z[:, evaluator.free] = box.confine(Z[:, evaluator.free])
        gradients = self.refines and evaluator.has_gradients
        opening = Opening(
            evaluator, Z, 0 if start is None else len(start), gradients, self.archive if self.prefer is None else 0, budget, rng
        )
        seen = opening.population.joined(opening.optima)
        m = seen.F.shape[1]
        self.check_objectives(m)
        guide = self._checked_guide(evaluator)
        state = SearchState(
            agents=agents_at(seen, np.arange(0), len(evaluator.free), self),
            archive=Archive.of(seen, np.arange(0)),
            closest=Archive.of(seen, np.arange(0)),
            breeders=Archive.of(seen, np.arange(0)),
            outside=Archive.of(seen, np.arange(0)),
            ideal=np.full(m, np.nan),
            nadir=np.full(m, np.nan),
            directions=directions.pool(m, self.directions or 100 * m),
            experience=np.empty((0, len(evaluator.free))),
            credit=no_credit(len(OPERATORS)),
            samples=Samples.none(len(evaluator.free)),
            restored=no_credit(2),
            progress=np.zeros((2, 2)),
            effort=no_effort(len(evaluator.ways), ITERATIONS * Z.shape[1]) if gradients else no_effort(0, 0),
            iteration=0,
            evaluations=evaluator.counts.evaluations,
            optima=Archive.of(opening.optima, opening.optima.status == CONVERGED),
            alike=opening.alike,
            several=opening.several,
            rng=rng,
        )
        remember(state, [*opening.evaluations, opening.optima, opening.closest], self, evaluator)
        if len(opening.closest.F):
            state.hopeless = HOPELESS
        Z = np.vstack([Z, opening.optima.Z])
        seen = replace(seen, Z=np.where(np.isfinite(seen.Z), seen.Z, Z))  # after a failure, an agent is where its candidate was
        chosen = _choose(seen, self.agents + self.lone_agents(m, budget), evaluator.tolerance, self.exponent, guide)
        state.agents = agents_at(seen, chosen, len(evaluator.free), self)
        assign(state, self, guide)
        return state

    @property
    def searches_until_done(self) -> bool:
        """Whether a search needs no number of evaluations."""
        return True

    def begin_rounds(self, evaluator: Evaluator, rng: np.random.Generator, start: np.ndarray | None = None) -> SearchState:
        """As `begin`, of a search that ends when it is done; see `rounds`."""
        state = self.begin(evaluator, min(PLANNED, self.ceiling), rng, start)
        state.rounds = Rounds.first(len(state.ideal), least(self._polishes(evaluator))[0], self.ceiling)
        return state

    def round_end(self, state: SearchState) -> int:
        """Number of evaluations at which the current round ends."""
        assert state.rounds is not None
        return state.rounds.end

    def ended(self, state: SearchState) -> str:
        """Why a search in rounds is at its end: "done" or "ceiling"; empty as long as it goes on."""
        return "" if state.rounds is None else state.rounds.stopped

    def _polishes(self, evaluator: Evaluator) -> bool:
        return self.refines and evaluator.has_gradients

    def _checked_guide(self, evaluator: Evaluator) -> Guide | None:
        """The guide by the preference, if there is one, for objectives that are known now."""
        if self.prefer is not None:
            self.check_goals(evaluator.goals)
        return guide_of(self.prefer, evaluator)

    def advance(self, state: SearchState, evaluator: Evaluator, budget: int) -> None:
        """Do one iteration, of some tens of evaluations; changes `state`. Once the budget is spent it does nothing."""
        if state.evaluations >= budget:
            return
        self._begin_anew(state, evaluator)
        seen: list[Evaluation] = []
        for actions in (individual_actions, social_actions):
            trials = Trials(self, state, evaluator, budget)
            actions(trials)
            remember(state, trials.seen, self, evaluator, bred=False)
            seen += trials.seen
        guide = guide_of(self.prefer, evaluator)
        offspring = Trials(self, state, evaluator, budget)
        breed_archive(offspring)
        restore(Trials(self, state, evaluator, budget), [*seen, *offspring.seen])
        if self.refines and evaluator.has_gradients:
            for _ in range(gradient_action.allowed(state.evaluations, self.refine_every, state.refinements)):
                gains, before = Gains(state, evaluator.tolerance), evaluator.counts.work
                found = gradient_action.individual_action(state, evaluator, self.F, guide)
                brought = sum(gains.of(one) for one in found)
                state.effort = credited(state.effort, -1, brought, evaluator.counts.work - before, len(found))
                remember(state, found, self, evaluator)
        assign(state, self, guide)
        state.iteration += 1

    def _begin_anew(self, state: SearchState, evaluator: Evaluator) -> None:
        """Make the gradient solves from other starts with which a round begins, where the search chooses its ways."""
        rounds, chooses = state.rounds, evaluator.ways and self._polishes(evaluator)
        if rounds is None or not (chooses and len(state.archive) and isinstance(evaluator, Bilevel)):
            return
        if (count := rounds.due - rounds.anew) > 0:
            found, worse = anew(state.archive, evaluator, self.archive, count, rounds.anew, state.alike, state.rng)
            state.several, rounds.anew = state.several or worse, rounds.due
            state.learn(Archive.of(found, found.status == CONVERGED))
            remember(state, [found], self, evaluator)

    def has_settled(self, state: SearchState) -> bool:
        """See `SearchMethod.has_settled`: where solves for feasibility from many places end at violations that can get no smaller, more of
        them would take long and find nothing."""
        return not len(state.archive) and state.hopeless >= HOPELESS

    def conclude(self, state: SearchState, evaluator: Evaluator) -> None:
        """Polish the archive by gradients, if the problem has them; of a search in rounds, end the round. If asked to end early, the polish
        continues at the next call."""
        if objection := self._objection(state, evaluator):
            log.warning("the preference did not guide the search: %s", objection)
        if not self._polishes(evaluator):
            self._end_round(state, evaluator, state.archive.F)
            return
        if state.polishing is None:
            if state.rounds is not None and state.polished is not None and not state.rounds.news(state.archive.F):
                state.archive = state.polished
                self._end_round(state, evaluator, state.archive.F)
                return
            state.polishing = PolishLog.of(state.archive)
        polishing = state.polishing
        count = max(state.evaluations // self.polish_every - state.refinements, FEWEST if evaluator.ways else 0)
        if state.rounds is not None:
            count = SOLVES * self.archive
        solves = BudgetedSolves(evaluator, count, polishing, state.in_vain)
        # A later round is polished if it found something new: not all starts are alike.
        guide, alike = guide_of(self.prefer, evaluator), bool(state.alike.all()) and state.polished is None
        state.archive = polish(polishing.archive, solves, self.archive, self.exponent, guide, state.optima, alike)
        if not solves.stopped:
            state.polishing, state.polished, state.in_vain = None, state.archive, solves.failed_pairs
            solved = polishing.take(slice(None))
            state.learn(Archive.of(solved, solved.status == CONVERGED))
            found = np.vstack([polishing.archive.F, solved.F[solves.feasible(solved)], state.archive.F])
            self._end_round(state, evaluator, found)

    def _end_round(self, state: SearchState, evaluator: Evaluator, found: np.ndarray) -> None:
        """Compare what a round has found with the front as it was, and begin the next round unless the search is at its end."""
        if state.rounds is None:
            return
        agents = state.agents
        feasible = agents.F[agents.violation <= evaluator.tolerance]
        violation = float(state.closest.violation.min()) if len(state.closest) else np.inf
        numbers = (state.evaluations, evaluator.counts.work, *least(self._polishes(evaluator)), self.ceiling)
        state.rounds = judged(state.rounds, found, feasible, violation, state.directions, *numbers, state.several)
        if len(state.archive):
            state.ideal, state.nadir = np.fmin(state.ideal, state.archive.F.min(axis=0)), state.archive.F.max(axis=0)
        assign(state, self, guide_of(self.prefer, evaluator))

    @property
    def mends(self) -> bool:
        """Whether points that a simulation does not confirm are solved again."""
        return self.mesh == "mended" and self.refines

    @property
    def remeshes(self) -> bool:
        """Whether points are solved on finer meshes than that of the search."""
        return self.mends or self.mesh == "adaptive"

    def finish(self, front: Front, verify: float | None, progress: bool | None, chosen: Chosen | None = None) -> Front:
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
        if not self.mends or verify is None:
            return front.verify(verify)
        fine, ends = (None, None) if chosen is None else (chosen.fine, chosen.refined)
        return Front.of(mended(front, verify, None, progress, fine, ends, guide))

    def check_objectives(self, m: int) -> None:
        """Raise ValueError if the archive is smaller than the number m of objectives, whose best points it keeps."""
        if self.archive < m:
            raise ValueError(f"MACS: archive must have at least one point for each of the {m} objectives, not {self.archive}")

    def check_goals(self, goals: Sequence[Objective]) -> None:
        """Raise ValueError for a preference that is not one of these objectives."""
        if self.prefer is not None:
            check_preference(self.prefer, goals)

    def extra_stats(self, state: SearchState, evaluator: Evaluator) -> dict[str, Any]:
        """Where the inner level was chosen during the search, "ways" are the evaluations and the work of each. With a preference that the
        archive's ranges do not contain, "prefer" is the reason why it did not guide the search."""
        objection = self._objection(state, evaluator)
        found: dict[str, Any] = {"ways": spent(state.effort, evaluator.ways)} if len(state.effort) > 1 else {}
        found |= {} if state.rounds is None else {"rounds": state.rounds.finished}
        return found | ({"prefer": f"not followed: {objection}"} if objection else {})

    def _objection(self, state: SearchState, evaluator: Evaluator) -> str:
        """Why the preference says nothing on the archive, if that is so."""
        if self.prefer is None or not len(state.archive):
            return ""
        return PreferenceGuide(self.prefer, evaluator.goals).objection(state.archive.F)

    def about(self) -> dict[str, Any]:
        """See `SearchMethod.about`; a preference is there only if there is one."""
        settings: dict[str, Any] = asdict(replace(self, prefer=None))
        del settings["prefer"]
        given = {} if self.prefer is None else {"prefer": written(self.prefer)}
        return {"name": type(self).__name__, "settings": settings | given}

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
