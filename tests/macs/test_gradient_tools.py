"""optimize, payoff and sweep: against closed forms and references, and what they say where there is nothing to find."""

import subprocess
import sys
from functools import cache

import casadi as ca
import numpy as np
import pytest
from compiled_cases import compiled
from fronts import distance_to_curve
from smooth_problems import compass, corners, shuttle, slide, still, two_wells, with_peak

from macs import Front, optimize, payoff, sweep
from macs.gradients.ends import tasks_between
from problems import Problem, load
from problems.cases.goddard import reference as goddard_reference
from problems.cases.orbit_rise import reference as orbit_reference
from transcription import DFET

MESH = DFET(4, 2)
WRONG = ({"starts": 0}, {"starts": 1.5}, {"seed": -1}, {"tolerance": 0}, {"start": "nonsense"}, {"start": np.zeros((1, 7))})
FEW = (1, 0, 2.5, True)
TOOLS = (optimize, payoff, lambda *args, **more: sweep(*args, **{"points": 5, **more}))


def certificates(front: Front) -> np.ndarray:
    return np.array([point.optimality for point in front])


@cache
def goddard(method: str = "pascoletti-serafini") -> Front:
    return sweep(compiled("goddard"), DFET(4, 6), points=10, method=method, starts=1)


@pytest.mark.slow
def test_goddard_is_exact_but_where_the_mesh_is_not() -> None:
    front = goddard()
    assert len(front) == 10 and set(front.status) == {"converged"} and not front.message
    miss = distance_to_curve(front.objectives, goddard_reference(8001))
    late = front.objectives[:, 0] > 112
    assert np.count_nonzero(late) >= 9 and miss[late].max() < 1e-6 and miss.max() < 3e-4
    assert certificates(front).max() < 1e-6 and front.violation.max() <= 1e-6
    # The ends: what the mesh makes of the bang-bang limit, and the linear tangent law at the longest time.
    # The front is vertical there: a speed of 1e-5 is a time within the tolerance of solves.
    assert front.objectives[0, 0] == pytest.approx(109.0806192, abs=1e-6)
    assert front.objectives[0, 1] == pytest.approx(0.0054525, abs=1e-5)
    assert front.objectives[-1] == pytest.approx([250, 0.903889755], abs=1e-6)


def test_goddard_points_are_evenly_spread() -> None:
    # Even on the line between the ends: the difference of the normalised objectives grows in equal steps.
    front = goddard()
    span = np.ptp(front.F, axis=0)
    steps = np.diff((front.F / span) @ [1, -1])
    assert steps == pytest.approx(np.full(9, 2 / 9), abs=1e-6)
    begun = sweep(load("goddard"), DFET(4, 6), points=6, start=goddard(), starts=1)
    assert len(begun) == 6 and begun.stats["inner_iterations"] < goddard().stats["inner_iterations"]


@pytest.mark.slow
def test_both_methods_lie_on_one_curve() -> None:
    one, other = goddard(), goddard("epsilon")
    assert len(other) == 10 and certificates(other).max() < 1e-6
    speeds = other.objectives[:, 1]
    assert np.diff(speeds) == pytest.approx(np.full(9, np.ptp(speeds) / 9), abs=1e-6)
    for front in (one, other):
        late = front.objectives[:, 0] > 112
        assert distance_to_curve(front[late].objectives, goddard_reference(8001)).max() < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("name", ["orbit_rise", "orbit_rise_full"])
def test_orbit_rise_is_what_its_mesh_can_be(name: str) -> None:
    front = sweep(load(name), DFET(30, 1), points=10, starts=1)
    assert len(front) == 10 and certificates(front).max() < 1e-6
    miss = distance_to_curve(front.objectives, orbit_reference())
    assert miss.mean() < 5e-5 and miss.max() < 1e-4


@pytest.mark.slow
def test_two_wells_and_their_multipliers() -> None:
    front = sweep(two_wells(), MESH, points=5)
    p = np.array([point.parameters["p"] for point in front])
    # The difference of the objectives is 2 p - 1: even steps of the one are even steps of the other.
    assert p == pytest.approx([0, 0.25, 0.5, 0.75, 1], abs=1e-6)
    # Both are convex, so that each end is the result of one solve: 1.5e-8, where the best of several starts had less by chance.
    assert certificates(front).max() < 1e-7


@pytest.mark.slow
def test_three_objectives_fill_their_triangle() -> None:
    front = sweep(corners(), MESH, points=15, starts=1)
    p = np.array([list(point.parameters.values()) for point in front])
    assert len(front) == 15 and p.sum(axis=1) == pytest.approx(1, abs=1e-6) and p.min() > -1e-6
    # The lattice of four divisions.
    assert 4 * p == pytest.approx(np.round(4 * p), abs=1e-2)
    limited = sweep(corners(), MESH, points=12, method="epsilon", starts=1)
    p = np.array([list(point.parameters.values()) for point in limited])
    assert 3 < len(limited) <= 12 and p.sum(axis=1) == pytest.approx(1, abs=1e-6) and p.min() > -1e-6


def test_a_front_of_peaks() -> None:
    front = sweep(shuttle(), MESH, points=5, starts=1)
    time, thrust = front.objectives.T
    assert len(front) == 5 and thrust == pytest.approx(16 / time**4, rel=1e-6) and certificates(front).max() < 1e-6


@pytest.mark.slow
def test_a_control_that_goes_round() -> None:
    front = sweep(compass(), MESH, points=5, starts=2)
    assert np.linalg.norm(front.objectives, axis=1) == pytest.approx(2, abs=1e-8)
    for point in front:
        assert np.all(np.abs(point.trajectory["walk"]["u"]) <= np.pi + 1e-9)


def test_payoff_is_lexicographic_in_the_declared_order() -> None:
    ends = payoff(load("orbit_rise"), DFET(30, 1), starts=1)
    assert len(ends) == 2 and list(ends.status) == ["converged"] * 2
    # At the least time any steering is optimal for the time; the second stage makes the best of it.
    assert ends.objectives[0] == pytest.approx([20, -0.28345966], abs=1e-6)
    assert ends.objectives[1] == pytest.approx([80, 0.05342372], abs=1e-6)
    assert certificates(ends).max() < 1e-6
    # Where a front is steep, a slack of 1e-9 in one objective would be 3e-5 in the other.
    ends = payoff(slide(), MESH, starts=1)
    assert ends.objectives == pytest.approx(np.array([[0, 1], [0.5, 0]]), abs=1e-6)


@pytest.mark.slow
def test_optimize_takes_one_objective() -> None:
    point = optimize(load("goddard"), DFET(4, 6), objective="horizontal speed", starts=1)
    assert point.objectives["horizontal speed"] == pytest.approx(0.903889755, abs=1e-6)
    assert point.status == "converged" and point.optimality < 1e-6 and point.simulate().max_defect < 1e-5
    assert optimize(two_wells(), MESH).objectives["from left"] == pytest.approx(0, abs=1e-9)


def two_valleys() -> Problem:
    """One objective with two minima, of which that with p < 0 is a little lower and much narrower."""
    problem = still("valleys")
    p = problem.parameter("p", bounds=(-2, 2))
    problem.minimize("depth", 1 - ca.exp(-((p - 1) ** 2)) - 1.2 * ca.exp(-16 * (p + 1) ** 2))
    return problem


@pytest.mark.slow
def test_several_starts_find_the_deeper_valley() -> None:
    assert optimize(two_valleys(), MESH, starts=12).parameters["p"] == pytest.approx(-1, abs=1e-2)
    near = optimize(two_valleys(), MESH, start=np.array([[0.9]]), starts=1)
    assert near.parameters["p"] == pytest.approx(1, abs=1e-2)
    assert optimize(two_valleys(), MESH, start=np.array([[0.9], [-0.95]])).parameters["p"] == pytest.approx(-1, abs=1e-2)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bits_and_the_costs() -> None:
    one, two = (sweep(shuttle(), MESH, points=4, starts=2, seed=3) for _ in range(2))
    assert np.array_equal(one.decision, two.decision) and one.stats["seed"] == 3
    assert one.stats["gradient_solves"] == two.stats["gradient_solves"] >= 2 * (2 * 2 + 2)
    assert one.stats["inner_iterations"] > one.stats["gradient_solves"] and one.stats["wall_time"] > 0 and one.stats["reproducible"]
    assert isinstance(sweep(shuttle(), MESH, points=3, starts=1, seed=None).stats["seed"], int)


def unreachable() -> Problem:
    problem = slide()
    run = problem.phases["run"]
    problem.constraint("too far", run.final(run["x"]), lower=4.5)
    return problem


@pytest.mark.slow
def test_the_message_if_nothing_converges() -> None:
    point = optimize(unreachable(), MESH, starts=2)
    assert point.status in ("infeasible", "failed") and point.violation > 1e-3
    ends = payoff(unreachable(), MESH, starts=2)
    assert len(ends) == 2 and "converged" not in ends.status and sum(ends.stats["failures"].values()) >= 2
    front = sweep(unreachable(), MESH, points=5, starts=2)
    assert len(front) == 0 and "no solve converged" in front.message and "too far" in front.message
    assert front.closest is not None and front.closest.violation > 1e-3


def test_objectives_that_are_in_no_conflict_have_one_point() -> None:
    problem = Problem("alike")
    run = problem.phase("run", t0=0, tf=2)
    x, u = run.state("x", bounds=(-3, 3), initial=0), run.control("u", bounds=(-2, 2))
    run.dynamics(x=u)
    problem.minimize("effort", run.integral(u**2))
    problem.minimize("path", run.integral(x**2))
    front = sweep(problem, MESH, points=6, starts=1)
    assert len(front) == 1 and np.allclose(front.F, 0, atol=1e-9) and "dominated or equal" in front.message


@pytest.mark.parametrize(
    ("call", "message"),
    [
        *((lambda tool=tool, wrong=wrong: tool(slide(), MESH, **wrong), next(iter(wrong))) for tool in TOOLS for wrong in WRONG),
        (lambda: optimize(slide(), MESH, objective="range"), "no objective 'range'; there are effort, miss"),
        (lambda: sweep(slide(), MESH, points=5, method="magic"), "unknown method 'magic'; there are pascoletti-serafini, epsilon"),
        *((lambda points=points: sweep(slide(), MESH, points=points), "points must be a whole number of at least 2") for points in FEW),
        (lambda: sweep(corners(), MESH, points=2), "points must be at least 3, one for each objective"),
        (lambda: sweep(two_valleys(), MESH, points=5), "one objective has no front to sweep"),
        (lambda: payoff("goddard", MESH), "problem must be a Problem, not str"),
    ],
)
def test_calls_that_make_no_sense(call, message) -> None:
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize("tool", TOOLS)
def test_peaks_used_otherwise_are_refused_before_any_work(tool) -> None:
    with pytest.raises(ValueError, match=r"objective 'speed' .* peak of phase 'trip'"):
        tool(with_peak("maximised"), MESH)


def test_targets_are_even_and_no_more_than_asked() -> None:
    ends = np.array([[0.0, 10.0], [2.0, 0.0]])
    down = tasks_between(ends, np.ptp(ends, axis=0), 5, "pascoletti-serafini")
    assert np.array([task.reference for task in down]) == pytest.approx(np.array([[0.5, 7.5], [1, 5], [1.5, 2.5]])[::-1])
    limited = tasks_between(ends, np.ptp(ends, axis=0), 4, "epsilon")
    assert sorted(task.reference[1] for task in limited) == pytest.approx([10 / 3, 20 / 3])
    for m in (3, 4):
        for points in (m, 10, 40):
            for method in ("epsilon", "pascoletti-serafini"):
                assert len(tasks_between(1 - np.eye(m), np.ones(m), points, method)) + m <= points


def test_importing_stays_light() -> None:
    code = (
        "import sys; from macs import *; NSGA3(divisions=4), SMSEMOA(), RVEA(), CTAEA();"
        "print([m for m in ('matplotlib', 'xarray', 'pandas', 'h5netcdf', 'scipy.stats', 'pymoo') if m in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == "[]"
