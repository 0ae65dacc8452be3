"""MACS: Multi-Agent Collaborative Search, the loop of its iterations and its end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from problems.compiled import CompiledProblem
from problems.peaks import refuse_peaks
from transcription.base import Meshed, Transcription
from transcription.catalogue import parse

from ..evaluation.box import box_of
from ..evaluation.evaluator import Evaluation, Evaluator
from ..front import Front
from ..gradients.polish import CountedSolves, PolishLog, polish
from ..pareto import archive as archives
from ..pareto import directions
from ..pareto.archive import Archive
from ..pareto.dominance import dominates, nondominated
from ..solvers.solver import Solver
from . import gradient_action
from .breeding import breed_archive, no_credit
from .individual import individual_actions
from .settings import Settings
from .social import assign, social_actions
from .state import SearchState, agents_at, remember
from .trials import Trials


class MACS(Settings, Solver):
    __doc__ = Settings.__doc__

    def begin(self, evaluator: Evaluator, budget: int, rng: np.random.Generator, start: np.ndarray | None = None) -> SearchState:
        """Sample, evaluate and archive the first population.

        Parameters
        ----------
        evaluator : Evaluator
        budget : int
            How many evaluations the evaluator may have counted in the end; never exceeded.
        rng : numpy.random.Generator
            The one source of chance; it becomes part of the state.
        start : array (k, D), optional
            Full vectors to begin with, evaluated first. Missing agents are sampled, and of too many the best become agents.

        Returns
        -------
        SearchState

        Raises
        ------
        ValueError
            Where the archive is smaller than the number of objectives, or the budget leaves nothing to evaluate.
        """
        if budget <= evaluator.counts.evaluations:
            raise ValueError(f"evaluations: the budget of {budget} leaves none")
        box = box_of(evaluator)
        missing = self.points_to_sample(budget) - (0 if start is None else len(start))
        batches = [] if start is None else [np.asarray(start, dtype=float)]
        if missing > 0:
            batches.append(evaluator.first_guess(evaluator.opening(box.to_values(box.sample(missing, rng)))))
        Z = np.vstack(batches)[: budget - evaluator.counts.evaluations]
        Z[:, evaluator.free] = box.confine(Z[:, evaluator.free])
        seen = evaluator.evaluate(Z)
        m = seen.F.shape[1]
        self.check_objectives(m)
        state = SearchState(
            agents=agents_at(seen, np.arange(0), len(evaluator.free), self),
            archive=Archive(seen.Z[:0], seen.F[:0], seen.violation[:0]),
            closest=Archive(seen.Z[:0], seen.F[:0], seen.violation[:0]),
            ideal=np.full(m, np.nan),
            nadir=np.full(m, np.nan),
            directions=directions.pool(m, self.directions or 100 * m),
            experience=np.empty((0, len(evaluator.free))),
            credit=no_credit(),
            iteration=0,
            evaluations=evaluator.counts.evaluations,
            rng=rng,
        )
        remember(state, [seen], self, evaluator)
        seen = replace(seen, Z=np.where(np.isfinite(seen.Z), seen.Z, Z))  # a failure may bring nothing back to start from again
        state.agents = agents_at(seen, _choose(seen, self.agents, evaluator.tolerance, self.exponent), len(evaluator.free), self)
        assign(state, self, box, evaluator)
        return state

    def advance(self, state: SearchState, evaluator: Evaluator, budget: int) -> None:
        """One iteration, of some tens of evaluations; changes `state`. With the budget spent it does nothing."""
        if state.evaluations >= budget:
            return
        box = box_of(evaluator)
        trials = Trials(self, state, evaluator, box, budget)
        individual_actions(state, self, box, trials)
        remember(state, trials.seen, self, evaluator)
        trials = Trials(self, state, evaluator, box, budget)
        social_actions(state, self, box, trials, evaluator)
        remember(state, trials.seen, self, evaluator)
        breed_archive(state, self, box, Trials(self, state, evaluator, box, budget))
        if self.refines and evaluator.has_gradients:
            for _ in range(gradient_action.allowed(state.evaluations, self.refine_every, state.refinements)):
                remember(state, gradient_action.individual_action(state, box, evaluator, self.F), self, evaluator)
        assign(state, self, box, evaluator)
        state.iteration += 1

    def conclude(self, state: SearchState, evaluator: Evaluator) -> None:
        """Polish the archive by gradients, where there are any. Asked to end early, it leaves what it has; called again, it goes on."""
        if not (self.refines and evaluator.has_gradients):
            return
        if state.polishing is None:
            state.polishing = PolishLog.of(state.archive)
        before = evaluator.counts.gradient_solves - len(state.polishing)
        solves = CountedSolves(evaluator, state.evaluations // self.polish_every - before, state.polishing)
        state.archive = polish(state.polishing.archive, solves, self.archive, self.exponent)
        if not solves.stopped:
            state.polishing = None

    def finish(self, front: Front, time_limit: float | None, progress: bool) -> Front:
        """The front polished on another transcription, or with its meshes refined, where the settings say so."""
        if self.polish_on is not None:
            solves = front.stats["evaluations"] // self.polish_every
            return front.polished(
                parse(self.polish_on),
                solves=solves,
                limit=self.archive,
                verify=self.verify,
                time_limit=time_limit,
                progress=progress,
            )
        if self.mesh == "fixed" or not len(front):
            return front
        refined = front.refine_mesh(tolerance=self.mesh_tolerance, time_limit=time_limit, progress=progress)
        # A point whose mesh is not fine enough may look too good: it does not count as dominating any.
        trusted = refined.F[[i for i, point in enumerate(refined) if not point.note]]
        return refined[np.flatnonzero(~np.any(dominates(trusted, refined.F[:, None]), axis=1))]

    def check_objectives(self, m: int) -> None:
        """Refuse an archive that could not keep the best points of all m objectives."""
        if self.archive < m:
            raise ValueError(f"MACS: archive must hold at least one point for each of the {m} objectives, not {self.archive}")

    def check_transcription(self, transcription: Transcription, problem: CompiledProblem) -> None:
        """Refuse `mesh="adaptive"` for a method whose mesh cannot be refined, and `polish_on` where gradient solves are refused."""
        if self.mesh == "adaptive" and not isinstance(transcription, Meshed):
            raise ValueError(f"MACS: mesh='adaptive' needs DFET or another method on elements, not {type(transcription).__name__}")
        if self.polish_on is not None:
            refuse_peaks(problem)

    @property
    def certifies(self) -> bool:
        """Whether the points of a front have their `optimality`."""
        return self.refines


def _choose(seen: Evaluation, count: int, tolerance: float, exponent: float | None) -> np.ndarray:
    """Rows, in order, of the points to start from: all, or of too many the best.

    Feasible ones come before infeasible ones, and these by violation; of the feasible ones those that no other dominates come first, well
    spread if they are too many, and then those that the fewest dominate.
    """
    if len(seen.F) <= count:
        return np.arange(len(seen.F))
    feasible = np.flatnonzero(seen.violation <= tolerance)
    front = feasible[nondominated(seen.F[feasible])]
    if len(front) > count:
        return front[archives.spread(seen.F[front], count, exponent=exponent)]
    worth = np.where(seen.violation <= tolerance, 0.0, seen.violation)
    dominators = [np.count_nonzero(dominates(seen.F[feasible], F)) for F in seen.F]
    return np.sort(np.lexsort((dominators, ~np.isin(np.arange(len(seen.F)), front), worth))[:count])
