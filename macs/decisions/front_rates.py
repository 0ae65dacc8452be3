"""Trade-off rates along a whole front."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..fronts.points import Points
from .trade_offs import rates

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def front_rates(front: Points) -> np.ndarray:
    """dJ_i/dJ_j (n, m, m) at all points of a front, the other objectives held, in the user's units and senses; see `TradeOffs.rate`. Not
    numbers at points without `weights`.

    Parameters
    ----------
    front : Front
        Points with their `weights`.

    Examples
    --------
    >>> from macs import sweep
    >>> from problems import load
    >>> from transcription import DFET
    >>> front = sweep(load("goddard"), DFET(6, 6, basis="bernstein"), points=3, starts=1)
    >>> from macs.decisions import front_rates
    >>> front_rates(front).shape
    (3, 2, 2)
    """
    m = len(front.goals)
    weights = [np.full(m, np.nan) if point.weights is None else np.array(list(point.weights.values())) for point in front]
    ranges = np.nan_to_num(np.ptp(front.F, axis=0)) if len(front) else np.zeros(m)
    return rates(np.array(weights).reshape(-1, m), front.signs, ranges)


def plot_rates(front: Points, figure: object = None) -> Sequence[Axes]:
    """Axes with the trade-off rates along a front. Of two objectives: the front with its slope at each point, and below the slopes, beside
    those of the chords between neighbours. Of more: for each pair, the front with its slope at each point when the others are held.

    Parameters
    ----------
    front : Points
        Those without `weights` have no slope.
    figure : matplotlib Figure, optional
        Empty figure to draw into. Default: a new one.

    Raises
    ------
    ValueError
        If there is only one objective, or no point has weights.

    Examples
    --------
    >>> from macs import sweep
    >>> from problems import load
    >>> from transcription import DFET
    >>> front = sweep(load("goddard"), DFET(6, 6, basis="bernstein"), points=3, starts=1)
    >>> from macs.decisions import plot_rates
    >>> axes = plot_rates(front)
    >>> len(axes) > 0
    True
    """
    from .trade_off_plots import draw_rates

    return draw_rates(front, front_rates(front), figure)
