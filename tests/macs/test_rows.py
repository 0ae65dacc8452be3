"""Simulators: functions of one design, which may fail, side by side and until Ctrl-C."""

import os
import signal
import threading
import time
from multiprocessing import get_context

import numpy as np
import pytest

from macs import MACS
from problems import VectorProblem


def spring(fails=lambda design: False, also=None) -> VectorProblem:
    problem = VectorProblem("spring")
    problem.variable("d", bounds=(0.01, 0.06), unit="m")
    problem.variable("turns", bounds=(3, 10), integer=True)
    problem.variable("material", choices=["steel", "carbon"])
    problem.minimize("mass")
    problem.maximize("stiffness")

    @problem.row
    def simulate(design):
        assert isinstance(design["turns"], int)
        if fails(design):
            raise ValueError("coils do not fit")
        density, modulus = {"steel": (7850.0, 210.0), "carbon": (1600.0, 135.0)}[design["material"]]
        stiffness = modulus * design["d"] if design["d"] < 0.055 else None
        return {"mass": density * design["d"] ** 2 * design["turns"], "stiffness": stiffness, "travel": 3.0} | (also or {})

    return problem


def test_designs_that_fail_are_counted_and_the_first_is_named():
    front = MACS().solve(spring(lambda design: design["d"] * design["turns"] > 0.3), evaluations=200, seed=1)
    failed, first = front.stats["failures"]["failed"], front.stats["first_failure"]
    assert 0 < failed < 150 and len(front) > 5 and front.verified.all()
    assert "at d = " in first and "material = " in first and f"{failed} evaluations failed; the first: {first}." in front.table()


def test_where_all_fail_the_search_ends_early_and_says_why():
    front = MACS().solve(spring(lambda design: True), evaluations=5000, seed=1)
    assert not len(front) and front.stats["stopped"] == "failed" and front.stats["evaluations"] < 300
    assert "all of them failed, the first: ValueError: coils do not fit, at d = 0.0" in front.message


def test_what_a_row_does_not_return_is_named():
    problem = VectorProblem("p")
    problem.variable("x", bounds=(0, 1))
    problem.minimize("cost")
    problem.row(lambda design: {"costs": 1.0})
    front = MACS().solve(problem, evaluations=300, seed=1)
    assert "problem 'p': its function did not return 'cost'" in front.message


@pytest.mark.slow
def test_any_number_of_workers_gives_the_same_bits():
    def slow(X):
        time.sleep(0.03 * len(X))
        return np.stack([X[:, 0], np.exp(-X[:, 0]) + X[:, 1]], axis=1)

    one, two = (MACS().minimize(slow, [(0, 1)] * 2, evaluations=150, seed=1, workers=count) for count in (1, 2))
    assert np.array_equal(one.F, two.F) and np.array_equal(one.decision, two.decision)


def square(x: float) -> float:
    time.sleep(0.2)
    return x * x


@pytest.mark.slow
def test_ctrl_c_ends_a_search_that_waits_for_a_pool_whose_processes_died_of_it():
    with get_context("fork").Pool(2) as pool:

        def function(X):
            return np.column_stack([pool.map(square, X[:, 0].tolist()), 1 - X[:, 0]])

        def interrupt() -> None:
            for pid in [*(one.pid for one in pool._pool), os.getpid()]:
                os.kill(pid, signal.SIGINT)

        timer = threading.Timer(3.0, interrupt)
        timer.start()
        began = time.perf_counter()
        front = MACS().minimize(function, [(0, 1)], evaluations=10_000, seed=1)
        assert front.stats["stopped"] == "interrupted" and time.perf_counter() - began < 5.0
