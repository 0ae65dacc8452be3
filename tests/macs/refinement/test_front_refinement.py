"""Mesh refinement of a front: an independent simulation confirms every point."""

import signal

import casadi as ca
import numpy as np
import pytest
from fronts import distance_to_curve
from synthetic_fronts import black_box, flights

from macs import MACS, Front, sweep
from macs.fronts.builders import trajectory_columns
from macs.fronts.verification import verify
from macs.gradients.scalarised import GradientSolves
from macs.refinement.front_refinement import FrontRefinement
from problems import Problem, load
from problems.cases.goddard import reference
from transcription import DFET, from_dict
from transcription.inner import Ipopt
from transcription.meshes.verdict import Wanted
from transcription.nlp.scalarized import scalarize


@pytest.fixture(scope="module")
def coarse() -> Front:
    """Goddard on the paper's mesh: both ends and three points between them, as good as that mesh knows."""
    problem = load("goddard").compile()
    nlp = DFET(4, 6).transcribe(problem)
    middle = 0.5 * (nlp.lower + nlp.upper)[nlp.free][None]
    z = Ipopt().solve(nlp, middle).z[0]
    Z = [scalarize(nlp, z, reference=np.array([0.0, np.inf]), weights=np.array([1.0, 0.0])).z]
    for tf in (112.0, 125.0, 170.0, 250.0):
        Z.append(scalarize(nlp, Z[-1], reference=np.array([tf, 0.0]), weights=np.array([0.0, 1.0])).z)
    return Front(**trajectory_columns(nlp, np.array(Z), 1e-6), goals=problem.goals, problem=problem)


@pytest.fixture(scope="module")
def fine(coarse) -> Front:
    return coarse.refine_mesh(limit=4)


@pytest.mark.slow
def test_points_get_near_the_truth_and_are_confirmed_by_simulation(coarse, fine):
    truth = reference(20001)
    before, after = distance_to_curve(coarse.objectives, truth), distance_to_curve(fine.objectives, truth)
    assert before[0] > 1e-4, "on the first mesh the shortest flight is shorter than simulation confirms"
    assert after.max() < 1e-6 and after[1:].max() < 2e-8
    assert fine.status.tolist() == ["converged"] * 5 and fine.violation.max() < 1e-8
    for point in fine[1:]:
        assert point.simulate(rtol=1e-12, atol=1e-13).max_defect < 1e-7
        assert point.optimality < 1e-7 and point.note == ""


def largest_control(point) -> float:
    phase = point.trajectory["ascent"]
    return float(np.abs(phase.at(np.linspace(phase.t0, phase.tf, 20001))["u"]).max())


def test_refined_points_stay_within_bounds_keep_their_places_and_go_through_files(coarse, fine, tmp_path):
    assert largest_control(coarse[0]) > np.pi / 2 + 0.1 and all(largest_control(point) <= np.pi / 2 for point in fine)
    span = np.ptp(coarse.F, axis=0)
    assert np.abs((fine.F - coarse.F) / span)[1:].max() < 1e-5
    assert fine.stats["gradient_solves"] >= 8 and fine.stats["mesh_tolerance"] == 1e-7
    assert coarse.stats["gradient_solves"] == 0 and fine.stats["wall_time"] > 0
    # Each solve takes at least one iteration.
    assert fine.stats["inner_iterations"] >= coarse.stats["inner_iterations"] + fine.stats["gradient_solves"]
    assert len({len(point.decision) for point in fine}) > 1 and fine[0].transcription["settings"]["basis"] == "bernstein"
    fine.save(tmp_path / "fine.nc")
    again = Front.load(tmp_path / "fine.nc")
    assert again.transcriptions == fine.transcriptions
    for one, two in zip(fine, again, strict=True):
        assert np.array_equal(one.decision, two.decision) and one.variables == two.variables and one.note == two.note
    assert all(check.ok for check in verify(again, tolerance=2e-4))
    dataset = fine.to_xarray()
    times = dataset["decision"].sel(variable="ascent.tf").values
    assert times == pytest.approx([point.trajectory["ascent"].tf for point in fine], rel=1e-14)


@pytest.mark.slow
def test_points_of_different_meshes_merge_and_start_a_search(coarse, fine):
    merged = Front.merge([coarse[3:], fine[:3]])
    assert len(merged) == 5 and len({id(one) for one in merged.transcriptions}) >= 2
    again = MACS().solve(load("goddard"), DFET(4, 6), evaluations=20, seed=1, start=fine, inner="projection")
    for row in fine.F[2:]:
        assert (row + 1e-6 * np.ptp(fine.F, axis=0) >= again.F).all(axis=1).any()


@pytest.mark.slow
def test_part_of_a_front_keeps_its_places(coarse):
    """The first of these is the best in flight time of those that are here, but not of all."""
    part = coarse[1:4]
    fine = part.refine_mesh(limit=3)
    assert np.abs((fine.F - part.F) / np.ptp(part.F, axis=0)).max() < 1e-4
    alone = coarse[2].alone().refine_mesh(limit=2)
    assert np.abs(alone.F / coarse[2].F - 1.0).max() < 1e-6 and alone.message.startswith("1 of 1")


@pytest.mark.slow
def test_objectives_without_derivatives_are_solved_by_projection():
    """The largest of a peak has no gradient solve: the feasible point nearest to the old one is taken."""
    problem = Problem("highest")
    phase = problem.phase("run", t0=0, tf=2)
    x, v = phase.state("x", bounds=(-3, 3), initial=0), phase.state("v", bounds=(-3, 3), initial=0, final=0)
    u = phase.control("u", bounds=(-1, 1))
    phase.dynamics(x=v, v=u - 0.3 * v * ca.fabs(v) ** 2)
    problem.maximize("peak", phase.peak(x))
    problem.minimize("effort", phase.integral(u**2))
    front = MACS(archive=4, mesh="fixed").solve(problem, DFET(2, 3), evaluations=60, seed=1)
    fine = front.refine_mesh(tolerance=1e-6, limit=6)
    assert len(fine) == len(front) and fine.stats["gradient_solves"] == front.mended().stats["gradient_solves"] == 0
    assert fine.status.tolist() == ["converged"] * len(front) and all(point.optimality is None for point in fine)
    defects = [(point.simulate().max_defect, other.simulate().max_defect) for point, other in zip(fine, front, strict=True)]
    assert max(after for after, _ in defects) < 1e-6 < max(before for _, before in defects)


def test_ctrl_c_while_a_point_is_solved_adds_no_note_to_that_point(coarse, monkeypatch):
    plain = GradientSolves.__call__

    def solve(self, nlp, *arguments):
        if nlp.transcription.to_dict() != coarse[0].transcription:
            signal.raise_signal(signal.SIGINT)
        return plain(self, nlp, *arguments)

    monkeypatch.setattr(GradientSolves, "__call__", solve)
    front = coarse.refine_mesh()
    assert front.stats["stopped"] == "interrupted"
    assert all("not solved on a finer mesh" in point.note and "timeout" not in point.note for point in front)


def test_a_point_that_is_refined_again_begins_where_it_was_left():
    front = sweep(load("goddard"), DFET(3, 2), points=3, starts=1, verify=None)
    job = FrontRefinement(front, Wanted(1e-7, feasible=1e-6), limit=1)
    good = []
    for _ in range(2):
        job.go()
        meshes = [from_dict(point.transcription).mesh_of("ascent").elements for point in job.points(0.0, "")]
        assert meshes == [len(point.trajectory["ascent"].state.edges) - 1 for point in job.points(0.0, "")]
        good.append(sum(one.good for one in job.found.values()))
    assert good[0] <= good[1] and max(meshes) > 3


@pytest.mark.slow
def test_points_that_did_not_converge_stay_as_they_are():
    bad = front_with_a_bad_point()
    assert bad.refine_mesh(limit=1)[1].status == "infeasible"


def front_with_a_bad_point() -> Front:
    nlp = DFET(2, 3).transcribe(load("orbit_rise"))
    candidates = 0.5 * (nlp.lower + nlp.upper)[nlp.free] * np.array([[1.0], [1.2]])
    columns = trajectory_columns(nlp, nlp.propagate(nlp.first_guess(candidates)), 1e-6)
    columns["status"] = np.array(["converged", "infeasible"])
    return Front(**columns, goals=nlp.problem.goals, problem=nlp.problem)


def test_what_makes_no_sense_or_has_no_mesh_of_ours_is_refused_and_a_time_limit_ends_it(coarse):
    for arguments, words in (
        ({"tolerance": 0.0}, "tolerance must be a positive number"),
        ({"tolerance": 1e-14}, "tolerance must be at least 1e-10"),
        ({"limit": 0}, "limit must be a whole number"),
        ({"limit": 2.5}, "limit must be a whole number"),
        ({"time_limit": 0}, "time_limit must be a positive number, not 0"),
    ):
        with pytest.raises(ValueError, match=words):
            coarse.refine_mesh(**arguments)
    with pytest.raises(ValueError, match="black box"):
        black_box().refine_mesh()
    with pytest.raises(ValueError, match="only meshes of DFET"):
        flights(transcriptions=None).refine_mesh()
    front = coarse.refine_mesh(time_limit=1e-6)
    assert front.stats["stopped"] == "time limit" and front.stats["gradient_solves"] == coarse.stats["gradient_solves"]
    assert np.array_equal(front.F, coarse.F)


@pytest.mark.slow
def test_a_search_may_refine_its_meshes_in_the_end():
    front = MACS(mesh="adaptive", mesh_tolerance=1e-5, archive=3).solve(load("orbit_rise"), DFET(5, 2), evaluations=60, seed=1)
    assert front.stats["gradient_solves"] >= len(front) > 0 and front.stats["evaluations"] == 60
    assert front.solver["settings"]["mesh"] == "adaptive" and "mesh tolerance" in front.message
    assert max(point.simulate(rtol=1e-11).max_defect for point in front if not point.note) < 1e-5
    assert sum(not point.note for point in front) >= len(front) - 1
    stopped = MACS(mesh="adaptive").solve(
        load("orbit_rise"), DFET(5, 2), evaluations=200, seed=1, inner="projection", callback=lambda progress: True
    )
    assert stopped.stats["gradient_solves"] == 0


@pytest.mark.slow
def test_goddard_with_defaults():
    front = MACS(mesh="adaptive").solve(load("goddard"), DFET(4, 6), evaluations=3_000, seed=1)
    good = [
        distance <= 1e-6 and point.simulate(rtol=1e-12, atol=1e-13).max_defect < 1e-7 and largest_control(point) <= np.pi / 2
        for distance, point in zip(distance_to_curve(front.objectives, reference(20001)), front, strict=True)
    ]
    assert len(front) == 10 and sum(good) >= 9
    assert all(point.note for point, fine in zip(front, good, strict=True) if not fine)
    assert not any(any((point.excursions or {}).values()) for point in front)


def test_one_verb_refines(coarse):
    """Until a tolerance, on a transcription, or until points are verified: as the names that say which."""
    one, other = coarse[[3]].refine(1e-5, limit=2), coarse[[3]].refine_mesh(tolerance=1e-5, limit=2)
    np.testing.assert_array_equal(one.decision, other.decision)
    np.testing.assert_array_equal(coarse.refine(DFET(5, 6), solves=1).F, coarse.polished(DFET(5, 6), solves=1).F)
    assert coarse[[3]].refine().verified.all()
