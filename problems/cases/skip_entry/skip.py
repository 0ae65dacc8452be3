"""A skip to 51.88 km and back: terminal mass against terminal speed.

Bae, Shin, Savvaris and Tsourdos, "Multi-objective skip trajectory optimization for hypersonic reentry vehicles", Cranfield University. What
the paper leaves open is chosen here: the specific impulse, 319 s, is such that the printed 86502 kg and 4970 m/s lie on the front (a
calibration); the constant of the heating rate is that of Betts (`reentry.vehicle`), which the paper's limit of 200 Btu/ft2/s goes with; the
speed, "free" in the table of bounds, is at most the initial one, as the printed 7803 m/s says (12 km/s are possible otherwise); and the
flight is level at its lowest point. Thrust follows without lag.
"""

from __future__ import annotations

from ...problem import Problem
from ..reentry.vehicle import SHUTTLE
from ..winged import FOOT, Winged
from .statement import ASCENT, START, Mission, skip_entry

BTU = 1054.350264488889
"""One thermochemical Btu in J."""
HEATING = 2269.7864
"""kW/m2: 200 Btu/ft2/s."""
LOWEST, IMPULSE = 51880.0, 319.0
VEHICLE = Winged(
    radius=6371203.92,
    mu=3.9856e14,
    density=1.2256,
    scale_height=7254.24,
    area=249.91,
    lift=(-0.2070, 1.676),
    drag=(0.07854, -0.3529, 2.040),
    heating=SHUTTLE.heating,
    heating_constant=SHUTTLE.heating_constant * BTU / FOOT**2 * 1e-3,
)


def problem(
    *,
    impulse: float = IMPULSE,
    thrust_lag: float | None = None,
    lowest: float = LOWEST,
    fastest: float = START["speed"],
    mass: float = START["mass"],
) -> Problem:
    """The case.

    Parameters
    ----------
    impulse : float
        Specific impulse, s.
    thrust_lag : float, optional
        Gain of a first-order lag of the thrust, 1/s; None: it follows at once.
    lowest : float
        Altitude at which the descent ends, m.
    fastest : float
        Bound of the speed, m/s.
    mass : float
        At the beginning, kg.
    """
    lags = {} if thrust_lag is None else {"thrust": thrust_lag}
    problem, _ = skip_entry("skip", Mission(VEHICLE, lowest, HEATING, impulse, lags, fastest, mass))
    ascent = problem.phases[ASCENT]
    problem.maximize("terminal mass", ascent.final(ascent["mass"]), unit="kg")
    problem.maximize("terminal speed", ascent.final(ascent["speed"]), unit="m/s")
    return problem
