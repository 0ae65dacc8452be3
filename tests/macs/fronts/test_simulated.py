"""A front as simulated by an independent integrator, with its own and with other problem data."""

import numpy as np
import pytest

from macs import NSGA2, Front
from problems import Problem
from transcription import SingleShooting


def push(mass: float = 2.0, unit: str = "m", drag: float = 0.0, most: float = 2.0, end: float = 4.0, start: float = 0.0, **more) -> Problem:
    """v' = u / mass, from rest: under a constant u on each second, everything is a sum."""
    problem = Problem("push")
    phase = problem.phase("run", t0=0.0, tf=end)
    x = phase.state("x", bounds=(0, 100), initial=start, unit=unit)
    v = phase.state("v", bounds=(0, 50), initial=0)
    u = phase.control("u", bounds=(0, most))
    phase.dynamics(x=v, v=u / mass - drag * v)
    for name, upper in more.items():
        phase.path(name, v, upper=upper, scale=1.0)
    problem.maximize("distance", phase.final(x), unit=unit)
    problem.minimize("effort", phase.integral(u))
    return problem


@pytest.fixture(scope="module")
def front() -> Front:
    return NSGA2(population=12).solve(push(), SingleShooting(5), evaluations=48, seed=1, inner="propagate")


def by_hand(point, mass: float) -> tuple[float, float]:
    """Distance and effort of constant controls on four seconds."""
    x, v, thrust = 0.0, 0.0, point.trajectory["run"].control.coefficients.ravel()
    for u in thrust:
        x, v = x + v + 0.5 * u / mass, v + u / mass
    return x, thrust.sum()


def test_a_front_flown_again_as_stated_and_under_other_data(front):
    again = front.simulate()
    assert len(again) == len(front) and (again.status == "converged").all()
    np.testing.assert_allclose(again.F, front.F, rtol=1e-6)
    for point, flight in zip(front, again, strict=True):
        assert list(flight.objectives.values()) == pytest.approx(by_hand(point, 2.0), rel=1e-5)
        assert flight.trajectory["run"].edge_states[-1, 0] == pytest.approx(flight.objectives["distance"])
        assert flight.violations["bounds of run.x"] == 0
    heavy = push(mass=4.0)
    other = front.simulate(heavy)
    assert other.problem.fingerprint == heavy.compile().fingerprint != front.problem.fingerprint
    for point, flight in zip(front, other, strict=True):
        assert list(flight.objectives.values()) == pytest.approx(by_hand(point, 4.0), rel=1e-5)
    np.testing.assert_allclose(other.objectives[:, 0], 0.5 * front.objectives[:, 0], rtol=1e-5)
    np.testing.assert_array_equal([p.decision for p in other], [p.decision for p in front])
    # What a simulation of the front's own problem found is not true of another.
    assert front.verified.all() and front.was_simulated.all()
    other = front.simulate(push(mass=4.0))
    assert not other.verified.any() and not other.was_simulated.any() and "verify" not in other.stats
    assert len(Front.merge([other])) == len(other) == len(front)


def test_points_that_become_infeasible_have_this_status_and_do_not_merge(front):
    speeds = np.array([point.trajectory["run"]["v"][-1] for point in front])
    limit = float(np.median(speeds)) + 0.013
    limited = front.simulate(push(gate=limit), tolerance=1e-3)
    assert (limited.violation > 1e-3).tolist() == (speeds > limit + 1e-3).tolist()
    assert set(limited.status[speeds > limit + 1e-3]) == {"infeasible"}
    assert len(Front.merge([limited])) == (speeds <= limit + 1e-3).sum()
    assert (front.simulate(push(gate=limit), tolerance=100.0).status == "converged").all()
    merged = Front.merge([front.simulate(push(gate=-1.0), tolerance=1e-3)])
    assert not len(merged) and merged.closest is not None
    assert "the nearest violates path 'gate' of 'run' by " in merged.message


def test_simulated_fronts_are_saved_like_others(front, tmp_path):
    front.save(tmp_path / "front.nc")
    loaded = Front.load(tmp_path / "front.nc", push())
    np.testing.assert_allclose(loaded.simulate().F, front.simulate().F, rtol=1e-9)
    again = front.simulate()
    again.save(tmp_path / "simulated.nc")
    back = Front.load(tmp_path / "simulated.nc", push())
    np.testing.assert_array_equal(back.F, again.F)
    np.testing.assert_allclose(back[0].trajectory["run"].at(2.2)["x"], again[0].trajectory["run"].at(2.2)["x"])


def test_other_problems_are_refused_by_what_differs(front):
    problem = Problem("pull")
    phase = problem.phase("run", t0=0.0, tf=4.0)
    phase.state("x", bounds=(0, 100), initial=0)
    phase.dynamics(x=phase.control("u", bounds=(0, 2)))
    problem.minimize("effort", phase.final(phase["x"]))
    with pytest.raises(ValueError, match="'push' cannot be simulated with 'pull': its objectives are minimize effort"):
        front.simulate(problem)
    with pytest.raises(ValueError, match=r"objectives are maximize distance \[ft\], .* not maximize distance \[m\]"):
        front.simulate(push(unit="ft"))
    with pytest.raises(ValueError, match="tolerance must not be negative"):
        front.simulate(tolerance=-1.0)
    with pytest.raises(ValueError, match="black box"):
        NSGA2(population=4).minimize(lambda X: X**2, [(0, 1), (0, 1)], evaluations=8, seed=1).simulate()


@pytest.mark.parametrize(
    ("data", "what", "amount"),
    [({"end": 3.0}, "bounds of run.tf", 1.0), ({"start": 50.0}, "initial value of run.x", 0.5), ({"most": 0.01}, "bounds of run.u", None)],
)
def test_what_was_decided_has_to_be_within_the_other_bounds(front, data, what, amount):
    other = front.simulate(push(**data))
    assert set(other.status) == {"infeasible"}
    for point in other:
        thrust = point.trajectory["run"].control.coefficients
        assert point.violations[what] == pytest.approx((thrust.max() - 0.01) / 0.01 if amount is None else amount)
