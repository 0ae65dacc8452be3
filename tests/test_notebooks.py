"""The notebooks of docs/notebooks run from top to bottom, and what their cells end with can be shown."""

import ast
import json
from pathlib import Path
from typing import Any

import matplotlib
import pytest

FOLDER = Path(__file__).parents[1] / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))


def cells(path: Path) -> list[dict[str, Any]]:
    return json.loads(path.read_text(encoding="utf-8"))["cells"]


def run(source: str, space: dict[str, Any], name: str) -> Any:
    """Run a cell; returns the value of its last line, as a notebook shows it, or None after a semicolon."""
    tree = ast.parse(source, name)
    last = tree.body[-1] if tree.body and isinstance(tree.body[-1], ast.Expr) and not source.rstrip().endswith(";") else None
    exec(compile(ast.Module(tree.body[:-1] if last else tree.body, []), name, "exec"), space)
    return eval(compile(ast.Expression(last.value), name, "eval"), space) if last else None


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    space: dict[str, Any] = {"__name__": "__notebook__"}
    shown = 0
    with matplotlib.rc_context():
        matplotlib.use("Agg")
        for number, cell in enumerate(cells(path)):
            if cell["cell_type"] == "code":
                value = run("".join(cell["source"]), space, f"{path.name}, cell {number}")
                html = getattr(value, "_repr_html_", None)
                shown += html is not None and len(html()) > 100
    assert shown, "no cell shows a front, a point or a study"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_are_kept_without_results(path: Path):
    """Of format 4.5, each cell with an id of its own; it begins with a title. There are six."""
    assert len(NOTEBOOKS) == 6
    whole = json.loads(path.read_text(encoding="utf-8"))
    assert (whole["nbformat"], whole["nbformat_minor"]) == (4, 5) and set(whole) == {"cells", "metadata", "nbformat", "nbformat_minor"}
    assert whole["cells"][0]["cell_type"] == "markdown" and whole["cells"][0]["source"][0].startswith("# ")
    ids = [cell["id"] for cell in whole["cells"]]
    assert len(set(ids)) == len(ids)
    for cell in whole["cells"]:
        assert cell["cell_type"] in ("code", "markdown") and isinstance(cell["source"], list) and cell["metadata"] == {}
        assert cell["cell_type"] == "markdown" or (cell["outputs"] == [] and cell["execution_count"] is None)
