"""Agents: the population, one array per property, one row per agent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

NO_DIRECTION = -1


@dataclass
class Agents:
    """The population of a search.

    Attributes
    ----------
    Z : array (n, D)
        Positions: full vectors, in the user's units.
    F : array (n, m)
        Objectives, all minimised; NaN where the evaluation failed.
    violation : array (n,)
        Infinite where the evaluation failed.
    velocity : array (n, d)
        The free displacement that the last success achieved, in units of span; zero where there is none.
    rho : array (n,)
        Relative radius of the pattern search.
    contractions : array (n,) of int
        How many times the radius has been contracted.
    direction : array (n,) of int
        Row, in the pool of directions, of the sub-problem that the agent owns; -1 where it owns none.
    """

    Z: np.ndarray
    F: np.ndarray
    violation: np.ndarray
    velocity: np.ndarray
    rho: np.ndarray
    contractions: np.ndarray
    direction: np.ndarray

    def __len__(self) -> int:
        return len(self.Z)

    def place(self, rows: np.ndarray, Z: np.ndarray, F: np.ndarray, violation: np.ndarray) -> None:
        """Put the agents `rows` on evaluated points."""
        self.Z[rows], self.F[rows], self.violation[rows] = Z, F, violation

    def adapt_radius(self, success: np.ndarray, rho: float, contraction: float, limit: int) -> None:
        """Contract the radius of the agents that failed, widen that of those that succeeded; past either end it starts anew.

        Parameters
        ----------
        success : array (n,) of bool
        rho : float
            The radius to start with.
        contraction : float
            By how much it shrinks.
        limit : int
            How many contractions in a row are allowed.
        """
        self.contractions += np.where(success, -1, 1)
        self.rho *= np.where(success, 1.0 / contraction, contraction)
        anew = (self.contractions < 0) | (self.contractions > limit)
        self.contractions[anew] = 0
        self.rho[anew] = rho
