"""Capsules of a spherical nose, a cone, a frustum behind the largest section, and a flat back: size, lift and drag of many at once.

Shape: Armellin and Lavagna (see `mars`), section 2.1 and figure 1. The nose is tangent to the cone. The paper's text does not say from
where the rear angle is measured: from the plane of the base, for the volumes of four of the five shapes of Table 2 are then 4.9 to 5.0 m3,
and up to 118 m3 if it is measured from the axis.

Modified Newtonian flow: Anderson, "Hypersonic and High Temperature Gas Dynamics", section 3.2: the pressure coefficient is its greatest
value times the squared cosine between the flow and the inward normal where the surface faces the flow, and zero in the shadow. A capsule is
convex, so a point is in the shadow exactly where its surface does not face the flow. Around the axis the integrals are closed forms; along
it, that of the cone is, too, and that of the sphere is taken by Gauss's quadrature, in two parts: the rings that are lit all around and the
others. The angle of attack is taken to be that of trim, as the paper does; it prints no moments.

All but the checks takes arrays and CasADi expressions alike.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import casadi as ca
import numpy as np

from transcription.numerics.polynomials import gauss_legendre

VOLUME = 5.0
"""m3, of every capsule of the paper."""
MASS = 946.0
"""kg: the paper's 230 kg/m3 in 3.8 m3, and 60 kg/m3 in the other 1.2 m3. The latter is chosen, for 13.30 % of the mass are printed as
126 kg."""
GREATEST_PRESSURE = MASS / 520.3
"""Pressure coefficient at the stagnation point, 1.818. Only mass over pressure coefficient can be told from the paper: 520.3 kg, fitted to
the five ballistic coefficients of Table 2."""
POINTS = 8
"""Of the quadrature on the part of the sphere that is not lit all around."""
LIMIT = 1.0 - 1e-8
"""Largest cosine of the azimuth where the shadow begins."""


def _of(array: Callable[..., Any], expression: Callable[..., Any]) -> Callable[..., Any]:
    """Either function, by what it is called with."""

    def either(*values: Any) -> Any:
        return (expression if any(isinstance(value, ca.MX | ca.SX) for value in values) else array)(*values)

    return either


sin, cos, tan, arccos = (_of(*pair) for pair in ((np.sin, ca.sin), (np.cos, ca.cos), (np.tan, ca.tan), (np.arccos, ca.acos)))
log = _of(np.log, ca.log)
greater, lesser = _of(np.maximum, ca.fmax), _of(np.minimum, ca.fmin)
choose = _of(np.where, ca.if_else)
"""(condition, value where it holds, value elsewhere); of expressions both values are computed, so both must be finite."""


def column(values: Any) -> Any:
    """An array (n,) as (n, 1), to be combined with rows of nodes (1, k); an expression as it is."""
    return values[:, None] if isinstance(values, np.ndarray) else values


@dataclass(frozen=True)
class Shapes:
    """Capsules: arrays (n,), or expressions of one; lengths in m, angles in rad."""

    base: Any  # Radius of the largest section, as those of the sphere, `nose`, and of the back, `rear`.
    nose: Any
    rear: Any
    front_angle: Any  # Half angle of the cone, from the axis.
    rear_angle: Any  # Angle of the frustum, from the plane of the base.
    cap: Any  # Length along the axis, as those of the other two parts.
    cone: Any
    frustum: Any
    volume: Any  # m3.

    @property
    def edge(self) -> Any:
        """Radius where the sphere meets the cone, m."""
        return self.nose * cos(self.front_angle)

    @property
    def length(self) -> Any:
        """From the tip to the back, m."""
        return self.cap + self.cone + self.frustum

    @property
    def area(self) -> Any:
        """Largest section, the area of reference, m2."""
        return np.pi * self.base**2

    @property
    def packing(self) -> Any:
        """Greatest of length and diameter over the volume, 1/m2: the inverse packing efficiency, eq. (17)."""
        return greater(2.0 * self.base, self.length) / self.volume

    def scaled(self, factor: Any) -> Shapes:
        """The same shapes, so many times as large."""
        powers = {"front_angle": 0, "rear_angle": 0, "volume": 3}
        return Shapes(**{f.name: getattr(self, f.name) * factor ** powers.get(f.name, 1) for f in fields(self)})


def faults(
    nose: np.ndarray, rear: np.ndarray, front_angle: np.ndarray, rear_angle: np.ndarray, attack: np.ndarray | float = 0.0
) -> np.ndarray:
    """Why rows are no capsules that this model describes: (n,) of text, empty where they are.

    Radii of the nose and of the back are over that of the largest section; angles, see `Shapes`, in rad.
    """
    given = np.broadcast_arrays(nose, rear, front_angle, rear_angle, attack)
    nose, rear, front, back, attack = (np.atleast_1d(np.asarray(a, float)) for a in given)
    quarter = 0.5 * np.pi
    with np.errstate(invalid="ignore"):
        checks = [
            (~np.isfinite(nose + rear + front + back + attack), "a value is not finite"),
            (nose <= 0.0, "the nose radius is not positive"),
            ((rear < 0.0) | (rear > 1.0), "the radius of the back is not between 0 and that of the largest section"),
            ((front <= 0.0) | (front >= quarter), "the front cone's half angle is not between 0 and 90 deg"),
            ((back < 0.0) | (back >= quarter), "the rear angle is not between 0 and 90 deg"),
            (nose * np.cos(front) > 1.0, "the nose is wider than the largest section: no volume for a front cone"),
            (np.abs(attack) >= quarter, "the angle of attack is not between -90 and 90 deg"),
            (np.abs(attack) > quarter - back, "the rear cone is lit: the angle of attack exceeds its half angle"),
        ]
    return np.select([found for found, _ in checks], [reason for _, reason in checks], default="").astype(object)


def capsules(
    nose: np.ndarray, rear: np.ndarray, front_angle: np.ndarray, rear_angle: np.ndarray, attack: np.ndarray | float = 0.0
) -> Shapes:
    """Capsules of the paper's volume, of the same parameters as in `faults`. Raises ValueError: a row has a fault; the first is named."""
    reasons = faults(nose, rear, front_angle, rear_angle, attack)
    if reasons.any():
        row = int(np.flatnonzero(reasons)[0])
        raise ValueError(f"capsule {row}: {reasons[row]}")
    return sized(*(np.atleast_1d(np.asarray(a, float)) for a in np.broadcast_arrays(nose, rear, front_angle, rear_angle)))


def sized(nose: Any, rear: Any, front_angle: Any, rear_angle: Any) -> Shapes:
    """Capsules of parameters that have no `faults`: arrays or expressions. Volumes are closed forms, so the size is, too."""
    edge, cap = nose * cos(front_angle), nose * (1.0 - sin(front_angle))
    cone, frustum = (1.0 - edge) / tan(front_angle), (1.0 - rear) * tan(rear_angle)
    sphere = cap**2 * (3.0 * nose - cap)
    unit = np.pi / 3.0 * (sphere + cone * (1.0 + edge + edge**2) + frustum * (1.0 + rear + rear**2))
    base = (VOLUME / unit) ** (1.0 / 3.0)
    return Shapes(nose**0, nose, rear, front_angle, rear_angle, cap, cone, frustum, unit).scaled(base)


def lift_and_drag(shapes: Shapes, attack: Any, greatest: float = GREATEST_PRESSURE) -> tuple[Any, Any]:
    """Coefficients of lift and drag (n,), of the largest section, of capsules whose rear cones are in the shadow (see `faults`).

    The angle of attack is in rad; `greatest` is the pressure coefficient at the stagnation point.
    """
    # Not by absolute value and sign, whose derivatives vanish at zero.
    side = choose(attack < 0.0, -1.0, 1.0)
    size = side * attack
    axial, normal = _sphere(shapes, size)
    edge = (shapes.edge / shapes.base) ** 2
    # Of a cone the sides are straight: its area, over the sine of the half angle, is that of the ring that one sees along the axis.
    along, across = _ring(shapes.front_angle, size)
    ring = (1.0 - edge) / (2.0 * np.pi)
    axial, normal = axial + ring * along, normal + ring * across / tan(shapes.front_angle)
    # Towards the windward side: below for a positive angle of attack, so that the force is upward.
    normal = side * normal
    drag = axial * cos(attack) + normal * sin(attack)
    lift = normal * cos(attack) - axial * sin(attack)
    return greatest * lift, greatest * drag


def ballistic_coefficient(shapes: Shapes, drag: Any, mass: float = MASS) -> Any:
    """Mass over drag area (n,), kg/m2."""
    return mass / (shapes.area * drag)


def _sphere(shapes: Shapes, attack: Any) -> tuple[Any, Any]:
    """Axial and normal force coefficients (n,) of the noses, for a pressure coefficient of at most 1."""
    last = 0.5 * np.pi - shapes.front_angle
    # A ring at polar angle p is lit all around while p + |attack| is at most a right angle.
    whole = lesser(last, 0.5 * np.pi - attack)
    fourth = sin(whole) ** 4
    axial = 0.5 * cos(attack) ** 2 * (1.0 - cos(whole) ** 4) + 0.25 * sin(attack) ** 2 * fourth
    normal = 0.5 * sin(attack) * cos(attack) * fourth
    nodes, weights = gauss_legendre(POINTS)
    half = 0.5 * (last - whole)
    polar = column(whole) + column(half) * (1.0 + nodes[None, :])
    along, across = _ring(0.5 * np.pi - polar, column(attack))
    area = column(half) * (weights[None, :] / np.pi) * sin(polar)
    size, total = (shapes.nose / shapes.base) ** 2, np.ones(POINTS)
    return size * (axial + (area * along * cos(polar)) @ total), size * (normal + (area * across * sin(polar)) @ total)


def _ring(slope: Any, attack: Any) -> tuple[Any, Any]:
    """Integrals around the axis of cos^2 between flow and inward normal where it is lit, and of the same times the cosine of the azimuth.

    The surface is inclined to the axis by `slope`, 0 to 90 deg; `attack` is not negative; the azimuth counts from the windward side.
    """
    mean, swing = cos(attack) * sin(slope), sin(attack) * cos(slope)
    shaded = mean < swing
    # Next to the limit the derivatives of the arc cosine are endless. It counts for nothing there, where the flow is along the surface.
    ratio = lesser(choose(shaded, mean, 0.0) / choose(shaded, swing, 1.0), LIMIT)
    lit = choose(shaded, arccos(-ratio), np.pi)
    sine, double = sin(lit), 0.5 * sin(2.0 * lit)
    along = 2.0 * ((mean**2 + 0.5 * swing**2) * lit + 2.0 * mean * swing * sine + 0.5 * swing**2 * double)
    across = 2.0 * (mean**2 * sine + mean * swing * (lit + double) + swing**2 * (sine - sine**3 / 3.0))
    return along, across
