"""What the search makes of an evaluator that moves its candidates, and of variables that it may not alter itself."""

import copy

import numpy as np
import pytest

from macs.evaluation.evaluator import Counts, Evaluation, Evaluator
from macs.search.macs import MACS
from macs.search.trials import Trials


class Sticky(Evaluator):
    """Free are entries 1 and 2 of three; the last of them is always put back to 0.5, and entry 0 remembers the point it started from."""

    def __init__(self):
        self.free, self.lower, self.upper, self.period = np.array([1, 2]), np.zeros(2), np.ones(2), np.zeros(2)
        self.tolerance, self.counts, self.started_from = 1e-6, Counts(), []

    def first_guess(self, candidates):
        return np.hstack([np.full((len(candidates), 1), 7.0), candidates])

    def _evaluate(self, Z, way=None):
        self.started_from.append(Z[:, 0].copy())
        back = Z.copy()
        back[:, 2] = 0.5
        back[:, 0] = Z[:, 1]
        F = np.stack([back[:, 1], back[:, 1] ** 2], axis=1)
        return Evaluation(back, F, np.zeros(len(Z)), np.full(len(Z), "converged")), 1


def prepared(settings=None):
    box, settings = Sticky(), settings or MACS()
    state = settings.begin(box, 1000, np.random.default_rng(0))
    agents = state.agents
    agents.Z[:], agents.velocity[:] = [0.8, 0.8, 0.5], 0.0
    agents.F[:] = [0.8, 0.64]
    return box, state, Trials(settings, state, box, 1000)


def test_velocity_credit_and_memory_are_of_what_was_achieved():
    _, state, trials = prepared()
    rows = np.array([2, 5])
    X = trials.positions(rows)
    success = trials.evaluate_and_accept(rows, X, X + np.array([[-0.2, 0.1], [0.1, 0.1]]))
    assert success.tolist() == [True, False] and np.allclose(state.agents.velocity[2], [-0.2, 0.0])
    assert np.allclose(state.agents.Z[2], [0.6, 0.6, 0.5])
    assert (state.agents.velocity[5] == 0.0).all()
    _, _, trials = prepared()
    rows = np.array([0, 1])
    X = trials.positions(rows)
    assert trials.evaluate_and_accept(rows, X, X + np.array([[-0.01, 0.4], [-0.4, 0.01]])).all()
    assert trials.successful[:2].tolist() == [False, True]
    box, _, trials = prepared()
    trials.state.agents.Z[3, 0] = 0.123
    rows = np.array([3])
    X = trials.positions(rows)
    trials.evaluate_and_accept(rows, X, X - 0.1)
    assert box.started_from[-1].tolist() == [0.123] and box.started_from[0].tolist() == [7.0] * 10


@pytest.mark.parametrize(
    ("settings", "scan", "velocity"),
    [(MACS(), False, [-0.13, 0.07]), (MACS(), True, [-0.13, 0.07]), (MACS.paper(), False, [0.0, 0.0]), (MACS.paper(), True, [-0.2, 0.0])],
)
def test_a_success_adds_a_part_of_the_last_velocity_and_a_failure_leaves_all_of_it(settings, scan, velocity):
    _, state, trials = prepared(settings)
    rows = np.array([2, 5])
    X = trials.positions(rows)
    state.agents.velocity[:] = 0.1
    trials.evaluate_and_accept(rows, X, X + np.array([[-0.2, 0.1], [0.1, 0.1]]), scan)
    assert np.allclose(state.agents.velocity[[2, 5, 6]], [velocity, [0.1, 0.1], [0.1, 0.1]])


def test_what_is_only_looked_at_is_seen_and_changes_no_agent():
    box, state, trials = prepared()
    before, rows = copy.deepcopy(state), np.array([2, 5, 6])
    X = trials.positions(rows)
    looked, result = trials.evaluate(state.agents.Z[rows], X, X - np.array([[0.2, 0.0], [0.0, 0.0], [0.3, 0.0]]))
    assert looked.tolist() == [0, 2] and np.allclose(result.F[:, 0], [0.6, 0.5])
    assert trials.seen == [result]
    assert state.evaluations == box.counts.evaluations == before.evaluations + 2
    assert all(np.array_equal(value, vars(before.agents)[name]) for name, value in vars(state.agents).items())


def test_a_proposal_that_is_only_as_good_for_the_direction_of_its_agent_is_no_success():
    """The last coordinate does not matter, so that a step along it gives the same objectives; one that is better by little is a success."""
    _, state, trials = prepared()
    rows = np.array([2, 5])
    state.agents.direction[rows] = 0
    before = state.agents.Z[rows].copy()
    X = trials.positions(rows)
    assert not trials.evaluate_and_accept(rows, X, X + np.array([[0.0, 0.1], [0.0, 0.2]])).any()
    assert np.array_equal(state.agents.Z[rows], before) and not state.agents.velocity[rows].any()
    assert trials.evaluate_and_accept(rows, X, X + np.array([[-1e-9, 0.1], [0.0, 0.2]])).tolist() == [True, False]


def test_what_agents_gain_is_counted_in_ranges_of_the_front():
    """An agent at 0.8 that gets to 0.6 gains 0.2 of the first objective and 0.28 of the second; one that does not improve gains nothing."""
    _, state, trials = prepared()
    state.ideal, state.nadir = np.zeros(2), np.array([2.0, 0.5])
    rows = np.array([2, 5])
    X = trials.positions(rows)
    trials.evaluate_and_accept(rows, X, X + np.array([[-0.2, 0.1], [0.1, 0.1]]))
    assert np.allclose(trials.gained[[2, 5]], [(0.2 / 2.0 + 0.28 / 0.5) / 2.0, 0.0])
    assert trials.tried[[2, 5]].tolist() == [1, 1] and trials.tried.sum() == 2
    state.agents.violation[2], state.agents.violation[5] = 3.0, np.inf
    X = trials.positions(rows)
    trials.evaluate_and_accept(rows, X, X + 0.1)
    assert np.allclose(trials.gained[[2, 5]], [(0.2 / 2.0 + 0.28 / 0.5) / 2.0 + 1.0, 1.0]), "all of the violation is gone"
    assert trials.tried[[2, 5]].tolist() == [2, 2]
