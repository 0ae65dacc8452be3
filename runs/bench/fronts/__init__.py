"""Benchmark of whole fronts: MACS until it is done against its other inner levels and against sweeps, to the same quality."""

from .contest import QUICK, Effort, bench_fronts, report, targets

__all__ = ["QUICK", "Effort", "bench_fronts", "report", "targets"]
