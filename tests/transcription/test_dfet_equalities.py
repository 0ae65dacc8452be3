"""Path constraints that are equalities: as many as a control can satisfy, whatever its order."""

from __future__ import annotations

from math import pi, tan

import numpy as np
import pytest

from problems import Problem
from transcription import parse
from transcription.nlp.scalarized import scalarize


def closed_curve() -> Problem:
    """The largest area that a curve of length 1 encloses: that of a circle, 1 / (4 pi)."""
    problem = Problem("closed curve")
    curve = problem.phase("curve", t0=0, tf=1)
    x, y = (curve.state(name, bounds=(-1, 1)) for name in "xy")
    u, v = (curve.control(name, bounds=(-2, 2)) for name in "uv")
    curve.dynamics(x=u, y=v)
    curve.path("unit speed", u**2 + v**2, lower=1, upper=1)
    for name, state in (("x", x), ("y", y)):
        problem.constraint(f"closed in {name}", curve.final(state) - curve.initial(state), lower=0, upper=0)
        problem.constraint(f"centre in {name}", curve.integral(state), lower=0, upper=0)
    corners = [0.0, 0.25, 0.5, 0.75, 1.0]
    curve.guess(x=(corners, [0.125, 0.125, -0.125, -0.125, 0.125]), y=(corners, [0.125, -0.125, -0.125, 0.125, 0.125]), u=0.0, v=0.0)
    problem.maximize("area", curve.integral((y * u - x * v) / 2))
    return problem


CIRCLE, POLYGON = 1 / (4 * pi), 1 / (80 * tan(pi / 20))
"""The areas of a circle, and of a regular polygon of 20 sides, whose perimeter is 1."""


@pytest.mark.parametrize(
    ("word", "area", "miss"),
    [("dfet:10x4", CIRCLE, 1e-8), ("dfet:20x3:bernstein:1", CIRCLE, 3e-5), ("dfet:20x2:bernstein:0", POLYGON, 1e-8)],
)
def test_a_closed_curve_of_unit_speed_encloses_a_circle(word: str, area: float, miss: float) -> None:
    nlp = parse(word).nlp(closed_curve())
    middle = np.where(np.isnan(nlp.guess), 0.5 * (nlp.lower + nlp.upper)[nlp.free], nlp.guess)
    solved = scalarize(nlp, nlp.first_guess(middle[None])[0], reference=np.zeros(1), weights=np.ones(1))
    assert solved.status == "converged" and solved.violation < 1e-6
    assert abs(-solved.F[0] / area - 1) < miss
