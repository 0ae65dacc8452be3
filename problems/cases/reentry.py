"""The re-entry of a shuttle: three cases with four objectives, and two with the greatest cross-range alone.

Four objectives: Chai, Savvaris, Tsourdos, Xia and Chai, "Solving multiobjective constrained trajectory optimization problem by an extended
evolutionary algorithm", IEEE Transactions on Cybernetics 50(4), 2020, eqs. (5)-(11). Where it leaves something open, it is chosen here: the
angles at the beginning, the gains of the lag equations, the bounds of the states (no flight of interest leaves them). The final latitude is
called longitude once, which is a slip; the heat load is in kBtu/ft2, the only unit in which it has the values of the paper's tables; and
the integral of the rate of the flight-path angle, which would be a mere difference between its ends, is that of its absolute value.

The absolute value and the peak are exact in the search; gradient tools bound them from above, which is the same where they are minimised.

The shuttle, with figures in feet, slugs and Btu (all that is computed is SI but for the heating rate): Betts, "Practical Methods for
Optimal Control and Estimation Using Nonlinear Programming", SIAM 2010, section 6.1; eqs. (5) and (9) of the paper, in which the sign of
the density's exponent is a slip. His are the cases with one objective, whose optima are known to six digits: angle of attack and bank angle
are the controls, the final time is free.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import degrees, pi, radians
from pathlib import Path
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from .. import checks
from ..compiled import vector_function
from ..phase import Phase
from ..problem import Problem
from .flight_figures import RED, pictures, trajectories
from .winged import FOOT, GRAVITIES, POUND, SLUG, STATES, UNITS, Winged

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["betts", "betts_heating", "plot", "reentry_case1", "reentry_case2", "reentry_case3"]

MASS = 6309.43 * SLUG
PRESSURE = POUND / FOOT**2
"""One lbf/ft2 in Pa."""
SHUTTLE = Winged(
    radius=20902900.0 * FOOT,
    mu=0.14076539e17 * FOOT**3,
    density=0.002378 * SLUG / FOOT**3,
    scale_height=23800.0 * FOOT,
    area=2690.0 * FOOT**2,
    lift=(-0.20704, 1.67556),
    drag=(0.07854, -0.352896, 2.039962),
    heating=(1.0672181, -0.019213774, 2.1286289e-4, -1.0117249e-6),
    # To Btu/ft2/s.
    heating_constant=17700.0 * 1e-4**3.07 * (FOOT**3 / SLUG) ** 0.5 / FOOT**3.07,
)
ATTACK = np.radians([17.4, 17.4])
"""rad, at equal steps of time: the glide of the greatest range."""
BANK = np.radians([-75.0, -45.0, -2.0])
"""rad, likewise: sharply to the left at first, where there is speed to lose, then less and less."""

START = {
    "altitude": 260000 * FOOT,
    "longitude": 0.0,
    "latitude": 0.0,
    "speed": 25600 * FOOT,
    "flight-path angle": radians(-1.0),
    "heading": radians(90.0),
    "angle of attack": radians(17.4),
    "bank angle": radians(-75.0),
}
END = {"altitude": 80000 * FOOT, "speed": 2500 * FOOT, "flight-path angle": radians(-5.0)}
BOUNDS = {
    "altitude": (20e3, 120e3),
    "longitude": (-pi, pi),
    "latitude": (-0.48 * pi, 0.48 * pi),
    "speed": (300.0, 8500.0),
    "flight-path angle": (radians(-80.0), radians(80.0)),
    "heading": (-pi, pi),
    "angle of attack": (0.0, radians(40.0)),
    "bank angle": (radians(-90.0), radians(1.0)),
}
SCALES = {state: abs(value) for state, value in END.items()}
"""What counts as one: for all that is limited its limit, so that a violation of 0.01 is 1 % of it."""
ANGLES = ("angle of attack", "bank angle")


@dataclass(frozen=True)
class Limits:
    """The most that a flight may take: heating rate, Btu/ft2/s; dynamic pressure, lbf/ft2; load, in weights."""

    heating_rate: float
    dynamic_pressure: float
    load_factor: float


LIMIT_UNITS = {"heating_rate": "Btu/ft2/s", "dynamic_pressure": "lbf/ft2", "load_factor": "g"}


@dataclass(frozen=True)
class Zone:
    """A circle on the map, all in degrees, over which no flight may go."""

    longitude: float
    latitude: float
    radius: float


WIDE = Limits(heating_rate=200.0, dynamic_pressure=280.0, load_factor=2.5)
NARROW = Limits(heating_rate=150.0, dynamic_pressure=250.0, load_factor=1.25)
ZONES = (Zone(30.0, 7.5, 5.0), Zone(60.0, 15.0, 5.0), Zone(70.0, 20.0, 5.0))
OPTIMA = {"betts": (34.1412, 2008.59), "betts_heating": (30.6255, 2198.67)}
"""Cross-range, deg, and final time, s, of the optima of Betts."""
ALONG = (*STATES, *ANGLES, *(f"{angle} command" for angle in ANGLES))
SHOWN_UNITS = {
    "altitude": ("km", 1e-3),
    "speed": ("km/s", 1e-3),
    "heating rate": ("Btu/ft2/s", 1.0),
    "dynamic pressure": ("lbf/ft2", 1.0),
    "load factor": ("g", 1.0),
}


def reentry(
    name: str,
    limits: Limits,
    zones: Sequence[Zone] = (),
    *,
    mass: float = MASS,
    gravity: str = "newtonian",
    lag_gain: float = 0.1,
    final_time: float = 2000.0,
    altitude_tolerance: float = 3000 * FOOT,
    speed_tolerance: float = 350 * FOOT,
    angle_tolerance: float = radians(1.0),
) -> Problem:
    """State a case, of one phase, "entry". Raises ValueError for data that make no sense, by their names.

    Parameters
    ----------
    mass : float
        kg; 92079 by default.
    gravity : "newtonian" or "constant"
    lag_gain : float
        Of the lag equations of both angles, 1/s: they follow their commands within some 1 / lag_gain seconds.
    final_time : float
        s.
    altitude_tolerance, speed_tolerance, angle_tolerance : float
        How far altitude, m, speed, m/s, and flight-path angle, rad, at the end may be from 80000 ft, 2500 ft/s and -5 degrees.
    """
    if gravity not in GRAVITIES:
        raise ValueError(f"{name}: gravity must be {' or '.join(map(repr, GRAVITIES))}, not {gravity!r}")
    mass, lag_gain, final_time = (
        checks.positive(value, f"{name}: {word}") for word, value in (("mass", mass), ("lag_gain", lag_gain), ("final_time", final_time))
    )
    given = {"altitude": altitude_tolerance, "speed": speed_tolerance, "flight-path angle": angle_tolerance}
    problem = Problem(name)
    phase = problem.phase("entry", t0=0.0, tf=final_time)
    for state, tolerance in given.items():
        what = f"{name}: the tolerance of the final {state}"
        if checks.number(tolerance, what) < 0:
            raise ValueError(f"{what} must not be negative, not {tolerance:g}")
        checks.within((END[state] - tolerance, END[state] + tolerance), BOUNDS[state], f"{name}: the final {state} with its tolerance")
    states = declare(phase, START, {state: END[state] for state, tolerance in given.items() if tolerance == 0})
    for angle in ANGLES:
        phase.control(f"{angle} command", bounds=BOUNDS[angle], unit="rad")
    rates = SHUTTLE.rates(states, states["angle of attack"], states["bank angle"], mass, model=gravity)
    turning = rates["flight-path angle"]
    rates |= {angle: lag_gain * (phase[f"{angle} command"] - phase[angle]) for angle in ANGLES}
    phase.dynamics(**rates)

    altitude, speed, attack = phase["altitude"], phase["speed"], phase["angle of attack"]
    heating = SHUTTLE.heating_rate(altitude, speed, attack)
    load = SHUTTLE.load_factor(altitude, speed, attack, mass, gravity)
    limited = heating, SHUTTLE.dynamic_pressure(altitude, speed) / PRESSURE, load
    for (word, limit), value in zip(vars(limits).items(), limited, strict=True):
        phase.path(word.replace("_", " "), value, upper=limit, unit=LIMIT_UNITS[word], scale=limit)
    for number, zone in enumerate(zones, 1):
        east, north = (degrees(1.0) * phase[word] - getattr(zone, word) for word in ("longitude", "latitude"))
        phase.path(f"distance from zone {number}", ca.sqrt(east**2 + north**2), lower=zone.radius, unit="deg", scale=zone.radius)

    for state, tolerance in given.items():
        if tolerance > 0:
            # Eq. (10): rows of their own, as what counts as one at the end is what is left open there.
            error = phase.final(states[state]) - END[state]
            unit = UNITS.get(state, "rad")
            problem.constraint(f"final {state}", error, lower=-tolerance, upper=tolerance, unit=unit, scale=tolerance)

    problem.maximize("cross-range", degrees(1.0) * phase.final(phase["latitude"]), unit="deg")
    problem.minimize("heat load", 1e-3 * phase.integral(heating), unit="kBtu/ft2")
    problem.minimize("oscillation", phase.integral(ca.fabs(turning)), unit="rad")
    problem.minimize("peak heating rate", phase.peak(heating), unit="Btu/ft2/s")

    guess(phase, START, final_time, {f"{angle} command": law for angle, law in zip(ANGLES, (ATTACK, BANK), strict=True)})
    # Commands within bounds everywhere. On fewer or simpler elements simulations confirm hardly a point: the angles follow a jump of their
    # commands within some ten seconds, what is allowed at the end is a hundredth of the altitude's span, and peaks and absolute values are
    # sampled. It takes seconds to make a candidate feasible: they are only propagated, and the best are left to the gradients.
    problem.default_transcription = "dfet:64x4:bernstein:1"
    problem.default_evaluations = 700
    problem.default_inner, problem.default_start = "propagate", "smooth"
    return problem


def declare(phase: Phase, start: Mapping[str, float], end: Mapping[str, Any]) -> dict[str, ca.MX]:
    """States of a flight, from `start`, which names them all, to what is given of the `end`; returns their symbols."""
    return {
        name: phase.state(
            name, bounds=BOUNDS[name], initial=value, final=end.get(name), unit=UNITS.get(name, "rad"), scale=SCALES.get(name)
        )
        for name, value in start.items()
    }


def guess(
    phase: Phase, start: Mapping[str, float], until: float, laws: Mapping[str, Sequence[float] | np.ndarray], begin: float = 0.0
) -> dict[str, float]:
    """Make a nominal flight, and the laws that it follows, the guess of a phase with dynamics; the states at its end by name.

    It begins at `start`, at least of the states of the phase; `laws` are values of all controls at equal steps of time, linear between.
    """
    times = np.linspace(begin, until, 401)
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


def known(case: str) -> np.ndarray:
    """The front (k, 4) of a case, as the user sees it: cross-range, heat load, oscillation, peak heating rate.

    The further columns of the table are the commands that were simulated, from which each row can be checked.
    """
    return np.loadtxt(Path(__file__).with_name(f"{case}.csv"), delimiter=",", usecols=range(4), ndmin=2)


reentry_case1_reference, reentry_case2_reference, reentry_case3_reference = (partial(known, f"reentry_case{i}") for i in (1, 2, 3))
reentry_case1_reference_name = reentry_case2_reference_name = reentry_case3_reference_name = "the front that gradients found"
"""Name of the reference in reports: every row is a local solve within narrower limits, so that there may be better flights."""


def reentry_case1(**data: Any) -> Problem:
    """Within wide limits; for `data` see `reentry`."""
    return reentry("reentry_case1", WIDE, **data)


def reentry_case2(**data: Any) -> Problem:
    """Within narrow limits; for `data` see `reentry`."""
    return reentry("reentry_case2", NARROW, **data)


def reentry_case3(**data: Any) -> Problem:
    """Within wide limits, around three no-fly zones; for `data` see `reentry`.

    Every feasible flight passes south of all three, as far as gradients can tell: for one that passes north of the first, this zone would
    have to lie 6.3 degrees farther south; of the second, south of the first, 1.5 degrees; of the third, south of both others, 8.0 degrees.
    """
    return reentry("reentry_case3", WIDE, ZONES, **data)


def betts() -> Problem:
    """The greatest cross-range, whatever the heat."""
    return _greatest_cross_range("betts")


def betts_heating() -> Problem:
    """The greatest cross-range with a heating rate of at most 70 Btu/ft2/s."""
    return _greatest_cross_range("betts_heating", 70.0)


betts_reference, betts_heating_reference = (partial(np.full, (1, 1), cross_range) for cross_range, _ in OPTIMA.values())


def _greatest_cross_range(name: str, heating_rate: float | None = None) -> Problem:
    """State it, with a limit to the heating rate, Btu/ft2/s, or none."""
    problem = Problem(name)
    phase = problem.phase("entry", t0=0.0, tf=(500.0, 4000.0))
    states = declare(phase, {state: START[state] for state in STATES}, END)
    attack, bank = (
        phase.control(angle, bounds=bounds, unit="rad")
        for angle, bounds in zip(ANGLES, ((-radians(90.0), radians(90.0)), (-radians(89.0), radians(1.0))), strict=True)
    )
    phase.dynamics(**SHUTTLE.rates(states, attack, bank, MASS))
    if heating_rate is not None:
        heating = SHUTTLE.heating_rate(states["altitude"], states["speed"], attack)
        phase.path("heating rate", heating, upper=heating_rate, unit="Btu/ft2/s", scale=heating_rate)
    problem.maximize("cross-range", degrees(1.0) * phase.final(states["latitude"]), unit="deg")
    guess(phase, START, 2000.0, dict(zip(ANGLES, (ATTACK, BANK), strict=True)))
    phase.guess(tf=2000.0)
    problem.default_transcription = "dfet:20x3"
    problem.default_evaluations = 1_000
    return problem


def plot(flights: Sequence[Any], zones: Sequence[Zone] = ()) -> dict[str, Figure]:
    """States, angles and what the air does over time, and the ground track; the flights coloured by their cross-range."""
    phases = [[trajectory["entry"]] for trajectory in trajectories(flights)]
    reached = np.array([degrees(flight[0]["latitude"][-1]) for flight in phases])
    # The cases of Betts have no commands.
    along = [name for name in ALONG if name in phases[0][0].names]
    figures = pictures(phases, reached, "cross-range [deg]", along, SHOWN_UNITS)
    around = np.linspace(0.0, 2 * np.pi, 181)
    for zone in zones:
        east, north = zone.longitude + zone.radius * np.cos(around), zone.latitude + zone.radius * np.sin(around)
        figures["ground-track"].axes[0].fill(east, north, facecolor="#f3c9b3", edgecolor=RED, lw=0.9, zorder=1)
    return figures


reentry_case3_plot = partial(plot, zones=ZONES)
