"""The normalisation of indicators in words, for the captions of tables: the ranges, the reference, and the corner of volumes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from macs.front import Front

from .indicators import POINT, Points, extent, pieces, truth


@dataclass(frozen=True)
class Scale:
    """The normalisation of a reference, in the user's units and senses.

    Attributes
    ----------
    ideal, nadir : tuple of m floats
        Best and worst value of each objective on the reference, dominated points left out.
    corner : tuple of m floats
        The reference point of the hypervolume.
    names, units : tuples of m str
    what : str
        Name of the reference: "the closed form", "the union of 60 runs".
    count : int
        How many points it has.
    curve : bool
        Whether the points of the reference are taken as the curve through them; see `runs.measures.indicators.gd`.
    """

    ideal: tuple[float, ...]
    nadir: tuple[float, ...]
    corner: tuple[float, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    what: str
    count: int
    curve: bool = False

    @staticmethod
    def of(reference: Points, *, like: Front | None = None, what: str = "the reference", curve: bool = True) -> Scale:
        """The normalisation by a reference that the indicators of `runs.measures.indicators` use.

        Parameters
        ----------
        reference : Front or array (k, m)
        like : Front, optional
            One of the fronts that are measured against it: it has names, units and senses where the reference is an array. Without it all
            columns are minimised.
        what : str
            Name of the reference, for captions.
        curve : bool
            As the indicators were given it.
        """
        known = reference if isinstance(reference, Front) else like
        R = truth(reference, known)
        m = R.shape[1]
        sign = np.array([goal.sign for goal in known.goals]) if known is not None else np.ones(m)
        ideal, unit = extent(R)

        def shown(values: np.ndarray) -> tuple[float, ...]:
            return tuple((sign * values + 0.0).tolist())

        return Scale(
            ideal=shown(ideal),
            nadir=shown(R.max(axis=0)),
            corner=shown(ideal + POINT * unit),
            names=known.names if known is not None else tuple(f"objective {i + 1}" for i in range(m)),
            units=known.units if known is not None else ("",) * m,
            what=what,
            count=len(R),
            curve=curve and bool(pieces(R)),
        )

    def describe(self) -> str:
        """Two sentences for a caption."""
        how = ", the curve through them" if self.curve else ""
        points = f"{self.what} ({self.count} point{'' if self.count == 1 else 's'}{how})"
        ends = f"0 at the ideal ({self._all(self.ideal)}) and 1 at the nadir ({self._all(self.nadir)})"
        volume = f"Hypervolume up to {POINT:g} in each objective ({self._all(self.corner)})."
        return f"Objectives normalised to {ends} of {points}. {volume}"

    def _all(self, values: tuple[float, ...]) -> str:
        cells = zip(self.names, values, self.units, strict=True)
        return ", ".join(f"{name} {value:.6g}{f' {unit}' if unit else ''}" for name, value, unit in cells)
