"""MOPSO: its kernels by hand and by properties, its archive, constraints, periodic variables, first particles, known fronts."""

import numpy as np
import pytest
from boxes import boxed
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from moocore import igd
from plain import zdt

from macs import MOPSO
from macs.baselines.swarms import hypercubes, improved, moved, roulette, thin_out, velocities
from macs.evaluation.evaluator import Counts, Evaluation, Evaluator, UnitBox
from macs.pareto.dominance import nondominated

PLAIN = UnitBox(np.zeros(2), np.ones(2), np.zeros(2, dtype=bool))
ROUND = UnitBox(np.zeros(2), np.ones(2), np.array([True, False]))


def test_hypercubes_by_hand() -> None:
    F = np.array([[0.0, 10.0], [0.9, 10.0], [1.0, 5.0], [4.0, 0.0], [3.9, 0.1], [2.0, 5.0]])
    cube = hypercubes(F, 4)  # sides of 1 and of 2.5
    assert cube[0] == cube[1]
    assert cube[3] == cube[4]  # the greatest value belongs to the last part
    assert len(set(cube)) == 4 and hypercubes(np.ones((3, 2)), 30).tolist() == [0, 0, 0]
    assert len(set(hypercubes(np.stack([np.arange(30.0), np.ones(30)], axis=1), 30))) == 30
    best = np.array([[1.0, 1.0]] * 4)
    F = np.array([[0.5, 1.0], [1.0, 1.5], [0.5, 1.5], [0.5, 1.5]])
    assert improved(F, best, np.array([False, True, True, False])).tolist() == [True, False, True, False]
    common = {"particles": 20, "archive": 100, "inertia": 1.4, "final_inertia": 0.4, "cognitive": 2, "social": 2}
    assert MOPSO.paper(cells=10) == MOPSO(**common, cells=10, one_leader=True, settled=0.01)


@given(arrays(float, st.tuples(st.integers(1, 40), st.integers(1, 4)), elements=st.floats(-1e6, 1e6)), st.integers(1, 30))
def test_points_of_one_hypercube_are_no_farther_apart_than_its_sides(F, cells) -> None:
    cube = hypercubes(F, cells)
    assert set(cube) == set(range(cube.max() + 1))
    for number in set(cube):
        inside = F[cube == number]
        assert (np.ptp(inside, axis=0) <= np.ptp(F, axis=0) / cells * (1 + 1e-9) + 1e-9).all()


def test_the_roulette_prefers_thin_hypercubes() -> None:
    cube = np.array([0, 0, 0, 1, 2, 2])
    rows = roulette(cube, 60_000, np.random.default_rng(0))
    share = np.bincount(rows, minlength=6) / 60_000
    wheel = 1 / 3 + 1 + 1 / 2
    assert share == pytest.approx(np.array([1 / 9, 1 / 9, 1 / 9, 1, 1 / 4, 1 / 4]) / wheel, abs=0.01)
    cube = np.array([0, 1, 0, 1, 0, 2, 0, 2, 3])
    keep = thin_out(cube, 5, np.random.default_rng(1))
    assert sorted(np.bincount(cube[keep], minlength=4)) in ([1, 1, 1, 2],) and keep[8]
    kept = [tuple(np.flatnonzero(thin_out(cube, 4, np.random.default_rng(seed)))) for seed in range(50)]
    assert all(sorted(cube[list(rows)]) == [0, 1, 2, 3] for rows in kept)
    assert len(set(kept)) > 10  # which of those in a hypercube is left to chance


@given(arrays(int, st.integers(1, 60), elements=st.integers(0, 5)), st.integers(1, 60), st.integers(0, 9))
def test_thinning_levels_what_there_is(numbers, limit, seed) -> None:
    cube = np.unique(numbers, return_inverse=True)[1].reshape(-1)
    keep = thin_out(cube, limit, np.random.default_rng(seed))
    assert np.count_nonzero(keep) == min(limit, len(cube))
    before, after = np.bincount(cube), np.bincount(cube[keep], minlength=cube.max() + 1)
    cut = after < before
    if cut.any():  # what was thinned out is among the fullest of what is left
        assert after[cut].min() >= after.max() - 1


def test_velocities_by_hand() -> None:
    """The sign that eq. (22) is printed with would drive particles away from what they follow."""
    X, V, best, leader = (np.array([row]) for row in ([0.5, 0.5], [0.1, -0.1], [0.7, 0.5], [0.5, 0.1]))
    chance = np.array([[[0.5, 1.0]], [[1.0, 0.5]]])
    found = velocities(PLAIN, X, V, best, leader, weights=(0.5, 2.0, 2.0), chance=chance, largest=1.0)
    assert found == pytest.approx(np.array([[0.05 + 2 * 0.5 * 0.2, -0.05 + 2 * 0.5 * -0.4]]))
    assert np.abs(velocities(PLAIN, X, V, best, leader, weights=(0.5, 2.0, 2.0), chance=chance, largest=0.1)).max() == 0.1


def test_bounds_stop_and_turn_particles_and_periods_let_them_through() -> None:
    X, V, rebound = np.array([[0.9, 0.9], [0.1, 0.1]]), np.array([[0.3, 0.3], [-0.3, -0.3]]), np.full((2, 2), -0.25)
    there, speed = moved(PLAIN, X, V, rebound)
    assert there == pytest.approx(np.array([[1, 1], [0, 0]])) and speed == pytest.approx(-0.25 * V)
    there, speed = moved(ROUND, X, V, rebound)
    assert there == pytest.approx(np.array([[0.2, 1], [0.8, 0]]))
    assert speed == pytest.approx(np.array([[0.3, -0.075], [-0.3, 0.075]]))
    # To 0.1 from 0.9: forward where it is periodic.
    V = velocities(ROUND, X[:1], 0 * V[:1], X[1:], X[1:], weights=(0, 1, 0), chance=np.ones((2, 1, 2)), largest=1.0)
    assert pytest.approx(V) == np.array([[0.2, -0.8]])


@given(arrays(float, (6, 2), elements=st.floats(0, 1)), arrays(float, (6, 2), elements=st.floats(-1, 1)), st.integers(0, 9))
def test_particles_stay_in_the_box(X, V, seed) -> None:
    for box in (PLAIN, ROUND):
        there, speed = moved(box, X, V, -np.random.default_rng(seed).random((6, 2)))
        assert ((there >= 0) & (there <= 1)).all() and (np.abs(speed) <= np.abs(V)).all()


def schaffer(X: np.ndarray) -> np.ndarray:
    return np.stack([(X**2).sum(axis=1), ((X - 1) ** 2).sum(axis=1)], axis=1)


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(st.integers(1, 12), st.integers(1, 9), st.integers(1, 6), st.integers(0, 10**6))
def test_what_always_holds_of_its_archive(particles, archive, cells, seed) -> None:
    box = boxed(lambda X: (schaffer(X), X[:, :1] - 0.8), [(-2, 2)] * 2)
    method = MOPSO(particles=particles, archive=archive, cells=cells)
    state, ever = method.begin(box, 90, np.random.default_rng(seed)), []
    while box.counts.evaluations < 90:
        method.advance(state, box, 90)
        assert len(state.leaders) <= archive
        assert nondominated(state.leaders.F).all() or (state.leaders.violation > box.tolerance).any()
        assert len(state.members) == len(state.best) == len(state.velocity) == min(particles, 90)
        assert (state.archive.violation <= box.tolerance).all()
        ever.append(state.archive.F)
        assert nondominated(state.archive.F).all()
    assert box.counts.evaluations == 90


def ring(X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Feasible in some 8 % of its box."""
    return schaffer(X), (np.linalg.norm(X - 0.5, axis=1) - 0.65)[:, None]


def test_the_swarm_begins_with_feasible_particles_only_and_their_search_is_counted() -> None:
    box, method = boxed(ring, [(-2, 2)] * 2), MOPSO(particles=10, search=0.5)
    state = method.begin(box, 1000, np.random.default_rng(1))
    drawn = [state.members]
    while state.launched < 0:
        assert (state.velocity == 0).all()
        method.advance(state, box, 1000)
        drawn.append(state.members)
    assert (state.members.violation <= box.tolerance).all()
    assert state.launched == box.counts.evaluations == 10 * len(drawn)
    assert 50 <= state.launched <= 400 and state.all_feasible == len(drawn) >= state.first_feasible
    for _ in range(20):  # a feasible best place is never given up
        method.advance(state, box, 1000)
        assert (state.best.violation <= box.tolerance).all()


def test_a_search_that_finds_too_few_ends_with_its_share_and_the_swarm_flies_there() -> None:
    def corner(X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return schaffer(X), (np.abs(X - 1.2).sum(axis=1) - 0.15)[:, None]

    box, method = boxed(corner, [(-2, 2)] * 3), MOPSO(particles=20, search=0.1)
    state = method.begin(box, 2000, np.random.default_rng(1))
    while state.launched < 0:
        method.advance(state, box, 2000)
    assert state.launched == 200 and not len(state.archive) and len(state.closest) == 1
    while box.counts.evaluations < 2000:
        method.advance(state, box, 2000)
    assert len(state.archive) and (state.archive.violation <= box.tolerance).all()


@pytest.mark.parametrize("more", [{"search": 0.0}, {"handling": "penalty"}, {"handling": "objective"}])
def test_without_a_search_for_feasible_particles_none_are_drawn(more) -> None:
    box, method = boxed(ring, [(-2, 2)] * 2), MOPSO(particles=10, **more)
    assert method.begin(box, 1000, np.random.default_rng(1)).launched == 10


@pytest.mark.parametrize("kind", [1, 2])
def test_zdt(kind) -> None:
    function, bounds, truth = zdt(kind)
    front = MOPSO().minimize(function, bounds, evaluations=10_000, seed=1)
    assert igd(front.F, ref=truth) < 0.1 and 50 <= len(front) <= 100


@pytest.mark.slow
def test_a_search_ends_when_the_mean_of_the_front_has_settled(tmp_path) -> None:
    bounds, limit = [(-4.0, 4.0)], 200_000
    loose = MOPSO(particles=20, settled=0.05).minimize(schaffer, bounds, evaluations=limit, seed=1)
    assert loose.stats["stopped"] == "settled" and loose.stats["reproducible"]
    assert 21 * 20 <= loose.stats["evaluations"] < limit
    # A budget that is just enough: the same iterations but for the inertia, which depends on the share of the budget.
    tight = MOPSO(particles=20, settled=0.05).minimize(schaffer, bounds, evaluations=21 * 20, seed=1)
    assert tight.stats["stopped"] == "budget"
    never = MOPSO(particles=20).minimize(schaffer, bounds, evaluations=2000, seed=1)
    assert never.stats["stopped"] == "budget" and never.stats["evaluations"] == 2000
    again = MOPSO(particles=20, settled=0.05).minimize(schaffer, bounds, evaluations=limit, seed=1, checkpoint=tmp_path / "run")
    more = MOPSO(particles=20, settled=0.05).minimize(schaffer, bounds, evaluations=limit, seed=1, checkpoint=tmp_path / "run")
    assert np.array_equal(again.F, loose.F) and np.array_equal(more.F, loose.F) and more.stats["stopped"] == "settled"


def test_with_the_printed_sign_particles_move_away() -> None:
    def sphere(X: np.ndarray) -> np.ndarray:
        """Squared distances from two points; the front is the line between them."""
        return np.stack([((X - 1.0) ** 2).sum(axis=1), ((X + 1.0) ** 2).sum(axis=1)], axis=1)

    found = {p: MOPSO(particles=20, printed=p).minimize(sphere, [(-4.0, 4.0)] * 4, evaluations=2000, seed=3).F for p in (False, True)}
    assert found[False].sum(axis=1).min() + 1.0 < found[True].sum(axis=1).min()


def srn(X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Srinivas and Deb (1994): the front lies at x1 = -2.5, x2 in [-14.79, 2.5]."""
    x, y = X.T
    F = np.stack([2 + (x - 2) ** 2 + (y - 1) ** 2, 9 * x - (y - 1) ** 2], axis=1)
    return F, np.stack([(x**2 + y**2) / 225 - 1, (x - 3 * y + 10) / 10], axis=1)


def test_the_front_of_srn() -> None:
    front = MOPSO(particles=40, degree="sum").minimize(srn, [(-20, 20)] * 2, evaluations=6000, seed=1)
    y = np.linspace(-14.79, 2.5, 500)
    truth = np.stack([2 + 4.5**2 + (y - 1) ** 2, -22.5 - (y - 1) ** 2], axis=1)
    assert (front.violation <= 1e-6).all() and igd(front.F, ref=truth) < 0.02 * np.ptp(truth)


class Compass(Evaluator):
    """Two directions to head for, one on each side of north, where the box is cut open."""

    def __init__(self) -> None:
        self.free, self.lower, self.upper, self.period = np.arange(1), np.zeros(1), np.full(1, 360.0), np.full(1, 360.0)
        self.tolerance, self.counts = 1e-6, Counts()

    def first_guess(self, candidates: np.ndarray) -> np.ndarray:
        return candidates.copy()

    def _evaluate(self, Z: np.ndarray, way: int | None = None) -> tuple[Evaluation, int]:
        assert ((Z >= 0) & (Z <= 360)).all()
        F = 1 - np.cos(np.deg2rad(Z - [350, 10]))
        return Evaluation(Z.copy(), F, np.zeros(len(Z)), np.full(len(Z), "converged")), 0


def test_periodic_variables_are_closed() -> None:
    box, method = Compass(), MOPSO(particles=10, archive=20)
    state = method.begin(box, 400, np.random.default_rng(1))
    while box.counts.evaluations < 400:
        method.advance(state, box, 400)
    heading = (state.archive.Z[:, 0] + 180) % 360 - 180
    assert (np.abs(heading) < 15).all() and heading.min() < -5 and heading.max() > 5
    assert np.count_nonzero(np.abs(state.members.Z[:, 0] - 180) > 120) >= 8  # so is the swarm, on both sides of the cut
