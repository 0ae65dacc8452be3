"""Problems as a stranger states them who has read nothing but the public face."""

import os
import subprocess
import sys

import casadi as ca
import numpy as np
import pytest

from macs import MACS, Front
from problems import Problem
from transcription import DFET

LUNAR = """
import casadi as ca
from macs import MACS, Front
from problems import Problem
from transcription import DFET

problem = Problem("lunar ascent")
ascent = problem.phase("ascent", t0=0.0, tf=(100.0, 250.0))            # a number is fixed, a pair is free within it
x  = ascent.state("x",  bounds=(-1, 200), initial=0, unit="km")
vx = ascent.state("vx", bounds=(-10, 10), initial=0, unit="km/s")
y  = ascent.state("y",  bounds=(-1, 11),  initial=0, final=10, unit="km")
vy = ascent.state("vy", bounds=(-10, 10), initial=0, final=0, unit="km/s")
u  = ascent.control("u", bounds=(-ca.pi / 2, ca.pi / 2), unit="rad")
ascent.dynamics(x=vx, vx=4e-3 * ca.cos(u), y=vy, vy=4e-3 * ca.sin(u) - 1.6e-3)
problem.minimize("flight time", ascent.tf, unit="s")
problem.maximize("horizontal speed", ascent.final(vx), unit="km/s")

front = MACS(agents=10, archive=10).solve(problem, DFET(elements=4, order=6), evaluations=EVALUATIONS, seed=1)
print(front.table()); front.plot(); front.save("ascent.nc")
flight = front[3].trajectory    # flight["ascent"].time, flight["ascent"]["y"], flight["ascent"].at(50.0)
check = front[3].simulate(rtol=1e-10)                                  # independent integration of the same controls
print(check.defect["ascent"], check.violation)                         # per state, scaled; and: is it still feasible?
"""


@pytest.mark.slow
def test_the_script_of_the_face_runs_as_it_stands(tmp_path):
    code = LUNAR.replace("EVALUATIONS", "150") + (
        "assert len(flight['ascent'].time) == len(flight['ascent']['y']) and len(flight['ascent'].at(50.0)) == 5\n"
        "assert (front.objectives[:, 0] >= 109.08).all() and (front.violation <= 1e-6).all()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env={**os.environ, "MPLBACKEND": "Agg"}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "flight time" in done.stdout and "horizontal speed" in done.stdout and "'vy'" in done.stdout
    assert (tmp_path / "ascent.nc").is_file() and [path.name for path in tmp_path.iterdir()] == ["ascent.nc"]


def rocket() -> Problem:
    """A sounding rocket: burn, then coast to the top; pay for fuel, size the tank, go high, and keep the load small."""
    problem = Problem("sounding rocket")
    tank = problem.parameter("tank", bounds=(0.2, 0.6), unit="t")
    burn = problem.phase("burn", t0=0, tf=(5, 60), time_unit="s")
    coast = problem.phase("coast", t0=(5, 60), tf=(10, 200), duration=(1, 150), time_unit="s")
    for phase in (burn, coast):
        h = phase.state("h", bounds=(0, 60), initial=0 if phase is burn else None, unit="km")
        ends = {"initial": 0} if phase is burn else {"final": (-0.05, 0.05)}
        v = phase.state("v", bounds=(-1, 2), **ends, unit="km/s")
        drag = 0.3 * ca.exp(-h / 8) * v * ca.fabs(v)
        if phase is burn:
            m = phase.state("m", bounds=(0.3, 1), initial=1, unit="t")
            thrust = phase.control("thrust", bounds=(0, 0.04), unit="t km/s2")
            phase.dynamics(h=v, v=(thrust - drag) / m - 9.81e-3, m=-thrust / 2.5)
            phase.path("dynamic pressure", 0.5 * ca.exp(-h / 8) * v**2, upper=0.12)
            phase.path("used", 1 - m - tank, upper=0)
            fuel = phase.integral(thrust / 2.5)
        else:
            phase.dynamics(h=v, v=-drag / 0.4 - 9.81e-3)
    problem.link(burn, coast)
    problem.constraint("empty", burn.final(m) + tank, upper=1.0)
    problem.maximize("apogee", coast.final(h), unit="km")
    problem.minimize("fuel", fuel + 0.1 * tank, unit="t")
    problem.guess(tank=0.5)
    burn.guess(thrust=0.03, tf=30, h=(0, 10), m=(1, 0.6), v=([0, 30], [0, 0.5]))
    return problem


@pytest.fixture(scope="module")
def front() -> Front:
    return MACS(agents=6, archive=6).solve(rocket(), DFET(elements=4, order=4, basis="bernstein"), evaluations=120, seed=3)


def test_a_strangers_problem_is_solved(front):
    assert len(front) >= 3
    assert front.names == ("apogee", "fuel") and front.senses == ("maximize", "minimize") and front.units == ("km", "t")
    assert (np.diff(front.objectives[:, 0]) > 0).all() and (np.diff(front.objectives[:, 1]) > 0).all(), "sorted, and a trade-off"
    assert (front.violation <= 1e-6).all() and set(front.status) == {"converged"}
    assert front.stats["evaluations"] <= 120 and front.stats["seed"] == 3
    assert np.array_equal(front.F, front.objectives * [-1, 1])
    for point in front:
        flight, check = point.trajectory, point.simulate()
        assert list(flight) == ["burn", "coast"]
        assert check.max_defect < 1e-2 and check.violation < 2e-2
        assert check.objectives["apogee"] == pytest.approx(point.objectives["apogee"], abs=1.0)
        assert flight["coast"].t0 == pytest.approx(flight["burn"].tf)
        assert flight["coast"]["h"][0] == flight["burn"]["h"][-1]
        assert 0.2 <= point.parameters["tank"] <= 0.6
        assert flight["burn"]["dynamic pressure"].max() <= 0.12 + 1e-6
        assert point.objectives["fuel"] == pytest.approx(1 - flight["burn"]["m"][-1] + 0.1 * point.parameters["tank"], abs=1e-5)
        assert 1 - flight["burn"]["m"][-1] <= point.parameters["tank"] + 1e-6


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bits_in_another_process(tmp_path):
    script = tmp_path / "again.py"
    script.write_text(
        LUNAR[: LUNAR.index("front =")]
        + "front = MACS(agents=6, archive=6).solve(problem, DFET(elements=3, order=3), evaluations=120, seed=7)\n"
        + "print(front.objectives.tobytes().hex(), front.decision.tobytes().hex(), len(front))\n"
    )
    first, second = (subprocess.run([sys.executable, script], capture_output=True, text=True, check=True).stdout for _ in range(2))
    assert first == second and len(first) > 100


def test_a_goal_out_of_reach_is_told_by_name():
    problem = Problem("too far")
    run = problem.phase("run", t0=0, tf=(1, 2))
    x = run.state("x", bounds=(-10, 10), initial=0)
    run.dynamics(x=run.control("u", bounds=(-1, 1)))
    problem.constraint("arrival", run.final(x), lower=5, upper=6)
    problem.minimize("time", run.tf)
    problem.maximize("way", run.final(x))
    front = MACS(agents=4, archive=4).solve(problem, DFET(2, 2), evaluations=30, seed=1)
    assert len(front) == 0 and front.objectives.shape == (0, 2) and list(front) == []
    assert "arrival" in front.message
    assert front.closest is not None and front.closest.status != "converged"
    assert front.closest.violation == pytest.approx(3, abs=0.1), "2 is as far as it gets"
    assert max(front.closest.violations, key=front.closest.violations.get) == "constraint 'arrival'"
    assert front.closest.trajectory["run"]["x"][-1] == pytest.approx(2, abs=0.1)
    assert front.closest.simulate().violation == pytest.approx(front.closest.violation, rel=1e-3)


def test_dynamics_that_never_work_give_an_empty_front_not_a_crash():
    problem = Problem("broken")
    run = problem.phase("run", t0=0, tf=(1, 2))
    x = run.state("x", bounds=(-1, 1), initial=-0.5)
    run.dynamics(x=ca.sqrt(x) + run.control("u", bounds=(-1, 1)))
    problem.minimize("time", run.tf)
    problem.maximize("way", run.final(x))
    front = MACS(agents=4, archive=4).solve(problem, DFET(2, 2), evaluations=20, seed=1)
    assert len(front) == 0 and front.message and front.stats["failures"] == {"failed": 20}
    problem = Problem("wrong")
    run = problem.phase("run", t0=0, tf=(1, 2))
    x = run.state("x", bounds=(-1, 1))
    run.dynamics(x=ca.log(-2 - x))
    problem.minimize("time", run.tf)
    seen = []
    with pytest.raises(ValueError, match=r"run.*'x'"):
        MACS().solve(problem, DFET(2, 2), evaluations=10, callback=seen.append)
    assert not seen


@pytest.mark.slow
def test_units_of_any_size():
    """The same flight in metres and in thousands of kilometres is the same front, scaled."""

    def hop(unit: float) -> Front:
        problem = Problem("hop")
        run = problem.phase("run", t0=0, tf=(10, 100))
        x = run.state("x", bounds=(-1e4 * unit, 1e4 * unit), initial=0)
        v = run.state("v", bounds=(-1e3 * unit, 1e3 * unit), initial=0, final=0)
        a = run.control("a", bounds=(-unit, unit))
        run.dynamics(x=v, v=a)
        problem.minimize("time", run.tf)
        problem.maximize("way", run.final(x))
        return MACS(agents=4, archive=4).solve(problem, DFET(2, 2), evaluations=80, seed=2)

    one, large, small = hop(1.0), hop(1e6), hop(1e-6)
    for other, unit in ((large, 1e6), (small, 1e-6)):
        assert len(other) >= 2 and (other.violation <= 1e-6).all()
        best, ours = other.objectives[:, 1].max() / unit, one.objectives[:, 1].max()
        assert best == pytest.approx(ours, rel=0.2)
