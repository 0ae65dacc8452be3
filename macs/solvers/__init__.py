"""Solvers of problems: their contract, the run from a seed to a front, and its checkpoints."""
