"""What states, controls and objectives do on a trajectory: the sizes that errors are measured by.

The bounds of a variable may be any number of times as wide as what it does between them. An error that is small against the bounds may be
all of the solution.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from problems.compiled import Variable

from ..base import NLP
from ..trajectories.limits import DENSE
from ..trajectories.trajectory import PhaseTrajectory, PiecewisePolynomial

OF_SIZE, OF_SPAN = 1e-3, 1e-6
"""The range of a quantity counts as at least these parts of its size and of the span of its bounds: one that is constant has no range."""
SAMPLES = 31
"""Number of random changes of a vector by which objectives are scaled."""


def own_scales(low: np.ndarray, high: np.ndarray, span: np.ndarray) -> np.ndarray:
    """What counts as one in quantities (k,) between the values `low` and `high` of a trajectory, with bounds of these spans: their ranges
    there, with floors for those that are constant, and never more than the span."""
    size = np.maximum(np.abs(low), np.abs(high))
    return np.minimum(span, np.max([high - low, OF_SIZE * size, OF_SPAN * span], axis=0))


def _of(piece: PiecewisePolynomial, variables: Sequence[Variable]) -> np.ndarray:
    values = piece.on_elements(DENSE)
    return own_scales(values.min(axis=(0, 1)), values.max(axis=(0, 1)), np.array([v.span for v in variables]))


def state_scales(trajectory: PhaseTrajectory) -> np.ndarray:
    """What counts as one in each state (nx,) of a phase."""
    return _of(trajectory.state, trajectory.state_variables)


def control_scales(trajectory: PhaseTrajectory) -> np.ndarray:
    """What counts as one in each control (nu,) of a phase."""
    return _of(trajectory.control, trajectory.control_variables)


def objective_variations(nlp: NLP, z: np.ndarray) -> np.ndarray:
    """How much the objectives (m,) change if the entries of a vector (n,) are changed by random parts of what they do: the median.

    It is a size of objectives that does not vanish where they do, and does not depend on the width of bounds.
    """
    ranges = np.minimum(nlp.span, _ranges(nlp, z))
    rng = np.random.default_rng(0)
    changed = np.clip(z + ranges * rng.standard_normal((SAMPLES, len(z))), nlp.lower, nlp.upper)
    F, _ = nlp.evaluate(np.vstack([z, changed]))
    change = np.abs(F[1:] - F[0])
    return np.median(np.where(np.isfinite(change), change, 0.0), axis=0)


def _ranges(nlp: NLP, z: np.ndarray) -> np.ndarray:
    """The ranges (n,) of the quantities that the entries of a vector belong to: all that have the same name but for
    an index, or the end of the phase, in brackets."""
    names = np.array([re.split(r"[\[(]", v.name)[0] for v in nlp.variables])
    _, member = np.unique(names, return_inverse=True)
    low, high = np.full(member.max() + 1, np.inf), np.full(member.max() + 1, -np.inf)
    np.minimum.at(low, member, z)
    np.maximum.at(high, member, z)
    finite = np.where(np.isfinite(nlp.span), nlp.span, 1.0)
    return own_scales(low[member], high[member], finite)
