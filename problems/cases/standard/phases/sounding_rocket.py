"""Sounding rocket: Goddard's rocket in three phases, full thrust, a singular arc and none, each with what is known of it.

Bryson and Ho, "Applied Optimal Control", 1975, section 8.3 and problems; Betts 2010, chapter 4; with the data of YAPSS, in feet and
slugs.
"""

from __future__ import annotations

import casadi as ca

from ....phase import Phase
from ....problem import Problem
from ..published import Published

THRUST, GRAVITY, DRAG, EXHAUST, DECAY = 193.044, 32.174, 5.49153484923381010e-05, 1580.9425279876559, 23800.0
SOURCE = "YAPSS 0.2.3, example goddard_problem_3_phase: 18550.8719"
PUBLISHED = (
    Published("height", 18550.872, 5e-4, SOURCE),
    Published("height", 18550.872, 5e-4, SOURCE, {"constrained": True}, remark="an equality that holds all along, of index two"),
)


def problem(constrained: bool = False) -> Problem:
    """On the singular arc weight and drag stand in a known ratio, which may be stated as a constraint, or left to be found."""
    problem = Problem("sounding_rocket")
    times = {"full": (0.0, (1.0, 45.0)), "singular": ((1.0, 45.0), (2.0, 60.0)), "coast": ((2.0, 60.0), (5.0, 100.0))}
    phases: list[Phase] = []
    for i, (name, (t0, tf)) in enumerate(times.items()):
        phase = problem.phase(name, t0=t0, tf=tf)
        first, last = i == 0, i == 2
        h = phase.state("h", bounds=(0, 20000), initial=0 if first else None, unit="ft")
        v = phase.state("v", bounds=(0, 10000), initial=0 if first else None, unit="ft/s")
        m = phase.state("m", bounds=(1, 3), initial=3 if first else None, final=1 if last else None, unit="slug")
        thrust = phase.control("thrust", bounds=(0.01 * THRUST, 0.99 * THRUST), unit="lbf") if name == "singular" else THRUST * first
        drag = DRAG * v**2 * ca.exp(-h / DECAY)
        phase.dynamics(h=v, v=(thrust - drag) / m - GRAVITY, m=-thrust / EXHAUST)
        if name == "singular":
            if constrained:
                phase.path("singular", m * GRAVITY - (1 + v / EXHAUST) * drag, lower=0.0, upper=0.0)
            phase.guess(thrust=0.5 * THRUST)
        phase.guess(h=(6000 * i, 6000 * (i + 1)), v=500, m=(3 - 2 / 3 * i, 3 - 2 / 3 * (i + 1)), tf=15.0 * (i + 1))
        if phases:
            problem.link(phases[-1], phase)
        phases.append(phase)
    problem.maximize("height", phases[-1].final(phases[-1]["h"]), unit="ft")
    return problem
