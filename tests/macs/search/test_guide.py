"""Searches that a preference guides: on closed fronts, dense where it is good, and the same bits again."""

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from boxes import boxed
from compiled_cases import compiled
from fronts import distance_to_curve

from macs import MACS, Front
from macs.decisions import FuzzyGoal, GoalProgramming, Larger, Nimbus, PhysicalProgramming, Preference, ReferencePoint, Smaller, WeightedSum
from macs.pareto import directions
from macs.pareto.spread import spread
from macs.search.guide import OUTSIDE_DENSITY, REGION_PART, PreferenceGuide, Region
from problems import load
from problems.cases import goddard
from problems.compiled import Objective
from transcription import DFET

GOALS = (Objective("f1"), Objective("f2"))
MIDDLE = ReferencePoint({"f1": 0.0, "f2": 0.0}, augmentation=0.0)
BOX = [(0.0, 1.0)] * 6


def line(n: int) -> np.ndarray:
    a = np.linspace(0.0, 1.0, n)
    return np.stack([a, 1.0 - a], axis=1)


def bent(X: np.ndarray) -> np.ndarray:
    """The front f2 = 1 - f1^2, at which the other variables are zero."""
    g = 1.0 + X[:, 1:].sum(axis=1)
    return np.stack([X[:, 0], g * (1.0 - (X[:, 0] / g) ** 2)], axis=1)


def minimize(prefer: Preference | None, evaluations: int = 1500, seed: int = 1, f: Callable = bent, **more: Any) -> Front:
    settings = {key: more.pop(key) for key in ("archive", "agents") if key in more}
    return MACS(prefer=prefer, **settings).minimize(f, BOX, evaluations=evaluations, seed=seed, **more)


class Halves:
    """Wants points four times as densely on the left half, and one of them kept."""

    def factors(self, front: np.ndarray, points: np.ndarray) -> np.ndarray:
        return np.where(points[:, 0] < 0.5, 1.0, 0.25)

    def anchors(self, front: np.ndarray) -> np.ndarray:
        return np.array([777])


def test_points_of_least_energy_are_as_dense_as_a_guide_wants():
    F = line(2001)
    chosen = spread(F, 50, exponent=4.0, guide=Halves())
    assert chosen.sum() == 50 and chosen[[0, 777, 2000]].all()
    assert np.count_nonzero(F[chosen, 0] < 0.5) == pytest.approx(40, abs=1)
    assert spread(F, 5, guide=Halves())[[0, 777, 2000]].all() and not spread(F, 2, guide=Halves())[777], "ends before anchors"


def test_factors_by_the_region():
    guide, F = PreferenceGuide(MIDDLE, GOALS), line(2001)
    factors, inside = guide.factors(F, F), Region.of(MIDDLE, GOALS, F).contains(F)
    assert inside.mean() == pytest.approx(REGION_PART, rel=0.05) and (factors[inside] == 1.0).all()
    assert (np.diff(factors[:1001]) >= 0).all() and factors[0] == factors[-1] == OUTSIDE_DENSITY
    assert guide.anchors(F).tolist() == [1000], "the worst values are those of the ends, which are kept anyway"
    F = np.array([[0.0, 0.5, 0.6], [0.6, 0.0, 0.5], [0.5, 0.6, 0.0], [0.2, 0.2, 0.2], [0.1, 0.1, 1.0]])
    anchors = PreferenceGuide(ReferencePoint({"f1": 0.0, "f2": 0.0, "f3": 0.0}), (*GOALS, Objective("f3"))).anchors(F)
    assert anchors.tolist() == [3, 4], "f3 is 0.6 at the ends, f1 and f2 nowhere worse than there"
    goals, lattice = (*GOALS, Objective("f3")), directions.simplex_lattice(3, 100)
    middle = ReferencePoint(dict.fromkeys(("f1", "f2", "f3"), 0.0), augmentation=0.0)
    factors, away = PreferenceGuide(middle, goals).factors(lattice, lattice), Region.of(middle, goals, lattice).away(lattice)
    border = REGION_PART * (1.0 - 10.0 ** (-1 / 2))
    assert (factors[away <= border] == 1.0).all() and (factors[(away > 1.2 * border) & (away <= REGION_PART)] < 0.6).all()


def test_shares_of_directions():
    every, rng = directions.pool(2, 100), np.random.default_rng(0)
    shares = np.where(every[:, 0] < every[:, 1], 1.0, 1e-6)
    drawn = directions.draw(every, 12, rng, shares)
    assert drawn[:2].tolist() == [0, 1] and (shares[drawn[2:]] == 1.0).all() and len({*drawn.tolist()}) == 12
    one, other = (directions.draw(every, 150, np.random.default_rng(0)) for _ in range(2))
    assert np.array_equal(one, other)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("prefer", "f1"),
    [
        (ReferencePoint({"f1": 0.0, "f2": 0.0}), (np.sqrt(5) - 1) / 2),  # f1 = 1 - f1^2
        (ReferencePoint({"f1": 0.3, "f2": 0.0}, {"f1": 0.8, "f2": 1.0}), np.sqrt(2.6) - 1),  # 2 (f1 - 0.3) = 1 - f1^2
        (PhysicalProgramming({"f1": Smaller(0.3, 0.31, 0.32, 0.33, 0.34), "f2": Smaller(0.7, 0.8, 0.9, 0.95, 1.0)}), None),
        (FuzzyGoal({"f1": 0.2, "f2": 0.4}), None),
        (GoalProgramming({"f1": 0.5, "f2": 0.2}), None),
    ],
    ids=lambda one: type(one).__name__,
)
def test_the_front_is_dense_where_the_preference_is_good(prefer, f1):
    f = np.linspace(0.0, 1.0, 20_001)
    truth = np.stack([f, 1.0 - f**2], axis=1)
    region = Region.of(prefer, GOALS, truth)
    front, even = minimize(prefer), minimize(None)
    assert "prefer" not in front.stats
    inside, others = region.contains(front.objectives), region.contains(even.objectives)
    assert inside.sum() >= 5 and inside.sum() >= others.sum() + 2
    assert front.F[0, 0] < 0.01 and front.F[-1, 1] < 0.01, "the ends are there"
    assert distance_to_curve(front.objectives[inside], truth).max() < 1e-3
    assert region.away(front.objectives).min() < 0.3 * REGION_PART
    if f1 is not None:
        assert truth[region.away(truth).argmin(), 0] == pytest.approx(f1, abs=1e-3)
        assert prefer.rank(front).best.objectives["f1"] == pytest.approx(f1, abs=5e-3)


@pytest.mark.slow
def test_three_objectives_of_which_one_is_maximised():
    def sphere(X):
        a, b = 0.5 * np.pi * X[:, 0], 0.5 * np.pi * X[:, 1]
        r = 1.0 + ((X[:, 2:] - 0.5) ** 2).sum(axis=1)
        return np.stack([r * np.cos(a) * np.cos(b), r * np.cos(a) * np.sin(b), -r * np.sin(a)], axis=1)

    wanted = ReferencePoint({"f1": 0.2, "f2": 0.4, "f3": -0.5})
    given = {"f": sphere, "senses": ("minimize", "minimize", "maximize"), "evaluations": 3000, "archive": 20}
    front, even = minimize(wanted, **given), minimize(None, **given)
    # The ray from the aspiration along (1, 1, 1) meets the unit sphere where 3 t^2 + 2.2 t = 0.55.
    t = (-2.2 + np.sqrt(2.2**2 + 12 * 0.55)) / 6
    best = np.array([0.2, 0.4, 0.5]) + t
    near = [int((np.abs(one.F - best).max(axis=1) < 0.1).sum()) for one in (front, even)]
    assert near[0] >= 10 > 3 >= near[1]
    assert front.F.max() > 0.98, "the ranges are known"


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bits():
    first, again, other = (minimize(MIDDLE, 600, seed) for seed in (1, 1, 2))
    assert first.F.tobytes() == again.F.tobytes() and first.decision.tobytes() == again.decision.tobytes()
    assert first.F.tobytes() != other.F.tobytes()
    assert first.F.tobytes() != minimize(None, 600).F.tobytes()


def test_without_a_preference_nothing_is_new(monkeypatch):
    class Even:
        """What a guide would be that wants nothing."""

        def factors(self, front, points):
            return np.ones(len(points))

        def anchors(self, front):
            return np.empty(0, dtype=int)

    F = np.random.default_rng(0).random((60, 3))
    F /= np.linalg.norm(F, axis=1, keepdims=True)
    assert np.array_equal(spread(F, 15), spread(F, 15, guide=Even()))
    assert MACS(prefer=None) == MACS() and "prefer" not in MACS().about()["settings"]
    plain = minimize(None, 600)
    monkeypatch.setattr("macs.search.guide.PreferenceGuide", None)  # not made
    assert minimize(None, 600).F.tobytes() == plain.F.tobytes()


def test_a_checkpoint_goes_on_to_the_same_bits_and_belongs_to_its_preference(tmp_path):
    file, left = tmp_path / "run.ckpt", iter(range(7))
    whole = minimize(MIDDLE, 600)
    part = minimize(MIDDLE, 600, checkpoint=file, callback=lambda progress: next(left, None) is None)
    assert part.stats["stopped"] == "callback"
    with pytest.raises(ValueError, match=r"belongs to another run: solver\.settings\.prefer"):
        minimize(None, 600, checkpoint=file)
    with pytest.raises(ValueError, match=r"belongs to another run: solver\.settings\.prefer"):
        minimize(ReferencePoint({"f1": 0.5, "f2": 0.0}), 600, checkpoint=file)
    again = minimize(MIDDLE, 600, checkpoint=file)
    assert again.F.tobytes() == whole.F.tobytes() and again.decision.tobytes() == whole.decision.tobytes()


def test_preferences_go_to_files_and_other_processes_and_come_from_plain_data(tmp_path):
    front = minimize(MIDDLE, 200)
    front.save(tmp_path / "front.nc")
    assert Front.load(tmp_path / "front.nc").solver == front.solver
    assert "ReferencePoint" in str(front.solver["settings"]["prefer"])
    solver = MACS(prefer=PhysicalProgramming({"f1": Smaller(0.1, 0.2, 0.3, 0.4, 0.5)}))
    minimize(solver.prefer, 100)  # functions are cached
    again = pickle.loads(pickle.dumps(solver))
    assert again == solver and "prefer" in repr(again)
    data = {"method": "ReferencePoint", "settings": {"aspiration": {"f1": 0.2}, "augmentation": 1e-3}}
    solver = MACS(prefer=data)
    assert solver.prefer == ReferencePoint({"f1": 0.2}, augmentation=1e-3)
    assert MACS(prefer=solver.about()["settings"]["prefer"]) == solver
    with pytest.raises(ValueError, match=r"MACS: prefer: .*'Wishes'"):
        MACS(prefer={"method": "Wishes"})


def never(X):
    raise AssertionError("evaluated")


@pytest.mark.parametrize(
    ("prefer", "words"),
    [
        (WeightedSum({"f1": 1.0, "range": 1.0}), "MACS: prefer: .*'range'.*f1, f2"),
        (ReferencePoint({"flight time": 100.0}), "'flight time'"),
        (PhysicalProgramming({"f1": Larger(0.5, 0.4, 0.3, 0.2, 0.1)}), "'f1'"),
        (Nimbus({"f1": 0.5, "f2": 0.5}, improve=["f1"], free=["f3"]), "'f3'"),
        (Nimbus({"f1": 0.5}, improve=["f1"], free=["f2"]), "no 'f2'"),
    ],
)
def test_a_preference_of_another_problem_is_refused_before_any_work(prefer, words):
    with pytest.raises(ValueError, match=words) as caught:
        minimize(prefer, f=never, names=("f1", "f2"))
    assert "\n" not in str(caught.value)
    with pytest.raises(ValueError, match=words):  # how many objectives there are is known from the first batch only
        minimize(prefer)


def test_a_preference_of_another_problem_is_refused_before_a_mesh_is_found(monkeypatch):
    monkeypatch.setattr("macs.solvers.solver.search_meshes", never)
    with pytest.raises(ValueError, match=r"prefer: .*'f1'.*flight time, horizontal speed"):
        MACS(prefer=MIDDLE).solve(load("goddard"), evaluations=20)


@pytest.mark.parametrize("given", [3, "reference", Region, object()])
def test_what_is_no_preference_is_refused(given):
    with pytest.raises(ValueError, match="MACS: prefer must be a preference"):
        MACS(prefer=given)


def test_targets_beyond_the_front_leave_the_search_even_and_say_so():
    front = minimize(ReferencePoint({"f1": 7.0, "f2": 0.1}), 600)
    assert "not followed: the aspiration of 'f1', 7, lies beyond its range" in front.stats["prefer"]
    assert len(front) == 10 and np.ptp(np.diff(front.F[:, 0])) < 0.15


@pytest.mark.slow
def test_limits_that_no_point_meets_are_approached():
    wanted = PhysicalProgramming({"f1": Smaller(0.1, 0.15, 0.2, 0.25, 0.3), "f2": Smaller(0.1, 0.15, 0.2, 0.25, 0.3)})
    front = minimize(wanted)
    excess = np.maximum(front.F - 0.3, 0.0).max(axis=1)
    far = np.maximum(minimize(None).F - 0.3, 0.0).max(axis=1)
    assert np.count_nonzero(excess < excess.min() + 0.04) >= 4 > np.count_nonzero(far < excess.min() + 0.04)


@pytest.mark.parametrize("constraints", [lambda X: 1.0 + X, lambda X: 0.9 - X[:, :1]], ids=["never", "seldom"])
def test_few_points_or_none(constraints):
    front = minimize(MIDDLE, 300, constraints=constraints)
    assert len(front) == 0 or front.F[:, 0].min() >= 0.9 - 1e-6
    assert front.stats["evaluations"] == 300


def test_one_objective_and_equal_ones():
    state = MACS(prefer=WeightedSum({"f1": 1.0}))
    front = state.minimize(lambda X: ((X - 0.3) ** 2).sum(axis=1), BOX, evaluations=600, seed=1)
    assert len(front) == 1 and front.F[0, 0] < 0.01
    box = boxed(lambda X: np.hstack([bent(X), np.ones((len(X), 1))]), BOX)
    begun = MACS(prefer=MIDDLE).begin(box, 100, np.random.default_rng(0))
    assert len(begun.archive)


FLIGHT = ReferencePoint({"flight time": 150.0, "horizontal speed": 0.6})


@pytest.fixture(scope="module")
def flights() -> dict[str, Front]:
    """Fronts by gradients, one guided, one even. Seeds 2, 3 and 4 have 8 points of the 10 in the region, seed 1 has 4."""
    return {
        who: MACS(prefer=prefer, mesh="fixed").solve(compiled("goddard"), DFET(4, 6), evaluations=800, seed=2, verify=None)
        for who, prefer in (("guided", FLIGHT), ("even", None))
    }


@pytest.mark.slow
def test_gradients_go_where_the_preference_is_good(flights):
    truth = goddard.reference()
    guided, even = flights["guided"], flights["even"]
    region = Region.of(FLIGHT, guided.goals, truth)
    inside, others = (region.contains(front.objectives).sum() for front in (guided, even))
    assert inside >= 5 > 2 >= others
    assert region.away(guided.objectives).min() < 0.2 * REGION_PART
    assert guided.objectives[0, 0] < 1.02 * truth[0, 0] and guided.objectives[-1, 0] > 240.0


@pytest.mark.slow
def test_a_guided_search_of_trajectories_goes_on_to_the_same_bits(tmp_path, flights):
    left = iter(range(3))
    for callback in (lambda progress: next(left, None) is None, None):
        front = MACS(prefer=FLIGHT, mesh="fixed").solve(
            load("goddard"), evaluations=800, seed=2, verify=None, checkpoint=tmp_path / "run.ckpt", callback=callback
        )
    assert front.F.tobytes() == flights["guided"].F.tobytes()
