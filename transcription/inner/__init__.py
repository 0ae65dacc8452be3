"""The inner level: candidate -> nearest feasible point, status, distance moved."""

from .base import InnerResult, InnerSolver
from .catalogue import NAMED, inner_solver
from .ipopt import Ipopt
from .levels import Auto
from .march import March
from .newton import Newton

__all__ = ["NAMED", "Auto", "InnerResult", "InnerSolver", "Ipopt", "March", "Newton", "inner_solver"]
