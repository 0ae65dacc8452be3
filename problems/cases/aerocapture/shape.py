"""Capsules of a spherical nose, a cone, a frustum behind the largest section, and a flat back: lengths and volume of many at once.

Armellin and Lavagna (see `mars`), section 2.1 and figure 1. The nose is tangent to the cone. The paper's text does not say from where the
rear angle is measured: from the plane of the base, for the volumes of four of the five shapes of Table 2 are then 4.9 to 5.0 m3, and up to
118 m3 if it is measured from the axis. All but the checks takes arrays and CasADi expressions alike.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from .elementary import cos, greater, sin, tan

VOLUME = 5.0
"""m3, of every capsule of the paper."""


@dataclass(frozen=True)
class Shapes:
    """Capsules: arrays (n,), or expressions of one; lengths in m, angles in rad.

    Attributes
    ----------
    base, nose, rear : ndarray
        Radii of the largest section, of the sphere and of the back.
    front_angle : ndarray
        Half angle of the cone, from the axis.
    rear_angle : ndarray
        Angle of the frustum, from the plane of the base.
    cap, cone, frustum : ndarray
        Lengths of the three parts along the axis.
    volume : ndarray
        m3.
    """

    base: Any
    nose: Any
    rear: Any
    front_angle: Any
    rear_angle: Any
    cap: Any
    cone: Any
    frustum: Any
    volume: Any

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

    Parameters
    ----------
    nose, rear : array_like (n,)
        Radii of the nose and of the back, over that of the largest section.
    front_angle, rear_angle : array_like (n,)
        See `Shapes`, rad.
    attack : array_like (n,)
        Angle of attack, rad.
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


def capsules(nose: np.ndarray, rear: np.ndarray, front_angle: np.ndarray, rear_angle: np.ndarray, volume: float = VOLUME) -> Shapes:
    """Capsules of a volume, of the same parameters as in `faults`; volumes are closed forms, so the size is, too.

    Raises
    ------
    ValueError
        A row has a fault, or the volume is not positive: the first one is named.
    """
    if not (np.isfinite(volume) and volume > 0.0):
        raise ValueError(f"the volume of a capsule must be positive and finite, not {volume!r}")
    nose, rear, front, back = (np.atleast_1d(np.asarray(a, float)) for a in np.broadcast_arrays(nose, rear, front_angle, rear_angle))
    reasons = faults(nose, rear, front, back)
    if reasons.any():
        row = int(np.flatnonzero(reasons)[0])
        raise ValueError(f"shape {row}: {reasons[row]}")
    return sized(nose, rear, front, back, volume)


def sized(nose: Any, rear: Any, front_angle: Any, rear_angle: Any, volume: float = VOLUME) -> Shapes:
    """Capsules of a volume, of parameters that have no `faults`: arrays or expressions."""
    edge, cap = nose * cos(front_angle), nose * (1.0 - sin(front_angle))
    cone, frustum = (1.0 - edge) / tan(front_angle), (1.0 - rear) * tan(rear_angle)
    sphere = cap**2 * (3.0 * nose - cap)
    unit = np.pi / 3.0 * (sphere + cone * (1.0 + edge + edge**2) + frustum * (1.0 + rear + rear**2))
    base = (volume / unit) ** (1.0 / 3.0)
    return Shapes(nose**0, nose, rear, front_angle, rear_angle, cap, cone, frustum, unit).scaled(base)
