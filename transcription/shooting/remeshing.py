"""The next intervals of a phase by shooting: where they are short by a density function, and how many of them by errors."""

from __future__ import annotations

import numpy as np

from ..meshes.density import equidistributed, integrals, raised, trajectory_density
from ..phases.mesh import PhaseMesh
from ..trajectories.trajectory import PhaseTrajectory

SHORTER = 4.0
"""A step becomes so many times shorter at most from one mesh to the next: its error says little about meshes that are much finer."""
SAFETY = 1.25
"""Steps that are too long become so many times shorter than their errors ask for."""
MORE = 1.5
"""How many times the intervals there are on a mesh that is to confirm another one."""


def next_intervals(
    old: PhaseMesh, phase: PhaseTrajectory, errors: np.ndarray, of_controls: np.ndarray, degree: int, least: float, most: int
) -> PhaseMesh:
    """The next mesh of one phase.

    As many intervals as before follow the density of the trajectory. Where errors ask for more than that, there are more. Where nothing is
    wrong, there are more everywhere. errors, of_controls (N,).
    """
    places, values = trajectory_density(phase)
    right = max(errors.max(initial=0.0), of_controls.max(initial=0.0)) <= 1.0
    count = min(max(most, old.elements), int(np.ceil(MORE * old.elements))) if right else old.elements
    curved = count * raised(places, values, least)
    # Errors of a step fall with the order and one more, those of controls of this degree twice as fast as their last coefficient.
    shorter = np.maximum(errors ** (1.0 / (old.order + 1)), of_controls ** (0.5 / max(degree, 1)))
    shorter = np.minimum(np.nan_to_num(np.where(shorter > 1.0, SAFETY * shorter, shorter), nan=SHORTER), SHORTER)
    needed = shorter / np.diff(places)
    density = np.maximum(curved, (needed * old.elements / (len(places) - 1))[:, None])
    count = max(count, min(most, int(np.ceil(integrals(places, density)[-1] - 1e-9))))
    return PhaseMesh(tuple(equidistributed(places, density, count).tolist()), old.order)
