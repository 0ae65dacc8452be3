"""Intervals of multiple shooting that follow the trajectory, from mesh to mesh."""

import casadi as ca
import numpy as np
import pytest

from macs import MACS, Front, optimize
from problems import Problem, load
from transcription import DFET, MultipleShooting, from_dict
from transcription.meshes.errors import state_scales
from transcription.trajectories.simulate import simulate


def refined(problem, method, **more):
    """The optimum of the first objective, and the same with its mesh refined."""
    point = optimize(problem, method, starts=1)
    assert point.status == "converged"
    return point, Front.of(point.alone()).refine_mesh(**more)[0]


def defect(problem, point) -> float:
    """The largest difference of a simulation at the ends of steps, in units of what states do: as refinement has it."""
    whole = simulate(problem.compile(), point.trajectory, rtol=1e-11, atol=1e-13).trajectory
    return max(
        float((np.abs(whole[name].edge_states - phase.edge_states) / state_scales(phase)).max()) for name, phase in point.trajectory.items()
    )


def method_of(point) -> MultipleShooting:
    return from_dict(point.transcription)


@pytest.mark.slow
def test_layers_at_equal_numbers_of_intervals():
    """The cost of the two layers is a closed form; between them nothing happens."""
    problem, method = load("standard/hypersensitive"), MultipleShooting(20, steps=7, control="linear")
    even, dense = refined(problem, method, more=False, limit=3)
    mesh = method_of(dense).mesh_of("run")
    assert mesh.elements == 20 and mesh.order == 4 and method_of(dense).intervals == 20
    lengths = np.diff(mesh.edges)
    assert max(lengths[0], lengths[-1]) < 0.3 / 20 and 2.5 / 20 < lengths.max() <= 4 / 20 + 1e-9
    assert defect(problem, dense) < 1e-4 * defect(problem, even)
    errors = [abs(point.objectives["cost"] - 1.330806904943) for point in (even, dense)]
    assert errors[1] < 0.03 * errors[0] and errors[1] < 5e-3


@pytest.mark.slow
def test_elements_of_other_methods_move_too():
    problem = load("standard/van_der_pol")
    even, dense = refined(problem, DFET(20, 2), more=False, limit=2)
    mesh = method_of(dense).mesh_of(next(iter(dense.trajectory)))
    assert (mesh.elements, mesh.order) == (20, 2) and len(set(np.round(np.diff(mesh.edges), 6))) > 10
    assert defect(problem, dense) < defect(problem, even)


@pytest.mark.slow
@pytest.mark.parametrize(("case", "tolerance", "most"), [("van_der_pol", 1e-5, 130), ("hypersensitive", 1e-5, 40)])
def test_simulations_agree_after_refinement(case, tolerance, most):
    problem = load(f"standard/{case}")
    steps = 7 if case == "hypersensitive" else 1
    even, fine = refined(problem, MultipleShooting(20, steps=steps, control="linear"), tolerance=tolerance, limit=8)
    assert fine.note == "" and defect(problem, fine) <= tolerance < 0.1 * defect(problem, even)
    mesh = method_of(fine).mesh_of(next(iter(fine.trajectory)))
    assert 20 < mesh.elements <= most and method_of(fine).control == "linear"


def test_a_finer_mesh_confirms_what_is_right():
    """Of a straight line nothing is wrong: half as many intervals again, equal ones, say the same."""
    problem = Problem("line")
    phase = problem.phase("run", t0=0, tf=2.0)
    phase.state("v", bounds=(-5, 5), initial=0, final=1)
    u = phase.control("u", bounds=(-2, 2))
    phase.dynamics(v=u)
    problem.minimize("effort", phase.integral(u**2))
    _, fine = refined(problem, MultipleShooting(4))
    mesh = method_of(fine).mesh_of("run")
    assert fine.note == "" and np.diff(mesh.edges) == pytest.approx(1 / 6, abs=5e-3)
    assert fine.objectives["effort"] == pytest.approx(0.5, abs=1e-7)


def swinging(bounds: tuple[float, float] = (-5, 5)) -> Problem:
    """A pendulum from rest to the top, quickly or with little effort."""
    problem = Problem("swing up")
    phase = problem.phase("up", t0=0, tf=(2.0, 6.0))
    x, v = phase.state("x", bounds=(-4, 7), initial=0, final=np.pi), phase.state("v", bounds=(-10, 10), initial=0, final=0)
    u = phase.control("u", bounds=bounds)
    phase.dynamics(x=v, v=u - 4 * ca.sin(x))
    problem.minimize("time", phase.tf)
    problem.minimize("effort", phase.integral(u**2))
    return problem


@pytest.mark.slow
def test_a_search_refines_the_intervals_of_its_points():
    solver = MACS(agents=3, archive=3, mesh="adaptive", mesh_tolerance=2e-2)
    front = solver.solve(swinging(), MultipleShooting(12, control="linear"), evaluations=40, seed=1)
    assert len(front) >= 2 and front.verified.all()
    counts = [method_of(point).mesh_of("up").elements for point in front]
    assert max(counts) > 12 and all(point.max_defect < 1e-3 for point in (p.simulate() for p in front))


@pytest.mark.slow
def test_without_a_transcription_the_problems_own_intervals_are_refined():
    problem = swinging()
    problem.default_transcription = "multiple-shooting:12:linear"
    point = optimize(problem, objective="effort", starts=1)
    assert point.verified and point.note == ""
    method = method_of(point)
    assert isinstance(method, MultipleShooting) and method.mesh_of("up").elements > 12


@pytest.mark.slow
def test_splines_that_leave_their_bounds_become_straight_lines():
    problem = swinging((-1.5, 1.5))
    spline = optimize(problem, MultipleShooting(16, control="spline"), objective="time", starts=1)
    fine = Front.of(spline.alone()).refine_mesh(tolerance=1e-3, limit=3)[0]
    assert spline.excursions and method_of(fine).control == "linear" and not fine.excursions
