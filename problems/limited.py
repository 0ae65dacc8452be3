"""Rows that may take too long, or end their process: each is computed in another process, which is killed then, and replaced."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from concurrent.futures import Executor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import cloudpickle
import numpy as np

_CHILDREN: dict[int, tuple[bytes, Executor]] = {}
"""By process, since a fork has no child: what its child computes, and the child."""


@dataclass(frozen=True)
class LimitedRows:
    """A function of rows (n, d), see `vector.Rows`, that is called in another process, for one row at a time.

    Raises TimeoutError where a row takes longer than `seconds`, and RuntimeError where it ends its process.
    """

    rows: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
    seconds: float

    def __reduce__(self) -> tuple[Any, ...]:
        return LimitedRows, (self.rows, self.seconds)

    def __call__(self, X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, bounded = zip(*(self._one(row) for row in X[:, None]), strict=True)
        return np.vstack(values), np.vstack(bounded)

    @cached_property
    def _packed(self) -> bytes:
        return cloudpickle.dumps(self.rows)

    def _one(self, row: np.ndarray) -> Any:
        future = _child(self._packed).submit(_computed, self._packed, row)
        try:
            return future.result(self.seconds)
        except BaseException as error:
            late, broken = not future.done(), isinstance(error, BrokenProcessPool)
            if late or broken:
                _end_child()
            if broken:
                raise RuntimeError("it ended its process") from None
            raise TimeoutError(f"it took longer than {self.seconds:g} s") if late and isinstance(error, TimeoutError) else error from None


def _child(data: bytes) -> Executor:
    """The process of this one that computes this; to begin it, and what it imports, does not count."""
    known = _CHILDREN.get(os.getpid())
    if known is None or known[0] != data:
        _end_child()
        from loky import ProcessPoolExecutor

        known = _CHILDREN[os.getpid()] = data, ProcessPoolExecutor(1, initializer=begin_process, initargs=(os.getpid(),))
        known[1].submit(_computed, data).result()
    return known[1]


def _end_child() -> None:
    """Kill the process that computes the rows of this one, with all that it began."""
    if (known := _CHILDREN.pop(os.getpid(), None)) is not None:
        known[1].shutdown(wait=False, kill_workers=True)  # type: ignore[call-arg]


_loaded = lru_cache(maxsize=1)(cloudpickle.loads)


def _computed(data: bytes, row: np.ndarray | None = None) -> Any:
    return _loaded(data) and None if row is None else _loaded(data)(row)


def begin_process(parent: int) -> None:
    """Begin a process: Ctrl-C is for the one that began it, and with that one it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
