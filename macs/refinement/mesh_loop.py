"""One point on one mesh after another, until independent simulations agree with it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from copy import copy
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np

from problems.compiled import CompiledProblem, remembered
from problems.sampling import objective_sizes, refuse_peaks
from transcription.base import NLP, Transcription, kept_nlp
from transcription.inner import Ipopt
from transcription.inner.base import solves_charge
from transcription.meshed import Meshed
from transcription.meshes.errors import objective_variations
from transcription.meshes.minimum import OptimumMultipliers
from transcription.meshes.moving_edges import at_switches, switched
from transcription.meshes.refinement import next_method, redistributed, where_controls_gain
from transcription.meshes.verdict import Verdict, Wanted, judge, simulated_objectives
from transcription.nlp.scalarized import Solved
from transcription.stopping import Stopped, stopping
from transcription.trajectories.tables import rough_tables
from transcription.trajectories.trajectory import Trajectory

from ..evaluation.evaluator import CONVERGED, Counts
from ..gradients.scalarised import WORK, GradientSolves, LexicographicEnd, Scalarised, Start, best_of
from ..io.interrupts import PURPOSE, spending
from ..io.workers import each
from ..pareto.dominance import objective_units, stated_scales

Result = TypeVar("Result")


@dataclass(frozen=True)
class LoopLimits:
    """When a point continues on another mesh, and how it is solved there. Units are of objectives, see `MeshLoop.units`."""

    kept: int = 3  # programs: of the meshes on which the next points are likely to be solved, too
    little: float = 1e-4  # part of what an objective varies by near a trajectory that counts as one unit of it at least
    patience: int = 3  # meshes without progress after which a point is not refined further
    progress: float = 0.5  # the error falls at least to this fraction where there is progress
    detours: int = 4  # other meshes that are tried for a point where solves fail
    blunt: float = 1e-3  # change, in units, that objectives may have which a solve determines only by the root of its accuracy
    # Where no more than this part of what other controls would gain to first order is gained, that says nothing: as on singular arcs.
    hollow: float = 0.1
    # If a point gets worse by more than this, in units of what an objective may be off, it is also sought near where it was: a solve on a
    # finer mesh may take moving edges away from the switches at which they lay.
    slip: float = 0.1
    refuted: float = 10.0  # error, in tolerances, above which a simulation clearly refutes a point; that without another mesh
    drift: float = 1e-2  # if a point gets worse by more than this, in units, other starts are tried too


LOOP = LoopLimits()
TROUBLES = {"": "its mesh cannot be refined further", CONVERGED: "finer meshes do not help"}
"""Why a point goes to no finer mesh, by the status of its last solve, if there was one."""


class Programs:
    """Cache of the latest NLPs of a problem on meshes, which take some ten megabytes each; those that a search keeps anyway are reused.

    What was `built` are the methods that were not `there` at first, each once, whichever process made its program, and how often.
    """

    def __init__(self, problem: CompiledProblem, kept: int = LOOP.kept, there: Iterable[Transcription] = ()) -> None:
        self.problem, self.sizes, self._kept = problem, dict.fromkeys(there, 0), kept
        self._made = lru_cache(kept)(lambda method: method.transcribe(problem))

    def __call__(self, method: Transcription) -> NLP:
        """The NLP of the problem on these meshes."""
        nlp: NLP = kept_nlp(self.problem, method) or self._made(method)
        self.sizes.setdefault(method, len(nlp.variables))
        return nlp

    @property
    def built(self) -> int:
        """Variables of all programs that were built."""
        return sum(self.sizes.values())

    def apart(self, sizes: Mapping[Transcription, int]) -> Programs:
        """The same programs, counted from given `sizes` on."""
        other = copy(self)
        other.sizes = dict(sizes)
        return other

    def __reduce__(self) -> tuple[Any, ...]:
        return Programs, (self.problem, self._kept)


@remembered
def latest_programs(problem: CompiledProblem) -> Programs:
    """The NLPs of the points of a front that were looked at last: those on meshes of their own have one each."""
    return Programs(problem, 2 * LOOP.kept)


@dataclass(frozen=True, eq=False)
class OnMesh:
    """A point on one mesh, and its assessment. z (n,)."""

    method: Meshed
    z: np.ndarray
    F: np.ndarray  # (m,): Objectives, all minimised
    trajectory: Trajectory
    verdict: Verdict
    by_gradients: bool  # true: a local optimum. False: a feasible point, or nothing is known.
    achieved: np.ndarray | None  # (m,): The objectives of its simulation, all minimised, where that is feasible
    doubt: float = 0.0  # by how much, in units, these may be too low, since constraints are not satisfied exactly
    change: float = np.inf  # largest change of an objective that matters from the mesh before, in units; infinite where there was none
    tried: bool = False  # whether elements were cut where other controls would gain, which changed next to nothing

    @property
    def gaining(self) -> bool:
        """Whether other controls are known to gain more than the tolerance of an objective."""
        return not self.tried and self.verdict.gain > self.verdict.wanted.gained

    @property
    def error(self) -> float:
        """The largest error, or change from the previous mesh, in units of the tolerance."""
        wanted = self.verdict.wanted
        # What no other mesh has confirmed is less wrong than what a simulation refutes.
        change = self.change if np.isfinite(self.change) else LOOP.refuted * wanted.settled
        unsettled = change / wanted.settled if wanted.confirmed else 0.0
        return max(self.verdict.error, unsettled, self.verdict.gain / wanted.gained if self.gaining else 0.0)

    def complaints(self) -> list[str]:
        """Reasons why the point is not good enough; empty if it is."""
        found = self.verdict.complaints()
        if self.gaining:
            found.append(f"other controls would gain {self.verdict.gain:.1e} of the front's range, to first order")
        if not self.verdict.wanted.confirmed:
            return found
        if np.isinf(self.change):
            found.append("it was not solved on a finer mesh")
        elif not self.change <= self.verdict.wanted.settled:
            found.append(f"its objectives still change by {self.change:.1e} of the front's range from mesh to mesh")
        return found


@dataclass(frozen=True)
class Proposal:
    """A mesh to try, whether its result counts only as an improvement, and whether the first solve stays near the present point."""

    method: Meshed
    better: bool = False
    near: bool = False


@dataclass(eq=False)
class Refinement:
    """The result of refining a point."""

    best: OnMesh  # the point on the best of its meshes: good enough if any is, else that of the least error
    trouble: str = ""  # reason why there were no finer meshes although it is not good enough
    worse: float = 0.0  # by how much it is worse, in units, than what a simulation of it on an earlier mesh achieved; 0 if it is not
    meshes: list[Meshed] = field(default_factory=list)  # those on which it was solved

    def complaints(self) -> list[str]:
        """Reasons why the point is not good enough; empty if it is."""
        found = self.best.complaints()
        if self.worse > 0.0:
            found.append(f"it is worse by {self.worse:.1e} of the front's range than what it achieved on an earlier mesh when simulated")
        return found

    @property
    def note(self) -> str:
        """The complaints and remarks about the point in one text."""
        complaints = self.complaints()
        if complaints:
            complaints.append(self.best.verdict.worst_place(self.best.method, self.best.trajectory))
            complaints += [self.trouble] if self.trouble else []
        return "; ".join([*complaints, *([self.best.verdict.remark] if self.best.verdict.unstable else [])])


@dataclass(eq=False)
class MeshLoop:
    """Solves points on one mesh after another."""

    programs: Programs
    solves: GradientSolves
    wanted: Wanted
    limit: int  # most meshes of a point
    most_work: float = np.inf  # iterations times variables
    enough: Callable[[OnMesh], bool] | None = None  # when a point is good, whatever else might be better
    more: bool = True  # whether meshes get finer; otherwise elements move only

    def __post_init__(self) -> None:
        self.problem, self._built = self.programs.problem, self.programs.built
        self._differentiable, self._stated = differentiable(self.problem), stated_scales(self.problem.goals)

    @property
    def ended(self) -> bool:
        """Whether no further mesh may begin."""
        return stopping() or self.left <= 0.0

    @property
    def left(self) -> float:
        """The work that is left, in iterations times variables."""
        return self.most_work - self.work

    @contextmanager
    def at_most(self, work: float) -> Iterator[None]:
        """Context in which at most so much more work is done."""
        usual, self.most_work = self.most_work, min(self.most_work, self.work + work)
        try:
            yield
        finally:
            self.most_work = usual

    @property
    def work(self) -> float:
        """Work so far, in iterations times variables."""
        return self.solves.counts.work + WORK.building * (self.programs.built - self._built)

    def each(self, do: Callable[..., Result], pieces: Sequence[tuple[Any, ...]], most: float = np.inf) -> list[Result | None]:
        """`do(loop, *piece)` of independent pieces side by side (`io.workers`), each with a loop of its own that may do an equal part
        of the work that is left, and at `most` so much; None of one that ended before it gave anything."""
        solves, work = self.solves, min(most, self.left / max(len(pieces), 1))
        limits = PURPOSE.get(), solves.tolerance, solves.max_iterations, self.wanted, self.limit, work, self.enough, self.more
        found = each(_alone, self.programs, [(self.programs.sizes, *limits, do, *piece) for piece in pieces])
        for _, counts, sizes in found:
            solves.counts, self.programs.sizes = solves.counts.joined(counts), self.programs.sizes | sizes
        return [one for one, *_ in found]

    @staticmethod
    def units(F: np.ndarray, nlp: NLP, z: np.ndarray) -> np.ndarray:
        """The unit of each objective (m,), see `objective_units`: at least a small part of its variation near a vector of the NLP, since
        the own size of an objective near zero is no measure."""
        quantities = [np.array(q).ravel() for q in nlp.quantities.call([z])]
        sizes = objective_sizes(nlp.problem, quantities, nlp.unpack(z).parameters)
        return objective_units([F], stated_scales(nlp.problem.goals), LOOP.little * objective_variations(nlp, z), sizes)

    def on_mesh(
        self,
        method: Meshed,
        z: np.ndarray,
        F: np.ndarray,
        trajectory: Trajectory,
        units: np.ndarray,
        by_gradients: bool,
        optimum: OptimumMultipliers | None = None,
    ) -> OnMesh:
        """The assessment of a vector that was found on a mesh."""
        verdict = judge(self.problem, trajectory, self.wanted, F, units, optimum)
        achieved = simulated_objectives(self.problem, verdict.simulation)
        feasible = verdict.simulation.violation <= self.wanted.feasible and verdict.leaving <= max(
            self.wanted.feasible, self.wanted.leaving
        )
        doubt, known = verdict.doubt, feasible and np.isfinite(achieved).all()
        if known and self._stated.any():
            # What an infeasible trajectory gains does not depend on what a user counts as one.
            doubt *= max(1.0, float((objective_variations(self.programs(method), z) / units).max()))
        return OnMesh(method, z, F, trajectory, verdict, by_gradients, achieved if known else None, doubt)

    def refine(self, begun: OnMesh, task: Scalarised, others: Sequence[Trajectory] = (), hints: Sequence[Meshed] = ()) -> Refinement:
        """A point on meshes that simulations agree with, as far as the limits allow."""
        found, seen = Refinement(begun), [begun]
        present, history, waiting, detours = begun, [begun.verdict.error], list(hints), LOOP.detours
        # Where a table is noisy, finer meshes see more of the noise.
        least, patience = _achieved(begun, task), 1 if rough_tables(self.problem, begun.trajectory) else LOOP.patience
        while len(found.meshes) < self.limit and not self.ended:
            reached, status = None, ""
            for proposal in self._proposals(present, waiting, detours > 0):
                try:
                    reached, last = self._solved(proposal, present, task, others, least)
                except Stopped:
                    # In the middle of it: the point stays on its best mesh so far.
                    break
                found.meshes.append(proposal.method)
                failed = reached is None
                if proposal.better and reached is not None and not self._improves(reached, present, task, least):
                    reached = None
                status = status or last
                if reached is not None or self.ended or not detours or len(found.meshes) >= self.limit:
                    break
                detours -= failed
            if reached is None:
                if not stopping():
                    found.trouble = TROUBLES.get(status, f"on the next finer mesh its status is '{status}'")
                break
            self.solves.counts.keep(1)
            least = min(least, _achieved(reached, task))
            present, task = reached, replace(task, known=reached.F) if isinstance(task, LexicographicEnd) else task
            seen.append(present)
            if self.enough is not None and self.enough(present):
                found.best = present
                break
            found.best = min((found.best, present), key=lambda one: (*self._doubts(one), *self._rank(one, task, least)))
            history.append(self._rank(present, task, least)[1])
            if self.enough is None and not self._rank(present, task, least)[0]:
                break
            if len(history) > patience and min(history[-patience:]) > LOOP.progress * min(history[:-patience]):
                found.trouble = TROUBLES[CONVERGED]
                break
        if self.enough is None and not self._rank(found.best, task, least)[0]:
            # Another mesh confirms it: of the meshes on which a simulation does so, too, and no less exactly, that on which it is best.
            equal = [one for one in seen if one.achieved is not None and not one.verdict.complaints() and one.doubt <= found.best.doubt]
            best, loss = min(equal, key=lambda one: task.loss(one.F), default=found.best), task.loss(found.best.F)
            if task.loss(best.F) < loss - LOOP.slip * self.wanted.settled:
                found.best = replace(best, change=loss - task.loss(best.F))
        beyond = task.loss(found.best.F) - least
        found.worse = beyond if beyond > self.wanted.settled else 0.0
        return found

    def _rank(self, one: OnMesh, task: Scalarised, least: float) -> tuple[bool, float]:
        """Whether a point has complaints, and its largest error, in units of the tolerance; a loss against the achieved value counts like
        an error of the objectives."""
        beyond = (task.loss(one.F) - least) / self.wanted.settled if self.wanted.confirmed else 0.0
        return bool(one.complaints()) or beyond > 1.0, max(one.error, beyond)

    def _doubts(self, one: OnMesh) -> tuple[bool, bool]:
        """Whether a simulation clearly refutes a point, or refutes one that no other mesh confirms; and whether none confirms it."""
        alone = self.wanted.confirmed and bool(np.isinf(one.change))
        return one.verdict.error > (LOOP.refuted if self.wanted.confirmed and not alone else 1.0), alone

    def _improves(self, reached: OnMesh, present: OnMesh, task: Scalarised, least: float) -> bool:
        """Whether to continue on a mesh with knots, or of another point: its errors are not larger, and its optimum is no worse than the
        achieved value."""
        errors = reached.verdict.error <= max(1.0, present.verdict.error)
        return errors and task.loss(reached.F) <= least + self.wanted.settled

    def _proposals(self, present: OnMesh, waiting: list[Meshed], knotted: bool) -> Iterator[Proposal]:
        """The next mesh, and alternatives if no solve converges on it."""
        seen = {present.method}
        while waiting:
            hint = waiting.pop(0)
            yield Proposal(hint, better=hint != present.method)
        if not self.more:
            yield Proposal(redistributed(present.method, self.problem, present.trajectory))
            return
        if present.gaining and not present.verdict.complaints():
            cut = where_controls_gain(present.method, present.verdict, present.trajectory)
            if cut not in seen:
                yield Proposal(cut)
        knots = switched(present.method, self.problem, present.trajectory) if knotted else None
        if knots is not None and knots not in seen:
            yield Proposal(knots, better=True)
        resting = at_switches(present.method, present.trajectory)
        begun = present.method.settled(present.trajectory) if resting is None else resting
        finer = next_method(begun, present.verdict, present.trajectory)
        if finer not in seen:
            yield Proposal(finer, near=resting is not None)
            yield from map(Proposal, finer.alternatives())

    def _solved(
        self, proposal: Proposal, present: OnMesh, task: Scalarised, others: Sequence[Trajectory], least: float
    ) -> tuple[OnMesh | None, str]:
        """The point on another mesh, None if no solve converged; and its status."""
        method = proposal.method
        nlp = self.programs(method)
        solved, by_gradients = self._from_starts(nlp, present, task, others, least, proposal.near)
        if solved.status != CONVERGED:
            return None, solved.status
        z, F = solved.z, solved.F
        optimum = None if solved.multipliers is None else OptimumMultipliers.of(nlp, z, solved.multipliers)
        reached = self.on_mesh(method, z, F, nlp.unpack(z), task.units, by_gradients, optimum)
        # On the same mesh nothing can be seen of what that has wrong.
        change = np.inf if method == present.method else _change(present, F, task, self.wanted.settled)
        tried = present.gaining and change <= LOOP.hollow * present.verdict.gain
        return replace(reached, change=change, tried=tried), solved.status

    def _from_starts(
        self, nlp: NLP, present: OnMesh, task: Scalarised, others: Sequence[Trajectory], least: float, near_first: bool
    ) -> tuple[Solved, bool]:
        """The best result of solves from the present trajectory and, if that fails or gets worse, near it (or in reverse order), then from
        other starts; and whether it is an optimum. For objectives without derivatives (a maximised peak), the feasible point nearest to the
        present one."""
        if not self._differentiable:
            return self._projected(nlp, nlp.interpolate(present.trajectory))
        bound = task.loss(present.F) if np.isinf(least) else least
        slip = min(LOOP.slip * self.wanted.settled, LOOP.drift)
        own = [(present.trajectory, near_first, slip), (present.trajectory, not near_first, LOOP.drift)]
        attempts = [*own, *((other, False, LOOP.drift) for other in others)]
        starts = (Start(nlp.interpolate(trajectory), near, drift) for trajectory, near, drift in attempts)
        return best_of(task, self.solves, nlp, starts, bound), True

    def _projected(self, nlp: NLP, start: np.ndarray) -> tuple[Solved, bool]:
        """The feasible point nearest to a vector, and that it is no optimum."""
        near = Ipopt().solve(nlp, start[None, nlp.free], start[None], tolerance=self.solves.tolerance)
        self.solves.counts.inner_iterations += int(near.iterations.sum())
        self.solves.counts.work += int(near.iterations.sum()) * len(nlp.variables)
        self.solves.counts.charge += solves_charge(nlp, 1, int(near.iterations.sum()))
        self.solves.counts.clocked += near.clocked
        return Solved(near.z[0], near.F[0], float(near.violation[0]), str(near.status[0]), int(near.iterations[0])), False


def _alone(
    programs: Programs,
    sizes: Mapping[Transcription, int],
    what: str,
    tolerance: float,
    iterations: int,
    wanted: Wanted,
    limit: int,
    work: float,
    enough: Callable[[OnMesh], bool] | None,
    more: bool,
    do: Callable[..., Result],
    *piece: Any,
) -> tuple[Result | None, Counts, dict[Transcription, int]]:
    """One piece of `MeshLoop.each`, its costs, and the sizes of all programs by then."""
    loop, found = MeshLoop(programs.apart(sizes), GradientSolves(tolerance, iterations), wanted, limit, work, enough, more), None
    with suppress(Stopped), spending(what):
        found = do(loop, *piece)
    return found, loop.solves.counts, loop.programs.sizes


def differentiable(problem: CompiledProblem) -> bool:
    """Whether gradient solves are possible: a peak that is maximised has no derivatives."""
    try:
        refuse_peaks(problem)
    except ValueError:
        return False
    return True


def _achieved(point: OnMesh, task: Scalarised) -> float:
    """The loss that the simulation of a point certainly achieves."""
    return np.inf if point.achieved is None else task.loss(point.achieved) + point.doubt


def _change(before: OnMesh, F: np.ndarray, task: Scalarised, settled: float) -> float:
    """The largest change of the used objectives, in units, from the previous mesh or from its simulation, whichever is less: the error of a
    coarse mesh is no change of the point. For objectives that are not `sharp`, a change of `LOOP.blunt` counts as one of `settled`."""
    known = [before.F] if before.achieved is None else [before.F, before.achieved]
    weights = np.where(task.sharp, 1.0, min(1.0, settled / LOOP.blunt)) / task.units
    return min(float((np.abs(F - one) * weights)[task.used].max()) for one in known)
