"""Choosing a point: preferences on fronts and on the problem itself, and what a choice costs."""

from ..preferences import (
    Around,
    FuzzyGoal,
    FuzzyPhysicalProgramming,
    FuzzySatisfactory,
    GoalProgramming,
    Larger,
    Nimbus,
    PhysicalProgramming,
    Preference,
    Range,
    Ranges,
    Ranking,
    ReferencePoint,
    Smaller,
    Stage,
    Value,
    WeightedSum,
)
from .front_rates import front_rates, plot_rates
from .trade_offs import TradeOffs, trade_offs

__all__ = [
    "Around",
    "FuzzyGoal",
    "FuzzyPhysicalProgramming",
    "FuzzySatisfactory",
    "GoalProgramming",
    "Larger",
    "Nimbus",
    "PhysicalProgramming",
    "Preference",
    "Range",
    "Ranges",
    "Ranking",
    "ReferencePoint",
    "Smaller",
    "Stage",
    "TradeOffs",
    "Value",
    "WeightedSum",
    "front_rates",
    "plot_rates",
    "trade_offs",
]
