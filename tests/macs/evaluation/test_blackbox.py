import numpy as np
import pytest
from boxes import boxed
from pymoo.core.problem import ElementwiseProblem
from pymoo.core.problem import Problem as PymooProblem
from pymoo.problems import get_problem

from macs.evaluation.blackbox import read_bounds
from problems.vector import SAMPLED


def two(X):
    return np.stack([X[:, 0], 1 - X[:, 0]], axis=1)


def middle(box, count=3):
    return np.tile((box.lower + box.upper) / 2, (count, 1))


def test_bounds_in_every_form():
    pairs = [(0, 1), (-1, 2), (3, 4)]
    for bounds in (pairs, np.array(pairs), ([0, -1, 3], [1, 2, 4]), (np.array([0, -1, 3]), np.array([1, 2, 4]))):
        assert [(v.name, v.lower, v.upper) for v in read_bounds(bounds)] == [("x1", 0, 1), ("x2", -1, 2), ("x3", 3, 4)]
    assert [v.name for v in read_bounds({"mass": (1, 2), "tf": (3, 4)})] == ["mass", "tf"]
    assert [v.lower for v in read_bounds([[0, 1], [2, 3]])] == [0, 2]  # two short ones are two pairs


@pytest.mark.parametrize(
    ("bounds", "message"),
    [
        (None, "missing"),
        ([(0, 1), (0.5, np.nextafter(0.5, 1))], "'x2', .* leave nothing to decide"),
        ([(0.0, 5e-324)], "'x1', .* leave nothing to decide"),
        ([(0, 1), (1, 1)], "'x2', .* leave nothing to decide"),
        ([(-1e308, 1e308)], "'x1', .* too far apart"),
        (5, "bounds: pairs .* expected, .* not 5"),
        ([5, 6], "the bounds of variable 'x1' must be a pair .* not 5"),
        ({"a\0b": (0, 1)}, "NUL"),
        ([], "empty"),
        ({"mass": (2, 1)}, "'mass': an empty interval, 2 > 1"),
        ([(0, np.inf)], "'x1' must be finite"),
        ([(0, np.nan)], "'x1' must be finite"),
        ([(0, 1, 2), (0, 1)], "'x1' must be a pair"),
        ({"mass": "heavy"}, "'mass' must be a pair .* not 'heavy'"),
        (([0, 0, 0], [1, 1, 1, 1]), "3 lower and 4 upper"),
    ],
)
def test_bounds_that_cannot_be_meant(bounds, message):
    with pytest.raises(ValueError, match=message):
        boxed(two, bounds)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"senses": ["minimise", "maximize"]}, "senses: .*'minimise'"),
        ({"senses": "minimize"}, "senses"),
        ({"names": ["a"], "senses": ["minimize"] * 2}, "senses has 2, 1 expected"),
        ({"names": ["a", "a"]}, "has a name twice"),
        ({"names": []}, "names has 0"),
        ({"names": ["a", "b\0"]}, "names: .* NUL"),
        ({"units": ["m", "\ud800"]}, "units: .* surrogate"),
        ({"constraints": 3}, "constraints: must be callable"),
        ({"tolerance": -1.0}, "tolerance"),
    ],
)
def test_other_arguments_that_cannot_be_meant(arguments, message):
    with pytest.raises(ValueError, match=message):
        boxed(two, [(0, 1)], **arguments)
    with pytest.raises(ValueError, match="function"):
        boxed(3, [(0, 1)])


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda X: two(X)[:1], r"shape \(1, 2\) for 3 points"),
        (lambda X: 7.0, r"shape \(\) for 3 points"),
        (lambda X: ["a"] * len(X), "must be an array of real numbers"),
        (lambda X: (two(X), X[:, 0] <= 3), "function: the constraints must be an array of real numbers"),
        (lambda X: two(X) + 1j, "function: the objectives must be an array of real numbers"),
        (lambda X: two(X).astype("datetime64[s]"), "function: the objectives must be an array of real numbers"),
        (lambda X: np.ma.masked_array(two(X) + 0j, mask=False), "function: the objectives must be an array of real numbers"),
        (lambda X: (two(X), X + 0j), "function: the constraints must be an array of real numbers"),
        (lambda X: (two(X), two(X)[:2]), "constraints have shape"),
        (lambda X: np.empty((len(X), 0)), "returned 0"),
    ],
)
def test_outputs_that_cannot_be_meant(function, message):
    box = boxed(function, [(0, 1)])
    with pytest.raises(ValueError, match=message):
        box.evaluate(middle(box))


def test_the_number_of_objectives_may_not_contradict_the_names():
    box = boxed(two, [(0, 1)], names=["a", "b", "c"])
    assert box.m == 3
    with pytest.raises(ValueError, match="returned 2, 3 expected"):
        box.evaluate(middle(box))
    box = boxed(two, [(0, 1)])
    box.evaluate(middle(box))
    assert (box.m, box.counts.evaluations) == (2, 3)
    asked = boxed(two, [(0, 1)])
    assert (asked.m, asked.counts.evaluations) == (2, 1)
    assert [(goal.name, goal.unit, goal.sense) for goal in asked.goals] == [("f1", "", "minimize"), ("f2", "", "minimize")]


def test_failed_rows_constraints_and_senses():
    def function(X):
        F = two(X)
        F[1] = np.nan
        return F, np.array([[-1.0], [0.0], [0.5]])

    box = boxed(function, [(0, 1)], senses=["minimize", "maximize"], constraints=lambda X: X - 2.0)
    result = box.evaluate(np.array([[0.0], [0.5], [1.0]]))
    assert result.status.tolist() == ["converged", "failed", "infeasible"]
    assert result.violation.tolist() == [0.0, np.inf, 0.5] and np.isnan(result.F[1]).all()
    assert result.F[0].tolist() == [0.0, -1.0]
    assert box.counts.failures == {"failed": 1, "infeasible": 1}

    def function(X):
        return X, np.stack([X[:, 0] - 1, 1 - X[:, 0]], axis=1)

    seen = boxed(function, [(0, 4)] * 2, constraints=lambda X: X[:, 1] - 2).evaluate(np.array([[3.0, 1.0], [0.5, 4.0]]))
    assert seen.violations.tolist() == [[2, 0, 0], [0, 0.5, 2]] and seen.violation.tolist() == [2, 2]
    assert boxed(lambda X: X, [(0, 1)] * 2).evaluate(np.zeros((3, 2))).violations.shape == (3, 0)

    def function(X):
        X *= 2
        return X.sum(axis=1)

    box = boxed(function, [(0, 1), (0, 1)])
    result = box.evaluate(np.ones((4, 2)))
    assert (result.F.shape, result.Z.max()) == ((4, 1), 1.0)


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_what_is_feasible_does_not_depend_on_the_units_of_constraints(unit):
    def near(X):
        return np.column_stack([X[:, 0], 1 - X[:, 0]]), unit * (0.5 - X)

    found = boxed(near, [(0, 1)]).evaluate(np.array([[0.5 - 1e-7], [0.5], [0.6]]))
    assert found.status.tolist() == ["infeasible", "converged", "converged"]

    class OnLine(PymooProblem):
        def __init__(self):
            super().__init__(n_var=2, n_obj=2, n_eq_constr=1, xl=0.0, xu=1.0)

        def _evaluate(self, X, out, *args, **kwargs):
            out["F"], out["H"] = X, unit * (X.sum(axis=1, keepdims=True) - 1)

    found = boxed(OnLine()).evaluate(np.array([[0.5, 0.5 + 1e-5], [0.5, 0.5 + 1e-8], [0.3, 0.7], [0.2, 0.7]]))
    assert found.status.tolist() == ["infeasible", "converged", "converged", "infeasible"]


def test_pymoo_problems_vectorised_and_elementwise_with_equalities():
    tnk = boxed(get_problem("tnk"))
    result = tnk.evaluate(middle(tnk))
    assert (tnk.m, result.F.shape) == (2, (3, 2)) and (result.violation > 0).all()

    class OnCircle(ElementwiseProblem):
        def __init__(self):
            super().__init__(n_var=2, n_obj=2, n_ieq_constr=1, n_eq_constr=1, xl=-1.0, xu=1.0)

        def _evaluate(self, x, out, *args, **kwargs):
            out["F"], out["G"], out["H"] = [x[0], x[1]], [x[0] - 0.5], [x[0] ** 2 + x[1] ** 2 - 1]

    circle = boxed(OnCircle())
    assert circle.lower.tolist() == [-1, -1]
    of_line, of_circle = circle.problem.sizes
    found = circle.evaluate(np.array([[0.0, 1.0], [0.0, 0.5], [1.0, 0.0]]))
    assert found.violation == pytest.approx([0.0, 0.75 / of_circle - 1e-6, 0.5 / of_line])
    assert circle.counts.evaluations == SAMPLED + 3


@pytest.mark.parametrize("as_list", [False, True])
def test_a_masked_value_is_a_failed_evaluation(as_list):
    def function(X):
        F = np.ma.masked_array(two(X), mask=[[False, False], [True, False], [False, False]])
        return list(F) if as_list else F

    box = boxed(function, [(0, 1)], constraints=lambda X: np.ma.masked_array(X - 2.0, mask=[[False], [False], [True]]))
    result = box.evaluate(np.array([[0.0], [0.5], [1.0]]))
    assert result.status.tolist() == ["converged", "failed", "failed"]
    assert np.isnan(result.F[1:]).all()


def test_an_error_of_the_function_is_a_failed_evaluation_that_says_at_which_row(caplog):
    def function(X):
        if (X[:, 0] > 0.8).any():
            raise ArithmeticError("too large")
        return two(X)

    box = boxed(function, {"height": (0, 1), "width": (0, 1)})
    seen = box.evaluate(np.array([[0.1, 0.2], [0.9, 0.3], [0.95, 0.4]]))
    assert seen.status.tolist() == ["converged", "failed", "failed"] and seen.F[0].tolist() == [0.1, 0.9]
    assert box.counts.first_failure == "ArithmeticError: too large, at height = 0.9, width = 0.3"
    assert caplog.messages == [f"an evaluation failed: {box.counts.first_failure}"]
    with pytest.raises(ValueError, match="failed at all designs; ArithmeticError: too large, at height"):
        boxed(function, {"height": (0, 1), "width": (0, 1)}).evaluate(np.array([[0.9, 0.3]]))
    with pytest.raises(ValueError, match="shape"):
        boxed(lambda X: X[:1], [(0, 1)]).evaluate(np.zeros((3, 1)))
    assert len(caplog.messages) == 1, "what it returned is no error of its own"
