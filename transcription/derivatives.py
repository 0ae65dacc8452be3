"""Derivatives of an NLP, and what they say of the size of its objectives."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from .base import NLP

SAMPLES = 31
"""Where the slopes of objectives are looked at to know their scales."""


@lru_cache(maxsize=16)
def objective_scales(nlp: NLP) -> np.ndarray:
    """What counts as one in each objective (m,) as long as nobody knows the front: what it would change by, to first order, if all
    variables moved by their scales; the median over the box, 1 where that is nothing.
    """
    rng = np.random.default_rng(0)
    lower, upper = np.where(np.isfinite(nlp.lower), nlp.lower, 0.0), np.where(np.isfinite(nlp.upper), nlp.upper, nlp.scale)
    slopes = [np.array(gradients(nlp)(lower + rng.random(len(lower)) * (upper - lower))[0]) for _ in range(SAMPLES)]
    sizes = np.median(np.nan_to_num(np.abs(slopes) @ nlp.scale, posinf=0.0), axis=0)
    return np.where(sizes > 0, sizes, 1.0)


@lru_cache(maxsize=8)
def gradients(nlp: NLP) -> ca.Function:
    """z -> (dF/dz (m, n), dg/dz (r, n), both sparse)."""
    z = symbol(nlp, "z", len(nlp.variables))
    F, g = nlp.functions(z)
    return ca.Function("gradients", [z], [ca.jacobian(F, z), ca.jacobian(g, z), F, g], ["z"], ["dF", "dg", "F", "g"])


def symbol(nlp: NLP, name: str, size: int) -> Any:
    """A column of symbols of the kind that the functions of an NLP are made of: derivatives of flat lists of scalar operations are best
    made, and fastest, as such lists; a Callback allows none."""
    return (ca.SX if nlp.functions.is_a("SXFunction") else ca.MX).sym(name, size)
