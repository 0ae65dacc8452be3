"""Other multi-objective algorithms as solvers, with the same evaluations, counts and seeds: those of pymoo, and a MOPSO."""

from .algorithms import AGEMOEA2, CTAEA, MOEAD, NSGA2, NSGA3, RVEA, SMSEMOA
from .swarms import MOPSO, MOPSOCD

__all__ = ["AGEMOEA2", "CTAEA", "MOEAD", "MOPSO", "MOPSOCD", "NSGA2", "NSGA3", "RVEA", "SMSEMOA"]
