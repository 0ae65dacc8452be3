"""The examples of docs/aerocapture.md run, and what they print is what the page says."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path
from typing import Any

import pytest

from problems import names

PAGE = Path(__file__).parents[1] / "docs" / "aerocapture.md"


def test_the_examples_of_aerocapture_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    text, space, printed = PAGE.read_text(encoding="utf-8"), dict[str, Any](), io.StringIO()
    with contextlib.redirect_stdout(printed):
        for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
            exec(block, space)
    assert space["front"].verified.all()
    for block in re.findall(r"```text\n(.*?)```", text, re.DOTALL):
        assert block in printed.getvalue()
    assert printed.getvalue().rstrip().endswith("0.594")
    assert set(re.findall(r"^\| `(aerocapture\w*)` \|", text, re.MULTILINE)) <= set(names())
    studies = {path.stem for path in (PAGE.parents[1] / "runs" / "studies").glob("*.toml")}
    assert set(re.findall(r"^\| `(aerocapture-\w+)` \|", text, re.MULTILINE)) <= studies
