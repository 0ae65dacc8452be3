"""Whether the Hamiltonian shows which meshes do not resolve an optimum, on optima that are published."""

import numpy as np
import pytest

from macs import optimize
from macs.front import Front
from macs.fronts.points import Points
from problems import load
from problems.cases.standard import published
from transcription import DFET, Collocation, SingleShooting
from transcription.trajectories.costates import hamiltonian_variation

COARSE = DFET(4, 3, basis="bernstein")
SAID = "the Hamiltonian varies"


def solved(name: str, method=COARSE) -> tuple[Front, float]:
    """An optimum as a front, and by how much it misses the published one, in scales."""
    known = published(name)[0]
    point = optimize(load(f"standard/{name}"), method, starts=1)
    return point.alone(), abs(known.error(point.objectives[known.objective]))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["car", "rocket", "tumour"])
def test_it_is_said_where_the_optimum_is_missed(name):
    front, error = solved(name)
    assert front.verified.all() and error > 5e-4
    (line,) = (line for line in front.table().split("\n") if SAID in line)
    assert line.startswith("On the mesh of point 0 ") and line.endswith("front.refine_mesh() finds meshes that are nearer to that.")


@pytest.mark.parametrize("name", ["linear_tangent", "zermelo", "stirred_tank"])
def test_nothing_is_said_where_a_coarse_mesh_does(name):
    front, error = solved(name)
    assert front.verified.all() and error < 1e-4 and SAID not in front.table()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["car", "bryson_denham", "catalyst_mixing"])
def test_nothing_is_said_on_the_mesh_that_is_found(name):
    front, error = solved(name, None)
    assert front.verified.all() and error < 5e-4 and SAID not in front.table()


def test_only_points_of_dfet_that_miss_nothing_are_named():
    front, _ = solved("car")
    assert SAID in front.table()
    assert SAID not in front.replace(verified=np.zeros(1, dtype=bool)).table(), "it has a remedy already"
    assert SAID not in front.replace(costates=[None]).table()
    collocated, error = solved("car", Collocation(6, 3))
    assert error < 1e-6 and SAID not in collocated.table(), "it switches at an end of an interval: the mesh is exact"
    assert hamiltonian_variation(collocated.problem, collocated[0].trajectory, collocated[0].costates) > 0.05
    shot = optimize(load("standard/car"), SingleShooting(4), starts=1).alone()
    assert hamiltonian_variation(shot.problem, shot[0].trajectory, shot[0].costates) > 0.05 and SAID not in shot.table()
    several = Front.of(Points.concatenate([front, front]))
    assert "On the meshes of points 0, 1 the Hamiltonian varies by up to " in several.table()


def test_a_hamiltonian_that_need_not_be_constant_does_not_count():
    """Of a phase whose path depends on time."""
    point = optimize(load("standard/jacobson_lele"), COARSE, starts=1)
    assert np.ptp(point.hamiltonian[next(iter(point.hamiltonian))]) > 0.1
    assert hamiltonian_variation(load("standard/jacobson_lele").compile(), point.trajectory, point.costates) == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("basis", ["lobatto", "bernstein"])
@pytest.mark.parametrize("name", ["brachistochrone", "crane", "f8", "hang_glider", "jacobson", "rayleigh", "robot_arm", "stirred_tank"])
def test_what_is_said_is_true_on_all_meshes(name, basis):
    front, error = solved(name, DFET(8, 3, basis=basis))
    if front.status[0] == "converged" and SAID in front.table():
        assert error > 5e-4
