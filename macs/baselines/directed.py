"""Base of the baselines with reference directions."""

from __future__ import annotations

import numpy as np

from ..pareto.directions import check_directions, population_size, reference_directions
from .pymoo_adapter import Baseline


class Directed(Baseline):
    """Baseline with reference directions, and with `population` and `divisions` among its settings; for two or more objectives."""

    population: int | None
    divisions: int | None
    _one_each = False
    """Whether there must be as many individuals as directions."""

    def check_objectives(self, m: int) -> None:
        """Raise ValueError for a single objective, and for directions that do not match the population."""
        name, m = type(self).__name__, self._presented_count(m)
        check_directions(name, m, self.population, self.divisions)
        made = population_size(m, None, self.divisions)
        if self._one_each and None not in (self.population, self.divisions) and made != self.population:
            raise ValueError(
                f"{name}: divisions={self.divisions} makes {made} reference directions with {m} objectives, and population="
                f"{self.population} needs as many; leave one of the two out"
            )

    def _size(self, m: int | None) -> int | None:
        return population_size(m and self._presented_count(m), self.population, self.divisions)

    def _directions(self, m: int) -> np.ndarray:
        """Reference directions (k, m) for m objectives, as they are presented to the algorithm."""
        return reference_directions(m, self.population, self.divisions)
