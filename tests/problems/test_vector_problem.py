import numpy as np
import pytest
from pymoo.problems import get_problem
from scipy.optimize import minimize
from vector_problems import parabolas

from problems import CompiledVectorProblem, VectorProblem, is_catalogued, load
from problems.cases.structures import four_bar_truss_reference


def rows(compiled: CompiledVectorProblem, count: int = 500) -> np.ndarray:
    lower, upper = (np.array([getattr(v, side) for v in compiled.variables]) for side in ("lower", "upper"))
    return np.random.default_rng(1).uniform(lower, upper, (count, len(lower)))


def test_objectives_are_minimised_and_violations_scaled_by_the_size_of_the_limit():
    F, violations = parabolas().compile().evaluate(np.array([[1.0, 0.5], [3.0, 0.0]]))
    assert F.tolist() == [[1.25, 1.25], [9.0, 1.0]]
    assert violations.tolist() == [[0.0], [1.0]]  # 1.5 m beyond a wall at 1.5 m

    def evaluate(X):
        X *= 2
        return {"wall": X[:, 0], "nearness": X[:, 1], "near": X[:, 0] + X[:, 1]}

    X = np.array([[1.0, 3.0]])
    F, violations = parabolas(function=evaluate).compile().evaluate(X)
    assert X.tolist() == [[1.0, 3.0]] and F.tolist() == [[8.0, -6.0]] and violations[0, 0] == pytest.approx(1 / 3)
    own = parabolas().compile().fingerprint
    assert own == parabolas().compile().fingerprint
    others = {parabolas(wall=1.6).compile().fingerprint, parabolas(far=2.001).compile().fingerprint}
    assert own not in others and len(others) == 2


@pytest.mark.parametrize(
    ("limits", "value", "residual"),
    [
        ({"upper": 200.0}, 300.0, 0.5),
        ({"lower": -200.0}, -300.0, -0.5),
        ({"lower": 10.0, "upper": 14.0}, 9.0, -0.25),
        ({"lower": 8.0, "upper": 8.0}, 10.0, 0.25),
        ({"upper": 0.0}, 3.0, 3.0),
        ({"upper": 200.0, "scale": 50.0}, 300.0, 2.0),
        ({"upper": 200.0}, 199.0, 0.0),
    ],
)
def test_what_counts_as_one_in_a_constraint(limits, value, residual):
    problem = VectorProblem("scaled")
    problem.variable("x", bounds=(0, 1))
    problem.minimize("f")
    problem.constraint("g", **limits)
    problem.function(lambda X: {"f": X[:, 0], "g": np.full(len(X), value)})
    assert problem.compile().evaluate(np.zeros((3, 1)))[1].tolist() == [[residual]] * 3


def test_mistakes_in_the_statement_name_the_users_own_things():
    problem = VectorProblem("beam")
    problem.variable("h", bounds=(0, 1))
    problem.minimize("cost")
    mistakes = [
        (lambda: problem.variable("h", bounds=(0, 1)), "problem 'beam': the name 'h' is used twice"),
        (lambda: problem.variable("l", bounds=(-1e308, 1e308)), "variable 'l' of problem 'beam', .* are too far apart"),
        (lambda: problem.variable("l", bounds=(1, 1)), "variable 'l' of problem 'beam' leave nothing to decide"),
        (lambda: problem.variable("l", bounds=(1, np.inf)), "variable 'l' of problem 'beam' must be finite"),
        (lambda: problem.variable("a", bounds=(0, 6), period=5), "'a' of problem 'beam' must be one period"),
        (lambda: problem.maximize("cost"), "problem 'beam': the name 'cost' is used twice"),
        (lambda: problem.constraint("cost", upper=1), "problem 'beam': the name 'cost' is used twice"),
        (lambda: problem.constraint("stress"), "'stress' of problem 'beam' has neither a lower nor an upper limit"),
        (lambda: problem.constraint("stress", upper=1, scale=0), "scale of constraint 'stress' of problem 'beam' must be positive"),
        (lambda: problem.constraint("stress\0", upper=1), "name of a constraint, .* has a NUL character"),
        (lambda: problem.variable("l", bounds=(0, 1), unit="\ud800"), "unit of variable 'l' of problem 'beam', .* surrogate"),
        (lambda: problem.variable("l", bounds=5), "variable 'l' of problem 'beam' must be a pair"),
        (lambda: problem.function(3), "problem 'beam': its function must be callable"),
        (lambda: problem.compile(), "problem 'beam' has no function"),
        (lambda: VectorProblem("empty").compile(), "problem 'empty' has no variable"),
        (lambda: VectorProblem(""), "name of a problem"),
    ]
    for mistake, message in mistakes:
        with pytest.raises(ValueError, match=message):
            mistake()
    problem.function(lambda X: {"cost": X[:, 0]})
    with pytest.raises(ValueError, match="'beam' has a function already"):
        problem.function(lambda X: {})


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        (lambda X: X, "dict with an array of 3 values, one for each row, for each of near, nearness, wall, not ndarray"),
        (lambda X: {"near": X[:, 0]}, "did not return 'nearness', 'wall'"),
        (lambda X: {"near": X[:, 0], "nearnes": X[:, 0]}, "'nearnes', did you mean nearness?"),
        (lambda X: dict.fromkeys(("near", "wall"), X[:, 0]) | {"nearness": X[:2, 0]}, r"'nearness' has shape \(2,\) for 3 rows, \(3,\)"),
        (lambda X: dict.fromkeys(("near", "wall"), X[:, 0]) | {"nearness": X[:, :1]}, r"'nearness' has shape \(3, 1\)"),
        (lambda X: dict.fromkeys(("near", "wall"), X[:, 0]) | {"nearness": 1.0}, r"'nearness' has shape \(\)"),
        (lambda X: dict.fromkeys(("near", "wall"), X[:, 0]) | {"nearness": ["a"] * 3}, "'nearness' must be an array of real numbers"),
        (lambda X: dict.fromkeys(("near", "nearness"), X[:, 0]) | {"wall": X[:, 0] <= 3}, "'wall' must be an array of real numbers"),
        (lambda X: dict.fromkeys(("near", "wall"), X[:, 0]) | {"nearness": 1j * X[:, 0]}, "'nearness' must be an array of real numbers"),
    ],
)
def test_what_a_function_returns_is_checked_by_name(returned, message):
    with pytest.raises(ValueError, match=f"problem 'parabolas': .*{message}"):
        parabolas(function=returned).compile().evaluate(np.zeros((3, 2)))


def test_problems_load_by_name_and_from_files_with_data(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(
        "from problems import VectorProblem\n"
        "def build(side: float = 1.0) -> VectorProblem:\n"
        "    problem = VectorProblem('mine')\n"
        "    problem.variable('x', bounds=(0, side))\n"
        "    problem.minimize('f')\n"
        "    problem.function(lambda X: {'f': X[:, 0]})\n"
        "    return problem\n"
    )
    problem = load(f"{file}:build", side=3.0)
    assert problem.variables["x"].upper == 3.0 and problem.compile().data == {"side": 3.0}
    assert problem.compile().address == f"{file}:build" and not is_catalogued(problem.address)
    beam = load("welded_beam")
    assert isinstance(beam, VectorProblem) and beam.address == "welded_beam" and beam.default_evaluations == 10_000
    with pytest.raises(ValueError, match="did you mean 'welded_beam'"):
        load("welded_bean")


def test_the_welded_beam_is_that_of_another_program():
    """That of pymoo, which has the buckling load and the sizes of the weld from moduli, and so to fewer digits the same."""
    compiled, other = load("welded_beam").compile(), get_problem("welded_beam")
    X = rows(compiled)
    F, violations = compiled.evaluate(X)
    F_other, G_other = other.evaluate(X, return_values_of=["F", "G"])
    assert np.allclose(F, F_other, rtol=1e-3)
    assert ((violations.max(axis=1) > 0) == (G_other.max(axis=1) > 0)).mean() > 0.995
    # Reklaitis, Ravindran and Ragsdell, "Engineering Optimization", 1983: (0.244369, 6.21861, 8.29147, 0.244369) in.
    compiled = load("welded_beam").compile()
    F, violations = compiled.evaluate(np.array([[0.244369, 6.21861, 8.29147, 0.244369]]))
    assert violations.max() < 2e-4
    lower, upper = (np.array([getattr(v, side) for v in compiled.variables]) for side in ("lower", "upper"))

    def slack(x: np.ndarray) -> np.ndarray:
        """Distances from the limits, scaled: positive inside."""
        pairs = zip(compiled.rows(x[None])[1][0], compiled.limits or (), strict=True)
        return np.array([(v - limit.lower if np.isinf(limit.upper) else limit.upper - v) / limit.scale for v, limit in pairs])

    least = minimize(
        lambda x: compiled.evaluate(x[None])[0][0, 0],
        [0.3, 6.0, 8.0, 0.3],
        method="SLSQP",
        bounds=list(zip(lower, upper, strict=True)),
        constraints={"type": "ineq", "fun": slack},
    )
    assert least.success and least.fun == pytest.approx(F[0, 0], rel=1e-3)
    assert least.x == pytest.approx([0.244369, 6.21861, 8.29147, 0.244369], rel=2e-3)
    assert compiled.evaluate(np.array([[1.0, 1.0, 10.0, 5.0]]))[0][0, 1] == pytest.approx(4.39e-4, rel=1e-3)  # stiffest: largest beam


def test_the_front_of_the_truss_is_that_of_weighted_sums_found_by_gradients():
    """The problem is convex but for the third area, which both objectives want small: weighted sums give every point of its front."""
    compiled = load("four_bar_truss").compile()
    J, box = four_bar_truss_reference(4001), [(v.lower, v.upper) for v in compiled.variables]
    for weight in (1e4, 3e4, 1e5):
        found = minimize(lambda x, w=weight: compiled.evaluate(x[None])[0][0] @ [1.0, w], [2.0] * 4, bounds=box, tol=1e-13)
        assert (J @ [1.0, weight]).min() == pytest.approx(found.fun, rel=1e-7)
    assert np.all(np.diff(J[:, 0]) >= 0) and np.all(np.diff(J[:, 1]) <= 0)
    F = compiled.evaluate(rows(compiled, 5000))[0]
    nearest = np.searchsorted(J[:, 0], F[:, 0], side="right") - 1
    assert np.all(F[:, 1] >= J[nearest, 1] - 1e-4)
    assert J[0] == pytest.approx([200 * (3 + 2 + 2**0.25), 0.04]) and len(J) == 4001
