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

__all__ = [
    "Around",
    "FuzzyGoal",
    "FuzzySatisfactory",
    "GoalProgramming",
    "Nimbus",
    "Preference",
    "Ranges",
    "Ranking",
    "ReferencePoint",
    "Stage",
    "WeightedSum",
]
