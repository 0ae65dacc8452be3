"""Where the steps of an integrator begin and end on a phase."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SAME = 1e-9
"""Places nearer to each other than this, relative to the phase, are one."""


@dataclass(frozen=True, eq=False)
class StepMesh:
    """Where steps begin and end: `places` (N + 1,), relative to the phase; `ends` (M + 1,), which of these are ends of intervals."""

    places: np.ndarray
    ends: np.ndarray

    @classmethod
    def of(cls, intervals: int, steps: int, nodes: np.ndarray) -> StepMesh:
        """`intervals` equal ones of `steps` equal steps each; a step across one of the nodes of controls becomes two."""
        whole = np.linspace(0.0, 1.0, intervals * steps + 1)
        apart = np.abs(nodes[:, None] - whole).min(axis=1) > SAME
        places = np.sort(np.concatenate([whole, nodes[apart]]))
        return cls(places, np.searchsorted(places, whole[::steps]))

    @property
    def steps(self) -> int:
        """How many steps there are, N."""
        return len(self.places) - 1
