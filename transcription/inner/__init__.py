"""The inner level: candidate -> nearest feasible point, status, distance moved."""

from .base import InnerResult, InnerSolver
from .ipopt import Ipopt
from .levels import NAMED, Auto, Projection, Propagate, Whole, inner_solver
from .newton import Newton

__all__ = ["NAMED", "Auto", "InnerResult", "InnerSolver", "Ipopt", "Newton", "Projection", "Propagate", "Whole", "inner_solver"]
