"""Vertical axes of panels: limits as dashed lines where they are near the values, and a range in which a constant looks constant."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .style import GREY

OF_SIZE, OF_BOUNDS = 1e-4, 1e-6
"""A quantity is constant if it varies by less than this part of its size, or of the span of its bounds: the latter is round-off."""
SMALL = 0.05
"""Part of the span of its bounds below which a constant is not drawn within these, unless it is zero: it could not be read."""

Limits = tuple[tuple[float, float] | None, float, float]
"""Between which places across they hold (None: all), and the lower and upper limit; infinite where there is none."""


def draw_limits(ax: Any, values: np.ndarray, limits: Sequence[Limits], reach: float = 1.0, margin: float = 0.06) -> None:
    """Set the vertical range of axes and draw dashed lines at limits in it."""
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 0.0)
    spans = [upper - lower for _, lower, upper in limits if np.isfinite(upper - lower)]
    if is_constant(low, high, max(spans, default=0.0)):
        low, high = _around(low, high, limits)
        reach = 0.0
    near = [
        (across, bound)
        for across, lower, upper in limits
        for bound in dict.fromkeys((lower, upper))
        if np.isfinite(bound) and low - reach * (high - low) <= bound <= high + reach * (high - low)
    ]
    for across, bound in near:
        look: dict[str, Any] = {"color": GREY, "lw": 0.8, "ls": (0, (5, 3)), "zorder": 1}
        if across is None:
            ax.axhline(bound, **look)
        else:
            ax.plot(across, [bound, bound], **look)
    ends = [low, high, *(bound for _, bound in near)]
    room = margin * (max(ends) - min(ends))
    ax.set_ylim(min(ends) - room, max(ends) + room)


def is_constant(low: float, high: float, span: float) -> bool:
    """Whether values between these are those of a constant whose bounds have this span (0: none)."""
    return high - low <= max(OF_SIZE * max(abs(low), abs(high)), OF_BOUNDS * span)


def _around(low: float, high: float, limits: Sequence[Limits]) -> tuple[float, float]:
    """The range in which a constant is drawn."""
    size = max(abs(low), abs(high))
    both = [(lower, upper) for _, lower, upper in limits if np.isfinite(upper - lower) and lower < upper]
    span = max((upper - lower for lower, upper in both), default=0.0)
    if both and (size >= SMALL * span or size <= OF_BOUNDS * span):
        return min(low, *(lower for lower, _ in both)), max(high, *(upper for _, upper in both))
    half = 0.1 * size or 1.0
    return low - half, high + half
