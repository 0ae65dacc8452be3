"""Derivatives of an NLP, and what they say of the size of its objectives."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from .base import NLP, expanded

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
    z = ca.MX.sym("z", len(nlp.variables))
    F, g = nlp.functions(z)
    return expanded(ca.Function("gradients", [z], [ca.jacobian(F, z), ca.jacobian(g, z), F, g], ["z"], ["dF", "dg", "F", "g"]))
