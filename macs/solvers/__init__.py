"""Solvers of problems: their contract, their run from a seed to a front, and its checkpoints."""
