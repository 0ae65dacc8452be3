"""DFET on elements of any lengths, each phase with its own."""

from __future__ import annotations

import numpy as np
import pytest
from cases import oscillator, propagated
from gauss import integrate
from test_dfet import rates_of

from problems import Problem
from transcription import DFET

UNEVEN = (0.0, 0.1, 0.35, 0.9, 1.0)


def two_phases() -> Problem:
    problem = Problem("two")
    one, two = problem.phase("one", t0=0, tf=1), problem.phase("two", t0=1, tf=3)
    x = one.state("x", bounds=(-5, 5), initial=1)
    y = two.state("x", bounds=(-5, 5))
    one.dynamics(x=-x)
    two.dynamics(x=-2 * y)
    problem.link(one, two)
    problem.minimize("end", two.final(y))
    return problem


@pytest.mark.parametrize("basis", ["lobatto", "bernstein"])
@pytest.mark.parametrize("order", [0, 1, 4])
def test_uneven_elements_are_the_gauss_method_too(basis, order):
    nlp = DFET(1, 1, basis=basis, mesh={"swing": (UNEVEN, order)}).transcribe(oscillator())
    for z, worst in zip(propagated(nlp, k=2), nlp.evaluate(propagated(nlp, k=2))[1], strict=True):
        flight = nlp.unpack(z)
        phase = flight["swing"]
        assert np.allclose((phase.state.edges - phase.t0) / (phase.tf - phase.t0), UNEVEN, atol=1e-15)
        edges, _ = integrate(rates_of(flight, flight.parameters["m"]), phase.states[0], phase.state.edges, order + 1)
        assert np.abs(phase.edge_states - edges).max() < 1e-12 * max(1, np.abs(edges).max())
        assert worst < 1e-13


def test_phases_have_their_own_elements_and_orders():
    nlp = DFET(3, 2, mesh={"two": (UNEVEN, 5)}).transcribe(two_phases())
    flight = nlp.unpack(propagated(nlp, k=1)[0]) if len(nlp.free) else nlp.unpack(nlp.propagate(nlp.first_guess(np.empty((1, 0))))[0])
    assert len(flight["one"].state.edges) == 4 and flight["one"].state.coefficients.shape[1] == 5
    assert len(flight["two"].state.edges) == 5 and flight["two"].state.coefficients.shape[1] == 8
    assert flight["two"].edge_states[-1, 0] == pytest.approx(np.exp(-5.0), abs=1e-7)
