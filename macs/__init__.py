"""Floor 3: the search over several objectives, and the fronts that it finds."""

from .baselines import MOEAD, MOPSO, MOPSOCD, NSGA2, NSGA3
from .evaluation import Evaluation, Evaluator
from .front import Front
from .gradient import optimize, payoff, sweep
from .macs import MACS
from .monitor import Progress
from .point import Point
from .solver import Solver

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
