"""Checks of saved points of which one number is off by a known amount: in which scale, against which tolerance, and in which words.

What a simulation finds of them is what marks points as verified: `test_verified.py`.
"""

from dataclasses import replace
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from carts import cart, points, slowed
from synthetic_fronts import black_box, flights
from vector_problems import parabolas

from macs import MACS, Front
from macs.fronts.builders import from_vectors
from macs.fronts.verification import verify
from problems import Problem, load
from problems.compiled import Variable
from transcription import DFET, parse
from transcription.inner import Projection

NEAR = pytest.mark.parametrize(("share", "good"), [(0.9, True), (1.1, False)])
"""A little less than a tolerance, and a little more."""


@pytest.fixture(scope="module")
def ascents() -> Front:
    """Feasible ascents nearest to random controls."""
    nlp = parse("dfet:4x6").transcribe(load("goddard"))
    controls = nlp.lower[nlp.free] + np.random.default_rng(0).random((4, len(nlp.free))) * nlp.span[nlp.free]
    found = Projection().solve(nlp, controls)
    assert (found.status == "converged").all()
    return Front.of(from_vectors(nlp, found.z, {"name": "by hand"}, {"tolerance": 1e-6}, optimality=[None] * 4))


@pytest.mark.slow
def test_an_honest_front_verifies(ascents, tmp_path):
    # They are no front: between the best of each objective there is little, and that counts as one.
    checks = verify(ascents, tolerance=10.0)
    assert len(checks) == len(ascents) > 0 and all(check.ok for check in checks)
    assert all(check.mismatch == 0 and check.objectives <= 1e-12 and check.violation <= 1e-6 for check in checks)
    ascents.save(tmp_path / "front.nc")
    assert verify(Front.load(tmp_path / "front.nc"), tolerance=10.0) == checks


def test_decisions_and_trajectories_of_others_are_found(ascents):
    decision = np.array(ascents.decision)
    decision[:, 3] += 0.25 * np.array([v.span for v in ascents.variables])[3]
    columns = {name: getattr(ascents, name) for name in ("F", "violation", "status", "goals", "variables", "problem", "transcriptions")}
    others = Front(**columns, decision=decision, trajectories=ascents.trajectories, stats=ascents.stats, sort=False)
    for check in verify(others, tolerance=1.0):
        assert any("differ from the decision vector" in reason for reason in check.reasons)
        assert any("violates " in reason for reason in check.reasons)
    swapped = verify(ascents.replace(trajectories=ascents.trajectories[::-1]), tolerance=1.0)
    assert any("phase 'ascent'" in reason for check in swapped for reason in check.reasons)


def test_what_cannot_be_verified_says_why(ascents):
    with pytest.raises(ValueError, match="black box"):
        verify(black_box(), tolerance=1.0)
    with pytest.raises(ValueError, match="does not say how"):
        verify(flights(transcriptions=None), tolerance=1.0)
    other = {"method": "DFET", "settings": {"elements": 3, "order": 4}}
    with pytest.raises(ValueError, match=r"decision vector of point 0 .* is not that of its transcription"):
        verify(ascents.replace(transcriptions=other), tolerance=1.0)


@pytest.mark.slow
def test_objectives_that_only_the_mesh_believes_are_found():
    """An integrand that oscillates faster than the quadrature sees: states are exact, so only a simulation of the objectives tells."""
    problem = Problem("ripple")
    phase = problem.phase("run", t0=0, tf=(1, 2))
    x = phase.state("x", bounds=(0, 3), initial=0)
    phase.dynamics(x=1)
    problem.minimize("cost", phase.integral(1 + ca.cos(40 * x)))
    problem.maximize("distance", phase.final(x))
    checks = verify(MACS(mesh="fixed").solve(problem, DFET(1, 1), evaluations=60, seed=1), tolerance=1e-2)
    assert all(check.defect < 1e-9 for check in checks)
    assert any("its 'cost' differs by" in " ".join(check.reasons) for check in checks)


@pytest.mark.parametrize("scheme", ["dfet:2x2", "shooting:5"])
@pytest.mark.filterwarnings("error")
def test_a_phase_without_duration_verifies(tmp_path, scheme):
    """The trajectory whose phase begins and ends at 0 is its own simulation."""
    problem = Problem("wait")
    phase = problem.phase("wait", t0=0.0, tf=(0.0, 2.0))
    x, u = phase.state("x", bounds=(-5, 5), initial=0), phase.control("u", bounds=(-1, 1))
    phase.dynamics(x=u - x * phase.time)
    problem.minimize("time", phase.tf)
    problem.maximize("x", phase.final(x))
    start = np.zeros((1, len(parse(scheme).nlp(problem.compile()).variables)))
    front = MACS(agents=4, archive=4, refine=False).solve(problem, parse(scheme), evaluations=8, seed=1, start=start)
    point = front[int(np.argmin(front.F[:, 0]))]
    assert point.trajectory["wait"].tf == 0.0 and point.verified
    again = point.simulate()
    assert again.max_defect == again.violation == 0.0 and again.objectives == point.objectives
    front.save(tmp_path / "front.nc")
    assert verify(Front.load(tmp_path / "front.nc", problem), tolerance=1e-3)[point.index].ok
    point.plot()


@NEAR
def test_what_a_simulation_does_not_confirm_is_a_reason(share, good):
    """After two seconds x, within [-5, 5], is 0.01 times `share` less than stored; the effort 2 u^2, of scale 1e6, hardly differs."""
    (check,) = verify(slowed(points(cart(of_objective=1e6), [1.0] * 4), 5e-3 * share), tolerance=1e-3)
    assert check.defect == pytest.approx(1e-3 * share, rel=1e-6) and check.missed < 1e-6 and check.simulated < 1e-9
    assert check.reasons[0].startswith("stored controls of phase 'run' differ from the decision vector by")
    assert check.reasons[1:] == (() if good else (f"simulated, its states differ by {check.defect:.1e} of their bounds",))


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
def sledge(t0: float = 0.0) -> Front:
    """One point of it."""
    return points(sled(t0), [1.0] * 4 + [2.0])


def changed(front: Front, part: str, change: Any) -> Front:
    """The front, of one point, with one number of a part of its trajectory increased, or with another basis or array there."""
    (trajectory,) = front.trajectories
    (phase,) = trajectory.phases
    if part == "parameters":
        return front.replace(trajectories=[replace(trajectory, parameters={"mass": trajectory.parameters["mass"] + change})])
    owner, _, name = part.rpartition(".")
    holder = getattr(phase, owner) if owner else phase
    if isinstance(change, float):
        array = getattr(holder, name).copy()
        array.flat[-1] += change
        change = array
    altered = replace(holder, **{name: change})
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
    (check,) = verify(changed(front, part, 1e-6 * scale), tolerance=1.0)
    assert check.mismatch == pytest.approx(1e-6, rel=1e-3)
    assert check.reasons == (f"stored {name} differ from the decision vector by {check.mismatch:.1e}",)
    assert [verify(changed(front, part, off * scale), tolerance=1.0)[0].ok for off in (0.0, 0.9e-9, 1.1e-9)] == [True, True, False]


@pytest.mark.parametrize(("t0", "scale"), [(-1.0, 2.0), (-5.0, 5.0), (3.0, 5.0), (0.0, 2.0)])
def test_times_are_compared_in_the_largest_of_them_and_of_the_duration(t0, scale):
    assert verify(changed(sledge(t0), "time", 1e-6), tolerance=1.0)[0].mismatch == pytest.approx(1e-6 / scale, rel=1e-6)


@pytest.mark.parametrize(
    ("part", "other", "name"),
    [
        ("state.basis", "legendre", "bases"),
        ("control.basis", "bernstein", "bases"),
        ("paths", np.zeros((2, 1)), "path constraints"),
        ("paths", np.inf, "path constraints"),
        ("paths", np.nan, "path constraints"),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value")
def test_another_basis_or_shape_and_what_is_no_number_differ_infinitely(part, other, name):
    (check,) = verify(changed(sledge(), part, other), tolerance=1e9)
    assert check.mismatch == np.inf and check.reasons == (f"stored {name} of phase 'run' differ from the decision vector by inf",)


@NEAR
def test_stored_objectives_are_compared_in_their_size_and_at_least_in_one(share, good):
    """Of 2 u^2 = 4.5 and 3; of 0.02 and 0.2, which are less than one."""
    for value, size in ((1.5, 4.5), (0.1, 1.0)):
        front = points(cart(), [value] * 4)
        k = [goal.name for goal in front.goals].index("effort")
        (check,) = verify(front.replace(F=front.F + share * 1e-9 * size * np.eye(2)[[k]]), tolerance=1.0)
        assert check.objectives == pytest.approx(share * 1e-9, rel=1e-4)
        assert check.reasons == (() if good else (f"stored objectives differ from recomputed ones by {check.objectives:.1e}",))
    (check,) = verify(front.replace(F=[[np.nan, 2.0]]), tolerance=1.0)
    assert check.objectives == check.missed == np.inf and not check.ok


@pytest.mark.parametrize(("stored", "good"), [(0.0, True), (0.9e-6, True), (1.1e-6, False), (np.nan, False)])
def test_a_stored_violation_is_compared_to_the_tolerance_of_the_search(stored, good):
    (check,) = verify(points(cart(), [1.0] * 4).replace(violation=[stored]), tolerance=1.0)
    assert check.reasons == (() if good else (f"stored violation {stored:.1e}, recomputed {check.violation:.1e}",))


@NEAR
def test_what_the_transcription_violates_is_compared_to_the_tolerance_of_the_search(share, good):
    """A hundred times the distance is less than 200 by a millionth; simulated, it is compared to another tolerance, in another scale."""
    (check,) = verify(points(cart(lower=200.0), [1.0 - 0.5e-8 * share] * 4), tolerance=1e-3)
    assert check.violation == pytest.approx(share * 1e-6, rel=1e-4)
    assert check.reasons == (() if good else (f"violates constraint 'enough' by {check.violation:.1e} (tolerance 1e-06)",))


def test_what_did_not_converge_or_has_no_trajectory_fails_and_an_earlier_verdict_does_not_count():
    front = points(cart(), [1.0] * 4, [1.5] * 4).replace(status=["converged", "infeasible"])
    assert [(check.point, check.reasons) for check in verify(front, tolerance=1.0)] == [(0, ()), (1, ("its status is 'infeasible'",))]
    front = points(cart(), [1.0] * 4).replace(notes=["simulated, its states differ by 1.0e+00 of their bounds"])
    assert verify(front, tolerance=1e-3)[0].ok
    (check,) = verify(sledge().replace(trajectories=[None]), tolerance=1e9)
    assert (check.mismatch, check.defect, check.simulated, check.missed) == (np.inf,) * 4
    assert check.reasons == ("stored phases differ from the decision vector by inf",)


def rows(X: list[list[float]], **changes: Any) -> Front:
    """Points of `parabolas` at these rows."""
    problem, Z = parabolas().compile(), np.array(X)
    F, violations = problem.evaluate(Z)
    given = {
        "F": F, "decision": Z, "violation": violations.max(axis=1), "status": ["converged"] * len(Z), "goals": problem.goals,
        "variables": problem.variables, "problem": problem, "stats": {"tolerance": 1e-6}, "sort": False,
    }  # fmt: skip
    return Front(**given | changes)


def scale_of_wall() -> float:
    return (parabolas().compile().limits or ())[0].scale


def test_honest_rows_pass_and_others_are_told():
    checks = verify(rows([[0.0, 0.0], [1.0, 0.0]]), tolerance=1e-9)
    assert [(check.point, check.reasons) for check in checks] == [(0, ()), (1, ())]
    assert all((c.mismatch, c.violation, c.objectives, c.defect, c.simulated, c.missed) == (0.0,) * 6 for c in checks)
    front = rows([[np.nan, 0.0]], F=[[1.0, 1.0]], violation=[0.0], status=["failed"])
    (check,) = verify(front, tolerance=1e-3)
    assert "evaluated again, it fails" in check.reasons and "its status is 'failed'" in check.reasons
    assert check.violation == check.missed == check.objectives == np.inf
    others = [Variable("a", -4.0, 4.0), Variable("y", -1.0, 1.0)]
    with pytest.raises(ValueError, match="the variables of the front are not x, y"):
        verify(rows([[1.0, 0.0]], variables=others), tolerance=1e-3)
    # x may be 1.5, and y 1 of a span of 2.
    beyond = rows([[1.6, 1.5], [3.5, 1.1]], violation=[0.25, 2.0])
    first, second = (check.reasons[-1] for check in verify(beyond, tolerance=1e-3))
    assert first == "evaluated again, it violates bounds of y by 2.5e-01" and "it violates wall by" in second
    assert rows([[5.0, 0.0]]).simulate()[0].violations["bounds of x"] == 1 / 8
    # Objectives of 0, 1/4 and 1, of which the middle one is off by an eighth; and a row half of a scale behind the wall.
    front = rows([[0.0, 0.0], [0.5, 0.0], [1.0, 0.0]])
    off = verify(front.replace(F=front.F + np.array([[0.0, 0.0], [0.125, 0.0], [0.0, 0.0]])), tolerance=0.125)
    assert [check.missed for check in off] == [0.0, 0.125, 0.0] and all(check.ok for check in off) and off[1].objectives == 0.125
    behind = rows([[1.5 + 0.5 * scale_of_wall(), 0.0]])
    assert verify(behind, tolerance=0.5)[0].violation == 0.5 and verify(behind, tolerance=0.5)[0].ok
    assert verify(rows([[1.0, 0.0]], violation=[0.5]), tolerance=0.5)[0].ok


@NEAR
def test_objectives_of_rows_are_compared_in_the_range_of_the_front(share, good):
    """Those of (0, 0) and (1, 0) are 0 and 1, and 4 and 1: ranges of 1 and 3."""
    front = rows([[0.0, 0.0], [1.0, 0.0]])
    front = front.replace(F=front.F + np.array([[0.0, 3e-3 * share], [0.0, 0.0]]))
    (first, second), scale = verify(front, tolerance=1e-3), 3.0
    assert first.missed == pytest.approx(3e-3 * share / scale) and first.objectives == pytest.approx(3e-3 * share / 4.0) and second.ok
    assert first.reasons == (() if good else (f"evaluated again, its 'nearness' differs by {3e-3 * share:.2g} m2",))
    marked = front.verify()
    assert marked.verified.tolist() == [good, True] and marked.notes == ("; ".join(first.reasons), "")


@NEAR
@pytest.mark.parametrize(("tolerance", "allowed"), [(1e-3, 1e-3), (1e-9, 1e-6)])
def test_rows_may_violate_what_is_asked_for_or_what_the_search_allowed(share, good, tolerance, allowed):
    """The wall is at 1.5, and its scale is 1.5 or 1: the share is of what the problem says of a row behind it."""
    front = rows([[1.5 + share * allowed * scale_of_wall(), 0.0]])
    (check,), marked = verify(front, tolerance=tolerance), front.verify(tolerance)
    assert check.violation == check.simulated == marked.simulated_violation[0] == pytest.approx(share * allowed, rel=1e-6)
    assert check.reasons == (() if good else (f"evaluated again, it violates wall by {check.violation:.1e}",))
    assert marked.verified.tolist() == [good] and marked.notes == ("; ".join(check.reasons),)


@pytest.mark.parametrize(("stored", "good"), [(0.9e-3, True), (1.1e-3, False)])
def test_a_stored_violation_of_a_row_is_compared_too(stored, good):
    (check,) = verify(rows([[1.0, 0.0]], violation=[stored]), tolerance=1e-3)
    assert check.reasons == (() if good else (f"stored violation {stored:.1e}, recomputed 0.0e+00",))
