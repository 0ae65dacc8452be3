"""Evaluators of plain functions, as `minimize` makes them."""

from typing import Any

from macs.evaluation.blackbox import BlackBox, plain_problem


def boxed(function: Any, bounds: Any = None, *, tolerance: float = 1e-6, **labels: Any) -> BlackBox:
    """The evaluator of a plain function or pymoo Problem."""
    return BlackBox(plain_problem(function, bounds, **labels), tolerance)
