"""Choosing a point: preferences on fronts and on the problem itself, and what a choice costs."""

from ..preferences.achievement import Nimbus, ReferencePoint, WeightedSum
from ..preferences.catalogue import from_dict, to_dict
from ..preferences.goals import Around, FuzzyGoal, FuzzySatisfactory, GoalProgramming
from ..preferences.physical import FuzzyPhysicalProgramming, PhysicalProgramming
from ..preferences.preference import Preference, Ranking
from ..preferences.preference_functions import Larger, Range, Smaller, Value
from ..preferences.ranges import Ranges
from ..preferences.stage import Stage
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
