"""Functions of preferences give the same for whole numbers, numbers of numpy, arrays, and symbols of CasADi."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest

from macs.preferences.stage import clipped, exp, greatest, least, log10

ALL: dict[str, tuple[Callable[[Any], Any], Callable[[float], float]]] = {
    "exp": (exp, math.exp),
    "log10": (log10, math.log10),
    "greatest": (lambda x: greatest(x, 2.0), lambda x: max(x, 2.0)),
    "least": (lambda x: least(x, 2.0), lambda x: min(x, 2.0)),
    "clipped": (lambda x: clipped(x, 1.5, 3.0), lambda x: min(max(x, 1.5), 3.0)),
}


@pytest.mark.filterwarnings("error")  # CasADi warns of numpy's functions on its symbols
@pytest.mark.parametrize("name", ALL)
def test_all_operands_give_the_same(name: str) -> None:
    function, expected = ALL[name]
    for x in (0.25, 1.0, 2.0, 2.5, 10.0):
        for operand in (x, np.float64(x), np.array([x]), np.float32(x)):
            assert np.ravel(function(operand)) == pytest.approx([expected(x)], rel=1e-6)
        if x == int(x):
            assert function(int(x)) == pytest.approx(expected(x))
        for kind in (ca.SX, ca.MX):
            symbol = kind.sym("x")
            assert float(ca.Function("f", [symbol], [function(symbol)])(x)) == pytest.approx(expected(x))


def test_arrays_are_taken_element_by_element() -> None:
    x = np.array([[0.0, 2.0], [4.0, np.inf]])
    assert clipped(x, 1.0, 3.0).tolist() == [[1.0, 2.0], [3.0, 3.0]]
    assert greatest(np.array([np.nan, 1.0]), 0.0).tolist() == [0.0, 1.0], "what is no number counts as nothing"
