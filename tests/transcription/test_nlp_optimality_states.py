"""What is left in the free variables once the states follow from them: by hand, where they are sensitive, overflow, or do not follow."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags
from smooth_problems import nlp_of, still, vector

from problems import Problem
from transcription import DFET
from transcription.nlp.optimality import Conditions, Linearised, optimality, steepest

ONE = np.ones(1)


def flight(gain: float = 1.0, final: float | None = None, rate: float = 0.0) -> tuple[Problem, Any]:
    """x' = rate x + gain u in 2 time units, with u in a box of width 2."""
    problem = Problem("flight")
    run = problem.phase("run", t0=0, tf=2)
    x, u = run.state("x", bounds=(-1, 1), initial=0, final=final), run.control("u", bounds=(-1, 1))
    run.dynamics(x=rate * x + gain * u)
    return problem, run


@pytest.mark.parametrize("gain", [1e-9, 1.0, 1e8, 1e12])
def test_however_sensitive_states_are_their_total_derivative_is_left(gain: float) -> None:
    problem, run = flight(gain)
    problem.minimize("end", run.final(run["x"]))
    nlp = nlp_of(problem, DFET(1, 0))
    # x(2) = 2 gain u, by a width of 2.
    assert optimality(nlp, np.zeros(len(nlp.variables)), ONE) == pytest.approx(4 * gain, rel=1e-12)


@pytest.mark.parametrize("gain", [1e-3, 1.0, 1e8])
@pytest.mark.parametrize("u", [0.0, 0.3])
def test_an_imposed_end_takes_what_it_can(gain: float, u: float) -> None:
    problem, run = flight(gain, final=0.0)
    problem.minimize("effort", run.integral((1 + run.time) * run["u"] + run["u"] ** 2))
    nlp = nlp_of(problem, DFET(2, 0))
    z = np.zeros(len(nlp.variables))
    z[nlp.free] = u, -u
    z = nlp.propagate(z[None])[0]
    # By the controls of the halves the gradient is (3/2 + 2 u, 5/2 - 2 u); of it, the end takes the mean. Widths are 2.
    slope = 2 * np.array([1.5 + 2 * u, 2.5 - 2 * u])
    conditions = Conditions.of(nlp, z, ONE)
    assert conditions is not None
    assert conditions.reduced[:, 0] == pytest.approx(slope - slope.mean(), rel=1e-9, abs=1e-9)
    assert conditions.residual == pytest.approx(np.sqrt(2) * abs(1 - 4 * u), rel=1e-9)
    # The costate of x is that mean over the gain: what is left by the states is nothing, too.
    equations = conditions.linear.of_equations
    states = np.setdiff1d(np.arange(len(z)), nlp.free)
    adjoint = conditions.adjoints[:, 0]
    assert (equations.T @ adjoint)[states] == pytest.approx(conditions.linear.of_objectives[0, states], abs=1e-9)
    assert (equations.T @ adjoint)[nlp.free] == pytest.approx(np.full(2, slope.mean()), rel=1e-9)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("rate", [1.0, 3.0])
def test_equations_that_determine_no_states_have_no_adjoint(rate: float, size: float) -> None:
    # With one coefficient of x, its mean m, on one element: x(2) - x(0) = 2 rate m and the moment of the equation make 1 - rate a factor
    # of all that x can do; where it is 0, x is anything, and no multiplier of the equations takes its slope.
    problem, run = flight(rate=rate)
    problem.minimize("end", run.final(run["x"]))
    nlp = nlp_of(problem, DFET(1, 0))
    residual = optimality(nlp, np.zeros(len(nlp.variables)), ONE / size)
    assert residual == np.inf if rate == 1.0 else 0 < residual < 10 * size


@pytest.mark.parametrize("elements", [2, 30])
def test_where_states_are_free_too_the_rest_of_a_projection_is_left(elements: int) -> None:
    # Few equations or many, each of a free vector: of the gradient, what they span is taken away.
    problem, run = flight(rate=-0.5, final=0.0)
    problem.minimize("effort", run.integral(run["x"] + run.time * run["u"]))
    nlp = nlp_of(problem, DFET(elements, 1)).whole
    assert len(nlp.free) == len(nlp.variables)
    conditions = Conditions.of(nlp, np.zeros(len(nlp.variables)), ONE)
    assert conditions is not None
    equations, gradient = conditions.linear.of_equations.toarray(), conditions.linear.of_objectives[0]
    left = gradient - equations.T @ np.linalg.lstsq(equations.T, gradient)[0]
    assert conditions.reduced[:, 0] == pytest.approx(left, abs=1e-9) and conditions.residual == pytest.approx(np.linalg.norm(left))


def test_products_that_overflow_are_no_residual() -> None:
    # The derivatives are numbers, their product is none.
    problem, run = flight(1e200)
    problem.minimize("end", 1e200 * run.final(run["x"]))
    nlp = nlp_of(problem, DFET(1, 0))
    z = np.zeros(len(nlp.variables))
    assert Linearised.of(nlp, z, ONE) is not None
    assert Conditions.of(nlp, z, ONE) is None and optimality(nlp, z, ONE) == np.inf


@pytest.mark.parametrize("broken", ["slope of the objective", "slope of a constraint", "a constraint"])
def test_derivatives_and_values_that_are_no_numbers(broken: str) -> None:
    problem = still("broken")
    p, q = problem.parameter("p", bounds=(0, 1)), problem.parameter("q", bounds=(0, 1))
    problem.minimize("f", ca.sqrt(p) if broken == "slope of the objective" else q)
    if broken == "slope of a constraint":
        problem.constraint("c", ca.sqrt(p) + q, lower=0, scale=1)
    elif broken == "a constraint":
        problem.constraint("c", 1e308 * p + 1e308 * q, lower=0, scale=1)
    nlp = nlp_of(problem, DFET(1, 0))
    good, bad = vector(nlp, p=0.5, q=0.5), vector(nlp, p=1.0 if broken == "a constraint" else 0.0, q=1.0)
    assert Linearised.of(nlp, good, ONE) is not None and np.isfinite(optimality(nlp, good, ONE))
    assert Linearised.of(nlp, bad, ONE) is None and optimality(nlp, bad, ONE) == np.inf


# What `steepest` finds in general


@pytest.mark.parametrize("small", [1.0, 1e-3, 1e-4])
@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_the_steepest_direction_does_not_depend_on_the_size_of_equations_or_gradients(small: float, size: float) -> None:
    # On s0 + s1 = 0 with lengths 1 and 2 of s0 and s1, of the gradient (1, 0) remains s = (1, -1)/3: then (1, 0) - (1, -2)/3 = 2/3 (1, 1).
    metric, equations = diags([1.0, 2.0, 1.0]), csr_matrix([[small, small, 0.0]])
    gradients = size * np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 5.0]])
    s, multipliers = steepest(metric, equations, gradients)
    assert s / size == pytest.approx(np.array([[1 / 3, 0], [-1 / 3, 0], [0, 5]]), rel=1e-7, abs=1e-7)
    assert multipliers / size * small == pytest.approx(np.array([[2 / 3, 0]]), rel=1e-7)
