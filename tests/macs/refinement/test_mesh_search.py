"""Meshes that are found where none is given: for a search, and for a single optimum; honest where no solve converges."""

import gc
import pickle
from itertools import pairwise
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from smooth_problems import time_against_effort

from macs import MACS, NSGA2, optimize, payoff
from macs.gradients.scalarised import GradientSolves, Scalarised
from macs.refinement.mesh_loop import LOOP, MeshLoop, OnMesh, Programs
from macs.refinement.mesh_search import (
    COARSE,
    SEARCH,
    MeshSearch,
    _together,
    default_transcription,
    guessed_elements,
    search_meshes,
    swinging_elements,
)
from problems import Problem, load
from problems.cases.standard import published
from transcription import DFET, parse
from transcription.base import NLP
from transcription.meshes.verdict import Wanted
from transcription.phases.mesh import PhaseMesh


def pulses(edges: list[float]) -> tuple[Problem, float]:
    """x' = u s(t), least final x, |u| <= 1, where s is a polynomial with these roots: u = -sign(s). The problem, and the optimum."""
    problem, s = Problem("pulses"), np.polynomial.Polynomial.fromroots(edges) * 10.0 ** (len(edges) / 2)
    run = problem.phase("run", t0=0, tf=1)
    x, u = run.state("x", bounds=(-2, 2), initial=0), run.control("u", bounds=(-1, 1))
    run.dynamics(x=u * sum(float(one) * run.time**k for k, one in enumerate(s.coef)))
    problem.minimize("end", run.final(x))
    return problem, -float(np.abs(np.diff(s.integ()(np.array([0.0, *edges, 1.0])))).sum())


def test_controls_that_a_coarse_mesh_hides_are_found_by_the_minimum_principle():
    problem, best = pulses([0.2, 0.24, 0.6, 0.65])
    found = optimize(problem, progress=False)
    assert found.verified and found.objectives["end"] == pytest.approx(best, abs=1e-6)


def layered(width: float) -> Problem:
    """A state that falls from 1 within `width` of a phase of length 1, and rises to 1 again as late, for little effort."""
    problem = Problem("layers")
    run = problem.phase("run", t0=0.0, tf=1.0)
    x = run.state("x", bounds=(-3, 3), initial=1.0)
    u = run.control("u", bounds=(-5, 5))
    run.dynamics(x=(u - x**3) / width)
    problem.minimize("cost", run.integral(0.5 * (x**2 + u**2)) / width)
    problem.minimize("miss", (run.final(x) - 1.5) ** 2)
    return problem


def test_a_problem_has_its_own_default_or_a_coarse_mesh():
    assert default_transcription(load("goddard")) == parse("dfet:4x6")
    assert default_transcription(time_against_effort()) == default_transcription(time_against_effort().compile()) == COARSE[0]


@pytest.mark.slow
def test_a_smooth_problem_keeps_the_coarse_mesh():
    found = search_meshes(time_against_effort(), 1e-3, 1e-6)
    assert found.search == COARSE[0] and found.fine is None and 2 <= found.counts.gradient_solves < 60
    assert found.ends is not None and len(found.ends) == 2


@pytest.mark.slow
def test_boundary_layers_get_short_elements():
    found = search_meshes(layered(0.01), 1e-3, 1e-6)
    assert found.search == COARSE[0] and found.fine is not None
    edges = np.array(found.fine.mesh_of("run").edges)
    assert len(edges) - 1 <= SEARCH.elements
    lengths = np.diff(edges)
    assert lengths[0] < 0.03 and lengths[-1] < 0.03 and lengths.max() > 0.05


@pytest.mark.slow
def test_a_search_without_a_transcription_finds_one():
    front = MACS(agents=4, archive=5).solve(layered(0.02), evaluations=200, seed=1)
    assert len(front) >= 3 and front.verified.all()
    assert front.stats["gradient_solves"] > 200 // 20, "what the mesh cost is counted"


@pytest.mark.slow
def test_a_search_begins_with_the_optima_of_single_objectives():
    """Of this arm's quickest way there are many local optima, in which searches of thousands of candidates end: 3.2 seconds and more."""
    front = MACS(agents=4).solve(load("standard/two_link_arm"), evaluations=30, seed=1)
    assert front.verified.all() and front.F.min() == pytest.approx(published("two_link_arm")[0].value, rel=5e-4)


@pytest.mark.slow
def test_a_search_keeps_the_ends_that_were_found_for_its_mesh():
    """A few evaluations lead to few points. Least effort in a time T is 12 / T^3, least time 1."""
    problem = time_against_effort()
    found = MACS(agents=4).solve(problem, evaluations=6, seed=1)
    assert found.verified.all() and found.objectives[0] == pytest.approx([1.0, 12.0], rel=1e-4)
    assert found.objectives[-1] == pytest.approx([2.0, 12 / 2**3], rel=1e-4)


def test_what_peaks_forbid_is_searched_on_the_coarse_mesh():
    problem = time_against_effort()
    problem.maximize("top speed", problem.phases["move"].peak(ca.fabs(problem.phases["move"]["v"])))
    assert search_meshes(problem, 1e-3, 1e-6).fine is None


meshes = st.lists(
    st.lists(st.integers(1, 99), min_size=0, max_size=12, unique=True).map(
        lambda inner: PhaseMesh((0.0, *(place / 100 for place in sorted(inner)), 1.0), 3)
    ),
    min_size=1,
    max_size=3,
)


@settings(max_examples=60, deadline=None)
@given(meshes)
def test_a_common_mesh_is_about_as_fine_as_each_of_several(several):
    common = np.array(_together(several).edges)
    assert len(common) - 1 <= min(SEARCH.elements, sum(mesh.elements for mesh in several))
    for begin, end in pairwise(common):
        for low, high in (element for mesh in several for element in pairwise(mesh.edges)):
            mostly = min(high, end) - max(low, begin) >= 0.5 * (high - low)
            assert not mostly or end - begin <= 2.0 * (high - low) + 0.01 or len(common) - 1 == SEARCH.elements


def test_a_common_mesh_has_a_higher_degree_than_any_and_is_thinned_evenly():
    one, two = PhaseMesh((0.0, 1.0), 3, 1), PhaseMesh((0.0, 0.5, 1.0), 5, 2)
    assert (_together([one, two]).order, _together([one, two]).control_order) == (6, 2)
    assert _together([one, PhaseMesh((0.0, 1.0), 2)]).control_order is None
    fine = PhaseMesh(tuple(np.linspace(0, 1, 101).tolist()), 3)
    lengths = np.diff(_together([fine]).edges)
    assert len(lengths) == SEARCH.elements and lengths.max() / lengths.min() < 5


@pytest.mark.slow
@pytest.mark.parametrize("budget", [None, 300])
def test_the_number_of_evaluations_has_a_default(budget):
    problem = time_against_effort()
    problem.default_evaluations = 250
    front = NSGA2(population=10).solve(problem, evaluations=budget, seed=1)
    assert front.stats["evaluations"] == (budget or 250)
    if budget is None:
        assert MACS(agents=4, archive=4).solve(problem, seed=1).stats["stopped"] == "done"


def back_to_the_side() -> Problem:
    """Dubins' car that is to go back and aside; its direction at the end is stated so that it may turn round on either side."""
    problem = Problem("back")
    drive = problem.phase("drive", t0=0.0, tf=(1.0, 30.0))
    drive.state("x", bounds=(-10, 10), initial=0, final=-3)
    drive.state("y", bounds=(-10, 10), initial=0, final=1)
    heading = drive.state("heading", bounds=(-2 * np.pi, 2 * np.pi), initial=0)
    turn = drive.control("turn", bounds=(-1, 1))
    drive.dynamics(x=ca.cos(heading), y=ca.sin(heading), heading=turn)
    problem.constraint("heading", ca.cos(drive.final(heading)), lower=1, upper=1)
    problem.minimize("length", drive.tf)
    return problem


@pytest.mark.slow
def test_other_starts_find_a_better_optimum():
    """Some starts send the car round the wrong way; the first one alone does so no longer for any of eight seeds."""
    record = published("dubins")[0]
    alone, best = optimize(back_to_the_side(), starts=1, seed=1), optimize(back_to_the_side())
    assert best.verified and record.met(best.simulated["length"])
    stats = best.alone().stats
    assert stats["starts"] > stats["found"] >= 1 and stats["optima"] >= 2
    assert alone.alone().stats["starts"] == 1


@pytest.mark.slow
def test_what_no_solve_reached_is_not_called_converged():
    """A way of 2 in a time of 1 at a speed of 1, missed by hardly more than the tolerance of feasibility, is still no optimum."""
    problem = Problem("too far")
    trip = problem.phase("trip", t0=0.0, tf=1.0)
    trip.state("x", bounds=(0, 4), initial=0, final=2)
    v = trip.control("v", bounds=(0, 1))
    trip.dynamics(x=v)
    problem.minimize("effort", trip.integral(v**2))
    point = optimize(problem, starts=2)
    assert point.status != "converged" and not point.verified and "no solve converged" in point.note


@pytest.mark.slow
def test_feasible_but_not_optimal_is_not_called_converged():
    """One iteration leaves a way feasible, and far from the least cost, which is huge elsewhere: in the scale of that nothing is left."""
    problem = Problem("detour")
    trip = problem.phase("trip", t0=0.0, tf=1.0)
    x = trip.state("x", bounds=(-9, 9), initial=0)
    v = trip.control("v", bounds=(-9, 9))
    trip.dynamics(x=v)
    problem.minimize("cost", trip.integral((ca.cosh(x - 3) - 1) ** 2 + v**2))
    trip.guess(x=0, v=0)
    point = optimize(problem, starts=1, max_iterations=1)
    assert point.violation <= 1e-6 and point.status == "failed"
    assert optimize(problem, starts=1).status == "converged"


def masses(n: int) -> Problem:
    """A row of n masses on springs, pushed at one end, brought to rest: time against effort. Linear, and convex for a given time."""
    problem = Problem(f"{n} masses")
    c = problem.phase("c", t0=0, tf=(2, 40))
    x = [c.state(f"x{i}", bounds=(-5, 5), initial=float(i == 0), final=0) for i in range(n)]
    v = [c.state(f"v{i}", bounds=(-5, 5), initial=0, final=0) for i in range(n)]
    u = c.control("u", bounds=(-1, 1))
    force = [(x[i - 1] if i else 0) - x[i] + (x[i + 1] - x[i] if i < n - 1 else u) for i in range(n)]
    c.dynamics(**{f"x{i}": v[i] for i in range(n)}, **{f"v{i}": force[i] for i in range(n)})
    problem.minimize("time", c.tf)
    problem.minimize("effort", c.integral(u**2))
    return problem


@pytest.mark.slow
def test_the_least_effort_is_that_of_the_gramian_whatever_a_coarse_mesh_hides():
    """Eight cubic elements hide the longest way of two masses, and have no feasible point of eight."""
    end = payoff(masses(2), seed=1)[1]
    assert end.verified and end.objectives == pytest.approx({"time": 40.0, "effort": 0.350076}, rel=1e-3)
    many = optimize(masses(8), objective="effort", seed=1)
    assert many.verified and many.objectives["effort"] == pytest.approx(2.472585, rel=1e-4)


def test_what_one_coarse_mesh_cannot_do_is_not_called_infeasible():
    """A thrust begins below the weight, for a time that is short beside an element: least v is -0.42 m/s."""
    problem = Problem("pad")
    ballast, burn = problem.parameter("ballast", bounds=(0, 20)), problem.phase("burn", t0=0, tf=3.9)
    v = burn.state("v", bounds=(-1.0, 600), initial=0)
    burn.dynamics(v=900 * (1 + ca.tanh((burn.time - 0.1) / 0.02)) / (17 + ballast) - 9.80665)
    problem.maximize("speed", burn.final(v))
    problem.maximize("carried", ballast + 0)
    ends = payoff(problem)
    # Ends may miss what other points may: 1e-3 of the range.
    assert ends.verified.all() and ends.objectives[:, 0] == pytest.approx([364.104, 146.618], abs=1e-3 * (364.104 - 146.618))


def test_the_scale_that_an_objective_states_counts_for_its_mesh():
    """1000 and the cost of two layers, which a closed form has, in units of 1e-4."""
    problem = Problem("offset")
    f = problem.phase("f", t0=0.0, tf=40.0)
    x, u = f.state("x", bounds=(-3, 3), initial=1.5, final=1.0), f.control("u", bounds=(-6, 6))
    f.dynamics(x=-(x**3) + u)
    problem.minimize("cost", 1e3 + f.integral(0.5 * (x**2 + u**2)), scale=1e-4)
    point = payoff(problem, starts=1)[0]
    assert point.verified and point.objectives["cost"] == pytest.approx(1001.330806904943, abs=1e-6)


def searched(loop, coarse=COARSE, m=1):
    search = MeshSearch(loop, [Scalarised.single(0, m)], lambda nlp: None, 1, np.random.default_rng(0))
    search.go(coarse)
    return search.best(0)


def found_for(problem: Problem, wanted: Wanted, coarse=COARSE, most_work: float = np.inf):
    compiled = problem.compile()
    loop = MeshLoop(Programs(compiled), GradientSolves(1e-6), wanted, 8, most_work)
    return searched(loop, coarse, len(compiled.goals)), loop


PLAIN = Wanted(1e-3, 1e-3, 1e-3, 1e-3)


def oscillators(speeds: np.ndarray, pushes: np.ndarray, start: np.ndarray, duration: float) -> tuple[Problem, float]:
    """Oscillators that one force brings to rest in 0.3 to 1 of a duration; and the least effort, for the whole of it, by the Gramian of
    controllability: a longer time never takes more."""
    k, problem = len(speeds), Problem("oscillators")
    run = problem.phase("run", t0=0, tf=(0.3 * duration, duration))
    x = [run.state(f"x{i}", bounds=(-9, 9), initial=start[i], final=0) for i in range(k)]
    v = [run.state(f"v{i}", bounds=(-9, 9), initial=0, final=0) for i in range(k)]
    u = run.control("u", bounds=(-2, 2))
    rates = {f"v{i}": -(speeds[i] ** 2) * x[i] + pushes[i] * u for i in range(k)}
    run.dynamics(**{f"x{i}": v[i] for i in range(k)}, **rates)
    problem.minimize("effort", run.integral(u**2))
    problem.minimize("time", run.tf)
    # From rest backwards: the state that a push at time t makes up for is of frequencies w: (sin wt / w, -cos wt).
    t = (np.arange(20_000) + 0.5) * duration / 20_000
    columns = pushes[:, None] * np.vstack([np.sin(speeds[:, None] * t) / speeds[:, None], -np.cos(speeds[:, None] * t)]).reshape(2, k, -1)
    columns = columns.reshape(2 * k, -1)
    begun = np.append(start, 0.0 * start)
    return problem, float(begun @ np.linalg.solve(columns @ columns.T * duration / 20_000, begun))


@pytest.mark.slow
@given(st.integers(0, 10**6), st.integers(1, 4), st.floats(20.0, 40.0))
@settings(max_examples=3)
def test_the_least_effort_of_long_oscillations_is_that_of_the_gramian(seed, k, duration):
    rng = np.random.default_rng(seed)
    speeds = 0.4 + 0.5 * np.arange(k) + 0.2 * rng.random(k)
    problem, least = oscillators(speeds, rng.choice([-1, 1], k) * rng.uniform(0.5, 1.5, k), rng.uniform(-1, 1, k), duration)
    found = optimize(problem)
    assert found.status == "converged" and found.objectives["effort"] == pytest.approx(least, rel=1e-3)


def test_elements_for_oscillations_of_linear_dynamics():
    problem, _ = oscillators(np.array([0.5, 1.5]), np.ones(2), np.ones(2), 40.0)
    assert swinging_elements(problem.compile()) == np.ceil(1.5 * 40.0 / SEARCH.angle)
    assert swinging_elements(layered(0.1).compile()) == 0, "dynamics are not linear"
    problem, _ = oscillators(np.array([9.0]), np.ones(1), np.ones(1), 100.0)
    assert swinging_elements(problem.compile()) == SEARCH.elements


@pytest.mark.slow
@pytest.mark.parametrize("name", ["breakwell", "bryson_denham", "hypersensitive", "linear_tangent", "moon_landing", "catalyst_mixing"])
def test_a_mesh_is_found(name):
    value = published(name)[0]
    found, loop = found_for(load(f"standard/{name}"), PLAIN)
    assert found.good and found.note == ""
    simulated = found.refinement.best.verdict.simulation.objectives[value.objective]
    assert value.met(simulated) and loop.solves.counts.gradient_solves <= 12


@pytest.mark.slow
def test_where_one_coarse_mesh_leads_nowhere_another_is_tried():
    hopeless = DFET(1, 1, control_order=0)
    problem = load("standard/bryson_denham")
    found, _ = found_for(problem, PLAIN, (hopeless,))
    assert not found.good and found.refinement is None
    found, loop = found_for(problem, PLAIN, (hopeless, DFET(8, 3)))
    assert found.good and loop.solves.counts.failures


@pytest.mark.slow
def test_work_ends_where_it_is_to_end():
    problem, wanted = layered(0.02), Wanted(1e-6, 1e-6)
    whole, free = found_for(problem, wanted)
    part, loop = found_for(problem, wanted, most_work=0.3 * free.solves.counts.work)
    assert whole.good and not part.good and ("change" in part.note or "finer mesh" in part.note)
    assert loop.solves.counts.gradient_solves < free.solves.counts.gradient_solves
    assert loop.solves.counts.work < 0.8 * free.solves.counts.work


def test_programs_that_a_search_has_are_not_made_again():
    problem = time_against_effort().compile()
    fine, searched, programs = DFET(4, 3), DFET(2, 3), Programs(problem, there=[DFET(2, 3)])
    assert programs(fine) is programs(fine) is not fine.nlp(problem) and programs.built == len(fine.nlp(problem).variables)
    assert Programs(problem)(searched) is not searched.nlp(problem), "without a search nothing is kept for good"
    assert programs(searched) is searched.nlp(problem) and programs.built == len(fine.nlp(problem).variables)
    other = pickle.loads(pickle.dumps(programs)).apart(programs.sizes)
    assert other(fine) is not programs(fine) and other.built == programs.built, "whichever process makes a program counts nothing twice"


@pytest.mark.slow
def test_programs_of_earlier_meshes_are_not_kept():
    def alive() -> int:
        gc.collect()
        return sum(isinstance(one, NLP) for one in gc.get_objects())

    before = alive()
    found, _ = found_for(layered(0.02), Wanted(1e-6, 1e-6))
    assert len(found.refinement.meshes) >= LOOP.kept and alive() - before <= LOOP.kept + 1


@pytest.mark.parametrize(("periods", "elements"), [(1, 8), (8, 8), (16, 16), (200, SEARCH.guessed[-1])])
def test_a_guess_that_turns_often_needs_more_elements(periods, elements):
    problem = Problem("turns")
    phase = problem.phase("phase", t0=0.0, tf=1.0)
    x = phase.state("x", bounds=(-2, 2))
    phase.dynamics(x=0.0)
    problem.minimize("x", phase.final(x))
    times = np.linspace(0.0, 1.0, 1001)
    assert guessed_elements(problem.compile()) == SEARCH.guessed[0]
    phase.guess(x=(times, np.sin(2 * np.pi * periods * times)))
    assert guessed_elements(problem.compile()) == elements


def test_what_no_other_mesh_confirms_is_better_than_what_a_simulation_refutes() -> None:
    wanted = Wanted(1e-3, feasible=1e-3, objectives=1e-3)

    def error(change: float, excess: float) -> float:
        verdict = SimpleNamespace(wanted=wanted, error=excess, gain=0.0)
        return OnMesh(None, None, None, None, verdict, True, None, change=change).error  # type: ignore[arg-type]

    assert 1.0 < error(0.5e-3, 2.0) < error(np.inf, 1.0) < error(0.5e-3, 500.0)
