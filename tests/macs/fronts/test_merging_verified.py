"""Merged fronts of points of which some are verified, some are not, and some were not simulated."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from macs import Front
from macs.fronts.builders import best_rows
from problems.compiled import Objective, Variable

GOALS = (Objective("time"), Objective("height", sense="maximize"))
X = Variable("x", 0.0, 1.0)


def front(F, simulated_F, verified, **more) -> Front:
    n = len(F)
    seen = ~np.isnan(np.asarray(simulated_F, dtype=float)).any(axis=1)
    columns = {
        "F": F, "simulated_F": simulated_F, "verified": verified, "defect": np.where(seen, 0.0, np.nan),
        "decision": np.arange(n)[:, None], "violation": np.zeros(n), "status": ["converged"] * n, "goals": GOALS, "variables": (X,),
        "stats": {"verify": 1e-3}, "sort": False, **more,
    }  # fmt: skip
    return Front(**columns)


def dominates(one, other) -> bool:
    return bool((one <= other).all() and (one < other).any())


@st.composite
def fronts(draw) -> Front:
    n = draw(st.integers(0, 8))
    values = st.integers(0, 4).map(float)
    F, S = (draw(arrays(float, (n, 2), elements=values)) for _ in range(2))
    kind = draw(arrays(int, n, elements=st.integers(0, 2)))  # not simulated, not verified, verified
    return front(F, np.where((kind == 0)[:, None], np.nan, S), kind == 2)


@given(fronts())
def test_verified_points_are_compared_among_themselves_and_never_displaced(found):
    kept = best_rows(found)
    F, S, good = found.F, found.simulated_F, np.flatnonzero(found.verified)
    others = np.flatnonzero(~found.verified)
    assert kept.tolist() == sorted(set(kept.tolist()))
    for i in good:
        beaten = any(dominates(S[j], S[i]) for j in good)
        first = not any((S[j] == S[i]).all() for j in good if j < i)
        assert (i in kept) == (not beaten and first)
    for i in others:
        beaten = any((S[j] <= F[i]).all() for j in good) or any(dominates(F[j], F[i]) for j in others)
        first = not any((F[j] == F[i]).all() for j in others if j < i)
        assert (i in kept) == (not beaten and first)


def test_what_is_not_verified_displaces_nothing_and_is_displaced():
    """On its mesh the first is better than all others in both objectives; the last is as good as a verified point."""
    claims = [[0.0, 0.0], [1.0, 3.0], [2.0, 2.0], [3.0, 2.5], [2.5, 2.5]]
    actual = [[9.0, 9.0], [1.5, 3.5], [2.0, 2.0], [3.0, 1.0], [9.0, 9.0]]
    verified = [False, True, True, True, False]
    merged = Front.merge([front(claims, actual, verified)])
    assert merged.decision.ravel().tolist() == [0.0, 1.0, 2.0, 3.0]
    assert Front.merge([front(claims, actual, [False] * 5)]).decision.ravel().tolist() == [0.0]


def test_what_is_not_verified_and_better_by_no_more_than_points_may_miss_is_left_out():
    """Of three such points, the second is better than the verified one by more."""
    claims = [[1.9, 2.0], [1.7, 3.0], [1.95, 5.0], [2.0, 2.5]]
    found = front(claims, claims, [False, False, False, True])[[0, 1, 3]], front(claims, claims, [False, False, False, True])[[2, 3]]
    assert [best_rows(one).tolist() for one in found] == [[0, 1, 2], [0, 1]]
    assert [best_rows(one, np.array([0.2, 0.6])).tolist() for one in found] == [[1, 2], [1]]


def test_two_fronts_of_different_tolerances_are_judged_by_the_looser():
    one, two = ([[0.0, 1.0]], [[0.0, 1.0]]), ([[1.0, 0.0]], [[1.0, 0.0]])
    loose = front(*two, [True], stats={"verify": 1e-2})
    merged = Front.merge([front(*one, [True]), loose, front(*two, [False], stats={})])
    assert merged.stats["verify"] == 1e-2 and len(merged) == 2
    assert "verify" not in Front.merge([front(*one, [False], stats={})]).stats
    claims, actual = [[0.0, 0.0], [1.0, -1.0]], [[2.0, 2.0], [1.0, -1.0]]
    text = Front.merge([front(claims[:1], actual[:1], [False]), front(claims[1:], actual[1:], [True])]).table()
    assert "Not verified: simulated, these differ by more than 0.001." in text
