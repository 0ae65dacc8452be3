import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from macs.pareto.archive import Archive, insert
from macs.pareto.dominance import extremes, nondominated
from macs.pareto.spread import CORNER, dominated_volume, pair_energies, reach, spread, swap_by_hypervolume


def fought(F, chosen, fixed=()):
    stays = np.isin(np.arange(len(F)), fixed)
    return swap_by_hypervolume(F, chosen, stays, pair_energies(F, count=int(chosen.sum())), reach(F, None))


def behind_a_surface(rng, count, m, depth):
    """Points behind the part of the unit sphere that is a front, by up to `depth` of its radius."""
    F = np.abs(rng.normal(size=(count, m)))
    return F / np.linalg.norm(F, axis=1, keepdims=True) * (1.0 + depth * rng.random((count, 1)))


@pytest.mark.parametrize(("N", "volume"), [
    ([[0.0, 0.0]], CORNER**2),
    ([[0.0, 0.0, 0.0]], CORNER**3),
    ([[0.0, 1.0], [1.0, 0.0]], 2 * 0.1 * 1.1 - 0.1**2),
    ([[0.5, 0.5], [0.25, 0.75]], 0.6**2 + 0.25 * 0.35),
    ([[2.0, 0.0]], 0.0),
])  # fmt: skip
def test_the_dominated_volume_is_that_of_boxes_to_the_corner(N, volume):
    assert dominated_volume(np.array(N)) == pytest.approx(volume, rel=1e-14)


def test_a_point_on_the_front_takes_the_place_of_one_behind_it_though_that_has_more_room():
    F = np.vstack([np.eye(3), [0.33, 0.6, 0.6], [1 / 3, 1 / 3, 1 / 3]])
    assert nondominated(F).all()
    behind = spread(F, 4)
    assert behind.tolist() == [True, True, True, True, False]
    assert fought(F, behind, [0, 1, 2]).tolist() == [True, True, True, False, True]
    F = np.array([[0.0, 1.0], [1.0, 0.0], [0.5, 0.5], [0.2, 0.8]])
    chosen = np.array([True, True, True, False])
    assert fought(F, chosen, [0, 1]).tolist() == chosen.tolist()
    other = np.array([True, True, False, True])
    assert fought(F, other, [0, 1]).tolist() == chosen.tolist()
    F = np.array([[0.0, 1.0], [1.0, 0.0], [0.49, 0.6], [0.5, 0.5]])
    chosen = np.array([True, True, True, False])
    assert fought(F, chosen, [0, 1]).tolist() == [True, True, False, True]
    assert fought(F, chosen, [0, 1, 2]).tolist() == chosen.tolist()
    F = behind_a_surface(np.random.default_rng(3), 40, 2, 0.1)
    F = F[nondominated(F)]
    chosen = np.zeros(len(F), dtype=bool)
    chosen[extremes(F)] = chosen[:5] = True
    flat = np.column_stack([F, np.full(len(F), 7.0)])
    assert np.array_equal(fought(flat, chosen, extremes(F)), fought(F, chosen, extremes(F)))


@given(st.integers(2, 3), st.integers(4, 12), st.integers(0, 2**32 - 1), st.lists(st.integers(-8, 8), min_size=3, max_size=3))
def test_as_many_points_with_the_fixed_ones_in_any_units(m, limit, seed, powers):
    rng = np.random.default_rng(seed)
    F = behind_a_surface(rng, 40, m, 0.1)
    F = F[nondominated(F)]
    best, chosen = extremes(F), np.zeros(len(F), dtype=bool)
    chosen[best] = True
    others = rng.permutation(np.flatnonzero(~chosen))
    chosen[others[: max(limit - chosen.sum(), 0)]] = True
    kept = fought(F, chosen, best)
    assert kept.sum() == chosen.sum() and kept[best].all()
    assert np.array_equal(fought(F * 2.0 ** np.array(powers[:m]), chosen, best), kept)


@pytest.mark.parametrize(("m", "power", "part"), [(2, 2.0, 0.9), (3, 8.0, 0.6)])
def test_the_archive_is_nearer_to_the_front_than_that_of_energy_alone(m, power, part):
    """Of the same points, offered in the same order, many a little behind a surface."""
    rng = np.random.default_rng(4)
    F = behind_a_surface(rng, 6000, m, 0.05)
    away = {}
    for exponent in (None, power):
        archive = Archive(np.empty((0, 1)), np.empty((0, m)), np.empty(0))
        for rows in np.split(np.arange(len(F)), 100):
            archive = insert(archive, np.zeros((60, 1)), F[rows], np.zeros(60), limit=40, tolerance=0.0, exponent=exponent)
        away[exponent] = (np.linalg.norm(archive.F, axis=1) - 1.0).mean()
    assert away[None] < part * away[power]


def fought_by_definition(F, chosen, fixed):
    """The same swap_by_hypervolume, with all volumes and distances computed anew for each."""
    N = (F - F.min(axis=0)) / np.ptp(F, axis=0)
    power, inside = {2: 2.0, 3: 8.0}[F.shape[1]], chosen.copy()

    def worth(point, beside):
        added = dominated_volume(N[[*beside, point]]) - dominated_volume(N[beside])
        return added * (np.linalg.norm(N[beside] - N[point], axis=1) ** -power).sum() ** (-1.0 / power)

    for other in np.flatnonzero(~chosen):
        held = min(set(np.flatnonzero(inside)) - set(fixed), key=lambda one: np.linalg.norm(N[one] - N[other]))
        beside = [one for one in np.flatnonzero(inside) if one != held]
        if worth(other, beside) > worth(held, beside) * (1.0 + 1e-9):
            inside[held], inside[other] = False, True
    return inside


@given(st.integers(2, 3), st.integers(5, 12), st.integers(0, 2**32 - 1))
def test_places_are_those_of_the_definition(m, limit, seed):
    rng = np.random.default_rng(seed)
    F = behind_a_surface(rng, 60, m, 0.1)
    F = F[nondominated(F)]
    chosen = np.zeros(len(F), dtype=bool)
    chosen[extremes(F)] = chosen[rng.permutation(len(F))[:limit]] = True
    best = extremes(F)
    if np.count_nonzero(chosen) > len(set(best)):
        assert np.array_equal(fought(F, chosen, best), fought_by_definition(F, chosen, best))
