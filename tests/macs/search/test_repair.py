"""Repair of infeasible points: fronts on thin feasible sets, published optima with equalities, and what it costs elsewhere."""

from dataclasses import replace

import numpy as np
import pytest
from boxes import boxed
from pymoo.core.problem import Problem
from pymoo.problems import get_problem

from macs.evaluation.evaluator import Evaluation, UnitBox
from macs.search import repair as module
from macs.search.macs import MACS
from macs.search.settings import Variant
from macs.search.trials import Trials
from problems import VectorProblem


class Sphere(Problem):
    """Squared distances from two points of a sphere in d dimensions, on which all points have to be: the front is the arc between the two,
    where F = 2 - 2 (cos a, sin a)."""

    def __init__(self, d: int, words: str = "H") -> None:
        super().__init__(n_var=d, n_obj=2, xl=-2.0, xu=2.0, **{"n_eq_constr" if words == "H" else "n_ieq_constr": 1})
        self.words = words

    def _evaluate(self, x, out, *args, **kwargs) -> None:
        ends = np.eye(self.n_var)[:2]
        out["F"] = ((x[:, None] - ends) ** 2).sum(axis=2)
        h = (x**2).sum(axis=1, keepdims=True) - 1.0
        out[self.words] = h if self.words == "H" else np.abs(h) - 1e-4


def off_the_arc(F):
    """Distances (n,) of points from the circle that the front is a quarter of, and the largest angle between neighbours, ends included."""
    c = 1.0 - F / 2.0
    angle = np.sort(np.arctan2(c[:, 1], c[:, 0]))
    return np.abs(np.linalg.norm(c, axis=1) - 1.0), np.diff(np.concatenate([[0.0], angle, [np.pi / 2]])).max()


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_a_front_on_a_thin_feasible_set_is_covered(seed):
    """With a tolerance of 1e-6. Without repair three points at most are found, or a part of the arc."""
    front = MACS(archive=30).minimize(Sphere(5), evaluations=10_000, seed=seed, progress=False)
    far, gap = off_the_arc(front.F)
    assert len(front) == 30 and far.max() < 0.02 and gap < 0.2
    alone = MACS(archive=30, variant=Variant(repair=False)).minimize(Sphere(5), evaluations=10_000, seed=seed, progress=False)
    assert len(alone) < 10 or off_the_arc(alone.F)[1] > 0.5


@pytest.mark.slow
@pytest.mark.parametrize(("d", "seed"), [(4, 1), (8, 1)])
def test_equalities_that_are_stated_as_a_limit_on_absolute_values(d, seed):
    """Their residuals do not say on which side a point is. Before models had signs, gaps were up to 0.7 wide."""
    front = MACS(archive=30).minimize(Sphere(d, "G"), evaluations=20_000, seed=seed, progress=False)
    far, gap = off_the_arc(front.F)
    assert len(front) == 30 and far.max() < 0.05 and gap < 0.2


class Banded(Problem):
    """A problem whose equalities h = 0 are stated as abs(h) - 1e-4 <= 0."""

    def __init__(self, stated: Problem) -> None:
        super().__init__(
            n_var=stated.n_var, n_obj=stated.n_obj, n_ieq_constr=stated.n_ieq_constr + stated.n_eq_constr, xl=stated.xl, xu=stated.xu
        )
        self.stated = stated

    def _evaluate(self, x, out, *args, **kwargs) -> None:
        values = self.stated.evaluate(x, return_values_of=["F", "G", "H"], return_as_dictionary=True)
        out["F"], out["G"] = values["F"], np.hstack([values["G"], np.abs(values["H"]) - 1e-4])


@pytest.mark.slow
@pytest.mark.parametrize("stated", [lambda problem: problem, Banded], ids=["equalities", "absolute values"])
@pytest.mark.parametrize(("name", "optimum", "near"), [("g5", 5126.4967, 1e-4), ("g13", 0.0539415, 1e-2), ("g15", 961.7150222899, 1e-5)])
def test_published_optima_with_equalities_are_found(name, optimum, near, stated):
    """Two or three nonlinear equalities, to 1e-6, or as limits on absolute values. Optima: Liang and others, Problem definitions for the
    CEC 2006 special session on constrained real-parameter optimization, 2006, where equalities hold to 1e-4."""
    # g13 has a local optimum at 0.4389, where two of five seeds end: the best of three is asked for.
    fronts = (MACS().minimize(stated(get_problem(name)), evaluations=10_000, seed=seed, progress=False) for seed in (1, 2, 3))
    assert any(front.F[0, 0] == pytest.approx(optimum, rel=near) for front in fronts)


def test_constraints_of_unlike_scales_are_met_together():
    """g21 has residuals from 1 to 1e6 in size: the first feasible point within 1000 evaluations, where there was none after 20,000."""
    front = MACS().minimize(get_problem("g21"), evaluations=1000, seed=1, progress=False)
    assert len(front) and front.violation.max() <= 1e-6


@pytest.mark.slow
def test_a_portfolio_of_assets_that_are_independent():
    """Variance against return of shares that sum to one, a constraint with one value. The least variance has shares as 1 / variance of each
    asset, the largest return has one asset."""
    variances, returns = np.linspace(0.5, 2.0, 8), np.linspace(0.1, 1.0, 8)
    problem = VectorProblem("portfolio")
    for i in range(8):
        problem.variable(f"share {i + 1}", bounds=(0.0, 1.0))
    problem.minimize("variance")
    problem.maximize("return")
    problem.constraint("sum", lower=1.0, upper=1.0)
    problem.function(lambda X: {"variance": X**2 @ variances, "return": X @ returns, "sum": X.sum(axis=1)})
    front = MACS(archive=20).solve(problem, evaluations=20_000, seed=1, progress=False)
    assert len(front) == 20 and np.abs(front.decision.sum(axis=1) - 1.0).max() <= 1e-6
    assert front.F[:, 0].min() == pytest.approx(1.0 / (1.0 / variances).sum(), rel=0.03)
    assert front.F[:, 1].min() == pytest.approx(-1.0, abs=0.02)  # a corner of the simplex, which a search without derivatives only nears


def repaired(name, evaluations, seed=1):
    """The part of the evaluations that repair takes."""
    evaluator, solver, taken = boxed(get_problem(name)), MACS(archive=30), 0
    state = solver.begin(evaluator, evaluations, np.random.default_rng(seed))

    def counted(trials, seen):
        nonlocal taken
        before = trials.state.evaluations
        repair(trials, seen)
        taken += trials.state.evaluations - before

    repair = module.repair
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("macs.search.macs.repair", counted)
        while state.evaluations < evaluations:
            solver.advance(state, evaluator, evaluations)
    return taken / evaluations


@pytest.mark.slow
def test_as_many_points_are_repaired_as_pays():
    assert 0.0 < repaired("bnh", 3000) < 0.05 and repaired("osy", 3000) < 0.05
    assert repaired("g13", 3000) > 0.1


def test_points_whose_evaluation_fails_are_no_sample():
    def function(X):
        F = np.column_stack([X[:, 0], X[:, 1]])
        F[X[:, 0] > 1.5] = np.nan
        return F, 1.0 - X[:, :1] * X[:, 1:]

    evaluator = boxed(function, [(0.0, 2.0)] * 2)
    state = MACS(archive=20).begin(evaluator, 1000, np.random.default_rng(1))
    while state.evaluations < 1000:
        MACS(archive=20).advance(state, evaluator, 1000)
    assert np.isfinite(state.samples.residuals).all() and state.samples.X[:, 0].max() <= 0.75 and len(state.archive) == 20
    calls = []

    def function(X):
        calls.append(len(X))
        return X, np.ones((len(X), 1 + (len(calls) > 3))) - X.sum(axis=1, keepdims=True)

    with pytest.raises(ValueError, match="constraints: the function returned 2 of them, 1 before"):
        MACS().minimize(function, [(0.0, 2.0)] * 2, evaluations=300, seed=1, progress=False)


def test_a_point_whose_violation_a_step_does_not_halve_is_given_up():
    """The violation, one and the distance of x1 from 1, is nowhere less than one."""
    evaluator = boxed(lambda X: (X, 1.0 + np.abs(X[:, :1] - 1.0)), [(0.0, 2.0)] * 2)
    state, trials = state_of(evaluator)
    seen = evaluator.evaluate(np.array([[1.5, 1.0]]))
    before = state.evaluations = evaluator.counts.evaluations
    state.samples = state.samples.joined(np.array([[0.8, 0.5], [0.75, 0.6], [0.9, 0.4]]), 1.0 + np.array([[0.6], [0.5], [0.8]]))
    module.repair(trials, [seen])
    assert evaluator.counts.evaluations == before + 1


def state_of(evaluator):
    state = MACS().begin(evaluator, 100, np.random.default_rng(1))
    return state, Trials(MACS(), state, evaluator, 100)


def test_nothing_is_repaired_where_constraints_are_not_known_one_by_one():
    evaluator = boxed(lambda X: (X, 1.0 - X[:, :1]), [(0.0, 2.0)] * 2)
    state, trials = state_of(evaluator)
    seen = evaluator.evaluate(np.array([[0.5, 0.5], [0.2, 1.0]]))
    before = state.evaluations = evaluator.counts.evaluations
    module.repair(trials, [replace(seen, residuals=None)])
    evaluator.moves = True
    module.repair(trials, [seen])
    evaluator.moves = False
    module.repair(Trials(MACS.paper(), state, evaluator, 100), [seen])
    free = boxed(lambda X: X, [(0.0, 2.0)] * 2)
    module.repair(state_of(free)[1], [free.evaluate(np.ones((2, 2)))])
    assert evaluator.counts.evaluations == before and not len(state.samples)
    module.repair(trials, [seen])
    assert evaluator.counts.evaluations > before and len(state.samples) > 2


@pytest.mark.slow
def test_the_budget_holds_and_a_resumed_search_continues_to_the_same_bits(tmp_path):
    solver, problem = MACS(archive=10), Sphere(3)
    whole = solver.minimize(problem, evaluations=1503, seed=1, progress=False)
    assert whole.stats["evaluations"] == 1503

    def stop(view):
        return view.evaluations > 700

    kept = tmp_path / "run.ckpt"
    half = solver.minimize(problem, evaluations=1503, seed=1, progress=False, callback=stop, checkpoint=kept)
    assert half.stats["evaluations"] < 1503
    again = solver.minimize(problem, evaluations=1503, seed=1, progress=False, checkpoint=kept)
    assert np.array_equal(again.F, whole.F)


def test_residuals_have_signs():
    one = Evaluation(np.zeros((1, 1)), np.zeros((1, 1)), np.ones(1), np.array(["infeasible"]), residuals=np.array([[-1.0, 0.5, 0.0]]))
    assert one.violations.tolist() == [[1.0, 0.5, 0.0]]
    box = boxed(Sphere(2), constraints=lambda X: X[:, 0] - 1.0, tolerance=0.0)
    seen = box.evaluate(np.array([[0.5, 0.0], [2.0, 0.0]]))
    assert seen.residuals is not None and np.allclose(seen.residuals * box.problem.sizes, [[-0.75, 0.0], [3.0, 1.0]])
    assert np.array_equal(seen.violation, np.abs(seen.residuals).max(axis=1))


def test_whole_numbers_stay_and_what_was_violated_before_is_watched():
    """x0 is whole; of x1 + x2 <= 0.7 + x0 and x1 >= 0.6 the first is violated, and a step for it is to leave the second as it is."""
    box = UnitBox(np.zeros(3), np.array([9.0, 1.0, 1.0]), np.zeros(3, dtype=bool), np.arange(3) == 0, np.zeros(3, dtype=bool))
    X = np.random.default_rng(1).random((30, 3))
    residuals = np.column_stack([X[:, 1] + X[:, 2] - 0.7 - X[:, 0], 0.6 - X[:, 1]])
    samples, x = module.ResidualSamples(X, residuals), np.array([[0.0, 0.6, 0.5]])
    for watched, step in ((np.array([[True, False]]), [0.0, -0.2, -0.2]), (np.ones((1, 2), dtype=bool), [0.0, 0.0, -0.4])):
        found = module.steps_to_zero(box, x, np.array([[0.4, 0.0]]), samples, watched)
        assert found[0] == pytest.approx(step, abs=0.02)
