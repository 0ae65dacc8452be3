from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from cases import candidates, integrator, oscillator, propagated, slot

from problems import Problem, load
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


def test_guesses_are_taken_into_narrower_ranges():
    nlp, found = guessed(x=(-5, 9))
    assert found["run.x(t0)"] == -1
    Z = nlp.first_guess(np.where(np.isnan(nlp.guess), 1.0, nlp.guess)[None])
    assert Z[0, slot(nlp, "run.x(tf)")] == 4


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


def test_a_peak_may_be_bounded_above():
    from cases import solved

    problem, phase = integrator(final=1)
    problem.constraint("gentle", phase.peak(phase["u"]), upper=0.6)
    problem.minimize("effort", phase.integral(phase["u"] ** 2))
    nlp = DFET(3, 2, basis="bernstein").transcribe(problem)
    found = solved(nlp, k=4)
    assert set(found.status) == {"converged"}
    for z in found.z:
        assert nlp.unpack(z)["run"].at(np.linspace(0, 2, 200))["u"].max() < 0.6 + 0.03


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


def test_unpacking_takes_values_back_exactly():
    nlp = DFET(2, 2).transcribe(load("goddard"))
    z = nlp.first_guess(candidates(nlp, 1))[0]
    phase = nlp.unpack(z)["ascent"]
    assert phase.tf == z[slot(nlp, "ascent.tf")]
    assert phase.control.coefficients[1, 2, 0] == z[slot(nlp, "ascent.u[1,2]")]
    assert phase.edge_states[0].tolist() == [0, 0, 0, 0] and phase.edge_states[-1, 2] == 10


@pytest.mark.slow
@pytest.mark.parametrize(("order", "control_order"), [(2, 2), (2, 5), (1, 8), (3, 6)])
def test_states_between_nodes_are_as_accurate_with_controls_of_a_higher_order(order, control_order):
    """x'' = -x from (1, 0): the error between the nodes is that of the collocation polynomial, of order l + 2, whatever the quadrature."""
    errors = []
    for elements in (4, 8):
        problem = Problem("swing")
        phase = problem.phase("swing", t0=0, tf=4)
        x, v = phase.state("x", bounds=(-2, 2), initial=1), phase.state("v", bounds=(-2, 2), initial=0)
        u = phase.control("u", bounds=(-1, 1))
        phase.dynamics(x=v, v=-x + 0 * u)
        problem.minimize("end", phase.final(x))
        nlp = DFET(elements, order, control_order=control_order).transcribe(problem)
        flight = nlp.unpack(nlp.propagate(nlp.first_guess(np.zeros((1, len(nlp.free)))))[0])["swing"]
        times = np.linspace(0, 4, 401)
        errors.append(np.abs(flight.at(times)["x"] - np.cos(times)).max())
    assert np.log2(errors[0] / errors[1]) > order + 1.3


def test_the_scale_of_a_peak_does_not_hang_on_one_point():
    """The size of exp(-h) in the middle of its box says nothing of its size: a taller box must not change the scale by orders."""
    scales = []
    for top in (10.0, 100.0):
        problem = Problem("entry")
        phase = problem.phase("fall", t0=0, tf=(1, 2))
        h = phase.state("h", bounds=(0, top), initial=5)
        phase.dynamics(h=-phase.control("sink", bounds=(0, 1)))
        problem.minimize("heat", phase.peak(ca.exp(-h)))
        nlp = DFET(2, 2).transcribe(problem)
        scales.append(next(v.scale for v in nlp.variables if "peak" in v.name))
    assert 0.5 < scales[0] <= 1.0
    assert 0.5 < scales[1] <= 1.0
