"""Modified Newtonian lift and drag against closed forms of the cone and of the hemisphere, and against panels."""

from __future__ import annotations

import numpy as np
import pytest

from problems.cases.aerocapture import aerodynamics
from problems.cases.aerocapture.aerodynamics import ballistic_coefficient, lift_and_drag
from problems.cases.aerocapture.designs import BOUNDS, shapes_of
from problems.cases.aerocapture.printed import TABLE_2
from problems.cases.aerocapture.shape import capsules

ATTACKS = np.radians([-30.0, -19.0, -5.0, 0.0, 3.0, 12.0, 30.0])


@pytest.mark.parametrize("half_angle", [35.0, 50.0, 70.0])
def test_sharp_cones_lit_all_around(half_angle):
    """C_N = C_pmax / 2 cos^2 t sin 2a, C_A = C_pmax / 2 (2 sin^2 t + sin^2 a (1 - 3 sin^2 t)) for |a| <= t: Clark and Trimmer, "Equations
    and charts for the evaluation of the hypersonic aerodynamic characteristics of lifting configurations by the Newtonian theory", 1964."""
    t, a = np.radians(half_angle), ATTACKS
    normal = np.cos(t) ** 2 * np.sin(2 * a)
    axial = 2 * np.sin(t) ** 2 + np.sin(a) ** 2 * (1 - 3 * np.sin(t) ** 2)
    lift, drag = lift_and_drag(capsules(np.full(len(a), 1e-9), 0.5, t, 0.3), a, greatest=2.0)
    np.testing.assert_allclose(lift, normal * np.cos(a) - axial * np.sin(a), atol=1e-12)
    np.testing.assert_allclose(drag, axial * np.cos(a) + normal * np.sin(a), rtol=1e-12)


def test_hemispheres():
    """The lit part is a lune, cut out by the plane of the base and that of the shadow. With azimuths l about the line in which both
    meet, from the flow, force is the integral of (sin b cos l)^2 n over it: C_D = 3/8 (2/3 + cos a - cos^3 a / 3), C_L = -sin^3 a / 8."""
    a = ATTACKS
    lift, drag = lift_and_drag(capsules(np.full(len(a), 1.0), 0.5, 1e-9, 0.3), a, greatest=1.0)
    np.testing.assert_allclose(drag, 3 / 8 * (2 / 3 + np.cos(a) - np.cos(a) ** 3 / 3), rtol=1e-8)
    np.testing.assert_allclose(lift, -(np.sin(a) ** 3) / 8, atol=1e-8)


def panels(nose: float, front: float, attack: float, n: int = 500) -> tuple[float, float]:
    """Lift and drag of a unit base by n x n flat panels on sphere and cone, for a greatest pressure coefficient of 1."""
    azimuth = (np.arange(n) + 0.5) * 2 * np.pi / n
    polar = (np.arange(n) + 0.5) / n * (np.pi / 2 - front)
    edge = nose * np.cos(front)
    radius = edge + (np.arange(n) + 0.5) / n * (1 - edge)
    slope = np.concatenate([np.pi / 2 - polar, np.full(n, front)])
    area = np.concatenate([nose**2 * np.sin(polar) * (np.pi / 2 - front) / n, radius * (1 - edge) / n / np.sin(front)]) * 2 * np.pi / n
    normals = np.array(
        [
            -np.sin(slope)[:, None] + 0 * azimuth,
            np.cos(slope)[:, None] * np.sin(azimuth),
            np.cos(slope)[:, None] * np.cos(azimuth),
        ]
    )
    flow = np.array([np.cos(attack), 0.0, np.sin(attack)])
    seen = np.maximum(-np.tensordot(flow, normals, 1), 0.0)
    force = -(normals * seen**2 * area[:, None]).sum(axis=(1, 2)) / np.pi
    return float(force @ [-np.sin(attack), 0.0, np.cos(attack)]), float(force @ flow)


def test_panels_agree_where_parts_are_in_the_shadow():
    X = np.random.default_rng(5).uniform(*np.array(BOUNDS).T, (12, 5))
    X[:6, 2], X[:6, 4] = np.linspace(20.0, 27.0, 6), [-30, 30, -28, 29, -30, 30]
    shapes, attack = shapes_of(X)
    lift, drag = lift_and_drag(shapes, attack, greatest=1.0)
    expected = np.array([panels(nose, front, a) for nose, front, a in zip(X[:, 0], shapes.front_angle, attack, strict=True)])
    np.testing.assert_allclose(np.column_stack([lift, drag]), expected, atol=2e-6)


def test_more_points_change_nothing(monkeypatch):
    X = np.random.default_rng(6).uniform(*np.array(BOUNDS).T, (200, 5))
    shapes, attack = shapes_of(X)
    usual = np.array(lift_and_drag(shapes, attack))
    monkeypatch.setattr(aerodynamics, "POINTS", 60)
    np.testing.assert_allclose(usual, lift_and_drag(shapes, attack), atol=1e-9)


def test_lift_and_ballistic_coefficient_of_the_printed_shapes():
    """No constant is fitted to the ratio of lift and drag; the mass over the pressure coefficient is fitted to these five coefficients."""
    shapes, attack = shapes_of(np.array([p.design for p in TABLE_2.values()]))
    lift, drag = lift_and_drag(shapes, attack)
    np.testing.assert_allclose(lift / drag, [p.lift_to_drag for p in TABLE_2.values()], atol=0.01)
    np.testing.assert_allclose(ballistic_coefficient(shapes, drag), [p.ballistic for p in TABLE_2.values()], rtol=0.01)
