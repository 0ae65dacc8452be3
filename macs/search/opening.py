"""How a search begins, and begins anew: its first population and, with gradients, the ends of the front and points between them.

Where the search chooses the way of its proposals, and has gradients, the first population is only propagated, but for what the user gave:
gradient solves from as many starts as pay find more for their work. If neither finds anything feasible, the population is projected.
"""

from __future__ import annotations

import numpy as np

from transcription.nlp.scalarized import Solved
from transcription.stopping import stopping

from ..evaluation.bilevel import Bilevel
from ..evaluation.evaluator import CONVERGED, Evaluation, Evaluator
from ..gradients.ends import METHODS, lexicographic_ends, solve_tasks, tasks_between
from ..gradients.multistart import MULTISTART, MultistartSolver, Starts, alpha_of, guessed_start
from ..gradients.scalarised import GradientSolves, Scalarised
from ..pareto.archive import Archive
from ..pareto.dominance import extremes, ranges

FIRST = 10
"""Most points of the front that gradient solves find before the search begins."""
UNSEEN, EVERY = 0.1, 20
"""Probability that another start would find another optimum below which there are enough to begin with, as long as all led to one; and the
number of evaluations for each of which one start may be drawn."""
OTHER = 1e-3
"""Part of the ranges of the front by which the result of another start must be worse to be another optimum."""


class Opening:
    """The points with which a search begins. Z (k, D), alike (m,)."""

    def __init__(
        self, evaluator: Evaluator, Z: np.ndarray, given: int, gradients: bool, points: int, budget: int, rng: np.random.Generator
    ) -> None:
        self._evaluator, self._Z, self._given, self._budget, self._rng = evaluator, Z, given, budget, rng
        self._points = min(points, FIRST)
        gradients = gradients and isinstance(evaluator, Bilevel)
        quick = gradients and bool(evaluator.ways)
        self.population = evaluator.evaluate(Z, 0) if quick and not given else evaluator.evaluate(Z[:given] if quick else Z)
        if quick and 0 < given < len(Z):
            self.population = self.population.joined(evaluator.evaluate(Z[given:], 0))
        self.evaluations, self.optima = [self.population], self.population.take(np.arange(0))
        self.closest = self.optima
        self.several, self.alike = False, np.zeros(self.population.F.shape[1], dtype=bool)
        solver = self._solver() if quick or (gradients and not self._feasible.any()) else None
        if quick and not self._feasible.any() and not self._decided(solver) and evaluator.counts.evaluations < budget:
            self._project()
            solver = self._solver()
        if solver is not None and solver.closest is not None:
            assert isinstance(evaluator, Bilevel)
            self.closest = _evaluation([solver.closest], evaluator)
        elif solver is not None and not stopping():
            self.optima = self._found(solver)

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
        """Solver that begins at the best of the vectors that were given; where none were, at the problem's guess, as gradient tools do;
        without one, at the candidate that misses least. None if that is no number."""
        assert isinstance(self._evaluator, Bilevel)
        seen, given = self.population, slice(self._given)
        known = np.isfinite(seen.F).all(axis=1) & np.isfinite(seen.Z).all(axis=1)
        violation = np.where(known, seen.violation, np.inf)
        start = guessed_start(self._evaluator.nlp)
        if known[given].any():
            start = self._Z[[np.argmin(violation[given])]]  # as it was given: propagated states may be far from those
        elif start is None and known.any():
            start = seen.Z[[np.argmin(violation)]]
        if start is None:
            return None
        count = None if self._evaluator.ways else 1
        solves, most = _counted_by(self._evaluator), self._budget // EVERY
        return MultistartSolver(self._evaluator.nlp, start, count, self._rng, solves, UNSEEN, most)

    def _decided(self, solver: MultistartSolver | None) -> bool:
        """Whether a gradient solve for the first objective ends at an optimum, or solves for feasibility find that there is none."""
        if solver is None:
            return False
        task = Scalarised.single(0, len(self._evaluator.goals))
        with solver.solves.at_most(MULTISTART.iterations):
            solved = solver.solve(task)
        return solver.with_feasible_start(solved, task).status == CONVERGED or solver.closest is not None

    def _found(self, solver: MultistartSolver) -> Evaluation:
        """The ends of the front, and a compromise of them; where the search chooses its ways, points along the front instead, each from as
        many starts as pay. Fewer if asked to end early, or where none was found."""
        found = lexicographic_ends(solver)
        self.several = any(one.optima() > 1 for one in solver.stopping.values())
        for i, one in solver.stopping.items():
            self.alike[i] = one.enough and one.optima() == 1
        if self.alike.all():
            solver.most = 0  # nothing else is expected between the ends, either
        if 1 < len(found) == sum(one.status == CONVERGED for one in found):
            F = np.array([one.F for one in found])
            if self._evaluator.ways:
                found += solve_tasks(solver, tasks_between(F, ranges(F), max(self._points, len(F) + 1), METHODS[0]))
            else:
                found.append(solver.solve(Scalarised(F.min(axis=0), ranges(F))))
        assert isinstance(self._evaluator, Bilevel)
        return _feasible_of(found, self._evaluator)


def anew(
    archive: Archive, evaluator: Bilevel, points: int, count: int, drawn: int, alike: np.ndarray, rng: np.random.Generator
) -> tuple[Evaluation, bool]:
    """What `count` gradient solves from other starts find, for the ends of the front and points along it in turn; fewer if asked to end
    early. Where starts led to several optima for some objectives only, other ends are not sought. alike (m,)."""
    solver = MultistartSolver(evaluator.nlp, archive.Z, 1, rng, _counted_by(evaluator))
    m, span = archive.F.shape[1], ranges(archive.F)
    ends = archive.F[extremes(archive.F)]
    singles = [Scalarised.single(i, m) for i in range(m) if alike.all() or not alike[i]]
    between = tasks_between(ends, np.ptp(ends, axis=0), max(min(points, FIRST), m + 1), METHODS[0]) if m > 1 else []
    found, worse = [], False
    with solver.solves.at_most(MULTISTART.iterations):
        for k in range(drawn, drawn + count):
            if stopping():
                break
            # Ends are what points between them follow: two starts for these, and one for one of those, in turn.
            inner = bool(between) and k % 3 == 2
            turn, which = divmod(k // 3, len(between)) if inner else divmod(k - k // 3 if between else k, len(singles))
            task = (between if inner else singles)[which]
            start = Starts(evaluator.nlp, rng, MULTISTART.everywhere + turn + which).draw(solver.nearest(task))[0]
            found.append(solver.from_vector(start, task))
            alpha, known = alpha_of(task, found[-1]), solver.merits(task, archive.F, archive.violation).min()
            worse |= alpha is not None and bool(alpha > known + OTHER * (span / np.where(task.moving, task.weights, np.inf)).max())
    return _feasible_of(found, evaluator), worse


def _counted_by(evaluator: Evaluator) -> GradientSolves:
    """Gradient solves whose counts are the evaluator's, and before each of which it does what it does before a batch."""
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
