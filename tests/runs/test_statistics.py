"""Statistics against scipy, hand-computed cases, and what must hold of any sample."""

import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st

from runs.measures.statistics import a12, effect, holm, overall, pairwise, summarise

NAN, INF = np.nan, np.inf
values = st.one_of(st.integers(-20, 20).map(float), st.sampled_from([NAN, INF]))
samples = st.lists(values, min_size=1, max_size=12)


@pytest.mark.filterwarnings("error")
def test_summaries_by_hand_with_failed_runs_counted_and_last():
    s = summarise([4.0, 1.0, 3.0, 2.0])
    assert (s.count, s.failures, s.mean, s.median, s.best, s.worst) == (4, 0, 2.5, 2.5, 1.0, 4.0)
    assert s.variance == pytest.approx(5 / 3) and (s.lower, s.upper) == (1.75, 3.25)
    large = summarise([4.0, 1.0, 3.0, 2.0], larger=True)
    assert (large.best, large.worst, large.lower, large.upper) == (4.0, 1.0, 1.75, 3.25)
    s = summarise([NAN, 1.0, 3.0, INF, 2.0])
    assert (s.count, s.failures, s.mean, s.median, s.best, s.worst) == (5, 2, 2.0, 3.0, 1.0, INF)
    assert (s.lower, s.upper) == (2.0, INF)
    assert summarise([NAN, 1.0, 3.0], larger=True).worst == -INF
    none = summarise([NAN, INF])
    assert none.failures == 2 and np.isnan(none.mean) and np.isnan(none.variance) and none.median == none.best == INF
    one = summarise([7.0])
    assert one.mean == one.median == one.best == 7.0 and np.isnan(one.variance)
    assert np.isnan(summarise([7.0, NAN]).variance)
    # Half of the way between the second and the third of four, both of which failed; and nothing is said of means of nothing.
    s = summarise([NAN, 1.0, INF, NAN])
    assert (s.lower, s.median, s.upper, s.best, s.worst) == (INF, INF, INF, 1.0, INF)
    assert (s.mean, summarise([NAN, NAN]).count) == (1.0, 2)


@given(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=30))
def test_summaries_as_numpy_has_them(sample):
    s = summarise(sample)
    assert [s.lower, s.median, s.upper] == pytest.approx(np.quantile(sample, [0.25, 0.5, 0.75]).tolist(), rel=1e-12, abs=1e-9)
    assert s.variance == pytest.approx(np.var(sample, ddof=1))


def test_holm_effects_and_ranks_by_hand_of_samples_alike_and_failed():
    # Sorted 0.01, 0.02, 0.03, 0.04 times 4, 3, 2, 1: 0.04, 0.06, 0.06, 0.04, of which the last may not fall below those before.
    assert holm([0.04, 0.01, 0.03, 0.02]).tolist() == pytest.approx([0.06, 0.04, 0.06, 0.06])
    assert holm([0.5, 0.9]).tolist() == [1.0, 1.0] and holm([0.03]).tolist() == [0.03] and holm([]).tolist() == []
    # Of nine pairs, (1, 2), (1, 4), (3, 4) and so on: better in 6, a tie in 1.
    assert a12([1, 3, 4], [2, 4, 5]) == pytest.approx((6 + 0.5) / 9)
    assert a12([1.0, 2.0], [3.0, NAN]) == 1.0 and a12([1.0, 2.0], [3.0, 4.0], larger=True) == 0.0
    assert a12([NAN], [INF]) == 0.5 and a12([NAN], [1.0]) == 0.0
    words = {0.5: "negligible", 0.56: "small", 0.44: "small", 0.64: "medium", 0.36: "medium", 0.71: "large", 0.29: "large", 0.0: "large"}
    assert {value: effect(value) for value in words} == words
    data = {"a": [1.0, 2.0], "b": [2.0, 2.0], "c": [3.0, NAN]}
    assert overall(data).ranks == {"a": 2.0, "b": 3.0, "c": 5.5}
    assert overall({"a": [1.0, 2.0], "b": [5.0]}, larger=True).ranks == {"a": 2.5, "b": 1.0}
    same = {"a": [1.0] * 5, "b": [1.0] * 5, "c": [1.0] * 5}
    failed = {"a": [NAN] * 5, "b": [INF] * 5, "c": [NAN] * 5}
    for data in (same, failed):
        assert all(c.p == c.p_holm == 1.0 and c.a12 == 0.5 and c.effect == "negligible" for c in pairwise(data))
        result = overall(data)
        assert result.p == 1.0 and result.statistic == 0.0 and len(set(result.ranks.values())) == 1
    assert pairwise({"a": [1.0], "b": [2.0]})[0].p == 1.0
    good, bad = np.arange(10.0), np.full(10, NAN)
    assert pairwise({"good": good, "bad": bad})[0].a12 == 1.0
    assert pairwise({"good": good, "bad": bad})[0].p < 1e-3
    assert pairwise({"good": good, "bad": bad}, larger=True)[0].a12 == 1.0
    ranks = overall({"good": good, "bad": bad}, larger=True).ranks
    assert ranks["good"] < ranks["bad"]


@settings(deadline=None, max_examples=40)
@given(samples, samples, st.booleans())
def test_effects_mirror_and_see_only_the_order(a, b, larger):
    assert a12(a, b, larger=larger) + a12(b, a, larger=larger) == pytest.approx(1.0)
    assert a12(a, a) == 0.5
    bent_a, bent_b = (np.exp(np.array(sample) / 5.0) for sample in (a, b))
    assert a12(a, b) == a12(bent_a, bent_b) == a12(-bent_a, -bent_b, larger=True)
    one, other = pairwise({"a": a, "b": b}), pairwise({"a": bent_a, "b": bent_b})
    assert one == other and 0 <= one[0].p <= 1
    assert overall({"a": a, "b": b}) == overall({"a": bent_a, "b": bent_b})


@settings(deadline=None, max_examples=40)
@given(samples, samples)
def test_neither_order_nor_direction_changes_p(a, b):
    there, back = pairwise({"a": a, "b": b})[0], pairwise({"b": b, "a": a})[0]
    assert there.p == pytest.approx(back.p) and there.a12 == pytest.approx(1 - back.a12)
    assert pairwise({"a": -np.array(a), "b": -np.array(b)}, larger=True)[0].p == there.p


def test_pairs_as_scipy_has_them():
    rng = np.random.default_rng(0)
    data = {"a": rng.normal(size=12), "b": rng.normal(0.8, size=12), "c": rng.normal(1.5, size=12)}
    found = pairwise(data)
    assert [(c.first, c.second) for c in found] == [("a", "b"), ("a", "c"), ("b", "c")]
    for c in found:
        theirs = scipy.stats.mannwhitneyu(data[c.first], data[c.second])
        assert (c.statistic, c.p) == pytest.approx((theirs.statistic, theirs.pvalue))
        assert c.a12 == pytest.approx(1 - theirs.statistic / 144) and c.note == ""
    assert [c.p_holm for c in found] == holm([c.p for c in found]).tolist()
    rng = np.random.default_rng(1)
    data = {"a": rng.normal(size=9), "b": rng.normal(0.8, size=9), "c": rng.normal(1.5, size=9), "d": rng.normal(size=9)}
    ours, theirs = overall(data), scipy.stats.kruskal(*data.values())
    assert (ours.statistic, ours.p) == pytest.approx((theirs.statistic, theirs.pvalue))
    assert sum(9 * rank for rank in ours.ranks.values()) == pytest.approx(36 * 37 / 2)


def test_pairs_by_hand():
    # Of the 20 ways to rank three among six, one is this apart, and one the other way round.
    (c,) = pairwise({"a": [1.0, 2.0, 3.0], "b": [4.0, 5.0, 6.0]})
    assert c.p == pytest.approx(0.1) and c.a12 == 1.0 and c.effect == "large"
    assert c.note == "Too few runs: p, corrected, cannot be below 0.1."
    # Of 40 places for a single run two are at the ends: p may be 0.05, and is not called impossible; of 39 it may not.
    many = np.arange(39.0)
    assert pairwise({"a": [50.0], "b": many})[0].note == ""
    assert pairwise({"a": [50.0], "b": many[1:]})[0].note == "Too few runs: p, corrected, cannot be below 0.051."
    # Five of each may be 2/252 apart, which is enough for six pairs and not for ten.
    five = {name: [float(5 * i + j) for j in range(5)] for i, name in enumerate("abcde")}
    assert all("cannot be below 0.079" in pair.note and pair.p_holm > 0.05 for pair in pairwise(five))
    assert all(pair.note == "" and pair.p_holm < 0.05 for pair in pairwise({name: five[name] for name in "abcd"}))
