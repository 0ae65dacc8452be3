"""Other multi-objective algorithms as solvers, with the same evaluations, counts and seeds: those of pymoo, and a MOPSO."""

from .agemoea2 import AGEMOEA2
from .ctaea import CTAEA
from .moead import MOEAD
from .mopso import MOPSO
from .mopsocd import MOPSOCD
from .nsga2 import NSGA2
from .nsga3 import NSGA3
from .rvea import RVEA
from .smsemoa import SMSEMOA

__all__ = ["AGEMOEA2", "CTAEA", "MOEAD", "MOPSO", "MOPSOCD", "NSGA2", "NSGA3", "RVEA", "SMSEMOA"]
