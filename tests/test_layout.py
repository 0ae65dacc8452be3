"""The size of files and folders: a folder reads as a table of contents, a file has one idea (docs/architecture.md)."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[1]
MODULES = [path for floor in ("problems", "transcription", "macs", "runs") for path in (ROOT / floor).rglob("*.py")]


def test_no_folder_has_more_than_14_modules():
    counts = Counter(path.parent.relative_to(ROOT) for path in MODULES if path.name != "__init__.py")
    assert {str(folder): count for folder, count in counts.items() if count > 14} == {}


def test_no_module_has_more_than_700_lines():
    lines = {str(path.relative_to(ROOT)): len(path.read_text(encoding="utf-8").splitlines()) for path in MODULES}
    assert {name: count for name, count in lines.items() if count > 700} == {}
