"""What a server shows, and threads that read its files again and again while a page asks for them."""

from __future__ import annotations

import hashlib
import logging
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from macs.front import Front

from ..page import packed
from ..points import SAMPLES, details

log = logging.getLogger(__name__)

REST = 0.7
"""Seconds between two looks at the files."""
PATIENCE = 1.5
"""Seconds that the answer waits for a look, if the last one is longer ago: after a pause, it would show what is long past."""


class Stamp(NamedTuple):
    """What differs once a file has been written again: its number, its size, and the time in seconds since 1970."""

    number: int
    size: int
    time: float


def stamp_of(path: Path) -> Stamp | None:
    """The stamp of a file; None if it is not there."""
    try:
        found = path.stat()
    except OSError:
        return None
    return Stamp(found.st_ino, found.st_size, found.st_mtime_ns * 1e-9)


@dataclass(frozen=True)
class Resource:
    """Plain data as JSON, and a word that differs once they differ."""

    content: bytes
    version: str

    @classmethod
    def of(cls, data: Any) -> Resource:
        """The resource of some data."""
        content = msgspec.json.encode(data)
        return cls(content, hashlib.sha256(content).hexdigest()[:16])


@dataclass(frozen=True)
class View:
    """What one reading of the files gave."""

    status: Mapping[str, Any]  # plain data, which change often
    # "data": as `front_page` and `study_page` have them, but for the measures of a comparison; "going": the points so far of runs that
    # have not ended.
    resources: Mapping[str, Resource]
    fronts: Mapping[str, Front] = field(default_factory=dict)  # of the runs in the data


class Source(ABC):
    """What a server shows: looked at again and again, but only while a page asks for it."""

    title: str

    def __init__(self) -> None:
        self._view, self._trouble = View({}, {}), ""
        self._looker = Repeater(self._look, REST)

    @abstractmethod
    def look(self) -> View:
        """What there is to be seen now. Raises ValueError or OSError where the files cannot be read."""

    def status(self) -> dict[str, Any]:
        """The state at the last look, what cannot be read now, and the version of each resource; asks for the next look."""
        self._looker.want(PATIENCE)
        resources = {name: one.version for name, one in self.resources().items()}
        return {**self._view.status, "trouble": self._trouble, "versions": resources}

    def resources(self) -> Mapping[str, Resource]:
        """All resources, by name."""
        return self._view.resources

    def say(self, words: str) -> None:
        """Say what is being done, until the first look has ended."""
        if not self._view.resources:
            self._view = View({"reading": words}, {})

    def details(self, block: str) -> bytes | None:
        """What is shown of the points of a run once they are selected, compressed; None if there is no such run."""
        front = self._view.fronts.get(block)
        return None if front is None else packed(details(front, SAMPLES))

    def _look(self) -> None:
        try:
            self._view, self._trouble = self.look(), ""
        except (ValueError, OSError) as error:
            # What was seen before stays; the next look may find the files whole again.
            self._trouble = " ".join(str(error).split())


class Repeater(threading.Thread):
    """A thread that calls a function again and again, with a rest in between, as long as it is wanted.

    An exception ends neither the thread nor the server: it is logged, and the next call may succeed.
    """

    def __init__(self, call: Callable[[], None], rest: float) -> None:
        super().__init__(daemon=True)
        self._call, self._rest, self._wanted, self._ended = call, rest, threading.Event(), -float("inf")
        self._called = threading.Condition()
        self.start()

    def want(self, patience: float = 0.0) -> None:
        """Ask for one more call; if the last one ended longer ago than `patience`, wait for its end, but no longer than that."""
        self._wanted.set()
        if patience:
            with self._called:
                self._called.wait_for(lambda: time.monotonic() - self._ended < patience, patience)

    def run(self) -> None:
        """Never ends."""
        while True:
            self._wanted.wait()
            self._wanted.clear()
            try:
                self._call()
            except Exception as error:
                log.error("%s: %s", type(error).__name__, error)
            with self._called:
                self._ended = time.monotonic()
                self._called.notify_all()
            time.sleep(self._rest)
