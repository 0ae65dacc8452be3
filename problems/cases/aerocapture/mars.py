"""Mars with an exponential atmosphere, the hyperbola on which a capsule arrives and the ellipse on which it leaves the air.

Armellin and Lavagna, "Multidisciplinary Optimization of Aerocapture Maneuvers", Journal of Artificial Evolution and Applications 2008.
The paper prints the interface, the target orbit and the speeds. The gravitational parameter is that of Mars (Konopliv et al., "Mars high
resolution gravity fields from MRO, Mars seasonal gravity, and other dynamical parameters", Icarus 211, 2011: 4.28284e13, here to five
digits). Radius, scale height and density are not printed: they are fitted to numbers of the paper, so that agreement with its tables tests
the model, not these three values.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Mars:
    """The planet, its air and the two circles that count.

    Attributes
    ----------
    mu : float
        Gravitational parameter, m3/s2.
    radius : float
        Mean radius, m. Fitted: with it an exit at 3500 m/s has the printed path angle and delta v, 1.73 deg and 52.6 m/s, and the circular
        speed at the target is the printed 3453.7 m/s.
    interface, target : float
        Altitudes at which the air begins and of the circular orbit that is wanted, m.
    scale_height : float
        Height in which the density falls by a factor e, m. Fitted to altitudes, entry angles and heat shields of Tables 1 and 2.
    density : float
        Of the air at the interface, kg/m3. Fitted likewise.
    """

    mu: float = 4.2828e13
    radius: float = 3390.7e3
    interface: float = 100e3
    target: float = 200e3
    scale_height: float = 8.92e3
    density: float = 3.17e-7

    @property
    def entry_radius(self) -> float:
        """Radius at which the air begins, m."""
        return self.radius + self.interface

    @property
    def target_radius(self) -> float:
        """Radius of the circular orbit that is wanted, m."""
        return self.radius + self.target


MARS = Mars()
ARRIVAL_SPEED, EXIT_SPEED = 5000.0, 3500.0
"""Excess speed of the arrival, and speed at which the air is left in the paper's coupled optimisation, m/s."""


def entry_speed(arrival_speed: float, mars: Mars = MARS) -> float:
    """Speed at the interface of a hyperbola with an excess speed, m/s: eq. (12)."""
    return float(np.sqrt(arrival_speed**2 + 2.0 * mars.mu / mars.entry_radius))


def exit_speeds(mars: Mars = MARS) -> tuple[float, float]:
    """Least and greatest speed at the interface of an ellipse whose apoapsis is on the target orbit, m/s: vertical and level exits."""
    ratio = mars.entry_radius / mars.target_radius
    vertical = 2.0 * mars.mu * (1.0 / mars.entry_radius - 1.0 / mars.target_radius)
    return float(np.sqrt(vertical)), float(np.sqrt(vertical / (1.0 - ratio**2)))


def exit_angle(speed: float, mars: Mars = MARS) -> float:
    """Path angle at the interface, rad, that brings the apoapsis to the target orbit: eqs. (13)-(16).

    Raises
    ------
    ValueError
        No angle does, for the speed is outside `exit_speeds`.
    """
    least, greatest = exit_speeds(mars)
    if not least <= speed <= greatest:
        raise ValueError(f"an exit at {speed:g} m/s cannot reach the target orbit tangentially; {least:.1f} to {greatest:.1f} m/s can")
    above = max(speed**2 - 2.0 * mars.mu * (1.0 / mars.entry_radius - 1.0 / mars.target_radius), 0.0)
    return float(np.arccos(min(mars.target_radius * np.sqrt(above) / (speed * mars.entry_radius), 1.0)))


def circularisation(speed: Any, mars: Mars = MARS) -> Any:
    """Delta v, m/s, of the burn at the target orbit after an exit at a speed whose apoapsis is there: eq. (27). Numbers, arrays, CasADi."""
    energy = speed**2 - 2.0 * mars.mu * (1.0 / mars.entry_radius - 1.0 / mars.target_radius)
    return (mars.mu / mars.target_radius) ** 0.5 - energy**0.5


def exit_speed(delta_v: float, mars: Mars = MARS) -> float:
    """Speed at the interface, m/s, after which the burn at the target orbit takes a delta v, m/s: `circularisation` solved for it.

    Raises
    ------
    ValueError
        No exit to the target orbit has this delta v.
    """
    vertical, level = exit_speeds(mars)
    least, most = float(circularisation(level, mars)), float(np.sqrt(mars.mu / mars.target_radius))
    if not least <= delta_v <= most:
        raise ValueError(f"no exit to the target orbit has a delta v of {delta_v:g} m/s; {least:.1f} to {most:.1f} m/s are possible")
    return float(np.hypot(most - delta_v, vertical))


def capture_by_burn(arrival_speed: float = ARRIVAL_SPEED, mars: Mars = MARS) -> float:
    """Delta v, m/s, of a burn at the periapsis of the hyperbola, on the target orbit, that ends on it: what aerocapture spares.

    Eq. (23) with 2 mu / r_a in its first root: with the printed mu / r_a the propellant is not the printed 0.594 of the mass.
    """
    circular = mars.mu / mars.target_radius
    return float(np.sqrt(2.0 * circular + arrival_speed**2) - np.sqrt(circular))


def propellant_fraction(delta_v: float, impulse: float = 400.0, gravity: float = 9.81) -> float:
    """Propellant over initial mass for a delta v in m/s and a specific impulse in s: eq. (24)."""
    return float(-np.expm1(-delta_v / (impulse * gravity)))
