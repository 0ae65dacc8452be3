"""Floor 2: from a continuous problem to an NLP and back: transcriptions, the inner level, trajectories, their simulation."""

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
