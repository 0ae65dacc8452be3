"""Lift and drag of many capsules by modified Newtonian flow.

Anderson, "Hypersonic and High Temperature Gas Dynamics", section 3.2: the pressure coefficient is its greatest value times the squared
cosine between the flow and the inward normal where the surface faces the flow, and zero in the shadow. A capsule is convex, so a point is
in the shadow exactly where its surface does not face the flow. Around the axis the integrals are closed forms; along it, that of the cone
is, too, and that of the sphere is taken by Gauss's quadrature, in two parts: the rings that are lit all around and the others.

Trim: the angle of attack is taken to be that of trim, as the paper does; it prints no moments.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from transcription.numerics.polynomials import gauss_legendre

from .elementary import arccos, choose, column, cos, lesser, sin, tan
from .shape import Shapes

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


def lift_and_drag(shapes: Shapes, attack: Any, greatest: float = GREATEST_PRESSURE) -> tuple[Any, Any]:
    """Coefficients of lift and drag (n,), of the largest section.

    Parameters
    ----------
    shapes : Shapes
        Of n capsules, whose rear cones are in the shadow (`shape.faults`).
    attack : ndarray (n,)
        Angle of attack, rad.
    greatest : float
        Pressure coefficient at the stagnation point.
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
