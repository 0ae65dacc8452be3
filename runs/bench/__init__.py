"""Benchmarks: ratios against the alternatives, measured side by side in one run. `contract` says what a benchmark is, `command` has the
table of all."""

from .command import BENCHES, bench, header_of
from .contest import solvers_of

__all__ = ["BENCHES", "bench", "header_of", "solvers_of"]
