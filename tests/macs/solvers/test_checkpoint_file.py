"""The file of a checkpoint: what is damaged or no checkpoint is refused in a line, before any of it is read."""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from damage import damaged

from macs import MACS
from macs.solvers import checkpoint
from macs.solvers.checkpoint import CHECKPOINT_VERSION as VERSION
from macs.solvers.checkpoint import read_file, sealed


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "run.ckpt"


# Damaged files


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
        (
            sealed(b"", VERSION + 1),
            f"is a checkpoint of version {VERSION + 1}; this MACS reads version {VERSION}",
        ),
        (sealed(b"abc") + b"d", "is damaged: it should have 3 bytes after its first line, but has 4"),
        (sealed(b"abc")[:-1] + b"d", "is damaged: its content does not match its checksum"),
    ],
)
def test_what_is_wrong_is_said(file, content, message) -> None:
    file.write_bytes(content)
    with pytest.raises(ValueError, match=f"^{message}"):
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
