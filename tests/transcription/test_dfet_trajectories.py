from __future__ import annotations

import numpy as np
import pytest
from cases import candidates, integrator, oscillator, propagated, slot

from problems import Problem
from transcription import DFET

# Guesses


def guessed(**values):
    problem, phase = integrator(tf=(1, 3), initial=(-1, 1), final=(2, 4))
    problem.parameter("p", bounds=(0, 4))
    problem.minimize("end", phase.final(phase["x"]))
    parameters = {k: values.pop(k) for k in list(values) if k == "p"}
    phase.guess(**values)
    problem.guess(**parameters)
    nlp = DFET(2, 3).transcribe(problem)
    return nlp, dict(zip((nlp.variables[i].name for i in nlp.free), nlp.guess, strict=True))


def test_nothing_guessed_is_nan():
    nlp, _found = guessed()
    assert np.isnan(nlp.guess).all()
    Z = nlp.first_guess(candidates(nlp, 2))
    phase = nlp.unpack(Z[0])["run"]
    assert phase.edge_states[-1, 0] == pytest.approx(3), "middle of the final range"
    assert phase.edge_states[1, 0] == pytest.approx(0.5 * (phase.edge_states[0, 0] + 3)), "on a line"


def test_numbers_lines_and_samples_are_guesses():
    nlp, found = guessed(u=0.25, p=1, tf=2)
    assert found["run.tf"] == 2 and found["p"] == 1 and found["run.u[1,2]"] == 0.25 and np.isnan(found["run.x(t0)"])
    nlp, found = guessed(u=(-1, 1), x=(-0.5, 3.5), tf=2)
    assert found["run.x(t0)"] == -0.5
    nodes = 0.5 * (1 + np.polynomial.legendre.leggauss(4)[0])
    assert [found[f"run.u[0,{k}]"] for k in range(4)] == pytest.approx(-1 + nodes)
    assert [found[f"run.u[1,{k}]"] for k in range(4)] == pytest.approx(nodes)
    nlp, found = guessed(u=([0, 1, 3], [0, 1, 1]), x=([0, 3], [0, 3]), tf=2)
    assert [found[f"run.u[0,{k}]"] for k in range(4)] == pytest.approx(nodes), "samples are in absolute time"
    C = np.where(np.isnan(nlp.guess), 1.0, nlp.guess)[None]
    phase = nlp.unpack(nlp.first_guess(C)[0])["run"]
    assert phase.states[:, 0] == pytest.approx(phase.time, abs=1e-12)


# Peaks


def humps(tf: float = 3.0) -> tuple[Problem, object]:
    """x = sin(t) exactly enough: the peak is 1 inside, the minimum at the end."""
    problem = Problem("humps")
    phase = problem.phase("wave", t0=0, tf=tf)
    x = phase.state("x", bounds=(-5, 5), initial=0)
    y = phase.state("y", bounds=(-5, 5), initial=1)
    phase.dynamics(x=y, y=-x)
    return problem, phase


@pytest.mark.parametrize("basis", ["lobatto", "bernstein"])
def test_peaks_are_the_largest_values(basis):
    problem, phase = humps()
    problem.minimize("top", phase.peak(phase["x"]))
    problem.maximize("bottom", -phase.peak(-phase["y"]))
    problem.minimize("both", phase.peak(phase["x"]) + phase.integral(1))
    nlp = DFET(12, 4, basis=basis).transcribe(problem)
    Z = nlp.propagate(nlp.first_guess(np.empty((1, 0))))
    F, violation = nlp.evaluate(Z)
    assert F[0] == pytest.approx([1, -np.cos(3), 4], abs=1e-3) and violation[0] < 1e-12
    assert not len(nlp.free), "peaks follow"


def test_tighten_sets_peaks_and_nothing_else():
    problem, phase = integrator()
    problem.minimize("top", phase.peak(phase["u"]))
    nlp = DFET(2, 2).transcribe(problem)
    Z = propagated(nlp)
    k = slot(nlp, "run.peak[0]")
    loose = Z.copy()
    loose[:, k] += 7
    assert nlp.evaluate(loose)[1].max() < 1e-12, "a bound above the peak is no violation"
    low = Z.copy()
    low[:, k] -= 7
    assert nlp.evaluate(low)[1].min() > 1
    assert np.array_equal(nlp.tighten(loose), Z) and np.array_equal(nlp.tighten(low), Z)


# Trajectories


def test_time_increases_and_at_interpolates():
    nlp = DFET(3, 4).transcribe(oscillator())
    flight = nlp.unpack(propagated(nlp, k=1)[0])
    phase = flight["swing"]
    assert (np.diff(phase.time) > 0).all() and phase.time[0] == phase.t0 and phase.time[-1] == phase.tf
    assert set(phase.state.edges) <= set(phase.time)
    together = phase.at(phase.time)
    assert set(together) == {"x", "y", "u", "v"}
    for name in together:
        assert together[name] == pytest.approx(phase[name], abs=1e-12)
        one = phase.at(float(phase.time[3]))[name]
        assert isinstance(one, float) and one == pytest.approx(phase[name][3])
    assert phase.at(np.zeros((2, 3)) + phase.t0)["x"].shape == (2, 3)
    assert phase.at(np.array([]))["x"].shape == (0,)
    # States are continuous over the ends of elements.
    for edge in phase.state.edges[1:-1]:
        assert phase.at(edge - 1e-9)["x"] == pytest.approx(phase.at(edge)["x"], abs=1e-7)


def test_what_is_not_there_is_told():
    nlp = DFET(2, 2).transcribe(oscillator())
    flight = nlp.unpack(propagated(nlp, k=1)[0])
    phase = flight["swing"]
    with pytest.raises(KeyError, match=r"descent.*swing"):
        flight["descent"]
    with pytest.raises(KeyError, match=r"swing.*height.*x, y, u, v"):
        phase["height"]
    for time in (phase.t0 - 0.01, phase.tf + 0.01, np.nan, [phase.t0, phase.tf + 1]):
        with pytest.raises(ValueError, match="swing"):
            phase.at(time)
    phase.at([phase.t0, phase.tf])
