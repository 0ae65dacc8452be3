"""Floor 1: optimal control problems, stated with CasADi expressions, vector problems, and a catalogue of cases."""

from .catalogue import describe, is_catalogued, load, names
from .compiled import CompiledPhase, CompiledProblem, Limit, Link, Objective, Variable
from .externals import external
from .models import Fmu
from .phase import Phase
from .problem import Problem
from .vector import CompiledVectorProblem, VectorProblem

__all__ = [
    "CompiledPhase",
    "CompiledProblem",
    "CompiledVectorProblem",
    "Fmu",
    "Limit",
    "Link",
    "Objective",
    "Phase",
    "Problem",
    "Variable",
    "VectorProblem",
    "describe",
    "external",
    "is_catalogued",
    "load",
    "names",
]
