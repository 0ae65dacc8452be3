"""What a person wants of the objectives: preferences that rank points, and that gradient solves minimise."""

from .preference import Preference
from .ranges import Ranges
from .ranking import Ranking
from .stage import Stage
from .weighted_sum import WeightedSum

__all__ = ["Preference", "Ranges", "Ranking", "Stage", "WeightedSum"]
