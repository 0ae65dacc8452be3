from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from synthetic_fronts import black_box, flights

import problems
from macs import MACS, Front
from macs.fronts.builders import from_vectors
from macs.fronts.verification import verify
from problems import Problem
from transcription import DFET, parse
from transcription.inner import Projection


@pytest.fixture(scope="module")
def front() -> Front:
    """Feasible ascents nearest to random controls."""
    nlp = parse("dfet:4x6").transcribe(problems.load("goddard"))
    controls = nlp.lower[nlp.free] + np.random.default_rng(0).random((4, len(nlp.free))) * nlp.span[nlp.free]
    found = Projection().solve(nlp, controls)
    assert (found.status == "converged").all()
    return Front.of(from_vectors(nlp, found.z, {"name": "by hand"}, {"tolerance": 1e-6}, optimality=[None] * 4))


def altered(front: Front, **changes) -> Front:
    columns = {
        "F": front.F, "decision": front.decision, "violation": front.violation, "status": front.status, "goals": front.goals,
        "variables": front.variables, "trajectories": [p.trajectory for p in front], "problem": front.problem,
        "transcriptions": front.transcriptions, "stats": front.stats, "sort": False, **changes,
    }  # fmt: skip
    return Front(**columns)


@pytest.mark.slow
def test_an_honest_front_verifies(front, tmp_path):
    checks = verify(front, tolerance=1.0)
    assert len(checks) == len(front) > 0 and all(check.ok for check in checks)
    assert all(check.mismatch == 0 and check.objectives <= 1e-12 and check.violation <= 1e-6 for check in checks)
    front.save(tmp_path / "front.nc")
    assert verify(Front.load(tmp_path / "front.nc"), tolerance=1.0) == checks


def test_decisions_that_were_touched_up_are_found(front):
    decision = np.array(front.decision)
    decision[:, 3] += 0.25 * np.array([v.span for v in front.variables])[3]
    for check in verify(altered(front, decision=decision), tolerance=1.0):
        assert any("differ from the decision vector" in reason for reason in check.reasons)
        assert any("violates " in reason for reason in check.reasons)


def test_trajectories_of_other_points_are_found(front):
    swapped = [p.trajectory for p in front][::-1]
    checks = verify(altered(front, trajectories=swapped), tolerance=1.0)
    assert any("phase 'ascent'" in reason for check in checks for reason in check.reasons)
    assert all("stored phases" in check.reasons[0] for check in verify(altered(front, trajectories=None), tolerance=1.0))


def test_what_cannot_be_verified_says_why(front):
    with pytest.raises(ValueError, match="black box"):
        verify(black_box(), tolerance=1.0)
    with pytest.raises(ValueError, match="does not say how"):
        verify(flights(transcriptions=None), tolerance=1.0)
    other = {"method": "DFET", "settings": {"elements": 3, "order": 4}}
    with pytest.raises(ValueError, match=r"decision vector of point 0 .* is not that of its transcription"):
        verify(altered(front, transcriptions=other), tolerance=1.0)


@pytest.mark.slow
def test_objectives_that_only_the_mesh_believes_are_found():
    """An integrand that oscillates faster than the quadrature sees: states are exact, so only a simulation of the objectives tells."""
    problem = problems.Problem("ripple")
    phase = problem.phase("run", t0=0, tf=(1, 2))
    x = phase.state("x", bounds=(0, 3), initial=0)
    phase.dynamics(x=1)
    problem.minimize("cost", phase.integral(1 + ca.cos(40 * x)))
    problem.maximize("distance", phase.final(x))
    found = MACS(mesh="fixed").solve(problem, DFET(1, 1), evaluations=60, seed=1)
    checks = verify(found, tolerance=1e-2)
    assert all(check.defect < 1e-9 for check in checks)
    assert any(not check.ok and "objectives differ" in " ".join(check.reasons) for check in checks)


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
