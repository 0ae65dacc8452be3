"""Pieces of work side by side: the same results, exceptions and ends, wherever they are done."""

from __future__ import annotations

import logging
import os
import re
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool

import numpy as np
import pytest

from macs import MACS, Front, sweep
from macs.io import workers as module
from macs.io.workers import Helpers, each, processes
from problems import load
from transcription import DFET
from transcription.stopping import stopped_by, stopping


@pytest.fixture
def eager(monkeypatch) -> None:
    """Other processes begin at once, and anew."""
    monkeypatch.setattr(module, "_OWN", {})
    monkeypatch.setattr(Helpers, "_worth", property(lambda self: self._killed < 2 and self._grown < 2))


def until(happened) -> Iterator[None]:
    """As often as it takes, for at most a minute."""
    limit = time.monotonic() + 60.0
    while not happened():
        assert time.monotonic() < limit
        yield


def test_results_have_the_order_of_pieces_wherever_they_are_done(eager):
    seen = set[int]()
    both = lambda: len(seen) == 2  # noqa: E731
    with processes(2):
        for _ in until(both):
            found = each(lambda ten, k: (ten * k, os.getpid()), 10, [(k,) for k in range(20)])
            assert [number for number, _ in found] == [10 * k for k in range(20)]
            seen |= {process for _, process in found}
        for _ in range(9):
            with pytest.raises(ZeroDivisionError):
                each(divmod, 100, [(k,) for k in (3, 0, 5, "seven", 0)])


def test_others_get_further_pieces_while_this_process_is_at_work_on_one(eager, tmp_path):
    here = os.getpid()

    def piece(folder, k, count):
        (folder / str(k)).touch()
        for _ in until(lambda: os.getpid() != here or k == 0 or len(list(folder.iterdir())) == count):
            time.sleep(0.01)
        return os.getpid()

    with processes(2):
        for _ in until(lambda: len(set(each(piece, tmp_path, [(k, 0) for k in (0, 0)]))) == 2):
            pass
        assert each(piece, tmp_path, [(k, 6) for k in range(6)]).count(here) == 1


def test_what_cannot_be_sent_to_other_processes_stays_in_this_one(eager, caplog):
    with caplog.at_level(logging.WARNING), processes(2):
        for _ in range(3):
            assert each(lambda lock, k: (lock.locked(), k), threading.Lock(), [(k,) for k in range(5)]) == [(False, k) for k in range(5)]
    (said,) = [record.getMessage() for record in caplog.records]
    assert said.startswith("one process does the work, since the problem cannot be sent to others: ") and "lock" in said


FROM_A_FILE = """
from beside import rates
from problems import Problem, external

def build():
    problem = Problem("sprint")
    run = problem.phase("run", t0=0.0, tf=(1.0, 9.0))
    run.state("x", bounds=(0, 5), initial=0, final=5)
    run.control("u", bounds=(0, 2))
    run.dynamics(external(rates, states=["x"], controls=["u"]))
    problem.minimize("time", run.tf)
    return problem
"""


def test_a_problem_of_a_file_goes_to_other_processes_with_what_stands_beside_it(eager, tmp_path, caplog):
    (tmp_path / "beside.py").write_text("def rates(states, controls, parameters, time):\n    return controls - 0.1 * states**2\n")
    (tmp_path / "mine.py").write_text(FROM_A_FILE)
    nlp, seen = DFET(2, 2).nlp(load(f"{tmp_path / 'mine.py'}:build").compile()), dict[int, float]()
    middle = 0.5 * (nlp.lower + nlp.upper)[None]
    with processes(2):
        for _ in until(lambda: len(seen) == 2):
            seen.update(each(lambda program, k: (os.getpid(), float(program.evaluate(middle)[1][0])), nlp, [(k,) for k in range(20)]))
    assert len(set(seen.values())) == 1 and not caplog.records


def test_an_executor_does_all_of_the_work():
    with ThreadPoolExecutor(2) as threads, processes(threads):
        assert each(divmod, 100, [(k,) for k in range(1, 20)]) == [divmod(100, k) for k in range(1, 20)]
        assert threading.get_ident() not in each(lambda _, k: threading.get_ident(), None, [(k,) for k in range(9)])
        with pytest.raises(ZeroDivisionError):
            each(divmod, 100, [(k,) for k in (3, 0, 5, "seven", 0)])


class Breaking(ThreadPoolExecutor):
    """An executor whose processes end after so many pieces."""

    left = 0

    def submit(self, do, *arguments):
        self.left -= 1
        return super().submit(do if self.left >= 0 else broken, *arguments)


def broken(*_: object) -> None:
    raise BrokenProcessPool


@pytest.mark.parametrize(("done", "why"), [(0, "needs `if __name__ == '__main__':`"), (3, "was killed, perhaps for want of memory")])
def test_why_processes_of_an_executor_ended(done, why):
    with Breaking(1) as threads, processes(threads), pytest.raises(RuntimeError, match=re.escape(why)):
        threads.left = done
        each(divmod, 100, [(k,) for k in range(1, 20)])


def test_where_the_work_is_to_end_pieces_are_asked_to():
    threads = ThreadPoolExecutor(1)

    def until_asked(_: None, number: int) -> int:
        while not stopping():
            pass
        return number

    asked = iter([False] * 3 + [True] * 10**6)
    with threads, processes(threads), stopped_by(lambda: next(asked)):
        assert each(until_asked, None, [(0,), (1,)]) == [0, 1]


@pytest.mark.slow
def test_what_a_killed_process_had_is_done_again(eager, caplog):
    """At the second time by this process alone."""

    def killed_elsewhere(own: int, number: int) -> int:
        if os.getpid() != own:
            os._exit(1)
        return number

    with caplog.at_level(logging.WARNING), processes(2):
        for _ in until(lambda: len(caplog.records) == 2):
            assert each(killed_elsewhere, os.getpid(), [(k,) for k in range(4)]) == [0, 1, 2, 3]
        assert each(killed_elsewhere, os.getpid(), [(k,) for k in range(4)]) == [0, 1, 2, 3]
    assert [record.getMessage().endswith("by one process from now on") for record in caplog.records] == [False, True]


def test_processes_that_have_grown_begin_anew_and_where_that_does_not_help_this_one_goes_on_alone(eager, monkeypatch, caplog):
    monkeypatch.setattr(module, "_memory", lambda: 1.0)
    module._say.cache_clear()
    with caplog.at_level(logging.WARNING), processes(2) as helpers:
        assert helpers is not None
        for _ in until(lambda: helpers._grown == 2):
            assert each(lambda ten, k: ten * k, 10, [(k,) for k in range(4)]) == [0, 10, 20, 30] and helpers._executor is None
        assert {*each(lambda _, k: os.getpid(), 10, [(k,) for k in range(4)])} == {os.getpid()}
    (said,) = [record.getMessage() for record in caplog.records]
    assert said.startswith("processes begin anew when one of them has more than") and said.endswith("GB of memory")


@pytest.mark.parametrize("wrong", [0, -1, 1.5, True, "some"])
def test_what_is_no_number_of_processes_is_refused_before_any_work(wrong):
    with pytest.raises(ValueError, match=r"workers must be a whole number of at least 1, 'all' or a concurrent\.futures\.Executor"):
        sweep(load("goddard"), points=3, workers=wrong)


@pytest.mark.slow
def test_the_same_bits_with_any_number_of_processes(eager):
    def fronts(workers: int) -> list[Front]:
        problem = load("goddard")
        coarse = sweep(problem, DFET(4, 4), points=6, workers=workers)
        finer = coarse.refine(1e-6, workers=workers)
        return [coarse, finer, MACS().solve(problem, seed=3, workers=workers)]

    first = fronts(1)
    for count in (2, 3):
        for one, other in zip(first, fronts(count), strict=True):
            assert one.F.tobytes() == other.F.tobytes()
            assert all(one.stats[key] == other.stats[key] for key in ("work", "solves_for", "iterations_for", "kept_for"))
            assert np.array_equal(one.simulated_F, other.simulated_F)
