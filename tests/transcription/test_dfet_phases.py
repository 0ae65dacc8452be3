"""Phases by DFET: periodic controls, links, durations, guesses, peaks and what a trajectory shows."""

import itertools

import casadi as ca
import numpy as np
import pytest
from cases import integrator, oscillator, propagated, slot, solved

from problems import Problem
from transcription import DFET


def spinner(**bounds) -> Problem:
    problem, phase = integrator(**({"bounds": (-np.pi, np.pi), "period": 2 * np.pi} | bounds))
    phase._rates = {}
    phase.dynamics(x=ca.cos(phase["u"]))
    problem.minimize("end", phase.final(phase["x"]))
    problem.minimize("turns", phase.integral(ca.sin(phase["u"])))
    return problem


@pytest.mark.parametrize("basis", ["lobatto", "bernstein"])
def test_a_period_more_changes_nothing(basis):
    nlp = DFET(2, 3, basis=basis).transcribe(spinner())
    assert nlp.period[nlp.free] == pytest.approx(np.full(8, 2 * np.pi))
    rng = np.random.default_rng(3)
    Z = propagated(nlp, k=5)
    moved = Z.copy()
    moved[:, nlp.free] += 2 * np.pi * rng.integers(-1, 2, (5, 8))
    F, g = (np.array(v).T for v in nlp.functions(Z.T))
    G, h = (np.array(v).T for v in nlp.functions(moved.T))
    assert pytest.approx(F, abs=1e-12) == G and pytest.approx(g, abs=1e-12) == h
    rest = np.setdiff1d(np.arange(Z.shape[1]), nlp.free)
    assert nlp.propagate(moved)[:, rest] == pytest.approx(Z[:, rest], abs=1e-12)
    assert nlp.distance(Z, moved) == pytest.approx(np.zeros(5), abs=1e-12)


@pytest.mark.parametrize(
    "values", [(3.0, -3.0), (-3.0, 3.0), (np.pi / 2, -np.pi / 2), (-np.pi / 2, np.pi / 2), (0, np.pi), (-np.pi, 0), (0, 3)]
)
def test_inside_an_element_a_periodic_control_takes_the_short_way(values):
    """And the trajectory takes the same as the equations, also at half a period."""
    nlp = DFET(1, 1, basis="bernstein").transcribe(spinner())
    z = nlp.propagate(nlp.first_guess(np.array([values], dtype=float)))[0]
    phase = nlp.unpack(z)["run"]
    law = phase.control.coefficients[0, :, 0]
    assert abs(law[1] - law[0]) <= np.pi + 1e-12 and np.cos(law) == pytest.approx(np.cos(values))
    A = 0.5 * (law[0] + law[1])
    half = 0.5 * (law[1] - law[0]) / np.sqrt(3)
    assert phase.edge_states[-1, 0] == pytest.approx(np.cos(A + half) + np.cos(A - half), abs=1e-12)
    shown = phase.at(np.linspace(0, 2, 50))["u"]
    assert (shown >= -np.pi - 1e-12).all() and (shown <= np.pi + 1e-12).all()
    assert (phase["u"] >= -np.pi - 1e-12).all() and (phase["u"] <= np.pi + 1e-12).all()


def relay(legs: int, jump: float = 0.0) -> Problem:
    """x' = u one leg after the other; `drop` is lost between the legs, if at all."""
    problem = Problem("relay")
    phases = []
    for i in range(legs):
        phase = problem.phase(f"leg {i}", t0=0 if i == 0 else (0, 10), tf=(0, 10), duration=(0, 3))
        phase.state("x", bounds=(-10, 10), initial=0 if i == 0 else None)
        phase.state("m", bounds=(0, 20), initial=10 if i == 0 else None)
        u = phase.control("u", bounds=(-1, 1))
        phase.dynamics(x=u, m=-0.1)
        phases.append(phase)
    for i, (first, second) in enumerate(itertools.pairwise(phases)):
        problem.link(first, second, states=["x"] if jump else None)
        if jump:
            drop = first.final(first["m"]) - second.initial(second["m"])
            problem.constraint(f"drop {i}", drop, lower=jump, upper=jump)
    problem.minimize("time", phases[-1].tf)
    problem.maximize("way", phases[-1].final(phases[-1]["x"]))
    return problem


@pytest.mark.parametrize("legs", [1, 2, 3, 12])
def test_linked_phases_share_time_and_states(legs):
    nlp = DFET(2, 2).transcribe(relay(legs))
    assert not any(label.startswith("link") for label in nlp.g_labels)
    flight = nlp.unpack(propagated(nlp, k=1)[0])
    assert list(flight) == [f"leg {i}" for i in range(legs)] and len(flight) == legs
    for i in range(1, legs):
        before, after = flight[f"leg {i - 1}"], flight[f"leg {i}"]
        assert after.t0 == pytest.approx(before.tf, abs=1e-12)
        assert np.array_equal(after.edge_states[0], before.edge_states[-1])
    total = sum(p.control.coefficients.mean() for p in flight.values())
    assert np.isfinite(total)
    last = flight[f"leg {legs - 1}"]
    assert last.edge_states[-1, 1] == pytest.approx(10 - 0.1 * last.tf)


def test_several_phases_may_lead_into_one_declared_before_them():
    problem = Problem("meeting")
    together = problem.phase("together", t0=(0, 5), tf=6)
    x = together.state("x", bounds=(-10, 10))
    together.dynamics(x=0)
    for name, start in (("left", -1), ("right", 1)):
        phase = problem.phase(name, t0=0, tf=(1, 5))
        phase.state("x", bounds=(-10, 10), initial=start)
        phase.dynamics(x=phase.control("u", bounds=(-1, 1)))
        problem.link(phase, together)
    problem.minimize("place", together.final(x))
    nlp = DFET(2, 2).transcribe(problem)
    joined = {label for label in nlp.g_labels if label.startswith("link")}
    assert joined == {"link from 'right' to 'together': t0", "link from 'right' to 'together': x"}
    found = solved(nlp)
    assert set(found.status) == {"converged"}
    flight = nlp.unpack(found.z[0])
    assert list(flight) == ["together", "left", "right"]
    assert flight["left"].tf == pytest.approx(flight["right"].tf, abs=1e-5) == flight["together"].t0
    assert flight["left"]["x"][-1] == pytest.approx(flight["right"]["x"][-1], abs=1e-4)


def test_durations_are_rows_only_where_the_times_do_not_see_to_it():
    def labels(**times):
        problem, phase = integrator(**times)
        problem.minimize("time", phase.tf)
        return [label for label in DFET(1, 1).transcribe(problem).g_labels if "duration" in label]

    assert labels(tf=(1, 5)) == [] and labels(tf=(1, 5), duration=(2, 4)) == []
    assert labels(t0=(0, 4), tf=(1, 5)) == ["duration of 'run'"]
    assert labels(t0=(0, 4), tf=(5, 9)) == []
    assert labels(t0=(0, 4), tf=(5, 9), duration=(2, 3)) == ["duration of 'run'"]


def guessed(**values):
    problem, phase = integrator(tf=(1, 3), initial=(-1, 1), final=(2, 4))
    problem.parameter("p", bounds=(0, 4))
    problem.minimize("end", phase.final(phase["x"]))
    parameters = {k: values.pop(k) for k in list(values) if k == "p"}
    phase.guess(**values)
    problem.guess(**parameters)
    nlp = DFET(2, 3).transcribe(problem)
    return nlp, dict(zip((nlp.variables[i].name for i in nlp.free), nlp.guess, strict=True))


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
