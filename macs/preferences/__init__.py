"""What a person wants of the objectives: preferences that rank points, and that gradient solves minimise."""

from .achievement import Nimbus, ReferencePoint, WeightedSum
from .catalogue import from_dict, to_dict
from .goals import Around, FuzzyGoal, FuzzySatisfactory, GoalProgramming
from .physical import FuzzyPhysicalProgramming, PhysicalProgramming
from .preference import Preference, Ranking
from .preference_functions import Larger, Range, Smaller, Value
from .ranges import Ranges
from .stage import Stage

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
