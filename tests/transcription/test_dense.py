"""Derivatives that would not fit into memory are refused; what needs none goes on."""

from __future__ import annotations

import pytest

from macs import MACS
from problems import load
from transcription import DFET, MultipleShooting, SingleShooting
from transcription.inner import Ipopt, Newton
from transcription.nlp import derivatives
from transcription.nlp.derivatives import gradients, hessian, objective_gradients


@pytest.fixture
def little(monkeypatch):
    """As if there were memory for few derivatives only: those of some 20 nodes."""
    monkeypatch.setattr(derivatives, "MOST_GIGABYTES", 1e-4)


def middle(nlp):
    return 0.5 * (nlp.lower + nlp.upper)[nlp.free][None]


def test_as_many_are_counted_as_there_are():
    for nodes in (50, 100, 200):
        nlp = SingleShooting(nodes).transcribe(load("goddard"))
        there = nlp.functions.jac_sparsity(1, 0).nnz()
        assert 0.8 * there < nlp.dense < 1.2 * there
    assert DFET(50, 2).transcribe(load("goddard")).dense == 0


@pytest.mark.parametrize("derive", [gradients, objective_gradients, hessian])
def test_derivatives_are_refused(little, derive):
    with pytest.raises(ValueError, match=r"'goddard', SingleShooting\(nodes=100\): .* GB, more than 0.0001 GB.* MultipleShooting"):
        derive(SingleShooting(100).transcribe(load("goddard")))
    derive(MultipleShooting(100).transcribe(load("goddard")))
    derive(SingleShooting(15).transcribe(load("goddard")))


@pytest.mark.parametrize("inner", [Newton(), Ipopt()])
def test_inner_levels_that_need_derivatives_are_refused(little, inner):
    nlp = SingleShooting(100).transcribe(load("goddard"))
    with pytest.raises(ValueError, match="inner='propagate'"):
        inner.solve(nlp, middle(nlp))


def test_a_search_that_propagates_goes_on_without(little):
    front = MACS().solve(load("goddard"), SingleShooting(100), evaluations=40, seed=1, inner="propagate")
    assert front.stats["evaluations"] == 40 and front.stats["gradient_solves"] == 0
