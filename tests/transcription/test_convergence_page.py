"""docs/convergence.py runs, and its picture shows what its title says."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "convergence.py"


@pytest.mark.slow
def test_global_collocation_converges_exponentially(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page: dict[str, Any] = runpy.run_path(str(PAGE))
    page["main"].__globals__["TARGET"] = tmp_path / "convergence.png"
    page["main"]()
    assert (tmp_path / "convergence.png").stat().st_size > 10_000 and "convergence.png" in capsys.readouterr().out
    for points in ("gauss", "radau", "lobatto"):
        found = {n: page["errors"](method)[0] for n, method in page["families"]()[points] if n <= 10}
        # Of a power of n, it would be the seventh or more.
        assert found[10] < 1e-9 and found[4] > 1e-6, points
