"""Simulators: functions of one design, which may fail, side by side and until Ctrl-C."""

import os
import signal
import sqlite3
import threading
import time
from contextlib import closing
from multiprocessing import get_context

import numpy as np
import pytest

from macs import MACS, NSGA2
from macs.evaluation.blackbox import RowCache
from problems import VectorProblem, load


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


def counting(rows: list, limit: float | None = None, spoil=lambda x: None) -> VectorProblem:
    problem = VectorProblem("counting")
    problem.variable("x", bounds=(0, 1))
    problem.variable("n", bounds=(1, 9), integer=True)
    problem.minimize("near")
    problem.minimize("far")

    @problem.row(limit=limit)
    def simulate(design):
        spoil(design["x"])
        rows.append(tuple(design.values()))
        return {"near": design["x"] + 1 / design["n"], "far": 2 - design["x"] + design["n"] / 9}

    return problem


def test_rows_on_disk_serve_any_later_search_and_give_the_same_front(tmp_path):
    rows, path = list[tuple](), tmp_path / "rows.sqlite"
    without = MACS().solve(counting(rows), evaluations=120, seed=1, verify=None)
    rows.clear()
    first = MACS().solve(counting(rows), evaluations=80, seed=1, verify=None, cache=path)
    twice = first.stats.get("from_cache", 0)  # a search may propose the same row again
    assert twice < 10 and len(rows) == 80 - twice + 8  # and those by which the problem is known
    rows.clear()
    longer = MACS().solve(counting(rows), evaluations=120, seed=1, verify=None, cache=path)
    assert np.array_equal(longer.F, without.F) and np.array_equal(longer.decision, without.decision)
    known = longer.stats["from_cache"]
    assert len(rows) == 120 - known + 8 and known >= 80 and longer.stats["evaluations"] == 120
    assert f"Of 120 evaluations, {known} came from the cache." in longer.table()
    other = NSGA2(population=10).solve(counting(rows), evaluations=50, seed=1, start=longer, verify=None, cache=path)
    assert 10 <= other.stats["from_cache"] < 50
    fronts = [MACS().minimize(lambda X: X @ [[1.0, -1.0]], [(0, 1)], evaluations=30, seed=1, cache=path) for _ in range(2)]
    assert fronts[1].stats["from_cache"] == 30 and np.array_equal(fronts[0].F, fronts[1].F)


def test_a_cache_keeps_no_errors_and_is_of_one_problem_one_process_and_one_kind(tmp_path):
    path, rows = tmp_path / "rows.sqlite", list[tuple]()

    def spoil(x: float) -> None:
        if x > 0.5:
            raise ValueError("no licence")

    MACS().solve(counting(rows, spoil=spoil), evaluations=60, seed=1, verify=None, cache=path)
    before = len(rows)
    front = MACS().solve(counting(rows, spoil=spoil), evaluations=60, seed=1, verify=None, cache=path)
    assert front.stats["from_cache"] == 60 - front.stats["failures"]["failed"] and len(rows) == before + 1  # of the eight, one is below
    well = MACS().solve(counting(rows), evaluations=60, seed=1, verify=None, cache=path)
    assert well.stats.get("from_cache", 0) < 10  # its values at the rows by which it is known are others
    with closing(RowCache(path, "one")), pytest.raises(ValueError, match="cannot be used, perhaps since another search does"):
        RowCache(path, "two")
    (tmp_path / "text").write_text("not a database, though long enough to be one " * 20)
    with pytest.raises(ValueError, match="is no cache of rows"):
        RowCache(tmp_path / "text", "one")
    sqlite3.connect(tmp_path / "other").execute("CREATE TABLE rows (a)").connection.commit()
    with pytest.raises(ValueError, match="is no cache of rows"):
        RowCache(tmp_path / "other", "one")
    with pytest.raises(ValueError, match="cache is for rows of vector problems, and 'goddard' has trajectories"):
        MACS().solve(load("goddard"), cache=path)


@pytest.mark.slow
def test_a_row_beyond_its_limit_or_one_that_ends_its_process_has_failed():
    def spoil(x: float) -> None:
        if 0.3 < x < 0.33:
            time.sleep(100.0)
        if 0.9 < x < 0.93:
            os._exit(3)

    began = time.perf_counter()
    front = MACS().solve(counting([], 0.5, spoil), evaluations=100, seed=3)
    assert time.perf_counter() - began < 60.0 and front.verified.all() and len(front) > 5
    assert 0 < front.stats["failures"]["failed"] < 20
    X = np.array([[0.31, 2.0], [0.91, 2.0], [0.5, 2.0]])
    compiled = counting([], 0.5, spoil).compile()
    late, died, good = (compiled.attempt(row, "evaluate") for row in X)
    assert late == "TimeoutError: it took longer than 0.5 s" and died == "RuntimeError: it ended its process"
    assert np.array_equal(good[0], [[1.0, 1.5 + 2 / 9]])
    assert compiled.fingerprint == counting([]).compile().fingerprint


def test_a_limit_is_above_nothing():
    with pytest.raises(ValueError, match="the limit of a row must be"):
        counting([], 0)


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
