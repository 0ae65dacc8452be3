"""Choosing a point: preferences on fronts and on the problem itself, and what a choice costs."""

from ..preferences import Preference, Ranges, Ranking, Stage, WeightedSum

__all__ = ["Preference", "Ranges", "Ranking", "Stage", "WeightedSum"]
