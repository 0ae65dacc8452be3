"""Every public name says what it is, what it takes, and shows an example that runs."""

import importlib
import inspect
from doctest import ELLIPSIS, NORMALIZE_WHITESPACE, DocTestFinder, DocTestRunner
from pathlib import Path
from typing import Any

import pytest
from numpydoc.docscrape import NumpyDocString

from macs import MACS

MODULES = ("macs", "macs.decisions", "macs.pymoo", "problems", "transcription", "runs")
NAMES = [f"{module}.{name}" for module in MODULES for name in getattr(importlib.import_module(module), "__all__", ["MACS"])]
API = Path(__file__).parents[1] / "docs" / "api"
FIRST = ["agents", "archive", "refine", "mesh", "prefer"]
"""Settings of MACS that matter first."""
QUICK = "macs.decisions.decide"
"""The example of decisions that is quick enough; others solve a front each. The first use of AGEMOEA2 compiles what pymoo has of it."""


def found(name: str) -> Any:
    module, _, item = name.rpartition(".")
    return getattr(importlib.import_module(module), item)


@pytest.mark.parametrize("name", NAMES)
def test_a_public_name_is_documented(name: str) -> None:
    thing = found(name)
    assert thing.__doc__, "no docstring of its own"
    text = NumpyDocString(inspect.cleandoc(thing.__doc__))
    assert text["Summary"] and text["Summary"][-1].rstrip().endswith(".")
    assert text["Examples"], "no example"
    takes = inspect.isclass(thing) or inspect.signature(thing).parameters
    assert text["Parameters"] or text["Attributes"] or text["Methods"] or not takes, "it does not say what it takes"


def is_slow(name: str) -> bool:
    return name == "macs.AGEMOEA2" or (name.startswith("macs.decisions") and name != QUICK)


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * is_slow(name)) for name in NAMES])
def test_the_example_of_a_public_name_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    (one,) = DocTestFinder(recurse=False).find(found(name), name, globs={})
    runner = DocTestRunner(optionflags=ELLIPSIS | NORMALIZE_WHITESPACE)
    written: list[str] = []
    runner.run(one, out=written.append)
    assert runner.tries and not runner.failures, "".join(written)


def test_the_reference_has_all_public_names() -> None:
    pages = [page.read_text(encoding="utf-8").split() for page in API.glob("*.rst")]
    assert {name.rpartition(".")[2] for name in NAMES} <= {word for words in pages for word in words}


def test_help_begins_with_the_settings_that_matter() -> None:
    text = NumpyDocString(inspect.cleandoc(MACS.__doc__ or ""))
    assert [one.name for one in text["Parameters"]] == FIRST
    assert {one.name for one in text["Parameters"] + text["Other Parameters"]} == set(inspect.signature(MACS).parameters)
