"""Floor 3: the search over several objectives, and the fronts that it finds."""

from .baselines import MOEAD, MOPSO, MOPSOCD, NSGA2, NSGA3
from .evaluation.evaluator import Evaluation, Evaluator
from .front import Front
from .fronts.point import Point
from .gradient_tools import optimize, payoff, sweep
from .search.macs import MACS
from .solvers.progress import Progress
from .solvers.solver import Solver

__all__ = [
    "MACS",
    "MOEAD",
    "MOPSO",
    "MOPSOCD",
    "NSGA2",
    "NSGA3",
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
