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
from .choice import Choice, Step
from .decide import decide
from .satisfy import satisfy

__all__ = [
    "Around",
    "Choice",
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
    "Value",
    "WeightedSum",
    "decide",
    "satisfy",
]
