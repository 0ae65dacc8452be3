"""What a checkpoint keeps, refuses and says, on a state of a few numbers: no search is run."""

from __future__ import annotations

import errno
import logging
import math
import os
import pickle
import tracemalloc
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import msgspec
import numpy as np
import pytest
from damage import damaged

from macs import MACS
from macs.evaluation.evaluator import Counts
from macs.solvers import checkpoint
from macs.solvers.checkpoint import CHECKPOINT_VERSION as VERSION
from macs.solvers.checkpoint import WRITE_SECONDS, WRITE_SHARE, Checkpoint, RunStatus, Unreadable, keeps, read_file, sealed
from macs.solvers.method import SearchMethod
from macs.solvers.packing import encode


@dataclass
class Rows:
    """Points without anything said about their shapes."""

    Z: np.ndarray
    F: np.ndarray
    violation: np.ndarray


@dataclass
class State:
    archive: Rows
    closest: Rows
    step: int


class Walk(SearchMethod):
    """A solver of which a checkpoint needs no more."""

    def begin(self, *given: Any) -> State:
        raise NotImplementedError

    def advance(self, *given: Any) -> None:
        raise NotImplementedError


def rows(count: int, m: int = 2, d: int = 3) -> Rows:
    return Rows(np.full((count, d), 0.5), np.arange(float(count * m)).reshape(count, m), np.zeros(count))


def state() -> State:
    return State(rows(4), rows(1), 7)


def kept(**changes: Any) -> RunStatus:
    return replace(RunStatus(3, Counts(), 2, 1.5, "budget"), **changes)


BELONGS: dict[str, Any] = {"problem": {"name": "cart", "fingerprint": "12"}, "evaluations": 100, "settings": {"evaluations": 5}}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "run.ckpt"


def made(path: Path, belongs: dict[str, Any] | None = None) -> Checkpoint:
    return Checkpoint(path, Walk(), BELONGS if belongs is None else belongs)


def written(path: Path, what: State | None = None, how: RunStatus | None = None, belongs: dict[str, Any] | None = None) -> Checkpoint:
    """A checkpoint of which the file is up to date."""
    one = made(path, belongs)
    one.keep(what or state(), how or kept())
    one.write()
    return one


REMOVED = object()


def forged(path: Path, place: str, value: Any) -> None:
    """A file with a valid checksum in which one part, of the document or of its "state", is another, or `REMOVED`."""
    document = msgspec.msgpack.decode(checkpoint.read_file(path))
    document["state"] = msgspec.msgpack.decode(document["state"])
    *parts, last = place.split(".")
    part = document
    for name in parts:
        part = part[name]
    if value is REMOVED:
        del part[last]
    else:
        part[last] = value
    document["state"] = msgspec.msgpack.encode(document["state"])
    path.write_bytes(checkpoint.sealed(msgspec.msgpack.encode(document)))


def plain(array: np.ndarray) -> dict[str, Any]:
    """An array as a file has it."""
    return msgspec.msgpack.decode(encode(array))


class Clock:
    """Time goes on only where it is told to."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.now = 1000.0
        patch.setattr(checkpoint, "time", self)

    def perf_counter(self) -> float:
        return self.now


@pytest.mark.parametrize("seed", [None, 3])
def test_what_was_kept_comes_back(path: Path, seed: int | None) -> None:
    how = kept(counts=replace(Counts(), evaluations=17, failures=Counter(timeout=2)))
    written(path, how=how)
    found = made(path).read(seed)
    assert found is not None
    what, again = found
    assert again == how and again.counts.failures["timeout"] == 2 and type(what) is State and what.step == 7
    for name in ("archive", "closest"):
        for part in ("Z", "F", "violation"):
            assert np.array_equal(getattr(getattr(what, name), part), getattr(getattr(state(), name), part))


FAILING = pytest.mark.parametrize(
    ("error", "reason"),
    [(OSError(errno.EIO, "Input/output error"), "Input/output error"), (OSError("the tape is stuck"), "the tape is stuck")],
)


@FAILING
def test_a_file_that_cannot_be_read_says_why(path: Path, monkeypatch: pytest.MonkeyPatch, error: OSError, reason: str) -> None:
    def fails(path: Path) -> None:
        raise error

    monkeypatch.setattr(checkpoint, "read_file", fails)
    with pytest.raises(Unreadable, match=f"^checkpoint '.*run.ckpt' cannot be read: {reason}$"):
        made(path).read(None)


def test_a_state_is_kept_as_it_was_when_it_was_noted(path: Path) -> None:
    one, what = made(path), state()
    one.keep(what, kept())
    what.archive.F[:] = -1.0
    one.write()
    found = made(path).read(3)
    assert found is not None and np.array_equal(found[0].archive.F, state().archive.F)
    # The point that is nearest to feasible has no number yet.
    what = state()
    what.closest.F[:], what.closest.violation[:] = np.nan, np.inf
    written(path, what)
    assert made(path).read(3) is not None
    # A NaN is not equal to itself; the run that it belongs to is the same one.
    written(path, belongs={"bounds": [math.nan, math.inf]})
    assert made(path, {"bounds": [math.nan, math.inf]}).read(3) is not None
    with pytest.raises(Unreadable, match=r"bounds is \['NaN', 'Infinity'\] there, \['NaN', 1.0\] here"):
        made(path, {"bounds": [math.nan, 1.0]}).read(3)


def test_writes_are_a_while_apart(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """At least `WRITE_SECONDS`, from the beginning on, and at least `WRITE_SHARE` times as long as the last write took."""
    clock = Clock(monkeypatch)
    write, took = checkpoint.write_whole, 0.01

    def slow(path: Any, content: bytes) -> None:
        clock.now += took
        write(path, content)

    monkeypatch.setattr(checkpoint, "write_whole", slow)

    def after(seconds: float) -> bool:
        """Whether something is written after so many seconds."""
        path.unlink(missing_ok=True)
        one.keep(state(), kept())
        clock.now += seconds
        one.write_in_time()
        return path.exists()

    one = made(path)
    assert not after(0.9 * WRITE_SECONDS) and after(0.2 * WRITE_SECONDS)
    took = 3.0
    assert not after(0.9 * WRITE_SECONDS) and after(0.2 * WRITE_SECONDS)
    assert not after(0.9 * WRITE_SHARE * took) and after(0.2 * WRITE_SHARE * took)


@FAILING
def test_a_write_that_fails_is_logged_once_and_tried_again(
    path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, error: OSError, reason: str
) -> None:
    def fails(path: Path, content: bytes) -> None:
        raise error

    one = made(path)
    assert one.failure == ""
    one.keep(state(), kept())
    with monkeypatch.context() as patch, caplog.at_level(logging.WARNING):
        patch.setattr(checkpoint, "write_whole", fails)
        for _ in range(3):
            one.write()
            assert [record.getMessage() for record in caplog.records] == [f"checkpoint: {reason}; the search goes on without"]
    assert one.failure == f"{reason}; the file is behind" and not path.exists()
    one.write()
    assert one.failure == "" and made(path).read(3) is not None


def test_other_versions_are_told_with_the_name_of_the_file_and_remembered(
    path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    assert not written(path).mixed
    with caplog.at_level(logging.WARNING):
        same = made(path)
        same.read(3)
        assert not same.mixed and not caplog.records
        with monkeypatch.context() as patch:
            patch.setattr(checkpoint, "versions", lambda: {"numpy": "99"})
            other = made(path)
            other.read(3)
            assert other.mixed
            other.keep(state(), kept())
            other.write()
        expected = f"checkpoint '{path}' was written by other versions: the rest of the run may differ in its last bits"
        assert [record.getMessage() for record in caplog.records] == [expected]
        back = made(path)
        back.read(3)
    assert back.mixed, "what the other ones did remains part of the run"


OTHERS: list[tuple[dict[str, Any], str]] = [
    (
        BELONGS | {"evaluations": 200},
        "evaluations is 100 there, 200 here (a larger budget is another search; to add to what was found, give",
    ),
    (BELONGS | {"settings": {"evaluations": 6}}, "settings.evaluations is 5 there, 6 here; it was left as it is"),
    (
        BELONGS | {"problem": {"name": "car", "fingerprint": "34"}},
        "problem.name is 'cart' there, 'car' here; problem.fingerprint is '12' there, '34' here (bounds, equations, objectives or data",
    ),
    (BELONGS | {"more": 1}, "more is nothing there, 1 here; it was left as it is"),
    ({"problem": BELONGS["problem"], "evaluations": 100}, "settings is {'evaluations': 5} there, nothing here; it was left as it is"),
]


@pytest.mark.parametrize(("belongs", "words"), OTHERS, ids=["budget", "setting", "problem", "more", "less"])
def test_another_run_is_refused_with_what_differs_and_what_to_do(path: Path, belongs: dict[str, Any], words: str) -> None:
    written(path)
    with pytest.raises(Unreadable) as caught:
        made(path, belongs).read(3)
    assert str(caught.value).startswith(f"'{path}' belongs to another run: {words}")
    assert str(caught.value).endswith("make the call that it belongs to, name another file, or delete this one")


ZEROS = plain(np.zeros((4, 3)))
DOCUMENT, STATE = "is no valid checkpoint: ", "cannot be continued by this Walk: "
FORGED: list[tuple[str, Any, str, str]] = [
    ("belongs", '{"seed": -1}', DOCUMENT, "seed is -1, a number of at least"),
    ("belongs", "cake", DOCUMENT, "Expecting value"),
    ("idle", -2, DOCUMENT, "idle is -2, a number"),
    ("idle", 1.5, DOCUMENT, "Expected `int`, got `float` - at `$.id"),
    ("elapsed", math.inf, DOCUMENT, "elapsed is inf, a number"),
    ("elapsed", math.nan, DOCUMENT, "elapsed is nan, a number"),
    ("counts.evaluations", -5, DOCUMENT, "counts.evaluations is -5"),
    ("counts.failures", {"failed": -1}, DOCUMENT, "counts.failures['failed'] is"),
    ("versions", [{"numpy": 3}], DOCUMENT, "Expected `str`, got `int`"),
    ("versions", REMOVED, DOCUMENT, "Object missing required field `versions`"),
    ("state.step", REMOVED, STATE, "Object missing required field `step`"),
    ("state.archive.Z", 3, STATE, "no array: "),
    ("state.archive.Z", ZEROS | {"dtype": "|O"}, STATE, "no array: "),
    (
        "state.archive.Z",
        ZEROS | {"shape": [10**9, 10**9]},
        STATE,
        "no array: 96 bytes are no array (1000000000, 1000000000) of float64 - at",
    ),
    ("state.archive.Z", ZEROS | {"shape": [-4, -3]}, STATE, "no array: "),
    ("state.archive.Z", {"dtype": "<U0", "shape": [10**15], "order": "C", "content": b""}, STATE, "no array: "),
    (
        "state.archive.Z",
        plain(np.zeros((4, 3), np.float32)),
        STATE,
        "state.archive.Z is an array of float32 with 2 dimensions; float64 with",
    ),
    ("state.closest.violation", plain(np.zeros((1, 1))), STATE, "state.closest.violation is an array of float64"),
    ("state.closest.F", plain(np.zeros((2, 2))), STATE, "state.closest.F has 2 rows, 1 expected"),
    ("state.closest.F", plain(np.zeros((1, 3))), STATE, "state.closest.F has 3 columns, 2 expected"),
    ("state.archive.F", plain(np.full((4, 2), np.nan)), STATE, "state.archive has a value that is not finite"),
]


@pytest.mark.parametrize(("place", "value", "what", "words"), FORGED)
def test_what_no_run_can_have_is_refused_by_the_name_of_the_field(path: Path, place: str, value: Any, what: str, words: str) -> None:
    written(path)
    forged(path, place, value)
    content = path.read_bytes()
    with pytest.raises(Unreadable) as caught:
        made(path).read(3)
    assert str(caught.value).startswith(f"'{path}' {what}{words}")
    assert "; it was left as it is; " in str(caught.value) and path.read_bytes() == content


@pytest.mark.parametrize("content", [b"", b"\x93", b"\x91" * 10_000, b"\xdf\xff\xff\xff\xff", b"\xc6\xff\xff\xff\xff"])
def test_what_is_no_document_is_refused_before_it_takes_memory(path: Path, content: bytes) -> None:
    path.write_bytes(checkpoint.sealed(content))
    tracemalloc.start()
    try:
        with pytest.raises(Unreadable, match="is no valid checkpoint: "):
            made(path).read(3)
        assert tracemalloc.get_traced_memory()[1] < 2e7
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"closest": rows(1, m=3)}, "^state.closest.F has 3 columns, 2 expected$"),
        ({"archive": replace(rows(4), violation=np.zeros(3))}, "^state.archive.F has 4 rows, 3 exp|viol"),
        ({"step": 1.5}, "Expected `int`, got `float` - at `\\$.step`"),
        ({"step": object()}, "^object cannot be kept in a checkpoint$"),
    ],
)
def test_a_state_that_breaks_the_contract_is_refused_when_it_is_noted(path: Path, changes: dict[str, Any], words: str) -> None:
    one = made(path)
    with pytest.raises(TypeError, match=words):
        one.keep(replace(state(), **changes), kept())
    one.write()
    assert not path.exists()


@dataclass
class Shaped(Rows):
    SHAPES: ClassVar[dict[str, str]] = {"F": "rows m", "Z": "rows d", "violation": "rows"}


@dataclass
class ShapedState:
    archive: Shaped
    closest: Shaped


class ShapedWalk(Walk):
    def begin(self, *given: Any) -> ShapedState:  # type: ignore[override]
        raise NotImplementedError


@pytest.mark.parametrize(
    ("sizes", "words"), [({}, ""), ({"m": 2, "d": 3}, ""), ({"m": 3}, "F has 2 columns, 3"), ({"d": 4}, "Z has 3 col")]
)
def test_the_sizes_of_the_run_are_those_of_its_state(path: Path, sizes: dict[str, int], words: str) -> None:
    what = ShapedState(Shaped(**vars(rows(4))), Shaped(**vars(rows(1))))
    one = Checkpoint(path, ShapedWalk(), {}, sizes)
    if words:
        with pytest.raises(TypeError, match=f"^state.archive.{words}"):
            one.keep(what, kept())
        # Nor is a file of other sizes gone on from.
        unchecked = Checkpoint(path, ShapedWalk(), {})
        unchecked.keep(what, kept())
        unchecked.write()
        with pytest.raises(Unreadable, match=f"cannot be continued by this ShapedWalk: state.archive.{words}"):
            one.read(3)
    else:
        one.keep(what, kept())
        one.write()
        assert one.read(3) is not None


# Solvers that say what their state is, and others


class Silent(Walk):
    def begin(self, *given: Any):  # type: ignore[no-untyped-def]
        raise NotImplementedError


class Vague(Walk):
    def begin(self, *given: Any) -> dict[str, float]:  # type: ignore[override]
        raise NotImplementedError


class Lost(Walk):
    def begin(self, *given: Any) -> Nowhere:  # type: ignore[name-defined]  # noqa: F821
        raise NotImplementedError


@pytest.mark.parametrize(
    ("solver", "words"),
    [
        (Silent, "^checkpoint: Silent.begin is not annotated with the class of the state that it returns$"),
        (Vague, "^checkpoint: Vague.begin is not annotated with the class of the state that it returns$"),
        (Lost, "^checkpoint: what Lost.begin returns is not known at run time: name 'Nowhere' is not defined$"),
    ],
)
def test_a_solver_that_does_not_say_what_its_state_is_is_not_kept(path: Path, solver: type[Walk], words: str) -> None:
    assert keeps(Walk()) and not keeps(solver())
    with pytest.raises(ValueError, match=words):
        Checkpoint(path, solver(), {})


# Damaged files, and paths that are no files


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "run.ckpt"


def test_damage_is_refused_in_one_line(file, monkeypatch) -> None:
    def minimize(function: Callable[[np.ndarray], np.ndarray]) -> None:
        MACS(agents=4, archive=6).minimize(function, [(0.0, 1.0)] * 3, evaluations=60, seed=1, checkpoint=file)

    minimize(lambda X: np.stack([X[:, 0], 1 - X.sum(axis=1)], axis=1))
    content, rng = file.read_bytes(), np.random.default_rng(1)
    monkeypatch.setattr(checkpoint, "decode", lambda *content: pytest.fail("read"))
    for broken in (damaged(content, rng) for _ in range(180)):
        if broken != content:  # a block of zeros may be overwritten by zeros
            file.write_bytes(broken)
            with pytest.raises(ValueError, match=r"run\.ckpt' is (damaged: |no checkpoint: |a checkpoint of version)[^\n]*$"):
                minimize(lambda X: pytest.fail("evaluated"))
            assert file.read_bytes() == broken


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is no checkpoint: it is empty"),
        (b"to do: buy milk\n", "is no checkpoint: it is a file of something else"),
        (b"MACS checkpoint 3: buy milk\n", "is damaged: its first line"),
        (b"MACS checkpoint 2", "is damaged: its first line"),
        (pickle.dumps({"format": "MACS checkpoint"}), "is no checkpoint: it is a file of something else"),
        (sealed(b"", VERSION + 1), f"is a checkpoint of version {VERSION + 1}; this MACS reads version {VERSION}"),
        (sealed(b"abc") + b"d", "is damaged: it should have 3 bytes after its first line, but has 4"),
        (sealed(b"abc")[:-1] + b"d", "is damaged: its content does not match its checksum"),
    ],
)
def test_what_is_wrong_is_said(file, content, message) -> None:
    file.write_bytes(content)
    with pytest.raises(ValueError, match=f"^{message}"):
        read_file(file)


@pytest.mark.parametrize("kind", ["pipe", "device", "folder", "circle of links"])
def test_what_is_no_ordinary_file_is_refused_at_once(tmp_path, kind) -> None:
    path = tmp_path / "run.ckpt"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "folder":
        path.mkdir()
    else:
        path.symlink_to(path)
    with pytest.raises((ValueError, OSError), match=r"is no ordinary file|symbolic links"):
        read_file(path)
    with pytest.raises(
        (ValueError, OSError), match=r"run.ckpt'.*(it is no ordinary file|it is a folder|its symbolic links lead in a circle)"
    ):
        MACS(agents=4, archive=6).minimize(lambda X: pytest.fail("evaluated"), [(0.0, 1.0)] * 3, evaluations=60, checkpoint=path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is no checkpoint"),
        (sealed(b"abc"), "is damaged"),
        (b"MACS checkpoint", "is damaged"),
        (f"MACS checkpoint {VERSION}: {10**12} bytes, sha256 {'0' * 64}\n".encode(), "it has 1000000000000 bytes, more than 4294967296"),
    ],
)
def test_a_huge_file_is_not_read(file, content, message) -> None:
    with file.open("wb") as opened:
        opened.write(content)
        opened.truncate(len(content) + 10**12)  # sparse: it takes no room on the disk
    with pytest.raises(ValueError, match=message):
        read_file(file)
