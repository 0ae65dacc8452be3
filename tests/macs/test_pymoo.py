"""MACS as an algorithm of pymoo: its points are those of `macs.MACS`, and all that pymoo's users do with an algorithm works."""

import copy
import pickle
from typing import Any

import numpy as np
import pytest
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.constraints.eps import AdaptiveEpsilonConstraintHandling
from pymoo.core.callback import Callback
from pymoo.core.evaluator import Evaluator
from pymoo.core.individual import Individual
from pymoo.core.population import Population
from pymoo.core.problem import ElementwiseProblem, Problem
from pymoo.core.termination import NoTermination, TerminateIfAll
from pymoo.core.variable import Binary, Choice, Integer, Real, Variable
from pymoo.operators.sampling.lhs import LHS
from pymoo.optimize import minimize
from pymoo.problems import get_problem
from pymoo.termination import get_termination
from pymoo.termination.collection import TerminationCollection
from pymoo.termination.default import DefaultMultiObjectiveTermination
from pymoo.util.archive import MultiObjectiveArchive

import macs
from macs.decisions import ReferencePoint
from macs.pymoo import MACS, most_evaluations
from macs.search.rounds import PLANNED_EVALUATIONS


class Equality(ElementwiseProblem):
    """Two distances on a circle, which is a constraint: the front is its arc between the two points."""

    def __init__(self) -> None:
        super().__init__(n_var=2, n_obj=2, n_eq_constr=1, xl=-2.0, xu=2.0)

    def _evaluate(self, x: np.ndarray, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        out["F"] = [(x[0] - 1) ** 2 + x[1] ** 2, x[0] ** 2 + (x[1] - 1) ** 2]
        out["H"] = [x[0] ** 2 + x[1] ** 2 - 1]


class Holes(Problem):
    """Schaffer's problem, whose evaluations fail where x lies in (0.5, 1.5), or everywhere."""

    def __init__(self, everywhere: bool = False) -> None:
        super().__init__(n_var=1, n_obj=2, xl=-4.0, xu=4.0, vtype=float)
        self.everywhere = everywhere

    def _evaluate(self, X: np.ndarray, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        F = np.hstack([X**2, (X - 2) ** 2])
        F[np.abs(X[:, 0] - 1) < 0.5 if not self.everywhere else slice(None), 0] = np.nan
        out["F"] = F


class Nowhere(ElementwiseProblem):
    """A problem without feasible points; the least violation is 1, at x = 0."""

    def __init__(self) -> None:
        super().__init__(n_var=3, n_obj=2, n_ieq_constr=1, xl=-1.0, xu=1.0)

    def _evaluate(self, x: np.ndarray, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        out["F"], out["G"] = [x[0], -x[0]], [1 + np.sum(x**2)]


def ordered(*columns: Any) -> np.ndarray:
    rows = np.hstack([np.atleast_2d(one) for one in columns])
    return rows[np.lexsort(rows.T)]


def of(front: macs.Front) -> np.ndarray:
    """Variables and objectives of a front, as those of a result."""
    return ordered([point.decision for point in front], front.objectives)


def ready(problem: Any, termination: Any = ("n_eval", 600), **settings: Any) -> MACS:
    algorithm = MACS(**settings)
    algorithm.setup(problem, termination=termination, seed=3)
    return algorithm


def finished(algorithm: MACS) -> np.ndarray:
    """Variables and objectives of the result, after `next` up to the end."""
    res = algorithm.run()
    return ordered(res.X, res.F)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("zdt4", {"agents": 20, "archive": 50, "variant": "paper"}),
        ("bnh", {}),
        ("g1", {}),
        ("rosenbrock", {}),
        ("zdt1", {"archive": 20, "prefer": ReferencePoint({"f1": 0.2, "f2": 0.6})}),
    ],
)
def test_the_points_are_those_of_macs_to_the_last_bit(name, settings):
    problem = get_problem(name)
    front = macs.MACS(**({"archive": 100} | settings)).minimize(problem, evaluations=1111, seed=5)
    res = minimize(problem, MACS(**settings), ("n_eval", 1111), seed=5)
    assert res.algorithm.evaluator.n_eval == 1111 == front.stats["evaluations"]
    assert len(front) and np.array_equal(ordered(res.X, res.F), of(front))


@pytest.mark.slow
def test_the_paper_is_the_same_too():
    front = macs.MACS.paper(archive=20).minimize(get_problem("zdt2"), evaluations=500, seed=2)
    res = minimize(get_problem("zdt2"), MACS.paper(archive=20, save_history=True), ("n_eval", 500), seed=2)
    assert np.array_equal(ordered(res.X, res.F), of(front)) and len(res.history) == res.algorithm.n_gen - 1


def test_the_size_of_the_archive_and_what_it_may_not_be():
    assert len(minimize(get_problem("bnh"), MACS(), ("n_eval", 1_500), seed=1).F) == 100 == NSGA2().pop_size
    assert MACS.paper().search.archive == macs.MACS.paper().archive
    res = minimize(get_problem("dtlz2", n_obj=6), MACS(archive=40), ("n_eval", 1_000), seed=1)
    assert res.F.shape == (40, 6) and np.linalg.norm(res.F, axis=1).min() >= 1 - 1e-12
    with pytest.raises(ValueError, match="archive must have at least one point for each of the 6 objectives"):
        minimize(get_problem("dtlz2", n_obj=6), MACS(archive=5), ("n_eval", 100))
    with pytest.raises(ValueError, match="MACS: prefer"):
        minimize(get_problem("zdt1"), MACS(prefer=ReferencePoint({"mass": 0.2})), ("n_eval", 100))


def test_without_a_budget_it_is_the_search_without_one():
    seen: list[np.ndarray] = []
    macs.MACS(archive=15).minimize(get_problem("zdt3"), seed=4, callback=lambda progress: seen.append(progress.F) or len(seen) == 12)
    res = minimize(get_problem("zdt3"), MACS(archive=15), ("n_gen", 13), seed=4)
    assert np.array_equal(res.F, seen[-1]) and res.algorithm.n_gen == 14


@pytest.mark.slow
def test_equality_constraints_are_met_as_pymoo_asks():
    res = minimize(Equality(), MACS(), ("n_eval", 3_000), seed=1)
    assert len(res.F) > 5 and (np.abs(res.H) <= 1e-4).all() and (res.CV == 0).all()
    assert np.abs(np.linalg.norm(res.X, axis=1) - 1).max() < 1e-4 and (res.X > -0.1).all()


def test_points_are_judged_by_what_they_are_told_with():
    """Also by an equality that the problem does not declare."""
    problem = Problem(n_var=2, n_obj=2, xl=0.0, xu=2.0)
    algorithm = MACS().setup(problem, termination=("n_eval", 400), seed=1)
    for _ in range(30):
        asked = algorithm.ask()
        X = asked.get("X")
        asked.set("F", X, "H", 1.0 - X.sum(axis=1, keepdims=True))
        for one in asked:
            one.evaluated.update(("F", "H"))
        algorithm.tell(infills=asked)
    H = algorithm.opt.get("H")
    assert len(H) == 1 or np.abs(H).max() <= 1e-4


def test_the_budget_is_that_of_the_termination_and_never_exceeded():
    for termination, most in (
        (("n_eval", 7), 7),
        (("n_eval", 503), 503),
        (get_termination("n_eval", 50.5), 51),
        (TerminationCollection(get_termination("n_eval", 80), get_termination("n_gen", 1000)), 80),
        (DefaultMultiObjectiveTermination(n_max_evals=130), 130),
    ):
        res = minimize(get_problem("zdt1"), MACS(), termination, seed=1)
        assert res.algorithm.evaluator.n_eval == most
    both = get_termination("n_eval", 100), get_termination("n_gen", 5)
    assert most_evaluations(TerminationCollection(*both)) == 100
    assert most_evaluations(TerminateIfAll(*both)) == np.inf == most_evaluations(NoTermination())
    assert most_evaluations(get_termination("n_eval")) == np.inf
    assert most_evaluations(DefaultMultiObjectiveTermination()) == 100_000
    assert most_evaluations(DefaultMultiObjectiveTermination(), default=False) == np.inf


def test_a_run_that_finds_nothing_to_evaluate_ends(monkeypatch):
    monkeypatch.setattr("macs.search.macs.MACS.advance", lambda self, state, evaluator, budget: None)
    res = minimize(get_problem("zdt1"), MACS(archive=10), ("n_eval", 500), seed=1)
    assert res.algorithm.evaluator.n_eval == 10 and res.algorithm.n_gen == 102
    asked = ready(get_problem("zdt1"))
    batches = [len(asked.tell(infills=asked.evaluator.eval(asked.problem, asked.ask()))) for _ in range(3)]
    assert len(batches) == 3 and asked.n_gen == 4 and len(asked.ask()) == 0


@pytest.mark.slow
def test_the_same_seed_gives_the_same_points():
    one, same, other = (minimize(get_problem("zdt1"), MACS(), ("n_eval", 300), seed=seed).X for seed in (1, 1, 2))
    assert np.array_equal(one, same) and not np.array_equal(one, other)
    assert not np.array_equal(*(minimize(get_problem("zdt1"), MACS(), ("n_eval", 60)).X for _ in range(2)))
    assert np.array_equal(minimize(get_problem("zdt1"), MACS(seed=1), ("n_eval", 300)).X, one)


def test_callbacks_see_each_iteration_and_may_end_the_run():
    class Watch(Callback):
        def __init__(self) -> None:
            super().__init__()
            self.data["seen"] = []

        def notify(self, algorithm: MACS) -> None:
            spent, off = algorithm.evaluator.n_eval, len(algorithm.off)
            self.data["seen"].append((algorithm.n_gen, spent, off, algorithm.pop.get("F").min(), len(algorithm.opt)))
            assert set(algorithm.off.get("n_gen")) == {algorithm.n_gen}
            if spent > 400:
                algorithm.termination.terminate()

    res = minimize(get_problem("zdt1"), MACS(archive=10), ("n_eval", 5000), callback=Watch(), seed=1)
    generations, spent, off, best, points = zip(*res.algorithm.callback.data["seen"], strict=True)
    assert generations == tuple(range(1, len(spent) + 1)) and np.array_equal(np.cumsum(off), spent)
    assert spent[-2] > 400 and spent[-3] <= 400 and (np.diff(best) <= 0).all() and points[-1] == 10
    assert res.exec_time > 0 and res.algorithm.n_gen == len(spent) + 1


def test_results_have_populations():
    res = minimize(get_problem("bnh"), MACS(archive=10), ("n_eval", 500), seed=1)
    assert {id(one) for one in res.opt} <= {id(one) for one in res.pop} and 10 <= len(res.pop) <= 20
    assert all(one.evaluated == {"F", "G", "H"} for one in res.pop)
    X, F, G = res.opt.get("X", "F", "G")
    expected = res.problem.evaluate(X, return_values_of=["F", "G"])
    assert np.array_equal(F, expected[0]) and np.array_equal(G, expected[1]) and np.array_equal(F, res.F)
    res = minimize(get_problem("zdt1"), MACS(), ("n_eval", 400), seed=1, archive=MultiObjectiveArchive())
    assert {F.tobytes() for F in res.F} <= {F.tobytes() for F in res.archive.get("F")}


def test_verbose_prints_pymoos_columns(capsys):
    minimize(get_problem("bnh"), MACS(), ("n_gen", 3), seed=1, verbose=True)
    head, *rows = [line for line in capsys.readouterr().out.splitlines() if "|" in line]
    assert [word.strip() for word in head.split("|")[:3]] == ["n_gen", "n_eval", "n_nds"] and len(rows) == 3
    minimize(get_problem("sphere"), MACS(), ("n_gen", 2), seed=1, verbose=True)
    assert "f_min" in capsys.readouterr().out
    minimize(get_problem("sphere"), MACS(), ("n_gen", 2), seed=1)
    assert capsys.readouterr().out == ""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("copied", "name"), [(copy.deepcopy, "zdt1"), (lambda algorithm: pickle.loads(pickle.dumps(algorithm)), "bnh")], ids=["copy", "pickle"]
)
def test_copies_in_the_middle_go_on_to_the_same_points(copied, name):
    expected = finished(ready(get_problem(name)))
    algorithm = ready(get_problem(name))
    assert np.array_equal(finished(copied(algorithm)), expected)
    for _ in range(4):
        algorithm.next()
    other = copied(algorithm)
    for _ in range(3):
        other.tell(infills=other.evaluator.eval(other.problem, other.ask()))
    assert np.array_equal(finished(copied(other)), expected)
    other.ask()
    assert np.array_equal(finished(copied(other)), expected)
    assert np.array_equal(finished(algorithm), expected)


def test_a_copy_made_by_a_callback_goes_on(tmp_path):
    """As pymoo's users do for checkpoints: the generation of the copy has not been counted yet."""

    class Keep(Callback):
        def notify(self, algorithm: MACS) -> None:
            if algorithm.n_gen == 5:
                (tmp_path / "checkpoint").write_bytes(pickle.dumps(algorithm.__dict__ | {"callback": None}))

    res = minimize(get_problem("zdt1"), MACS(), ("n_eval", 600), seed=3, callback=Keep())
    again = MACS()
    again.__dict__.update(pickle.loads((tmp_path / "checkpoint").read_bytes()) | {"callback": Callback()})
    assert np.array_equal(finished(again), ordered(res.X, res.F))


def test_a_budget_may_come_and_go():
    algorithm = ready(get_problem("zdt1"), ("n_eval", 100))
    algorithm.run()
    algorithm.termination = get_termination("n_gen", algorithm.n_gen + 2)
    algorithm.run()
    between = algorithm.evaluator.n_eval
    algorithm.termination = get_termination("n_eval", between + 33)
    algorithm.run()
    assert 100 < between < PLANNED_EVALUATIONS and algorithm.evaluator.n_eval == between + 33


@pytest.mark.slow
def test_an_interrupt_loses_no_evaluation():
    class Interrupted(Evaluator):
        def _eval(self, *args: Any, **kwargs: Any) -> None:
            if self.n_eval > 150 and not self.interrupted:
                self.interrupted = True
                raise KeyboardInterrupt
            super()._eval(*args, **kwargs)

        interrupted = False

    expected = finished(ready(get_problem("zdt1")))
    for asks in (False, True):
        algorithm = ready(get_problem("zdt1"), evaluator=Interrupted())
        with pytest.raises(KeyboardInterrupt):
            while True:
                algorithm.ask()
                algorithm.next()
        assert 150 < algorithm.evaluator.n_eval < 250
        while asks and algorithm.evaluator.n_eval < 400:
            algorithm.tell(infills=algorithm.evaluator.eval(algorithm.problem, algorithm.ask()))
        assert np.array_equal(finished(algorithm), expected) and algorithm.evaluator.n_eval == 600


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bnh", "sphere"])
def test_ask_and_tell_give_the_same_points(name):
    expected, problem = ready(get_problem(name)), get_problem(name)
    points = finished(expected)
    algorithm, generations = ready(problem), []
    algorithm.callback = lambda algorithm: generations.append(algorithm.n_gen)
    while algorithm.has_next():
        infills = algorithm.ask()
        assert np.array_equal(algorithm.ask().get("X"), infills.get("X"))
        algorithm.evaluator.eval(problem, infills)
        algorithm.tell(infills=infills)
    res = algorithm.result()
    assert np.array_equal(ordered(res.X, res.F), points)
    assert generations == list(range(1, expected.n_gen)) and algorithm.n_gen == expected.n_gen and algorithm.evaluator.n_eval == 600


def test_what_is_told_has_to_be_what_was_asked_for():
    problem = get_problem("zdt1")
    algorithm = ready(problem, archive=10)
    infills = algorithm.ask()
    with pytest.raises(ValueError, match="tell: individuals without values"):
        algorithm.tell(infills=infills)
    algorithm.evaluator.eval(problem, infills)
    with pytest.raises(ValueError, match="tell: 7 individuals, but 10 were asked for"):
        algorithm.tell(infills=infills[:7])
    algorithm.tell(infills=infills)
    assert algorithm.n_gen == 2
    with pytest.raises(ValueError, match="setup"):
        MACS().next()


def test_first_points_are_a_start_and_evaluated_ones_are_not_evaluated_again():
    problem = get_problem("zdt1", n_var=4)
    X = np.random.default_rng(0).random((30, 4))
    front = macs.MACS(archive=15).minimize(problem, evaluations=300, seed=1, start=X)
    for sampling in (X, X.tolist(), Population.new(X=X)):
        res = minimize(problem, MACS(archive=15, sampling=sampling), ("n_eval", 300), seed=1)
        assert np.array_equal(ordered(res.X, res.F), of(front))
    beyond = np.vstack([X[:1], np.full((1, 4), 1 + 1e-9)])
    assert np.array_equal(ready(problem, sampling=beyond).ask().get("X")[:2], np.clip(beyond, 0, 1)) and beyond.max() > 1
    few = minimize(problem, MACS(archive=10, sampling=X[0]), ("n_gen", 1), seed=1)
    assert few.algorithm.evaluator.n_eval == 10 and np.array_equal(few.algorithm.off[0].X, X[0])
    known = Evaluator().eval(problem, Population.new(X=X))
    res = minimize(problem, MACS(archive=15, sampling=known), ("n_eval", 300), seed=1)
    front = macs.MACS(archive=15).minimize(problem, evaluations=330, seed=1, start=X)
    assert res.algorithm.evaluator.n_eval == 300
    assert np.array_equal(ordered(res.X, res.F), of(front))
    res = minimize(problem, MACS(archive=15, sampling=known), ("n_gen", 1), seed=1)
    assert res.algorithm.evaluator.n_eval == 0 and len(res.algorithm.off) == 30
    many = minimize(problem, MACS(sampling=np.random.default_rng(0).random((PLANNED_EVALUATIONS + 5, 4))), ("n_gen", 1), seed=1)
    assert many.algorithm.evaluator.n_eval == PLANNED_EVALUATIONS + 5


def test_sampling_of_pymoo_draws_the_first_population():
    one, same = (minimize(get_problem("zdt1"), MACS(archive=40, sampling=LHS()), ("n_gen", 2), seed=1) for _ in range(2))
    assert np.array_equal(one.X, same.X)
    first = ready(get_problem("zdt1"), ("n_gen", 2), archive=40, sampling=LHS())
    assert len(first.ask()) == 40


@pytest.mark.parametrize(
    ("X", "message"), [([[0.5, 2.0]], "outside its bounds"), ([[0.5]], "1 entries, 2 expected"), ([[0.5, np.nan]], "nan")]
)
def test_wrong_first_points_are_refused(X, message):
    with pytest.raises(ValueError, match=f"^sampling: .*{message}"):
        minimize(get_problem("zdt1", n_var=2), MACS(sampling=X), ("n_eval", 50))


def test_failed_evaluations_stop_nothing_and_where_all_fail_there_is_no_result():
    res = minimize(Holes(), MACS(archive=10), ("n_eval", 800), seed=2, verbose=False)
    assert np.isfinite(res.F).all() and len(res.F) == 10 and ((np.abs(res.X - 1) >= 0.5) & (np.abs(res.X - 1) <= 1 + 1e-3)).all()
    front = macs.MACS().minimize(Holes(), evaluations=800, seed=2)
    assert np.array_equal(ordered(res.X, res.F), of(front))
    res = minimize(Holes(everywhere=True), MACS(), ("n_eval", 200), seed=1)
    assert res.X is None and res.F is None and res.opt is None and np.isinf(res.pop.get("CV")).all()
    assert res.algorithm.evaluator.n_eval == 200
    res = minimize(Holes(everywhere=True), MACS(), seed=1, verbose=True)
    assert res.F is None


@pytest.mark.slow
def test_where_nothing_is_feasible_the_least_infeasible_point_is_returned_if_asked_for():
    res = minimize(Nowhere(), MACS(), ("n_eval", 1_000), seed=1)
    assert res.X is None and len(res.algorithm.opt) == 1
    res = minimize(Nowhere(), MACS(), ("n_eval", 1_000), seed=1, return_least_infeasible=True)
    assert res.X.shape == (1, 3) and np.abs(res.X).max() < 0.1 and 1 <= res.CV[0, 0] < 1.01
    front = macs.MACS(archive=100).minimize(Nowhere(), evaluations=1_000, seed=1)
    assert np.array_equal(res.X[0], front.closest.decision)


def test_what_is_feasible_is_in_the_individuals_config(monkeypatch):
    def config() -> dict[str, Any]:
        ours = Individual_config()
        ours["cv_eq"] = ours["cv_eq"] | {"eps": 0.05}
        return ours

    Individual_config = Individual.default_config
    monkeypatch.setattr(Individual, "default_config", staticmethod(config))
    res = minimize(Equality(), MACS(), ("n_eval", 1_500), seed=1)
    assert 1e-3 < np.abs(res.H).max() <= 0.05 and (res.CV == 0).all()


def test_only_known_variables_with_bounds_settings_of_the_algorithm_and_constraints_that_stay():
    class Odd(ElementwiseProblem):
        def __init__(self) -> None:
            super().__init__(vars={"a": Real(bounds=(0, 1)), "b": Variable()}, n_obj=1)

    for problem, message in (
        (Odd(), "pymoo problem Odd has a variable 'b' of the class Variable"),
        (Problem(n_var=2, n_obj=2, xl=0, xu=1, vtype=str), "problem Problem has variables of type str"),
        (Problem(n_var=2, n_obj=2, xl=0, xu=9.5, vtype=int), "variable 'x1', a whole number, must be whole numbers"),
        (Problem(n_var=2, n_obj=2), "no bounds"),
        (Problem(n_var=2, n_obj=2, xl=np.zeros(2), xu=np.array([1.0, np.inf])), "variable 'x2'"),
    ):
        with pytest.raises(ValueError, match=message):
            minimize(problem, MACS(), ("n_eval", 10))
        with pytest.raises(ValueError, match=message):
            macs.NSGA2(population=4).minimize(problem, evaluations=10)
    for name, value in {"agents": 20, "archive": 50}.items():
        with pytest.raises(ValueError, match=rf"{name} is a setting of the algorithm: MACS\({name}={value}\)"):
            minimize(get_problem("zdt1"), MACS(), ("n_eval", 10), **{name: value})
    with pytest.raises(ValueError, match="may not change"):
        minimize(get_problem("bnh"), AdaptiveEpsilonConstraintHandling(MACS()), ("n_eval", 10))


def test_whole_numbers_and_choices_are_searched_as_they_are_and_as_by_macs():
    class Mixed(ElementwiseProblem):
        def __init__(self) -> None:
            kinds = {"n": Integer(bounds=(1, 40)), "m": Choice(options=["al", "st"]), "x": Real(bounds=(0, 1)), "b": Binary()}
            super().__init__(vars=kinds, n_obj=2)

        def _evaluate(self, x, out, *args, **kwargs):
            assert isinstance(x["n"], int) and isinstance(x["b"], bool)
            cost = {"al": 1.0, "st": 2.0}[x["m"]]
            out["F"] = [x["n"] * cost + x["x"], 10 / cost / x["n"] + (x["x"] - 0.5) ** 2 + x["b"]]

    found = minimize(Mixed(), MACS(), ("n_eval", 300), seed=1)
    ours = macs.MACS(archive=100).minimize(Mixed(), evaluations=300, seed=1)
    assert np.array_equal(np.sort(found.F[:, 0]), np.sort(ours.F[:, 0]))
    assert ours[0].parameters["m"] == "al" and ours[0].parameters["n"] == 1 and found.X[0].keys() == ours[0].parameters.keys()

    class Whole(Problem):
        def __init__(self) -> None:
            super().__init__(n_var=2, n_obj=2, xl=0, xu=6, vtype=int)

        def _evaluate(self, X, out, *args, **kwargs):
            assert X.dtype == int
            out["F"] = np.column_stack([(X**2).sum(axis=1), ((X - 5) ** 2).sum(axis=1)])

    result = minimize(Whole(), MACS(), ("n_eval", 200), seed=1)
    assert result.algorithm.evaluator.n_eval == 49 and result.X.dtype == int and (np.abs(result.X[:, 0] - result.X[:, 1]) <= 1).all()


def test_settings_are_refused_as_those_of_macs():
    for name, value in {"agents": 2, "rho": 0.5, "mesh": "fine", "archive": MultiObjectiveArchive(), "variant": "quick"}.items():
        with pytest.raises(ValueError, match=r"^MACS: ") as ours:
            MACS(**{name: value})
        with pytest.raises(ValueError) as theirs:
            macs.MACS(**{name: value})
        assert str(ours.value) == str(theirs.value)
    with pytest.raises(TypeError, match=r"agent.*agents"):
        MACS(agent=5)
    for setting in ({"mesh": "adaptive"}, {"polish_on": "dfet:4x3"}):
        with pytest.raises(ValueError, match="does not apply, since 'ZDT1' is a vector problem"):
            minimize(get_problem("zdt1"), MACS(**setting), ("n_eval", 10))
    minimize(get_problem("zdt1"), MACS(refine=False, mesh="fixed", ceiling=5), ("n_eval", 10))
