import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from macs.pareto.archive import Archive, insert, least_violated, outside
from macs.pareto.dominance import dominates, extremes
from macs.pareto.spread import pair_energies, reach, spread


def empty(m):
    return Archive(np.empty((0, 1)), np.empty((0, m)), np.empty(0))


def offer(archive, F, limit=10, violation=None):
    F = np.atleast_2d(np.asarray(F, dtype=float))
    violation = np.zeros(len(F)) if violation is None else np.asarray(violation)
    return insert(archive, np.zeros((len(F), 1)), F, violation, limit=limit, tolerance=1e-6)


def energy(F, chosen):
    return pair_energies(F)[np.ix_(chosen, chosen)].sum() / 2


def quarter_circle(count):
    angle = np.linspace(0, np.pi / 2, count)
    return 1 - np.stack([np.sin(angle), np.cos(angle)], axis=1)


@given(st.integers(1, 4), st.integers(4, 12), st.integers(0, 2**32 - 1))
def test_members_are_few_feasible_different_and_mutually_nondominated_and_extremes_stay(m, limit, seed):
    rng = np.random.default_rng(seed)
    archive, seen = empty(m), []
    for _ in range(5):
        F, violation = rng.integers(0, 30, (20, m)).astype(float), rng.choice([0.0, 1.0, np.inf], 20)
        F[violation == np.inf] = np.nan
        archive = offer(archive, F, limit, violation)
        seen.append(F[violation <= 1e-6])
        every = np.vstack(seen)
        assert len(archive) <= limit and not dominates(archive.F[:, None], archive.F[None]).any()
        assert len(np.unique(archive.F, axis=0)) == len(archive)
        if len(every):
            assert np.array_equal(archive.F.min(axis=0), every.min(axis=0))


def test_nothing_infeasible_failed_or_equal_comes_in():
    archive = offer(empty(2), [[1.0, 2.0]])
    assert len(offer(archive, [[0.0, 0.0]], violation=[1.0])) == 1
    assert len(offer(archive, [[np.nan, 0.0]], violation=[np.inf])) == 1
    assert offer(archive, [[1.0, 2.0]]).F.tolist() == [[1.0, 2.0]]
    assert offer(archive, [[1.0, 1.0]]).F.tolist() == [[1.0, 1.0]]
    archive = offer(empty(1), [[3.0], [1.0], [2.0]])
    assert archive.F.tolist() == [[1.0]] and offer(archive, [[0.5], [4.0]]).F.tolist() == [[0.5]]
    archive = offer(empty(2), quarter_circle(40)[5:35], limit=5)
    archive = offer(archive, [[-0.5, 3.0]], limit=5)
    assert len(archive) == 5 and archive.F.min(axis=0)[0] == -0.5


@given(st.integers(2, 4), st.integers(4, 12), st.integers(0, 2**32 - 1), st.booleans())
def test_extremes_are_chosen_and_energy_never_rises_unless_they_were_missing(m, limit, seed, given_extremes):
    rng = np.random.default_rng(seed)
    F = np.abs(rng.normal(size=(40, m)))
    F = (1 - F / np.linalg.norm(F, axis=1, keepdims=True)) * 10.0 ** rng.integers(-3, 4, m)
    best, members = extremes(F), np.zeros(40, dtype=bool)
    if given_extremes:
        members[best] = True
    members[rng.permutation(np.flatnonzero(~members))[: limit - members.sum()]] = True
    chosen = spread(F, limit, members)
    assert chosen.sum() == limit and chosen[best].all()
    if members[best].all():
        assert energy(F, chosen) <= energy(F, members) * (1 + 1e-9)


def test_a_missing_extreme_is_added_at_any_cost_and_distances_are_in_ranges_by_factors():
    F = np.array([[0.0, 0.01, 1.0], [0.01, 0.0, 0.9], [1.0, 1.0, 0.0], [0.3, 0.5, 0.5]])
    members = np.array([True, False, True, True])
    chosen = spread(F, 3, members)
    assert chosen.tolist() == [True, True, True, False] and energy(F, chosen) > energy(F, members)
    F = np.array([[3.0, 2.0, 2.0], [2.0, 2.0, 1.0], [1.0, 3.0, 3.0], [2.0, 1.0, 3.0]])
    assert spread(F, 2).tolist() == [False, False, True, True]
    F = np.stack([np.linspace(0, 1, 5), np.linspace(1, 0, 5), np.full(5, 7.0)], axis=1)
    assert np.array_equal(pair_energies(F), pair_energies(F[:, :2]))
    assert np.isfinite(pair_energies(np.ones((3, 2)))).all()
    F = quarter_circle(5)
    plain, stretched = pair_energies(F, 2.0), pair_energies(F, 2.0, factors=np.array([1.0, 4.0, 1.0, 9.0, 1.0]))
    assert stretched[0, 1] == pytest.approx(plain[0, 1] / 4.0)
    assert stretched[1, 3] == pytest.approx(plain[1, 3] / 36.0)
    assert stretched[0, 2] == pytest.approx(plain[0, 2])


def test_the_archive_spreads_evenly_and_keeps_the_ends():
    rng = np.random.default_rng(1)
    F, archive = quarter_circle(2000), empty(2)
    for rows in rng.permutation(2000).reshape(-1, 20):
        archive = offer(archive, F[rows])
    gaps = np.linalg.norm(np.diff(archive.F[np.argsort(archive.F[:, 0])], axis=0), axis=1)
    assert archive.F.min(axis=0).tolist() == [0.0, 0.0] and gaps.max() / gaps.min() < 1.25


@pytest.mark.parametrize("scale", [1e-4, 1.0])
@pytest.mark.parametrize("exponent", [2.0, 8.0, 16.0])
def test_points_that_almost_coincide_drown_nothing(exponent, scale):
    curve = quarter_circle(60) * scale
    F = np.vstack([curve, curve[1:-1] + scale * np.array([1e-10, -1e-10])])
    chosen = spread(F, 12, exponent=exponent)
    gaps = np.linalg.norm(np.diff(F[chosen][np.argsort(F[chosen][:, 0])], axis=0), axis=1)
    assert chosen.sum() == 12 and gaps.max() / gaps.min() < 1.6


@pytest.mark.parametrize(("m", "high", "least"), [(3, None, 0.7), (4, 8.0, 0.6)])
def test_surfaces_are_covered_evenly_with_their_ends(m, high, least):
    rng = np.random.default_rng(2)
    F = np.abs(rng.normal(size=(3000, m)))
    F[: m * 40, :] *= ~np.eye(m, dtype=bool)[np.arange(m * 40) % m]  # its edges
    F = np.vstack([np.eye(m), F / np.linalg.norm(F, axis=1, keepdims=True)])
    spreads = {}
    for exponent in (high, 2.0):
        archive = empty(m)
        for rows in np.array_split(rng.permutation(len(F)), 60):
            archive = insert(archive, np.zeros((len(rows), 1)), F[rows], np.zeros(len(rows)), limit=60, tolerance=1e-6, exponent=exponent)
        apart = np.linalg.norm(archive.F[:, None] - archive.F, axis=2) + 9 * np.eye(60)
        nearest = apart.min(axis=1)
        spreads[exponent] = nearest.min() / nearest.mean()
        assert all((corner == archive.F).all(axis=1).any() for corner in np.eye(m))
    assert spreads[high] > least and spreads[high] > spreads[2.0]


@pytest.mark.parametrize(("share", "count"), [(0.0, 1), (1.0, 1), (1.001, 0), (5.0, 0), (100.0, 0)])
def test_what_violates_by_more_than_the_tolerance_stays_out(share, count):
    assert len(offer(empty(2), [[0.0, 0.0]], violation=[share * 1e-6])) == count


@pytest.mark.parametrize(("count", "m"), [(2, 2), (9, 2), (16, 3)])
@pytest.mark.parametrize("exponent", [2.0, 3.0, 8.0])
def test_the_energy_of_a_pair_is_the_inverse_power_of_its_distance_in_spacings(exponent, count, m):
    """Of two opposite corners of a box, in its ranges, the square of the distance is m; with `count` points the spacing is that of as many
    in a unit of length, or of area."""
    F = np.array([np.zeros(m), 10.0 ** np.arange(m)])
    spacing = count ** (-1.0 / (m - 1))
    energies = pair_energies(F, exponent, count)
    assert energies[0, 1] == energies[1, 0] == pytest.approx((np.sqrt(m) / spacing) ** -exponent)
    assert energies[0, 0] == energies[1, 1] == 0.0


@pytest.mark.parametrize("exponent", [1.0, 2.0, 8.0])
def test_the_energy_of_points_that_coincide_is_that_of_a_billion_neighbours(exponent):
    energies = pair_energies(np.array([[0.0, 1.0], [0.0, 1.0], [1.0, 0.0]]), exponent)
    assert energies[0, 1] == pytest.approx(1e9) and energies[0, 2] < 1.0


@pytest.mark.parametrize(("m", "varying", "exponent"), [(2, 2, 2.0), (3, 2, 2.0), (3, 3, 8.0), (5, 4, 8.0)])
def test_the_exponent_is_two_for_curves_and_eight_for_surfaces_unless_it_is_given(m, varying, exponent):
    F = np.random.default_rng(0).random((6, m))
    F[:, varying:] = 1.0
    assert reach(F, None) == exponent and reach(F, 5.0) == 5.0
    assert np.array_equal(pair_energies(F), pair_energies(F, exponent))


def test_points_outside_are_infeasible_and_neither_dominated_by_the_archive_nor_among_themselves():
    archive = Archive(np.array([[0.0]]), np.array([[2.0, 2.0]]), np.zeros(1))
    known = Archive(np.array([[1.0], [2.0]]), np.array([[1.0, 3.0], [0.5, 5.0]]), np.array([0.1, 9.0]))
    Z = np.array([[3.0], [4.0], [5.0], [6.0], [7.0]])
    F = np.array([[0.9, 2.9], [3.0, 3.0], [1.5, 1.5], [0.0, 0.0], [0.0, np.nan]])
    found = outside(known, archive, Z, F, np.array([0.5, 0.1, 0.2, 0.0, 0.5]), limit=5, tolerance=1e-6)
    assert found.Z.tolist() == [[2.0], [3.0], [5.0]]
    assert outside(known, archive, Z, F, np.array([np.inf] * 5), limit=5, tolerance=1e-6).Z.tolist() == [[1.0], [2.0]]
    assert len(outside(known, archive, Z, F, np.array([0.5, 0.1, 0.2, 0.0, 0.5]), limit=2, tolerance=1e-6)) == 2


def test_the_least_violated_points_differ_and_only_the_first_may_have_failed():
    closest = Archive(np.array([[1.0]]), np.array([[5.0, 5.0]]), np.array([0.3]))
    Z, F = np.array([[2.0], [1.0], [4.0]]), np.array([[0.0, 0.0], [5.0, 5.0], [2.0, 2.0]])
    assert least_violated(closest, Z, F, np.array([0.4, 0.3, 0.2]), 5).Z.tolist() == [[4.0], [1.0], [2.0]]
    assert least_violated(closest, Z, F, np.array([0.4, 0.3, 0.2]), 2).Z.tolist() == [[4.0], [1.0]]
    assert least_violated(closest, Z, F, np.array([np.inf, 0.3, np.inf]), 5).Z.tolist() == [[1.0]]
    assert least_violated(closest.take([]), Z, F, np.full(3, np.inf), 5).Z.tolist() == [[2.0]]


@settings(max_examples=30)
@given(st.integers(2, 3), st.integers(0, 2**32 - 1), st.booleans())
def test_no_exchange_of_one_point_for_another_lowers_the_energy(m, seed, begun):
    """But for the best of each objective, which stay."""
    F = np.abs(np.random.default_rng(seed).normal(size=(15, m))) + 0.01
    F = 1.0 - F / np.linalg.norm(F, axis=1, keepdims=True)
    members = np.isin(np.arange(15), np.random.default_rng(seed).choice(15, 6, replace=False)) if begun else None
    chosen = spread(F, 6, members)
    assert chosen.sum() == 6
    energies = pair_energies(F, None, 6)
    least = energies[np.ix_(chosen, chosen)].sum()
    for out in np.setdiff1d(np.flatnonzero(chosen), extremes(F)):
        for new in np.flatnonzero(~chosen):
            other = chosen.copy()
            other[[out, new]] = False, True
            assert energies[np.ix_(other, other)].sum() >= least * (1.0 - 1e-8)


class Wish:
    """Wants some rows, and distances as they are, or those of the first half of a front twice as small as they are."""

    def __init__(self, rows, dense=False):
        self.rows, self.dense = np.array(rows), dense

    def factors(self, front, points):
        assert front.shape == (len(front), points.shape[1])
        return np.where(self.dense & (points[:, 0] < 0.5), 2.0, 1.0)

    def anchors(self, front):
        assert front.shape == (len(front), 2)
        return self.rows


def test_what_a_guide_wants_kept_takes_half_of_the_places_at_most_and_the_most_important_first():
    F = quarter_circle(101)
    for limit, kept in ((3, 0), (4, 0), (5, 1), (6, 1), (8, 2), (10, 3)):
        chosen, wish = spread(F, limit, guide=Wish([51, 52, 53, 54])), np.array([51, 52, 53, 54])
        assert chosen.sum() == limit and chosen[[0, 100]].all()
        assert chosen[wish[:kept]].all() and not chosen[wish[kept:]].any()


def test_points_are_denser_where_a_guide_stretches_distances():
    """Of many points, twice as dense where distances count twice."""
    F = np.column_stack([np.linspace(0.0, 1.0, 401), np.linspace(1.0, 0.0, 401)])
    for guide, share in ((None, 0.5), (Wish([], dense=True), 2.0 / 3.0)):
        chosen = insert(empty(2), np.zeros((401, 1)), F, np.zeros(401), limit=61, tolerance=0.0, exponent=8.0, guide=guide)
        assert (chosen.F[:, 0] < 0.5).mean() == pytest.approx(share, abs=0.05)


def test_columns_stay_together():
    one = Archive(np.array([[1.0], [2.0]]), np.array([[1.0, 4.0], [2.0, 3.0]]), np.array([0.0, 1e-7]))
    two = Archive(np.array([[3.0], [4.0]]), np.array([[5.0, 0.0], [6.0, -1.0]]), np.array([0.5, 0.25]))
    assert [column.tolist() for column in one.columns()] == [[[1.0], [2.0]], [[1.0, 4.0], [2.0, 3.0]], [0.0, 1e-7]]
    both = one.joined(two)
    assert both.Z.ravel().tolist() == [1, 2, 3, 4] and both.F[2].tolist() == [5, 0] and both.violation.tolist() == [0, 1e-7, 0.5, 0.25]
    some = both.take(np.array([3, 0]))
    assert some.Z.ravel().tolist() == [4, 1] and some.F.tolist() == [[6, -1], [1, 4]] and some.violation.tolist() == [0.25, 0]
    same = Archive.of(both, np.array([False, True, False, True]))
    assert same.Z.ravel().tolist() == [2, 4] and same.F.tolist() == [[2, 3], [6, -1]] and same.violation.tolist() == [1e-7, 0.25]
    mixed = one.replaced(np.array([False, True]), two)
    assert mixed.Z.ravel().tolist() == [1, 4] and mixed.F.tolist() == [[1, 4], [6, -1]] and mixed.violation.tolist() == [0, 0.25]
    assert repr(one) == "<Archive: 2 points, 2 objectives>" and repr(one.take(np.array([0]))) == "<Archive: 1 point, 2 objectives>"
    archive = offer(empty(2), [[1.0, 2.0]])
    found = insert(archive, np.array([[7.0], [8.0]]), np.array([[0.0, 3.0], [2.0, 2.5]]), np.array([1e-7, 0.0]), limit=10, tolerance=1e-6)
    assert found.F.tolist() == [[1.0, 2.0], [0.0, 3.0]] and found.Z.ravel().tolist() == [0.0, 7.0]
    assert found.violation.tolist() == [0.0, 1e-7]
    assert insert(found, np.zeros((1, 1)), np.zeros((1, 2)), np.ones(1), limit=10, tolerance=1e-6) is found
