"""A minute of random problems and black boxes, and whether what judges them would see what is wrong."""

from __future__ import annotations

import numpy as np
import pytest
from fuzzing import Finding, _check_flown, attempt_box, attempt_flight
from random_flights import random_flight
from random_terms import numeric, random_term, symbolic

import casadi as ca
from macs import MACS

FLYING = 7
"""Seed of a problem that has verified points."""


def test_terms_mean_the_same_to_both():
    rng = np.random.default_rng(0)
    for _ in range(200):
        term, values = random_term(rng, ["a", "b"], 3, 0.3), {"a": float(rng.normal()), "b": float(rng.normal())}
        symbols = {name: ca.MX.sym(name) for name in values}
        found = float(ca.Function("f", list(symbols.values()), [ca.MX(symbolic(term, symbols))])(*values.values()))
        ours = numeric(term, values)
        assert found == pytest.approx(ours, rel=1e-12, abs=1e-300) or not np.isfinite([found, ours]).any()


@pytest.mark.slow
def test_random_problems_have_true_points_or_clear_errors():
    assert "verified points" in {attempt_flight(seed) for seed in range(30)}


@pytest.mark.slow
def test_random_black_boxes_have_true_points_or_clear_errors():
    assert {"points", "refused"} <= {attempt_box(seed) for seed in range(200)}
