"""The bank profile of a given capsule: from the hyperbola to a polar orbit, with the least burn at the apoapsis.

Armellin and Lavagna (see `mars`), section 5: the motion over a round planet, eq. (5) with drag that slows down; the capsule and its angle of
attack are given; bank and plane of the entry are free. Eq. (26) is read as the arc cosine of the angular momentum's component over its size,
and with the size of the eccentricity vector, not its square.

The paper does not print the direction of the arrival, the limit of the bank rate, nor whether Mars turns. Chosen here: a declination of -20
deg, 10 deg/s, and no turning. The capsule then enters over the north, past the pole, and flies south.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, exp, inf, pi, radians, sin

import casadi as ca
import numpy as np

from ... import checks
from ...phase import Phase
from ...problem import Problem
from ..winged import STATES, UNITS, Winged
from .aerodynamics import MASS, ballistic_coefficient, lift_and_drag
from .designs import judged, shapes_of
from .heating import allowed_load, heating_rate, shield_fraction
from .mars import EXIT_SPEED, MARS, circularisation
from .passage import PASSAGE, profile
from .printed import TABLE_2

DECLINATION, BANK_RATE = -20.0, 10.0
"""Of the arrival's velocity, deg; greatest rate of the bank angle, deg/s."""
ENTRY_SPEED = PASSAGE.entry_speed
DURATION = (150.0, 2000.0)
BOUNDS = {
    "altitude": (15e3, MARS.interface),
    "longitude": (-1.5, 1.5),
    "latitude": (radians(-80.0), radians(85.0)),
    "speed": (2500.0, 7200.0),
    "flight-path angle": (-0.5, 0.3),
    "heading": (0.5 * pi, 1.5 * pi),
}
BANK = (-2.0 * pi, 2.0 * pi)


def problem(
    *,
    shape: int | Sequence[float] = 2,
    shield: float | None = None,
    trade: bool = False,
    declination: float = DECLINATION,
    bank_rate: float = BANK_RATE,
) -> Problem:
    """The case.

    Parameters
    ----------
    shape : int or five numbers
        Number of a solution of Table 2, or the five variables of `designs.BOUNDS`.
    shield : float, optional
        Largest heat shield, % of the mass; that of the passage at constant bank by default. Without limit if `trade`.
    trade : bool
        Whether the heat shield is a second objective.
    declination : float
        Of the velocity with which the capsule arrives from far away, deg.
    bank_rate : float
        Greatest rate of the bank angle, deg/s.

    Raises
    ------
    ValueError
        For a shape that is no capsule or cannot be captured, and data that make no sense.
    """
    design = _design(shape)
    checks.positive(bank_rate, "aerocapture_bank: the bank rate")
    checks.within((declination, declination), (-60.0, 60.0), "aerocapture_bank: the declination")
    planar = judged(design)
    limit = float(planar.shield[0]) if shield is None else checks.positive(shield, "aerocapture_bank: the heat shield")
    shapes, attack = shapes_of(design)
    lift, drag = (float(c[0]) for c in lift_and_drag(shapes, attack))
    vehicle = Winged(
        radius=MARS.radius,
        mu=MARS.mu,
        density=MARS.density * exp(MARS.interface / MARS.scale_height),
        scale_height=MARS.scale_height,
        area=float(shapes.area[0]),
        lift=(lift,),
        drag=(drag,),
        heating=(1.0,),
        heating_constant=0.0,
    )
    problem = Problem("aerocapture bank")
    phase = problem.phase("atmosphere", t0=0.0, tf=DURATION)
    initial = {"altitude": MARS.interface, "speed": ENTRY_SPEED, "flight-path angle": (-0.4, -0.05)}
    final = {"altitude": MARS.interface, "flight-path angle": (0.0, 0.1), "heading": pi}
    states = {
        name: phase.state(name, bounds=BOUNDS[name], initial=initial.get(name), final=final.get(name), unit=UNITS.get(name, "rad"))
        for name in STATES
    }
    bank = phase.state("bank angle", bounds=BANK, unit="rad")
    rate = phase.control("bank rate", bounds=(-radians(bank_rate), radians(bank_rate)), unit="rad/s")
    phase.dynamics(**vehicle.rates(states, 0.0, bank, MASS), **{"bank angle": rate})
    for name, expression in _arrival(phase, states, declination).items():
        problem.constraint(name, expression, lower=0.0, upper=0.0)
    ends = {name: phase.final(symbol) for name, symbol in states.items()}
    problem.constraint("apoapsis", _apoapsis(ends) / 1e3, lower=MARS.target / 1e3, upper=MARS.target / 1e3, scale=100.0)
    load = phase.integral(heating_rate(vehicle.air(states["altitude"]), states["speed"], float(shapes.nose[0])))
    problem.minimize("delta v", circularisation(ends["speed"]), unit="m/s")
    if trade:
        problem.minimize("TPS mass fraction", shield_fraction(load), unit="%")
    if shield is not None or not trade:
        most = float(allowed_load(limit))
        problem.constraint("heat load", load / 1e3, upper=most / 1e3, scale=most / 1e3)
    _guess(phase, float(ballistic_coefficient(shapes, np.array([drag]))[0]), float(planar.bank[0]), lift / drag, declination)
    return problem


def _design(shape: int | Sequence[float]) -> np.ndarray:
    """The five variables (1, 5) of a capsule that can be captured."""
    if isinstance(shape, int | np.integer):
        if int(shape) not in TABLE_2:
            raise ValueError(f"aerocapture_bank: there is no solution {shape} of Table 2; there are {', '.join(map(str, TABLE_2))}")
        shape = TABLE_2[int(shape)].design
    values = [checks.number(value, "aerocapture_bank: a variable of the shape") for value in shape]
    if len(values) != 5:
        raise ValueError(f"aerocapture_bank: a shape has five variables, not {len(values)}")
    design = np.array([values])
    reason = judged(design).reason[0]
    if reason:
        raise ValueError(f"aerocapture_bank: the shape {shape}: {reason}")
    return design


def _arrival(phase: Phase, states: dict[str, ca.MX], declination: float) -> dict[str, ca.MX]:
    """What must vanish so that the hyperbola comes from the right direction: components of its asymptote across that, by name.

    The velocity far away is along e / |e|^2 + sqrt(1 - 1 / |e|^2) q, with the eccentricity vector e towards the periapsis, and q a right
    angle ahead of it: Battin, "An Introduction to the Mathematics and Methods of Astrodynamics", AIAA 1999, section 4.4.
    """
    h, lon, lat, v, path, heading = (phase.initial(states[name]) for name in STATES)
    up = ca.vertcat(ca.cos(lat) * ca.cos(lon), ca.cos(lat) * ca.sin(lon), ca.sin(lat))
    east = ca.vertcat(-ca.sin(lon), ca.cos(lon), 0.0)
    north = ca.vertcat(-ca.sin(lat) * ca.cos(lon), -ca.sin(lat) * ca.sin(lon), ca.cos(lat))
    velocity = v * (ca.sin(path) * up + ca.cos(path) * (ca.sin(heading) * east + ca.cos(heading) * north))
    position = (MARS.radius + h) * up
    momentum = ca.cross(position, velocity)
    e = ca.cross(velocity, momentum) / MARS.mu - up
    size = ca.sumsqr(e)
    ahead = ca.cross(momentum, e) / ca.sqrt(ca.sumsqr(momentum) * size)
    asymptote = e / size + ca.sqrt(1.0 - 1.0 / size) * ahead
    return {
        "arrival sideways": asymptote[1],
        "arrival upward": asymptote[2] * cos(radians(declination)) - asymptote[0] * sin(radians(declination)),
    }


def _apoapsis(ends: dict[str, ca.MX]) -> ca.MX:
    """Altitude of the apoapsis of the orbit after the exit, m: eq. (26)."""
    r, v = MARS.radius + ends["altitude"], ends["speed"]
    excess = r * v**2 / MARS.mu
    eccentricity = ca.sqrt((excess - 1.0) ** 2 * ca.cos(ends["flight-path angle"]) ** 2 + ca.sin(ends["flight-path angle"]) ** 2)
    return r / (2.0 - excess) * (1.0 + eccentricity) - MARS.radius


def _guess(phase: Phase, ballistic: float, bank: float, ratio: float, declination: float) -> None:
    """The passage at constant bank. Its heading turns with the speed that is lost, dpsi/dx = L/D sin(bank) / 2, so that it ends polar."""
    planar = profile(ballistic)
    time, lost = planar.time, 2.0 * np.log(planar.speed / EXIT_SPEED)
    heading = pi - 0.5 * ratio * sin(bank) * lost
    # From the asymptote to the periapsis, of which the entry is a little before, by the angle whose cosine is -1 / e.
    gamma, r = planar.path_angle[0], MARS.entry_radius
    excess = r * ENTRY_SPEED**2 / MARS.mu
    eccentricity = np.hypot((excess - 1.0) * np.cos(gamma), excess * np.sin(gamma) * np.cos(gamma))
    eccentricity = np.sqrt((excess - 1.0) ** 2 * np.cos(gamma) ** 2 + np.sin(gamma) ** 2)
    anomaly = np.arctan2(excess * np.cos(gamma) * np.sin(gamma), excess * np.cos(gamma) ** 2 - 1.0)
    flown = np.arccos(-1.0 / eccentricity) + anomaly
    latitude = pi - (-radians(declination) + flown) - planar.ground
    ahead = np.concatenate([[0.0], np.cumsum(0.5 * (np.sin(heading[1:]) + np.sin(heading[:-1])) * np.diff(planar.ground))])
    phase.guess(
        tf=float(time[-1]),
        altitude=(time, np.clip(planar.altitude, *BOUNDS["altitude"])),
        longitude=(time, ahead - ahead[-1]),
        latitude=(time, latitude),
        speed=(time, planar.speed),
        heading=(time, np.clip(heading, *BOUNDS["heading"])),
        **{"flight-path angle": (time, planar.path_angle), "bank angle": bank, "bank rate": 0.0},
    )
