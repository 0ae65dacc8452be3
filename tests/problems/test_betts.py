"""The greatest cross-range of a shuttle, as published."""

from __future__ import annotations

import pytest

from macs import optimize
from problems import load
from problems.cases import betts, betts_heating
from transcription import DFET, MultipleShooting


@pytest.mark.slow
def test_the_optimum_is_near_on_a_coarse_mesh():
    point = optimize(load("betts"), DFET(12, 3))
    assert point.status == "converged"
    assert point.objectives["cross-range"] == pytest.approx(betts.CROSS_RANGE, abs=5e-3)
    assert point.trajectory["entry"].tf == pytest.approx(betts.FINAL_TIME, abs=1.0)


@pytest.mark.slow
@pytest.mark.parametrize("method", [DFET(60, 4), MultipleShooting(400, control="linear")], ids=["collocated", "shot"])
@pytest.mark.parametrize(("name", "room"), [("betts", betts), ("betts_heating", betts_heating)])
def test_the_optimum_is_the_published_one(name, room, method):
    point = optimize(load(name), method, starts=1)
    assert point.status == "converged" and point.optimality is not None and point.optimality < 1e-6
    assert point.objectives["cross-range"] == pytest.approx(room.CROSS_RANGE, abs=5e-4)
    assert point.trajectory["entry"].tf == pytest.approx(room.FINAL_TIME, abs=0.5)
    check = point.simulate()
    assert check.objectives["cross-range"] == pytest.approx(room.CROSS_RANGE, abs=5e-3)
    assert room.reference().shape == (1, 1)
