"""Floor 1: optimal control problems, stated with CasADi expressions, and a catalogue of cases."""

from .catalogue import describe, is_catalogued, load, names
from .compiled import CompiledPhase, CompiledProblem, Limit, Link, Objective, Variable
from .phase import Phase
from .problem import Problem

__all__ = [
    "CompiledPhase",
    "CompiledProblem",
    "Limit",
    "Link",
    "Objective",
    "Phase",
    "Problem",
    "Variable",
    "describe",
    "is_catalogued",
    "load",
    "names",
]
