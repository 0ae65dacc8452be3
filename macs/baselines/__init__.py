"""The field's algorithms under the contract of this floor: pymoo's, asked and told, on our evaluations, counters and seeds."""

from .moead import MOEAD
from .mopsocd import MOPSOCD
from .nsga2 import NSGA2
from .nsga3 import NSGA3

__all__ = ["MOEAD", "MOPSOCD", "NSGA2", "NSGA3"]
