"""Benchmarks: ratios against the alternatives, measured side by side in one run. Inner levels in `inner`, on the batches of `cases`;
meshes by a density in `density`; transcriptions in `methods`; populations simulated in one call in `population`; searches in `search`,
batches of them in `study`; published optima in `standard`; one optimum beside other programs in `peers`."""

from .command import KINDS, SEEDED, STUDIES, bench
from .functions import solvers_of
from .page import Effort, header_of, sources

__all__ = ["KINDS", "SEEDED", "STUDIES", "Effort", "bench", "header_of", "solvers_of", "sources"]
