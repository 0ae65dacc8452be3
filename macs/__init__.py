"""Floor 3: the search over several objectives, and the fronts that it finds."""

import sys as _sys
from pathlib import Path as _Path

# The floors find each other whatever lies beside the user's script.
_sys.path.insert(0, str(_Path(__file__).parents[1]))
try:
    import transcription as _below

    _below.DFET  # noqa: B018 - it raises
except AttributeError:
    raise ImportError(f"{_below.__file__} hides the package 'transcription' of MACS: rename it, or import macs before it") from None
finally:
    _sys.path.pop(0)

from .baselines import AGEMOEA2, CTAEA, MOEAD, MOPSO, MOPSOCD, NSGA2, NSGA3, RVEA, SMSEMOA
from .evaluation.evaluator import Evaluation, Evaluator
from .front import Front
from .fronts.point import Point
from .fronts.tables import explain
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
    "explain",
    "optimize",
    "payoff",
    "sweep",
]
