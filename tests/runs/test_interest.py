"""How much of a region of interest a front covers, against closed forms."""

import numpy as np
import pytest
from choices import plain_front

from macs.preferences import PhysicalProgramming, ReferencePoint, Smaller
from macs.search.guide import REGION_PART
from problems.compiled import Objective
from runs.bench.prefer import Interest

GOALS = [Objective("a"), Objective("b")]
EVENLY = ReferencePoint({"a": 0.0, "b": 0.0}, augmentation=0.0)


def line(n: int = 10_001) -> np.ndarray:
    """The front a + b = 1, on which the value of `EVENLY` goes from 1/2 in the middle to 1 at the ends."""
    a = np.linspace(0.0, 1.0, n)
    return np.stack([a, 1.0 - a], axis=1)


def test_the_region_and_what_is_missing_there():
    interest = Interest.of(EVENLY, GOALS, line())
    half = 0.5 * REGION_PART  # of the values' spread of 1/2, on either side of the middle
    assert interest.points[:, 0].min() == pytest.approx(0.5 - half, abs=1e-4)
    assert interest.points[:, 0].max() == pytest.approx(0.5 + half, abs=1e-4)
    assert interest.part == pytest.approx(REGION_PART, rel=1e-2)
    # n points, evenly within a straight front, leave a triangle before, between and after each: the part 1 / (n + 1) of the area below it.
    for n in (1, 4):
        a = 0.5 - half + 2 * half * np.arange(1, n + 1) / (n + 1)
        front = plain_front(np.stack([a, 1.0 - a], axis=1), GOALS)
        assert interest.missing(front) == pytest.approx(1.0 / (n + 1), rel=1e-2)
        assert interest.inside(front) == n
    assert interest.worse(front) == pytest.approx(half / 5 / 0.5, rel=1e-3)
    assert interest.missing(plain_front(line(), GOALS)) == pytest.approx(0.0, abs=1e-12)


def test_points_outside_the_region_cover_nothing_of_it():
    interest = Interest.of(EVENLY, GOALS, line())
    ends = plain_front(np.array([[0.0, 1.0], [0.4, 0.6], [0.6, 0.4], [1.0, 0.0]]), GOALS)
    assert interest.missing(ends) == pytest.approx(1.0) and interest.inside(ends) == 0
    nothing = ends[:0]
    assert interest.missing(nothing) == pytest.approx(1.0) and interest.worse(nothing) == np.inf


def test_beyond_hard_limits_nothing_is_of_interest():
    wanted = PhysicalProgramming({"a": Smaller(0.1, 0.2, 0.3, 0.4, 0.5), "b": Smaller(0.5, 0.6, 0.7, 0.8, 0.9)})
    interest = Interest.of(wanted, GOALS, line())
    assert interest.points[:, 0].min() >= 0.1 and interest.points[:, 0].max() <= 0.5
    never = PhysicalProgramming({"a": Smaller(0.1, 0.15, 0.2, 0.25, 0.3), "b": Smaller(0.1, 0.15, 0.2, 0.25, 0.3)})
    middle = Interest.of(never, GOALS, line())
    assert np.abs(middle.points - 0.5).max() < 0.05, "where no limits are met, what exceeds them least"


def test_a_region_with_two_points_of_the_dense_front_is_refused():
    few = line(4)
    with pytest.raises(ValueError, match="only 2 points of the dense front"):
        Interest.of(EVENLY, GOALS, few)
