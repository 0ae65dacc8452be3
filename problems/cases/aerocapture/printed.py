"""What Armellin and Lavagna print (see `mars`): the solutions of Table 2, the two shapes of Table 1, and the refined ones of Table 3."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from .designs import judged
from .passage import passages


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


def table_2() -> str:
    """Table 2 beside ours: for each solution the printed figures, then what follows here from its five variables."""
    found = judged(np.array([solution.design for solution in TABLE_2.values()]), way=passages)
    bank, entry = np.degrees(found.bank), np.degrees(found.entry_angle)
    ours = (found.shield, found.packing, found.lift_to_drag, bank, found.ballistic, found.lowest / 1e3, entry, found.base)
    heads = ("solution", "by", "TPS %", "eta 1/m2", "L/D", "bank deg", "BC kg/m2", "h_min km", "gamma_e deg", "r_b m")
    rows: list[tuple[str, ...]] = []
    for (number, p), here in zip(TABLE_2.items(), np.transpose(ours), strict=True):
        theirs = (p.shield, p.packing, p.lift_to_drag, p.bank, p.ballistic, p.lowest, p.entry_angle, p.base)
        rows += [(str(number), "the paper", *_figures(theirs)), ("", "ours", *_figures(here))]
    return _aligned([heads, *rows])


def table_1() -> str:
    """Table 1 beside ours: what the ballistic coefficient decides; the nose radii, and with them the heat shields, are not printed."""
    ours = passages(np.array([one[3] for one in TABLE_1.values()]))
    heads = ("shape", "by", "BC kg/m2", "L/D", "bank deg", "h_min km", "gamma_e deg")
    rows: list[tuple[str, ...]] = []
    for row, (number, (_, ratio, bank, ballistic, lowest, entry)) in enumerate(TABLE_1.items()):
        # The ratio is printed with two digits, and its sign follows from the bank angle beyond 90 deg.
        angle = np.degrees(np.arccos(ours.lift[row] / ratio))
        rows += [
            (str(number), "the paper", *_figures((ballistic, ratio, bank, lowest, entry))),
            ("", "ours", *_figures((ballistic, ratio, angle, ours.lowest[row] / 1e3, np.degrees(ours.entry_angle[row])))),
        ]
    return _aligned([heads, *rows])


def _figures(values: Iterable[float]) -> list[str]:
    return [f"{value:.2f}" for value in values]


def _aligned(rows: list[tuple[str, ...]]) -> str:
    """Rows of cells as text, in columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join("  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows)
