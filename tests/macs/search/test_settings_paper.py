"""Settings of `MACS.paper()`: the directions, social actions, velocities and first re-seeding of the authors."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from boxes import boxed

from macs.pareto.archive import Archive
from macs.search.individual import individual_actions
from macs.search.macs import MACS
from macs.search.settings import PAPER, Variant
from macs.search.social import assign, social_actions
from macs.search.trials import Trials


def schaffer(X):
    return np.stack([(X**2).sum(axis=1), ((X - 1) ** 2).sum(axis=1)], axis=1)


def begun(settings, function=schaffer, d=3):
    """Settings at work on a function: its state, and the two phases of an iteration as functions."""
    box = boxed(function, [(-2, 2)] * d)
    state = settings.begin(box, 10_000, np.random.default_rng(0))
    trials = Trials(settings, state, box, 10_000)
    return state, lambda: individual_actions(trials), lambda: social_actions(trials), trials


def owned(state):
    """Angles of the agents' directions, in degrees."""
    sine, cosine = state.directions[state.agents.direction].T
    return np.degrees(np.arctan2(sine, cosine))


def test_directions_are_equally_spaced_and_kept_for_the_whole_run():
    settings, box = MACS.paper(), boxed(schaffer, [(-2, 2)] * 3)
    state = settings.begin(box, 600, np.random.default_rng(0))
    first = owned(state)
    assert np.allclose(np.sort(first), np.arange(0, 91, 10)) and first[:2].tolist() == [90.0, 0.0]
    while state.evaluations < 600:
        settings.advance(state, box, 600)
        assert np.array_equal(owned(state), first)
    assert [MACS.paper(agents=n).directions_to_draw_from(2) for n in (4, 20)] == [4, 20] and MACS().directions_to_draw_from(2) == 200


def test_social_actions_only_feed_the_archive():
    for settings in (MACS.paper(), MACS()):
        state, individual, social, trials = begun(settings)
        individual()
        before, seen = copy.deepcopy(state), len(trials.seen)
        social()
        unchanged = [np.array_equal(value, vars(before.agents)[name]) for name, value in vars(state.agents).items()]
        assert len(trials.seen) == seen + 1
        assert state.evaluations == before.evaluations + len(trials.seen[-1].F)
        assert all(unchanged) == (settings == MACS.paper())


@pytest.mark.parametrize("settings", [MACS.paper(), MACS()])
def test_inertia_erases_the_velocity_or_adds_to_a_part_of_it(settings):
    state, individual, *_ = begun(settings, lambda X: np.stack([X.sum(axis=1)] * 2, axis=1))
    state.agents.Z[:], state.agents.F[:], state.agents.velocity[:] = 0.0, 0.0, -0.1
    individual()
    assert (np.ptp(state.agents.Z, axis=1) == 0.0).all()  # all coordinates alike: along the velocity
    assert (state.agents.Z < 0.0).all()
    momentum = settings.variant.momentum
    assert np.allclose(state.agents.velocity, state.agents.Z / 4 - momentum * 0.1 if momentum else 0.0)


def test_pattern_search_leaves_its_displacement():
    state, individual, *_ = begun(MACS.paper(), lambda X: np.stack([X.sum(axis=1)] * 2, axis=1))
    state.agents.Z[:], state.agents.F[:] = 0.0, 0.0
    individual()
    assert ((state.agents.velocity < 0.0).sum(axis=1) == 1).all()
    assert np.allclose(state.agents.velocity * 4, state.agents.Z)
    settings = MACS(variant=replace(PAPER, CR=1.0))
    # Off the diagonal everything is worse: only differences of agents on it lead along it.
    state, individual, *_ = begun(settings, lambda X: np.stack([np.abs(X[:, 0]) + 99 * np.abs(X[:, 1] - X[:, 0])] * 2, axis=1), d=2)
    state.agents.Z[:] = np.linspace(0.1, 1.0, 10)[:, None]
    state.agents.F[:] = np.linspace(0.1, 1.0, 10)[:, None]
    state.agents.velocity[:] = [0.1, -0.1]
    before = state.agents.Z.copy()
    individual()
    moved = (before != state.agents.Z).any(axis=1)
    assert 0 < moved.sum() < 10 and (state.agents.velocity[moved] == 0.0).all()
    assert (state.agents.velocity[~moved] == [0.1, -0.1]).all()


@pytest.mark.parametrize("settings", [MACS.paper(), MACS()])
def test_the_only_point_of_the_archive_gets_the_nearest_agent_of_an_orthogonal_direction(settings):
    box = boxed(schaffer, [(-2, 2)] * 3)
    state = settings.begin(box, 100, np.random.default_rng(0))
    state.archive = Archive(np.zeros((1, 3)), np.array([[0.0, 3.0]]), np.zeros(1))
    state.ideal = state.nadir = state.archive.F[0]
    state.agents.Z[:], state.agents.F[:] = 1.0, [3.0, 0.0]
    state.agents.F[[0, 1, 2]] = [[np.nan, np.nan], [2.0, 2.0], [0.0, 3.0]]
    assign(state, settings)
    assert np.flatnonzero((state.agents.Z == 0.0).all(axis=1)).tolist() == [1]


def test_without_feasible_points_no_agent_moves():
    box = boxed(schaffer, [(-2, 2)] * 3, constraints=lambda X: 1 + X**2)
    state = MACS.paper().begin(box, 100, np.random.default_rng(0))
    before = state.agents.Z.copy()
    assign(state, MACS.paper())
    assert np.array_equal(state.agents.Z, before)


@pytest.mark.parametrize(("F", "CR"), [(0.5, 0.25), (1.5, 1.0)])
def test_differential_evolution_takes_its_weight_and_its_probability_from_the_settings(monkeypatch, F, CR):
    state, individual, *_ = begun(MACS(variant=Variant(F=F, CR=CR)), lambda X: np.stack([X[:, 0] ** 2] * 2, axis=1))
    state.agents.F[:] = 0.0  # nothing is better, so that all come to this action
    used = []

    def differential(box, X, donors, *weights):
        used.append(weights[:2])
        return X

    monkeypatch.setattr("macs.search.individual.differential", differential)
    individual()
    assert used == [(F, CR)]
