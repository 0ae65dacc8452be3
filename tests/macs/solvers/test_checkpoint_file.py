"""The file of a checkpoint: what was damaged is refused before it is unpacked, and what was forged before it takes memory."""

from __future__ import annotations

import hashlib
import io
import json
import os
import re
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from macs import MACS
from macs.solvers import checkpoint
from macs.solvers.checkpoint import VERSION, read_file, to_bytes

DOCUMENT = {"numbers": [1, 2.5, float("inf")], "word": "é"}
ARRAYS = {"state.Z": np.arange(600.0).reshape(20, 30), "state.status": np.array(["converged", "failed"]), "state.empty": np.zeros((0, 3))}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "run.ckpt"


def sealed(archive: bytes, version: int = VERSION) -> bytes:
    """An archive with a valid first line, as a forger would write it."""
    return f"MACS checkpoint {version}: {len(archive)} bytes, sha256 {hashlib.sha256(archive).hexdigest()}\n".encode() + archive


def zipped(members: dict[str, bytes], compression: int = zipfile.ZIP_STORED) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", compression) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def npy(array: np.ndarray, **changes: Any) -> bytes:
    """An npy file whose header may be forged."""
    buffer = io.BytesIO()
    header = {"descr": np.lib.format.dtype_to_descr(array.dtype), "fortran_order": False, "shape": array.shape} | changes
    np.lib.format.write_array_header_1_0(buffer, header)
    return buffer.getvalue() + array.tobytes()


def same(one: tuple[Any, dict[str, np.ndarray]], two: tuple[Any, dict[str, np.ndarray]]) -> bool:
    (document, arrays), (other, others) = one, two
    return document == other and [*arrays] == [*others] and all(same_array(arrays[name], others[name]) for name in arrays)


def same_array(one: np.ndarray, two: np.ndarray) -> bool:
    """In their values row by row, and in the order that they have in memory."""
    return (one.dtype, one.shape, one.tobytes("C"), one.tobytes("A")) == (two.dtype, two.shape, two.tobytes("C"), two.tobytes("A"))


def test_what_is_written_is_read(file) -> None:
    arrays = ARRAYS | {"state.F": np.asfortranarray(np.arange(6.0).reshape(2, 3)), "state.one": np.array(1 + 2j)}
    file.write_bytes(to_bytes(DOCUMENT, arrays))
    found = read_file(file)
    assert same(found, (DOCUMENT, arrays))
    assert found[1]["state.F"].flags.f_contiguous and all(array.flags.writeable and array.flags.owndata for array in found[1].values())


# Damaged files


def flipped(content: bytes, rng: np.random.Generator) -> bytes:
    place = int(rng.integers(len(content)))
    return content[:place] + bytes([content[place] ^ 1 << int(rng.integers(8))]) + content[place + 1 :]


def truncated(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: int(rng.integers(len(content)))]


def zeroed(content: bytes, rng: np.random.Generator) -> bytes:
    start, length = block(content, rng)
    return content[:start] + bytes(length) + content[start + length :]


def repeated(content: bytes, rng: np.random.Generator) -> bytes:
    start, length = block(content, rng)
    return content[: start + length] + content[start:]


def overwritten(content: bytes, rng: np.random.Generator) -> bytes:
    (start, length), (other, _) = block(content, rng), block(content, rng)
    return content[:start] + content[other : other + length] + content[start + len(content[other : other + length]) :]


def swapped(content: bytes, rng: np.random.Generator) -> bytes:
    """Two members of the archive change places; the first line stays."""
    line, _, archive = content.partition(b"\n")
    with zipfile.ZipFile(io.BytesIO(archive)) as opened:
        members = {name: opened.read(name) for name in opened.namelist()}
    one, two = rng.choice([*members], 2, replace=False)
    return line + b"\n" + zipped(members | {one: members[two], two: members[one]})


def appended(content: bytes, rng: np.random.Generator) -> bytes:
    return content + (bytes(int(rng.integers(1, 5000))) if rng.random() < 0.5 else content[int(rng.integers(len(content) - 1)) :])


def block(content: bytes, rng: np.random.Generator) -> tuple[int, int]:
    return int(rng.integers(len(content) - 1)), int(rng.integers(1, 600))


DAMAGES = [flipped, truncated, zeroed, repeated, overwritten, swapped, appended]


@pytest.mark.parametrize("damage", DAMAGES, ids=lambda damage: damage.__name__)
def test_damage_is_refused_in_one_line(file, monkeypatch, damage: Callable[[bytes, np.random.Generator], bytes]) -> None:
    def minimize(function: Callable[[np.ndarray], np.ndarray]) -> None:
        MACS(agents=4, archive=6).minimize(function, [(0.0, 1.0)] * 3, evaluations=60, seed=1, checkpoint=file)

    minimize(lambda X: np.stack([X[:, 0], 1 - X.sum(axis=1)], axis=1))
    content, rng = file.read_bytes(), np.random.default_rng(1)
    monkeypatch.setattr(checkpoint, "_from_archive", lambda archive: pytest.fail("unpacked"))
    for broken in (damage(content, rng) for _ in range(30)):
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
        (
            zipped({"document.npy": npy(np.zeros(3, np.uint8))}),
            "is no checkpoint: it is a file of something else, or of an older MACS",
        ),  # the format before the first line
        (sealed(b"", VERSION + 1), f"is a checkpoint of version {VERSION + 1}; this MACS reads version {VERSION}"),
        (sealed(b"abc") + b"d", "is damaged: it should have 3 bytes after its first line, but has 4"),
        (sealed(b"abc")[:-1] + b"d", "is damaged: its content does not match its checksum"),
    ],
)
def test_what_is_wrong_is_said(file, content, message) -> None:
    file.write_bytes(content)
    with pytest.raises(ValueError, match=f"^{message}"):
        read_file(file)


# Forged files


DOCUMENT_MEMBER = npy(np.frombuffer(json.dumps(DOCUMENT).encode(), dtype=np.uint8))
HUGE = 10**15
FORGED = {
    "no archive": (b"PK is not enough", "its archive cannot be read"),
    "no document": (zipped({"state.Z.npy": npy(np.zeros(3))}), "it has no document"),
    "no JSON": (zipped({"document.npy": npy(np.frombuffer(b"{", np.uint8))}), "its document is no JSON"),
    "deep JSON": (zipped({"document.npy": npy(np.frombuffer(b"[" * 10**6, np.uint8))}), "its document is no JSON"),
    "text as an array": (zipped({"document.npy": DOCUMENT_MEMBER, "state.Z.npy": b"1 2 3"}), "state.Z is no array"),
    "a bomb": (
        zipped({"document.npy": DOCUMENT_MEMBER, "state.Z.npy": bytes(10**8)}, zipfile.ZIP_DEFLATED),
        r"its archive cannot be read \(its members are compressed",
    ),
    "a shape without its bytes": (
        zipped({"state.Z.npy": npy(np.zeros(3), shape=(HUGE,))}),
        "state.Z is no array .its 24 bytes",
    ),
    "a shape of nothing": (zipped({"state.Z.npy": npy(np.zeros(3), shape=(0, HUGE * HUGE))}), "state.Z is no array"),
    "a negative shape": (zipped({"state.Z.npy": npy(np.zeros(3), shape=(-1, -3))}), "state.Z is no array"),
    "a shape of NaN": (zipped({"state.Z.npy": npy(np.zeros(3), shape="nan")}), "state.Z is no array"),
    "items without bytes": (zipped({"state.Z.npy": npy(np.zeros(0), descr="<U0", shape=(HUGE,))}), "state.Z is no array"),
    "objects": (zipped({"state.Z.npy": npy(np.zeros(3), descr="|O")}), "state.Z is no array"),
    "a header that is no Python": (zipped({"state.Z.npy": npy(np.zeros(3), shape="((").replace(b"'(('", b"((((")}), "state.Z is no array"),
    "a type of no kind": (zipped({"state.Z.npy": npy(np.zeros(3), descr="<q9")}), "state.Z is no array"),
}


@pytest.mark.parametrize("kind", FORGED)
def test_a_forged_file_is_refused_before_it_takes_memory(file, kind) -> None:
    archive, message = FORGED[kind]
    file.write_bytes(sealed(archive))
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=f"^is no valid checkpoint: {message}"):
            read_file(file)
        assert tracemalloc.get_traced_memory()[1] < 2e7
    finally:
        tracemalloc.stop()


def test_members_that_overlap_are_refused(file) -> None:
    """A bomb without compression: every entry of the directory is the same member."""
    archive = zipped({f"{i:03}.npy": npy(np.zeros(1000)) if i == 0 else b"" for i in range(100)})
    start = archive.index(b"PK\x01\x02")
    first = re.compile(rb"PK\x01\x02.{42}(000)\.npy", re.DOTALL).match(archive, start)
    assert first is not None
    entries = b"".join(first[0].replace(b"000.npy", b"%03d.npy" % i) for i in range(100))
    end = archive.index(b"PK\x05\x06")
    assert len(entries) == end - start
    file.write_bytes(sealed(archive[:start] + entries + archive[end:]))
    with pytest.raises(ValueError, match=r"its archive cannot be read \(its members are compressed, or overlap\)$"):
        read_file(file)


# Paths that are no files


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


def test_a_huge_file_is_not_read(file) -> None:
    for content in (b"", sealed(b"abc"), b"MACS checkpoint"):
        with file.open("wb") as opened:
            opened.write(content)
            opened.truncate(10**12)  # sparse: it takes no room on the disk
        with pytest.raises(ValueError, match=r"is damaged|is no checkpoint"):
            read_file(file)


def test_a_huge_file_that_states_its_size_is_not_read(file) -> None:
    line = f"MACS checkpoint {VERSION}: {10**12} bytes, sha256 {'0' * 64}\n".encode()
    with file.open("wb") as opened:
        opened.write(line)
        opened.truncate(len(line) + 10**12)
    with pytest.raises(ValueError, match=r"it has 1000000000000 bytes, more than 4294967296"):
        read_file(file)
