"""Constraints as presented to algorithms, against the definition of constrained dominance; degrees against hand-computed cases of eqs.
(16)-(18) of Chai and others (2020)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from macs import MOPSO, NSGA2
from macs.baselines.population import DEGREES, by_objectives, excess, presented
from macs.baselines.population import violation_degree as degree
from macs.pareto.dominance import constrained_dominates, dominates

VALUES = st.floats(-1e9, 1e9).map(lambda value: round(value, 3))
AMOUNTS = st.sampled_from([0.0, 1e-9, 0.25, 0.5, 1.0, 1.5, 3.0, 100.0])
VIOLATIONS = st.sampled_from([0.0, 1e-9, 1e-6, 2e-6, 0.5, 0.5000001, 3.0, 1e9, np.inf])


@given(arrays(float, (6, 2), elements=VALUES), arrays(float, 6, elements=VIOLATIONS))
def test_objectives_that_include_the_violation_dominate_as_feasible_first_does(F, violation):
    F[np.isinf(violation)] = np.nan
    G = by_objectives(*presented("feasible-first", 0.0, F, violation, 1e-6))
    assert np.isfinite(G).all()
    wanted = constrained_dominates(F[:, None], violation[:, None], F, violation, 1e-6)
    assert np.array_equal(dominates(G[:, None], G), wanted)


@pytest.mark.parametrize(
    ("handling", "expected", "beyond"),
    [
        ("feasible-first", [[1, 2], [3, 4], [5, 6]], [0, 0, 0.5, np.inf]),
        ("penalty", [[1, 2], [3, 4], [10, 11]], [0, 0, 0, np.inf]),
        ("objective", [[1, 2, 0], [3, 4, 0], [5, 6, 0.5]], [0, 0, 0, np.inf]),
    ],
)
def test_the_three_ways_by_hand(handling, expected, beyond):
    F, violation = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [np.nan, 0.0]]), np.array([0.0, 1e-7, 0.5, np.inf])
    shown, cv = presented(handling, 10.0, F, violation, 1e-6)
    assert shown[:3].tolist() == expected and cv.tolist() == beyond and np.isfinite(shown).all()
    # With another degree of violation, that one is in its place.
    doubled = presented(handling, 10.0, F, violation, 1e-6, 2.0 * violation)
    same = presented(handling, 10.0, F, np.array([0.0, 0.0, 1.0, np.inf]), 1e-6)
    assert all(np.array_equal(one, other) for one, other in zip(doubled, same, strict=True))


def test_a_heating_rate_and_a_pressure_by_hand() -> None:
    """Limits 200 and 280: rates of 250, 300, 500 and 900, pressures of 280, 350, 560 and 1400."""
    v = np.array([[250, 280], [300, 350], [500, 560], [900, 1400]]) / [200, 280] - 1
    worst = v.max(axis=1)

    def by(name: str) -> np.ndarray:
        return degree(name, worst, lambda: v, 1e-6)

    assert by("largest").tolist() == pytest.approx([0.25, 0.5, 1.5, 4.0])
    assert by("sum").tolist() == pytest.approx([0.25, 0.75, 2.5, 7.5])
    assert by("log").tolist() == pytest.approx([np.log(1.25), np.log(1.5) + np.log(1.25), np.log(2.5 * 2), np.log(4.5 * 5)])
    assert by("capped").tolist() == pytest.approx([0.25, 0.75, 2.0, 2.0])  # at twice the limit
    assert by("printed").tolist() == pytest.approx([0.25 / 3.5, 0.5 / 3.5 + 0.25 / 4.0, 2.0, 2.0])  # g_max: 900 and 1400


def test_what_failed_or_is_no_number_is_violated_infinitely_and_what_is_within_the_tolerance_not():
    v = np.array([[5e-7, 0.3], [5e-7, 1e-7], [np.nan, 0.1], [np.inf, 0.1]])
    worst = np.array([0.3, 5e-7, np.inf, np.inf])
    for name in DEGREES[1:]:
        found = degree(name, worst, lambda: v, 1e-6)
        assert found[0] == pytest.approx({"log": np.log1p(0.3), "printed": 1.0}.get(name, 0.3)) and found[1] == 0
        assert np.isinf(found[2:]).all()
    violation = np.array([1.0, 1.0, 1.0, np.inf])
    for name in ("sum", "log"):
        found = degree(name, violation, lambda: np.array([[np.nan, 0.0], [np.inf, 0.0], [1.0, 1.0], [1.0, 1.0]]), 1e-6)
        assert found[[0, 1, 3]].tolist() == [np.inf] * 3 and found[2] == pytest.approx(2.0 if name == "sum" else 2.0 * np.log(2.0))
    assert degree("sum", violation[:1], lambda: np.array([[1e-6, 2e-6]]), 1e-6).tolist() == [2e-6]
    F = np.array([[1.0, 2.0], [np.nan, 2.0], [1.0, 2.0], [1.0, 2.0], [np.inf, 2.0]])
    violation = np.array([0.5, 0.5, np.nan, np.inf, 0.0])
    assert excess(F, violation, 1e-6).tolist() == [0.5, np.inf, np.inf, np.inf, np.inf]
    assert excess(F, violation, 1e-6, np.full(5, 3.0)).tolist() == [3.0, np.inf, np.inf, np.inf, np.inf]


@given(arrays(float, (5, 3), elements=AMOUNTS), st.sampled_from(DEGREES))
def test_a_degree_is_none_exactly_where_a_point_is_feasible_and_never_falls_with_a_violation(v, name) -> None:
    found = degree(name, v.max(axis=1), lambda: v, 1e-6)
    assert np.array_equal(excess(np.zeros((5, 2)), v.max(axis=1), 1e-6, found) > 0, v.max(axis=1) > 1e-6)
    more = degree(name, (v + 1).max(axis=1), lambda: v + 1, 1e-6)
    assert (more >= found).all()
    if name in ("sum", "log"):
        assert (more > found).all()


def two_limits(X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Far from feasible almost everywhere: both limits are missed by many times their size."""
    F = np.stack([(X**2).sum(axis=1), ((X - 1) ** 2).sum(axis=1)], axis=1)
    return F, np.stack([20 * (np.abs(X[:, 0] - 0.6) - 0.01), 20 * (np.abs(X[:, 1] - 0.3) - 0.01)], axis=1)


@pytest.mark.parametrize("name", DEGREES[:3])  # the printed one does not distinguish better from worse where both are missed by their size
@pytest.mark.parametrize("solver", [NSGA2, MOPSO], ids=lambda kind: kind.__name__)
def test_solvers_rank_by_the_degree_and_show_the_violation(solver, name) -> None:
    size = {"particles": 20} if solver is MOPSO else {"population": 20}
    front = solver(**size, degree=name).minimize(two_limits, [(-2, 2)] * 2, evaluations=1000, seed=3)
    seen = front.stats["population"]
    assert len(front) and (np.abs(front.decision - [0.6, 0.3]) <= 0.01 + 1e-6).all()
    assert 1 <= seen["first_feasible"] <= seen["generations"]


def test_how_feasible_populations_are_is_counted_generation_by_generation() -> None:
    generations: list[int] = []

    def function(X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Only what is evaluated from the third generation on is feasible."""
        generations.append(len(X))
        return X, np.full((len(X), 1), 1.0 if len(generations) < 3 else -1.0)

    front = NSGA2(population=10).minimize(function, [(0, 1)] * 2, evaluations=60, seed=1)
    expected = {"generations": 6, "size": 10, "feasible": 10, "nondominated": len(front), "first_feasible": 3, "all_feasible": 3}
    assert front.stats["population"] == expected
    front = NSGA2(population=10).minimize(lambda X: (X, X[:, :1] + 1), [(0, 1)] * 2, evaluations=60, seed=1)
    none = {"feasible": 0, "nondominated": 0, "first_feasible": None, "all_feasible": None}
    assert front.stats["population"] == {"generations": 6, "size": 10, **none}
