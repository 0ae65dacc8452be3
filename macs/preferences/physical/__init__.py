"""Physical programming: classes of objectives, their preference functions, and the fuzzy ones."""

from .classes import Larger, Range, Smaller, Value
from .fuzzy import FuzzyPhysicalProgramming
from .programming import PhysicalProgramming

__all__ = ["FuzzyPhysicalProgramming", "Larger", "PhysicalProgramming", "Range", "Smaller", "Value"]
