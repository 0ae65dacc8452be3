"""Floor 1: what is to be flown. Problems stated with CasADi expressions; a catalogue of cases."""

from .catalogue import describe, load, names
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
    "load",
    "names",
]
