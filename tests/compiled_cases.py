"""Cases of the catalogue that are compiled once: their NLPs are kept with them, for all tests of a process that only read them."""

from functools import cache

from problems import load
from problems.compiled import CompiledProblem


@cache
def compiled(problem: str) -> CompiledProblem:
    """The case of this name."""
    return load(problem).compile()
