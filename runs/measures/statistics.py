"""Statistics of an indicator over many runs, and tests of whether solvers differ in it. Pure functions of samples.

A value that is NaN or infinite is a *failed* run: an empty front has no distance. Failed runs are never dropped: they rank below all
others, all alike. Mean and variance are those of the runs that did not fail, beside the number of failures.
Every test is of ranks, two-sided. Smaller values are better, unless `larger` is True (hypervolume).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import comb

import numpy as np

ALPHA = 0.05
"""Level of significance. A pair whose samples are too few for any p below it has a note."""


@dataclass(frozen=True)
class SampleSummary:
    """A sample in numbers."""

    count: int  # count, failures: Runs, and how many of them failed
    failures: int
    mean: float  # mean, variance: Of the runs that did not fail; variance with divisor n - 1. NaN where there are too few.
    variance: float
    # median, lower, upper: Median and quartiles (linear between values) of all runs, failed ones last: infinite where a failed one stands
    # there.
    median: float
    lower: float
    upper: float
    best: float  # best, worst: The worst is infinite if any run failed
    worst: float


@dataclass(frozen=True)
class PairTest:
    """Two solvers on one indicator."""

    first: str
    second: str
    statistic: float  # statistic, p, p_holm: Of the test, and p after Holm's correction for all pairs that were compared
    p: float
    p_holm: float
    a12: float  # probability that a run of the first is better than one of the second, a tie being half
    effect: str  # "negligible", "small", "medium" or "large"
    note: str = ""  # states that there are too few runs for any corrected p below 0.05; usually empty


@dataclass(frozen=True)
class Overall:
    """Several solvers on one indicator: whether any differs, and their average ranks, 1 being the best."""

    statistic: float
    p: float
    ranks: Mapping[str, float]


def summarise(values: Sequence[float] | np.ndarray, *, larger: bool = False) -> SampleSummary:
    """The numbers of a sample (n,), n >= 1; see `SampleSummary`. One run has a mean, but no variance."""
    costs = _costs(values, larger)
    sign = -1.0 if larger else 1.0
    good = sign * costs[np.isfinite(costs)]
    lower, upper = sorted(sign * _quantile(costs, share) for share in (0.25, 0.75))
    return SampleSummary(
        count=len(costs),
        failures=len(costs) - len(good),
        mean=float(good.mean()) if len(good) else np.nan,
        variance=float(good.var(ddof=1)) if len(good) > 1 else np.nan,
        median=sign * _quantile(costs, 0.5),
        lower=lower,
        upper=upper,
        best=sign * float(costs.min()),
        worst=sign * float(costs.max()),
    )


def pairwise(samples: Mapping[str, Sequence[float] | np.ndarray], *, larger: bool = False) -> list[PairTest]:
    """Mann-Whitney U tests of every pair of solvers, with Holm's correction and A12.

    p is exact where scipy's "auto" makes it so, else the normal approximation with correction for ties.
    """
    from scipy.stats import mannwhitneyu, rankdata

    costs = {name: _costs(values, larger) for name, values in samples.items()}
    pairs = [*combinations(costs, 2)]
    found = []
    for one, other in pairs:
        a, b = costs[one], costs[other]
        # Of ranks, because infinities have no differences.
        ranks = rankdata(np.concatenate([a, b]))
        result = mannwhitneyu(ranks[: len(a)], ranks[len(a) :], alternative="two-sided", method="auto")
        least = min(1.0, len(pairs) * 2.0 / comb(len(ranks), len(a)))
        note = f"Too few runs: p, corrected, cannot be below {least:.2g}." if least > ALPHA else ""
        statistic, p, size = float(result.statistic), float(result.pvalue), a12(a, b)
        found.append(PairTest(one, other, statistic, p, p, size, effect(size), note))
    return [replace(pair, p_holm=float(p)) for pair, p in zip(found, holm([pair.p for pair in found]), strict=True)]


def overall(samples: Mapping[str, Sequence[float] | np.ndarray], *, larger: bool = False) -> Overall:
    """The Kruskal-Wallis test of whether any of several solvers differs, with average ranks among all runs together.

    p is the chi-squared approximation, which is rough for fewer than about five runs of a solver. Of samples that are all alike, p is 1.
    """
    from scipy.stats import kruskal, rankdata

    costs = {name: _costs(values, larger) for name, values in samples.items()}
    names, columns = list(costs), list(costs.values())
    ends = np.cumsum([len(column) for column in columns])[:-1]
    ranks = np.split(rankdata(np.concatenate(columns)), ends)
    statistic, p = (0.0, 1.0) if np.ptp(np.concatenate(ranks)) == 0 else kruskal(*ranks)
    return Overall(float(statistic), float(p), {name: float(np.mean(column)) for name, column in zip(names, ranks, strict=True)})


def a12(a: Sequence[float] | np.ndarray, b: Sequence[float] | np.ndarray, *, larger: bool = False) -> float:
    """Probability that a value of `a` is better than one of `b`, a tie being half (Vargha and Delaney 2000)."""
    first, second = _costs(a, larger)[:, None], _costs(b, larger)
    better, worse = int((first < second).sum()), int((first > second).sum())
    return 0.5 + 0.5 * (better - worse) / (len(first) * len(second))


def effect(a12: float) -> str:
    """The usual word for an effect of this size, in either direction, with the thresholds of Vargha and Delaney 2000."""
    # As far from one half, whatever the side; rounding must not take the name from a value on the border.
    size = max(a12, 1.0 - a12) + 1e-12
    return next((word for least, word in ((0.71, "large"), (0.64, "medium"), (0.56, "small")) if size >= least), "negligible")


def holm(p: Sequence[float] | np.ndarray) -> np.ndarray:
    """p-values (k,) corrected for being k, by Holm's step-down method (1979), in the order given."""
    p = np.asarray(p, dtype=float)
    order = np.argsort(p, kind="stable")
    corrected = np.empty(len(p))
    corrected[order] = np.minimum(1.0, np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1)))
    return corrected


def _costs(values: Sequence[float] | np.ndarray, larger: bool) -> np.ndarray:
    """Values (n,) of which smaller is better; infinite for failed runs."""
    values = np.asarray(values, dtype=float)
    return np.where(np.isfinite(values), -values if larger else values, np.inf)


def _quantile(costs: np.ndarray, share: float) -> float:
    """Linear between the sorted values; infinite as soon as a failed run has a share in it. (numpy's would make NaN of two infinities.)"""
    ordered = np.sort(costs)
    at = share * (len(ordered) - 1)
    low = int(at)
    part = at - low
    if part == 0:
        return float(ordered[low])
    return float(ordered[low] + part * (ordered[low + 1] - ordered[low])) if np.isfinite(ordered[low + 1]) else np.inf
