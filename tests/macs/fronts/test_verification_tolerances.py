"""Checks of points of which one number is off by a known amount: compared with which tolerance, in which scale, and in which words."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from carts import cart, points, slowed
from vector_problems import parabolas

from macs import Front
from macs.fronts import verification as module
from macs.fronts.verification import _difference, verify
from problems import Problem
from problems.compiled import Variable
from transcription import DFET
from transcription.trajectories.simulate import simulate_all

# What a simulation finds, against what is known


@pytest.mark.parametrize(("share", "good"), [(1.05, True), (0.95, False)])
def test_what_only_the_simulated_trajectory_violates_is_found(share, good):
    """The control, of values 2, 2 and 1 at Gauss points, is a parabola that exceeds its bound 2 between the first two by an eighth: by a
    sixteenth of the span of the bounds. The point is feasible at its nodes, and its states and objectives are exact."""
    front = points(cart(), [2.0, 2.0, 1.0], method=DFET(1, 2))
    (check,) = verify(front, tolerance=share * 0.0625)
    assert check.simulated == pytest.approx(0.0625, rel=1e-2) and check.violation < 1e-9 and max(check.defect, check.missed) < 1e-9
    said = f"simulated, it violates bounds of run.u by {check.simulated:.1e} (tolerance {share * 0.0625:.1e})"
    assert check.ok is good and check.reasons == (() if good else (said,))


@pytest.mark.parametrize(("share", "good"), [(0.9, True), (1.1, False)])
def test_an_end_that_a_simulation_does_not_reach_is_compared_to_the_tolerance(share, good):
    """After two seconds x, within [-5, 5], is 0.01 times `share` less than stored."""
    (check,) = verify(slowed(points(cart(of_objective=1e6), [1.0] * 4), 5e-3 * share), tolerance=1e-3)
    assert check.defect == pytest.approx(1e-3 * share, rel=1e-6)
    assert check.reasons[0].startswith("stored controls of phase 'run' differ from the decision vector by")
    assert check.reasons[1:] == (() if good else (f"simulated, it ends {check.defect:.1e} away (tolerance 1.0e-03)",))


@pytest.mark.parametrize(("share", "good"), [(0.9, True), (1.1, False)])
def test_objectives_that_a_simulation_does_not_give_are_compared_to_the_tolerance(share, good):
    """The effort 2 u^2, of scale 0.1, changes by 40 times a small part of u: so the end, of span 10, by far less than the tolerance."""
    (check,) = verify(slowed(points(cart(of_objective=0.1), [1.0] * 4), share * 1e-3 / 40.0), tolerance=1e-3)
    assert check.missed == pytest.approx(1e-3 * share, rel=1e-4) and check.defect < 2e-5
    assert check.reasons[1:] == (() if good else (f"simulated, its objectives differ by {check.missed:.1e} (tolerance 1.0e-03)",))


def test_the_integrator_is_the_one_that_is_asked_for(monkeypatch):
    asked = []
    monkeypatch.setattr(module, "simulate_all", lambda *what, **how: asked.append(how) or simulate_all(*what, **how))
    front = points(cart(), [1.0] * 4)
    verify(front, tolerance=1e-3, rtol=1e-6, atol=1e-7, method="RK45")
    verify(front, tolerance=1e-3)
    assert asked == [{"rtol": 1e-6, "atol": 1e-7, "method": "RK45"}, {"rtol": 1e-10, "atol": 1e-11, "method": "DOP853"}]


# What is stored, against what follows from the decision vector


def sled(t0: float = 0.0) -> Problem:
    """x' = u for two seconds beside a wall, with a parameter of scale 3."""
    problem = Problem("sled")
    mass = problem.parameter("mass", bounds=(1.0, 4.0))
    run = problem.phase("run", t0=t0, tf=t0 + 2.0)
    x = run.state("x", bounds=(-5, 5), initial=0)
    u = run.control("u", bounds=(0, 2))
    run.dynamics(x=u)
    run.path("wall", x, upper=5.0)
    problem.minimize("heat", mass * run.integral(u**2))
    problem.maximize("distance", run.final(x))
    return problem


@cache
def sledge() -> Front:
    """One point of it."""
    return points(sled(), [1.0] * 4 + [2.0])


def changed(front: Front, part: str, amount: float) -> Front:
    """The front, of one point, with one number of a part of its trajectory increased."""
    (trajectory,) = front.trajectories
    (phase,) = trajectory.phases
    if part == "parameters":
        return front.replace(trajectories=[replace(trajectory, parameters={"mass": trajectory.parameters["mass"] + amount})])
    owner, _, name = part.rpartition(".")
    holder = getattr(phase, owner) if owner else phase
    array = getattr(holder, name).copy()
    array.flat[-1] += amount
    altered = replace(holder, **{name: array})
    return front.replace(trajectories=[replace(trajectory, phases=(replace(phase, **{owner: altered}) if owner else altered,))])


PARTS = {
    "parameters": ("parameters", 3.0),
    "time": ("times of phase 'run'", 2.0),
    "state.edges": ("times of phase 'run'", 2.0),
    "control.edges": ("times of phase 'run'", 2.0),
    "states": ("states of phase 'run'", 10.0),
    "state.coefficients": ("states of phase 'run'", 10.0),
    "controls": ("controls of phase 'run'", 2.0),
    "control.coefficients": ("controls of phase 'run'", 2.0),
    "paths": ("path constraints of phase 'run'", 1.0),
}
"""The parts of a trajectory, their names, and their scales."""


@pytest.mark.parametrize("part", PARTS)
def test_every_part_of_a_trajectory_is_compared_in_its_scale(part):
    """One number that is off by a millionth of its scale is found; by a thousandth of a millionth it may be."""
    front, (name, scale) = sledge(), PARTS[part]
    assert verify(front, tolerance=1.0)[0].reasons == ()
    (check,) = verify(changed(front, part, 1e-6 * scale), tolerance=1.0)
    assert check.mismatch == pytest.approx(1e-6, rel=1e-3)
    assert check.reasons == (f"stored {name} differ from the decision vector by {check.mismatch:.1e}",)
    assert verify(changed(front, part, 0.9e-9 * scale), tolerance=1.0)[0].ok
    assert not verify(changed(front, part, 1.1e-9 * scale), tolerance=1.0)[0].ok


@pytest.mark.parametrize(("t0", "scale"), [(-1.0, 2.0), (-5.0, 5.0), (3.0, 5.0), (0.0, 2.0)])
def test_times_are_compared_in_the_largest_of_them_and_of_the_duration(t0, scale):
    front = points(sled(t0), [1.0] * 4 + [2.0])
    assert verify(changed(front, "time", 1e-6), tolerance=1.0)[0].mismatch == pytest.approx(1e-6 / scale, rel=1e-6)


@pytest.mark.parametrize("kind", ["state", "control"])
def test_another_basis_is_another_trajectory(kind):
    front = sledge()
    (trajectory,) = front.trajectories
    (phase,) = trajectory.phases
    other = replace(getattr(phase, kind), basis="lobatto" if getattr(phase, kind).basis != "lobatto" else "legendre")
    found = verify(front.replace(trajectories=[replace(trajectory, phases=(replace(phase, **{kind: other}),))]), tolerance=1e9)
    assert found[0].mismatch == np.inf and found[0].reasons[0].startswith("stored bases of phase 'run' differ")


def test_a_point_without_a_trajectory_fails_in_every_respect():
    (check,) = verify(sledge().replace(trajectories=[None]), tolerance=1e9)
    assert (check.mismatch, check.defect, check.simulated, check.missed) == (np.inf,) * 4
    assert (
        check.reasons[0] == "stored phases differ from the decision vector by inf" and "it violates everything by inf" in check.reasons[2]
    )


@pytest.mark.filterwarnings("ignore:invalid value")
def test_arrays_differ_by_their_largest_difference_in_scales():
    one = np.array([[1.0, 10.0], [2.0, 20.0]])
    scales = [Variable("a", 0.0, 5.0, scale=2.0), 100.0]
    assert _difference(one, one + np.array([[0.0, 0.0], [1.0, 0.0]]), scales) == pytest.approx(0.5)
    assert _difference(one, one - np.array([[0.0, 80.0], [1.0, 0.0]]), scales) == pytest.approx(0.8)
    assert _difference(one, one[:1], scales) == np.inf and _difference(np.empty((0, 2)), np.empty((0, 2)), scales) == 0.0
    odd = np.array([[np.nan, np.inf]])
    assert _difference(odd, odd, scales) == 0.0 and _difference([[np.nan, 1.0]], [[1.0, 1.0]], scales) == np.inf
    assert _difference([[1.0, 1.0]], [[1.0, np.nan]], scales) == np.inf and _difference([[np.inf, 1.0]], [[-np.inf, 1.0]], scales) == np.inf


@pytest.mark.parametrize(("share", "good"), [(0.9, True), (1.1, False)])
def test_stored_objectives_are_compared_in_their_size_and_at_least_in_one(share, good):
    """Of 2 u^2 = 4.5 and 3; of 0.02 and 0.2, which are less than one."""
    for value, size in ((1.5, 4.5), (0.1, 1.0)):
        front = points(cart(), [value] * 4)
        k = [goal.name for goal in front.goals].index("effort")
        (check,) = verify(front.replace(F=front.F + share * 1e-9 * size * np.eye(2)[[k]]), tolerance=1.0)
        assert check.objectives == pytest.approx(share * 1e-9, rel=1e-4)
        assert check.reasons == (() if good else (f"stored objectives differ from recomputed ones by {check.objectives:.1e}",))


def test_an_objective_that_is_no_number_is_infinitely_far_off():
    (check,) = verify(points(cart(), [1.0] * 4).replace(F=[[np.nan, 2.0]]), tolerance=1.0)
    assert check.objectives == check.missed == np.inf and not check.ok


@pytest.mark.parametrize(("stored", "good"), [(0.0, True), (0.9e-6, True), (1.1e-6, False), (np.nan, False)])
def test_a_stored_violation_is_compared_to_the_tolerance_of_the_search(stored, good):
    (check,) = verify(points(cart(), [1.0] * 4).replace(violation=[stored]), tolerance=1.0)
    said = f"stored violation {stored:.1e}, recomputed {check.violation:.1e}"
    assert check.reasons == (() if good else (said,))


@pytest.mark.parametrize(("share", "good"), [(0.9, True), (1.1, False)])
def test_what_the_transcription_violates_is_compared_to_the_tolerance_of_the_search(share, good):
    """A hundred times the distance is less than 200 by a millionth; simulated, it is compared to another tolerance, in another scale."""
    (check,) = verify(points(cart(lower=200.0), [1.0 - 0.5e-8 * share] * 4), tolerance=1e-3)
    assert check.violation == pytest.approx(share * 1e-6, rel=1e-4)
    assert check.reasons == (() if good else (f"violates constraint 'enough' by {check.violation:.1e} (tolerance 1e-06)",))


def test_what_did_not_converge_fails():
    front = points(cart(), [1.0] * 4, [1.5] * 4).replace(status=["converged", "infeasible"])
    assert [(check.point, check.reasons) for check in verify(front, tolerance=1.0)] == [(0, ()), (1, ("its status is 'infeasible'",))]


# Rows of vector problems


def rows(X: list[list[float]], **changes: Any) -> Front:
    """Points of `parabolas` at these rows."""
    problem, Z = parabolas().compile(), np.array(X)
    F, violations = problem.evaluate(Z)
    given = {
        "F": F, "decision": Z, "violation": violations.max(axis=1), "status": ["converged"] * len(Z), "goals": problem.goals,
        "variables": problem.variables, "problem": problem, "stats": {"tolerance": 1e-6}, "sort": False,
    }  # fmt: skip
    return Front(**given | changes)


def test_honest_rows_pass():
    checks = verify(rows([[0.0, 0.0], [1.0, 0.0]]), tolerance=1e-9)
    assert [(check.point, check.reasons) for check in checks] == [(0, ()), (1, ())]
    assert all((c.mismatch, c.violation, c.objectives, c.defect, c.simulated, c.missed) == (0.0,) * 6 for c in checks)


@pytest.mark.parametrize(("share", "good"), [(0.9, True), (1.1, False)])
def test_objectives_of_rows_are_compared_in_the_range_of_the_front(share, good):
    """Those of (0, 0) and (1, 0) are 0 and 1, and 4 and 1: ranges of 1 and 3."""
    front = rows([[0.0, 0.0], [1.0, 0.0]])
    (first, second) = verify(front.replace(F=front.F + np.array([[0.0, 3e-3 * share], [0.0, 0.0]])), tolerance=1e-3)
    scale = 3.0 + 3e-3 * share
    assert first.missed == pytest.approx(3e-3 * share / scale) and first.objectives == pytest.approx(3e-3 * share / 4.0) and second.ok
    assert first.reasons == (() if good else (f"evaluated again, its objectives differ by {first.missed:.1e} (tolerance 1.0e-03)",))


@pytest.mark.parametrize(("share", "good"), [(0.9, True), (1.1, False)])
@pytest.mark.parametrize(("tolerance", "allowed"), [(1e-3, 1e-3), (1e-9, 1e-6)])
def test_rows_may_violate_what_is_asked_for_or_what_the_search_allowed(share, good, tolerance, allowed):
    """The wall is at 1.5, and its scale is 1.5 or 1: the share is of what the problem says of a row behind it."""
    scale = (parabolas().compile().limits or ())[0].scale
    (check,) = verify(rows([[1.5 + share * allowed * scale, 0.0]]), tolerance=tolerance)
    assert check.violation == check.simulated == pytest.approx(share * allowed, rel=1e-6)
    assert check.reasons == (() if good else (f"violates wall by {check.violation:.1e} (tolerance {allowed:.0e})",))


def test_what_is_as_large_as_the_tolerance_passes():
    """Objectives of 0, 1/4 and 1, of which the middle one is off by an eighth; and a row half of a scale behind the wall."""
    front = rows([[0.0, 0.0], [0.5, 0.0], [1.0, 0.0]])
    off = front.replace(F=front.F + np.array([[0.0, 0.0], [0.125, 0.0], [0.0, 0.0]]))
    assert [check.missed for check in verify(off, tolerance=0.125)] == [0.0, 0.125, 0.0]
    assert all(check.ok for check in verify(off, tolerance=0.125)) and verify(off, tolerance=0.125)[1].objectives == 0.125
    scale = (parabolas().compile().limits or ())[0].scale
    behind = rows([[1.5 + 0.5 * scale, 0.0]])
    assert verify(behind, tolerance=0.5)[0].violation == 0.5 and verify(behind, tolerance=0.5)[0].ok
    assert verify(rows([[1.0, 0.0]], violation=[0.5]), tolerance=0.5)[0].ok


def test_the_constraint_that_is_violated_most_is_named():
    """x may be 1.5, and y 1 of a span of 2."""
    beyond = rows([[1.6, 1.5], [3.5, 1.1]], violation=[0.25, 2.0])
    first, second = (check.reasons[-1] for check in verify(beyond, tolerance=1e-3))
    assert first.startswith("violates bounds of y by 2.5e-01") and second.startswith("violates wall by")


@pytest.mark.parametrize(("stored", "good"), [(0.9e-3, True), (1.1e-3, False)])
def test_a_stored_violation_of_a_row_is_compared_too(stored, good):
    (check,) = verify(rows([[1.0, 0.0]], violation=[stored]), tolerance=1e-3)
    assert check.reasons == (() if good else (f"stored violation {stored:.1e}, evaluated again 0.0e+00",))


def test_rows_that_fail_or_are_of_another_problem_are_told():
    front = rows([[np.nan, 0.0]], F=[[1.0, 1.0]], violation=[0.0], status=["failed"])
    (check,) = verify(front, tolerance=1e-3)
    assert check.reasons[0] == "evaluated again, it fails" and "its status is 'failed'" in check.reasons
    assert check.violation == check.missed == check.objectives == np.inf
    others = [Variable("a", -4.0, 4.0), Variable("y", -1.0, 1.0)]
    with pytest.raises(ValueError, match="the variables of the front are not x, y"):
        verify(rows([[1.0, 0.0]], variables=others), tolerance=1e-3)


@pytest.mark.parametrize(("share", "good"), [(0.9, True), (1.1, False)])
def test_rows_are_marked_by_the_same_tolerances(share, good):
    """Of the range 1 of the first objective, or of the scale of the wall; the note says so."""
    front, scale = rows([[0.0, 0.0], [0.5, 0.0], [1.0, 0.0]]), (parabolas().compile().limits or ())[0].scale
    found = front.replace(F=front.F + np.array([[0.0, 0.0], [1e-3 * share, 0.0], [0.0, 0.0]])).verify(1e-3)
    assert found.verified.tolist() == [True, good, True] and found.stats["verify"] == 1e-3
    assert found.notes == ("", "" if good else f"evaluated again, its 'near' differs by {1e-3 * share:.2g} m2", "")
    behind = rows([[1.5 + 1e-3 * share * scale, 0.0]]).verify(1e-3)
    assert behind.verified.tolist() == [good]
    assert behind.notes == ("" if good else f"evaluated again, it violates wall by {1e-3 * share:.1e}",)
    assert behind.simulated_violation == pytest.approx(1e-3 * share)
