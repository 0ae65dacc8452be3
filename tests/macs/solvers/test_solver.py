"""What all solvers share: checks before any work, ends before the budget, and what comes back."""

import os
import signal
import warnings

import casadi as ca
import numpy as np
import pytest
from compiled_cases import compiled
from threadpoolctl import threadpool_info, threadpool_limits

from macs import MACS, MOPSO, NSGA2, Progress, sweep
from macs.evaluation.evaluator import Counts
from macs.refinement.mesh_search import SearchMeshes
from macs.solvers.solver import Solver
from problems import Problem, load
from problems.compiled import CompiledProblem
from transcription import DFET, SingleShooting
from transcription.inner import Ipopt
from transcription.stopping import Stopped, stopped_by

MESH = DFET(3, 2)


def test_settings_are_printed_as_the_call_that_makes_them() -> None:
    assert repr(MACS()) == "MACS()"
    for solver in (NSGA2(population=40, degree="sum"), MOPSO.paper()):
        assert eval(repr(solver)) == solver and len(repr(solver)) < 100


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"evaluations": 0}, "evaluations"),
        ({"evaluations": 2.5}, "evaluations"),
        ({"seed": -1}, "seed"),
        ({"tolerance": 0}, "tolerance"),
        ({"tolerance": float("nan")}, "tolerance"),
        ({"time_limit": -1}, "time_limit"),
        ({"inner": "magic"}, "magic"),
        ({"callback": 3}, "callback"),
        ({"checkpoint": 3}, "checkpoint must be a path"),
        ({"start": np.zeros((2, 7))}, "7 entries"),
        ({"start": np.full((1, 9 + 1), np.nan)}, "start"),
        ({"start": "nonsense"}, "start"),
    ],
)
def test_arguments_that_make_no_sense(wrong: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        MACS().solve(load("orbit_rise"), MESH, **{"evaluations": 50, **wrong})


def test_what_no_search_is_about_is_refused() -> None:
    with pytest.raises(ValueError, match="problem must be a Problem, not str"):
        MACS().solve("goddard", MESH, evaluations=50)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="transcription must be"):
        MACS().solve(load("goddard"), "dfet:4x6", evaluations=50)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="archive"):
        MACS(archive=1).solve(load("goddard"), MESH, evaluations=50)
    problem = Problem("falling stone")
    fall = problem.phase("fall", t0=0, tf=1)
    height = fall.state("height", bounds=(-10, 10), initial=5)
    fall.dynamics(height=-1)
    problem.maximize("height", fall.final(height))
    with pytest.raises(ValueError, match="'falling stone' leaves nothing to decide"):
        MACS().solve(problem, MESH, evaluations=10)


@pytest.mark.slow
def test_a_callback_sees_progress_and_stops_the_search() -> None:
    seen: list[Progress] = []

    def callback(progress: Progress) -> bool:
        seen.append(progress)
        assert len(progress.front) == progress.archive
        return np.bool_(progress.evaluations > 200)  # type: ignore[return-value] - what comparing arrays gives

    front = MACS().solve(compiled("orbit_rise"), MESH, evaluations=5000, seed=1, callback=callback)
    assert front.stats["stopped"] == "callback"
    assert not front.stats["reproducible"]
    assert seen[-1].evaluations == front.stats["evaluations"] < 5000
    assert seen[-1].ideal["flight time"] == front.objectives[:, 0].min()


def test_a_time_limit_keeps_what_was_found() -> None:
    front = MACS().solve(compiled("orbit_rise"), MESH, evaluations=10**6, seed=1, time_limit=0.5)
    assert front.stats["stopped"] == "time limit" and not front.stats["reproducible"]
    assert len(front) > 0 and front.was_simulated.all()
    front = MACS().solve(compiled("goddard"), MESH, evaluations=12, seed=1, inner=Ipopt(seconds=1e-6))
    assert not front.stats["reproducible"]


def test_the_first_population_of_a_hard_problem_may_be_cut_short(capsys) -> None:
    problem = load("goddard").compile()
    MESH.nlp(problem)  # the first call with so little time ends before its first evaluation
    front = MACS().solve(problem, MESH, evaluations=100, seed=1, inner="ipopt", time_limit=1e-9, progress=True)
    assert len(front) == 0 and front.stats["stopped"] == "time limit" and not front.stats["reproducible"]
    assert front.stats["failures"] == {"timeout": 10} and front.stats["evaluations"] == 10
    assert front.message.startswith("no feasible point in 10 evaluations") and front.closest is not None
    assert capsys.readouterr().err.startswith("0 / 100 evaluations, 0:00, no feasible point yet")


def test_an_interrupt_within_the_first_population_keeps_what_it_had(monkeypatch) -> None:
    solve = Ipopt._solve_all

    def interrupted(self, nlp, start, guess, tolerance):
        first = solve(self, nlp, start[:3], guess[:3], tolerance)
        os.kill(os.getpid(), signal.SIGINT)
        rest = solve(self, nlp, start[3:], guess[3:], tolerance)
        return tuple(np.concatenate(pair) for pair in zip(first, rest, strict=True))

    monkeypatch.setattr(Ipopt, "_solve_all", interrupted)
    front = MACS().solve(compiled("goddard"), MESH, evaluations=10, seed=1, inner="ipopt")
    assert 0 < len(front) <= 3 and front.stats["failures"] == {"timeout": 7}
    assert front.stats["stopped"] == "interrupted" and not front.stats["reproducible"]


@pytest.mark.slow
def test_a_start_is_used_and_never_made_worse() -> None:
    first = MACS(mesh="fixed").solve(compiled("orbit_rise"), MESH, evaluations=300, seed=1)
    again = MACS(mesh="fixed").solve(compiled("orbit_rise"), MESH, evaluations=60, seed=2, start=first)
    for row in first.F:
        assert not (row < again.F).all(axis=1).all()
    best = first.F.min(axis=0)
    assert (again.F.min(axis=0) <= best + 1e-6 * np.ptp(first.F, axis=0)).all()  # equal to the digits that a solve has
    assert len(MACS(mesh="fixed").solve(compiled("orbit_rise"), MESH, evaluations=30, seed=2, start=first[0])) > 0


def test_a_guess_is_among_the_first() -> None:
    problem = load("orbit_rise")
    problem.phases["rise"].guess(u=1.5, tf=50.0)
    front = MACS(mesh="fixed").solve(problem, MESH, evaluations=1, seed=1, inner="projection")
    assert len(front) == 1 and front[0].objectives["flight time"] == 50.0
    np.testing.assert_allclose(front[0].trajectory["rise"]["u"], 1.5)


@pytest.mark.slow
def test_a_start_of_another_problem_is_refused(monkeypatch) -> None:
    other = MACS().solve(compiled("goddard"), DFET(4, 1), evaluations=30, seed=1)
    with pytest.raises(ValueError, match="other variables"):
        MACS().solve(compiled("orbit_rise"), MESH, evaluations=30, start=other)
    with pytest.raises(ValueError, match="other variables"):
        MACS().solve(compiled("orbit_rise"), MESH, evaluations=30, start=[other.closest or other[0]])
    # Before a mesh is found.
    monkeypatch.setattr("macs.solvers.solver.search_meshes", lambda *_: pytest.fail("work before the check"))
    with pytest.raises(ValueError, match="other variables"):
        MACS().solve(load("orbit_rise"), evaluations=30, start=other)
    with pytest.raises(ValueError, match="unknown start 'smoth', did you mean smooth"):
        MACS().solve(load("orbit_rise"), evaluations=30, start="smoth")


@pytest.mark.slow
@pytest.mark.parametrize("mesh", [MESH, DFET(6, 2)])
def test_a_front_of_other_data_may_begin_a_search(mesh) -> None:
    def lift(most: float) -> Problem:
        problem = Problem("lift")
        phase = problem.phase("up", t0=0, tf=(0.5, 5))
        v = phase.state("v", bounds=(0, 2), initial=0)
        a = phase.control("a", bounds=(0, most))
        phase.dynamics(v=a)
        problem.minimize("time", phase.tf)
        problem.maximize("speed", phase.final(v))
        return problem

    before = MACS(mesh="fixed").solve(lift(2.0), MESH, evaluations=60, seed=1)
    assert max(point.trajectory["up"]["a"].max() for point in before) > 1.5
    front = MACS(mesh="fixed").solve(lift(1.0), mesh, evaluations=60, seed=1, start=before)
    assert len(front) and max(point.trajectory["up"]["a"].max() for point in front) <= 1.0 + 1e-9
    with pytest.raises(ValueError, match=r"up\.a.* outside its bounds"):
        MACS().solve(lift(1.0), MESH, evaluations=60, start=before.decision)


def test_a_front_of_a_variant_may_begin_a_search() -> None:
    """A slew in one phase begins the same in two, with one parameter more: what has the same name, over the same time."""

    def slew(phases: int) -> Problem:
        problem = Problem("slew")
        made = []
        for k in range(phases):
            last = k == phases - 1
            phase = problem.phase(f"part {k}", t0=(0.1, 10) if k else 0.0, tf=(0.5, 10))
            phase.state("angle", bounds=(-4, 4), initial=None if k else 0.0, final=3.0 if last else None)
            rate = phase.state("rate", bounds=(-2, 2), initial=None if k else 0.0, final=0.0 if last else None)
            torque = phase.control("torque", bounds=(-1, 1))
            phase.dynamics(angle=rate, rate=torque)
            made.append(phase)
        if phases > 1:
            problem.link(*made)
            problem.constraint("spare", problem.parameter("spare", bounds=(0, 2)) + 0, upper=2.0)
        problem.minimize("time", made[-1].tf)
        problem.maximize("middle", made[0].final(made[0]["angle"]))
        return problem

    known = sweep(slew(1), DFET(8, 3), points=2, starts=1)[0]
    begun = MACS(mesh="fixed").solve(slew(2), DFET(8, 3), evaluations=1, seed=1, start=known, inner="projection")
    assert begun[0].objectives["time"] == pytest.approx(known.objectives["time"], rel=0.02)
    assert begun[0].objectives["middle"] == pytest.approx(known.trajectory["part 0"].at(0.5 * known.objectives["time"])["angle"], abs=0.05)
    assert begun[0].parameters["spare"] == pytest.approx(1.0)


@pytest.mark.slow
def test_a_start_of_another_mesh_is_interpolated() -> None:
    coarse = MACS(mesh="fixed").solve(compiled("orbit_rise"), DFET(6, 2), evaluations=300, seed=1, inner="projection")
    fine = MACS(mesh="fixed").solve(compiled("orbit_rise"), DFET(12, 2), evaluations=40, seed=2, start=coarse, inner="projection")
    bare = MACS(mesh="fixed").solve(compiled("orbit_rise"), DFET(12, 2), evaluations=40, seed=2, inner="projection")
    span = np.ptp(coarse.F, axis=0)
    assert ((fine.F.min(axis=0) - coarse.F.min(axis=0)) / span < 0.05).all()
    assert (fine.F[:, 1].min() - coarse.F[:, 1].min()) < (bare.F[:, 1].min() - coarse.F[:, 1].min())


def test_candidates_that_the_fast_inner_level_leaves_are_counted() -> None:
    problem = Problem("needle")
    phase = problem.phase("p", t0=0.0, tf=8.0)
    x = phase.state("x", bounds=(-2, 2), initial=0.5, final=0.0)
    u = phase.control("u", bounds=(-10, 10))
    phase.dynamics(x=4 * x + u)
    problem.minimize("effort", phase.integral(u**2))
    front = MACS(refine=False).solve(problem, DFET(8, 3), evaluations=20, seed=1)
    assert len(front) == 1 and 0 < front.stats["fallbacks"] <= 20
    assert "went to IPOPT, because the fast inner level failed" in front.table()


@pytest.mark.parametrize(
    ("solver", "coarse"),
    [(MACS(), True), (MACS(mesh="adaptive"), True), (MACS(mesh="fixed"), False), (MACS(refine=False), False), (NSGA2(population=4), False)],
)
def test_a_search_goes_on_the_coarse_mesh_where_its_points_are_solved_on_finer_ones(
    monkeypatch: pytest.MonkeyPatch, solver: Solver, coarse: bool
) -> None:
    mesh, fine, begun = DFET(2, 2), DFET(5, 3), []

    def record(self: Solver, problem: CompiledProblem, transcription: DFET, *_: object) -> None:
        begun.append(transcription)
        raise Stopped("seen")

    monkeypatch.setattr("macs.solvers.solver.search_meshes", lambda *_: SearchMeshes(mesh, fine, Counts()))
    monkeypatch.setattr(Solver, "_search_run", record)
    solver.solve(load("goddard"), seed=1)
    assert begun == [mesh if coarse else fine]


def test_a_search_that_ends_before_it_begins_has_the_ends_of_the_front(monkeypatch) -> None:
    known = sweep(load("goddard"), DFET(8, 4, basis="bernstein"), points=2, starts=1)
    reasons = [""]

    def found(*_) -> SearchMeshes:
        reasons[0] = "time limit"
        return SearchMeshes(DFET(8, 3), None, Counts(), known)

    monkeypatch.setattr("macs.solvers.solver.search_meshes", found)
    with stopped_by(lambda: reasons[0]):
        front = MACS().solve(load("goddard"), seed=1)
    np.testing.assert_array_equal(front.F, known.F)
    assert front.verified.all() and front.stats["stopped"] and front.message.startswith("The search ended before it began")
    assert front.solver["name"] == "MACS" and front.stats["seed"] == 1


@pytest.mark.slow
def test_what_blows_up_in_a_search_is_no_warning():
    problem = Problem("explosion")
    phase = problem.phase("p", t0=0.0, tf=10.0)
    x, u = phase.state("x", bounds=(-1, 1), initial=0.5), phase.control("u", bounds=(0, 1))
    phase.dynamics(x=x**3 + ca.exp(40 * u * x))
    problem.minimize("end", phase.final(x) ** 2)
    problem.minimize("effort", phase.integral(u**2))
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        for inner in ("propagate", "auto"):
            front = MACS(agents=4, archive=4).solve(problem, SingleShooting(8), evaluations=40, seed=1, inner=inner)
            assert front.message
        sweep(problem, DFET(3, 2), points=3, starts=1)


def test_work_on_trajectories_takes_one_thread_of_blas():
    def threads() -> set[int]:
        return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}

    during: list[set[int]] = []
    with threadpool_limits(2, user_api="blas"):
        MACS(agents=3, archive=4).solve(
            compiled("goddard"), DFET(2, 2), evaluations=20, seed=1, verify=None, callback=lambda progress: during.append(threads())
        )
        assert threads() == {2} and during and all(one == {1} for one in during)
