"""Linear models of constraints from points around, and the steps to their zero, against projections in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from macs.evaluation.evaluator import UnitBox
from macs.search import repair
from macs.search.repair import MODEL_LIMITS
from macs.search.state import KEPT_SAMPLES, ResidualSamples

SEEDS = st.integers(0, 2**32 - 1)


def steps_to_zero(box, x, residuals, known):
    """Without whole numbers nothing is watched but what is violated."""
    return repair.steps_to_zero(box, x, residuals, known, residuals != 0.0)


def box(d, wraps=()):
    return UnitBox(np.zeros(d), np.ones(d), np.isin(np.arange(d), wraps))


def around(x, radius, count, residual, rng):
    """Points near x with their residuals."""
    X = x + radius * rng.uniform(-1.0, 1.0, (count, len(x)))
    return ResidualSamples.none(len(x)).joined(X, residual(X))


@given(SEEDS, st.integers(1, 8), st.data())
def test_the_step_is_the_projection_onto_planes(seed, d, data):
    """As long as no bound is in the way: the shortest step to A x = b, by the pseudoinverse, and a little more."""
    c, rng = data.draw(st.integers(1, d)), np.random.default_rng(seed)
    A = np.linalg.qr(rng.standard_normal((d, d)))[0][:c] * rng.uniform(0.1, 1e4, (c, 1))
    x = np.full(d, 0.5)
    b = A @ (x + 0.01 * rng.uniform(-1.0, 1.0, d))
    known = around(x, 0.2, 2 * d + 2, lambda X: X @ A.T - b, rng)
    step = steps_to_zero(box(d), x[None], (A @ x - b)[None], known)[0]
    assert step == pytest.approx(-(1.0 + MODEL_LIMITS.beyond) * np.linalg.pinv(A) @ (A @ x - b), rel=1e-6, abs=1e-12)


def test_constraints_without_a_residual_have_no_part():
    rng, x = np.random.default_rng(1), np.array([0.5, 0.5, 0.5])
    known = around(x, 0.1, 8, lambda X: np.column_stack([X[:, 0] - 0.4, np.maximum(X[:, 1] - 0.6, 0.0)]), rng)
    step = steps_to_zero(box(3), x[None], np.array([[0.1, 0.0]]), known)[0]
    assert step == pytest.approx([-0.1 * (1.0 + MODEL_LIMITS.beyond), 0.0, 0.0], abs=1e-9)
    assert x[0] + step[0] < 0.4 - 1e-3, "inside of the limit"


@pytest.mark.parametrize(("d", "most"), [(1, 0.9), (2, 0.95), (4, 0.95), (8, 0.9)])
def test_limits_on_absolute_values_are_met_from_either_side(d, most, monkeypatch):
    """abs(a x - b) <= 0 has a kink at the plane. With points on both sides most steps end on the plane, and few without signs."""
    rng, x = np.random.default_rng(d), np.full(d, 0.5)
    met, without_signs = [], []
    for _ in range(100):
        a = rng.standard_normal(d)
        b = a @ x + 0.02 * np.linalg.norm(a) * rng.choice([-1.0, 1.0])
        known = around(x, 0.1, 4 * d + 4, lambda X, a=a, b=b: np.abs(X @ a - b)[:, None], rng)
        amount = np.abs(a @ x - b)[None, None]
        met.append(abs(a @ (x + steps_to_zero(box(d), x[None], amount, known)[0]) - b) < 0.021 * amount)
        with monkeypatch.context() as alone:
            alone.setattr(repair, "MODEL_LIMITS", replace(MODEL_LIMITS, rounds=0))
            without_signs.append(abs(a @ (x + steps_to_zero(box(d), x[None], amount, known)[0]) - b) < 0.021 * amount)
    assert np.mean(met) > most and np.mean(without_signs) < 0.25


@pytest.mark.parametrize("d", [1, 4, 16])
def test_limits_on_one_side_are_not_taken_for_absolute_values(d, monkeypatch):
    """Curved, with points on both sides, near and far: the same steps as without trying other signs, for 99 %."""
    rng, x = np.random.default_rng(d), np.full((1, d), 0.5)
    changed = 0
    for k in range(200):
        centre, side = 0.5 + 0.3 * rng.uniform(-1.0, 1.0, d), rng.choice([-1.0, 1.0])
        limit = ((x - centre) ** 2).sum() - side * (0.001, 0.01, 0.1)[k % 3]
        ball = lambda X, c=centre, r=limit, s=side: np.maximum(s * (((X - c) ** 2).sum(axis=1, keepdims=True) - r), 0.0)  # noqa: E731
        known = around(x[0], (0.02, 0.1, 0.3)[k // 3 % 3], 4 * d + 4, ball, rng)
        step = steps_to_zero(box(d), x, ball(x), known)
        with monkeypatch.context() as without:
            without.setattr(repair, "MODEL_LIMITS", replace(MODEL_LIMITS, rounds=0))
            changed += not np.array_equal(step, steps_to_zero(box(d), x, ball(x), known))
    assert changed <= 2


def test_steps_end_at_bounds_go_the_shorter_way_and_not_far():
    """The nearest point of the plane x1 + x2 + x3 = 0.6 in the box, from (0.02, 0.5, 0.5), has x1 = 0: (0, 0.3, 0.3)."""
    rng, x = np.random.default_rng(1), np.array([0.02, 0.5, 0.5])
    known = around(x, 0.4, 8, lambda X: X.sum(axis=1, keepdims=True) - 0.6, rng)
    step = steps_to_zero(box(3), x[None], np.array([[0.42]]), known)[0]
    over = MODEL_LIMITS.beyond * 0.42 / 2
    assert x + step == pytest.approx([0.0, 0.3 - over, 0.3 - over], abs=1e-9)
    rng, x = np.random.default_rng(1), np.array([0.9, 0.8])
    known = around(x, 0.3, 5, lambda X: X.sum(axis=1, keepdims=True) + 1.0, rng)
    far = np.vstack([known.X, [[-1.0, -1.0]]])
    step = steps_to_zero(box(2), x[None], np.array([[2.7]]), ResidualSamples(far, far.sum(axis=1, keepdims=True) + 1.0))[0]
    assert x + step == pytest.approx([0.0, 0.0], abs=1e-9)
    x = np.array([0.98, 0.5])
    X = np.array([[0.02, 0.5], [0.96, 0.5], [0.98, 0.6]])
    turn = lambda X: (np.mod(X[:, :1] - 0.5, 1.0) - 0.5) - 0.01  # noqa: E731 - 0 at 0.01, which is beyond the bound
    step = steps_to_zero(box(2, [0]), x[None], turn(x[None]), ResidualSamples(X, turn(X)))[0]
    assert step == pytest.approx([0.03 * (1.0 + MODEL_LIMITS.beyond), 0.0], abs=1e-9)
    # x1 = 0.4 and x1 + 1e-6 x2 = 0.41 are both zero at x2 = 10,000 only: the step ends between the two planes.
    rng, x = np.random.default_rng(1), np.array([0.5, 0.5])
    A, b = np.array([[1.0, 0.0], [1.0, 1e-6]]), np.array([0.4, 0.41])
    step = steps_to_zero(box(2), x[None], (A @ x - b)[None], around(x, 0.4, 6, lambda X: X @ A.T - b, rng))[0]
    assert step == pytest.approx([-0.095 * (1.0 + MODEL_LIMITS.beyond), 0.0], abs=1e-6)


def test_no_step_is_longer_than_what_is_known_reaches_and_only_the_last_points_are_kept():
    x = np.array([0.5])
    known = ResidualSamples(np.array([[0.51], [0.49]]), np.array([[0.99], [1.01]]))
    assert steps_to_zero(box(1), x[None], np.array([[1.0]]), known)[0] == pytest.approx([0.01])
    x = np.array([[0.5, 0.5]])
    assert not steps_to_zero(box(2), x, np.array([[1.0]]), ResidualSamples(x, np.array([[1.0]]))).any()
    flat = ResidualSamples(np.array([[0.4, 0.5], [0.6, 0.5]]), np.ones((2, 1)))
    assert not steps_to_zero(box(2), x, np.array([[1.0]]), flat).any()
    first = ResidualSamples.none(1).joined(np.zeros((KEPT_SAMPLES, 1)), np.zeros((KEPT_SAMPLES, 2)))
    both = first.joined(np.ones((3, 1)), np.ones((3, 2)))
    assert len(first) == len(both) == KEPT_SAMPLES and both.X.sum() == 3.0 and both.residuals.sum() == 6.0
    assert repr(both) == f"<ResidualSamples: {KEPT_SAMPLES} with 2 residuals>"


def test_a_few_steps_lead_to_a_curved_constraint():
    """Each makes the models better: from a residual of a tenth to 1e-5 in six steps, on a sphere in five dimensions."""
    rng = np.random.default_rng(1)
    sphere = lambda X: ((X - 0.5) ** 2).sum(axis=1, keepdims=True) - 0.09  # noqa: E731
    for _ in range(20):
        u = rng.standard_normal(5)
        x = 0.5 + np.sqrt(0.09 + rng.uniform(-0.05, 0.1)) * u / np.linalg.norm(u)
        known = around(x, 0.05, 12, sphere, rng)
        for _ in range(6):
            x = x + steps_to_zero(box(5), x[None], sphere(x[None]), known)[0]
            known = known.joined(x[None], sphere(x[None]))
        assert abs(sphere(x[None])[0, 0]) < 1e-5
