"""Convective heating at the stagnation point, and the heat shield that a heat load asks for. Numbers, arrays and CasADi expressions alike.

Armellin and Lavagna (see `mars`), eqs. (3) and (4), after Tauber and Bowles, "The use of atmospheric braking during Mars missions", AIAA
89-1730, and Laub and Venkatapathy, "Thermal protection system technology and facility needs for demanding future planetary missions", 2003.

Two readings. Eq. (3) prints 0.0091, which gives a fraction ten times smaller than all tables: here 0.091, in per cent for J/cm2. The wall
enthalpy is not printed: a constant, fitted to the heat shields of Tables 1 and 2.
"""

from __future__ import annotations

from typing import Any

CONSTANT = 1.35e-8
"""Of the heating rate in W/cm2, for SI units."""
SPEED_POWER = 3.04
WALL_ENTHALPY = 1.395e6
"""J/kg; fitted."""
SHIELD, SHIELD_POWER = 0.091, 0.51575
"""Per cent of the mass for a heat load in J/cm2, and its power."""


def heating_rate(density: Any, speed: Any, nose: Any = 1.0, wall_enthalpy: float = WALL_ENTHALPY) -> Any:
    """Convective heating rate at the stagnation point, W/cm2: eq. (4), with the total enthalpy v^2/2.

    Parameters
    ----------
    density, speed : numbers, arrays or expressions
        Of the air, kg/m3, and of the flight, m/s.
    nose : the same
        Nose radius, m. That of 1 m gives the rate times the root of the nose radius, which no longer depends on the nose.
    wall_enthalpy : float
        J/kg.
    """
    return CONSTANT * (density / nose) ** 0.5 * speed**SPEED_POWER * (1.0 - 2.0 * wall_enthalpy / speed**2)


def shield_fraction(load: Any) -> Any:
    """Mass of the heat shield in per cent of the capsule's, for a heat load in J/cm2: eq. (3) with 0.091."""
    return SHIELD * load**SHIELD_POWER


def allowed_load(fraction: Any) -> Any:
    """Heat load in J/cm2 that a heat shield of so many per cent of the capsule's mass bears: eq. (3) solved for it."""
    return (fraction / SHIELD) ** (1.0 / SHIELD_POWER)
