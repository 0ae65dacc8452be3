"""Checkpoints: a run is saved in a file, so that the same call continues it after any end.

The first line of a file is `MACS checkpoint 8: N bytes, sha256 H`; N and H are those of the MessagePack document that follows. So a damaged
file is refused before any of it is read. In a forged file, no array takes more memory than the file has bytes. Nothing is pickled. The
document has the identity of the run, the versions that computed it, and its state; see `packing`.
"""

from __future__ import annotations

import hashlib
import json
import logging
import math
import re
import stat
import time
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from ..evaluation.evaluator import Counts
from ..fronts.provenance import versions
from ..io.atomic import write_whole
from ..io.text import document
from .method import SearchMethod
from .packing import check_kept, check_shapes, decode, encode

CHECKPOINT_VERSION = 8
"""Of the file format: of the document, and of the states in it."""
FIRST_LINE = re.compile(rb"MACS checkpoint (\d{1,9}): (\d{1,18}) bytes, sha256 ([0-9a-f]{64})\n")
LARGEST_CHECKPOINT = 2**32
"""Bytes that the document of a file may have."""
WRITE_SECONDS, WRITE_SHARE = 1.0, 20.0
"""The time between two writes is at least so many seconds, and at least so many times what the last write took."""
INSTEAD = "it was left as it is; make the call that it belongs to, name another file, or delete this one"
HINTS = {
    "problem": "bounds, equations, objectives or data differ, or another CasADi",
    "evaluations": "a larger budget is another search; to add to what was found, give its front as start",
}
POINTS = {"Z": "n D", "F": "n m", "violation": "n"}
"""Shapes of the points that each state has."""

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class RunStatus:
    """Status of a run between two iterations, beside the state of its solver."""

    seed: int
    counts: Counts
    idle: int  # number of iterations since the last evaluation
    elapsed: float  # seconds of work so far
    stopped: str = ""  # why the run ended by itself; empty as long as it has not
    memory: np.ndarray = field(default_factory=lambda: np.empty((0, 0)), compare=False)  # see `Evaluator.memory`


@dataclass(frozen=True)
class _Document:
    """The document of a file, after its first line."""

    belongs: str  # JSON: all that determines the run, with its seed
    versions: list[dict[str, str]]
    counts: Counts
    idle: int
    elapsed: float
    stopped: str
    state: bytes
    memory: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))


class Unreadable(ValueError):  # noqa: N818 - the state of the file
    """Raised for a file that is no checkpoint, is damaged, or belongs to another run."""


class Checkpoint(AbstractContextManager["Checkpoint"]):
    """The checkpoint file of one run.

    On leaving the context, what is not in the file yet is written. A write that fails does not stop the run: it is logged and tried again
    later, and `failure` gives the reason.
    """

    def __init__(
        self, path: str | PathLike[str], solver: SearchMethod, belongs: Mapping[str, Any], sizes: Mapping[str, int] | None = None
    ) -> None:
        self.path, self.failure = path, ""
        self._state_class, self._solver = solver.state_class, type(solver).__name__
        self._belongs = _read_json(document(dict(belongs)))
        self._versions = [versions()]
        self._sizes = sizes or {}
        self._waiting: _Document | None = None
        self._checked = False  # whether the state is one that comes back as it was
        self._written, self._took = time.perf_counter(), 0.0

    @property
    def mixed(self) -> bool:
        """Whether the run was computed by several versions."""
        return len(self._versions) > 1

    def read(self, seed: int | None) -> tuple[Any, RunStatus] | None:
        """The state of the solver and the status of the run with this seed (None: any seed); None if there is no file."""
        try:
            return self._read(seed)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise Unreadable(f"checkpoint '{self.path}' cannot be read: {error.strerror or error}") from error
        except ValueError as error:
            raise Unreadable(f"'{self.path}' {' '.join(str(error).split())}; {INSTEAD}") from error

    def _read(self, seed: int | None) -> tuple[Any, RunStatus]:
        """As `read`; the message of a ValueError continues after the name of the file."""
        content = read_file(self.path)
        try:
            found = decode(content, _Document)
            theirs = _read_json(found.belongs)
            status = RunStatus(theirs.get("seed"), found.counts, found.idle, found.elapsed, found.stopped, found.memory)
            _check_counts(status)
        except (TypeError, AttributeError, ValueError, RecursionError) as error:
            raise ValueError(f"is no valid checkpoint: {error}") from error
        mine = self._belongs | {"seed": status.seed if seed is None else seed}
        if differences := [*_differences(theirs, mine)]:
            raise ValueError(f"belongs to another run: {'; '.join(differences)}")
        try:
            state = decode(found.state, self._state_class)
            self._check(state)
        except TypeError as error:
            raise ValueError(f"cannot be continued by this {self._solver}: {error}") from error
        self._versions = [*(one for one in found.versions if one != versions()), versions()]
        if self.mixed:
            log.warning("checkpoint '%s' was written by other versions: the rest of the run may differ in its last bits", self.path)
        return state, status

    def keep(self, state: Any, status: RunStatus) -> None:
        """Note the status of the run, for the next write. Raises TypeError for a state that breaks the contract of a solver."""
        content = encode(state)
        if not self._checked:
            check_kept(state, content, self._state_class)
            self._checked = True
        self._check(state)
        belongs = json.dumps(self._belongs | {"seed": status.seed})
        told = status.counts, status.idle, status.elapsed, status.stopped
        self._waiting = _Document(belongs, self._versions, *told, content, status.memory)
        self._waiting = decode(encode(self._waiting), _Document)  # a copy: the counts go on

    def _check(self, state: Any) -> None:
        """Raise TypeError for shapes that no state has; the objectives of a function that was not evaluated yet are the archive's."""
        sizes = {"m": state.archive.F.shape[-1], **self._sizes}
        for name in ("archive", "closest"):
            check_shapes(getattr(state, name), sizes, f"state.{name}", POINTS)
        if not all(np.isfinite(getattr(state.archive, name)).all() for name in POINTS):
            raise TypeError("state.archive has a value that is not finite")
        check_shapes(state, sizes)

    def write_in_time(self) -> None:
        """Write the latest status, unless it is in the file or the last write is too recent."""
        if time.perf_counter() - self._written > max(WRITE_SECONDS, WRITE_SHARE * self._took):
            self.write()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.write()

    def write(self) -> None:
        """Write the latest status, unless it is in the file."""
        if self._waiting is None:
            return
        began = time.perf_counter()
        try:
            write_whole(self.path, sealed(encode(self._waiting)))
        except OSError as error:
            if not self.failure:
                log.warning("checkpoint: %s; the search goes on without", error.strerror or error)
            self.failure = f"{error.strerror or error}; the file is behind"
        else:
            self.failure, self._waiting = "", None
        self._written = time.perf_counter()
        self._took = self._written - began


def keeps(solver: SearchMethod) -> bool:
    """Whether a checkpoint can save a run of this solver: whether the class of its state is known."""
    try:
        solver.state_class  # noqa: B018 - it raises
    except ValueError:
        return False
    return True


def _check_counts(status: RunStatus) -> None:
    """Raise ValueError for a number that no run can have."""
    counts = {f"counts.{name}": count for name, count in vars(status.counts).items() if name != "first_failure"}
    by = {f"{name}[{what!r}]": one for name, count in counts.items() if isinstance(count, dict) for what, one in count.items()}
    numbers = {name: count for name, count in counts.items() if not isinstance(count, dict)}
    for name, number in {"seed": status.seed, "idle": status.idle, "elapsed": status.elapsed, **numbers, **by}.items():
        if isinstance(number, bool) or not isinstance(number, int | float) or not 0 <= number < math.inf:
            raise ValueError(f"{name} is {number!r}, a number of at least 0 expected")


def _read_json(text: str) -> Any:
    """JSON data that can be compared: each NaN is the same word."""
    return json.loads(text, parse_constant=str)


def _differences(theirs: Any, mine: Any, name: str = "") -> Iterator[str]:
    """Sentences about what differs, with hints."""
    if isinstance(theirs, dict) and isinstance(mine, dict):
        for key in dict.fromkeys([*mine, *theirs]):
            found = list(_differences(theirs.get(key), mine.get(key), f"{name}.{key}" if name else key))
            hint = HINTS.get(key, "") if not name else ""
            yield from [*found[:-1], f"{found[-1]} ({hint})"] if found and hint else found
    elif theirs != mine:
        yield f"{name} is {_short(theirs)} there, {_short(mine)} here"


def _short(value: Any) -> str:
    text = "nothing" if value is None else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def sealed(content: bytes, version: int = CHECKPOINT_VERSION) -> bytes:
    """The content of a file: after a first line with its length and checksum."""
    return f"MACS checkpoint {version}: {len(content)} bytes, sha256 {hashlib.sha256(content).hexdigest()}\n".encode() + content


def read_file(path: str | PathLike[str]) -> bytes:
    """The document of a file, checked against the checksum of the first line."""
    if not stat.S_ISREG(Path(path).stat().st_mode):
        raise ValueError("is no ordinary file")  # reading a device or a pipe may never end
    with Path(path).open("rb") as file:
        line = file.readline(200)
        head = FIRST_LINE.fullmatch(line)
        if head is None and line.startswith(b"MACS checkpoint"):
            raise ValueError("is damaged: its first line is not that of a checkpoint")
        if head is None:
            raise ValueError(f"is no checkpoint: {'it is a file of something else, or of an older MACS' if line else 'it is empty'}")
        version, size, checksum = int(head[1]), int(head[2]), head[3].decode()
        if version != CHECKPOINT_VERSION:
            raise ValueError(f"is a checkpoint of version {version}; this MACS reads version {CHECKPOINT_VERSION}")
        found = Path(path).stat().st_size - len(line)
        if found != size:
            raise ValueError(f"is damaged: it should have {size} bytes after its first line, but has {found}")
        if size > LARGEST_CHECKPOINT:
            raise ValueError(f"is no valid checkpoint: it has {size} bytes, more than {LARGEST_CHECKPOINT}")
        content = file.read(size)
    if hashlib.sha256(content).hexdigest() != checksum:
        raise ValueError("is damaged: its content does not match its checksum")
    return content
