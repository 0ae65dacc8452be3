"""Gradient solves of one stage of a preference: on a given transcription, or on a mesh that is found."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from problems.compiled import CompiledProblem
from problems.valued import ObjectiveBox, Valued, valued
from transcription import from_dict
from transcription.base import NLP, Transcription
from transcription.meshed import Meshed
from transcription.meshes.verdict import Wanted
from transcription.nlp.scalarized import Solved
from transcription.stopping import Stopped

from ..evaluation.evaluator import CONVERGED, Counts
from ..fronts.builders import certified, from_vectors
from ..fronts.points import Points
from ..fronts.provenance import COUNTED_BY, costs
from ..fronts.verified import unmarked
from ..gradients.multistart import MultistartSolver
from ..gradients.scalarised import WORK, GradientSolves, Scalarised
from ..io.interrupts import spending
from ..preferences.stage import Stage, no_limits
from ..refinement.mending import resolve_unverified
from ..refinement.mesh_loop import MeshLoop, Programs
from ..refinement.mesh_search import SEARCH, MeshSearch

MINIMUM = Scalarised.single(0, 1)
"""Of a problem with one objective, which is minimised."""
WIDENINGS = 3
"""Most times that the room of an objective is made ten times as wide because its optimum is at an end of it."""
SAME_VALUE = 1e-6
"""By how much values of stages differ that are as good as each other: this part of their size, and of 1 at least."""
ONLY_NEAR = "it is not the optimum of the preference on its mesh, but near the one that was found on another"
"""Note of a point that was solved again in the objectives themselves."""


@dataclass(frozen=True, eq=False)
class StartVectors:
    """Vectors to begin at, of the problem itself on one transcription: Z (k, n), best first, and their objectives F (k, m), minimised."""

    nlp: NLP
    Z: np.ndarray
    F: np.ndarray


@dataclass(frozen=True, eq=False)
class EpigraphSolution:
    """The optimum of a stage in the derived problem: a vector z of its NLP; `first`: no stages before it are kept."""

    stage: Stage
    first: bool
    derived: Valued
    nlp: NLP
    z: np.ndarray


@dataclass(frozen=True, eq=False)
class StageSolution:
    """A stage solved: the vector z of the NLP of the problem itself, its objectives F (m,), minimised, and what is to be said of it; and
    the same in the derived problem in which it was found."""

    nlp: NLP
    z: np.ndarray
    F: np.ndarray
    status: str
    note: str = ""
    epigraph: EpigraphSolution | None = None

    @property
    def known(self) -> StartVectors:
        """Itself as a vector to begin at."""
        return StartVectors(self.nlp, self.z[None], self.F[None])


StageBound = tuple[Stage, float]
"""A stage and the value that it attained, which those after it keep."""


class StageSolver:
    """Solves stages of a preference of one problem. best, worst (m,)."""

    def __init__(
        self, problem: CompiledProblem, best: np.ndarray, worst: np.ndarray, solves: GradientSolves, rng: np.random.Generator
    ) -> None:
        self.problem, self.solves, self.rng = problem, solves, rng
        self._box = ObjectiveBox(best, worst, np.minimum(best, worst), np.maximum(best, worst))
        # By how many times their ranges objectives may leave these, and all values that are known.
        self._room = np.full(len(best), 10.0)

    @spending("stages")
    def on_mesh(self, stage: Stage, kept: Sequence[StageBound], known: StartVectors, starts: int) -> StageSolution:
        """The best result of so many starts on the transcription of the known vectors; the first are these, others are random."""
        for widened in range(WIDENINGS + 1):
            derived = self._derived(stage, kept, known)
            nlp = known.nlp.transcription.transcribe(derived.problem)
            solved = self._multistart(derived, nlp, known, starts)
            solution = self._solution(stage, not kept, derived, nlp, known.nlp, solved.z, solved.status, solved.message)
            if widened == WIDENINGS or solved.status != CONVERGED or not self._widened(derived, nlp, solved.z):
                break
            known = solution.known
        return solution

    @spending("stages")
    def on_found_mesh(
        self, stage: Stage, meshes: Sequence[Meshed], known_on: Callable[[Meshed], StartVectors], starts: int, verify: float
    ) -> StageSolution:
        """The optimum on a mesh that is found for it, from the first of these `meshes` on, where all starts are solved; the next is tried
        where that leads nowhere. `known_on` has the vectors to begin at on each."""
        limits = SEARCH.optimum * verify
        wanted = Wanted(limits, feasible=limits, leaving=limits, objectives=limits)
        for widened in range(WIDENINGS + 1):
            known = known_on(meshes[0])
            derived = self._derived(stage, (), known)
            loop = MeshLoop(Programs(derived.problem), self.solves, wanted, SEARCH.meshes, WORK.most)
            first = loop.programs(meshes[0])
            begun = self._multistart(derived, first, known, starts)

            def given(nlp: NLP, derived: Valued = derived, first: NLP = first, begun: Solved = begun) -> np.ndarray:
                if nlp is first and begun.status == CONVERGED:
                    return begun.z[None]
                one = known_on(nlp.transcription)  # type: ignore[arg-type]
                return derived.lifted(one.nlp.variables, nlp.variables, one.Z, one.F)

            search = MeshSearch(loop, [MINIMUM], given, 1, self.rng)
            search.go(meshes)
            found = search.best(0)
            own = found.nlp.transcription.transcribe(self.problem)
            solution = self._solution(stage, True, derived, found.nlp, own, found.z, found.status, found.note)
            if widened == WIDENINGS or found.status != CONVERGED or not self._widened(derived, found.nlp, found.z):
                break
        return solution

    def again(self, solution: StageSolution, verify: float) -> StageSolution:
        """A solution, solved again for the value of its stage, within hard limits, where a simulation of the derived problem does not
        confirm it: on finer meshes, or inside the limits that it exceeds; itself where that leads nowhere."""
        before = solution.epigraph
        if before is None or not before.first:
            # What stages before attained on this mesh is not what they attain on others.
            return solution
        found = self._resolved(before.nlp, before.z, solution.note, verify)
        if found is None:
            return solution
        method, z, note = found
        nlp, own = method.nlp(before.derived.problem), method.nlp(self.problem)
        return self._solution(before.stage, before.first, before.derived, nlp, own, z, CONVERGED, note)

    def nearest(self, solution: StageSolution, verify: float, known: Points) -> StageSolution:
        """A solution, solved again in the objectives themselves, from where it is on, where a simulation does not confirm it; itself where
        that leads nowhere. Objectives are judged by the ranges of known points."""
        found = self._resolved(solution.nlp, solution.z, solution.note, verify, _confirmed_ends(known).replace(problem=self.problem))
        if found is None:
            return solution
        method, z, note = found
        nlp = method.nlp(self.problem)
        return StageSolution(nlp, z, nlp.evaluate(z[None])[0][0], CONVERGED, "; ".join(filter(None, [ONLY_NEAR, note])))

    def _resolved(
        self, nlp: NLP, z: np.ndarray, note: str, verify: float, among: Points | None = None
    ) -> tuple[Transcription, np.ndarray, str] | None:
        """A converged vector, solved again as points of other gradient tools are if a simulation does not confirm it, beside confirmed
        points of a front: its transcription, the vector and its note; None where that leads nowhere. What it costs is counted."""
        about = costs(Counts(), wall_time=0.0, seed=None, tolerance=self.solves.tolerance, reproducible=True)
        point = from_vectors(nlp, z[None], {"name": "decide"}, about, status=[CONVERGED], notes=[note], **certified(nlp, z[None], None))
        found = resolve_unverified(point if among is None else unmarked(Points.concatenate([point, among])), verify)
        spent = {key: found.stats[key] for key in ("inner_iterations", "work", "charge")}
        spent |= {key: Counter(found.stats[key]) for key in COUNTED_BY}
        self.solves.counts = self.solves.counts.joined(Counts(**spent, clocked=int(not found.stats["reproducible"])))
        first, method = found[0], from_dict(found[0].transcription or {})
        if method == nlp.transcription and np.array_equal(first.decision, z):
            return None
        return method, first.decision, unmarked(found)[0].note

    def _derived(self, stage: Stage, kept: Sequence[StageBound], known: StartVectors) -> Valued:
        """The problem with the value of the stage as its objective."""
        # Vectors that are nearly feasible say where objectives may lie.
        feasible = np.isfinite(known.F).all(axis=1) & (known.nlp.evaluate(known.Z)[1] <= 1e-2)
        J = known.F[feasible] * self.problem.signs
        ends = np.vstack([self._box.best, self._box.worst, J])
        room = self._room * self._box.scales
        box = replace(self._box, lower=ends.min(axis=0) - room, upper=ends.max(axis=0) + room)
        # Without its limits: a start may exceed them.
        values = replace(stage, limits=no_limits).numbers(J)
        values = values[np.isfinite(values)]
        # The part of its size, and of 1 at least, by which later stages may exceed what a stage attained.
        limits = [(one, value + 1e-7 * max(abs(value), 1.0)) for one, value in kept]
        return valued(self.problem, stage, box, kept=limits, zero=float(values[0]) if len(values) else 0.0)

    def _widened(self, derived: Valued, nlp: NLP, z: np.ndarray) -> bool:
        """Whether objectives are at ends of ranges that the problem does not have; these are wider from now on."""
        ends = derived.at_ends(dict(zip((v.name for v in nlp.variables), z.tolist(), strict=True)))
        self._room = np.where([goal.name in ends for goal in self.problem.goals], 10.0 * self._room, self._room)
        return bool(ends)

    def _multistart(self, derived: Valued, nlp: NLP, known: StartVectors, starts: int) -> Solved:
        """The best of so many solves: from known vectors, then from random ones."""
        Z = derived.lifted(known.nlp.variables, nlp.variables, known.Z, known.F)
        solver = MultistartSolver(nlp, Z, 1, self.rng, self.solves)
        found = solver.from_vectors([(z, MINIMUM) for z in Z[:starts]])
        try:
            found += solver.from_draws([MINIMUM] * (starts - len(found)))
        except Stopped:
            if not found:
                raise
        return min(found, key=MINIMUM.rank)

    def _solution(
        self, stage: Stage, first: bool, derived: Valued, nlp: NLP, own: NLP, z: np.ndarray, status: str, note: str
    ) -> StageSolution:
        """What was found, as a vector of the problem itself."""
        own_z = own.tighten(derived.dropped(nlp.variables, own.variables, z)[None])
        return StageSolution(own, own_z[0], own.evaluate(own_z)[0][0], status, note, EpigraphSolution(stage, first, derived, nlp, z))


def _confirmed_ends(known: Points) -> Points:
    """Those confirmed points that have the least or the largest value of an objective."""
    rows = np.flatnonzero(known.verified)
    F = known.F[rows]
    return known[sorted({int(rows[k]) for k in [*F.argmin(axis=0), *F.argmax(axis=0)]} if len(rows) else [])]
