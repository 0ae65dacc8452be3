"""A flight to start from: a sensible law of the controls, and where it leads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from ...compiled import vector_function
from ...phase import Phase

ATTACK = np.radians([17.4, 17.4])
"""rad, at equal steps of time: the glide of the greatest range."""
BANK = np.radians([-75.0, -45.0, -2.0])
"""rad, likewise: sharply to the left at first, where there is speed to lose, then less and less."""
STEPS = 400


def guess(
    phase: Phase, start: Mapping[str, float], until: float, laws: Mapping[str, Sequence[float] | np.ndarray], begin: float = 0.0
) -> dict[str, float]:
    """Make a nominal flight, and the laws that it follows, the guess of a phase, whose dynamics are given.

    Parameters
    ----------
    phase : Phase
    start : {state: value}
        At least of those of the phase.
    until, begin : float
        Times at which the flight ends and begins, s.
    laws : {control: values}
        Of all controls, at equal steps of time, linear between.

    Returns
    -------
    dict
        The states at the end, as they stand in the guess.
    """
    times = np.linspace(begin, until, STEPS + 1)
    controls = {name: np.interp(times, np.linspace(begin, until, len(law)), law) for name, law in laws.items()}
    states = _propagated(phase, [start[name] for name in phase._rates], controls, times)
    end = {}
    for name, values in zip(phase._rates, states, strict=True):
        # With other data it may lead anywhere: then it is a poor guess, but one.
        lower, upper = phase._states[name].lower, phase._states[name].upper
        inside = np.clip(np.where(np.isfinite(values), values, lower), lower, upper)
        phase.guess(**{name: (times, inside)})
        end[name] = float(inside[-1])
    for name, law in controls.items():
        phase.guess(**{name: (times, law)})
    return end


def _propagated(phase: Phase, start: Sequence[float], laws: Mapping[str, np.ndarray], times: np.ndarray) -> np.ndarray:
    """States (nx, n) at equidistant times (n,), by the classical Runge-Kutta method."""
    groups = {"x": [phase[name] for name in phase._rates], "u": [phase[name] for name in laws]}
    rate = vector_function("rate", groups, list(phase._rates.values()))
    h, x = float(times[1] - times[0]), ca.MX.sym("x", len(phase._rates))
    left, right = ca.MX.sym("left", len(laws)), ca.MX.sym("right", len(laws))
    k1 = rate(x, left)
    k2 = rate(x + 0.5 * h * k1, 0.5 * (left + right))
    k3 = rate(x + 0.5 * h * k2, 0.5 * (left + right))
    k4 = rate(x + h * k3, right)
    step = ca.Function("step", [x, left, right], [x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])
    law = np.array(list(laws.values()))
    flight = np.array(step.mapaccum(len(times) - 1)(start, law[:, :-1], law[:, 1:]))
    return np.column_stack([start, flight])
