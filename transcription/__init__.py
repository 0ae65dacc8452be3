"""Floor 2: from a continuous problem to an NLP and back: transcriptions, the inner level, trajectories, their simulation."""

import sys as _sys
from pathlib import Path as _Path

# The floors find each other whatever lies beside the user's script.
_sys.path.insert(0, str(_Path(__file__).parents[1]))
try:
    import problems as _below

    _below.CompiledVectorProblem  # noqa: B018 - it raises
except AttributeError:
    raise ImportError(f"{_below.__file__} hides the package 'problems' of MACS: rename it, or import macs before it") from None
finally:
    _sys.path.pop(0)

from .base import NLP, Transcription
from .catalogue import from_dict, parse, stated, word
from .elements.collocation import Collocation
from .elements.dfet import DFET
from .inner import InnerResult, InnerSolver
from .meshed import Meshed
from .shooting.method import MultipleShooting, SingleShooting
from .smooth import Smooth
from .trajectories.simulate import Simulation
from .trajectories.trajectory import PhaseTrajectory, PiecewisePolynomial, Trajectory

__all__ = [
    "DFET",
    "NLP",
    "Collocation",
    "InnerResult",
    "InnerSolver",
    "Meshed",
    "MultipleShooting",
    "PhaseTrajectory",
    "PiecewisePolynomial",
    "Simulation",
    "SingleShooting",
    "Smooth",
    "Trajectory",
    "Transcription",
    "from_dict",
    "parse",
    "stated",
    "word",
]
