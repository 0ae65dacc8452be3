"""Elementary functions of numbers, arrays and CasADi expressions alike, so that a kernel is written once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np


def _of(array: Callable[..., Any], expression: Callable[..., Any]) -> Callable[..., Any]:
    """Either function, by what it is called with."""

    def either(*values: Any) -> Any:
        return (expression if any(isinstance(value, ca.MX | ca.SX) for value in values) else array)(*values)

    return either


sin, cos, tan, arccos = (_of(*pair) for pair in ((np.sin, ca.sin), (np.cos, ca.cos), (np.tan, ca.tan), (np.arccos, ca.acos)))
log = _of(np.log, ca.log)
greater, lesser = _of(np.maximum, ca.fmax), _of(np.minimum, ca.fmin)
choose = _of(np.where, ca.if_else)
"""(condition, value where it holds, value elsewhere); of expressions both values are computed, so both must be finite."""


def column(values: Any) -> Any:
    """An array (n,) as (n, 1), to be combined with rows of nodes (1, k); an expression as it is."""
    return values[:, None] if isinstance(values, np.ndarray) else values
