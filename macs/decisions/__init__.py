"""Choosing a point: what a choice costs the other objectives."""

from .front_rates import front_rates, plot_rates
from .trade_offs import TradeOffs, trade_offs

__all__ = ["TradeOffs", "front_rates", "plot_rates", "trade_offs"]
