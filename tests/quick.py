"""Runs the quick tests of what has changed since the last commit, `make quick`, or since another: `python -P tests/quick.py COMMIT`.

A module's tests are the files that import it in the folder of tests that mirrors its own; where none does, all that import it.
"""

import ast
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FLOORS = ("problems", "transcription", "macs", "runs")


def changed(since: str) -> list[Path]:
    """Files that differ from a commit, and new ones."""
    calls = (["git", "diff", "--name-only", since], ["git", "ls-files", "--others", "--exclude-standard"])
    return [Path(line) for call in calls for line in subprocess.check_output(call, cwd=ROOT, text=True).splitlines()]


@cache
def imports(test: Path) -> frozenset[str]:
    """Dotted names of modules, and of what is imported from them, of a file of tests."""
    names: set[str] = set()
    for node in ast.walk(ast.parse((ROOT / test).read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return frozenset(names)


def tests_of(file: Path, tests: list[Path]) -> list[Path]:
    """The files of tests of a changed file."""
    if file.suffix != ".py" or file.parts[0] not in (*FLOORS, "tests"):
        return []
    if file.parts[0] == "tests":
        return [file] if file in tests else [test for test in tests if file.stem in imports(test)]
    name = ".".join(file.with_suffix("").parts).removesuffix(".__init__")
    found = [test for test in tests if name in imports(test)]
    near = [test for test in found if test.is_relative_to(Path("tests") / file.parent)]
    return near or found or [test for test in tests if test.parent == Path("tests") / file.parent]


def main() -> int:
    """Run them."""
    tests = sorted(path.relative_to(ROOT) for path in (ROOT / "tests").rglob("test_*.py"))
    chosen = {test for file in changed((sys.argv[1:] or ["HEAD"])[0]) for test in tests_of(file, tests)}
    print("tests:", *sorted(map(str, chosen)) or ["none"], sep="\n  ")
    return int(pytest.main(["-m", "not slow", "-n", "2", *(str(ROOT / one) for one in sorted(chosen))])) if chosen else 0


if __name__ == "__main__":
    sys.exit(main())
