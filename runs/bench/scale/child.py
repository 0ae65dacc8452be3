"""Series in processes of their own, whose peak memory is then theirs: `python -m runs.bench.scale.child REPEATS NAME:SIZES ...`."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Sequence
from multiprocessing import get_context

from ...execution.memory import peak_memory
from .series import SERIES, Series

ENOUGH = 4.0
"""Seconds of work at one size after which it is not repeated."""


def main(arguments: Sequence[str]) -> None:
    """Measure series one after the other, each in a process that begins as a copy of this one: so that modules are imported once."""
    repeats, *tasks = arguments
    os.environ["MACS_COMPILE"] = "0"  # a compiler is a process of its own, and its time not proportional to anything
    for task in tasks:
        name, sizes = task.split(":")
        series = next(one for one in SERIES if one.name == name)
        process = get_context("fork").Process(target=measure, args=(series, [int(size) for size in sizes.split(",")], int(repeats)))
        process.start()
        process.join()


def measure(series: Series, sizes: Sequence[int], repeats: int) -> None:
    """Print a line of JSON for each repetition: name, size, CPU seconds, and MB of the peak so far above the beginning."""
    begin = peak_memory()
    series.prepare(sizes[0])()  # whatever is made once is made
    spent = dict.fromkeys(sizes, 0.0)
    for _ in range(repeats):  # all sizes, then again: if the machine is slow for a while, all sizes suffer alike
        for size in sizes:
            if spent[size] < ENOUGH:
                spent[size] += (once := seconds(series, size))
                print(json.dumps([series.name, size, once, peak_memory() - begin]), flush=True)


def seconds(series: Series, size: int) -> float:
    """CPU seconds of one repetition."""
    work = series.prepare(size)
    began = time.process_time()
    work()
    return time.process_time() - began


if __name__ == "__main__":
    main(sys.argv[1:])
