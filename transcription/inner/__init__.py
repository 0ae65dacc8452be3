"""The inner level: candidate -> nearest feasible point, status, distance moved."""

from .base import InnerResult, InnerSolver
from .levels import NAMED, Auto, Ipopt, Projection, Propagate, Whole, inner_solver
from .newton import Newton

__all__ = ["NAMED", "Auto", "InnerResult", "InnerSolver", "Ipopt", "Newton", "Projection", "Propagate", "Whole", "inner_solver"]
