"""Benchmark of growth: how time and memory grow with the size of problems, meshes, fronts and populations."""

from .growth import FULL, QUICK, Effort, bench_scale, report, targets

__all__ = ["FULL", "QUICK", "Effort", "bench_scale", "report", "targets"]
