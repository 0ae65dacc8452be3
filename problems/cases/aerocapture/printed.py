"""What Armellin and Lavagna print (see `mars`): the solutions of Table 2, the two shapes of Table 1, and the refined ones of Table 3."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Printed:
    """A column of Table 2.

    Attributes
    ----------
    shield : float
        Heat shield, % of the mass.
    packing : float
        Inverse packing efficiency, 1/m2.
    attack, bank : float
        Angle of attack and bank angle, deg.
    lift_to_drag : float
    ballistic : float
        kg/m2.
    lowest : float
        Least altitude, km.
    entry_angle : float
        deg.
    base, nose, rear : float
        Radii, m.
    front_angle, rear_angle : float
        deg.
    """

    shield: float
    packing: float
    attack: float
    bank: float
    lift_to_drag: float
    ballistic: float
    lowest: float
    entry_angle: float
    base: float
    nose: float
    rear: float
    front_angle: float
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
TABLE_1 = {1: (9.48, 0.15, 163.18, 135.99, 43.01, -8.57), 2: (7.44, 0.31, 115.7, 69.62, 48.6, -8.11)}
"""Heat shield in %, lift over drag, bank angle in deg, ballistic coefficient, least altitude in km and entry angle in deg of two shapes
whose measures are not printed."""
TABLE_3 = {2: (40.85, -9.16, 7.98, 39.22), 3: (44.8, -9.38, 7.05, 38.25)}
"""Least altitude in km, entry angle in deg, heat shield in % and delta v in m/s of solutions 2 and 3 after their refinement."""
