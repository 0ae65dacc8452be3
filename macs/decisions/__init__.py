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
    from_dict,
    to_dict,
)
from .choice import Choice, Step, Turn
from .decide import decide, satisfy
from .dialogue import Dialogue
from .trade_offs import TradeOffs, front_rates, plot_rates, trade_offs

__all__ = [
    "Around",
    "Choice",
    "Dialogue",
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
    "Step",
    "TradeOffs",
    "Turn",
    "Value",
    "WeightedSum",
    "decide",
    "from_dict",
    "front_rates",
    "plot_rates",
    "satisfy",
    "to_dict",
    "trade_offs",
]
