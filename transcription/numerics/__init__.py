"""Numerical kernels: arrays and CasADi Functions in, the same out."""
