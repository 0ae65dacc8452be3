"""A flight to start from: a sensible law of the angles, and where it leads."""

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


def guess(phase: Phase, rates: Mapping[str, ca.MX], start: Mapping[str, float], final_time: float, controls: Sequence[str]) -> None:
    """Make the nominal flight, and the law that it follows, the guess of a phase.

    Parameters
    ----------
    phase : Phase
    rates : {state: expression}
        Of the states of the phase, and no other than these and the controls.
    start : {state: value}
        At least of these.
    final_time : float
        s, from 0.
    controls : two names
        Of the controls that command the angle of attack and the bank angle.
    """
    times = np.linspace(0.0, final_time, STEPS + 1)
    laws = {name: np.interp(times, np.linspace(0.0, final_time, len(law)), law) for name, law in zip(controls, (ATTACK, BANK), strict=True)}
    states = _propagated(phase, rates, [start[name] for name in rates], laws, times)
    for name, values in zip(rates, states, strict=True):
        # With other data it may lead anywhere: then it is a poor guess, but one.
        lower, upper = phase._states[name].lower, phase._states[name].upper
        phase.guess(**{name: (times, np.clip(np.where(np.isfinite(values), values, lower), lower, upper))})
    for name, law in laws.items():
        phase.guess(**{name: (times, law)})


def _propagated(
    phase: Phase, rates: Mapping[str, ca.MX], start: Sequence[float], laws: Mapping[str, np.ndarray], times: np.ndarray
) -> np.ndarray:
    """States (nx, n) at equidistant times (n,), by the classical Runge-Kutta method."""
    groups = {"x": [phase[name] for name in rates], "u": [phase[name] for name in laws]}
    rate = vector_function("rate", groups, list(rates.values()))
    h, x = float(times[1] - times[0]), ca.MX.sym("x", len(rates))
    left, right = ca.MX.sym("left", len(laws)), ca.MX.sym("right", len(laws))
    k1 = rate(x, left)
    k2 = rate(x + 0.5 * h * k1, 0.5 * (left + right))
    k3 = rate(x + 0.5 * h * k2, 0.5 * (left + right))
    k4 = rate(x + h * k3, right)
    step = ca.Function("step", [x, left, right], [x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])
    law = np.array(list(laws.values()))
    flight = np.array(step.mapaccum(len(times) - 1)(start, law[:, :-1], law[:, 1:]))
    return np.column_stack([start, flight])
