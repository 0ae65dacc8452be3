"""Stages: operands, values, hard limits and what is said of them, the order of points; and a preference of the user's own."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from choices import cart, plain_front

from macs.decisions import Preference, Stage
from macs.preferences.preference import keeps_limits, within_limits
from macs.preferences.stage import LIMIT_TOL, check_limits, conflict_message, exceeded, ordering
from problems.compiled import Objective

GOALS = (Objective("time", "s"), Objective("mass", "kg", "maximize"), Objective("risk"))
FREE = Stage("first", lambda J, peaks: J[0])
LIMITED = Stage(
    "limited",
    lambda J, peaks: J[0] + 10.0 * peaks[0] + 100.0 * peaks[1],
    lambda J: [[J[0], J[1]], [0.0, J[2]]],
    lambda J: [J[0] / 2.0 - 1.0, (5.0 - J[1]) / 10.0, J[0] - J[2]],
    ("time at most 2 s", "mass at least 5 kg", "time at most the risk"),
)


def rows(*J: tuple[float, ...]) -> np.ndarray:
    return np.array(J, dtype=float)


def test_peaks_are_the_largest_of_their_groups() -> None:
    assert LIMITED.numbers(rows((1.0, 7.0, 3.0), (2.0, 5.0, 2.0))) == pytest.approx([1.0 + 70.0 + 300.0, 2.0 + 50.0 + 200.0])
    assert Stage("same", lambda J, peaks: 3.0).numbers(rows((1.0,), (2.0,))).tolist() == [3.0, 3.0], "a number for all points"
    largest = Stage("peak", lambda J, peaks: peaks[0], lambda J: [[0.0, J[0], 1.0]])
    assert largest.numbers(rows((0.5,), (2.0,), (-1.0,))).tolist() == [1, 2, 1]


def test_what_exceeds_a_limit_has_no_value() -> None:
    J = rows((2.0, 5.0, 2.0), (2.0 + 1.9 * LIMIT_TOL, 5.0, 3.0), (2.0 + 2.1 * LIMIT_TOL, 5.0, 3.0), (2.0, 4.0, 2.0), (2.0, 5.0, 1.5))
    assert np.isfinite(LIMITED.numbers(J)).tolist() == [True, True, False, False, False]
    assert LIMITED.excess(J) == pytest.approx([0.0, 0.95 * LIMIT_TOL, 1.05 * LIMIT_TOL, 0.1, 0.5])
    assert LIMITED.excesses(rows((1.0, 7.0, 3.0))) == pytest.approx(rows((-0.5, -0.2, -2.0)))
    assert LIMITED.excess(rows((1.0, 7.0, 3.0))).tolist() == [0.0], "met by more is met"
    assert Stage("one", lambda J, peaks: J[0], limits=lambda J: [0.5]).excess(rows((1.0,), (2.0,))).tolist() == [0.5, 0.5]
    J = rows((1.0, 2.0), (np.nan, 2.0), (1.0, np.inf), (-np.inf, 0.0))
    assert FREE.excess(J).tolist() == [0.0, 0.0, 0.0, 0.0] and FREE.excesses(J).shape == (4, 0)
    assert FREE.numbers(J).tolist() == [1.0, np.inf, np.inf, np.inf]
    limited = Stage("limited", lambda J, peaks: J[0], limits=lambda J: [J[0] - 5.0])
    assert limited.excesses(J).tolist() == [[-4.0], [np.inf], [np.inf], [np.inf]]


@pytest.mark.filterwarnings("error")
def test_values_that_are_no_numbers_do_not_warn() -> None:
    root = Stage("root", lambda J, peaks: np.sqrt(J[0]), lambda J: [[np.log(J[0])]], lambda J: [1.0 / J[0] - 3.0])
    assert root.numbers(rows((0.0,), (4.0,))).tolist() == [np.inf, 2.0]


def test_what_is_missed_is_said_in_the_unit_of_its_objective() -> None:
    assert exceeded(LIMITED, GOALS, np.array([3.0, 1.0, 1.0])) == (
        "'time at most 2 s' is missed by 1 s, 'mass at least 5 kg' is missed by 4 kg, 'time at most the risk' is missed by 2"
    )
    assert exceeded(LIMITED, GOALS, np.array([1.0, 4.5, 1e3])) == "'mass at least 5 kg' is missed by 0.5 kg"
    assert exceeded(LIMITED, GOALS, np.array([1e3, 5.0, 1e3])) == "'time at most 2 s' is missed by 998 s"
    assert exceeded(LIMITED, GOALS, np.array([1e7, 5.0, 1e7])) == "'time at most 2 s' is missed by 1e+07 s"
    unnamed = Stage("cheap", lambda J, peaks: J[0], limits=lambda J: [J[0] - 1.0, 3.0 * (2.0 - J[1])])
    assert exceeded(unnamed, GOALS, np.array([0.0, 1.0, 0.0])) == "'limit 2 of cheap' is missed by 1 kg"
    assert exceeded(LIMITED, GOALS, np.array([0.0, 5.0, 0.0])) == "", "what is met is not missed"
    assert exceeded(LIMITED, GOALS, np.array([2.0 + LIMIT_TOL, 5.0, 3.0])) == ""
    assert exceeded(LIMITED, GOALS, np.array([np.nan, 5.0, np.inf])) == "'time', 'risk' is no number"
    with pytest.raises(ValueError, match="zip"):
        exceeded(LIMITED, GOALS[:2], np.array([1.0, 5.0, 1.0]))


def ordered(stages: Any, J: np.ndarray, **more: Any) -> list[int]:
    return ordering(stages, J, more.pop("kind", np.zeros(len(J))), **more)[0].tolist()


def test_the_kind_comes_first_then_the_limits_and_then_the_values() -> None:
    limited = Stage("limited", lambda J, peaks: J[0], limits=lambda J: [J[1] - 1.0])
    J = rows((4.0, 0.0), (3.0, 1.0), (0.0, 2.0), (0.0, 1.5), (0.0, 0.0))
    order, values = ordering([limited], J, np.array([0, 0, 0, 0, 1]))
    assert order.tolist() == [1, 0, 3, 2, 4] and values[:, 0].tolist() == [4.0, 3.0, np.inf, np.inf, 0.0]
    # Rounding is no excess, so that it does not order.
    assert ordered([limited], rows((2.0, 1.0), (1.0, 1.0 + 0.9 * LIMIT_TOL))) == [1, 0]
    limited = Stage("limited", lambda J, peaks: J[0], limits=lambda J: [J[1]])
    assert ordered([limited, FREE], rows((1.0, np.nan), (0.0, np.inf), (2.0, 0.0), (0.0, 0.5), (1.0, 0.5))) == [2, 3, 4, 0, 1]
    with pytest.raises(ValueError, match="hard limits are those of the first stage, which all stages keep: state those of 'limited' there"):
        check_limits([FREE, LIMITED])
    check_limits([LIMITED, FREE])


def test_later_stages_and_ties_tell_apart_what_is_as_good_as_the_best() -> None:
    second, third = (Stage(name, lambda J, peaks, k=k: J[k]) for k, name in ((1, "second"), (2, "third")))
    J = rows((1.0, 2.0, 0.0), (1.0 + 1e-10, 1.0, 5.0), (2.0, 0.0, 0.0), (1.0, 1.0 + 1e-10, 4.0))
    assert ordered([FREE, second, third], J) == [3, 1, 0, 2]
    assert ordered([FREE, second, third], J, same=1e-12) == [3, 0, 1, 2]
    # By parts of their size where this is above 1, and as they are below it.
    assert ordered([FREE, second], rows((100.0, 1.0, 0.0), (100.5, 0.0, 0.0)), same=1e-2) == [1, 0]
    assert ordered([FREE, second], rows((100.0, 1.0, 0.0), (101.5, 0.0, 0.0)), same=1e-2) == [0, 1]
    assert ordered([FREE, second], rows((0.0, 1.0, 0.0), (0.009, 0.0, 0.0)), same=1e-2) == [1, 0]
    assert ordered([FREE, second], rows((0.0, 1.0, 0.0), (0.011, 0.0, 0.0)), same=1e-2) == [0, 1]
    assert ordered([FREE, second], rows((-100.0, 1.0, 0.0), (-99.5, 0.0, 0.0)), same=1e-2) == [1, 0]
    missing = Stage("missing", lambda J, peaks: J[0])
    rest = Stage("rest", lambda J, peaks: J[1], after_zero=True)
    order, values = ordering([missing, rest], rows((0.0, 3.0), (1e-10, 2.0), (1.0, 0.0), (1.0, -1.0)), np.zeros(4))
    assert values[:, 1].tolist() == pytest.approx([3.0, 2.0, np.nan, np.nan], nan_ok=True) and order.tolist() == [1, 0, 2, 3]
    J = rows((1.0,), (1.0,), (0.0,), (1.0,))
    assert ordered([FREE], J) == [2, 0, 1, 3]
    assert ordered([FREE], J, tie=np.array([2.0, 1.0, 9.0, 0.0])) == [2, 3, 1, 0]
    # The last stage tells all differences: there is no slack in it.
    assert ordered([FREE], rows((1.0,), (1.0 - 1e-12,)), tie=np.array([0.0, 1.0]), same=1.0) == [1, 0]
    assert ordered([FREE], rows((1.0,))) == [0] and ordered([FREE], np.zeros((0, 1))) == []


@dataclass(frozen=True)
class Quick(Preference):
    """The least effort within a time, which is a limit without a name."""

    time: float

    @property
    def names(self) -> tuple[str, ...]:
        return "time", "effort"

    def stages(self, goals: Sequence[Objective], ranges: object) -> tuple[Stage, ...]:
        return (Stage("effort", lambda J, peaks: J[1], limits=lambda J: [J[0] - self.time]),)

    def degrees(self, goals: Sequence[Objective], ranges: object, objectives: np.ndarray) -> np.ndarray:
        return np.full(objectives.shape, np.nan)


def test_the_best_is_the_least_effort_within_the_time() -> None:
    """The efforts of times from 1.2 to 4 are 12 / T^3."""
    ranking = Quick(2.6).rank(cart(3))
    assert ranking.best.objectives["time"] == pytest.approx(2.6) and ranking.message == ""
    assert ranking.values[ranking.order].tolist() == pytest.approx([12 / 2.6**3, 12 / 1.2**3, np.inf])
    ranking = Quick(1.0).rank(cart(3))
    assert ranking.message == "No point meets all hard limits; none has limit 1 of effort."
    assert ranking.best.objectives["time"] == pytest.approx(1.2)


# Hard limits: what is within them, and what is said where no point is


TIME, MASS = Objective("time", "s"), Objective("mass")


def limited(*bounds: tuple[int, float, str]) -> Stage:
    """A stage with the value of the first objective, and upper limits of some."""
    names = tuple(words for _, _, words in bounds)
    return Stage("cheap", lambda J, peaks: J[0], limits=lambda J: [J[i] - most for i, most, _ in bounds], limit_names=names)


def at(*objectives: float, **columns: Any) -> Any:
    """A point with these objectives."""
    return plain_front(np.array([objectives]), [TIME, MASS], **columns)[0]


@pytest.mark.parametrize(("share", "within"), [(-1.0, True), (0.0, True), (1.0, True), (1.1, False), (1e6, False)])
def test_rounding_does_not_count_as_beyond_a_limit(share: float, within: bool) -> None:
    """What is met has a value, what is not has none: both are told by the same slack, exactly."""
    stage, point = limited((0, 0.0, "time at most 0")), at(share * LIMIT_TOL, 1.0)
    assert within_limits(stage, point) is within and keeps_limits(stage, point, 1e-3) is within
    assert np.isfinite(stage.numbers(np.array([[*point.objectives.values()]]))[0]) == within


def test_what_was_simulated_keeps_a_limit_as_far_as_simulations_may_miss_it() -> None:
    """A point of a time of 2 that flies 3.05: half a tenth beyond the limit of 3."""
    stage = limited((0, 3.0, "time at most 3"))
    flown = {"defect": [0.5], "simulated_violation": [0.0], "simulated_F": [[3.05, 1.0]], "verified": [False]}
    point = at(2.0, 1.0, **flown)
    assert point.verified is False and within_limits(stage, point)
    assert keeps_limits(stage, point, 0.1) and not keeps_limits(stage, point, 0.01)


def test_only_limits_in_conflict_are_named_and_what_the_nearest_misses() -> None:
    """Limits are in conflict that are exceeded at least half as much as the one that is exceeded most."""
    stage = limited((0, 3.0, "time at most 3 s"), (1, 5.0, "mass at most 5"), (1, 5.5, "mass at most 5.5"))
    assert conflict_message(stage, (TIME, MASS), np.array([4.0, 7.0])) == (
        "no point was found that meets all of: time at most 3 s, mass at most 5, mass at most 5.5; the nearest has time 4 s, mass 7:"
        " 'time at most 3 s' is missed by 1 s, 'mass at most 5' is missed by 2, 'mass at most 5.5' is missed by 1.5"
    )
    words = conflict_message(stage, (TIME, MASS), np.array([3.99, 7.0]))
    assert "meets all of: mass at most 5, mass at most 5.5;" in words and "'time at most 3 s' is missed by 0.99 s" in words
    # A single one is named alone.
    for J, name in (((9.0, 0.0), "short"), ((0.0, 9.0), "light")):
        words = conflict_message(limited((0, 3.0, "short"), (1, 5.0, "light")), (TIME, MASS), np.array(J))
        assert words.startswith(f"no point was found that meets {name}; the nearest has time {J[0]:g} s, mass {J[1]:g}: '{name}' is missed")
