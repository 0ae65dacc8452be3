"""The baselines: pymoo's own bits, states that are data, exact budgets, failures, constraints, moved points, starts, known fronts."""

import sys
import warnings
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest
from boxes import boxed
from fronts import mean_distance
from plain import dtlz, zdt
from pymoo.algorithms.moo import ctaea, moead, mopso_cd, nsga2, nsga3, rvea, sms
from pymoo.core.problem import Problem
from pymoo.optimize import minimize
from pymoo.problems import get_problem
from pymoo.util.ref_dirs import get_reference_directions

from macs import AGEMOEA2, CTAEA, MOEAD, MOPSO, MOPSOCD, NSGA2, NSGA3, RVEA, SMSEMOA
from macs.evaluation.evaluator import Counts, Evaluation, Evaluator
from macs.pareto.dominance import nondominated
from macs.solvers.packing import decode, encode
from macs.solvers.solver import solver, solver_class
from problems import load
from transcription import DFET

NUMBA = find_spec("numba") is not None
"""Without it, all but AGE-MOEA-II is tested."""


def age(population: int) -> Any:
    """AGE-MOEA-II as a parameter of a slow test, without numba of one that is skipped: its first use compiles what pymoo has of it."""
    settings = AGEMOEA2(population=population) if NUMBA else None
    return pytest.param(settings, id="AGEMOEA2", marks=[pytest.mark.slow, pytest.mark.skipif(not NUMBA, reason="without numba")])


CUBE = [(-2.0, 2.0)] * 3
SMALL = [
    NSGA2(population=12),
    NSGA3(divisions=11),
    MOEAD(divisions=11, neighbors=5),
    MOEAD(divisions=11, batch=True),
    MOPSOCD(particles=12),
    MOPSO(particles=12),
    SMSEMOA(population=12),
    RVEA(divisions=11),
    CTAEA(divisions=11),
    age(12),
]
HANDLED = [replace(one, handling="objective" if k % 2 else "penalty") for k, one in enumerate(SMALL[:-1])]
"""Each way of handling constraints with half of the algorithms; feasible-first is in `SMALL`."""


def named(settings: Any) -> str | None:
    if settings is None:
        return None
    return f"{type(settings).__name__}-{settings.handling}" + ("-batch" if getattr(settings, "batch", False) else "")


def stored(state: Any) -> Any:
    """The state as it comes back from a checkpoint."""
    return decode(encode(state), type(state))


def run(settings: Any, box: Evaluator, budget: int, seed: int = 1, between: Any = None) -> Any:
    state = settings.begin(box, budget, np.random.default_rng(seed))
    for _ in range(100 * budget):
        if box.counts.evaluations >= budget:
            return state
        state = state if between is None else between(state)
        settings.advance(state, box, budget)
    raise AssertionError("the search does not come to its end")


def schaffer(X: np.ndarray) -> np.ndarray:
    return np.stack([(X**2).sum(axis=1), ((X - 1) ** 2).sum(axis=1)], axis=1)


# pymoo's own


def theirs(settings: Any, m: int) -> Any:
    """The algorithm of pymoo that the settings are to equal."""
    if isinstance(settings, NSGA2):
        return nsga2.NSGA2(pop_size=settings.population)
    if isinstance(settings, SMSEMOA):
        return sms.SMSEMOA(pop_size=settings.population)
    if isinstance(settings, AGEMOEA2):
        from pymoo.algorithms.moo import age2

        return age2.AGEMOEA2(pop_size=settings.population)
    if isinstance(settings, MOPSOCD):
        return mopso_cd.MOPSO_CD(pop_size=settings.particles, archive_size=settings.archive)
    directions = get_reference_directions("das-dennis", m, n_partitions=settings.divisions or (99 if m == 2 else 12))
    if isinstance(settings, NSGA3):
        return nsga3.NSGA3(directions, pop_size=settings.population)
    if isinstance(settings, RVEA):
        return rvea.RVEA(directions, pop_size=settings.population, alpha=settings.alpha, adapt_freq=settings.adapt_every)
    if isinstance(settings, CTAEA):
        return ctaea.CTAEA(directions)
    algorithm = moead.ParallelMOEAD if settings.batch else moead.MOEAD
    return algorithm(directions, n_neighbors=settings.neighbors)


CASES = [
    *((settings, name) for settings in (NSGA2(), NSGA3(), MOPSOCD(archive=500), SMSEMOA(), RVEA(), CTAEA()) for name in ("zdt4", "dtlz2")),
    *((MOEAD(divisions=divisions, batch=batch), name) for batch in (False, True) for divisions, name in ((19, "zdt1"), (4, "dtlz2"))),
    (RVEA(population=20, divisions=4, alpha=1.0, adapt_every=0.3), "dtlz7"),
    *((settings, "dtlz2") for settings in (NSGA3(divisions=3), MOPSOCD(particles=20, archive=500), CTAEA(divisions=3))),
]


@pytest.mark.parametrize(("settings", "name"), CASES, ids=lambda value: value if isinstance(value, str) else named(value))
def test_they_are_pymoo_s_own_to_the_last_bit_if_interrupted_too(settings: Any, name: str) -> None:
    problem, generations = get_problem(name), 5
    with warnings.catch_warnings():
        truth = minimize(problem, theirs(settings, problem.n_obj), ("n_gen", generations), seed=5)
    unused = settings.particles if isinstance(settings, MOPSOCD) else 0  # a first swarm that pymoo evaluates and throws away
    state = run(settings, boxed(problem), truth.algorithm.evaluator.n_eval - unused, seed=5, between=stored)
    assert np.array_equal(state.members.F, truth.pop.get("F"))
    assert np.array_equal(state.members.Z, truth.pop.get("X"))
    kept = np.unique(truth.F, axis=0)
    assert np.array_equal(np.unique(state.archive.F, axis=0), kept[nondominated(kept)])


def test_so_are_fronts() -> None:
    problem = get_problem("zdt1")
    truth = minimize(problem, theirs(NSGA2(), 2), ("n_eval", 500), seed=5)
    front = NSGA2().minimize(problem, evaluations=500, seed=5)
    assert np.array_equal(front.F, np.unique(truth.F, axis=0))
    assert front.stats["evaluations"] == 500 == truth.algorithm.evaluator.n_eval
    assert front.stats["stopped"] == "budget" and front.stats["reproducible"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings",
    [NSGA2(population=40), SMSEMOA(population=40), age(40), RVEA(population=40, divisions=6), CTAEA(divisions=7)],
    ids=lambda settings: type(settings).__name__,
)
def test_with_one_constraint_they_are_still_pymoo_s_own_if_interrupted_too(settings: Any) -> None:
    class Ring(Problem):
        def __init__(self) -> None:
            super().__init__(n_var=4, n_obj=3, n_ieq_constr=1, xl=-2.0, xu=2.0)

        def _evaluate(self, X: np.ndarray, out: dict, *args: Any, **kwargs: Any) -> None:
            out["F"] = np.stack([((X - middle) ** 2).sum(axis=1) for middle in (0, 1, [1, 0, 0, -1])], axis=1)
            out["G"] = (0.81 - ((X - 0.5) ** 2).sum(axis=1))[:, None] * (X[:, :1] < 1.5)

    truth = minimize(Ring(), theirs(settings, 3), ("n_gen", 15), seed=2)
    budget = truth.algorithm.evaluator.n_eval
    for between in (None, stored):
        state = run(settings, boxed(Ring(), tolerance=0.0), budget, seed=2, between=between)
        assert np.array_equal(state.members.F, truth.pop.get("F"))
        kept = np.unique(truth.opt[truth.opt.get("feas")].get("F"), axis=0)
        assert np.array_equal(np.unique(state.archive.F, axis=0), kept[nondominated(kept)])
    if isinstance(settings, CTAEA):
        assert np.array_equal(state.diversity.F, truth.algorithm.da.get("F"))


@pytest.mark.slow
@pytest.mark.parametrize("settings", [SMALL[0], *SMALL[6:]], ids=named)
def test_they_draw_from_no_generator_but_the_run_s(settings: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    class Forbidden:
        def __getattr__(self, name: str) -> Any:
            raise AssertionError(f"{name} drawn from a generator without a seed")

    seeded = np.random.default_rng
    monkeypatch.setattr(np.random, "default_rng", lambda seed=None: Forbidden() if seed is None else seeded(seed))
    monkeypatch.setattr(np.random.mtrand, "_rand", Forbidden())
    for function in (schaffer, partial(tied, 0.0), partial(tied, 1.0)):
        run(settings, boxed(function, CUBE), 150)


def tied(share: float, X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points with equal objectives, and with a few violations, so that much is equal."""
    return np.round(schaffer(X)), np.round(X[:, :1] + share)


def constrained(X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Feasible in a ring that few first candidates are in."""
    return schaffer(X), np.abs(((X - 0.5) ** 2).sum(axis=1, keepdims=True) - 1) - 0.1


@pytest.mark.parametrize("settings", [*SMALL, *HANDLED], ids=named)
def test_a_state_that_was_data_for_a_while_goes_on_with_the_same_bits_and_another_seed_with_others(settings: Any) -> None:
    box = partial(boxed, constrained, CUBE)
    straight = run(settings, box(), 80)
    assert encode(run(settings, box(), 80, between=stored)) == encode(straight)
    assert not np.array_equal(run(settings, box(), 80, seed=2).members.Z, straight.members.Z)


@pytest.mark.parametrize("budget", [1, 11, 13, 57])
@pytest.mark.parametrize("settings", SMALL, ids=named)
def test_the_budget_is_met_exactly(settings: Any, budget: int) -> None:
    rows: list[int] = []
    front = settings.minimize(lambda X: rows.append(len(X)) or schaffer(X), CUBE, evaluations=budget, seed=1)
    assert sum(rows) == budget == front.stats["evaluations"]
    assert len(front) and nondominated(front.F).all()


@pytest.mark.parametrize("settings", [*SMALL, *HANDLED], ids=named)
def test_failures_and_constraints_stop_no_solver(settings: Any) -> None:
    def function(X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        F, G = constrained(X)
        F[X[:, 0] > 0.8] = np.nan
        return F, G

    front = settings.minimize(function, CUBE, evaluations=250, seed=3)
    assert len(front) >= (1 if settings.handling == "objective" else 3)  # there the population is spread over the infeasible ones too
    assert (front.violation <= 1e-6).all() and (front.decision[:, 0] <= 0.8).all() and front.stats["failures"]["failed"] > 0
    assert nondominated(front.F).all() and set(front.status) == {"converged"}


@pytest.mark.parametrize("settings", [*SMALL, *HANDLED], ids=named)
@pytest.mark.parametrize("what", ["infeasible", "failed"])
def test_without_feasible_points_the_message_has_the_nearest(settings: Any, what: str) -> None:
    seen: list[float] = []

    def function(X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        G = 1 + (X**2).sum(axis=1, keepdims=True)
        seen.extend(G[:, 0])
        return schaffer(X) if what == "infeasible" else np.full((len(X), 2), np.nan), G

    front = settings.minimize(function, CUBE, evaluations=96, seed=3)
    assert len(front) == 0 and front.message.startswith("no feasible point in 96 evaluations") and front.closest is not None
    if what == "infeasible":
        assert front.closest.violation == min(seen)
        if settings.handling == "feasible-first":
            assert min(seen) < 1.5  # it went for the least violation


@pytest.mark.parametrize("settings", SMALL, ids=named)
def test_feasible_points_come_before_infeasible_ones_at_any_size_of_numbers(settings: Any) -> None:
    def function(X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return 1e9 * schaffer(X), 1e-4 * (np.abs(X - 1.4).sum(axis=1, keepdims=True) - 1.2)

    front = settings.minimize(function, CUBE, evaluations=250, seed=2, tolerance=1e-12)
    assert len(front) and (np.abs(front.decision - 1.4).sum(axis=1) <= 1.2 + 1e-7).all()
    assert front.F[:, 1].min() <= 0.6e9  # 0, at x = (1, 1, 1)


@pytest.mark.parametrize("settings", SMALL, ids=named)
@pytest.mark.parametrize("count", [1, 30])
def test_a_start_is_evaluated_first_and_is_of_use(settings: Any, count: int) -> None:
    asked: list[np.ndarray] = []
    start = np.linspace(0, 1, count)[:, None] * np.ones(3)
    front = settings.minimize(
        lambda X: asked.append(X.copy()) or schaffer(X), CUBE, evaluations=24, seed=1, start=np.vstack([start, start[:1]])
    )
    first = np.vstack(asked)[: min(count, 12)]
    wanted = start[np.linspace(0, count - 1, min(count, 12)).round().astype(int)]
    assert np.array_equal(first, wanted)
    kept = [(front.decision == one).all(axis=1).any() for one in start]
    assert any(kept) if isinstance(settings, RVEA) else (front.decision[0] == start[0]).all()  # it need not keep the ends of a front


class Moved(Evaluator):
    """Candidates come back on the sphere about the middle, and remember, in an entry that is not free, how often they were moved."""

    def __init__(self) -> None:
        self.free, self.lower, self.upper, self.period = np.arange(3), np.full(3, -2.0), np.full(3, 2.0), np.array([0.0, 0.0, 4.0])
        self.tolerance, self.counts, self.sent = 1e-9, Counts(), []

    def first_guess(self, candidates: np.ndarray) -> np.ndarray:
        return np.hstack([candidates, np.zeros((len(candidates), 1))])

    def _evaluate(self, Z: np.ndarray, way: int | None = None) -> tuple[Evaluation, int]:
        self.sent.append(Z.copy())
        Z = Z.copy()
        Z[:, :3] /= np.linalg.norm(Z[:, :3], axis=1, keepdims=True)
        Z[:, 3] += 1
        return Evaluation(Z, schaffer(Z[:, :3]), np.zeros(len(Z)), np.full(len(Z), "converged")), 0


@pytest.mark.parametrize("settings", SMALL, ids=named)
def test_the_population_goes_where_the_evaluator_moves_it_and_starts_from_there(settings: Any) -> None:
    box = Moved()
    state = run(settings, box, 100)
    assert np.allclose(np.linalg.norm(state.members.Z[:, :3], axis=1), 1)
    assert np.array_equal(state.members.F, schaffer(state.members.Z[:, :3]))
    assert (np.vstack(box.sent[-1:])[:, 3] >= 1).all() and state.members.Z[:, 3].max() >= 3
    assert np.abs(np.vstack(box.sent)[:, :3]).max() <= 2


@pytest.mark.slow
@pytest.mark.parametrize("settings", [SMALL[1], SMALL[2]], ids=named)
def test_they_solve_a_problem_of_trajectories(settings: Any) -> None:
    problem, mesh = load("goddard"), DFET(2, 4)
    front = settings.solve(problem, mesh, evaluations=30, seed=1)
    assert front.stats["evaluations"] == 30
    assert front.solver["name"] == type(settings).__name__
    assert len(front)
    assert front[0].trajectory is not None
    assert (front.violation <= 1e-6).all()
    again = settings.solve(problem, mesh, evaluations=15, seed=2, start=front)
    assert again.F[:, 0].min() <= front.F[:, 0].min() + 1e-6


REFUSED: list[tuple[type, dict[str, Any], str]] = [
    (NSGA2, {"population": 1}, "population must be a whole number of at least 2, not 1"),
    (NSGA2, {"handling": "death"}, "handling must be one of 'feasible-first', 'penalty', 'objective', not 'death'"),
    (NSGA2, {"penalty": -1.0}, r"penalty must be in \[0, inf\), not -1.0"),
    (NSGA2, {"degree": "mean"}, "degree must be one of 'largest', 'sum', 'log', 'capped', 'printed', not 'mean'"),
    (AGEMOEA2, {"mutation_eta": 0.5}, r"mutation_eta must be in \[1, 100\], not 0.5"),
    (NSGA3, {"divisions": 0}, "divisions must be a whole number of at least 1, not 0"),
    (NSGA3, {"whole": 1}, "whole must be True or False, not 1"),
    (MOEAD, {"neighbor_mating": 1.1}, "neighbor_mating"),
    (MOEAD, {"decomposition": "sum"}, "decomposition"),
    (MOEAD, {"batch": 2}, "batch must be True or False"),
    (RVEA, {"alpha": -1.0}, r"alpha must be in \[0, inf\), not -1.0"),
    (RVEA, {"adapt_every": 0.0}, r"adapt_every must be in \(0, 1\], not 0.0"),
    (CTAEA, {"population": 2.5}, "population must be a whole number of at least 2, not 2.5"),
    (MOPSOCD, {"particles": 1}, "particles must be a whole number of at least 2"),
    (MOPSO, {"particles": 0}, "particles must be a whole number of at least 1, not 0"),
    (MOPSO, {"cells": 2.5}, "cells must be a whole number of at least 1, not 2.5"),
    (MOPSO, {"final_inertia": -1}, r"final_inertia must be in \[0, inf\), not -1"),
]


@pytest.mark.parametrize(("kind", "settings", "message"), REFUSED, ids=lambda value: getattr(value, "__name__", None))
def test_settings_that_make_no_sense(kind: type, settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=f"{kind.__name__}: {message}"):
        kind(**settings)


@pytest.mark.parametrize(
    ("settings", "m", "message"),
    [
        *((kind(), 1, f"{kind.__name__} needs at least two objectives, not 1") for kind in (NSGA3, MOEAD, SMSEMOA, RVEA, CTAEA)),
        (NSGA3(population=2), 3, "NSGA3: population=2 is too few: 3 objectives"),
        (NSGA3(population=50, divisions=12), 3, "makes 91 reference directions with 3 objectives, more than population=50"),
        (NSGA3(population=120, divisions=3), 4, "makes 20 .* too few for population=120; divisions=7 makes 120"),
        (NSGA3(divisions=12, population=91, handling="objective"), 3, "makes 455 reference directions with 4 objectives"),
        (RVEA(population=50, divisions=12), 3, "RVEA: divisions=12 makes 91 .*, more than population=50"),
        (CTAEA(population=92, divisions=12), 3, "CTAEA: divisions=12 makes 91 .*, and population=92 needs as many"),
        (MOEAD(population=92, divisions=12), 3, "MOEAD: divisions=12 makes 91 reference directions with 3 objectives, and population=92"),
    ],
)
def test_directions_that_do_not_fit(settings: Any, m: int, message: str) -> None:
    def function(X: np.ndarray) -> np.ndarray:
        raise AssertionError("evaluated before the settings were refused")

    with pytest.raises(ValueError, match=message):
        settings.minimize(function, [(0, 1)] * 4, evaluations=500, names=[f"f{k}" for k in range(m)])


def test_objectives_whose_number_only_an_evaluation_tells_and_single_ones() -> None:
    for settings in (NSGA3(), MOEAD(population=5), RVEA(), CTAEA()):
        with pytest.raises(ValueError, match="at least two objectives"):
            settings.minimize(lambda X: X.sum(axis=1), [(0, 1)] * 4, evaluations=50)
    (function, bounds, _), rows = dtlz(2, 3), []
    NSGA3(divisions=4).minimize(lambda X: rows.append(len(X)) or function(X), bounds, evaluations=30, seed=1)
    assert rows == [1, 14, 15]  # the first of the fifteen gives the number of objectives
    before = list(warnings.filters)
    NSGA3().minimize(schaffer, CUBE, evaluations=300, seed=1)
    assert warnings.filters == before
    for settings in (NSGA2(population=20), MOPSOCD(particles=20)):
        front = settings.minimize(lambda X: (X**2).sum(axis=1, keepdims=True), CUBE, evaluations=300, seed=1)
        assert len(front) == 1 and front.F[0, 0] < 0.5


def test_the_whole_front_of_a_population_holds_the_nearest_to_the_directions_and_changes_nothing_else():
    function, bounds, _ = dtlz(2, 3)
    one, other = (NSGA3(population=20, divisions=4, whole=whole) for whole in (False, True))
    nearest, whole = (solver.minimize(function, bounds, evaluations=400, seed=4) for solver in (one, other))
    assert whole.stats["population"] == nearest.stats["population"] and len(whole) == whole.stats["population"]["nondominated"]
    assert len(nearest) < len(whole) and {tuple(F) for F in nearest.F} <= {tuple(F) for F in whole.F}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["smsemoa", "agemoea2", "rvea", "ctaea"])
@pytest.mark.parametrize(("plain", "evaluations", "limit"), [(zdt(1), 3000, 0.5), (dtlz(2, 3), 2000, 0.15)], ids=["zdt1", "dtlz2"])
def test_they_come_near_known_fronts(name: str, plain: Any, evaluations: int, limit: float) -> None:
    """First points are at a mean distance of more than 1.9 and 0.5."""
    if name == "agemoea2":
        pytest.importorskip("numba")
    function, bounds, truth = plain
    found = solver(name, population=36).minimize(function, bounds, evaluations=evaluations, seed=1)
    assert mean_distance(truth[::5], found.F) < limit


def test_failed_members_have_no_part_in_the_ranges_of_objectives() -> None:
    """As they are presented, their objectives are huge; beside these, all other points would be one."""
    largest: list[float] = []

    class Watched(SMSEMOA):
        def _restore(self, algorithm: Any, state: Any, individuals: Any) -> None:
            super()._restore(algorithm, state, individuals)
            largest.append(individuals.get("F").max())

    def function(X: np.ndarray) -> np.ndarray:
        F = schaffer(X)
        F[X[:, 0] > 0.3] = np.nan
        return F

    settings, box = Watched(population=12), boxed(function, CUBE)
    state = settings.begin(box, 60, np.random.default_rng(1))
    assert 0 < np.isnan(state.members.F[:, 0]).sum() < 12
    settings.advance(state, box, 60)
    assert len(largest) == 2 and max(largest) < 100


@pytest.mark.slow
def test_a_front_whose_points_are_all_equal_is_no_model() -> None:
    pytest.importorskip("numba")
    state = run(AGEMOEA2(population=12), boxed(lambda X: np.round(schaffer(np.round(X[:, :1]))), CUBE), 240)
    assert {tuple(F) for F in state.archive.F} == {(0.0, 1.0), (1.0, 0.0)}
    flat = run(AGEMOEA2(population=12), boxed(lambda X: np.ones((len(X), 2)), CUBE), 240)
    assert len(flat.members) == 12 and flat.archive.F.tolist()[0] == [1.0, 1.0]


def test_without_numba_it_is_refused_and_nothing_else_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "numba", None)
    with pytest.raises(ValueError, match=r"AGEMOEA2 needs numba, which is not installed: pip install 'macs-trajectories\[agemoea2\]'"):
        solver("agemoea2")
    assert solver_class("agemoea2") is AGEMOEA2
    assert len(SMSEMOA(population=12).minimize(schaffer, CUBE, evaluations=24, seed=1))


def test_progress_is_that_of_pymoo_by_generations_or_by_evaluations() -> None:
    problem = get_problem("dtlz2")
    for n in (4, 7):
        ours = run(RVEA(divisions=4), boxed(problem), 15 * n)
        for end in (("n_gen", n), ("n_eval", 15 * (n + 1))):
            truth = minimize(problem, theirs(RVEA(divisions=4), 3), end, seed=1)
            survival = truth.algorithm.survival
            assert np.array_equal(ours.members.F, truth.pop.get("F")) and np.array_equal(ours.vectors, survival.V)
            assert np.array_equal(ours.ideal, survival.ideal) and np.array_equal(ours.nadir, survival.nadir)


def test_vectors_are_not_adapted_to_an_objective_that_is_always_the_same() -> None:
    def function(X: np.ndarray) -> np.ndarray:
        return np.hstack([schaffer(X), np.ones((len(X), 1))])

    state = run(RVEA(divisions=6), boxed(function, CUBE), 28 * 20)
    assert np.isfinite(state.vectors).all() and len(state.archive) >= 5


def test_the_two_archives_are_full_and_only_the_first_has_to_be_feasible() -> None:
    def function(X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return schaffer(X), (1.5 - schaffer(X)[:, :1])

    state = run(CTAEA(divisions=11), boxed(function, CUBE), 12 * 30)
    assert len(state.members) == len(state.diversity) == 12
    assert (state.members.violation == 0).all() and (state.diversity.violation > 0).any()
    assert np.array_equal(state.ideal, np.minimum(state.ideal, state.diversity.F.min(axis=0)))


@pytest.mark.parametrize("budget", [1, 7, 14])
def test_a_budget_of_less_than_one_population_ends(budget: int) -> None:
    function, bounds, _ = dtlz(2, 3)
    front = CTAEA(divisions=4).minimize(function, bounds, evaluations=budget, seed=1)
    assert front.stats["evaluations"] == budget and len(front)
