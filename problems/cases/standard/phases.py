"""Problems of several phases."""

from __future__ import annotations

from math import pi

import casadi as ca

from ...phase import Phase
from ...problem import Problem
from .published import optimum


@optimum("time", 40.9119, 5e-4, "two of our meshes: 40.9119; Subchan and Zbikowski 2007: 40.9")
def missile() -> Problem:
    """Along the sea, then a strike from above.

    Thrust and angle of attack are the controls; the normal acceleration is limited all along. Subchan and Zbikowski, "Computational
    optimal control of the terminal bunt manoeuvre", Optimal Control Applications and Methods 28, 2007; among PSOPT's examples. The least
    height of 30 m holds for the first 7500 m only: a phase of its own here.
    """
    problem = Problem("missile")
    level = problem.phase("level", t0=0.0, tf=(10.0, 60.0))
    dive = problem.phase("dive", t0=(10.0, 60.0), tf=(20.0, 100.0))
    _missile_phase(level, 30.0, {"path angle": 0.0, "speed": 272.0, "x": 0.0, "h": 30.0}, {"x": 7500.0})
    _missile_phase(dive, 0.0, {"x": 7500.0}, {"path angle": -pi / 2, "speed": 310.0, "x": 10000.0, "h": 0.0})
    problem.link(level, dive)
    problem.minimize("time", dive.tf, unit="s")
    level.guess(**{"path angle": 0}, speed=(272, 300), x=(0, 7500), h=30, thrust=6000, attack=0, tf=25.0)
    dive.guess(**{"path angle": (0, -pi / 2)}, speed=(300, 310), x=(7500, 10000), h=(500, 0), thrust=6000, attack=0, t0=25.0, tf=40.0)
    return problem


def _missile_phase(phase: Phase, lowest: float, initial: dict[str, float], final: dict[str, float]) -> None:
    """States, controls, dynamics and the limit of the load of a phase."""
    MASS, GRAVITY, AREA = 1005.0, 9.81, 0.3376
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


@optimum("distance", 0.0, 1e-6, "PSOPT: 3.1e-16; the origin is reached", remark="many optima")
def schwartz() -> Problem:
    """Two phases, the first around an ellipse.

    The distance is five times the squared one of the final state from the origin. Schwartz, "Theory and implementation of numerical
    methods based on Runge-Kutta integration for solving optimal control problems", 1996 (RIOTS, problem "obstacle"); in two phases in the
    manual of PSOPT.
    """
    problem = Problem("schwartz")
    first = problem.phase("first", t0=0.0, tf=1.0)
    second = problem.phase("second", t0=1.0, tf=2.9)
    for phase, slowest, strength in ((first, -0.8, 1.0), (second, -10.0, 50.0)):
        start = 1.0 if phase is first else None
        x = phase.state("x", bounds=(-20, 10), initial=start)
        v = phase.state("v", bounds=(slowest, 10), initial=start)
        u = phase.control("u", bounds=(-strength, strength))
        phase.dynamics(x=v, v=u - 0.1 * (1 + 2 * x**2) * v)
        phase.guess(x=1, v=1 if phase is first else 0, u=0)
    first.path("ellipse", 9 * (first["x"] - 1) ** 2 + ((first["v"] - 0.4) / 0.3) ** 2, lower=1.0)
    problem.link(first, second)
    problem.minimize("distance", 5 * (second.final(second["x"]) ** 2 + second.final(second["v"]) ** 2))
    return problem


@optimum("height", 18550.872, 5e-4, "YAPSS 0.2.3, example goddard_problem_3_phase: 18550.8719")
@optimum(
    "height", 18550.872, 5e-4, "YAPSS, in three phases", {"constrained": True}, remark="an equality that holds all along, of index two"
)
def sounding_rocket(constrained: bool = False) -> Problem:
    """The greatest height of a rocket, in three phases.

    On the singular arc weight and drag stand in a known ratio, which may be stated as a constraint, or left to be found. Bryson and Ho,
    "Applied Optimal Control", 1975, section 8.3 and problems; Betts 2010, chapter 4; with the data of YAPSS, in feet and slugs.
    """
    THRUST, GRAVITY, DRAG, EXHAUST, DECAY = 193.044, 32.174, 5.49153484923381010e-05, 1580.9425279876559, 23800.0
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
