"""The cases of the re-entry: three with four objectives, see `statement`, and two with the greatest cross-range alone.

The latter are of Betts, "Practical Methods for Optimal Control and Estimation Using Nonlinear Programming", SIAM 2010, section 6.1, whose
optima are known to six digits: angle of attack and bank angle are the controls, the final time is free.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from math import degrees, radians
from typing import TYPE_CHECKING, Any

import numpy as np

from ...problem import Problem
from ..flight_figures import RED, ColouredFlights, track, trajectories
from ..winged import STATES
from .statement import ANGLES, ATTACK, BANK, END, MASS, SHUTTLE, START, Limits, Zone, declare, guess, known, reentry

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["betts", "betts_heating", "case1", "case2", "case3", "plot", "track"]

WIDE = Limits(heating_rate=200.0, dynamic_pressure=280.0, load_factor=2.5)
NARROW = Limits(heating_rate=150.0, dynamic_pressure=250.0, load_factor=1.25)
ZONES = (Zone(30.0, 7.5, 5.0), Zone(60.0, 15.0, 5.0), Zone(70.0, 20.0, 5.0))
case1_reference, case2_reference, case3_reference = (partial(known, case) for case in ("case1", "case2", "case3"))
case1_reference_name = case2_reference_name = case3_reference_name = "the front that gradients found"
"""Name of the reference in reports: every row is a local solve within narrower limits, so that there may be better flights."""
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


def case1(**data: Any) -> Problem:
    """Within wide limits; for `data` see `statement.reentry`."""
    return reentry("reentry_case1", WIDE, **data)


def case2(**data: Any) -> Problem:
    """Within narrow limits; for `data` see `statement.reentry`."""
    return reentry("reentry_case2", NARROW, **data)


def case3(**data: Any) -> Problem:
    """Within wide limits, around three no-fly zones; for `data` see `statement.reentry`.

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


def betts_reference() -> np.ndarray:
    """The optimal cross-range in degrees, shape (1, 1)."""
    return np.array([[OPTIMA["betts"][0]]])


def betts_heating_reference() -> np.ndarray:
    """The same below the heating rate."""
    return np.array([[OPTIMA["betts_heating"][0]]])


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
    flown = ColouredFlights(phases, np.array([degrees(flight[0]["latitude"][-1]) for flight in phases]), "cross-range [deg]")
    figure, ax = flown.on_the_map()
    around = np.linspace(0.0, 2 * np.pi, 181)
    for zone in zones:
        east, north = zone.longitude + zone.radius * np.cos(around), zone.latitude + zone.radius * np.sin(around)
        ax.fill(east, north, facecolor="#f3c9b3", edgecolor=RED, lw=0.9, zorder=1)
    # The cases of Betts have no commands.
    along = [name for name in ALONG if name in phases[0][0].names]
    return {"population": flown.over_time(along, SHOWN_UNITS), "ground-track": figure}


case3_plot = partial(plot, zones=ZONES)
