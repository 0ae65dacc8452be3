"""Refinement by gradients: guarded, counted, certified; on an evaluator with a known front, and on trajectories."""

from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import pytest
from fronts import distance_to_curve, inverted_distance
from scipy.optimize import brentq

from macs import MACS
from macs.decisions import ReferencePoint
from macs.evaluation.bilevel import Bilevel
from macs.evaluation.evaluator import CONVERGED, FAILED, Counts, Evaluation, Evaluator, UnitBox
from macs.gradients.polish import BudgetedSolves, Surface, cover, polish
from macs.pareto.archive import Archive
from macs.pareto.directions import across, simplex_lattice
from macs.search.guide import PreferenceGuide, Region
from macs.search.settings import Variant
from macs.search.state import SearchState
from problems import load
from problems.cases import goddard, orbit_rise
from problems.compiled import Objective
from transcription import DFET
from transcription.inner import Projection
from transcription.stopping import stopped_by, stopping


class Circle(Evaluator):
    """f = (1 - x cos(y), 1 - x sin(y)): the front is the quarter of a circle at x = 1, and a solve along the weights is exact."""

    has_gradients, angles, places = True, 1, 20_001

    def __init__(self) -> None:
        size = 1 + self.angles
        self.free, self.lower, self.upper = np.arange(size), np.zeros(size), np.array([1.0] + self.angles * [np.pi / 2])
        self.period, self.tolerance, self.counts = np.zeros(size), 1e-6, Counts()
        self.grid = on_front(self.angles, self.places)

    def first_guess(self, candidates: np.ndarray) -> np.ndarray:
        return candidates.copy()

    @staticmethod
    def objectives(Z: np.ndarray) -> np.ndarray:
        return 1.0 - Z[:, :1] * np.column_stack([np.cos(Z[:, 1]), np.sin(Z[:, 1])])

    def _evaluate(self, Z: np.ndarray, way: int | None = None) -> tuple[Evaluation, int]:
        return Evaluation(Z.copy(), self.objectives(Z), np.zeros(len(Z)), np.full(len(Z), CONVERGED)), 0

    def _descend(self, starts, references, weights, margins) -> tuple[Evaluation, int]:
        rows, F = [], self.objectives(self.grid)
        for reference, weight in zip(references, weights, strict=True):
            moving, hard = (weight > 0) & (reference < np.inf), (weight == 0) & (reference < np.inf)
            alpha = ((F[:, moving] - reference[moving]) / weight[moving]).max(axis=1)
            alpha[(F[:, hard] > reference[hard] + 1e-9).any(axis=1)] = np.inf
            rows.append(self.grid[np.argmin(alpha)])
        Z = np.array(rows)
        return Evaluation(Z, self.objectives(Z), np.zeros(len(Z)), np.full(len(Z), CONVERGED)), len(Z)


class Sphere(Circle):
    """The same with three objectives: the front is the eighth of a sphere at x = 1."""

    angles, places = 2, 101

    @staticmethod
    def objectives(Z: np.ndarray) -> np.ndarray:
        x, a, b = Z.T
        return 1.0 - x[:, None] * np.column_stack([np.cos(a) * np.cos(b), np.cos(a) * np.sin(b), np.sin(a)])


def on_front(angles: int, count: int) -> np.ndarray:
    """Decisions (count**angles, 1 + angles) all over the front."""
    axes = np.meshgrid(*angles * [np.linspace(0.0, np.pi / 2, count)], indexing="ij")
    return np.column_stack([np.ones(count**angles), *(axis.ravel() for axis in axes)])


def state_of(evaluator: Circle, Z: np.ndarray) -> SearchState:
    state = MACS(agents=3).begin(evaluator, 3, np.random.default_rng(0))
    state.archive = Archive(Z, evaluator.objectives(Z), np.zeros(len(Z)))
    return state


def test_a_polished_archive_lies_on_the_front_with_its_ends_and_evenly() -> None:
    evaluator = Circle()
    rng = np.random.default_rng(1)
    Z = np.column_stack([rng.uniform(0.8, 0.9, 10), np.sort(rng.uniform(0.2, 1.3, 10))])
    state = state_of(evaluator, Z)
    archive = polish(state.archive, BudgetedSolves(evaluator, 10_000), 10)
    assert len(archive) == 10 and archive.Z[:, 0] == pytest.approx(1.0)
    angles = np.sort(archive.Z[:, 1])
    assert angles[[0, -1]] == pytest.approx([0.0, np.pi / 2], abs=1e-3)
    assert np.diff(angles).max() < 1.5 * np.diff(angles).min()
    evaluator = Circle()
    rng = np.random.default_rng(1)
    state = state_of(evaluator, np.column_stack([rng.uniform(0.8, 0.9, 30), np.linspace(0.7, 0.8, 30)]))
    state.archive = polish(state.archive, BudgetedSolves(evaluator, 20), 30)
    angles = np.sort(state.archive.Z[state.archive.Z[:, 0] == 1.0, 1])
    assert angles[[0, -1]] == pytest.approx([0.0, np.pi / 2], abs=1e-3)
    assert np.count_nonzero((angles < 0.65) | (angles > 0.85)) >= 6


@pytest.mark.slow
def test_no_more_solves_than_allowed() -> None:
    evaluator = Circle()
    state = state_of(evaluator, np.column_stack([np.full(5, 0.9), np.linspace(0.2, 1.3, 5)]))
    solves = BudgetedSolves(evaluator, 3)
    state.archive = polish(state.archive, solves, 5)
    assert evaluator.counts.gradient_solves == 3 and solves.left == 0
    assert 3 <= len(state.archive) <= 5
    for seed in (1, 2):
        assert len(MACS(archive=4).solve(load("goddard"), DFET(2, 3), evaluations=150, seed=seed)) <= 4


def test_where_no_candidate_is_feasible_gradients_find_what_is() -> None:
    class Closed(Circle):
        def _evaluate(self, Z: np.ndarray, way: int | None = None) -> tuple[Evaluation, int]:
            return Evaluation(Z.copy(), self.objectives(Z), np.ones(len(Z)), np.full(len(Z), "infeasible")), 0

    def found(**settings) -> SearchState:
        evaluator, solver = Closed(), MACS(agents=4, variant=Variant(refine_every=10), **settings)
        state = solver.begin(evaluator, 200, np.random.default_rng(0))
        while state.evaluations < 200:
            solver.advance(state, evaluator, 200)
        return state

    state = found()
    assert len(state.archive) >= 3 and state.archive.Z[:, 0] == pytest.approx(1.0)
    assert not len(found(refine=False).archive)


def uncovered(F: np.ndarray, sphere: Sphere) -> float:
    """How far a point of the sphere may be from the nearest of F."""
    every = sphere.objectives(on_front(2, 21))
    return float(np.linalg.norm(every[:, None] - F, axis=2).min(axis=1).max())


def test_a_surface_is_covered_by_few_solves_from_a_crowd() -> None:
    rng = np.random.default_rng(3)
    crowd = np.column_stack([rng.uniform(0.85, 0.9, 20), rng.uniform(0.4, 0.5, (20, 2))])
    for solves in (36, 200):
        sphere = Sphere()
        state = state_of(sphere, crowd)
        state.archive = polish(state.archive, BudgetedSolves(sphere, solves), 30)
        assert len(state.archive) <= 30 and state.archive.Z[:, 0] == pytest.approx(1.0)
        assert uncovered(state.archive.F, sphere) < 0.3


@pytest.mark.parametrize("hoped", [(0.3, 0.3, 0.3), (0.9, 0.1, 0.0)], ids=["inside", "at the edge"])
def test_solves_of_a_guided_surface_go_where_points_are_wanted(hoped) -> None:
    rng, sphere, goals = np.random.default_rng(3), AskingSphere(), tuple(Objective(name) for name in ("f1", "f2", "f3"))
    wanted = ReferencePoint({goal.name: value for goal, value in zip(goals, hoped, strict=True)})
    region = Region.of(wanted, goals, sphere.objectives(sphere.grid))
    state = state_of(sphere, np.column_stack([rng.uniform(0.85, 0.9, 20), rng.uniform(0.1, 1.4, (20, 2))]))
    archive = polish(state.archive, BudgetedSolves(sphere, 40), 20, guide=PreferenceGuide(wanted, goals))
    assert len(sphere.found) == 40 and region.contains(np.array(sphere.found[6:])).mean() > 0.5, "all but those of the ends"
    assert region.contains(archive.F).sum() >= 10


def after(solves: int):
    """Asks to stop after so many questions."""
    asked = iter(range(10**6))
    return lambda: next(asked) >= solves


class Asking:
    """Asks before each solve whether it is to go on, and notes what solves find."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[np.ndarray] = []

    def _descend(self, starts, references, weights, margins) -> tuple[Evaluation, int]:
        some = slice(next((k for k in range(len(starts)) if stopping()), len(starts)))
        if not len(starts[some]):
            return Evaluation(starts[:0], references[:0], np.empty(0), np.empty(0, dtype=str)), 0
        found, iterations = super()._descend(starts[some], references[some], weights[some], margins)  # type: ignore[misc]
        self.found.extend(found.F)
        return found, iterations


class AskingCircle(Asking, Circle):
    pass


class AskingSphere(Asking, Sphere):
    pass


@pytest.mark.parametrize(("kind", "solves"), [*((AskingCircle, solves) for solves in (0, 11, 23)), (AskingSphere, 16)])
def test_a_polish_that_is_stopped_loses_nothing_and_goes_on(kind, solves) -> None:
    rng = np.random.default_rng(3)
    crowd = np.column_stack([rng.uniform(0.85, 0.9, 24), rng.uniform(0.4, 0.9, (24, len(kind().free) - 1))])
    settings = MACS(agents=3, archive=200, polish_every=1)

    def beginning() -> tuple[SearchState, Any]:
        evaluator = kind()
        state = state_of(evaluator, crowd)
        state.evaluations = 40  # so many solves, one for each
        return state, evaluator

    whole, thorough = beginning()
    settings.conclude(whole, thorough)
    assert len(thorough.found) > solves
    state, evaluator = beginning()
    with stopped_by(after(solves)):
        settings.conclude(state, evaluator)
    assert evaluator.counts.gradient_solves == len(evaluator.found) == solves and evaluator.counts.clocked
    # What was there, and what was found, is in the front, or something that is better.
    for F in [*evaluator.objectives(crowd), *evaluator.found]:
        assert (state.archive.F <= F + 1e-3).all(axis=1).any()
    settings.conclude(state, evaluator)
    assert evaluator.counts.gradient_solves == len(evaluator.found) == len(thorough.found)
    assert state.archive.Z.tobytes() == whole.archive.Z.tobytes() and state.archive.F.tobytes() == whole.archive.F.tobytes()


@pytest.mark.slow
def test_gradient_solves_that_are_stopped_within_a_batch_are_kept() -> None:
    nlp = DFET(3, 2).transcribe(load("goddard"))

    def solved(solves: int) -> tuple[Bilevel, Evaluation]:
        evaluator = Bilevel(nlp, Projection(), 1e-6)
        rng = np.random.default_rng(1)
        seen = evaluator.evaluate(evaluator.first_guess(evaluator.lower + rng.random((4, len(nlp.free))) * nlp.span[nlp.free]))
        with stopped_by(after(solves)):
            return evaluator, evaluator.descend(seen.Z, seen.F, np.ones((4, 2)))

    whole, everything = solved(10**6)  # also builds the programs, which asks too
    assert whole.counts.gradient_solves == 4 and not whole.counts.clocked
    for solves in range(4):
        part, found = solved(solves)
        assert part.counts.gradient_solves == solves and part.counts.clocked == 1
        assert found.Z.shape == (solves, len(nlp.variables)) and found.F.shape == (solves, 2)
        assert np.array_equal(found.Z, everything.Z[:solves]) and np.array_equal(found.status, everything.status[:solves])


def test_with_more_than_two_objectives_the_ends_are_sought_first_and_then_all_over() -> None:
    sphere = Sphere()
    solver = MACS(agents=6, archive=30, variant=Variant(refine_every=10))
    state = solver.begin(sphere, 200, np.random.default_rng(0))
    while state.evaluations < 200:
        solver.advance(state, sphere, 200)
    best = state.archive.Z[state.archive.Z[:, 0] == 1.0]
    assert sphere.objectives(best).min(axis=0) == pytest.approx(0.0, abs=1e-9)
    assert len(best) > 6 and uncovered(sphere.objectives(best), sphere) < 0.6


def test_what_is_worse_or_failed_is_not_taken() -> None:
    class Useless(Circle):
        def _descend(self, starts, references, weights, margins) -> tuple[Evaluation, int]:
            found, count = super()._descend(starts, references, weights, margins)
            status = np.where(np.arange(count) % 2, CONVERGED, "failed")
            return Evaluation(found.Z, found.F + 2.0, found.violation, status), count

    evaluator = Useless()
    Z = np.column_stack([np.full(5, 0.9), np.linspace(0.2, 1.3, 5)])
    state = state_of(evaluator, Z)
    state.archive = polish(state.archive, BudgetedSolves(evaluator, 1000), 5)
    assert np.array_equal(np.sort(state.archive.Z[:, 1]), Z[:, 1])


@pytest.mark.parametrize(
    ("name", "mesh", "reference", "evaluations", "worst"),
    [
        ("goddard", DFET(4, 6), goddard.reference, 500, 3e-4),
        pytest.param("orbit_rise", DFET(30, 1), orbit_rise.reference, 1500, 1e-4, marks=pytest.mark.slow),
    ],
)
def test_every_point_is_a_certified_optimum_of_the_mesh(name, mesh, reference, evaluations, worst) -> None:
    front = MACS(mesh="fixed").solve(load(name), mesh, evaluations=evaluations, seed=3, inner="projection")
    assert len(front) == 10 and max(point.optimality for point in front) < 1e-6
    assert distance_to_curve(front.objectives, reference()).max() < worst
    assert inverted_distance(front.objectives, reference()) < 0.044
    assert front.stats["evaluations"] <= evaluations and 0 < front.stats["gradient_solves"] <= evaluations // 20


@pytest.mark.parametrize("kind", [AskingCircle, AskingSphere])
def test_optima_that_are_known_are_not_solved_again(kind) -> None:
    size = len(kind().free) - 1
    Z = np.column_stack([np.ones(6), np.random.default_rng(2).uniform(0.1, 1.4, (6, size))])
    archive = Archive(Z, kind.objectives(Z), np.zeros(6))

    def again(known: Archive | None) -> int:
        """How many of the points are solved for their own objectives from where they are."""
        evaluator, asked = kind(), []
        descend = evaluator.descend

        def noted(starts, references, weights):
            asked.extend(np.hstack([starts, references]))
            return descend(starts, references, weights)

        evaluator.descend = noted
        polish(archive, BudgetedSolves(evaluator, 200), 6, optima=known)
        return sum((row == np.hstack([Z, archive.F])).all(axis=1).any() for row in asked)

    assert again(None) > 0 and again(archive) == 0


def test_what_is_no_better_than_an_optimum_gives_way_to_it() -> None:
    """The first point differs by round-off, the second by what its violation explains; the third is better. No solve is left for them."""
    optima = Archive(np.arange(3.0)[:, None], np.array([[0.0, 1.0], [0.5, 0.5], [1.0, 0.0]]), np.zeros(3))
    off = np.array([[-1e-9, 0.0], [-1e-6, -1e-6], [0.0, -1e-3]])
    archive = Archive(optima.Z + 10.0, optima.F + off, np.array([0.0, 1e-6, 0.0]))
    found = polish(archive, BudgetedSolves(Answers(), 0), 3, optima=optima)
    assert sorted(found.Z[:, 0].tolist()) == [0.0, 1.0, 12.0]


class Answers:
    """Gives prepared objectives, and notes from where they were asked."""

    tolerance, counts = 1e-6, Counts()
    free, box = np.arange(1), UnitBox(np.zeros(1), np.ones(1), np.zeros(1, dtype=bool))

    def __init__(self, *F: list[float]) -> None:
        self.F, self.starts = iter(np.array(F)), []

    def descend(self, starts, references, weights) -> Evaluation:
        self.starts.extend(starts)
        return Evaluation(
            starts + 100.0, np.array([next(self.F) for _ in starts]), np.zeros(len(starts)), np.array([CONVERGED] * len(starts))
        )


def test_where_all_starts_are_alike_none_is_made_from_neighbours() -> None:
    F = np.array([[0.0, 1.0], [0.3, 0.3], [1.0, 0.0]])
    optima = Archive(np.arange(3.0)[:, None], F, np.zeros(3))
    made = []
    for alike in (False, True):
        evaluator = Answers(*[[9.0, 9.0]] * 40)
        found = polish(optima, BudgetedSolves(evaluator, 40), 3, optima=optima, alike=alike)  # type: ignore[arg-type]
        assert np.array_equal(np.sort(found.Z[:, 0]), [0.0, 1.0, 2.0])
        made.append(len(evaluator.starts))
    # Three in a row, as many as there are points, find nothing; of the ends two were not tried yet.
    assert made == [1 + 3 + 2, 1]


# Cover of a surface whose solves end in the valley in which they begin


GOALS = tuple(Objective(f"f{k + 1}", "", "minimize") for k in range(3))
GOOD, POOR = 1.0, 1.03
GUIDE = PreferenceGuide(ReferencePoint({"f1": 0.3, "f2": 0.4, "f3": 0.5}), GOALS)


@dataclass
class Spheres:
    """Solves on eighths of spheres: the only variable is the radius, which no solve changes."""

    left: int
    begun: list[float] = field(default_factory=list)
    results: Counts = field(default_factory=Counts)

    def __call__(self, starts: np.ndarray, references: np.ndarray, weights: np.ndarray) -> Evaluation:
        F = np.empty(references.shape)
        for k, ((radius,), reference, weight) in enumerate(zip(starts.tolist(), references, weights, strict=True)):
            outside = partial(lambda r, w, size, t: float(np.linalg.norm(np.maximum(r + t * w, 0.0))) - size, reference, weight, radius)
            F[k] = np.maximum(reference + brentq(outside, -3.0, 3.0) * weight, 0.0)
        self.left -= len(F)
        self.begun += starts[:, 0].tolist()
        return Evaluation(starts.copy(), F, np.zeros(len(F)), np.array([CONVERGED] * len(F)))

    def feasible(self, found: Evaluation) -> np.ndarray:
        return found.status == CONVERGED


def on_sphere(directions: np.ndarray, radius: float) -> Archive:
    F = radius * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return Archive(np.full((len(F), 1), radius), F, np.zeros(len(F)))


ENDS = on_sphere(np.eye(3), GOOD)
"""The ends of the front; they are no good for the preference."""


def test_solves_begin_where_points_are_good_and_stay_in_the_better_valley() -> None:
    """One point of the good valley is best; those of the poor one are nearer to most places."""
    poor = on_sphere(simplex_lattice(3, 30), POOR)
    poor = poor.take((poor.F > 0.0).all(axis=1))
    best = on_sphere(np.array([[0.3, 0.4, 0.5]]), GOOD)
    surface = Surface(ENDS.joined(poor).joined(best), np.zeros(3), np.ones(3), across(ENDS.F), ENDS.F)
    start, place = surface.guided(GUIDE)
    wanted = GUIDE.factors(surface.pool.F, surface.pool.F)
    nearest = np.linalg.norm(surface.plane(surface.pool.F) - place, axis=1).argmin()
    assert wanted[nearest] < wanted.max() == wanted[start]
    solves = Spheres(40)
    few = on_sphere(simplex_lattice(3, 12), POOR)
    surface = cover(best.joined(few.take((few.F > 0.0).all(axis=1))), ENDS, solves, 12, GUIDE)  # type: ignore[arg-type]
    assert solves.left == 0 and set(solves.begun) == {GOOD}


def test_the_same_solve_is_made_once_and_none_after_the_most_work() -> None:
    evaluator = Answers([1.0, 1.0], [2.0, 2.0], [3.0, 3.0])
    solves = BudgetedSolves(evaluator, 5, most_work=0.0)  # type: ignore[arg-type]
    solves.promise(2)
    starts, weights = np.array([[0.0], [0.0], [1.0], [2.0]]), np.ones((4, 2))
    found = solves(starts, np.zeros((4, 2)), weights)
    assert found.status.tolist() == [CONVERGED, CONVERGED, CONVERGED, FAILED]
    assert found.F[:3, 0].tolist() == [1.0, 1.0, 2.0]
    assert (len(evaluator.starts), solves.left, solves.stopped) == (2, 3, False)
