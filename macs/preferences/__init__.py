"""What a person wants of the objectives: preferences that rank points, and that gradient solves minimise."""

from .catalogue import from_dict, to_dict
from .fuzzy_goal import FuzzyGoal
from .fuzzy_satisfactory import FuzzySatisfactory
from .goal_programming import GoalProgramming
from .nimbus import Nimbus
from .physical import FuzzyPhysicalProgramming, Larger, PhysicalProgramming, Range, Smaller, Value
from .preference import Preference
from .ranges import Ranges
from .ranking import Ranking
from .reference_point import ReferencePoint
from .stage import Stage
from .targets import Around
from .weighted_sum import WeightedSum

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
    "Value",
    "WeightedSum",
    "from_dict",
    "to_dict",
]
