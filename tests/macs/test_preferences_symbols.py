"""Each stage gives the same for numbers and as a function of CasADi symbols, whose derivatives are finite."""

from __future__ import annotations

import pickle
import warnings
from functools import reduce

import casadi as ca
import numpy as np
import pytest
from choices import plain_front

from macs.decisions import (
    Around,
    FuzzyGoal,
    FuzzyPhysicalProgramming,
    FuzzySatisfactory,
    GoalProgramming,
    Larger,
    Nimbus,
    PhysicalProgramming,
    Range,
    Ranges,
    ReferencePoint,
    Smaller,
    Value,
    WeightedSum,
)
from problems.compiled import Objective

GOALS = [Objective("time", "s"), Objective("effort", "m²/s³"), Objective("speed", "m/s", "maximize")]
RNG = np.random.default_rng(0)
T = RNG.uniform(1.2, 4.0, 20)
FRONT = plain_front(np.column_stack([T, 12 / T**3, RNG.uniform(10, 20, 20)]), GOALS)
RANGES = Ranges({"time": 1.2, "effort": 0.1875, "speed": 20.0}, {"time": 4.0, "effort": 12 / 1.2**3, "speed": 10.0})
CLASSES = {
    "time": Smaller(1.0, 1.5, 2.5, 3.0, 4.5),
    "effort": Range(-1, -0.5, 0.0, 0.1, 0.2, 0.5, 1.0, 2.0, 4.0, 8.0),
    "speed": Larger(25, 15, 13, 12, 9),
}
PREFERENCES = [
    WeightedSum({"time": 1.0, "speed": 2.0}),
    GoalProgramming({"time": 2.0, "speed": 15.0}, weights={"time": 3.0}),
    GoalProgramming({"time": 2.0, "speed": Around(15.0), "effort": 1.0}, priorities=["speed", ("time", "effort")]),
    FuzzyGoal({"time": 2.0, "speed": 15.0, "effort": Around(1.0, (0.5, 6.0))}),
    FuzzyGoal({"time": 2.0, "speed": 15.0, "effort": Around(1.0)}, tolerances={"speed": 6.0}, aggregate="sum"),
    FuzzySatisfactory({}, ["time", "speed", "effort"]),
    FuzzySatisfactory({"time": 2.0, "speed": Around(15.0)}, [("time", "speed"), "effort"], ordered=True),
    ReferencePoint({"time": 2.0, "speed": 15.0}, {"time": 3.0}),
    Nimbus({"time": 2.0, "effort": 1.5, "speed": 15.0}, improve=["time"], to={"speed": 18.0}, until={"effort": 5.0}),
    Nimbus({"time": 2.0, "effort": 1.5, "speed": 15.0}, improve=["time"], keep=["speed"], free=["effort"]),
    PhysicalProgramming(CLASSES),
    PhysicalProgramming({"speed": Value(8, 10, 12, 14, 15, 16, 17, 19, 22)}),
    FuzzyPhysicalProgramming(CLASSES, spread=0.3),
    FuzzyPhysicalProgramming(CLASSES, spread=0.3, printed=True),
]


CASES = [(kind, one) for one in PREFERENCES for kind in ((ca.SX,) if isinstance(one, FuzzyPhysicalProgramming) else (ca.SX, ca.MX))]
"""Quadrature has hundreds of operations, which as matrices take seconds."""


@pytest.mark.parametrize(("kind", "preference"), CASES, ids=lambda one: getattr(one, "__name__", type(one).__name__))
def test_numbers_and_symbols_agree(preference, kind):
    symbols = [kind.sym(goal.name) for goal in GOALS]
    J = FRONT.objectives
    for stage in preference.stages(GOALS, RANGES):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            groups, limits = stage.groups(symbols), stage.limits(symbols)
            peaks = [reduce(ca.fmax, group) for group in groups]
            value = stage.value(symbols, peaks)
            numbers = stage.numbers(J)
        assert len(stage.limit_names) == len(limits)
        gradient = ca.gradient(value, ca.vertcat(*symbols)) if kind is ca.SX else ca.vertcat(*(ca.jacobian(value, one) for one in symbols))
        function = ca.Function("stage", symbols, [value, ca.vertcat(0, *limits), gradient])
        for row, number in zip(J, numbers, strict=True):
            found, excess, slopes = (np.array(one).ravel() for one in function(*row))
            assert np.isfinite(slopes).all()
            if excess.max() > 1e-6:
                assert number == np.inf
            else:
                assert number == pytest.approx(found[0], rel=1e-12, abs=1e-13)


SLOW = [pytest.param(one, marks=[pytest.mark.slow] * isinstance(one, FuzzyPhysicalProgramming)) for one in PREFERENCES]


@pytest.mark.parametrize("preference", SLOW, ids=lambda one: type(one).__name__)
def test_values_rise_with_their_peaks_and_gradients_agree_with_differences(preference):
    """What gradient solves rely on: a variable that is not less than any of a group may stand for its peak."""
    symbols = [ca.SX.sym(goal.name) for goal in GOALS]
    for stage in preference.stages(GOALS, RANGES):
        peaks = [ca.SX.sym(f"peak{k}") for k in range(len(stage.groups(symbols)))]
        value = stage.value(symbols, peaks)
        function = ca.Function("value", [ca.vertcat(*symbols), ca.vertcat(*peaks)], [value])
        slopes = ca.Function("slopes", [ca.vertcat(*symbols), ca.vertcat(*peaks)], [ca.gradient(value, ca.vertcat(*symbols, *peaks))])
        printed = getattr(preference, "printed", False)
        for row in FRONT.objectives[:5]:
            at = np.linspace(-0.3, 0.7, len(peaks))
            found = np.array(slopes(row, at)).ravel()
            assert np.all(found[len(GOALS) :] >= 0)
            for k in range(0 if printed else len(GOALS)):
                step = 1e-5 * np.eye(len(GOALS))[k]
                difference = float(function(row + step, at) - function(row - step, at)) / 2e-5
                assert found[k] == pytest.approx(difference, rel=1e-4, abs=1e-7)


@pytest.mark.parametrize("preference", PREFERENCES, ids=lambda one: type(one).__name__)
def test_preferences_go_to_other_processes(preference):
    stages = preference.stages(GOALS, RANGES)
    other = pickle.loads(pickle.dumps(preference))
    assert other == preference
    for one, two in zip(stages, other.stages(GOALS, RANGES), strict=True):
        assert np.array_equal(one.numbers(FRONT.objectives), two.numbers(FRONT.objectives))
