"""One optimum on a mesh that is found: from several starts on a coarse mesh, refined by what simulation shows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from transcription import DFET
from transcription.base import NLP
from transcription.meshed import Meshed
from transcription.nlp.scalarized import Solved
from transcription.stopping import Stopped

from ..evaluation.evaluator import CONVERGED
from ..gradients.multistart import MULTISTART, MultistartSolver, MultistartStopping, is_least
from ..gradients.scalarised import WORK, Scalarised
from .mesh_loop import MeshLoop, Refinement

COARSE: tuple[Meshed, ...] = (
    DFET(8, 3),
    DFET(12, 3, basis="bernstein"),
    DFET(4, 4),
    DFET(20, 3),
    DFET(20, 3, basis="bernstein", control_order=1),
)
"""Meshes to begin on, in the order in which they are tried: where one leads nowhere, another often does."""
SECOND: Meshed = DFET(16, 3)
"""A mesh for other starts, beside that from which the optimum came: what one basis hides another may show."""
SHARE, AGAIN = 0.5, 0.5
"""What other starts on each of the two may take together, and what refining what they find may take, as shares of the work before."""
MUCH = 2e6
"""Work after which no other mesh is tried, if there is a result."""
PASSABLE = 5.0
"""How many times what is wanted a point may miss where other meshes are tried only as long as that takes little."""
HOPELESS = 2
"""Coarse meshes on which solves for feasibility from many starts find nothing feasible, after which no other is tried."""
CLEARLY, REFINED = 1e-3, 2
"""Part of its unit by which an objective on a coarse mesh differs that is another optimum; most other optima that are refined."""


@dataclass(frozen=True, eq=False)
class Found:
    """An optimum on a mesh that was found."""

    nlp: NLP  # of its mesh
    solved: Solved  # on the coarse mesh that it came from; where no solve converged, the least infeasible result
    refinement: Refinement | None  # what became of it; None where no solve on a coarse mesh converged
    behind: float = 0.0  # by how much it is worse, in units, than what another one achieved when simulated; 0 if it is not
    exhausted: bool = False
    # starts, optima, times: Solves on its coarse mesh that converged, how many different optima these found, and how often that which it
    # came from.
    starts: int = 0
    optima: int = 0
    times: int = 0

    @property
    def z(self) -> np.ndarray:
        """The vector (n,) of `nlp`."""
        return self.solved.z if self.refinement is None else self.refinement.best.z

    @property
    def status(self) -> str:
        """That of the solves on its mesh: what is refined is an optimum."""
        return self.solved.status if self.refinement is None else CONVERGED

    @property
    def good(self) -> bool:
        """Whether simulations agree with it as well as is wanted."""
        return self.refinement is not None and not self.refinement.complaints() and not self.behind

    def is_least(self, task: Scalarised) -> bool:
        """Whether bounds allow nothing better, see `multistart.is_least`."""
        return self.status == CONVERGED and is_least(self.nlp, self.z, task)

    @property
    def note(self) -> str:
        """Why it is not good, or what else is to be said of it."""
        note = f"no solve converged: {self.solved.message}" if self.refinement is None else self.refinement.note
        behind = f"it is worse by {self.behind:.1e} of its size than what another one achieved when simulated" if self.behind else ""
        exhausted = "it ended at the most work of a default call: name a transcription" if note and self.exhausted else ""
        return "; ".join(words for words in (behind, note, exhausted) if words)


def found_optimum(
    loop: MeshLoop,
    task: Scalarised,
    given: Callable[[NLP], np.ndarray | None],
    starts: int | None,
    rng: np.random.Generator,
    coarse: Sequence[Meshed] = COARSE,
) -> Found:
    """The optimum of a scalarised problem, from coarse meshes on."""
    search = _Search(loop, task)
    for method in coarse:
        try:
            nlp = loop.programs(method)
        except Stopped:
            if not search.all:
                raise
            break
        solver = MultistartSolver(nlp, given(nlp), starts or 1, rng, loop.solves)
        search.begin(method, solver, starts is None)
        search.exhausted = loop.most_work is not None and loop.work >= loop.most_work
        if search.enough:
            break
    best = search.best
    if starts is None and not (best.good and (best.times == best.starts > 1 or best.is_least(task))):
        search.elsewhere((SECOND,))
    return search.best


@dataclass(frozen=True, eq=False)
class _Attempt:
    """What came of one solve on a coarse mesh: `alpha` is its objective, `loss` that of its best mesh, and `achieved` the least that its
    simulations have for certain, in the scale of the solve, of which `unit` counts as one."""

    method: Meshed
    solver: MultistartSolver
    solved: Solved
    alpha: float
    found: Found
    census: MultistartStopping
    unit: float = 1.0
    loss: float = np.inf
    achieved: float = np.inf


_Other = tuple[float, Meshed, MultistartSolver, Solved, MultistartStopping]
"""Another optimum on a coarse mesh: by how much it is better there than the best attempt, in its units, negative; the mesh, its solver, the
result, and what the starts there have found."""


class _Search:
    """Attempts from coarse meshes, and which of them is best."""

    def __init__(self, loop: MeshLoop, task: Scalarised) -> None:
        self.loop, self.task = loop, task
        self.all: list[_Attempt] = []
        self._units = np.full(len(task.weights), np.inf)
        self.exhausted, self.hopeless = False, 0
        self._searched: set[Meshed] = set()

    def begin(self, method: Meshed, solver: MultistartSolver, elsewhere: bool) -> None:
        """Solve on a coarse mesh, also `elsewhere` if other starts were not made yet, and refine what is best; where that leads to no good
        point, also what the first start gave: an optimum that is better on a coarse mesh may be none."""
        solved = solver.solve(self.task)
        solved = best = solver.with_feasible_start(solved, self.task) if elsewhere else solved
        self.hopeless += solver.closest is not None
        census = MultistartStopping()
        census.add(self._loss(solved))
        if elsewhere and not self._searched and solved.status == CONVERGED and not solver.is_least(solved, self.task):
            self._searched.add(method)
            others = self._drawn(solver, solved, census, self.loop.work + WORK.little)
            best = min([solved, *others], key=lambda one: self.task.loss(one.F))
        self.add(method, solver, best, census)
        if best is not solved and not self.best.good and not self.loop.ended:
            self.add(method, solver, solved, census)

    def _loss(self, solved: Solved) -> float | None:
        return self.task.loss(solved.F) if solved.status == CONVERGED else None

    def _drawn(self, solver: MultistartSolver, known: Solved, census: MultistartStopping, most: float) -> list[Solved]:
        """Optima that starts that are drawn lead to on a coarse mesh, of which one is known, until there are enough, or `most` work is
        done."""
        found: list[Solved] = []
        nearby = known if known.status == CONVERGED else None
        with suppress(Stopped), self.loop.solves.at_most(MULTISTART.iterations):
            while not (census.enough or self.loop.ended or self.loop.work >= most):
                solved = solver.from_drawn(self.task, nearby)
                loss = self._loss(solved)
                nearby = solved if census.add(loss) else nearby
                found += [solved] if loss is not None else []
        return found

    def add(self, method: Meshed, solver: MultistartSolver, solved: Solved, census: MultistartStopping) -> None:
        """Refine the result of a solve on a coarse mesh, of whose starts there is a census, if it converged."""
        loop, nlp = self.loop, solver.nlp
        attempt = _Attempt(method, solver, solved, self.task.loss(solved.F), Found(nlp, solved, None), census)
        if solved.status == CONVERGED:
            # Objectives that are large only where an attempt is poor are not to be judged by that.
            self._units = units = np.minimum(self._units, loop.units(solved.F[None], nlp, solved.z))
            with suppress(Stopped):
                begun = loop.on_mesh(method, solved.z, solved.F, nlp.unpack(solved.z), units, True)
                refinement = loop.refine(begun, replace(self.task, units=units))
                attempt = self._refined(attempt, refinement, units)
        self.all.append(attempt)

    def _refined(self, attempt: _Attempt, refinement: Refinement, units: np.ndarray) -> _Attempt:
        best, task = refinement.best, self.task
        moving = task.moving
        unit = 1.0 / float(np.max((task.weights / units)[moving])) * float(np.max(task.weights[moving]))
        loss = task.loss(best.F)
        known = [] if best.achieved is None else [task.loss(best.achieved) + best.verdict.doubt * unit]
        known += [loss - refinement.worse * unit] if refinement.worse else []
        found = Found(self.loop.programs(best.method), attempt.solved, refinement)
        return replace(attempt, found=found, unit=unit, loss=loss, achieved=min(known, default=np.inf))

    @property
    def enough(self) -> bool:
        """Whether no other coarse mesh is to be tried."""
        best, work = self.best, self.loop.work
        refined = best.refinement is not None
        if not refined and self.hopeless >= HOPELESS:
            return True
        return best.good or self.loop.ended or (refined and (work >= MUCH or (work >= WORK.little and self._passable(best))))

    def _passable(self, best: Found) -> bool:
        """Whether an optimum is known to be nearly as good as is wanted, in the spans of bounds: what states do may be little of these."""
        if best.refinement is None:
            return False
        point, wanted = best.refinement.best, self.loop.wanted
        simulation, settled = point.verdict.simulation, max(point.verdict.off, point.change, best.behind) / wanted.settled
        missed = max(
            simulation.max_defect / wanted.tolerance, simulation.violation / wanted.feasible, point.verdict.excess / wanted.feasible
        )
        return max(missed, settled) <= PASSABLE and point.verdict.leaving <= wanted.leaving

    @property
    def best(self) -> Found:
        """The best of all attempts by their errors, of which one is to be worse than what another one achieved."""
        least = min(attempt.achieved for attempt in self.all)
        behind = [max((one.loss - least) / one.unit, 0.0) if np.isfinite(one.loss) and np.isfinite(least) else 0.0 for one in self.all]
        behind = [amount if amount > self.loop.wanted.settled else 0.0 for amount in behind]
        i = min(range(len(self.all)), key=lambda k: _rank(self.all[k].found, behind[k] / self.loop.wanted.settled))
        census, same = self.all[i].census, CLEARLY * self.all[i].unit
        return replace(
            self.all[i].found,
            behind=behind[i],
            exhausted=self.exhausted,
            starts=census.converged,
            optima=census.optima(same),
            times=census.hits(self.all[i].alpha, same),
        )

    def elsewhere(self, coarse: Sequence[Meshed]) -> None:
        """Begin anew from other starts on coarse meshes where that was not done yet, as long as it takes little; refine what is better
        there than the best attempt, or, where that is not good, what is different."""
        loop, best = self.loop, self.best
        first = next(attempt for attempt in self.all if attempt.solved is best.solved)
        before, others = loop.work, list[_Other]()
        for method in dict.fromkeys((first.method, *coarse)):
            if method not in self._searched:
                with suppress(Stopped):
                    others += self._others(method, first, best, before + max(SHARE * min(before, MUCH), WORK.little))
        usual, most = loop.most_work, loop.work + max(AGAIN * min(before, MUCH), WORK.little)
        loop.most_work = most if usual is None else min(most, usual)
        for _, method, solver, solved, census in sorted(others, key=lambda other: other[0])[:REFINED]:
            if not loop.ended:
                self.add(method, solver, solved, census)
        loop.most_work = usual

    def _others(self, method: Meshed, first: _Attempt, best: Found, most: float) -> list[_Other]:
        """Other optima on a coarse mesh that are worth refining."""
        loop, unit = self.loop, first.unit
        if loop.ended or loop.work >= most or best.refinement is None:
            return []
        if method == first.method:
            solver, known, census = first.solver, first.solved, first.census
        else:
            nlp, census = loop.programs(method), MultistartStopping()
            solver = MultistartSolver(nlp, None, 1, first.solver.rng, loop.solves)
            with loop.solves.at_most(MULTISTART.iterations):
                known = solver.from_vector(nlp.interpolate(best.refinement.best.trajectory), self.task)
            census.add(self._loss(known))
        alpha = self.task.loss(known.F) if known.status == CONVERGED else np.inf
        seen, found = [alpha], list[_Other]()
        for solved in self._drawn(solver, known, census, most):
            loss = self.task.loss(solved.F)
            if all(abs(loss - other) > CLEARLY * unit for other in seen):
                seen.append(loss)
                if loss < alpha or not best.good:
                    found.append(((loss - alpha) / unit, method, solver, solved, census))
        return found


def _rank(one: Found, behind: float) -> tuple[bool, float]:
    """Those that were refined first, by their errors, of which one is being behind; then the others by their violation."""
    refined = one.refinement
    return (True, one.solved.violation) if refined is None else (False, max(refined.best.error, behind))
