"""DFET on elements whose edges are variables of the NLP."""

import json

import numpy as np
import pytest
from cases import integrator, oscillator, propagated, slot, total_derivatives

from macs import optimize
from problems import Problem
from transcription import DFET
from transcription.phases.mesh import PhaseMesh
from transcription.trajectories.simulate import simulate

EDGES, MOVING = (0.0, 0.1, 0.35, 0.6, 1.0), (1, 3)


def moving(basis: str = "lobatto", order: int = 3, control_order: int | None = None) -> DFET:
    return DFET(2, 2, basis=basis, mesh={"swing": (EDGES, order, control_order, MOVING)})


def test_moving_edges_are_free_variables_that_cannot_meet():
    nlp = moving().transcribe(oscillator())
    names = [nlp.variables[i].name for i in nlp.free]
    found = {name: nlp.variables[i] for i, name in zip(nlp.free, names, strict=True) if "edge" in name}
    assert list(found) == ["swing.edge[1]", "swing.edge[3]"]
    assert found["swing.edge[1]"].lower == pytest.approx(0.01) and found["swing.edge[1]"].upper == pytest.approx(0.1 + 0.45 * 0.5)
    assert found["swing.edge[3]"].lower == pytest.approx(0.6 - 0.45 * 0.5) and found["swing.edge[3]"].upper == pytest.approx(0.96)
    assert all(v.scale == v.upper - v.lower for v in found.values())
    close = PhaseMesh((0.0, 0.2, 0.4, 1.0), 1, None, (1, 2)).ranges()
    assert close == pytest.approx(np.array([[0.02, 0.29], [0.31, 0.94]]))
    assert nlp.guess[names.index("swing.edge[3]")] == 0.6
    mesh = PhaseMesh(EDGES, 3, None, MOVING)
    own = np.array([0.0, 0.2, 0.35, 0.5, 1.0])
    assert mesh.found_in(3.0 + 2.0 * own).edges == pytest.approx(own, abs=1e-12)
    assert mesh.found_in(own).ranges() != pytest.approx(mesh.ranges())
    other, beyond = own.copy(), own.copy()
    other[2], beyond[[2, 3]] = 0.4, (0.585, 0.97)
    for edges in (other, beyond, own[[0, 1, 3, 4]], 0.0 * own):
        assert mesh.found_in(edges) is mesh


@pytest.mark.slow
@pytest.mark.parametrize("basis", ["lobatto", "bernstein"])
@pytest.mark.parametrize("order", [0, 1, 4])
def test_where_the_edges_are_the_equations_are_those_of_a_mesh_with_these_edges(basis, order):
    nlp = moving(basis, order, 2).transcribe(oscillator())
    chosen = [slot(nlp, f"swing.edge[{j}]") for j in MOVING]
    for z in propagated(nlp):
        one, two = z[chosen]
        edges = np.array([0.0, one, 0.5 * (one + two), two, 1.0])
        still = DFET(2, 2, basis=basis, mesh={"swing": (edges, order, 2)}).transcribe(oscillator())
        same = np.delete(z, chosen)[None]
        assert np.abs(still.propagate(same) - same).max() < 1e-11
        for one, two in zip(nlp.evaluate(z[None]), still.evaluate(same), strict=True):
            assert np.abs(one - two).max() < 1e-12
        flight, other = nlp.unpack(z)["swing"], still.unpack(same[0])["swing"]
        assert flight.state.edges == pytest.approx(other.state.edges, abs=1e-14)
        assert flight.states == pytest.approx(other.states, abs=1e-14)


@pytest.mark.parametrize("written_out", [True, False])
@pytest.mark.parametrize("basis", ["lobatto", "bernstein"])
def test_derivatives_by_the_edges_are_those_of_differences(basis, written_out, monkeypatch):
    if not written_out:
        monkeypatch.setattr("transcription.elements.propagation.MOST_UNKNOWNS", 0)
    nlp = moving(basis).transcribe(oscillator())
    derivatives = total_derivatives(nlp, propagated(nlp, k=1))[0]
    assert np.abs(derivatives[:, [list(nlp.free).index(slot(nlp, f"swing.edge[{j}]")) for j in MOVING]]).max() > 1e-2


@pytest.mark.parametrize("basis", ["lobatto", "bernstein"])
def test_a_trajectory_comes_back_from_its_own_mesh_with_its_edges(basis):
    nlp = moving(basis).transcribe(oscillator())
    for z in propagated(nlp):
        assert np.abs((nlp.interpolate(nlp.unpack(z)) - z) / nlp.span).max() < 1e-9


def least_time() -> Problem:
    """A double integrator from rest at 0 to rest at 1 and back at -0.5, as fast as may be, with unequal bounds of the force.

    With a from 0 to t1 and -b from there, distance d takes sqrt(2 d (1/a + 1/b)), and the switch is at b / (a + b) of it.
    """
    problem = Problem("least time")
    run = problem.phase("run", t0=0, tf=(0.1, 10))
    x, v = run.state("x", bounds=(-5, 5), initial=0, final=1), run.state("v", bounds=(-5, 5), initial=0, final=0)
    run.control("u", bounds=(-1, 2))
    run.dynamics(x=v, v=run["u"])
    problem.minimize("time", run.tf)
    assert x is not None
    return problem


@pytest.mark.parametrize(("basis", "control_order"), [("lobatto", 0), ("bernstein", None)])
def test_a_switch_is_where_it_belongs(basis, control_order):
    exact, place = np.sqrt(2 * 1.5), 1 / 3
    still = optimize(least_time(), DFET(2, 2, control_order, basis=basis), starts=1)
    assert abs(still.objectives["time"] - exact) > 1e-3
    method = DFET(2, 2, basis=basis, mesh={"run": ((0, 0.5, 1), 2, control_order, (1,))})
    point = optimize(least_time(), method, starts=1)
    assert point.objectives["time"] == pytest.approx(exact, rel=1e-8)
    flight = point.trajectory["run"]
    assert flight.state.edges[1] / flight.tf == pytest.approx(place, abs=1e-8)
    assert point.simulate().max_defect < 1e-8 and not point.excursions
    assert method.settled(point.trajectory).mesh_of("run").edges[1] == pytest.approx(place, abs=1e-8)


@pytest.mark.slow
def test_a_constant_control_is_one_variable_on_its_arc():
    mesh = PhaseMesh(EDGES, 3, 2, MOVING, {"u": [1, 0], "v": (2,)})
    assert mesh.constant == (("u", (0, 1)), ("v", (2,))) and mesh.arcs.tolist() == [0, 1, 1, 2]
    assert PhaseMesh.of(json.loads(json.dumps(mesh.to_dict()))) == mesh
    assert "u constant on 2 of 3 arcs" in repr(mesh)
    for basis in ("lobatto", "bernstein"):
        nlp = DFET(2, 2, basis=basis, mesh={"swing": mesh}).transcribe(oscillator())
        names = [nlp.variables[i].name for i in nlp.free]
        assert [name for name in names if name.startswith("swing.u[")] == [
            "swing.u[arc 0]",
            "swing.u[arc 1]",
            *(f"swing.u[3,{k}]" for k in range(3)),
        ]
        assert sum(name.startswith("swing.v[") for name in names) == 1 + 3 * 3
        assert [len(profile.columns) for profile in nlp.profiles] == [5, 10]
        (z,) = propagated(nlp, k=1)
        flight = nlp.unpack(z)
        assert np.abs((nlp.interpolate(flight) - z) / nlp.span).max() < 1e-9
        control = flight["swing"].control.coefficients
        assert np.ptp(control[1:3, :, 0]) == 0 == np.ptp(control[3, :, 1]) and np.ptp(control[3, :, 0]) > 0.1
        # The same as where it is free, with the same coefficients.
        free = DFET(2, 2, basis=basis, mesh={"swing": (EDGES, 3, 2, MOVING)}).transcribe(oscillator())
        again = free.interpolate(flight)
        assert np.abs(free.evaluate(again[None])[0] - nlp.evaluate(z[None])[0]).max() < 1e-10 and free.evaluate(again[None])[1] < 1e-9
        total_derivatives(nlp, z[None])


def test_constant_controls_and_paths_and_peaks_follow_the_edges():
    problem, phase = integrator()
    phase.path("speed", phase["u"] * phase.time, upper=1.5)
    problem.minimize("peak", phase.peak(phase["x"] + phase.time))
    nlp = DFET(2, 2, mesh={"run": ((0, 0.5, 1), 2, 0, (1,))}).transcribe(problem)
    z = nlp.propagate(nlp.first_guess(np.array([[1.0, -1.0, 0.75]])))
    F, _ = nlp.evaluate(z)
    assert F[0, 0] == pytest.approx(2 * 1.5) and simulate(nlp.problem, nlp.unpack(z[0])).objectives["peak"] == pytest.approx(3.0)
    assert nlp.violations(z[0])["path 'speed' of 'run'"] == pytest.approx(0.0, abs=1e-12)
    later = nlp.propagate(nlp.first_guess(np.array([[1.0, -1.0, 0.9]])))
    assert nlp.violations(later[0])["path 'speed' of 'run'"] == pytest.approx((1.8 - 1.5) / nlp.problem.phases[0].paths[0].scale)
