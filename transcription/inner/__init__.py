"""The inner level: candidate -> nearest feasible point, status, distance moved."""

from .base import InnerResult, InnerSolver
from .ipopt import Ipopt
from .levels import NAMED, Auto, March, inner_solver
from .newton import Newton

__all__ = ["NAMED", "Auto", "InnerResult", "InnerSolver", "Ipopt", "March", "Newton", "inner_solver"]
