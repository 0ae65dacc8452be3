"""Benchmarks of searches on plain functions: many objectives, CEC 2009, ZDT and constraints, against the other algorithms."""

from .cases import NAMES, solvers_of
from .contest import SEEDS, Contest

__all__ = ["NAMES", "SEEDS", "Contest", "solvers_of"]
