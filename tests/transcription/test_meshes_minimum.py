"""Costates, and what controls could still gain by the minimum principle: against closed forms."""

import numpy as np
import pytest

from problems import Problem
from transcription import DFET, Collocation, Meshed
from transcription.meshes.minimum import OptimumMultipliers, gains
from transcription.meshes.refinement import where_controls_gain
from transcription.meshes.verdict import Wanted, judge
from transcription.nlp.scalarized import scalarize

WANTED = Wanted(1e-6, 1e-6)


def optimum(problem: Problem, method: Meshed, goal: int = 0):
    """An optimum of one objective: NLP, trajectory, costates with multipliers, verdict; all in units of the objectives."""
    nlp = method.nlp(problem.compile())
    m = len(nlp.problem.goals)
    start = nlp.first_guess(np.full((1, len(nlp.free)), 0.1))[0]
    own = np.arange(m) == goal
    solved = scalarize(nlp, start, reference=np.where(own, 0.0, np.inf), weights=own.astype(float))
    assert solved.status == "converged"
    found = OptimumMultipliers.of(nlp, solved.z, solved.multipliers)
    trajectory = nlp.unpack(solved.z)
    return nlp, trajectory, found, judge(nlp.problem, trajectory, WANTED, solved.F, np.ones(m), found)


def rest_to_rest(scale: float = 1.0) -> Problem:
    """x'' = u from rest at 0 to rest at 1 in one second, least integral of u^2 / 2: u = 6 - 12 t."""
    problem = Problem("rest to rest")
    run = problem.phase("run", t0=0, tf=1)
    run.state("x", bounds=(-2, 2), initial=0, final=1)
    v = run.state("v", bounds=(-5, 5), initial=0, final=0)
    u = run.control("u", bounds=(-20, 20))
    run.dynamics(x=v, v=u)
    problem.minimize("effort", scale * run.integral(u**2 / 2))
    return problem


METHODS = [
    DFET(3, 3),
    DFET(3, 3, basis="bernstein"),
    Collocation(3, 4, points="gauss"),
    Collocation(3, 4),
    Collocation(3, 4, control="bernstein"),
]


@pytest.mark.parametrize("method", METHODS, ids=str)
@pytest.mark.parametrize("scale", [1.0, 250.0])
def test_costates_are_those_of_the_closed_form(method, scale):
    """H = u^2 / 2 + p v + q u: p is constant, q' = -p, u = -q; so p = -12 and q = 12 t - 6, times what multiplies the objective."""
    _, _, found, verdict = optimum(rest_to_rest(scale), method)
    times = np.linspace(0, 1, 21)
    costates = found.costates["run"](times) / found.of_objectives[0]
    assert costates[:, 0] == pytest.approx(np.full(21, -12.0 * scale), rel=1e-6)
    assert costates[:, 1] == pytest.approx(scale * (12 * times - 6), abs=1e-5 * scale)
    assert 0 <= verdict.gain < 1e-8 * scale


@pytest.mark.parametrize("method", [DFET(3, 3), Collocation(3, 4, points="gauss"), Collocation(3, 4)], ids=str)
@pytest.mark.parametrize("fraction", [0.02, 0.3])
def test_a_control_that_is_not_the_best_shows_by_what_it_loses(fraction, method):
    """With costates of the optimum, u + d has a Hamiltonian larger by d^2 / 2 everywhere: here the gain is exact, up to the values that are
    compared."""
    nlp, trajectory, found, _ = optimum(rest_to_rest(), method)
    z = nlp.interpolate(trajectory)
    controls = [i for i, v in enumerate(nlp.variables) if v.name.startswith("run.u")]
    z[controls] += 40 * fraction
    off = nlp.unpack(z)
    quantities = [np.zeros(phase.n_quantities) for phase in nlp.problem.phases]
    (gain,) = gains(nlp.problem, off, found, quantities, np.ones(1)).values()
    lost = (40 * fraction) ** 2 / 2
    assert 0.7 * lost < gain.amounts.sum() <= lost * (1 + 1e-9)
    _, _, others, _ = optimum(rest_to_rest(), DFET(5, 3))
    (same,) = gains(nlp.problem, off, others, quantities, np.ones(1)).values()
    assert same.amounts == pytest.approx(gain.amounts, rel=1e-5), "costates may have elements of their own"


def hidden_pulse(low: float, high: float) -> Problem:
    """x' = u (t - low) (t - high), least final x, |u| <= 1: u is -1, but 1 between low and high."""
    problem = Problem("hidden pulse")
    run = problem.phase("run", t0=0, tf=1)
    run.state("x", bounds=(-2, 2), initial=0)
    u = run.control("u", bounds=(-1, 1))
    run.dynamics(x=u * (run.time - low) * (run.time - high))
    problem.minimize("end", run.final(run["x"]))
    return problem


def test_what_a_mesh_is_too_coarse_for_is_seen_measured_and_found():
    low, high = 0.31, 0.37
    nlp, trajectory, _, verdict = optimum(hidden_pulse(low, high), DFET(4, 2, control_order=0))
    assert verdict.complaints() == [] and verdict.leaving == 0.0, "no simulation shows it"
    # Twice the integral of |(t - low) (t - high)| between them.
    assert verdict.gain == pytest.approx((high - low) ** 3 / 3, rel=0.05)
    finer = where_controls_gain(nlp.transcription, verdict, trajectory)
    new = sorted(set(np.round(finer.mesh_of("run").edges, 9)) - {0.0, 0.25, 0.5, 0.75, 1.0})
    assert new == pytest.approx([low, high], abs=0.25 / 24)
    _, _, _, after = optimum(hidden_pulse(low, high), finer)
    assert after.gain < 0.05 * verdict.gain


@pytest.mark.parametrize("method", [DFET(4, 3), Collocation(4, 4, points="gauss"), Collocation(4, 4)], ids=str)
def test_a_constraint_on_an_integral_has_its_share_in_the_hamiltonian(method):
    """Furthest in one second from rest with a given effort: x'' = u, integral u^2 = 3; u = 3 (1 - t), final x = 1."""
    problem = Problem("furthest")
    run = problem.phase("run", t0=0, tf=1)
    x = run.state("x", bounds=(-2, 4), initial=0)
    v = run.state("v", bounds=(-5, 5), initial=0)
    u = run.control("u", bounds=(-20, 20))
    run.dynamics(x=v, v=u)
    problem.constraint("effort", run.integral(u**2), upper=3.0)
    problem.maximize("way", run.final(x))
    _, trajectory, _, verdict = optimum(problem, method)
    assert trajectory["run"].edge_states[-1, 0] == pytest.approx(1.0, rel=1e-6)
    assert 0 <= verdict.gain < 1e-6
