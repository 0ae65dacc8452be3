"""Anti-ship missile: the quickest way to strike from above, along the sea at first.

Subchan and Zbikowski, "Computational optimal control of the terminal bunt manoeuvre", Optimal Control Applications and Methods 28, 2007;
among PSOPT's examples. The least height of 30 m holds for the first 7500 m only: a phase of its own here.
"""

from __future__ import annotations

from math import pi

import casadi as ca

from ....phase import Phase
from ....problem import Problem
from ..published import Published

MASS, GRAVITY, AREA = 1005.0, 9.81, 0.3376
PUBLISHED = (Published("time", 40.9119, 5e-4, "two of our meshes: 40.9119; Subchan and Zbikowski 2007: 40.9"),)


def problem() -> Problem:
    """Thrust and angle of attack are the controls; the normal acceleration is limited all along."""
    problem = Problem("missile")
    level = problem.phase("level", t0=0.0, tf=(10.0, 60.0))
    dive = problem.phase("dive", t0=(10.0, 60.0), tf=(20.0, 100.0))
    _state(level, 30.0, {"path angle": 0.0, "speed": 272.0, "x": 0.0, "h": 30.0}, {"x": 7500.0})
    _state(dive, 0.0, {"x": 7500.0}, {"path angle": -pi / 2, "speed": 310.0, "x": 10000.0, "h": 0.0})
    problem.link(level, dive)
    problem.minimize("time", dive.tf, unit="s")
    level.guess(**{"path angle": 0}, speed=(272, 300), x=(0, 7500), h=30, thrust=6000, attack=0, tf=25.0)
    dive.guess(**{"path angle": (0, -pi / 2)}, speed=(300, 310), x=(7500, 10000), h=(500, 0), thrust=6000, attack=0, t0=25.0, tf=40.0)
    return problem


def _state(phase: Phase, lowest: float, initial: dict[str, float], final: dict[str, float]) -> None:
    """States, controls, dynamics and the limit of the load of a phase."""
    bounds = {"path angle": (-pi / 2, pi / 2), "speed": (200, 310), "x": (0, 10000), "h": (lowest, 1900)}
    path, v, _, h = (phase.state(name, bounds=bounds[name], initial=initial.get(name), final=final.get(name)) for name in bounds)
    thrust = phase.control("thrust", bounds=(1000, 6000), unit="N")
    attack = phase.control("attack", bounds=(-0.3, 0.3), unit="rad")
    pressure = 0.5 * (3.312e-9 * h**2 - 1.142e-4 * h + 1.224) * v**2 * AREA
    push = thrust - pressure * (-1.9431 * attack**2 - 0.1499 * attack + 0.2359)
    lift = pressure * 21.9 * attack
    phase.dynamics(
        **{
            "path angle": (push * ca.sin(attack) + lift * ca.cos(attack)) / (MASS * v) - GRAVITY * ca.cos(path) / v,
            "speed": (push * ca.cos(attack) - lift * ca.sin(attack)) / MASS - GRAVITY * ca.sin(path),
            "x": v * ca.cos(path),
            "h": v * ca.sin(path),
        }
    )
    phase.path("load", lift / (MASS * GRAVITY), lower=-4.0, upper=4.0, unit="g")
