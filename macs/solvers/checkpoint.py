"""Keeps a run in a file, so that the same call continues it, whatever ended it.

The first line of a file is `MACS checkpoint 6: N bytes, sha256 H`; N and H are those of the npz archive that follows, of arrays and a JSON
document. So a file that was damaged is refused before any of it is unpacked. Of a forged one, no array is allocated before its size is
known to be that of its bytes. Nothing is pickled. The document says which run it is, by which versions it was computed, and how it stands,
in the trees of `packing`.
"""

from __future__ import annotations

import hashlib
import io
import json
import logging
import math
import re
import stat
import time
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, is_dataclass
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Any, get_type_hints

import numpy as np

from ..evaluation.evaluator import Counts
from ..fronts.provenance import versions
from ..io.atomic import write_whole
from ..io.text import document
from .method import SearchMethod
from .packing import pack, unpack
from .shapes import check_shapes

SECONDS, SHARE = 1.0, 20.0
"""The time between two writes is at least so many seconds, and at least so many times what the last write took."""
INSTEAD = "it was left as it is; make the call that it belongs to, name another file, or delete this one"
HINTS = {
    "problem": "bounds, equations, objectives or data differ, or another CasADi",
    "evaluations": "a larger budget is another search; to add to what was found, give its front as start",
}
PARTS = ("belongs", "versions", "run", "state")
"""Parts of the document."""
RANKS = {"F": 2, "Z": 2, "violation": 1}
"""Numbers of dimensions of the rows that each state has."""

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Kept:
    """How a run stands between two iterations, beside the state of its solver."""

    seed: int
    counts: Counts
    idle: int  # number of iterations since the last evaluation
    elapsed: float  # seconds of work so far
    stopped: str = ""  # why the run ended by itself; empty as long as it has not


class Unreadable(ValueError):  # noqa: N818 - the state of the file
    """Raised for a file that is no checkpoint, is damaged, or belongs to another run."""


class Checkpoint(AbstractContextManager["Checkpoint"]):
    """A file that one run is kept in.

    On leaving the context, what is not in the file yet is written. A write that fails does not stop the run: it is logged and tried again
    later, and `failure` gives the reason.
    """

    def __init__(
        self, path: str | PathLike[str], solver: SearchMethod, belongs: Mapping[str, Any], sizes: Mapping[str, int] | None = None
    ) -> None:
        self.path, self.failure = path, ""
        self._state_class, self._solver = _state_class(solver), type(solver).__name__
        self._belongs = _read_json(document(dict(belongs)))
        self._versions = [versions()]
        self._sizes = sizes or {}
        self._waiting: tuple[dict[str, Any], dict[str, np.ndarray]] | None = None
        self._written, self._took = time.perf_counter(), 0.0

    @property
    def mixed(self) -> bool:
        """See the class."""
        return len(self._versions) > 1

    def read(self, seed: int | None) -> tuple[Any, Kept] | None:
        """The solver's state, and how the run of this seed (None: of any seed) stands; None if there is no file."""
        try:
            return self._read(seed)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise Unreadable(f"checkpoint '{self.path}' cannot be read: {error.strerror or error}") from error
        except ValueError as error:
            raise Unreadable(f"'{self.path}' {' '.join(str(error).split())}; {INSTEAD}") from error

    def _read(self, seed: int | None) -> tuple[Any, Kept]:
        """As `read`; the message of a ValueError continues after the name of the file."""
        header, arrays = read_file(self.path)
        if not isinstance(header, dict) or header.keys() != {*PARTS} or not isinstance(header["belongs"], dict):
            raise ValueError(f"is no valid checkpoint: its document does not consist of {', '.join(PARTS)}")
        try:
            kept = unpack(header["run"], Kept, arrays, "run")
            _check_counts(kept)
            mine = self._belongs | {"seed": kept.seed if seed is None else seed}
            differences = [*_differences(header["belongs"] | {"seed": kept.seed}, mine)]
            if differences:
                raise ValueError(f"belongs to another run: {'; '.join(differences)}")
            state = unpack(header["state"], self._state_class, arrays, "state")
            _check_points(state)
            self._check_shapes(state)
            known = unpack(header["versions"], list[dict[str, str]], arrays, "versions")
            if arrays:
                raise TypeError(f"{min(arrays)} is unknown")
        except TypeError as error:
            raise ValueError(f"cannot be continued by this {self._solver}: {error}") from error
        self._versions = [*(one for one in known if one != versions()), versions()]
        if self.mixed:
            log.warning("checkpoint '%s' was written by other versions: the rest of the run may differ in its last bits", self.path)
        return state, kept

    def keep(self, state: Any, kept: Kept) -> None:
        """Note how the run stands, for the next write. Raises TypeError for a state that is not as the contract of a solver has it."""
        arrays: dict[str, np.ndarray] = {}
        trees = {"run": pack(kept, Kept, arrays, "run"), "state": pack(state, self._state_class, arrays, "state")}
        _check_points(state)
        self._check_shapes(state)
        self._waiting = trees, arrays

    def _check_shapes(self, state: Any) -> None:
        """See `check_shapes`; the objectives of a function that was not evaluated yet are those of the archive."""
        check_shapes(state, {"m": state.archive.F.shape[1], **self._sizes})

    def write_in_time(self) -> None:
        """Write what is not in the file yet, if the last write is long enough ago."""
        if time.perf_counter() - self._written > max(SECONDS, SHARE * self._took):
            self.write()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.write()

    def write(self) -> None:
        """Write what is not in the file yet."""
        if self._waiting is None:
            return
        trees, arrays = self._waiting
        began = time.perf_counter()
        try:
            header = {"belongs": self._belongs, "versions": self._versions, **trees}
            write_whole(self.path, to_bytes(header, arrays))
        except OSError as error:
            if not self.failure:
                log.warning("checkpoint: %s; the search goes on without", error.strerror or error)
            self.failure = f"{error.strerror or error}; the file is behind"
        else:
            self.failure, self._waiting = "", None
        self._written = time.perf_counter()
        self._took = self._written - began


def keeps(solver: SearchMethod) -> bool:
    """Whether a checkpoint can keep a run of this solver: whether the class of its state is known."""
    try:
        _state_class(solver)
    except ValueError:
        return False
    return True


def _state_class(solver: SearchMethod) -> type:
    name = type(solver).__name__
    try:
        found = get_type_hints(solver.makes_state).get("return")
    except NameError as error:
        raise ValueError(f"checkpoint: what {name}.{solver.makes_state.__name__} returns is not known at run time: {error}") from error
    if not (isinstance(found, type) and is_dataclass(found)):
        raise ValueError(f"checkpoint: {name}.{solver.makes_state.__name__} is not annotated with the class of the state that it returns")
    return found


def _check_counts(kept: Kept) -> None:
    """Raise TypeError for a number that no run can have."""
    counts = {f"counts.{name}": count for name, count in vars(kept.counts).items() if name != "failures"}
    failures = {f"counts.failures[{status!r}]": count for status, count in kept.counts.failures.items()}
    for name, number in {"seed": kept.seed, "idle": kept.idle, "elapsed": kept.elapsed, **counts, **failures}.items():
        if not 0 <= number < math.inf:
            raise TypeError(f"run.{name} is {number}, a number of at least 0 expected")


def _check_points(state: Any) -> None:
    """Raise TypeError unless the points of a state are what the contract of a solver says: rows of floats, those of the archive finite."""
    columns: dict[str, int] = {}
    for name in ("archive", "closest"):
        for part, rank in RANKS.items():
            where, array = f"state.{name}.{part}", getattr(getattr(state, name), part)
            if array.dtype != float or array.ndim != rank:
                raise TypeError(f"{where} is an array of {array.dtype} with {array.ndim} dimensions; float64 with {rank} expected")
            if len(array) != (rows := len(getattr(state, name).F)):
                raise TypeError(f"{where} has {len(array)} rows, {rows} expected")
            if rank == 2 and array.shape[1] != columns.setdefault(part, array.shape[1]):
                raise TypeError(f"{where} has {array.shape[1]} columns, {columns[part]} expected")
            if name == "archive" and not np.isfinite(array).all():
                raise TypeError(f"{where} has a value that is not finite")


def _read_json(text: str) -> Any:
    """Data that can be compared: each NaN is the same word."""
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


VERSION = 6
FIRST_LINE = re.compile(rb"MACS checkpoint (\d{1,9}): (\d{1,18}) bytes, sha256 ([0-9a-f]{64})\n")
LONGEST_LINE = 200
LARGEST = 2**32
"""Bytes that the archive of a file may have."""
DOCUMENT = "document"
"""The member of the archive that is JSON, as an array of bytes."""


def to_bytes(document: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> bytes:
    """The content of a file with a document (what JSON knows, infinities and NaN included) and named arrays, none of objects."""
    buffer = io.BytesIO()
    members: dict[str, Any] = {DOCUMENT: np.frombuffer(json.dumps(document).encode(), dtype=np.uint8), **arrays}
    np.savez(buffer, **members)
    archive = buffer.getvalue()
    return f"MACS checkpoint {VERSION}: {len(archive)} bytes, sha256 {hashlib.sha256(archive).hexdigest()}\n".encode() + archive


def read_file(path: str | PathLike[str]) -> tuple[Any, dict[str, np.ndarray]]:
    """The document and the arrays of a file, checked against its checksum."""
    if not stat.S_ISREG(Path(path).stat().st_mode):
        raise ValueError("is no ordinary file")  # reading a device or a pipe may never end
    with Path(path).open("rb") as file:
        line = file.readline(LONGEST_LINE)
        head = FIRST_LINE.fullmatch(line)
        if head is None and line.startswith(b"MACS checkpoint"):
            raise ValueError("is damaged: its first line is not that of a checkpoint")
        if head is None:
            raise ValueError(f"is no checkpoint: {'it is a file of something else, or of an older MACS' if line else 'it is empty'}")
        version, size, checksum = int(head[1]), int(head[2]), head[3].decode()
        if version != VERSION:
            raise ValueError(f"is a checkpoint of version {version}; this MACS reads version {VERSION}")
        found = Path(path).stat().st_size - len(line)
        if found != size:
            raise ValueError(f"is damaged: it should have {size} bytes after its first line, but has {found}")
        if size > LARGEST:
            raise ValueError(f"is no valid checkpoint: it has {size} bytes, more than {LARGEST}")
        archive = file.read(size)
    if hashlib.sha256(archive).hexdigest() != checksum:
        raise ValueError("is damaged: its content does not match its checksum")
    return _from_archive(archive)


def _from_archive(archive: bytes) -> tuple[Any, dict[str, np.ndarray]]:
    arrays = {name.removesuffix(".npy"): _array(name, content) for name, content in _members(archive).items()}
    if DOCUMENT not in arrays:
        raise ValueError("is no valid checkpoint: it has no document")
    try:
        return json.loads(arrays.pop(DOCUMENT).tobytes()), arrays
    except (ValueError, RecursionError) as error:
        raise ValueError(f"is no valid checkpoint: its document is no JSON ({error})") from error


def _members(archive: bytes) -> dict[str, bytes]:
    """The members of a zip archive, which have to be stored as they are: then none is larger than the archive."""
    try:
        with zipfile.ZipFile(io.BytesIO(archive)) as file:
            infos = file.infolist()
            stored = all(info.compress_type == zipfile.ZIP_STORED for info in infos)
            if not stored or sum(info.file_size for info in infos) > len(archive):
                raise ValueError("its members are compressed, or overlap")
            return {info.filename: file.read(info) for info in infos}
    except Exception as error:  # zipfile raises errors of many classes; whichever it is, the archive is not one that `to_bytes` wrote
        raise ValueError(f"is no valid checkpoint: its archive cannot be read ({error})") from error


def _array(name: str, content: bytes) -> np.ndarray:
    """An array of the content of an npy file. Only the header is parsed by numpy, which would allocate what the header asks for."""
    stream = io.BytesIO(content)
    try:
        np.lib.format.read_magic(stream)
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(stream)
        start = stream.tell()
        if dtype.hasobject or not dtype.itemsize or math.prod(shape) * dtype.itemsize != len(content) - start:
            raise ValueError(f"its {len(content) - start} bytes are no array {shape} of {dtype}")
        return np.ndarray(shape, dtype, content, start, order="F" if fortran else "C").copy(order="K")
    except Exception as error:  # as above: the parser of numpy raises errors of many classes
        raise ValueError(f"is no valid checkpoint: {name.removesuffix('.npy')} is no array ({error})") from error
