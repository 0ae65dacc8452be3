"""Optima with their meshes: solved on coarse meshes, refined until simulations agree, and compared with other meshes where one misleads.

This search serves all calls without a transcription: a single optimum, the ends of a front, and with these the mesh of a search. A coarse
mesh may have no feasible point, or hide the best optimum, which another mesh often shows. So no mesh decides alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem
from problems.problem import Problem
from transcription import DFET
from transcription.base import NLP, Transcription
from transcription.catalogue import stated
from transcription.meshed import Meshed
from transcription.meshes.verdict import Wanted
from transcription.nlp.scalarized import Solved
from transcription.phases.mesh import PhaseMesh
from transcription.stopping import Stopped
from transcription.trajectories.trajectory import Trajectory

from ..evaluation.evaluator import CONVERGED, Counts
from ..fronts.builders import certified, from_vectors
from ..fronts.points import Points
from ..fronts.verified import verified
from ..gradients.ends import lexicographic_ends
from ..gradients.multistart import MULTISTART, MultistartSolver, MultistartStopping, Rules, guessed_start, is_least
from ..gradients.scalarised import WORK, GradientSolves, LexicographicEnd, Scalarised
from ..io.interrupts import spending
from .mesh_loop import MeshLoop, Programs, Refinement, differentiable

COARSE: tuple[Meshed, ...] = (
    DFET(8, 3, basis="bernstein"),
    DFET(8, 3),
    DFET(12, 3, basis="bernstein"),
    DFET(4, 4),
    DFET(20, 3),
    DFET(20, 3, basis="bernstein", control_order=1),
)
"""Meshes to begin on, in the order in which they are tried: where one leads nowhere, another often does."""
FINEST: Meshed = DFET(20, 3)
"""That of these which is tried next where one has no feasible point."""


@dataclass(frozen=True)
class MeshSearchLimits:
    """Limits of the search for meshes, and tolerances of an optimum."""

    optimum: float = 0.1  # what an optimum may miss, as a part of what points may
    meshes: int = 8  # most meshes of one optimum, beside the coarse one
    share: float = 0.5  # work of other starts on another mesh, and of refining what they find, as a part of that before
    passable: float = 5.0  # error, in tolerances, with which other meshes are tried only as long as that takes little work
    hopeless: int = 2  # coarse meshes without anything feasible after which no other is tried
    infeasible: tuple[int, int] = (3, 3)  # fewest and most starts without a feasible vector on the first of these
    clearly: float = 1e-3  # part of its unit by which an objective on a coarse mesh differs that is another optimum
    starts: float = 0.4  # part of `WORK.little` that starts of an end take
    even: tuple[int, int] = (16, 40)  # fewest and most elements of the mesh for other starts
    refined: int = 2  # most other optima that are refined
    elements: int = 40  # most of a phase on a common mesh: a search evaluates it thousands of times
    near: float = 0.25  # an edge is left out if the element is then longer than the shortest there by at most this part
    lost: float = 0.1  # part of its range by which a mesh may miss a guess: on a coarser one what it says is lost
    angle: float = 2.0  # through which linear dynamics may swing on a cubic element, in radians
    guessed: tuple[int, ...] = (8, 16, 32)  # numbers of cubic elements that are considered for that


SEARCH = MeshSearchLimits()


def default_transcription(problem: Problem | CompiledProblem) -> Transcription:
    """The problem's own default, or a coarse mesh."""
    own = problem.default_transcription if isinstance(problem, Problem) else None
    return COARSE[0] if own is None else stated(own)


def coarse_meshes(problem: Problem | CompiledProblem) -> list[Meshed]:
    """Meshes to begin on, in order: fine enough for a guess and for oscillations, the problem's own, and coarse ones; edges are
    at the corners of tables."""
    own, compiled = default_transcription(problem), problem.compile()
    coarse = list(dict.fromkeys([own, *COARSE] if isinstance(own, Meshed) else COARSE))
    elements = max(guessed_elements(compiled), swinging_elements(compiled))
    if elements > coarse[0].elements:
        coarse = [DFET(elements, 3, basis="bernstein"), DFET(elements, 3), *coarse]
    cornered = [phase for phase in compiled.phases if phase.corners]
    return [method.remeshed({phase.name: _cornered(method, phase) for phase in cornered}) if cornered else method for method in coarse]


def _cornered(method: Meshed, phase: CompiledPhase) -> PhaseMesh:
    """The mesh of a phase with edges at the corners of its tables; elements between two of these are no longer than those that it has."""
    old, t0, tf = method.mesh_of(phase.name), phase.t0.lower, phase.tf.lower
    ends = np.array([t0, *phase.corners, tf])
    shares = (ends - t0) / (tf - t0)
    counts = np.ceil(np.diff(shares) * old.elements - 1e-9).astype(int)
    edges = np.interp(np.concatenate([k + np.arange(count) / count for k, count in enumerate(counts)]), np.arange(len(ends)), shares)
    return PhaseMesh((*edges.tolist(), 1.0), old.order, old.control_order)


def guessed_elements(problem: CompiledProblem) -> int:
    """The least of the considered numbers of equal elements on which cubic polynomials describe each guessed profile of a problem; the
    least number of all if no profile is guessed."""
    guesses = (guess for phase in problem.phases for guess in phase.guesses.values())
    profiles = [guess for guess in guesses if np.ndim(guess) and np.ndim(guess[0]) == 1 and len(guess[0]) > 2]
    enough = (count for count in SEARCH.guessed if all(_missed(times, values, count) <= SEARCH.lost for times, values in profiles))
    return next(enough, SEARCH.guessed[-1])


def swinging_elements(problem: CompiledProblem) -> int:
    """The least number of equal elements, up to a limit, on each of which dynamics that are linear in the states swing through no more than
    an angle that cubic polynomials describe; 0 where dynamics are not linear."""
    counts = [0]
    for phase in problem.phases:
        groups = (phase.states, phase.controls, (phase.tf,), (phase.t0, phase.tf, *problem.parameters))
        symbols = [ca.MX.sym("v", len(group)) for group in groups]
        rates = phase.dynamics(*symbols)
        if not any(ca.which_depends(rates, symbols[0], 2, True)):
            slopes = ca.Function("slopes", symbols, [ca.jacobian(rates, symbols[0])])
            matrix = np.array(slopes(*([0.5 * (v.lower + v.upper) for v in group] for group in groups)))
            turned = np.abs(np.linalg.eigvals(np.nan_to_num(matrix)).imag).max() * min(phase.duration[1], phase.tf.upper - phase.t0.lower)
            counts.append(int(min(np.ceil(turned / SEARCH.angle), SEARCH.elements)))
    return max(counts)


def _missed(times: np.ndarray, values: np.ndarray, count: int) -> float:
    """The largest difference of `count` cubic polynomials from samples, in the range of these."""
    size, nodes = float(np.ptp(values)), np.cos(np.linspace(np.pi, 0.0, 4))
    if size == 0.0:
        return 0.0
    places = np.linspace(times[0], times[-1], count + 1)
    middles, half = 0.5 * (places[:-1] + places[1:]), 0.5 * (places[1] - places[0])
    coefficients = np.interp(middles[:, None] + half * nodes, times, values) @ np.linalg.inv(np.vander(nodes)).T
    own = np.clip(np.searchsorted(places, times, side="right") - 1, 0, count - 1)
    powers = np.vander((np.asarray(times) - middles[own]) / half, len(nodes))
    return float(np.abs((coefficients[own] * powers).sum(axis=1) - values).max()) / size


@dataclass(frozen=True, eq=False)
class MeshedOptimum:
    """An optimum, and the mesh that suits it."""

    method: Meshed  # the coarse mesh that it came from
    nlp: NLP  # of its vector
    solved: Solved  # on the coarse mesh; where no solve converged, the least infeasible result
    rule: MultistartStopping  # what starts there led to
    alpha: float = np.inf  # what the solve minimised, at its result
    refinement: Refinement | None = None  # None where no solve on the coarse mesh converged
    unit: float = 1.0  # what of alpha counts as one
    loss: float = np.inf  # alpha on its best mesh
    achieved: float = np.inf  # the least alpha that its simulations have for certain
    behind: float = 0.0  # by how much it is worse, in units, than what another one achieved when simulated; 0 if it is not
    exhausted: bool = False  # whether the search ended at the most work

    @property
    def z(self) -> np.ndarray:
        """The vector (n,) of its program."""
        return self.solved.z if self.refinement is None else self.refinement.best.z

    @property
    def status(self) -> str:
        """The status of the solves on its mesh: a refined result is an optimum."""
        return self.solved.status if self.refinement is None else CONVERGED

    @property
    def good(self) -> bool:
        """Whether simulations confirm it to the wanted tolerance."""
        return self.refinement is not None and not self.refinement.complaints() and not self.behind

    def rank(self, settled: float) -> tuple[bool, float]:
        """Order: refined ones first, by their errors in tolerances, with a loss against others; then the rest by their violation."""
        if self.refinement is None:
            return True, self.solved.violation
        return False, max(self.refinement.best.error, self.behind / settled)

    def proven(self, task: Scalarised) -> bool:
        """Whether no start improves it: it is good, and the only optimum of its mesh, or the bounds allow no smaller value."""
        return self.good and (self.rule.convex or is_least(self.nlp, self.z, task))

    @property
    def agreed(self) -> bool:
        """Whether it is good, and all starts led to it."""
        return self.good and self.hits == self.rule.converged > 1

    @property
    def optima(self) -> int:
        """Number of different optima that starts on its coarse mesh found."""
        return self.rule.optima(SEARCH.clearly * self.unit)

    @property
    def hits(self) -> int:
        """How many of these starts led to it."""
        return self.rule.hits(self.alpha, SEARCH.clearly * self.unit)

    @property
    def note(self) -> str:
        """Why it is not good, or other remarks."""
        note = f"no solve converged: {self.solved.message}" if self.refinement is None else self.refinement.note
        behind = f"it is worse by {self.behind:.1e} of its size than what another one achieved when simulated" if self.behind else ""
        exhausted = "it used up the work of a call without a transcription: pass one" if note and self.exhausted else ""
        return "; ".join(words for words in (behind, note, exhausted) if words)


class TaskOptima:
    """The optima of one scalarised problem from several coarse meshes, and the best of them."""

    def __init__(self, loop: MeshLoop, task: Scalarised, end: int | None) -> None:
        self.loop, self.task, self.end = loop, task, end
        self.all: list[MeshedOptimum] = []
        self._units = np.full(len(task.weights), np.inf)

    def scaled(self, nlp: NLP, solved: Solved, ends: Sequence[np.ndarray]) -> Scalarised:
        """The task in units of the result of a solve, and of the objectives (m,) of the other `ends` of a front."""
        # Objectives that are large only where an attempt is poor are not to be judged by that.
        self._units = units = np.minimum(self._units, self.loop.units(np.array([solved.F, *ends]), nlp, solved.z))
        return replace(self.task, units=units) if self.end is None else LexicographicEnd.of(self.end, units, solved.F)

    def take(self, one: MeshedOptimum, found: Refinement | None) -> None:
        """Add an optimum, refined if it is."""
        if found is not None:
            best, loss, unit = found.best, self.task.loss(found.best.F), float(self._units[self.task.moving][0])
            known = [] if best.achieved is None else [self.task.loss(best.achieved) + best.doubt * unit]
            known += [loss - found.worse * unit] if found.worse else []
            achieved, own = min(known, default=np.inf), self.loop.programs(best.method)
            one = replace(one, nlp=own, refinement=found, unit=unit, loss=loss, achieved=achieved)
        self.all.append(one)

    @property
    def best(self) -> MeshedOptimum:
        """The best by its errors; a loss against the value that another one achieved is one of the errors."""
        least, settled = min(one.achieved for one in self.all), self.loop.wanted.settled
        behind = [max((one.loss - least) / one.unit, 0.0) if np.isfinite(one.loss) and np.isfinite(least) else 0.0 for one in self.all]
        behind = [amount if amount > settled else 0.0 for amount in behind]
        return min((replace(one, behind=amount) for one, amount in zip(self.all, behind, strict=True)), key=lambda one: one.rank(settled))


Coarse = tuple[TaskOptima, Solved, MultistartStopping, Sequence[np.ndarray], float | None]
"""A result on a coarse mesh: of which task, from starts by which rule, objectives (m,) of the other ends, and its alpha where the starts
were made; by default its own."""


def refine_together(loop: MeshLoop, method: Meshed, several: Sequence[Coarse]) -> None:
    """Refine results of solves on a coarse mesh, those that converged, side by side, and add them to their optima."""
    nlp, pieces = loop.programs(method), {}
    for k, (optima, solved, _, ends, _) in enumerate(several):
        if solved.status == CONVERGED:
            pieces[k] = (method, solved, optima.scaled(nlp, solved, ends))
    found = dict(zip(pieces, loop.each(_refined, [*pieces.values()]), strict=True))
    for k, (optima, solved, rule, _, alpha) in enumerate(several):
        optima.take(MeshedOptimum(method, nlp, solved, rule, optima.task.loss(solved.F) if alpha is None else alpha), found.get(k))


def _refined(loop: MeshLoop, method: Meshed, solved: Solved, task: Scalarised) -> Refinement:
    """The refinement of a result on a coarse mesh."""
    nlp = loop.programs(method)
    with loop.solves.within(loop.left):
        return loop.refine(loop.on_mesh(method, solved.z, solved.F, nlp.unpack(solved.z), task.units, True), task)


class MeshSearch:
    """Search for the optima of scalarised problems on suitable meshes; with `ends`, these are the ends of the problem's front."""

    def __init__(
        self,
        loop: MeshLoop,
        tasks: Sequence[Scalarised],
        given: Callable[[NLP], np.ndarray | None],
        starts: int | None,
        rng: np.random.Generator,
        ends: bool = False,
    ) -> None:
        self.loop, self.tasks = loop, [TaskOptima(loop, task, i if ends else None) for i, task in enumerate(tasks)]
        self._given, self._starts, self._rng, self._ends = given, starts, rng, ends
        self.solvers: dict[Meshed, MultistartSolver] = {}
        self._explored: list[set[Meshed]] = [set() for _ in tasks]
        self._others: list[tuple[Callable[[np.ndarray], Trajectory], list[Solved]]] = []  # what other starts on coarse meshes led to
        self.exhausted, self._hopeless, self._begun = False, 0, False

    @spending("meshes")
    def go(self, coarse: Sequence[Meshed]) -> None:
        """Solve on coarse meshes and refine the results, until all are good or another mesh does not pay; then solve from other starts."""
        left = list(coarse)
        while left:
            method = left.pop(0)
            try:
                self._begin(method)
            except Stopped:
                if not self.tasks[-1].all:
                    raise
                break
            self.exhausted = self.loop.left <= 0.0
            if self._enough:
                break
            if self._hopeless and FINEST in left:
                # A coarse mesh may have no feasible point where a finer one has.
                left.remove(FINEST)
                left.insert(0, FINEST)
        if self._starts is None and not self._ends:
            self._elsewhere(0)

    def best(self, i: int) -> MeshedOptimum:
        """The best optimum of task i."""
        return replace(self.tasks[i].best, exhausted=self.exhausted)

    @property
    def _enough(self) -> bool:
        """Whether no other coarse mesh is needed."""
        best = [optima.best for optima in self.tasks]
        if any(one.refinement is None for one in best):
            return self._hopeless >= SEARCH.hopeless or self.loop.ended
        passable = self.loop.work >= WORK.little and all(one.rank(self.loop.wanted.settled)[1] <= SEARCH.passable for one in best)
        # The points of a front get meshes of their own in the end, and other starts on another mesh anyway.
        return self._ends or all(one.good for one in best) or self.loop.ended or passable

    def _begin(self, method: Meshed) -> None:
        """Solve all tasks on a coarse mesh, from further starts if not yet done, and refine the best result; if that gives no good point,
        also the result of the first start: a better optimum on a coarse mesh may be spurious."""
        nlp = self.loop.programs(method)
        self.solvers[method] = solver = MultistartSolver(nlp, self._given(nlp), self._starts or 1, self._rng, self.loop.solves)
        first, rules = list[Solved](), list[MultistartStopping]()

        def single(i: int) -> Solved:
            optima, rule = self.tasks[i], MultistartStopping()
            tries = SEARCH.infeasible if not self._hopeless else MULTISTART.infeasible
            solved = solver.solve(optima.task) if self._starts else solver.first(optima.task, tries)
            rule.add(optima.task.optimum(solved))
            first.append(solved)
            rules.append(rule)
            if self._starts or self._explored[i] or solved.status != CONVERGED or solver.is_least(solved, optima.task):
                return solved
            self._explored[i].add(method)
            work = WORK.little * (SEARCH.starts if self._ends else 1.0)
            solved, others = solver.drawn(solved, optima.task, rule, min(work, self.loop.left))
            self._others.append((nlp.unpack, others))
            return solved

        best = lexicographic_ends(solver, single) if self._ends else [single(0)]
        self._hopeless += solver.closest is not None
        if not self._begun and any(one.status == CONVERGED for one in best):
            # What it took to find the first optima is not limited; refining them, and other meshes, are.
            self.loop.most_work, self._begun = self.loop.most_work + self.loop.work, True
        coarse = list[Coarse]()
        for optima, other, rule in zip(self.tasks, best, rules, strict=True):
            front = [end.F for end in best if self._ends and end is not other and end.status == CONVERGED]
            coarse += [] if optima.all and optima.best.good else [(optima, other, rule, front, None)]
        refine_together(self.loop, method, coarse)
        if coarse and not self._ends and best[0] is not first[0] and not self.tasks[0].best.good and not self.loop.ended:
            refine_together(self.loop, method, [(self.tasks[0], first[0], rules[0], (), None)])

    def _elsewhere(self, i: int) -> None:
        """Solve from the best optimum, other optima of the coarse mesh and other starts on an even mesh as fine as its own, if that takes
        little work, and refine results that are better than it or, if it is not good, different from it: on a coarse mesh good optima may
        be hidden among spurious ones. Where starts agree there, only from their optimum, and only if its own mesh is much finer.
        """
        loop, optima, before = self.loop, self.tasks[i], self.loop.work
        best, task, budget, found = optima.best, optima.task, max(SEARCH.share * before, WORK.little), list[Solved]()
        if best.refinement is None or loop.ended or best.proven(task):
            return
        present = best.refinement.best
        method = even(present.method)
        # On few elements there is little that a coarse mesh cannot show.
        if best.agreed and method.elements <= max(SEARCH.even[0], best.method.elements):
            return
        nlp, rule = loop.programs(method), MultistartStopping()

        def different(solved: Sequence[Solved], most: float) -> list[Solved]:
            """Those that converged, are no worse than `most` and differ from the best optimum and from each other, in their order."""
            seen, kept = [best.loss], list[Solved]()
            for one in sorted(solved, key=task.rank):
                loss = task.loss(one.F)
                if one.status == CONVERGED and loss < most and all(abs(loss - other) > SEARCH.clearly * best.unit for other in seen):
                    seen, kept = [*seen, loss], [*kept, one]
            return kept

        solver = self.solvers.setdefault(method, MultistartSolver(nlp, None, 1, self._rng, loop.solves))
        with suppress(Stopped):
            begun = [present.trajectory, *(unpack(other.z) for unpack, others in self._others for other in different(others, np.inf))]
            for trajectory in begun:
                if loop.work < before + budget and not loop.ended:
                    with loop.solves.at_most(MULTISTART.iterations):
                        found.append(solver.from_vector(nlp.interpolate(trajectory), task))
                    rule.add(task.optimum(found[-1]))
            if not best.agreed:
                found += solver.drawn(min(found, key=task.rank), task, rule, min(before + budget - loop.work, loop.left))[1]
        if rule.starts > best.rule.starts and found:
            # On the mesh from which the best came no other starts were made.
            known = best.solved
            best = replace(best, rule=rule, alpha=task.loss(found[0].F))
            optima.all = [replace(one, rule=rule, alpha=best.alpha) if one.solved is known else one for one in optima.all]
        promising = different(found, best.loss if best.good else np.inf)
        # What is known to be better is refined even if all work was done to know it.
        loop.most_work = max(loop.most_work, loop.work + budget)
        with loop.at_most(budget):
            for solved in promising[: SEARCH.refined]:
                if not loop.ended:
                    own = solved is found[0]  # the same optimum on this mesh
                    refine_together(loop, method, [(optima, solved, best.rule if own else rule, (), best.alpha if own else None)])


def even(method: Meshed) -> Meshed:
    """DFET on equal elements, as many as a method has in the phase with most of them, within limits."""
    count = max([method.elements, *(len(mesh.edges) - 1 for mesh in method.meshes.values())])
    return DFET(int(np.clip(count, *SEARCH.even)), COARSE[0].order + 1)


@dataclass(frozen=True)
class SearchMeshes:
    """The transcriptions for a problem without a stated one."""

    search: Transcription  # for the candidates of a search: cheap
    fine: Meshed | None  # a finer mesh, where one is needed for points that a simulation confirms
    counts: Counts  # what it cost to find out
    ends: Points | None = None  # the ends of the front, on meshes of their own
    rules: Rules = field(default_factory=dict)  # what starts found for each objective


def search_meshes(
    statement: Problem | CompiledProblem,
    verify: float,
    tolerance: float,
    show: Callable[[str], None] = lambda words: None,
    given: Callable[[NLP], np.ndarray | None] | None = None,
    starts: int | None = None,
) -> SearchMeshes:
    """The problem's own default transcription; without one, those found from the ends of the front, which are sought on coarse meshes and
    then on finer ones, until a simulation agrees and a finer mesh changes no more than a part of what points may miss."""
    problem = statement.compile()
    if isinstance(statement, Problem) and statement.default_transcription is not None:
        return SearchMeshes(stated(statement.default_transcription), None, Counts())
    if not differentiable(problem):
        return SearchMeshes(COARSE[0], None, Counts())
    show("ends of the front on coarse meshes")
    limits, m = SEARCH.optimum * verify, len(problem.goals)
    wanted = Wanted(limits, feasible=limits, leaving=limits, objectives=limits)
    loop = MeshLoop(Programs(problem), GradientSolves(tolerance), wanted, SEARCH.meshes, m * WORK.most)
    tasks = [Scalarised.single(i, m) for i in range(m)]
    search = MeshSearch(loop, tasks, given or guessed_start, starts, np.random.default_rng(0), ends=True)
    search.go(coarse_meshes(statement))
    return _chosen(search, limits)


def _chosen(search: MeshSearch, limits: float) -> SearchMeshes:
    """The coarse mesh of a search, that of the best ends, and the fine one, which has the elements of all meshes of these ends."""
    loop, methods, best = search.loop, list(search.solvers), [search.best(i) for i in range(len(search.tasks))]
    refined = [(one, one.refinement.best) for one in best if one.refinement is not None]
    if not refined:
        return SearchMeshes(methods[-1], None, loop.solves.counts)
    # An end that came from another mesh than the first is hidden by that.
    method = methods[max(methods.index(one.method) for one, _ in refined)]
    stats, rows = {"tolerance": loop.solves.tolerance}, []
    for point in (point for _, point in refined):
        nlp = loop.programs(point.method)
        rows.append(from_vectors(nlp, point.z[None], {}, stats, trajectories=[point.trajectory], **certified(nlp, point.z[None], None)))
    same = all(one.method == method and abs(one.loss - one.alpha) <= limits * one.unit for one, _ in refined)
    if same:
        Z = np.array([one.solved.z for one, _ in refined])
        same = bool(verified(from_vectors(search.solvers[method].nlp, Z, {}, stats, sort=False), limits).verified.all())
    fine = method if same else _common([point.method.settled(point.trajectory) for _, point in refined], loop.problem)
    rules = {i: one.rule for i, one in enumerate(best) if one.refinement is not None}
    ends = Points.concatenate(rows).replace(stats=stats)
    return SearchMeshes(method, None if fine == method else fine, loop.solves.counts, ends, rules)


def _common(methods: Sequence[Meshed], problem: CompiledProblem) -> Meshed:
    """DFET on one mesh that has the elements and degrees of several."""
    meshes = {phase.name: _together([method.mesh_of(phase.name) for method in methods], len(phase.corners)) for phase in problem.phases}
    basis = "lobatto" if all(getattr(method, "basis", "") == "lobatto" for method in methods) else "bernstein"
    return DFET(COARSE[0].elements, COARSE[0].order, basis=basis, mesh=meshes)


def _together(meshes: Sequence[PhaseMesh], corners: int = 0) -> PhaseMesh:
    """A mesh with the edges of several, without edges that would make elements shorter than in any single mesh. Its degree is one above
    theirs: points between the ends may be harder than these."""
    edges = sorted({edge for mesh in meshes for edge in mesh.edges})
    while len(edges) > 2:
        joined = np.array(edges[2:]) - np.array(edges[:-2])
        # How long the element without an edge would be, in those that the meshes have there.
        excess = joined / np.array([min(_length_at(mesh, edge) for mesh in meshes) for edge in edges[1:-1]])
        k = int(np.argmin(excess))
        if excess[k] > 1.0 + SEARCH.near and len(edges) - 1 <= SEARCH.elements + corners:
            break
        del edges[k + 1]
    orders = [mesh.control_order for mesh in meshes]
    controls = None if None in orders else max(order for order in orders if order is not None)
    return PhaseMesh(tuple(edges), 1 + max(mesh.order for mesh in meshes), controls)


def _length_at(mesh: PhaseMesh, place: float) -> float:
    """The length of the shortest element of a mesh that has a place in it or at its end."""
    edges = np.array(mesh.edges)
    touching = (edges[:-1] <= place) & (place <= edges[1:])
    return float(np.diff(edges)[touching].min())
