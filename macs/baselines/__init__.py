"""Other multi-objective algorithms as solvers, with the same evaluations, counts and seeds: those of pymoo, and a MOPSO."""

from .moead import MOEAD
from .mopso import MOPSO
from .mopsocd import MOPSOCD
from .nsga2 import NSGA2
from .nsga3 import NSGA3

__all__ = ["MOEAD", "MOPSO", "MOPSOCD", "NSGA2", "NSGA3"]
