from pathlib import Path

import pytest
from chromium import started

from runs.cli import main


@pytest.fixture(scope="module")
def browser():
    """Headless Chromium."""
    driver = started()
    yield driver
    driver.quit()


@pytest.fixture
def here(tmp_path, monkeypatch) -> Path:
    """A working folder of its own."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def refused(here, capsys):
    """Makes a wrong call of `macs`, which writes no file; returns the one line of the answer."""

    def files() -> set[Path]:
        return {path for path in here.rglob("*") if "__pycache__" not in path.parts}

    def refused(*call: str) -> str:
        capsys.readouterr()
        before = files()
        try:
            code = main(call)
        except SystemExit as end:
            code = end.code
        said = capsys.readouterr()
        assert (code, said.out) == (2, "") and said.err.startswith("macs") and files() == before
        (line,) = said.err.splitlines()
        return line

    return refused
