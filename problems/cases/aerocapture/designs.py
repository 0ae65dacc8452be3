"""Capsules from their five variables to all that counts: packing, heat shield, lift and the way through the air, for many at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from .aerodynamics import ballistic_coefficient, lift_and_drag
from .heating import shield_fraction
from .passage import PASSAGE, Passage, Passages
from .passage_table import outside, tabulated
from .shape import Shapes, capsules, faults

BOUNDS = ((0.1, 0.9), (0.2, 0.9), (20.0, 70.0), (5.0, 60.0), (-30.0, 30.0))
"""Of the five variables: radii of nose and back over that of the base, front angle, rear angle, angle of attack; deg."""
LIFT_TO_DRAG, LENGTH = 0.3, 0.8
"""Least lift over drag, of either sign, and least length, m."""


@dataclass(frozen=True)
class Designs:
    """What follows from the variables: arrays (n,).

    Rows with a reason are no capsules, or none that can be judged; they hold NaN in all other columns.

    Attributes
    ----------
    reason : ndarray of str
        Why a row cannot be judged, or is not captured; empty otherwise.
    packing : ndarray
        Inverse packing efficiency, 1/m2.
    shield : ndarray
        Heat shield, % of the mass.
    lift_to_drag, ballistic : ndarray
        Lift over drag; mass over drag area, kg/m2.
    length, base : ndarray
        Of the capsule, and radius of its largest section, m.
    lift : ndarray
        Lift over drag that must point upward for the passage; it is captured if this is not larger than `lift_to_drag`.
    bank : ndarray
        Angle, rad; where it is not captured, that of all the lift upward or downward.
    lowest, entry_angle : ndarray
        Least altitude, m, and path angle at the entry, rad.
    """

    reason: np.ndarray
    packing: np.ndarray
    shield: np.ndarray
    lift_to_drag: np.ndarray
    ballistic: np.ndarray
    length: np.ndarray
    base: np.ndarray
    lift: np.ndarray
    bank: np.ndarray
    lowest: np.ndarray
    entry_angle: np.ndarray


def shapes_of(X: np.ndarray) -> tuple[Shapes, np.ndarray]:
    """Capsules of rows of the five variables (n, 5), see `BOUNDS`, and their angles of attack, rad. Raises ValueError for a faulty one."""
    X = np.atleast_2d(np.asarray(X, float))
    nose, rear = X[:, 0], X[:, 1]
    front, back, attack = np.radians(X[:, 2:].T)
    reasons = faults(nose, rear, front, back, attack)
    if reasons.any():
        row = int(np.flatnonzero(reasons)[0])
        raise ValueError(f"capsule {row}: {reasons[row]}")
    return capsules(nose, rear, front, back), attack


def judged(X: np.ndarray, passage: Passage = PASSAGE, way: Callable[[np.ndarray, Passage], Passages] = tabulated) -> Designs:
    """All about rows of the five variables (n, 5), see `BOUNDS`. No row raises an error: those that cannot be judged have a reason.

    Parameters
    ----------
    X : ndarray (n, 5)
    passage : Passage
    way : callable
        Passages of ballistic coefficients: `tabulated`, or `passage.passages`, the solver itself.
    """
    X = np.atleast_2d(np.asarray(X, float))
    reason = faults(X[:, 0], X[:, 1], *np.radians(X[:, 2:].T))
    columns = {f.name: np.full(len(X), np.nan) for f in fields(Designs) if f.name != "reason"}
    rows = np.flatnonzero(reason == "")
    if len(rows):
        shapes, attack = shapes_of(X[rows])
        lift, drag = lift_and_drag(shapes, attack)
        ballistic = ballistic_coefficient(shapes, drag)
        reason[rows] = outside(ballistic)
        inside = reason[rows] == ""
        rows = rows[inside]
        through = way(ballistic[inside], passage)
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
    return Designs(reason, **columns)
