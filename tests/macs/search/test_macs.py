"""The whole search on plain functions: budgets, sameness, failures, constraints, known fronts."""

import copy

import moocore
import numpy as np
import pytest
from ascent import Ascent
from boxes import boxed
from fronts import distance_to_curve, inverted_distance, mean_distance
from plain import dtlz, uf, zdt

import macs.pymoo
from macs.baselines import NSGA3
from macs.pareto.dominance import dominates
from macs.search.macs import MACS
from macs.search.settings import GONE, Variant
from macs.search.state import NO_DIRECTION
from macs.solvers.solver import solver as named_solver
from problems.cases.goddard import reference


def run(settings, box, budget, seed=1, start=None):
    state = settings.begin(box, budget, np.random.default_rng(seed), start)
    while state.evaluations < budget:
        before = state.evaluations
        settings.advance(state, box, budget)
        assert state.evaluations > before or state.iteration < 2
    return state


def schaffer(X):
    return np.stack([(X**2).sum(axis=1), ((X - 1) ** 2).sum(axis=1)], axis=1)


@pytest.mark.parametrize("budget", [1, 2, 9, 10, 11, 57, 200])
@pytest.mark.parametrize("settings", [MACS(agents=3, archive=4), MACS(), MACS.paper()])
def test_the_budget_is_met_exactly(budget, settings):
    rows = []
    box = boxed(lambda X: rows.append(len(X)) or schaffer(X), [(-2, 2)] * 3)
    state = run(settings, box, budget)
    assert sum(rows) == budget == state.evaluations
    settings.advance(state, box, 0)
    assert sum(rows) == budget


def test_the_same_seed_gives_the_same_bits_and_another_seed_others():
    first, again, other = (run(MACS(), boxed(schaffer, [(-2, 2)] * 4), 500, seed) for seed in (1, 1, 2))
    assert np.array_equal(first.archive.Z, again.archive.Z)
    assert np.array_equal(first.agents.velocity, again.agents.velocity)
    assert not np.array_equal(first.archive.F, other.archive.F)
    settings, box = MACS(), boxed(schaffer, [(-2, 2)] * 4)
    state = settings.begin(box, 600, np.random.default_rng(0))
    while state.evaluations < 300:
        settings.advance(state, box, 600)
    kept, other = copy.deepcopy(state), boxed(schaffer, [(-2, 2)] * 4)
    kept.rng = np.random.default_rng(9)
    kept.rng.bit_generator.state = state.rng.bit_generator.state
    other.counts.evaluations = kept.evaluations
    while state.evaluations < 600:
        settings.advance(state, box, 600)
        settings.advance(kept, other, 600)
    assert np.array_equal(state.archive.Z, kept.archive.Z) and state.iteration == kept.iteration


def test_failed_and_infeasible_evaluations_never_enter_the_archive():
    def function(X):
        F = schaffer(X)
        F[X[:, 0] > 0.3] = np.nan
        F[X[:, 1] > 0.7, 0] = np.inf
        return F

    state = run(MACS(), boxed(function, [(-2, 2)] * 3), 600)
    assert len(state.archive) == 10 and (state.archive.Z[:, 0] <= 0.3).all()
    assert np.isfinite(state.archive.F).all()
    nothing = run(MACS(), boxed(lambda X: np.full((len(X), 2), np.nan), [(0, 1)] * 2), 300)
    assert len(nothing.archive) == 0 and nothing.evaluations == 300
    box = boxed(schaffer, [(-2, 2)] * 3, constraints=lambda X: np.abs(X[:, 1:] - 0.5) - 0.05)
    state = run(MACS(), box, 1500)
    assert len(state.archive) == 10 and len(state.closest) == 0
    assert (np.abs(state.archive.Z[:, 1:] - 0.5) <= 0.05 + 1e-6).all()
    box = boxed(schaffer, [(-2, 2)] * 3, constraints=lambda X: 1 + X**2)
    state = run(MACS(), box, 1000)
    assert len(state.archive) == 0 and len(state.closest) == 1 and len(state.infeasible) == 10
    assert 1.0 <= state.closest.violation[0] < 1.02 and (np.diff(state.infeasible.violation) >= 0.0).all()
    assert state.closest.violation[0] <= state.agents.violation.min()


def test_one_objective_one_that_does_not_vary_and_more_than_there_are_points():
    state = run(MACS(), boxed(lambda X: ((X - 0.3) ** 2).sum(axis=1), [(-2, 2)] * 5), 2000)
    assert state.archive.F.shape == (1, 1) and state.archive.F[0, 0] < 1e-4
    state = run(MACS(), boxed(lambda X: np.hstack([schaffer(X), np.ones((len(X), 1))]), [(-2, 2)] * 2), 500)
    assert len(state.archive) == 10
    box = boxed(lambda X: np.hstack([schaffer(X), X]), [(-2, 2)] * 3)
    with pytest.raises(ValueError, match="5 objectives, not 4"):
        MACS(archive=4).begin(box, 100, np.random.default_rng(0))
    with pytest.raises(ValueError, match="leaves none"):
        MACS().begin(boxed(schaffer, [(-2, 2)]), 0, np.random.default_rng(0))


def test_periodic_variables_cross_their_bounds():
    # optimal angles are around 0 = 1: half of them just below the upper bound, half just above the lower one
    box = boxed(lambda X: np.stack([1 - np.cos(2 * np.pi * (X - c)).mean(axis=1) for c in (0.03, 0.97)], axis=1), [(0, 1)] * 6)
    box.period = np.ones(6)
    state = run(MACS(), box, 2000)
    X = (state.archive.Z + 0.5) % 1.0 - 0.5
    assert (np.abs(X) < 0.1).all() and ((state.archive.Z >= 0) & (state.archive.Z <= 1)).all()


def test_the_best_of_each_objective_is_never_lost():
    settings, box, best = MACS(agents=5, archive=3), boxed(schaffer, [(-2, 2)] * 3), np.full(2, np.inf)
    state = settings.begin(box, 1000, np.random.default_rng(0))
    while state.evaluations < 1000:
        settings.advance(state, box, 1000)
        now = state.archive.F.min(axis=0)
        assert (now <= best).all() and np.array_equal(now, state.ideal)
        assert not dominates(state.archive.F[:, None], state.archive.F[None]).any()
        best = now


def test_a_start_is_evaluated_first_and_too_many_are_thinned():
    start = np.random.default_rng(3).uniform(-2, 2, (25, 3))
    box = boxed(schaffer, [(-2, 2)] * 3)
    state = MACS().begin(box, 100, np.random.default_rng(0), start)
    assert (state.evaluations, len(state.agents)) == (25, 10)
    few = MACS().begin(boxed(schaffer, [(-2, 2)] * 3), 100, np.random.default_rng(0), np.zeros((1, 3)))
    assert few.evaluations == 10 and 0.0 in few.archive.F[:, 0]
    outside = MACS().begin(boxed(schaffer, [(-2, 2)] * 3), 100, np.random.default_rng(0), np.full((12, 3), 5.0))
    assert outside.agents.Z.max() == 2.0


def test_of_too_many_starts_the_best_become_agents(monkeypatch):
    monkeypatch.setattr("macs.search.macs.assign", lambda *state: None)  # which moves agents to the archive

    def begun(start, agents):
        box = boxed(lambda X: X, [(-9, 9)] * 2, constraints=lambda X: -X[:, 0] - 1)
        state = MACS(agents=agents).begin(box, 100, np.random.default_rng(0), np.array(start, dtype=float))
        return state.agents.Z.tolist()

    infeasible = [[-9, 0], [-3, 0], [-5, 0]]
    dominated = [[4, 4], [3, 3], [4, 3]]
    front = [[0, 2], [0.1, 1.9], [1, 1], [1.1, 0.9], [2, 0]]
    assert begun(infeasible + dominated + front, 5) == front
    assert begun(infeasible + dominated + front, 4)[::3] == [front[0], front[-1]]
    assert begun(infeasible + dominated + front, 3) in ([front[0], middle, front[-1]] for middle in front[2:4])
    assert begun(infeasible + dominated + [front[0]] * 3 + front, 5) == [front[0], *front[1:]]
    assert begun(infeasible + dominated + front, 7) == [*dominated[1:], *front]
    assert begun(infeasible + dominated + front, 9) == [infeasible[1], *dominated, *front]
    assert begun(infeasible + dominated + front, 11) == infeasible + dominated + front


@pytest.mark.parametrize(
    "setting",
    [
        *({"agents": 2}, {"agents": 3.5}, {"archive": 0}, {"mesh_tolerance": 0}, {"mesh": "fine"}, {"refine": 1}),
        *({"polish_every": 0}, {"ceiling": None}, {"variant": "quick"}, {"variant": 3}),
    ],
)
def test_settings_out_of_range_are_named(setting):
    with pytest.raises(ValueError, match=next(iter(setting))):
        MACS(**setting)


@pytest.mark.parametrize("name", GONE)
def test_a_setting_of_a_former_version_says_what_to_use(name):
    words = f"{name} is no setting any more: "
    for make in (MACS, MACS.paper, macs.pymoo.MACS, lambda **given: named_solver("macs", **given)):
        with pytest.raises(ValueError, match=words) as caught:
            make(**{name: 1})
        assert "\n" not in str(caught.value)


def test_variants_have_names():
    assert MACS(variant="paper").variant == MACS.paper().variant == named_solver("macs", paper=True).variant
    assert eval(repr(MACS.paper())) == MACS.paper() and repr(MACS()) == "MACS()"
    with pytest.raises(TypeError, match="unknown setting of MACS 'archiv', did you mean archive"):
        MACS(archiv=5)
    assert MACS.paper().about()["settings"]["variant"] == "paper" and MACS().about()["settings"]["variant"] == "default"
    own = MACS(variant=Variant(repair=False))
    assert own.about()["settings"]["variant"]["repair"] is False and own != MACS()
    assert MACS.paper(archive=20).archive == 20
    assert MACS.paper().coordinates_to_scan(29, 10, 2, 100) == 29
    assert MACS().coordinates_to_scan(29, 10, 2, 10_000) == 1
    assert MACS().coordinates_to_scan(29, 0, 2, 10_000) == 29
    assert MACS().coordinates_to_scan(400, 0, 2, 10_000) == 62, "20 evaluations a coordinate, an eighth of the budget in all"
    assert MACS().coordinates_to_scan(29, 0, 2, 10) == 1
    state = run(MACS.paper(), boxed(schaffer, [(-2, 2)] * 3), 600)
    assert len(state.archive) == 10
    assert len(run(MACS.paper(archive=30), boxed(schaffer, [(-2, 2)] * 3), 900).archive) == 30


@pytest.mark.slow
def test_agents_without_a_direction_are_as_many_as_the_budget_allows_and_are_never_moved_to_the_archive(monkeypatch):
    many = MACS(archive=100)
    budgets = (9_999, 35_999, 36_000, 300_000, 1_000_000)
    assert [many.undirected_agents(2, budget) for budget in budgets] == [0, 0, 1, 45, 45]
    assert [many.undirected_agents(3, budget) for budget in budgets] == [0, 0, 0, 22, 45]
    assert [MACS(archive=points).undirected_agents(3, 1_000_000) for points in (3, 10, 11, 12, 150)] == [0, 0, 0, 1, 70]
    assert MACS(archive=150).undirected_agents(4, 300_000) == MACS.paper(archive=100).undirected_agents(2, 300_000) == 0
    monkeypatch.setattr(MACS, "undirected_agents", lambda self, m, budget: 5)
    settings, box = MACS(agents=4, archive=20), boxed(schaffer, [(-2, 2)] * 3)
    state = settings.begin(box, 2000, np.random.default_rng(0))
    first = state.agents.F[4:].copy()
    assert len(first) == 5
    while state.evaluations < 2000:
        settings.advance(state, box, 2000)
        assert (state.agents.direction[4:] == NO_DIRECTION).all()
        assert (state.agents.direction[:4] != NO_DIRECTION).all()
    last = state.agents.F[4:]
    assert (dominates(last, first) | (last == first).all(axis=1)).all(), "each is compared with itself only"
    assert (last != first).any()


@pytest.mark.slow
def test_agents_without_a_direction_get_evaluations_as_long_as_they_gain(monkeypatch):
    """Each comes to the front of DTLZ2. Then neither they nor the others gain anything, and shares are about even."""
    monkeypatch.setattr(MACS, "undirected_agents", lambda self, m, budget: 5)
    settings, box = MACS(archive=50), boxed(*dtlz(2, 3)[:2])
    state, parts, gains = settings.begin(box, 20_000, np.random.default_rng(1)), [], []
    while state.evaluations < 20_000:
        settings.advance(state, box, 20_000)
        parts.append(state.undirected.cost[1] / state.undirected.cost.sum())
        gains.append(state.undirected.gained[1] / state.undirected.cost[1])
    assert max(parts) > 0.4 and np.mean(parts[len(parts) // 2 :]) < 0.6
    assert gains[-1] < 1e-4 * max(gains)


def distances(problem, seeds, evaluations):
    """Mean distance of the true front from that of the defaults with an archive of 100, for each seed."""
    function, bounds, front = problem
    values = []
    for seed in seeds:
        state = run(MACS(agents=10, archive=100), boxed(function, bounds), evaluations, seed)
        values.append(mean_distance(front, state.archive.F))
    return values


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "evaluations", "limit"),
    [(1, 15_000, 4.0e-3), (2, 15_000, 4.0e-3), (3, 15_000, 4.6e-3), (4, 15_000, 10e-3), (6, 30_000, 3.3e-3)],
)
def test_fronts_of_zitzler_deb_and_thiele(kind, evaluations, limit):
    values = distances(zdt(kind), range(1, 4), evaluations)
    assert np.median(values) <= limit, values


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "m", "limit"), [(1, 3, 0.021), (2, 3, 0.054), (4, 3, 0.056), (7, 3, 0.062)])
def test_fronts_of_three_objectives(kind, m, limit):
    values = distances(dtlz(kind, m), range(1, 4), 30_000)
    assert np.median(values) <= limit, values


@pytest.mark.slow
@pytest.mark.parametrize("m", [5, 8])
def test_with_many_objectives_it_is_nearer_to_the_front_than_nsga3_and_covers_more(m):
    function, bounds, _ = dtlz(2, m)
    distance, volume = {}, {}
    for solver in (MACS(archive=110), NSGA3(population=110)):
        fronts = [solver.minimize(function, bounds, evaluations=15_000, seed=seed, progress=False).F for seed in range(1, 4)]
        distance[solver] = np.median([np.abs(np.linalg.norm(F, axis=1) - 1).mean() for F in fronts])
        volume[solver] = np.median([moocore.hypervolume(F[(F < 1.1).all(axis=1)], ref=np.full(m, 1.1)) for F in fronts])
    (ours, theirs), (more, less) = distance.values(), volume.values()
    assert ours < theirs
    assert more > less


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "limit"), [(1, 0.050), (3, 0.277)])
def test_coupled_variables_of_cec_2009_are_nearer_than_the_authors(kind, limit):
    values = distances(uf(kind), range(1, 4), 30_000)
    assert np.mean(values) <= limit, values


@pytest.mark.slow
def test_the_front_of_the_lunar_ascent():
    front, gd, spread = reference() * [1, -1], [], []
    for seed in range(1, 6):
        F = run(MACS(agents=10, archive=10), Ascent(), 10_000, seed).archive.F
        gd.append(distance_to_curve(F, front).mean())
        spread.append(inverted_distance(F, front))
    assert np.mean(gd) <= 6e-3, gd
    assert np.max(gd) <= 1e-2, gd
    assert np.mean(spread) <= 0.044, spread


@pytest.mark.slow
def test_a_short_search_of_the_lunar_ascent():
    state = run(MACS(), Ascent(), 1500)
    assert len(state.archive) == 10
    assert (state.archive.violation <= 1e-9).all()
    assert distance_to_curve(state.archive.F, reference() * [1, -1]).mean() < 0.06
