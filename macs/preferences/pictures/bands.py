"""Bands behind figures: the ranges of preference, from ideal to unacceptable."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

SHADES = ("#d9efdf", "#e9f5e3", "#f9f7dc", "#fdeccf", "#fbdcc8", "#f3c9c4")
"""From ideal to unacceptable: light, so that curves and bars stand out; readers of any colour vision tell them by their order."""


def shade_ranges(ax: Any, boundaries: Sequence[float], degree: Callable[[np.ndarray], np.ndarray], ends: tuple[float, float]) -> None:
    """Shade upright bands between the boundaries of an objective by the degree in their middles."""
    edges = [ends[0], *(b for b in sorted(boundaries) if ends[0] < b < ends[1]), ends[1]]
    for low, high in pairwise(edges):
        level = float(degree(np.array([0.5 * (low + high)]))[0])
        ax.axvspan(low, high, color=SHADES[int(np.clip(np.floor(level), 0, 5))], lw=0, zorder=0)


def shade_degrees(ax: Any, top: float) -> None:
    """Shade level bands of degrees: below 1, 1 to 2, ..., beyond 5."""
    for k, shade in enumerate(SHADES):
        ax.axhspan(k, k + 1 if k < 5 else max(top, 6.0), color=shade, lw=0, zorder=0)
