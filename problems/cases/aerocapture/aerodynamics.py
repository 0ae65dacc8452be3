"""Lift and drag of many capsules by modified Newtonian flow.

Anderson, "Hypersonic and High Temperature Gas Dynamics", section 3.2: the pressure coefficient is its greatest value times the squared
cosine between the flow and the inward normal where the surface faces the flow, and zero in the shadow. A capsule is convex, so a point is
in the shadow exactly where its surface does not face the flow. Around the axis the integrals are closed forms; along it, that of the cone
is, too, and that of the sphere is taken by Gauss's quadrature, in two parts: the rings that are lit all around and the others.

Trim: the angle of attack is taken to be that of trim, as the paper does; it prints no moments.
"""

from __future__ import annotations

import numpy as np

from transcription.numerics.polynomials import gauss_legendre

from .shape import Shapes

MASS = 946.0
"""kg: the paper's 230 kg/m3 in 3.8 m3, and 60 kg/m3 in the other 1.2 m3. The latter is chosen, for 13.30 % of the mass are printed as
126 kg."""
GREATEST_PRESSURE = MASS / 520.3
"""Pressure coefficient at the stagnation point, 1.818. Only mass over pressure coefficient can be told from the paper: 520.3 kg, fitted to
the five ballistic coefficients of Table 2."""
POINTS = 16
"""Of the quadrature on each part of the sphere."""


def lift_and_drag(shapes: Shapes, attack: np.ndarray, greatest: float = GREATEST_PRESSURE) -> tuple[np.ndarray, np.ndarray]:
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
    attack = np.broadcast_to(np.asarray(attack, float), shapes.base.shape)
    size = np.abs(attack)
    axial, normal = _sphere(shapes, size)
    edge = (shapes.edge / shapes.base) ** 2
    # Of a cone the sides are straight: its area, over the sine of the half angle, is that of the ring that one sees along the axis.
    along, across = _ring(shapes.front_angle, size)
    ring = (1.0 - edge) / (2.0 * np.pi)
    axial, normal = axial + ring * along, normal + ring * across / np.tan(shapes.front_angle)
    # Towards the windward side: below for a positive angle of attack, so that the force is upward.
    normal = np.sign(attack) * normal
    drag = axial * np.cos(attack) + normal * np.sin(attack)
    lift = normal * np.cos(attack) - axial * np.sin(attack)
    return greatest * lift, greatest * drag


def ballistic_coefficient(shapes: Shapes, drag: np.ndarray, mass: float = MASS) -> np.ndarray:
    """Mass over drag area (n,), kg/m2."""
    return mass / (shapes.area * drag)


def _sphere(shapes: Shapes, attack: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Axial and normal force coefficients (n,) of the noses, for a pressure coefficient of at most 1."""
    nodes, weights = gauss_legendre(POINTS)
    last = 0.5 * np.pi - shapes.front_angle
    # A ring at polar angle p is lit all around while p + |attack| is at most a right angle.
    whole = np.minimum(last, 0.5 * np.pi - attack)
    axial, normal = np.zeros_like(last), np.zeros_like(last)
    for begin, end in ((np.zeros_like(last), whole), (whole, last)):
        half = 0.5 * (end - begin)
        polar = begin[:, None] + half[:, None] * (1.0 + nodes)
        along, across = _ring(0.5 * np.pi - polar, attack[:, None])
        area = half[:, None] * weights * np.sin(polar) / np.pi
        axial += (area * along * np.cos(polar)).sum(axis=1)
        normal += (area * across * np.sin(polar)).sum(axis=1)
    size = (shapes.nose / shapes.base) ** 2
    return size * axial, size * normal


def _ring(slope: np.ndarray, attack: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Integrals around the axis of cos^2 between flow and inward normal where it is lit, and of the same times the cosine of the azimuth.

    The surface is inclined to the axis by `slope`, 0 to 90 deg; `attack` is not negative; the azimuth counts from the windward side.
    """
    mean, swing = np.cos(attack) * np.sin(slope), np.sin(attack) * np.cos(slope)
    lit = np.arccos(np.clip(-mean / np.maximum(swing, 1e-300), -1.0, 1.0))
    sine, double = np.sin(lit), 0.5 * np.sin(2.0 * lit)
    along = 2.0 * ((mean**2 + 0.5 * swing**2) * lit + 2.0 * mean * swing * sine + 0.5 * swing**2 * double)
    across = 2.0 * (mean**2 * sine + mean * swing * (lit + double) + swing**2 * (sine - sine**3 / 3.0))
    return along, across
