"""Floor 3: the search over several objectives, and the fronts that it finds."""

from .baselines import AGEMOEA2, CTAEA, MOEAD, MOPSO, MOPSOCD, NSGA2, NSGA3, RVEA, SMSEMOA
from .evaluation.evaluator import Evaluation, Evaluator
from .front import Front
from .fronts.point import Point
from .gradient_tools import optimize, payoff, sweep
from .search.macs import MACS
from .solvers.progress import Progress
from .solvers.solver import Solver

__all__ = [
    "AGEMOEA2",
    "CTAEA",
    "MACS",
    "MOEAD",
    "MOPSO",
    "MOPSOCD",
    "NSGA2",
    "NSGA3",
    "RVEA",
    "SMSEMOA",
    "Evaluation",
    "Evaluator",
    "Front",
    "Point",
    "Progress",
    "Solver",
    "optimize",
    "payoff",
    "sweep",
]
