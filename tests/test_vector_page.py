"""The examples of docs/vector-problems.md run, and what they say is so."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from problems import names

PAGE = Path(__file__).parents[1] / "docs" / "vector-problems.md"


def test_the_examples_of_vector_problems_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    space: dict[str, Any] = {}
    text = PAGE.read_text(encoding="utf-8")
    for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        exec(block, space)
    front, again = space["front"], space["again"]
    assert front.verified.all() and again[3].simulate().objectives == front[3].objectives
    assert set(re.findall(r"^\| `(\w+)` \|", text, re.MULTILINE)) <= set(names())
    assert (tmp_path / "out/truss/report/four-bar-truss-no-transcription-variables.png").is_file()
