import os
import pickle
import subprocess
import sys

import casadi as ca
import numpy as np
import pytest

from problems import Problem

GRID = np.linspace(0.0, 1.0, 5)


def rich(**changes) -> Problem:
    """A problem with something of everything; `changes` alter one thing each."""
    c = {
        "name": "rich", "tf": (1.0, 2.0), "bounds": (0, 10), "initial": 5, "rate": 1.0, "limit": 1.0, "scale": None, "unit": "m",
        "period": None, "sense": "minimize", "weight": 1.0, "states": None, "table": 0.0, "mass": (1, 2), "time_unit": "s",
        "duration": None,
        "path": 3.0, "objective": "cost", "integrand": 1.0,
    }  # fmt: skip
    c |= changes
    problem = Problem(c["name"])
    mass = problem.parameter("mass", bounds=c["mass"])
    look = ca.interpolant("table", "bspline", [GRID], GRID**2 + c["table"])
    phases = []
    for name, t0, tf in (("up", 0.0, c["tf"]), ("down", (1.0, 3.0), (2.0, 4.0))):
        phase = problem.phase(name, t0=t0, tf=tf, time_unit=c["time_unit"], duration=c["duration"])
        x = phase.state("x", bounds=c["bounds"], initial=c["initial"] if name == "up" else None, unit=c["unit"], scale=c["scale"])
        phase.state("y", bounds=(0, 10))
        u = phase.control("u", bounds=(-1, 1), period=c["period"])
        phase.dynamics(x=u * c["rate"] / mass + look(phase.time / 4), y=x)
        phase.path("p", x * u, upper=c["path"])
        phases.append(phase)
    problem.link(*phases, states=c["states"])
    problem.constraint("c", phases[0].final(phases[0]["x"]), upper=c["limit"])
    getattr(problem, c["sense"])(c["objective"], c["weight"] * phases[1].tf + phases[0].integral(c["integrand"] * phases[0]["u"] ** 2))
    problem.minimize("top", phases[1].peak(phases[1]["x"]))
    return problem


def test_the_fingerprint_is_that_of_the_statement():
    assert rich().compile().fingerprint == rich().compile().fingerprint
    guessed = rich()
    guessed.guess(mass=1.5)
    guessed.phases["up"].guess(x=(1, 2))
    assert guessed.compile().fingerprint == rich().compile().fingerprint


@pytest.mark.parametrize(
    "change",
    [
        {"name": "poor"}, {"tf": (1.0, 2.5)}, {"bounds": (0, 11)}, {"initial": 4}, {"initial": None}, {"rate": 1.0 + 1e-12}, {"limit": 1.1},
        {"scale": 3.0}, {"unit": "km"}, {"period": 2.0}, {"sense": "maximize"}, {"weight": 2.0}, {"states": ["x"]}, {"table": 1e-9},
        {"mass": (1, 3)}, {"time_unit": "min"}, {"duration": (0.5, 3)}, {"path": 3.1}, {"objective": "price"}, {"integrand": 2.0},
    ],
    ids=str,
)  # fmt: skip
def test_the_fingerprint_changes_with_anything_that_matters(change):
    assert rich(**change).compile().fingerprint != rich().compile().fingerprint


SCRIPT = """
import pickle, sys
sys.path.insert(0, {here!r})
from test_compiled import rich
compiled = pickle.loads(sys.stdin.buffer.read())
again = rich().compile()
assert again.fingerprint == compiled.fingerprint, "another process, another fingerprint"
sys.stdout.buffer.write(pickle.dumps((compiled, again.fingerprint)))
"""


def test_a_compiled_problem_travels_to_another_process_and_back():
    compiled = rich().compile()
    here = os.path.dirname(__file__)  # noqa: PTH120
    done = subprocess.run([sys.executable, "-c", SCRIPT.format(here=here)], input=pickle.dumps(compiled), capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()
    back, fingerprint = pickle.loads(done.stdout)
    assert back.fingerprint == fingerprint == compiled.fingerprint
    x, u, t, s = [1.0, 2.0], [0.3], 0.4, [0.0, 1.0, 1.5]
    assert np.array_equal(np.array(back.phases[0].dynamics(x, u, t, s)), np.array(compiled.phases[0].dynamics(x, u, t, s)))
    assert back.limits == compiled.limits and back.goals == compiled.goals and back.links == compiled.links


def test_functions_are_those_that_were_stated():
    compiled = rich().compile()
    phase = compiled.phases[0]
    x, u, t, s = [1.0, 2.0], [0.3], 0.4, [0.0, 1.0, 1.5]
    assert np.array(phase.dynamics(x, u, t, s)).ravel() == pytest.approx([0.3 / 1.5 + 0.1**2, 1.0], abs=1e-3)
    assert float(phase.path(x, u, t, s)) == pytest.approx(0.3)
    assert float(phase.integrands(x, u, t, s)) == pytest.approx(0.09)
    assert phase.n_quantities == 4 and compiled.phases[1].n_quantities == 3
    assert np.array(compiled.objectives([0, 1, 7, 5], [1, 3, 9], [1.5])).ravel() == pytest.approx([8, 9])
    assert float(compiled.constraints([0, 1, 7, 5], [1, 3, 9], [1.5])) == pytest.approx(7)


def test_the_fingerprint_of_a_table_outlives_its_derivatives():
    """CasADi keeps a table's derivatives with the table once asked for: what was solved must still be the problem of a fresh process."""
    table = ca.interpolant("table", "bspline", [np.linspace(-1, 2, 8).tolist()], np.linspace(-1, 2, 8) ** 2)

    def statement():
        problem = Problem("table")
        phase = problem.phase("run", t0=0, tf=(1, 2))
        x = phase.state("x", bounds=(-1, 2), initial=0)
        phase.dynamics(x=table(x) + phase.control("u", bounds=(0, 1)))
        problem.minimize("time", phase.tf)
        return problem

    before = statement().compile()
    fresh = before.fingerprint
    before.phases[0].dynamics.jacobian()(0.5, 0.5, 0.0, [0.0, 1.0], 0)
    assert statement().compile().fingerprint == fresh
