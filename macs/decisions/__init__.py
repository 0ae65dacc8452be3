"""Choosing a point: preferences on fronts and on the problem itself, and what a choice costs."""

from ..preferences import (
    Around,
    FuzzyGoal,
    FuzzySatisfactory,
    GoalProgramming,
    Nimbus,
    Preference,
    Ranges,
    Ranking,
    ReferencePoint,
    Stage,
    WeightedSum,
)
from .choice import Choice, Step
from .decide import decide
from .satisfy import satisfy

__all__ = [
    "Around",
    "Choice",
    "FuzzyGoal",
    "FuzzySatisfactory",
    "GoalProgramming",
    "Nimbus",
    "Preference",
    "Ranges",
    "Ranking",
    "ReferencePoint",
    "Stage",
    "Step",
    "WeightedSum",
    "decide",
    "satisfy",
]
