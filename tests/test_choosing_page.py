"""The examples of docs/choosing.md run, and what they say is so."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

PAGE = Path(__file__).parents[1] / "docs" / "choosing.md"


def test_the_examples_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    space: dict[str, Any] = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL):
        exec(block, space)
    found = [f"{turn.choice.objectives['flight time']:.0f}" for turn in space["dialogue"].history]
    assert found == re.findall(r"# (\d+) s\b", PAGE.read_text(encoding="utf-8"))
