"""Points that a simulation does not confirm are solved again; the ascent's least time has a closed form."""

import signal
from dataclasses import replace
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from carts import points
from smooth_problems import bryson_denham, time_against_effort

from macs import MACS, NSGA2, Front, payoff, sweep
from macs.fronts.builders import certified, from_vectors
from macs.fronts.points import Points
from macs.fronts.verification import verify
from macs.fronts.verified import unmarked
from macs.gradients.front_polish import KEPT_INSIDE
from macs.refinement import mending
from macs.refinement.mesh_loop import MeshLoop
from problems import Problem, load
from transcription import DFET, SingleShooting
from transcription.stopping import Stopped, stopped_by

MESH = DFET(4, 6)
LEAST = np.sqrt(2.0 * 10.0 * (1.0 / (4e-3 - 1.6e-3) + 1.0 / (4e-3 + 1.6e-3)))
"""Seconds up to 10 km with full thrust up, then down: v = (a - g) t1 = (a + g) t2, and v (t1 + t2) / 2 is the height."""


@pytest.fixture(scope="module")
def marked() -> Front:
    """Three points of the ascent's front; at its least time the polynomials of the thrust's angle leave their bounds."""
    return sweep(load("goddard"), MESH, points=3, starts=1)


@pytest.fixture(scope="module")
def mended(marked) -> Front:
    return marked.mended()


def test_the_widest_gap_is_between_neighbours_whatever_the_number_of_objectives() -> None:
    F = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]])
    good = SimpleNamespace(simulated_F=F, F=F, verified=np.ones(3, dtype=bool))
    first = mending._target(good, np.empty((0, 3)), np.ones(3), None)  # type: ignore[arg-type]
    assert first.tolist() == [0.0, 1.0, 0.5] or first.tolist() == [0.5, 1.0, 0.0]
    second = mending._target(good, first[None], np.ones(3), None)  # type: ignore[arg-type]
    assert second.tolist() == [0.5, 0.0, 0.5]
    third = mending._target(good, np.array([first, second]), np.ones(3), None, [first, second])  # type: ignore[arg-type]
    assert third is not None and third.tolist() not in [first.tolist(), second.tolist()], "half of what was the widest gap"
    assert mending._target(good, np.array([first, second]), np.ones(3), None) is None  # type: ignore[arg-type]


def test_a_search_with_few_points_gets_more_in_their_gaps(unverified) -> None:
    few = unverified.verify(1e-3)
    few = few[np.flatnonzero(few.verified)[[0, -1]]]
    more = mending.mended(few, 1e-3, size=5)
    assert len(more) == 5 and more.verified.all()
    assert np.diff(more.F[:, 0]).max() < 0.5 * np.ptp(more.F[:, 0]) and not more.message


@pytest.mark.parametrize(
    ("step", "result", "why"),
    [("_between", "did not converge", "solves for more: 3 did not converge."), ("_most_work", 0.0, "the work for more was used up.")],
)
def test_a_front_says_why_points_are_missing(unverified, monkeypatch, step, result, why) -> None:
    few = unverified.verify(1e-3)
    few = few[np.flatnonzero(few.verified)[[0, -1]]]
    monkeypatch.setattr(mending._Mending, step, lambda job, points, tasks, *_: [result] * len(tasks) if step == "_between" else result)
    assert mending.mended(few, 1e-3, size=5).message.endswith(f"2 of 5 points were found; {why}")


@pytest.fixture(scope="module")
def unverified() -> Front:
    """Of a search that simulates nothing."""
    return MACS(agents=4, archive=4).solve(load("goddard"), DFET(4, 4), evaluations=80, seed=1, verify=None)


@pytest.mark.slow
def test_a_mesh_that_is_given_is_kept_and_points_are_only_marked(marked):
    assert marked.verified.tolist() == [False, True, True]
    assert {point.transcription["settings"]["mesh"] for point in marked} == {None}
    assert marked.objectives[0, 0] < LEAST - 1e-2, "better than there is"


def test_the_least_time_is_mended_to_the_closed_form(marked, mended):
    assert abs(LEAST - 109.10894511799619) < 1e-9
    assert len(mended) == 3 and mended.verified.all() and mended.violation.max() < 1e-6
    assert LEAST - 1e-6 * 141 < mended.objectives[0, 0] < LEAST + 1e-3 * 141
    assert mended.simulated_F[0, 0] == pytest.approx(LEAST, rel=1e-5)
    check = mended[0].simulate(rtol=1e-11, atol=1e-12)
    assert check.max_defect < 1e-3 and check.violation < 1e-3


def test_verified_points_stay_as_they_are_without_time_all_and_the_work_is_counted(marked, mended):
    for before, after in zip(list(marked)[1:], list(mended)[1:], strict=True):
        np.testing.assert_array_equal(before.decision, after.decision)
        assert before.transcription == after.transcription
    again = mended.mended()
    np.testing.assert_array_equal(again.decision, mended.decision)
    tried = 1  # solve by which an end is to get better in the other objective: it does not
    assert again.stats["gradient_solves"] == mended.stats["gradient_solves"] + tried
    assert mended.stats["gradient_solves"] > marked.stats["gradient_solves"] and mended.stats["work"] > marked.stats["work"] > 0
    assert mended.stats["wall_time"] > marked.stats["wall_time"] and mended.stats["verify"] == marked.stats["verify"]
    assert mended.solver == marked.solver and mended.message == marked.message
    # The quickest flight of the first mesh is no real one; the verified one that was known stands in its place, whichever came last.
    kept = mending._Mending(mended, 1e-3, print)._as_before(marked)
    assert kept.verified.all() and (kept[0].decision == mended[0].decision).all() and (kept[2].decision == marked[2].decision).all()
    found = marked.mended(time_limit=1e-9)
    assert found.verified.tolist() == [False, True, True] and found.stats["stopped"] == "time limit"
    np.testing.assert_array_equal(found.F, marked.F)


def test_a_program_that_is_not_built_in_time_loses_nothing(marked, monkeypatch):
    def outlasted(self, method):
        raise Stopped("time limit")

    monkeypatch.setattr(mending.Programs, "__call__", outlasted)
    found = marked.mended()
    np.testing.assert_array_equal(found.F, marked.F)
    assert found.verified.tolist() == marked.verified.tolist()


@pytest.mark.slow
def test_ends_keep_their_places_when_they_are_mended():
    """The first objective is maximised, so that the ends are not in the order of a sorted front; on two elements both miss."""
    problem = Problem("pendulum")
    phase = problem.phase("swing", t0=0.0, tf=(3.0, 6.0))
    x, v = phase.state("x", bounds=(-3, 3), initial=1.0), phase.state("v", bounds=(-3, 3), initial=0.0)
    u = phase.control("u", bounds=(-0.3, 0.3))
    phase.dynamics(x=v, v=u - x + x**3 / 6)
    problem.maximize("end", phase.final(x))
    problem.minimize("time", phase.tf)
    problem.default_transcription = "dfet:2x1:bernstein"
    given, ends = payoff(problem, DFET(2, 1, basis="bernstein"), starts=1), payoff(problem, starts=1)
    assert not given.verified.any() and ends.verified[0] and len(ends) == 2
    assert ends[0].simulated["end"] > ends[1].simulated["end"] + 1e-3
    assert ends[1].objectives["time"] == pytest.approx(3.0) and ends[0].objectives["time"] > 3.5


def small() -> dict:
    return {"evaluations": 60, "seed": 1}


@pytest.mark.slow
def test_who_mends():
    """MACS with gradients does, unless its mesh is fixed; MACS without, `paper()` and the baselines only mark."""
    problem = load("goddard")
    marking = [
        MACS(agents=4, archive=3, mesh="fixed"),
        MACS(agents=4, archive=3, refine=False),
        MACS.paper(agents=4, archive=3),
        NSGA2(population=4),
    ]
    for solver in marking:
        front = solver.solve(problem, DFET(2, 3), **small())
        assert front.was_simulated.all() and not front.verified.all()
        assert all(one["settings"]["mesh"] is None for one in front.transcriptions)
    plain, front = (MACS(agents=4, archive=3, **mesh).solve(problem, DFET(2, 3), **small()) for mesh in ({"mesh": "fixed"}, {}))
    assert front.verified.sum() > plain.verified.sum() and any(one["settings"]["mesh"] is not None for one in front.transcriptions)


def test_points_of_shooting_are_moved_inside_their_limits():
    """Bryson and Denham's problem, whose least effort at a height l up to 1/6 is 4 / (9 l); three nodes do not see the height between."""
    rough = MACS(agents=4, archive=4, refine=False).solve(bryson_denham(), SingleShooting(3, control="linear"), evaluations=200, seed=1)
    again = rough.mended()
    assert rough.verified.sum() < len(rough) == len(again) and again.verified.all()
    moved = [point for point in again if KEPT_INSIDE in point.note]
    assert len(moved) == len(rough) - rough.verified.sum() and again.stats["gradient_solves"] >= len(moved)
    for point in moved:
        effort, height = point.simulated.values()
        assert effort > (1 - 3e-3) * 4 / (9 * height)
        assert point.transcription["method"] == "SingleShooting"


def test_an_integral_over_a_kink_is_that_of_the_simulation():
    """Of what u has above 0 on its way from -2 to 0.3 and to -1: two triangles, which no step of this method meets; others are exact."""
    problem = Problem("kink")
    phase = problem.phase("run", t0=0.0, tf=2.0)
    x, u = phase.state("x", bounds=(-5, 5), initial=0), phase.control("u", bounds=(-2, 2))
    phase.dynamics(x=u)
    problem.maximize("distance", phase.final(x))
    problem.minimize("push", phase.integral(ca.fmax(u, 0.0)))
    rough = points(problem, [-2.0, 0.3, -1.0], [-1.0, 2.0, 0.5], method=SingleShooting(3, control="linear", steps=2)).verify()
    found = rough.refine()
    assert rough.verified.tolist() == [False, True] and found.verified.all() and found.notes == (mending.AS_SIMULATED, "")
    assert found.F[0, 1] == pytest.approx(0.045 * (1 / 2.3 + 1 / 1.3), abs=1e-6) and found.F[1].tolist() == rough.F[1].tolist()
    assert found[[0]].verify().verified.all() and all(check.ok for check in verify(found, tolerance=1e-3))
    wrong = found.replace(F=found.F - [[0.0, 0.01]])
    assert ["stored objectives differ" in "".join(check.reasons) for check in verify(wrong, tolerance=1e-3)] == [True, True]


@pytest.mark.slow
def test_points_that_exceed_a_limit_by_little_keep_their_mesh():
    """The same on elements, whose states are exact: only between nodes is the height too large."""
    rough = sweep(bryson_denham(), DFET(6, 3), points=4, verify=1e-5, starts=1)
    again = rough.mended()
    assert rough.verified.sum() == 1 and rough.simulated_violation.max() < 1e-3 and again.verified.all() and len(again) == 4
    for point in again:
        effort, height = point.simulated.values()
        assert 1 - 1e-4 < effort / (4 / (9 * height)) < 1.01
    moved = [point for point in again if KEPT_INSIDE in point.note]
    assert len(moved) == 3 and {point.transcription["settings"]["mesh"] for point in again} == {None}


@pytest.mark.slow
def test_points_that_were_not_simulated_are_simulated_first(unverified):
    assert not unverified.was_simulated.any() and unverified.mended().verified.all()
    assert len(unverified[[]].mended()) == 0


@pytest.mark.slow
@pytest.mark.parametrize("fine", [None, DFET(4, 7)])
def test_an_empty_front_stays_empty_and_keeps_its_reason(unverified, fine):
    nothing = mending.mended(unverified[[]].replace(message="no feasible point"), 1e-3, fine=fine)
    assert len(nothing) == 0 and nothing.message == "no feasible point" and nothing.stats["verify"] == 1e-3


def test_a_fine_mesh_is_for_all_points():
    """Simulations confirm all of them on the mesh of the search, where each effort is too large: the least in a time T is 12 / T^3."""
    front = sweep(time_against_effort(), DFET(3, 2, control_order=0), points=5, starts=1)
    assert front.verified.all() and len(front) == 5 and (front.F[:, 1] > 1.02 * 12.0 / front.F[:, 0] ** 3).all()
    found = mending.mended(unmarked(front), 1e-3, fine=DFET(4, 3))
    assert found.verified.all() and {one["settings"]["order"] for one in found.transcriptions} == {3}
    assert found.F[:, 1] == pytest.approx(12.0 / found.F[:, 0] ** 3, rel=1e-7) and max(found.optimality) < 1e-6
    assert found.F[[0, -1], 0] == pytest.approx([1.0, 2.0], abs=1e-7), "the ends of the front"
    assert (np.abs(found.F - front.F) / np.ptp(front.F, axis=0)).max() < 0.15, "less than the distance of neighbours"
    with stopped_by(lambda: True):
        assert mending.mended(front, 1e-3, fine=DFET(4, 3)).trajectories == front.trajectories


def test_what_a_point_wastes_without_any_effect_on_its_own_objective_is_saved():
    """The least time, at its bound, with a parameter that only costs: on the way to 1 in a time T the least effort is 1 / T."""
    problem = Problem("waste")
    run = problem.phase("run", t0=0.0, tf=(1.0, 2.0))
    x, p = run.state("x", bounds=(-2, 2), initial=0, final=1), problem.parameter("p", bounds=(-1, 1))
    u = run.control("u", bounds=(-3, 3))
    run.dynamics(x=u + 0.0 * x)
    problem.minimize("time", run.tf)
    problem.minimize("cost", run.integral(u**2) + p**2)
    front = sweep(problem, DFET(2, 2), points=3, starts=1)
    nlp = DFET(2, 2).nlp(problem.compile())
    Z = np.array([point.decision for point in front])
    Z[0, [v.name for v in nlp.variables].index("p")] = 0.7
    wasteful = from_vectors(nlp, Z, front.solver, front.stats, **certified(nlp, Z, np.ptp(front.F, axis=0)))
    assert wasteful.F[0] == pytest.approx([1.0, 1.49], abs=1e-6) and wasteful[0].optimality < 1e-6, "it is weakly optimal"
    found = mending.mended(wasteful, 1e-3)
    assert found.verified.all() and pytest.approx(front.F, abs=1e-4) == found.F
    assert found.stats["gradient_solves"] <= wasteful.stats["gradient_solves"] + 4, "at most two solves for each end"


def test_an_end_that_is_known_better_replaces_that_of_the_front(monkeypatch) -> None:
    """By more than a tenth of what points may miss, as exact as a payoff table is, where no work is left to solve it again."""
    problem = two_sided_cart()
    front, ends = sweep(problem, DFET(27, 3, basis="bernstein"), points=2, starts=1), payoff(problem)
    off, spans = front.F.min(axis=0) - np.diag(ends.F), np.ptp(ends.F, axis=0)
    assert front.verified.all() and 1e-4 < (off / spans).max() < 1e-3
    monkeypatch.setattr(mending, "MENDING", replace(mending.MENDING, least=1.0))
    searched = front.replace(stats=front.stats | {"evaluations": 1, "work": 1})
    found = mending.mended(searched, 1e-3, ends=ends)
    assert found.verified.all() and (found.F.min(axis=0) <= np.diag(ends.F) + 1e-4 * spans).all()


def test_an_end_on_a_finer_mesh_may_lose_in_other_objectives(marked, mended) -> None:
    """A point between the ends may not."""
    known, quickest = marked[1:], mended[:1]
    job = mending._Mending(known, 1e-3, print)
    ahead = Points.concatenate([quickest, known[1:]]).replace(stats=known.stats)
    assert (quickest.F[0] - known.F[0] > 0).tolist() == [False, True]
    assert np.array_equal(job._as_before(ahead).F, ahead.F)
    job.points = mended
    beside = Points.concatenate([mended[:1], mended[:1], mended[2:]]).replace(stats=mended.stats)
    assert np.array_equal(job._as_before(beside).F, mended.F)


def two_sided_cart() -> Problem:
    """From rest to rest, thrust on both sides: fuel against time is T - sqrt(T^2 - 4), with switches between elements' edges."""
    problem = Problem("cart")
    ride = problem.phase("ride", t0=0, tf=(2, 10))
    _, v = ride.state("x", bounds=(-1, 2), initial=0, final=1), ride.state("v", bounds=(-2, 2), initial=0, final=0)
    forth, back = ride.control("forth", bounds=(0, 1)), ride.control("back", bounds=(0, 1))
    ride.dynamics(x=v, v=forth - back)
    problem.minimize("time", ride.tf)
    problem.minimize("fuel", ride.integral(forth + back))
    return problem


def test_points_that_other_controls_would_better_are_solved_again(tmp_path, monkeypatch) -> None:
    problem = two_sided_cart()

    def off(front: Front) -> np.ndarray:
        time, fuel = front.objectives.T
        return fuel - (time - np.sqrt(np.maximum(time**2 - 4, 0)))

    coarse = sweep(problem, DFET(9, 3, basis="bernstein"), points=5, starts=1)
    assert coarse.verified.all() and off(coarse).min() > 5e-3 and coarse.gain.min() > 3e-4
    better = coarse.mended()
    good = off(better) < 2e-4
    assert better.verified.all() and good.sum() >= 4 and (better.gain[good] < 1e-4).all()
    better.save(tmp_path / "cart.nc")
    again = Front.load(tmp_path / "cart.nc")
    assert [point.gain for point in again[1:3]] == pytest.approx(better.gain[1:3], rel=1e-12)
    plain, calls = MeshLoop._solved, iter(range(100))

    def interrupting(self, *arguments):
        found = plain(self, *arguments)
        if next(calls) == 1:
            signal.raise_signal(signal.SIGINT)
        return found

    monkeypatch.setattr(MeshLoop, "_solved", interrupting)
    some = coarse.mended()
    assert some.stats["stopped"] == "interrupted" and some.verified.all() and len(some) == len(coarse)
    assert all(point.costates is not None for point in some), "the one in work stays as it was"
