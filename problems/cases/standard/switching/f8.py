"""F-8 aircraft: the quickest return to trim by an elevator that is full up or full down.

Kaya and Noakes, "Computational method for time-optimal switching control", JOTA 117(1), 2003; dynamics of Garrard and Jordan, "Design of
nonlinear automatic flight control systems", Automatica 13, 1977; "F-8 aircraft" of mintoc.de (Sager 2012).
"""

from __future__ import annotations

from ....problem import Problem
from ..published import Published

ELEVATOR = 0.05236
PUBLISHED = (
    Published(
        "time",
        3.780855775,
        1e-8,
        "Sager, mintoc.de: 3.78086; its four arcs, integrated: see tests",
        local=(6.035, 5.742, 5.729, 4.400),
        remark="local optima as published by Kaya and Noakes 2003 and others; a single start often ends in one of them",
    ),
)


def problem() -> Problem:
    """Angle of attack, pitch angle and pitch rate; the elevator is a control within its limits, at which it stays by itself."""
    problem = Problem("f8")
    turn = problem.phase("return", t0=0.0, tf=(0.1, 20.0))
    attack = turn.state("attack", bounds=(-2, 2), initial=0.4655, final=0, unit="rad")
    pitch = turn.state("pitch", bounds=(-2, 2), initial=0, final=0, unit="rad")
    rate = turn.state("rate", bounds=(-2, 2), initial=0, final=0, unit="rad/s")
    u = turn.control("elevator", bounds=(-ELEVATOR, ELEVATOR), unit="rad")
    turn.dynamics(
        attack=-0.877 * attack
        + rate
        - 0.088 * attack * rate
        + 0.47 * attack**2
        - 0.019 * pitch**2
        - attack**2 * rate
        + 3.846 * attack**3
        - 0.215 * u
        + 0.28 * attack**2 * u
        + 0.47 * attack * u**2
        + 0.63 * u**3,
        pitch=rate,
        rate=-4.208 * attack
        - 0.396 * rate
        - 0.47 * attack**2
        - 3.564 * attack**3
        - 20.967 * u
        + 6.265 * attack**2 * u
        + 46.0 * attack * u**2
        + 61.4 * u**3,
    )
    problem.minimize("time", turn.tf, unit="s")
    return problem
