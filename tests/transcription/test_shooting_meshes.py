"""Multiple shooting on intervals of any lengths."""

from __future__ import annotations

import numpy as np
import pytest
from cases import candidates, oscillator, oscillator_rates, propagated, slot
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from macs import optimize
from problems import Problem, load
from transcription import MultipleShooting
from transcription.shooting.runge_kutta import TABLEAUX
from transcription.trajectories.simulate import simulate

EDGES = (0.0, 0.1, 0.15, 0.4, 0.5, 0.9, 1.0)
KINDS = [("constant", None), ("linear", 10), ("spline", 4)]


def image(places: np.ndarray, edges=EDGES) -> np.ndarray:
    """Where places on equal intervals lie on those between edges."""
    return np.interp(places, np.linspace(0, 1, len(edges)), edges)


def law(kind: str, times: np.ndarray, values: np.ndarray):
    """A control as scipy has it, by values at times, or between them."""
    if kind == "constant":
        return lambda t: values[np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(values) - 1)]
    return CubicSpline(times, values) if kind == "spline" else lambda t: np.interp(t, times, values)


def values_of(nlp, z: np.ndarray, name: str) -> np.ndarray:
    return np.array([value for v, value in zip(nlp.variables, z, strict=True) if v.name.startswith(f"{name}[")])


def on(edges=EDGES, **more) -> MultipleShooting:
    return MultipleShooting(3, mesh={"swing": (edges, TABLEAUX[more.get("scheme", "rk4")].order)}, **more)


# Equal intervals, and others


@pytest.mark.parametrize(("kind", "nodes"), KINDS)
@pytest.mark.parametrize("count", [6, 49])
def test_a_mesh_of_equal_intervals_is_the_same_bits(kind, nodes, count):
    more = {"control": kind, "control_nodes": nodes, "steps": 3}
    plain = MultipleShooting(count, **more).transcribe(oscillator())
    meshed = on(tuple(np.linspace(0, 1, count + 1).tolist()), **more).transcribe(oscillator())
    Z = plain.first_guess(candidates(plain, 3))
    assert [v.name for v in plain.variables] == [v.name for v in meshed.variables]
    for one, other in zip(plain.propagate_and_score(Z), meshed.propagate_and_score(Z), strict=True):
        assert np.array_equal(one, other)


@pytest.mark.parametrize(("kind", "nodes"), KINDS)
def test_a_flight_is_what_scipy_makes_of_the_same_controls(kind, nodes):
    nlp = on(scheme="rk8", steps=4, control=kind, control_nodes=nodes).transcribe(oscillator())
    for z in propagated(nlp, 2):
        t0, tf, m = (z[slot(nlp, name)] for name in ("swing.t0", "swing.tf", "m"))
        kinks = t0 + (tf - t0) * image(np.linspace(0, 1, nodes or len(EDGES)))
        u, v = (law(kind, kinks, values_of(nlp, z, name)) for name in ("swing.u", "swing.v"))
        x, cost = np.array([z[slot(nlp, "swing.x(t0)")], 0.5]), 0.0

        def rates(t, y, u=u, v=v, m=m, tf=tf):
            return [*oscillator_rates(t, y[:2], np.array([u(t), v(t)]), m, tf), u(t) ** 2 + y[0] * y[1]]

        for a, b in zip(kinks[:-1], kinks[1:] - 1e-13, strict=True):
            *x, cost = solve_ivp(rates, (a, b), [*x, cost], method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        assert z[[slot(nlp, "swing.x(tf)"), slot(nlp, "swing.y(tf)")]] == pytest.approx(x, abs=2e-9)
        assert pytest.approx([cost, -x[0]], abs=2e-9) == nlp.evaluate(z[None])[0][0]
        flight, times = nlp.unpack(z)["swing"], np.linspace(t0, tf, 200)[1:-1] + 1e-5
        assert flight.at(times)["u"] == pytest.approx(u(times), abs=1e-11)
        if nodes is None:
            assert flight.state.edges[::4] == pytest.approx(t0 + (tf - t0) * np.array(EDGES), abs=1e-12)
            assert np.diff(flight.state.edges).reshape(6, 4) == pytest.approx((tf - t0) * np.diff(EDGES)[:, None] / 4 * np.ones((6, 4)))
        assert simulate(nlp.problem, nlp.unpack(z)).max_defect < 1e-8


@pytest.mark.parametrize(("kind", "nodes"), KINDS)
def test_derivatives_of_the_reduced_problem(kind, nodes):
    nlp = on(control=kind, control_nodes=nodes, steps=2).transcribe(oscillator())
    reduced, Z = nlp.reduced, nlp.first_guess(candidates(nlp, 2, seed=4))
    A = reduced.derivatives(reduced.propagate(Z), np.arange(len(reduced.lower)))
    for k, column in enumerate(nlp.free):
        moved = [Z.copy(), Z.copy()]
        moved[0][:, column] += 1e-6
        moved[1][:, column] -= 1e-6
        slope = (reduced.propagate(moved[0]).values - reduced.propagate(moved[1]).values) / 2e-6
        assert np.allclose(A[:, :, k], slope, atol=2e-8), nlp.variables[column].name


def test_each_phase_has_a_mesh_of_its_own():
    problem = Problem("legs")
    first, second = problem.phase("first", t0=0, tf=(0.5, 1.5)), problem.phase("second", t0=(0.5, 1.5), tf=2.0)
    for phase, ends in ((first, {"initial": 0}), (second, {"final": 0})):
        phase.state("x", bounds=(-2, 3), **({"initial": 0} if phase is first else {"final": 1}))
        v, u = phase.state("v", bounds=(-5, 5), **ends), phase.control("u", bounds=(-10, 10))
        phase.dynamics(x=v, v=u)
    problem.link(first, second)
    problem.minimize("effort", first.integral(first["u"] ** 2) + second.integral(second["u"] ** 2))
    method = MultipleShooting(7, control="linear", mesh={"second": (EDGES, 4)})
    point = optimize(problem, method, starts=1)
    assert point.status == "converged" and point.verified
    assert point.objectives["effort"] == pytest.approx(1.5, abs=1e-4), "12 / 2^3, with a control that is a straight line"
    flight = point.trajectory
    assert len(flight["first"].state.edges) == 8
    assert (flight["second"].state.edges - flight["second"].t0) / (2.0 - flight["second"].t0) == pytest.approx(EDGES, abs=1e-12)


# Settings


# Steps that are too long


def lag(rate: float) -> Problem:
    """y follows a control with a lag, for 100 s."""
    problem = Problem("lag")
    phase = problem.phase("turn", t0=0, tf=100.0)
    y, u = phase.state("y", bounds=(-1, 1), initial=0), phase.control("u", bounds=(-1, 1))
    phase.dynamics(y=rate * (u - y))
    problem.maximize("far", phase.final(y))
    return problem


def test_the_longest_step_decides():
    """Of 100 equal steps of 1 s each is stable to a rate of 2.785; so are 49 half steps and a last one of 75.5 s only to 0.037."""
    even, tail = np.linspace(0, 1, 101), np.append(0.5e-2 * np.arange(50), 1.0)
    MultipleShooting(100, mesh={"turn": (tuple(even.tolist()), 4)}).transcribe(lag(2.7))
    method = MultipleShooting(100, mesh={"turn": (tuple(tail.tolist()), 4)})
    with pytest.raises(ValueError, match=r"steps of 75.5 s are too long for 'y', .*: the longest step of rk4 .* 50 in all; take steps=\d+"):
        method.transcribe(lag(1.0))
    assert not method.suits(lag(1.0).compile()) and method.suits(lag(0.03).compile())
    # Rates of 0.1: 7.55 decays in one step are multiplied by 80, which is not yet certain to be wrong.
    method.transcribe(lag(0.1))


def test_where_the_guess_is_not_the_trajectory_long_steps_may_be_right():
    """x' = u - x^3 decays quickly on the guess, from 1.5 to 1, but not at 0, where the optimum is nearly all of the time."""
    edges = tuple(np.concatenate([np.linspace(0, 0.1, 31), np.linspace(0.1, 0.9, 21)[1:], np.linspace(0.9, 1, 31)[1:]]).tolist())
    with pytest.raises(ValueError, match=r"steps of 1.667 s are too long for .x."):
        MultipleShooting(30).transcribe(load("standard/hypersensitive"))
    MultipleShooting(80, mesh={"run": (edges, 4)}).transcribe(load("standard/hypersensitive"))
