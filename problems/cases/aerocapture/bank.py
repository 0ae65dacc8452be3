"""The bank profile of a given capsule, from the hyperbola to a polar orbit: the burn at the apoapsis against the heat shield.

Armellin and Lavagna (see `mars`), section 5: the motion over a round planet, eq. (5) with drag that slows down; the capsule and its angle
of attack are given; bank and plane of the entry are free. Eq. (26) is read as the arc cosine of the angular momentum's component over its
size, and with the size of the eccentricity vector, not its square.

The paper does not print the direction of the arrival, the limit of the bank rate, nor whether Mars turns. Chosen here: a declination of -20
deg, 10 deg/s, and no turning. The capsule then enters over the north, past the pole, and flies south.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from math import exp, pi, radians, sin
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from ... import checks
from ...problem import Problem
from ..flight_figures import pictures, trajectories
from ..winged import STATES, UNITS, Winged
from .capsule import MASS, lift_and_drag
from .designs import TABLE_2, JudgedCapsules, assess, shapes_of
from .dispersions import Capsule, DispersedOutcome, Dispersions, outcomes
from .mars import EXIT_SPEED, MARS, allowed_load, apoapsis, arrival, circularisation, heating_rate, shield_fraction, since_arrival
from .passage import PASSAGE, profile

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Dispersions", "dispersed", "plot", "problem"]

SHAPE, OWN = 2, "passage"
DECLINATION, BANK_RATE = -20.0, 10.0
"""Of the arrival's velocity, deg; greatest rate of the bank angle, deg/s."""
DECLINATIONS = (-60.0, -5.0)
"""For these the flight does not pass over a pole, where the longitude is not defined. The planet is round: optima do not depend on it."""
ENTRY_SPEED = PASSAGE.entry_speed
STEEPEST = 0.05
"""Greatest path angle at the exit, rad: it ends the trade with the heat shield at a delta v of 100 m/s."""
DURATION = (150.0, 2000.0)
BOUNDS = {
    "altitude": (15e3, MARS.interface),
    "longitude": (-1.5, 1.5),
    "latitude": (radians(-80.0), radians(85.0)),
    "speed": (2500.0, 7200.0),
    "flight-path angle": (-0.5, 0.3),
    "heading": (0.5 * pi, 1.5 * pi),
}
BANK = (0.0, pi)
"""To one side: altitude, speed and path angle depend on the cosine alone, and the plane of the entry makes up for what turns the heading.
Nothing is lost but local optima that roll over to the other side where there is little air."""
EDGES = [*np.linspace(0.0, 0.03, 4), *np.linspace(0.03, 0.28, 37)[1:], *np.linspace(0.28, 1.0, 9)[1:]]
PHASE = "atmosphere"
MESH = {"edges": EDGES, "order": 4, "control_order": 1}
"""Short elements where the air is dense: on 30 equal ones of order 3, an optimum that looks as good misses the apoapsis by 48 km."""
TRANSCRIPTION = {
    "method": "DFET",
    "settings": {"elements": len(EDGES) - 1, "order": 4, "control_order": 1, "basis": "bernstein", "mesh": {PHASE: MESH}},
}


def problem(
    *,
    shape: int | Sequence[float] = SHAPE,
    shield: float | str = OWN,
    declination: float = DECLINATION,
    bank_rate: float = BANK_RATE,
) -> Problem:
    """The case. Raises ValueError for a shape that is no capsule or cannot be captured, and data that make no sense.

    Parameters
    ----------
    shape : int or five numbers
        Number of a solution of Table 2, or the five variables of `designs.BOUNDS`.
    shield : float or "passage"
        Largest heat shield, % of the mass; "passage": that of the same capsule's passage at constant bank, as in the paper.
    declination : float
        Of the velocity with which the capsule arrives from far away, deg.
    bank_rate : float
        Greatest rate of the bank angle, deg/s.
    """
    design = _design(shape)
    planar = assess(design)
    limit = float(planar.shield[0]) if shield == OWN else checks.positive(shield, "aerocapture_bank: the heat shield")
    lift, drag, nose = _capsule(design)
    most = 1e-3 * float(allowed_load(limit))
    problem = Problem("aerocapture_bank")
    ends, load = flight(problem, lift, drag, nose, most=2.0 * most, declination=declination, bank_rate=bank_rate)
    problem.constraint("heat shield", load, upper=most, unit="kJ/cm2", scale=most)
    problem.minimize("delta v", circularisation(ends["speed"]), unit="m/s")
    problem.minimize("TPS mass fraction", shield_fraction(1e3 * load), unit="%")
    guess(problem, planar, nose, most, declination)
    problem.default_transcription = TRANSCRIPTION
    problem.default_evaluations, problem.default_inner, problem.default_start = 1_000, "propagate", "smooth"
    return problem


def flight(
    problem: Problem,
    lift: Any,
    drag: Any,
    nose: Any,
    *,
    most: float,
    declination: float,
    bank_rate: float,
    steepest: float = STEEPEST,
) -> tuple[dict[str, ca.MX], ca.MX]:
    """Add the phase from the hyperbola to the polar orbit to a problem: its states at the end by name, and the heat load, kJ/cm2.

    `lift` and `drag` are coefficients times the area, m2, `nose` its radius, m; `most` is the greatest heat load, kJ/cm2; `steepest` the
    greatest path angle at the exit, rad; the others are as in `problem`.
    """
    checks.positive(bank_rate, f"{problem.name}: the bank rate")
    direction = checks.number(declination, f"{problem.name}: the declination")
    checks.within((direction, direction), DECLINATIONS, f"{problem.name}: the declination")
    phase = problem.phase(PHASE, t0=0.0, tf=DURATION)
    initial = {"altitude": MARS.interface, "speed": ENTRY_SPEED, "flight-path angle": (-0.4, -0.05)}
    final = {"altitude": MARS.interface, "flight-path angle": (0.0, steepest), "heading": pi}
    states = {
        name: phase.state(name, bounds=BOUNDS[name], initial=initial.get(name), final=final.get(name), unit=UNITS.get(name, "rad"))
        for name in STATES
    }
    bank = phase.state("bank angle", bounds=BANK, unit="rad")
    rate = phase.control("bank rate", bounds=(-radians(bank_rate), radians(bank_rate)), unit="rad/s")
    # A state, as in the paper: a power of an integral would have second derivatives by all variables at once.
    heat = phase.state("heat load", bounds=(0.0, most), initial=0.0, unit="kJ/cm2")
    vehicle = Winged(
        radius=MARS.radius,
        mu=MARS.mu,
        density=MARS.density * exp(MARS.interface / MARS.scale_height),
        scale_height=MARS.scale_height,
        area=1.0,
        # Coefficients do not change with the angle of attack, for that is trimmed.
        lift=(lift,),
        drag=(drag,),
        # Heating is that of `heating`.
        heating=(0.0,),
        heating_constant=0.0,
    )
    heating = heating_rate(vehicle.air(states["altitude"]), states["speed"], nose)
    phase.dynamics(**vehicle.rates(states, 0.0, bank, MASS), **{"bank angle": rate, "heat load": 1e-3 * heating})
    begins, ends = ({name: of(symbol) for name, symbol in states.items()} for of in (phase.initial, phase.final))
    for name, expression in arrival(begins, declination).items():
        problem.constraint(name, expression, lower=0.0, upper=0.0)
    target = MARS.target / 1e3
    problem.constraint("apoapsis", apoapsis(ends) / 1e3, lower=target, upper=target, unit="km", scale=100.0)
    return ends, phase.final(heat)


def dispersed(front: Any, dispersions: Dispersions) -> list[dict[str, DispersedOutcome]]:
    """What becomes of each point of a front under dispersions, with its bank profile over time, whose last value stays, and with a constant
    bank solved anew for each case."""
    design = _design(front.source.data.get("shape", SHAPE))
    found, nose = assess(design), float(shapes_of(design)[0].nose[0])
    ballistic, ratio = float(found.ballistic[0]), float(found.lift_to_drag[0])
    flights = [next(iter(point.trajectory.values())) for point in front]
    entries = [float(flight.at(flight.t0)["flight-path angle"]) for flight in flights]
    capsules = [
        Capsule(ballistic, ratio, nose, entry, partial(_bank, flight), curved=True) for flight, entry in zip(flights, entries, strict=True)
    ]
    return outcomes(capsules, dispersions)


def _bank(flight: Any, times: np.ndarray) -> np.ndarray:
    """The bank angle of a flight at times (k,)."""
    return np.asarray(flight.at(np.clip(times, flight.t0, flight.tf))["bank angle"])


def _design(shape: int | Sequence[float]) -> np.ndarray:
    """The five variables (1, 5) of a capsule that can be captured."""
    if isinstance(shape, int | np.integer):
        if int(shape) not in TABLE_2:
            raise ValueError(f"aerocapture_bank: there is no solution {shape} of Table 2; there are {', '.join(map(str, TABLE_2))}")
        shape = TABLE_2[int(shape)].design
    if not isinstance(shape, Sequence | np.ndarray):
        raise ValueError(f"aerocapture_bank: a shape is the number of a solution of Table 2 or five variables, not {shape!r}")
    values = [checks.number(value, "aerocapture_bank: a variable of the shape") for value in shape]
    if len(values) != 5:
        raise ValueError(f"aerocapture_bank: a shape has five variables, not {len(values)}")
    design = np.array([values])
    reason = assess(design).reason[0]
    if reason:
        raise ValueError(f"aerocapture_bank: the shape {shape}: {reason}")
    return design


def _capsule(design: np.ndarray) -> tuple[float, float, float]:
    """Coefficients of lift and drag times the area, m2, and nose radius, m."""
    shapes, attack = shapes_of(design)
    lift, drag = lift_and_drag(shapes, attack)
    area = float(shapes.area[0])
    return area * float(lift[0]), area * float(drag[0]), float(shapes.nose[0])


def guess(problem: Problem, design: JudgedCapsules, nose: float, most: float, declination: float) -> None:
    """Set the guess of the phase of `flight`: the passage at constant bank of the first of `design`.

    Its heading turns with the speed that is lost, dpsi/dx = L/D sin(bank) / 2, so that it ends polar.
    """
    bank, ratio = float(design.bank[0]), float(design.lift_to_drag[0])
    planar = profile(float(design.ballistic[0]))
    time, lost = planar.time, 2.0 * np.log(planar.speed / EXIT_SPEED)
    heading = pi - 0.5 * ratio * sin(bank) * lost
    flown = since_arrival(MARS.entry_radius, ENTRY_SPEED, float(planar.path_angle[0])) + planar.ground
    latitude = pi + radians(declination) - flown
    ahead = np.concatenate([[0.0], np.cumsum(0.5 * (np.sin(heading[1:]) + np.sin(heading[:-1])) * np.diff(planar.ground))])
    problem.phases[PHASE].guess(
        tf=float(time[-1]),
        altitude=(time, np.clip(planar.altitude, *BOUNDS["altitude"])),
        longitude=(time, ahead - ahead[-1]),
        latitude=(time, latitude),
        speed=(time, planar.speed),
        heading=(time, np.clip(heading, *BOUNDS["heading"])),
        **{"flight-path angle": (time, planar.path_angle), "bank angle": bank, "bank rate": 0.0},
        **{"heat load": (time, np.clip(1e-3 * planar.heat / nose**0.5, 0.0, most))},
    )


ALONG = (*STATES, "bank angle", "bank rate", "heat load")
SHOWN_UNITS = {
    "altitude": ("km", 1e-3),
    "speed": ("km/s", 1e-3),
    "heat load": ("kJ/cm2", 1.0),
    "bank rate": ("deg/s", float(np.degrees(1.0))),
}


def plot(flights: Sequence[Any]) -> dict[str, Figure]:
    """Both figures by name, states and bank over time, as figures 14 to 17 of the paper, and the ground track, coloured by delta v."""
    phases = [list(trajectory.values()) for trajectory in trajectories(flights)]
    speeds = np.array([float(flight[-1].at(flight[-1].tf)["speed"]) for flight in phases])
    return pictures(phases, circularisation(speeds), "delta v [m/s]", ALONG, SHOWN_UNITS)
