"""Costates, the Hamiltonian and weights of points: along fronts, after refinement, in files and in pictures."""

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from synthetic_fronts import black_box, contents

from macs import MACS, Front, optimize, sweep
from macs.fronts.dataset import phase_dataset, root_dataset
from macs.fronts.points import Points
from problems import Problem, load
from problems.cases import goddard
from transcription import parse


@pytest.fixture(scope="module")
def ascents() -> Front:
    return sweep(load("goddard"), parse("dfet:6x6"), points=9, starts=1)


@pytest.mark.slow
def test_weights_are_the_slope_of_the_front(ascents):
    """Against the closed form of the front, by differences of its greatest speed."""
    for point in ascents[1:]:
        time = point.objectives["flight time"]
        slope = (goddard._speed(time + 1e-3) - goddard._speed(time - 1e-3)) / 2e-3
        assert point.weights["flight time"] / point.weights["horizontal speed"] == pytest.approx(slope, rel=1e-4)


def test_weights_are_the_slope_between_neighbours_and_the_hamiltonian_minus_that_of_the_time(ascents):
    """Of a front that is concave, the slope of a chord lies between those at its ends."""
    for one, other in pairwise(list(ascents[1:])):
        chord = np.divide(*(other.objectives[name] - one.objectives[name] for name in ("horizontal speed", "flight time")))
        first, last = (point.weights["flight time"] / point.weights["horizontal speed"] for point in (one, other))
        assert last < chord < first
    for point in ascents:
        assert min(point.weights.values()) >= 0 and sum(point.weights.values()) == pytest.approx(1.0)
        assert list(point.weights) == ["flight time", "horizontal speed"]
    for point in ascents[2:]:
        along = point.hamiltonian["ascent"]
        assert along.shape == point.costates["ascent"]["vy"].shape == point.trajectory["ascent"].time.shape
        assert along == pytest.approx(np.full(len(along), -point.weights["flight time"]), rel=1e-5)
    assert black_box()[0].costates is black_box()[0].weights is None
    assert all(point.costates is None for point in ascents[:2].simulate())


def test_costates_jump_where_edges_have_moved_to():
    """A ball below a ceiling at 1/9: it is there from 1/3 to 2/3 of the time, and the costate of v is -u (Bryson and Ho, 3.11). The default
    mesh has edges near these times, which moved there."""
    problem = Problem("ball")
    move = problem.phase("move", t0=0.0, tf=1.0)
    move.state("x", bounds=(-0.1, 1 / 9), initial=0, final=0)
    v = move.state("v", bounds=(-2, 2), initial=1, final=-1)
    u = move.control("u", bounds=(-20, 20))
    move.dynamics(x=v, v=u)
    problem.minimize("effort", move.integral(u**2 / 2))
    point = optimize(problem, starts=1)
    mesh, edges = point.transcription["settings"]["mesh"]["move"], point.trajectory["move"].state.edges
    assert max(abs(edges[k] - mesh["edges"][k]) for k in mesh["moving"]) > 0.05, "else this test says nothing"
    costates, flown = point.costates["move"], point.trajectory["move"]
    assert costates["v"] == pytest.approx(-flown["u"], abs=0.01 * 6)
    on = (flown.time > 0.36) & (flown.time < 0.64)
    assert on.any() and np.abs(costates["x"][on]).max() < 0.02 * 18 and costates.error < 1e-6


def test_the_optimum_of_one_objective_has_weight_one():
    """Even at the quickest ascent, where each control is on a bound and other weights would do as well."""
    point = optimize(load("goddard"), parse("dfet:6x4"), starts=1)
    assert point.weights == {"flight time": pytest.approx(1.0), "horizontal speed": 0.0}


@pytest.mark.slow
def test_points_of_a_search_have_them():
    front = MACS(agents=5, archive=5, mesh="fixed").solve(load("goddard"), parse("dfet:4x6"), evaluations=600, seed=1)
    assert all((point.costates is None) == (point.optimality > 1e-3) for point in front)
    assert sum(point.costates is not None for point in front) >= 4


def refined(name: str, **options):
    return Front.of(optimize(load(f"standard/{name}"), **options).alone()).refine_mesh()[0]


@pytest.mark.parametrize(
    ("name", "value"), [("brachistochrone", -1.0), pytest.param("hang_glider", 0.0, marks=pytest.mark.slow), ("moon_landing", 0.0)]
)
def test_the_hamiltonian_is_constant_where_nothing_depends_on_time(name, value):
    """Minus the slope of the objective in the free final time: 1 where this is the objective, else 0. To 2e-5 of the unit of time, as the
    twelve elements have it on which the time is right to 5e-8; a range of a kilometre is known to the 1e-7 of it to which the mesh was
    refined."""
    point = refined(name, starts=1)
    (along,) = point.hamiltonian.values()
    assert along == pytest.approx(np.full(len(along), value), abs=max(2e-5, 1e-7 * abs(float(point.F[0]))))


@pytest.mark.slow
def test_the_hamiltonian_of_a_launcher_is_constant_in_each_phase():
    point = refined("delta_iii", starts=1)
    for H in point.hamiltonian.values():
        assert np.ptp(H) <= 1e-5 * max(1.0, np.abs(H).max())
    assert point.hamiltonian["second stage"] == pytest.approx(0.0, abs=1e-5), "only its end is free"
    for first, second in (("six boosters", "three boosters"), ("three boosters", "first stage"), ("first stage", "second stage")):
        for name in ("x", "y", "z", "vx", "vy", "vz"):
            assert point.costates[first][name][-1] == pytest.approx(point.costates[second][name][0], rel=1e-5), "these go on"


def switching(name: str, point) -> tuple[np.ndarray, np.ndarray]:
    """dH/du and u along the one phase and the one control of a problem, both inside of the elements."""
    (phase,) = load(f"standard/{name}").compile().phases
    flown, costates = point.trajectory[phase.name], point.costates[phase.name]
    inputs = [ca.MX.sym(one, phase.dynamics.size1_in(i)) for i, one in enumerate("xuts")]
    p, w = ca.MX.sym("p", len(phase.states)), np.ones(phase.integrands.size1_out(0))
    H = ca.dot(p, phase.dynamics(*inputs)) + ca.dot(ca.DM(w), phase.integrands(*inputs))
    slope = ca.Function("slope", [*inputs, p], [ca.gradient(H, inputs[1])])
    times = flown.state.times(np.array([-0.9, -0.5, 0.0, 0.5, 0.9])).ravel()
    x, u, adjoint = flown.state(times), flown.control(times), costates.polynomial(times)
    s = np.array([flown.t0, flown.tf])
    return np.array(slope(x.T, u.T, times[None], s, adjoint.T)).ravel(), u.ravel()


@pytest.mark.slow
@pytest.mark.parametrize(("name", "switches"), [("moon_landing", 1), ("f8", 3)])
def test_switching_functions_change_sign_where_controls_do(name, switches):
    point = refined(name)
    slope, u = switching(name, point)
    high = u > 0.5 * (u.max() + u.min())
    assert (slope[high] < 0).all() and (slope[~high] > 0).all()
    assert np.count_nonzero(np.diff(high)) == switches


@pytest.mark.parametrize("name", ["rocket", "catalyst_mixing", "jacobson"])
def test_switching_functions_vanish_on_singular_arcs(name):
    slope, u = switching(name, optimize(load(f"standard/{name}"), starts=1))
    low, high = np.ptp(u) * np.array([0.01, -0.01]) + [u.min(), u.max()]
    singular = (u > low) & (u < high)
    assert singular.sum() > 10 and np.abs(slope[singular]).max() < 1e-3 * np.abs(slope).max()


def test_costates_of_a_harvest_are_those_of_its_closed_form():
    """Fish grow by x (1 - x): none are caught up to x = 1/2, then as many as grow, then all that can be. H = -1/4 gives the costate on both
    arcs without, p = (1/4 - u) / (u - x (1 - x)), and it is -1 on the singular one, as each fish in the sea is worth one caught."""
    problem = Problem("harvest")
    sea = problem.phase("sea", t0=0, tf=10)
    x, u = sea.state("x", bounds=(0.01, 2), initial=0.1, final=0.2), sea.control("u", bounds=(0, 0.5))
    sea.dynamics(x=x * (1 - x) - u)
    problem.maximize("catch", sea.integral(u))
    point = optimize(problem, starts=1)
    first, last, time = np.log(9.0), 10 - 2 * np.arctan(0.6), point.trajectory["sea"].time
    x = np.where(time < first, 1 / (1 + 9 * np.exp(-time)), 0.5 - 0.5 * np.tan(np.maximum(time - last, 0) / 2))
    u = np.where(time < first, 0.0, 0.5)
    expected = np.where((time < first) | (time > last), (0.25 - u) / (u - x * (1 - x)), -1.0)
    assert point.costates["sea"]["x"] == pytest.approx(expected, abs=1e-3)
    assert point.hamiltonian["sea"] == pytest.approx(np.full(len(time), -0.25), abs=1e-3)


def test_where_nothing_is_feasible_there_are_none():
    problem = Problem("too far")
    run = problem.phase("run", t0=0, tf=1)
    x = run.state("x", bounds=(0, 9), initial=0, final=5)
    u = run.control("u", bounds=(-1, 1))
    run.dynamics(x=u + 0 * x)
    problem.minimize("effort", run.integral(u**2))
    point = optimize(problem, parse("dfet:4x3"), starts=1)
    assert point.status != "converged" and point.costates is None and point.plot().shape == (2,)


def test_a_file_has_them(ascents, tmp_path):
    front = ascents.replace(costates=[None, *ascents.costates[1:]])
    front.save(tmp_path / "front.nc")
    loaded = Front.load(tmp_path / "front.nc")
    assert loaded[0].costates is None and loaded[0].weights is None
    assert contents(front) == contents(loaded)
    loaded[2:].save(tmp_path / "again.nc")
    assert contents(front[2:].costates) == contents(Front.load(tmp_path / "again.nc").costates)
    phase = loaded.to_xarray("ascent")
    assert phase["costate_of_vy"].dims == phase["hamiltonian"].dims == ("point", "node")
    assert phase["costate_of_vy"].attrs["long_name"] == "costate of vy" and "sum of weights" in phase.attrs["costates"]
    assert loaded.to_xarray()["weights"].dims == ("point", "objective")
    plain = ascents.replace(costates=[None] * len(ascents))
    arrays = {*root_dataset(plain).arrays, *phase_dataset(plain, "ascent").arrays}
    assert not [name for name in arrays if "costate" in name or name in ("hamiltonian", "weights")]


def test_a_state_may_be_called_hamiltonian(tmp_path):
    problem = Problem("names")
    run = problem.phase("run", t0=0, tf=1)
    x = run.state("hamiltonian", bounds=(-9, 9), initial=0, final=1)
    y = run.state("costate of x", bounds=(-9, 9), initial=0)
    u = run.control("u", bounds=(-9, 9))
    run.dynamics(**{"hamiltonian": u, "costate of x": x + 0 * y})
    problem.minimize("effort", run.integral(u**2))
    front = Front.of(optimize(problem, parse("dfet:2x3"), starts=1).alone())
    front.save(tmp_path / "front.nc")
    loaded = Front.load(tmp_path / "front.nc")
    assert contents(front) == contents(loaded)
    assert loaded.to_xarray("run")["hamiltonian"].values[0, -1] == pytest.approx(1.0)
    assert loaded.to_xarray("run")["costate_hamiltonian"].attrs["long_name"] == "Hamiltonian"


@pytest.mark.slow
def test_a_mesh_of_its_own_and_two_meshes_in_one_file(tmp_path):
    fine = optimize(load("standard/car"), starts=1).alone()
    coarse = optimize(load("standard/car"), parse("multiple-shooting:12"), starts=1).alone()
    front = Front.concatenate([fine, coarse])
    front.save(tmp_path / "front.nc")
    assert contents(Front.of(front)) == contents(Front.load(tmp_path / "front.nc"))


@pytest.mark.slow
def test_a_picture_shows_them_below(ascents):
    axes = ascents[3].plot(costates=True)
    names, units = zip(*(" ".join(ax.get_ylabel().split()).split(" [") for ax in axes[5:]), strict=True)
    assert names == ("costate of x", "costate of vx", "costate of y", "costate of vy", "Hamiltonian")
    assert units[0] == units[2] == "per km]" and units[4] == "per s]"
    axes[0].figure.draw_without_rendering()
    assert axes[5].get_position().y1 < min(ax.get_position().y0 for ax in axes[:5])
    # A costate that is zero is drawn as such, not its round-off.
    low, high = axes[5].get_ylim()
    assert high - low > 1e-5
    assert len(ascents.replace(costates=[None] * len(ascents))[3].plot(costates=True)) == 5


def test_costates_beside_a_longer_trajectory_without_any_are_saved(tmp_path):
    short = optimize(load("goddard"), parse("dfet:2x3"), objective="flight time", starts=1)
    long = optimize(load("goddard"), parse("dfet:6x3"), objective="horizontal speed", starts=1)
    both = Front.of(Points.concatenate([short.alone(), long.alone().replace(costates=[None])]))
    both.save(tmp_path / "front.nc")
    first, second = Front.load(tmp_path / "front.nc")
    assert second.costates is None and short.costates is not None and contents(first.costates) == contents(short.costates)
