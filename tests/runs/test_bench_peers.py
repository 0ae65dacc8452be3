"""The benchmark beside peers: which are missing is said, and the optima of ours are right."""

from __future__ import annotations

from math import pi

import pytest

from runs.bench import peers
from runs.bench.measured import Row


def test_peers_that_are_missing_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peers, "find_spec", lambda name: None)
    text = peers.report([Row("isoperimetric", peers.OURS, {"seconds": [0.5], "optimum": [0.0795774715]})])
    assert text.splitlines()[-1] == "not installed: yapss, rockit; for a comparison: pip install 'macs-trajectories[peers]'"
    monkeypatch.setattr(peers, "find_spec", lambda name: name)
    assert "not installed" not in peers.report([Row("isoperimetric", peers.OURS)])


@pytest.mark.slow
def test_ours_is_measured_alone_where_no_peer_is_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peers, "find_spec", lambda name: None)
    rows: list[Row] = []
    circle = next(example for example in peers.EXAMPLES if example.name == "isoperimetric")
    peers.bench_peers(rows, peers.Effort(rounds=2, examples=(circle,)))
    assert [row.who for row in rows] == [peers.OURS]
    assert len(rows[0].values["seconds"]) == 2 and abs(rows[0].of("optimum") - 1 / (4 * pi)) < 1e-8


def test_every_example_is_stated() -> None:
    for example in peers.EXAMPLES:
        assert len(example.problem().objectives) == 1
