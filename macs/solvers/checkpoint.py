"""The file that a run is kept in, so that the same call goes on where it was, however it ended.

A file is a zip archive of numpy arrays, as `numpy.savez` writes them, each with a checksum. One of them, `document`, is JSON: what the file
is, whom it belongs to, and the trees of `packing`, whose arrays are `array_0`, `array_1`, ... Nothing in it is pickled.
"""

from __future__ import annotations

import io
import json
import logging
import time
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, is_dataclass
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Any, cast, get_type_hints

import numpy as np

from ..evaluation.evaluator import Counts
from ..fronts.labelled import document
from ..fronts.provenance import versions
from ..io.atomic import write_whole
from .method import SearchMethod
from .packing import pack, unpack

FORMAT, VERSION = "MACS checkpoint", 1
SECONDS, SHARE = 1.0, 20.0
"""Between two writes there are at least so many seconds, and at least this many times what the last one took."""
INSTEAD = "it was left as it is; make the call that it belongs to, name another file, or delete this one"
HINTS = {
    "problem": "bounds, equations, objectives or data differ, or another CasADi",
    "evaluations": "a larger budget is another search; to add to what was found, give its front as start",
}

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Kept:
    """How a run stands between two iterations, beside the state of its solver.

    Attributes
    ----------
    seed : int
    counts : Counts
    idle : int
        How many iterations on end evaluated nothing.
    elapsed : float
        Seconds of work so far.
    stopped : str
        What ended the run by itself; empty as long as it is to go on.
    """

    seed: int
    counts: Counts
    idle: int
    elapsed: float
    stopped: str = ""


class Unreadable(ValueError):  # noqa: N818 - what the file is
    """The file holds no checkpoint, or one that is damaged or of another run."""


class Checkpoint(AbstractContextManager["Checkpoint"]):
    """Keeps one run in a file.

    Left as a context, it writes what is not in the file yet. A write that fails does not stop the run: it is logged, tried again in time,
    and `failure` says so.

    Parameters
    ----------
    path : path
    solver : Solver
        The class of its state is the one that its `makes_state` is annotated to return.
    belongs : mapping
        Everything but the seed that decides what the run does, as data.

    Attributes
    ----------
    failure : str
        Why the file is behind the run; empty if it is not.
    mixed : bool
        Whether other versions, of this package or of what it computes with, had a part in the run.

    Raises
    ------
    ValueError
        If the solver does not say what its state is.
    """

    def __init__(self, path: str | PathLike[str], solver: SearchMethod, belongs: Mapping[str, Any]) -> None:
        self.path, self.failure = path, ""
        self._state_class, self._belongs = _state_class(solver), _read_json(document(dict(belongs)))
        self._versions = [versions()]
        self._waiting: tuple[dict[str, Any], list[np.ndarray]] | None = None
        self._written, self._took = time.perf_counter(), 0.0

    @property
    def mixed(self) -> bool:
        """See the class."""
        return len(self._versions) > 1

    def read(self, seed: int | None) -> tuple[Any, Kept] | None:
        """The solver's state, and the rest, of the run of this seed, or whichever for None; None if there is no file.

        Raises
        ------
        Unreadable
            If the file cannot be read, is no checkpoint, is damaged, or belongs to another run: then the message says what differs.
        """
        try:
            content = Path(self.path).read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            raise Unreadable(f"checkpoint {self.path} cannot be read: {error.strerror or error}") from error
        try:
            header, arrays = _from_bytes(content)
            theirs, kept = dict(header["belongs"]), unpack(header["run"], Kept, arrays, "run")
            known = [*header["versions"]]
        except Exception as error:
            # Whatever a damaged or foreign file provokes in numpy or in what follows, the file is what is wrong.
            raise Unreadable(f"{self.path} does not hold a checkpoint that can be read: {_reason(content, error)}; {INSTEAD}") from error
        mine = self._belongs | {"seed": kept.seed if seed is None else seed}
        differences = [*_differences(theirs | {"seed": kept.seed}, mine)]
        if differences:
            raise Unreadable(f"checkpoint {self.path} belongs to another run: {'; '.join(differences)}. {INSTEAD.capitalize()}")
        try:
            state = unpack(header["state"], self._state_class, arrays, "state")
        except TypeError as error:
            raise Unreadable(f"checkpoint {self.path} is of another {self._state_class.__name__}: {error}; {INSTEAD}") from error
        self._versions = [*(one for one in known if one != versions()), versions()]
        if self.mixed:
            log.warning("checkpoint %s was written by other versions: the rest of the run may differ in its last bits", self.path)
        return state, kept

    def keep(self, state: Any, kept: Kept) -> None:
        """Take note of how the run stands."""
        arrays: list[np.ndarray] = []
        trees = {"run": pack(kept, Kept, arrays, "run"), "state": pack(state, self._state_class, arrays, "state")}
        self._waiting = trees, arrays

    def write_in_time(self) -> None:
        """Write what is not in the file yet, if the last time is long enough ago."""
        if time.perf_counter() - self._written > max(SECONDS, SHARE * self._took):
            self.write()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.write()

    def write(self) -> None:
        """Write what is not in the file yet."""
        if self._waiting is None:
            return
        trees, arrays = self._waiting
        header = {"format": FORMAT, "version": VERSION, "belongs": self._belongs, "versions": self._versions, **trees}
        began = time.perf_counter()
        try:
            write_whole(self.path, _to_bytes(header, arrays))
        except OSError as error:
            if not self.failure:
                log.warning("checkpoint: %s; the search goes on without", error.strerror or error)
            self.failure = f"{error.strerror or error}; the file is behind"
        else:
            self.failure, self._waiting = "", None
        self._written = time.perf_counter()
        self._took = self._written - began


def keeps(solver: SearchMethod) -> bool:
    """Whether a checkpoint can keep a run of this solver: whether it says what its state is."""
    try:
        _state_class(solver)
    except ValueError:
        return False
    return True


def _state_class(solver: SearchMethod) -> type:
    name = type(solver).__name__
    try:
        found = get_type_hints(solver.makes_state).get("return", Any)
    except NameError as error:
        raise ValueError(f"checkpoint: what {name}.{solver.makes_state.__name__} returns is not known at run time: {error}") from error
    if not is_dataclass(found):
        raise ValueError(f"checkpoint: {name}.{solver.makes_state.__name__} is not annotated with the class of the state that it returns")
    return cast(type, found)


def _to_bytes(header: Mapping[str, Any], arrays: list[np.ndarray]) -> bytes:
    buffer = io.BytesIO()
    text = np.frombuffer(json.dumps({**header, "arrays": len(arrays)}).encode(), dtype=np.uint8)
    named: dict[str, Any] = {f"array_{i}": array for i, array in enumerate(arrays)}
    np.savez(buffer, document=text, **named)
    return buffer.getvalue()


def _from_bytes(content: bytes) -> tuple[dict[str, Any], list[np.ndarray]]:
    """Raises whatever comes if it is no checkpoint."""
    with np.load(io.BytesIO(content), allow_pickle=False) as file:
        header = json.loads(file["document"].tobytes())
        if header["format"] != FORMAT:
            raise ValueError("it is a file of something else")
        if header["version"] != VERSION:
            raise ValueError(f"its format is version {header['version']}, this MACS reads version {VERSION}")
        return header, [file[f"array_{i}"] for i in range(header["arrays"])]


def _reason(content: bytes, error: Exception) -> str:
    if not content:
        return "it is empty"
    if not content.startswith(b"PK"):
        return "it is a file of something else"
    return str(error) if isinstance(error, ValueError) else f"it is cut short or damaged ({error})"


def _read_json(text: str) -> Any:
    """As data that can be compared: NaN, too, is equal to itself."""
    return json.loads(text, parse_constant=str)


def _differences(theirs: Any, mine: Any, name: str = "") -> Iterator[str]:
    """What differs, in words, with what there is to say of it."""
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
