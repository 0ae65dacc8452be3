"""Ctrl-C while a function waits for processes of the user's."""

import os
import signal
import threading
import time
from multiprocessing import get_context

import numpy as np
import pytest

from macs import MACS


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

        threading.Timer(3.0, interrupt).start()
        began = time.perf_counter()
        front = MACS().minimize(function, [(0, 1)], evaluations=10_000, seed=1)
        assert front.stats["stopped"] == "interrupted" and time.perf_counter() - began < 5.0
