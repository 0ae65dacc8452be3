"""Choosing a point: preferences on fronts and on the problem itself, and what a choice costs."""

from ..preferences import Preference, Ranges, Ranking, Stage, WeightedSum
from .choice import Choice, Step
from .decide import decide

__all__ = ["Choice", "Preference", "Ranges", "Ranking", "Stage", "Step", "WeightedSum", "decide"]
