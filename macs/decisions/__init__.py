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
from .choice import Choice, Step
from .decide import decide
from .dialogue import Dialogue
from .front_rates import front_rates, plot_rates
from .satisfy import satisfy
from .trade_offs import TradeOffs, trade_offs
from .turn import Turn

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
