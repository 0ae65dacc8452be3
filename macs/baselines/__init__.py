"""The field's algorithms under the contract of this floor, on our evaluations, counters and seeds: pymoo's, asked and told, and a MOPSO."""

from .moead import MOEAD
from .mopso import MOPSO
from .mopsocd import MOPSOCD
from .nsga2 import NSGA2
from .nsga3 import NSGA3

__all__ = ["MOEAD", "MOPSO", "MOPSOCD", "NSGA2", "NSGA3"]
