"""Points marked by a simulation: scales, notes, and what is not simulated. x' = u is integrated exactly by every method that is used."""

from functools import lru_cache, partial

import casadi as ca
import numpy as np
import pytest
from carts import MESH, cart, constant, points, slowed
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from synthetic_fronts import black_box

from macs import MACS, NSGA2, Front, optimize, sweep
from macs.evaluation.blackbox import plain_problem
from macs.fronts import verified as module
from macs.fronts.points import Points
from macs.fronts.verified import VERIFY, Simulations, largest_miss, objective_scales, verified
from problems import Problem, load
from problems.compiled import Limit, Variable, verified_scale
from transcription import DFET, SingleShooting

NEAR = pytest.mark.parametrize(("share", "good"), [(0.9, True), (1.1, False)])
"""A little less than a tolerance, and a little more."""


def test_what_agrees_and_is_feasible_is_verified_and_what_cannot_be_simulated_is_not():
    front = points(cart(), *constant(0.5, 1.0, 1.5)).verify()
    assert front.verified.all() and front.stats["verify"] == VERIFY == 1e-3 and not any(front.notes)
    assert front.defect == pytest.approx(0.0, abs=1e-9) and front.simulated_violation == pytest.approx(0.0, abs=1e-9)
    assert front.simulated_F == pytest.approx(front.F, abs=1e-7)
    fast = next(point for point in front if point.objectives["distance"] > 2.5)
    assert fast.simulated == pytest.approx({"distance": 3.0, "effort": 4.5}) and fast.verified is True
    assert "All 3 points are verified" in front.table()
    front = points(cart(), *constant(0.5, 1.0)).replace(status=["converged", "infeasible"])
    assert front.verify().verified.tolist() == [True, False]
    front = points(cart(), *constant(0.5, 1.0))
    found = front.replace(trajectories=[None, front.trajectories[1]], status=["failed", "converged"]).verify()
    assert [point.verified for point in found] == [None, True]
    assert found[0].defect is found[0].simulated is found[0].simulated_violation is None
    assert "failed" in found.table()
    front = black_box(4)
    again = front.verify()
    assert again is front and [point.verified for point in again] == [None] * 4 and "verified" not in again.table()


@NEAR
@pytest.mark.parametrize(
    ("problem", "values", "k", "rows", "scale"),
    [
        pytest.param(cart(), (0.5, 1.0, 1.5), 0, [1], 2.0, id="its range over the front"),
        pytest.param(cart(of_objective=50.0), (0.5, 1.0), 1, [0], 50.0, id="its stated scale"),
        pytest.param(cart(), (1.0, 1.0 + 1e-9), 1, [0, 1], 2.0, id="its size, if it hardly varies"),
    ],
)
def test_an_objective_is_judged_by(share, good, problem, values, k, rows, scale):
    front = points(problem, *constant(*values))
    assert objective_scales(front)[k] == pytest.approx(scale)
    F = np.array(front.F)
    F[rows, k] -= share * 1e-3 * scale
    found = front.replace(F=F).verify()
    assert [i for i in range(len(front)) if not found.verified[i]] == ([] if good else rows)
    said = "" if good else f"simulated, its '{front.names[k]}' differs by {1.1e-3 * scale:.2g} {front.units[k]}".rstrip()
    assert {found.notes[i] for i in rows} == {said}


@pytest.mark.parametrize(("off", "good"), [(1e-10, True), (1e-8, False)])
def test_an_objective_near_zero_is_judged_by_how_much_it_varies_within_the_bounds(off, good):
    """All of its values are 0, or as good as that; anywhere within the bounds it is of the order of 1."""
    front = points(cart(), [1e-7] * 4)
    assert 1e-7 < objective_scales(front)[1] < 1e-5
    assert front.replace(F=[[-2e-7, 2e-14 + off]]).verify().verified.tolist() == [good]


@NEAR
def test_states_are_judged_by_the_spans_of_their_bounds(share, good):
    """After two seconds x, within [-5, 5], is 0.01 times `share` less than planned."""
    found = slowed(points(cart(of_objective=1e6), *constant(1.0)), 0.005 * share).verify()
    assert found[0].verified is good and found.defect[0] == pytest.approx(1e-3 * share, rel=1e-6)
    assert found.notes[0] == ("" if good else "simulated, its states differ by 1.1e-03 of their bounds")


@pytest.mark.parametrize("limits", [{"lower": 200.0}, {"lower": 200.0, "upper": 200.0}, {"lower": 200.0, "scale": 0.1}])
@NEAR
def test_equalities_and_limits_on_one_side_have_at_least_their_size_as_scale(limits, share, good):
    """By default their scale is 1, and what is 0.2 short of 200 would violate it by 20 %."""
    found = slowed(points(cart(of_objective=1e6, **limits), *constant(1.0)), 1e-3 * share).verify()
    assert found[0].verified is good and found.simulated_violation[0] == pytest.approx(1e-3 * share, rel=1e-6)
    assert found.notes[0] == ("" if good else "simulated, it violates constraint 'enough' by 1.1e-03")
    assert found[0].simulate().violation > 0.05


@pytest.mark.parametrize(
    ("limit", "scale"),
    [
        (Limit("a", -np.inf, -300.0), 300.0),
        (Limit("a", 0.0, np.inf), 1.0),
        (Limit("a", 0.0, 0.0, 5.0), 5.0),
        (Limit("a", 299.0, 300.0), 1.0),
        (Variable("a", 7.0, 7.0, scale=2.0), 7.0),
    ],
)
def test_the_scale_of_a_limit(limit, scale):
    assert verified_scale(limit) == scale


def test_controls_may_not_leave_their_bounds_between_nodes():
    """Values at the three Gauss points of one element: the parabola through 2, 2, 1 is more than 2 between the first two."""
    inside, outside = points(cart(), [1.0, 1.0, 1.0], [2.0, 2.0, 1.0], method=DFET(1, 2)).verify()
    assert inside.verified and not outside.verified and outside.violation < 1e-9
    # With nodes at -s, 0 and s, where s^2 = 3 / 5, u = 2 - t / (2 s) - 5 t^2 / 6 is greatest at t = -s / 2.
    assert outside.simulated_violation == pytest.approx(0.125 / 2.0, rel=1e-2)
    assert outside.note.startswith("simulated, it violates bounds of run.u by") and ", " not in outside.note.removeprefix("simulated, ")


@given(
    arrays(float, (5, 2), elements=st.sampled_from([0.0, 4e-4, 2e-3, 5e-3])),
    st.lists(st.integers(0, 4), min_size=1, max_size=7),
    st.lists(st.integers(0, 4), max_size=3),
)
@settings(max_examples=40, deadline=None)
def test_points_are_judged_alike_whatever_others_are_there(off, rows, more):
    """Any part, order and union of a front, also of such parts that were marked again."""
    front, judge = five_points()
    marked = judge(front.replace(F=front.F - off), VERIFY)
    part = marked[rows]
    again = judge(part, VERIFY)
    assert_same_judgement(again, part)
    assert_same_judgement(judge(Points.concatenate([again, marked[more]]), VERIFY), marked[[*rows, *more]])
    assert_same_judgement(judge(judge(part, 0.1), VERIFY), part, rel=1e-12)


@lru_cache
def five_points():
    """A front, and what judges its points, with simulations that are made once."""
    front = points(cart(), *constant(0.3, 0.5, 0.9, 1.0, 1.6))
    return front, partial(verified, simulations=Simulations(front.compiled(), VERIFY))


def assert_same_judgement(one, other, rel=0.0):
    assert one.verified.tolist() == other.verified.tolist()
    assert one.tolerances == pytest.approx(other.tolerances, rel=rel, abs=0.0)


def test_fixed_by_the_ends_that_simulate():
    """The range of what the first end claims is 50 times as wide. With two points or fewer there is another range, or none."""
    front = points(cart(), *constant(0.5, 1.0, 1.5))
    last = slowed(front[[2]], 0.5)
    marked = Front.of(Points.concatenate([front[:2], last.replace(F=[[-100.0, 100.0]])])).verify()
    assert marked.verified.tolist() == [True, True, False] and marked.tolerances == pytest.approx(np.array([[1e-3, 1.5e-3]] * 3))
    assert marked[1].tolerances == pytest.approx({"distance": 1e-3, "effort": 1.5e-3}) and front[0].tolerances is None
    other = points(cart(), *constant(0.1, 1.9)).verify()
    merged = Front.merge([marked[:2], other])
    assert merged.tolerances[:, 0].tolist() == pytest.approx([3.6e-3, 1e-3, 1e-3, 3.6e-3])
    assert_same_judgement(merged.verify(), merged)


def test_what_a_point_misses_does_not_depend_on_those_beside_it():
    """To the last bit: where errors grow e^10 times, last digits of an integrator are what is judged."""
    problem = Problem("pole")
    phase = problem.phase("run", t0=0.0, tf=1.0)
    x = phase.state("x", bounds=(-1e5, 1e5), initial=0.0)
    phase.dynamics(x=10.0 * x + phase.control("u", bounds=(-9, 9)))
    problem.maximize("end", phase.final(x))
    front = points(problem, [1.0, 2.0, -1.0, 3.0], [4.0, -2.0, 0.0, 1.0], [9.0, 9.0, -9.0, 0.5])
    every = front.verify()
    for rows in ([1], [2, 0], [1, 2]):
        part = front[rows].verify()
        assert part.defect.tolist() == every.defect[rows].tolist() and part.simulated_F.tolist() == every.simulated_F[rows].tolist()


@pytest.mark.parametrize("arguments", [{}, {"until": 1e-6}, {"until": MESH, "solves": 2}])
def test_points_that_are_solved_again_keep_their_tolerances(arguments):
    """One whose effort is not least, and that is more than it claims."""
    rough = points(cart(), [0.2, 0.8, 0.2, 0.8]).replace(tolerances=[[1e-3, 1.5e-3]], within=[1e-3])
    found = rough.replace(F=rough.F - 0.1).verify().refine(**arguments)
    assert not np.array_equal(found.decision[0], rough.decision[0]) and found.verified.all()
    assert found.tolerances == pytest.approx(np.array([[1e-3, 1.5e-3]] * len(found)))


@pytest.mark.parametrize(("offset", "size"), [(0.0, 1.0), (-1.0, 2.0), (50.0, 51.0)])
def test_a_single_objective_is_judged_by_its_size_or_that_of_its_terms(offset, size):
    """The least of the square of u over a second, which moves x by 1, is 1."""
    problem = Problem("haul")
    phase = problem.phase("run", t0=0.0, tf=1.0)
    phase.state("x", bounds=(-5, 5), initial=0, final=1)
    u = phase.control("u", bounds=(-9, 9))
    phase.dynamics(x=u)
    problem.minimize("effort", phase.integral(u**2) + offset)
    assert optimize(problem, MESH, starts=1).tolerances == pytest.approx({"effort": 1e-3 * size})


@pytest.mark.slow
@pytest.mark.parametrize(("name", "method"), [("goddard", DFET(2, 4)), ("orbit_rise", DFET(3, 4)), ("skip", DFET(4, 3))])
def test_cases_are_judged_alike(name, method):
    front, rng = sweep(load(name), method, points=5, starts=1, seed=1), np.random.default_rng(0)
    assert front.tolerances.shape == (len(front), 2) and (front.tolerances == front.tolerances[0]).all()
    for _ in range(3):
        rows = rng.permutation(len(front))[: rng.integers(1, len(front) + 1)]
        assert_same_judgement(front[rows].verify(), front[rows])


def test_notes_of_an_earlier_simulation_are_replaced():
    front = slowed(points(cart(), *constant(1.0)), 0.01).replace(notes=["solved twice"])
    strict = front.verify()
    assert strict[0].note.startswith("solved twice; simulated, its states differ by 2.0e-03 of their bounds")
    loose = strict.verify(0.1)
    assert loose.verified.all() and loose.notes == ("solved twice",) and loose.stats["verify"] == 0.1
    again = loose.verify(1e-3)
    assert again.notes == strict.notes and again.stats == strict.stats


def test_an_error_that_grows_by_itself_is_called_unstable():
    """x' = 40 x + u multiplies what is off in the first element by e^40, whatever the mesh; a mesh that is too coarse is not excused so."""
    problem = Problem("pole")
    phase = problem.phase("run", t0=0.0, tf=1.0)
    x = phase.state("x", bounds=(-2, 2), initial=0.0)
    u = phase.control("u", bounds=(-100, 100))
    phase.dynamics(x=40.0 * x + u)
    problem.minimize("miss", phase.integral((x - 1.0) ** 2 + 1e-4 * u**2))
    fine, coarse = (optimize(problem, mesh, starts=1) for mesh in (DFET(20, 5), DFET(3, 1)))
    assert fine.status == coarse.status == "converged" and fine.verified is coarse.verified is False
    assert "the dynamics are unstable, and no simulation without feedback can follow them" in fine.note
    assert "its states differ by" in coarse.note and "unstable" not in coarse.note


def test_a_simulation_that_diverges_says_where():
    """x' = x^4 from 1 is infinite after a third of a second, in the second of nine elements."""
    problem = Problem("blow-up")
    phase = problem.phase("run", t0=0.0, tf=2.7)
    x = phase.state("x", bounds=(-5, 5), initial=1.0)
    phase.dynamics(x=x**4 + phase.control("u", bounds=(-1, 1)))
    problem.maximize("end", phase.final(x))
    (point,) = points(problem, [0.0] * 9, method=DFET(9, 0)).verify(1.0)
    assert not point.verified and point.note.startswith("simulated, it diverges in phase 'run' between t = 0.3 and 0.6 s: 'x' is ")


def test_an_error_of_one_element_in_the_middle_is_not_called_unstable():
    """A wind that changes too fast for the first element, while the second, without thrust, is exact."""
    problem = Problem("gust")
    phase = problem.phase("run", t0=0.0, tf=2.0)
    x = phase.state("x", bounds=(-5, 5), initial=0)
    u = phase.control("u", bounds=(0, 2))
    phase.dynamics(x=u * ca.sin(9.0 * phase.time))
    problem.maximize("distance", phase.final(x))
    (point,) = points(problem, [2.0, 2.0, 0.0, 0.0]).verify()
    assert not point.verified and "its states differ by" in point.note and "unstable" not in point.note


def test_none_means_that_nothing_is_simulated():
    front = MACS(agents=4, archive=4).solve(cart(), MESH, evaluations=40, seed=1, verify=None)
    assert len(front) and not front.was_simulated.any() and not front.verified.any() and "verify" not in front.stats
    table = front.table(details=True)
    assert "defect" not in table and "between nodes" in table
    assert optimize(cart(), MESH, verify=None, starts=1).verified is None
    once = NSGA2(population=4).solve(cart(), SingleShooting(4), evaluations=8, seed=1)
    assert once.was_simulated.all() and once.verify(None).stats["verify"] == VERIFY


@pytest.mark.parametrize("wrong", [0, -1e-3, float("nan"), "much", True])
def test_a_tolerance_is_a_positive_number(wrong):
    front = points(cart(), *constant(1.0))
    for call in (
        front.verify,
        lambda verify: MACS().solve(cart(), MESH, evaluations=10**9, verify=verify),
        lambda verify: optimize(cart(), MESH, verify=verify, starts=1),
    ):
        with pytest.raises(ValueError, match="verify must be a positive number"):
            call(wrong)


def test_a_search_is_not_lost_if_its_points_cannot_be_simulated(monkeypatch, caplog):
    def fails(*_, **__):
        raise RuntimeError("no\nair")

    monkeypatch.setattr("macs.fronts.verified.simulate", fails)
    front = MACS(agents=4, archive=4).solve(cart(), MESH, evaluations=40, seed=1)
    assert len(front) and not front.was_simulated.any() and "no air" in front.message and "no air" in front.table()
    assert "the search left it" in caplog.text
    with pytest.raises(RuntimeError, match="no"):
        front.verify()


def test_tables_set_apart_what_is_not_verified():
    front = points(cart(), *constant(0.5, 1.0, 1.5))
    found = front.replace(F=front.F - [[0.0, 0.0], [0.1, 0.0], [0.0, 0.0]]).verify()
    lines = found.table().split("\n")
    at = lines.index("Not verified: simulated, these differ by more than 0.001.")
    assert [line.split()[0] for line in lines[at - 3 : at + 2] if line] == ["0", "2", "Not", "1"]
    assert lines[at + 1].endswith("not verified") and any(line.startswith("2 of 3 points are verified. front.mended() ") for line in lines)
    assert "Point 1: simulated, its 'distance' differs by 0.1 m." in lines
    assert "The point is not verified." in found[[1]].table() and "None of 2 points is verified." in found[[1, 1]].table()


def test_a_trajectory_is_simulated_once(monkeypatch):
    """Also if others judge it by other ranges."""
    seen, simulate = [], module.simulate
    monkeypatch.setattr(module, "simulate", lambda problem, one, **about: seen.append(one) or simulate(problem, one, **about))
    front = points(cart(), *constant(0.5, 1.0, 1.5))
    simulations = Simulations(front.compiled(), VERIFY)
    first = verified(front[[0, 2]], VERIFY, simulations=simulations)
    assert len(seen) == 2
    every = verified(front, VERIFY, simulations=simulations)
    assert len(seen) == 3 and seen[2] is front.trajectories[1]
    again = verified(every[::-1], VERIFY, simulations=simulations)
    assert first.verified.all() and again.verified.all()
    np.testing.assert_array_equal(again.simulated_F[::-1], every.simulated_F)
    wrong = front.replace(F=front.F + np.array([[0.0, 0.0], [0.2, 0.0], [0.0, 0.0]]))
    assert verified(wrong, VERIFY, simulations=simulations).verified.tolist() == [True, False, True]
    assert verified(wrong, VERIFY, np.full(2, 1e3), simulations=simulations).verified.all() and len(seen) == 3
    assert front.verify().simulated_F == pytest.approx(every.simulated_F, rel=1e-9) and len(seen) == 6


def test_the_largest_miss_is_what_is_compared_with_the_tolerance():
    front = points(cart(lower=150.0), *constant(0.5, 1.0, 1.5))
    marked, simulations = front.verify(), Simulations(front.compiled(), VERIFY)(front.trajectories)
    scales = objective_scales(front)
    misses = np.array([largest_miss(front.compiled(), one, F, scales) for one, F in zip(simulations, front.F, strict=True)])
    assert misses == pytest.approx(np.maximum(marked.defect, marked.simulated_violation), abs=1e-8) and misses.max() > 0.1
    off = largest_miss(front.compiled(), simulations[1], front.F[1] + [0.0, 0.3 * scales[1]], scales)
    assert off == pytest.approx(max(0.3, misses[1]), abs=1e-8)


def test_constraints_without_names_are_evaluated_again_too():
    def problem(least: float):
        return plain_problem(lambda X: (np.hstack([X, 1 - X]), least - X), [(0, 1)], names=["a", "b"], name="segment")

    front = MACS(archive=10).solve(problem(0.5), evaluations=100, seed=1)
    assert len(front) == 10 and front.verified.all() and all(set(found) == {"g1"} for found in front.violations)
    assert "the nearest violates g1 by 1 of its scale" in MACS().solve(problem(2.0), evaluations=100, seed=1).message
