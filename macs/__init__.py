"""Floor 3: the search over several objectives, and the fronts that it finds."""

from .evaluation import Evaluation, Evaluator
from .front import Front
from .gradient import optimize, payoff, sweep
from .macs import MACS
from .monitor import Progress
from .point import Point
from .solver import Solver

__all__ = ["MACS", "Evaluation", "Evaluator", "Front", "Point", "Progress", "Solver", "optimize", "payoff", "sweep"]
