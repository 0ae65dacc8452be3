"""Independent pieces of work side by side: in processes of this machine, which are kept for the next ones, or of an executor.

A method cuts its work into pieces without a look at how many processes there are, and where a piece is done changes nothing in its result:
the same seed gives the same bits with any number.
"""

from __future__ import annotations

import hashlib
import logging
import os
import tempfile
import threading
import time
import uuid
from collections import OrderedDict, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import cloudpickle

from problems.limited import begin_process
from transcription.stopping import stopped_by, stopping

from .interrupts import work_on_trajectories

log = logging.getLogger(__name__)
Result = TypeVar("Result")
Workers = int | str | Executor
ALL = "all"
ALONE = "one process does the work, since the problem cannot be sent to others: "
UNGUARDED = "where processes are spawned, a script needs `if __name__ == '__main__':` before what begins them"
TOGETHER = 8
"""Most pieces that a method begins together before it looks at their results, where it decides by these: a part of the method, so that the
number of processes changes nothing."""


def check_workers(workers: Workers | None) -> None:
    """Raise ValueError unless it is a number of processes, "all", an executor or None."""
    if workers is None or isinstance(workers, Executor) or workers == ALL:
        return
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise ValueError(f"workers must be a whole number of at least 1, {ALL!r} or a concurrent.futures.Executor, not {workers!r}")


def cores() -> int:
    """Cores that this process may use, as a container or a scheduler limits them."""
    from loky import cpu_count

    return cpu_count()


@contextmanager
def processes(workers: Workers | None) -> Iterator[Helpers | None]:
    """Within, independent pieces of work are done by so many processes, "all" for one for each core, or by an executor; None: as around."""
    if workers is None:
        yield _HELPERS.get()
        return
    check_workers(workers)
    count = cores() if isinstance(workers, str) else workers
    token = _HELPERS.set(None if count == 1 else _own(count) if isinstance(count, int) else Helpers(0, count))
    try:
        yield _HELPERS.get()
    finally:
        _HELPERS.reset(token)


def each(do: Callable[..., Result], shared: Any, pieces: Sequence[tuple[Any, ...]]) -> list[Result]:
    """`do(shared, *piece)` of every piece, in their order; an exception is that of the first piece that raised one.

    Where the work is asked to end (`transcription.stopping`), so is each piece.
    """
    helpers = _HELPERS.get()
    if helpers is None:
        return [do(shared, *piece) for piece in pieces]
    return helpers.each(do, shared, pieces) if len(pieces) > 1 else helpers.alone(do, shared, pieces)


class Helpers:
    """Processes that do pieces of work: `count` of this machine beside this one, begun when there was enough work for it to pay, or those
    of an executor, while this one waits."""

    def __init__(self, count: int, executor: Executor | None = None) -> None:
        self._count, self._executor, self._given = count, executor, executor is not None
        self._seconds, self._killed, self._grown, self._answered = 0.0, 0, 0, False
        self.batches: list[int] = []  # pieces of each batch so far
        self._taught: dict[str, list[Future[Any]]] = {}
        self._awake: Future[Any] | None = None  # done once there is a process

    def alone(self, do: Callable[..., Result], shared: Any, pieces: Sequence[tuple[Any, ...]]) -> list[Result]:
        """See `each` beside this class, of a piece that has to be done before others: here, while processes begin that these will need."""
        if self._awake is None and self._worth and not self._given:
            self._awake = self._submit(os.getpid)
        self.batches.append(1)
        return [self._here(do, shared, piece).result() for piece in pieces]

    def each(self, do: Callable[..., Result], shared: Any, pieces: Sequence[tuple[Any, ...]]) -> list[Result]:
        """See `each` beside this class."""
        self.batches.append(len(pieces))
        found, left, begun = dict[int, Future[Any]](), deque(range(len(pieces))), dict[Future[Any], int]()
        data, work = self._packed(shared, do) if self._worth else (b"", b"")
        digest, stop = hashlib.sha256(data).hexdigest(), Path(tempfile.gettempdir()) / f"macs-{uuid.uuid4().hex}"
        lock, ready = threading.RLock(), 0

        def feed(done: Future[Any] | None = None) -> None:
            """Give pieces to the processes that are ready, one each, and a next one as long as many are left; again once one is done."""
            with lock:
                if done is not None and (done.cancelled() or done.exception() is not None):
                    return
                while len(left) > (done is None and not self._given):
                    if sum(not one.done() for one in begun) >= ready * (2 if len(left) > 2 * self._count else 1):
                        break
                    k = left.popleft()
                    future = self._submit(_perform, digest, data, work, pieces[k], str(stop))
                    begun[future] = k
                    future.add_done_callback(feed)

        try:
            while left or begun:
                ready = self._ready(len(left), digest, data)
                feed()
                with lock:
                    mine = left.pop() if left else None
                if mine is not None:
                    found[mine] = self._here(do, shared, pieces[mine])
                else:
                    wait(begun, timeout=0.1, return_when=FIRST_COMPLETED)
                if begun and stopping():
                    stop.touch()
                with lock:
                    ended = {one: begun.pop(one) for one in [*begun] if one.done()}
                for future, k in ended.items():
                    if self._lost(future):
                        left.append(k)
                    else:
                        found[k] = future
                if any(one.exception() is not None for one in found.values()):
                    left.clear()  # as with one process, in which no piece after it would begin
        except BaseException:
            left.clear()
            stop.touch()
            for future in begun:
                future.cancel()
            if wait(begun, timeout=1.0).not_done and not self._given and self._executor is not None:
                self._end()
            raise
        finally:
            stop.unlink(missing_ok=True)
        self._renew()
        return [found[k].result() for k in sorted(found)]

    @property
    def _worth(self) -> bool:
        """Whether there was enough work for other processes to pay: a second is what it takes to begin them. Killed twice, they do not."""
        return self._given or (self._seconds >= 1.0 and self._killed < 2 and self._grown < 2)

    def _renew(self) -> None:
        """End processes of which one has more than half of its part of the memory, so that others begin; said once. If those of the next
        batch grow as much, this one goes on alone."""
        most, sizes = _memory() / (2 * self._count + 2), list[int]()
        with suppress(OSError):  # other systems do not say it there
            for process in getattr(self._executor, "_processes", None) or ():
                sizes.append(int(Path(f"/proc/{process}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE"))
        self._grown = self._grown + 1 if max(sizes, default=0) > most else 0
        if self._grown:
            self._end()
            _say(f"processes begin anew when one of them has more than {most / 1e9:.2g} GB of memory")

    def _end(self) -> None:
        """End all processes; the next piece begins others."""
        if self._executor is not None:
            self._executor.shutdown(wait=False, kill_workers=True)  # type: ignore[call-arg]
        self._executor = None
        self._taught.clear()

    def _packed(self, *parts: Any) -> tuple[bytes, ...]:
        """What others need for pieces, what these share apart: it is learned once for whatever is done with it. None where it cannot be
        sent, such as a model that is called back."""
        try:
            return tuple(map(cloudpickle.dumps, parts))
        except Exception as error:
            if self._given:
                raise
            _say(ALONE + str(error).rsplit("\n", 1)[-1])
            return (b"",) * len(parts)

    def _ready(self, left: int, digest: str, data: bytes) -> int:
        """How many processes may have pieces. They learn what a piece needs while this process works."""
        if self._given:
            return left
        if not self._worth or not data:
            return 0
        if digest not in self._taught:
            self._taught[digest] = [self._submit(_learn, digest, data) for _ in range(self._count)]
            if self._awake is not None and self._awake.done() and left <= 2 * self._count:
                wait(self._taught[digest], timeout=0.3)  # this process would have done most of so few by then
        outcomes = [one.exception() for one in self._taught[digest] if one.done()]
        if wrong := [error for error in outcomes if error is not None and not isinstance(error, BrokenProcessPool)]:
            _say(ALONE + str(wrong[0]).rsplit("\n", 1)[-1])
            return 0
        return outcomes.count(None)

    def _here(self, do: Callable[..., Any], shared: Any, piece: tuple[Any, ...]) -> Future[Any]:
        """What a piece gives in this process."""
        done, began = Future[Any](), time.perf_counter()
        try:
            done.set_result(do(shared, *piece))
        except Exception as error:
            done.set_exception(error)
        self._seconds += time.perf_counter() - began
        return done

    def _submit(self, do: Callable[..., Any], *arguments: Any) -> Future[Any]:
        if self._executor is None:
            from loky import ProcessPoolExecutor

            self._executor = ProcessPoolExecutor(max_workers=self._count, timeout=300.0, initializer=begin_process, initargs=(os.getpid(),))
        try:
            return self._executor.submit(do, *arguments)
        except BrokenProcessPool as error:  # since the last piece
            broken = Future[Any]()
            broken.set_exception(error)
            return broken

    def _lost(self, future: Future[Any]) -> bool:
        """Whether a piece is to be done again, since its process was killed, which is said."""
        if not (future.cancelled() or isinstance(future.exception(), BrokenProcessPool)):
            self._answered = True
            return False
        if self._given:
            why = "was killed, perhaps for want of memory" if self._answered else f"ended before it did any work: {UNGUARDED}"
            raise RuntimeError(f"a process of the executor in `workers` {why}") from None
        if self._executor is not None:
            self._killed += 1
            self._end()
            words = "" if self._worth else ", by one process from now on"
            log.warning("a process was killed, perhaps for want of memory: its work is done again%s", words)
        return True


_HELPERS: ContextVar[Helpers | None] = ContextVar("helpers", default=None)
_OWN: dict[tuple[int, int], Helpers] = {}
"""Those of this machine by the process that began them, since a fork has none, and the number of processes."""
_KEPT: OrderedDict[str, Any] = OrderedDict()
"""In a process: what its pieces of work share, by digest."""


@cache
def _say(words: str) -> None:
    """Say once what is to be known of processes."""
    log.warning(words)


def _memory() -> float:
    """Bytes of memory of this machine or, if that is less, of its container; infinite where they are not known."""
    known = [float("inf")]
    with suppress(OSError, AttributeError, ValueError):
        known.append(float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")))
        known.append(float(Path("/sys/fs/cgroup/memory.max").read_text()))
    return min(known)


def _own(count: int) -> Helpers:
    """The processes of this machine, one of which is this one; begun once."""
    return _OWN.setdefault((os.getpid(), count), Helpers(count - 1))


def _learn(digest: str, data: bytes) -> None:
    """Prepare for pieces of work in a process, which keeps what they share."""
    if digest not in _KEPT:
        with work_on_trajectories():
            _KEPT[digest] = cloudpickle.loads(data)
        while len(_KEPT) > TOGETHER:
            _KEPT.popitem(last=False)
    _KEPT.move_to_end(digest)


def _perform(digest: str, data: bytes, work: bytes, piece: tuple[Any, ...], stop: str) -> Any:
    """One piece of work in a process."""
    with processes(1), stopped_by(lambda: "asked to end" if Path(stop).exists() else ""), work_on_trajectories():
        _learn(digest, data)
        return cloudpickle.loads(work)(_KEPT[digest], *piece)
