"""Floor 2: from a continuous problem to numbers and back: transcriptions, the inner level, trajectories, their independent check."""

from .base import NLP, Transcription
from .catalogue import from_dict, parse
from .dfet import DFET
from .inner import InnerResult, InnerSolver
from .simulate import Simulation
from .smooth import Smooth
from .trajectory import PhaseTrajectory, PiecewisePolynomial, Trajectory

__all__ = [
    "DFET",
    "NLP",
    "InnerResult",
    "InnerSolver",
    "PhaseTrajectory",
    "PiecewisePolynomial",
    "Simulation",
    "Smooth",
    "Trajectory",
    "Transcription",
    "from_dict",
    "parse",
]
