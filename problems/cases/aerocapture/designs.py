"""Capsules from their five variables to all that counts: packing, heat shield, lift and the way through the air, for many at once.

And what Armellin and Lavagna print (see `mars`): the solutions of Table 2.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from .capsule import Shapes, ballistic_coefficient, capsules, faults, lift_and_drag
from .mars import shield_fraction
from .passage import PASSAGE, Passage, outside, tabulated

BOUNDS = ((0.1, 0.9), (0.2, 0.9), (20.0, 70.0), (5.0, 60.0), (-30.0, 30.0))
"""Of the five variables: radii of nose and back over that of the base, front angle, rear angle, angle of attack; deg."""
LIFT_TO_DRAG, LENGTH = 0.3, 0.8
"""Least lift over drag, of either sign, and least length, m."""


@dataclass(frozen=True)
class JudgedCapsules:
    """What follows from the variables: arrays (n,).

    Rows with a reason are no capsules, or none that can be judged; they hold NaN in all other columns.
    """

    reason: np.ndarray  # Why a row cannot be judged, or is not captured; empty otherwise.
    packing: np.ndarray  # Inverse packing efficiency, 1/m2.
    shield: np.ndarray  # Heat shield, % of the mass.
    lift_to_drag: np.ndarray  # Lift over drag.
    ballistic: np.ndarray  # Mass over drag area, kg/m2.
    length: np.ndarray  # Of the capsule, m.
    base: np.ndarray  # Radius of its largest section, m.
    lift: np.ndarray  # Lift over drag that must point upward for the passage; it is captured if this is not larger than `lift_to_drag`.
    bank: np.ndarray  # Angle, rad; where it is not captured, that of all the lift upward or downward.
    lowest: np.ndarray  # Least altitude, m.
    entry_angle: np.ndarray  # Path angle at the entry, rad.


def shapes_of(X: np.ndarray) -> tuple[Shapes, np.ndarray]:
    """Capsules of rows of the five variables (n, 5), see `BOUNDS`, and their angles of attack, rad. Raises ValueError for a faulty one."""
    X = np.atleast_2d(np.asarray(X, float))
    front, back, attack = np.radians(X[:, 2:].T)
    return capsules(X[:, 0], X[:, 1], front, back, attack), attack


def assess(X: np.ndarray, passage: Passage = PASSAGE) -> JudgedCapsules:
    """All about rows of the five variables (n, 5), see `BOUNDS`. No row raises an error: those that cannot be judged have a reason."""
    X = np.atleast_2d(np.asarray(X, float))
    reason = faults(X[:, 0], X[:, 1], *np.radians(X[:, 2:].T))
    columns = {f.name: np.full(len(X), np.nan) for f in fields(JudgedCapsules) if f.name != "reason"}
    rows = np.flatnonzero(reason == "")
    if len(rows):
        shapes, attack = shapes_of(X[rows])
        lift, drag = lift_and_drag(shapes, attack)
        ballistic = ballistic_coefficient(shapes, drag)
        reason[rows] = outside(ballistic)
        inside = reason[rows] == ""
        rows = rows[inside]
        through = tabulated(ballistic[inside], passage)
        ratio, nose = (lift / drag)[inside], shapes.nose[inside]
        with np.errstate(divide="ignore"):
            cosine = np.clip(through.lift / ratio, -1.0, 1.0)
        found = {
            "packing": shapes.packing[inside],
            "shield": shield_fraction(through.heat / np.sqrt(nose)),
            "lift_to_drag": ratio,
            "ballistic": ballistic[inside],
            "length": shapes.length[inside],
            "base": shapes.base[inside],
            "lift": through.lift,
            "bank": np.arccos(cosine),
            "lowest": through.lowest,
            "entry_angle": through.entry_angle,
        }
        for name, values in found.items():
            columns[name][rows] = values
        reason[rows[np.abs(through.lift) > np.abs(ratio)]] = "not captured: the passage asks for more lift than there is"
    return JudgedCapsules(reason, **columns)


@dataclass(frozen=True)
class Printed:
    """A column of Table 2."""

    shield: float  # Heat shield, % of the mass.
    packing: float  # Inverse packing efficiency, 1/m2.
    attack: float  # Angle of attack, deg.
    bank: float  # deg.
    lift_to_drag: float
    ballistic: float  # kg/m2.
    lowest: float  # Least altitude, km.
    entry_angle: float  # deg.
    base: float  # Radius, m, as the next two.
    nose: float
    rear: float
    front_angle: float  # deg, as the next one.
    rear_angle: float

    @property
    def design(self) -> tuple[float, float, float, float, float]:
        """The five variables: radii of nose and back over that of the base, front and rear angle and angle of attack in degrees."""
        return self.nose / self.base, self.rear / self.base, self.front_angle, self.rear_angle, self.attack


TABLE_2 = {
    1: Printed(13.28, 0.46, -29.45, 57.4, -0.31, 299.72, 36.5, -9.08, 1.16, 0.73, 0.58, 21.0, 41.0),
    2: Printed(9.0, 0.55, -21.13, 116.9, 0.32, 120.26, 43.9, -8.50, 1.37, 1.22, 0.47, 68.51, 56.59),
    3: Printed(7.9, 0.63, -19.3, 117.2, 0.30, 86.13, 46.7, -8.25, 1.59, 1.42, 0.45, 70.0, 40.0),
    4: Printed(7.5, 0.68, -20.3, 115.8, 0.31, 77.11, 47.7, -8.19, 1.69, 1.52, 0.48, 69.64, 32.44),
    5: Printed(6.1, 0.89, -19.27, 115.0, 0.30, 45.02, 52.3, -7.73, 2.19, 1.94, 0.82, 70.0, 5.2),
}
"""By the number of the solution. The rear angle of the fourth is printed as 42.07 deg, with which its volume is 6.3 m3: here 32.44."""
