"""Delta III: the ascent of a launcher in four phases, with boosters that burn and drop in two groups, to a transfer orbit.

Benson, "A Gauss pseudospectral transcription for optimal control", 2004; Rao et al., "Algorithm 902: GPOPS", ACM TOMS 37(2), 2010, with the
data of YAPSS. The payload and what is left of the propellant are to be as heavy as possible.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, pi, radians, sin, sqrt

import casadi as ca

from ...phase import Phase
from ...problem import Problem
from .published import optimum

MU, EARTH, SPIN, GRAVITY = 3.986012e14, 6378145.0, 7.29211585e-5, 9.80665
DENSITY, HEIGHT, DRAG = 1.225, 7200.0, 0.5 * 4 * pi
"""Of the air at the ground, the height in which it falls by e, and the drag coefficient times the area of the vehicle."""
LATITUDE = radians(28.5)
BOOSTER, FIRST, SECOND = (19290.0, 17010.0, 628500.0, 75.2), (104380.0, 95550.0, 1083100.0, 261.0), (19300.0, 16820.0, 110094.0, 700.0)
"""Mass, propellant, thrust and burning time of a booster and of both stages."""
PAYLOAD = 4164.0
ORBIT = {"size": 24361140.0, "eccentricity": 0.7308, "inclination": radians(28.5), "node": radians(269.8), "perigee": radians(130.5)}
AXES = "xyz"
START = {"x": EARTH * cos(LATITUDE), "y": 0.0, "z": EARTH * sin(LATITUDE), "vx": 0.0, "vy": EARTH * SPIN * cos(LATITUDE), "vz": 0.0}
TIMES = (0.0, 75.2, 150.4, 261.0, 961.0)


@optimum("mass", 7529.7123, 5e-4, "Rao et al. 2010: 7529.712; YAPSS 0.2.3, example delta_iii_ascent: 7529.71227")
def delta_iii() -> Problem:
    """A launcher in four phases.

    The guess stays on the pad for two phases and is in orbit, at its perigee, for the others.
    """
    problem = Problem("delta_iii")
    total = 9 * BOOSTER[0] + FIRST[0] + SECOND[0] + PAYLOAD
    goal = perigee()
    phases: list[Phase] = []
    for i, (boosters, name) in enumerate(((6, "six boosters"), (3, "three boosters"), (0, "first stage"), (None, "second stage"))):
        engines = [(1, SECOND)] if boosters is None else [(boosters, BOOSTER), (1, FIRST)]
        flow = sum(number * propellant / burning for number, (_, propellant, _, burning) in engines)
        burnt = total - flow * (TIMES[i + 1] - TIMES[i])
        phase = problem.phase(name, t0=TIMES[i], tf=TIMES[i + 1] if boosters is not None else (TIMES[i] + 100.0, TIMES[i + 1]))
        _state(phase, total, sum(number * push for number, (_, _, push, _) in engines), flow, START if i == 0 else {})
        place = START if i < 2 else goal
        phase.guess(**place, m=(total, burnt), ux=0, uy=1, uz=0)
        if phases:
            problem.link(phases[-1], phase, states=tuple(START))
        phases.append(phase)
        # What drops: the boosters that have burnt out, then the first stage.
        total = burnt - {6: 6, 3: 3}.get(boosters or 0, 0) * (BOOSTER[0] - BOOSTER[1]) - (FIRST[0] - FIRST[1] if boosters == 0 else 0.0)
    last = phases[-1]
    last.guess(tf=TIMES[-1] - 50.0)
    for name, value in _elements([last[axis] for axis in AXES], [last[f"v{axis}"] for axis in AXES]).items():
        unit, scale = {"size": ("m", EARTH), "eccentricity": ("", 1.0)}.get(name, ("rad", 1.0))
        problem.constraint(name, last.final(value), lower=ORBIT[name], upper=ORBIT[name], unit=unit, scale=scale)
    problem.maximize("mass", last.final(last["m"]), unit="kg")
    return problem


def _state(phase: Phase, mass: float, push: float, flow: float, start: Mapping[str, float]) -> None:
    """States, controls and dynamics of a phase that begins with a mass."""
    place = [phase.state(axis, bounds=(-2 * EARTH, 2 * EARTH), initial=start.get(axis), unit="m") for axis in AXES]
    speed = [phase.state(f"v{axis}", bounds=(-10000, 10000), initial=start.get(f"v{axis}"), unit="m/s") for axis in AXES]
    m = phase.state("m", bounds=(PAYLOAD, mass), initial=mass, unit="kg")
    u = [phase.control(f"u{axis}", bounds=(-1.1, 1.1)) for axis in AXES]
    radius = ca.sqrt(sum(value**2 for value in place))
    wind = [speed[0] + SPIN * place[1], speed[1] - SPIN * place[0], speed[2]]
    # A metre a second at least, so that the root has derivatives on the pad.
    drag = 0.5 * DENSITY * ca.exp(-(radius - EARTH) / HEIGHT) * DRAG * ca.sqrt(sum(value**2 for value in wind) + 1e-10)
    rates = {axis: speed[k] for k, axis in enumerate(AXES)}
    rates |= {f"v{axis}": -MU / radius**3 * place[k] + (push * u[k] - drag * wind[k]) / m for k, axis in enumerate(AXES)}
    phase.dynamics(**rates, m=-flow)
    phase.path("direction", sum(value**2 for value in u), lower=1.0, upper=1.0)
    phase.path("altitude", radius / EARTH, lower=1.0)


def _elements(place: list[ca.MX], speed: list[ca.MX]) -> dict[str, ca.MX]:
    """Five orbital elements, as smooth functions near those of `ORBIT`."""
    r, v = ca.vertcat(*place), ca.vertcat(*speed)
    radius, h = ca.norm_2(r), ca.cross(r, v)
    momentum, node = ca.norm_2(h), ca.vertcat(-h[1], h[0], 0)
    towards = ca.cross(v, h) / MU - r / radius
    node_angle = ca.atan2(node[1], node[0]) + 2 * pi
    return {
        "size": 1 / (2 / radius - ca.sumsqr(v) / MU),
        "eccentricity": ca.norm_2(towards),
        "inclination": ca.acos(h[2] / momentum),
        "node": node_angle,
        "perigee": ca.atan2(ca.dot(ca.cross(node, towards), h) / momentum, ca.dot(node, towards)),
    }


def perigee() -> dict[str, float]:
    """Place and velocity at the perigee of the orbit."""
    size, e, inclination, node, perigee = ORBIT.values()
    out = (cos(node), sin(node), 0.0)
    up = (-sin(node) * cos(inclination), cos(node) * cos(inclination), sin(inclination))
    towards = [cos(perigee) * a + sin(perigee) * b for a, b in zip(out, up, strict=True)]
    across = [cos(perigee) * b - sin(perigee) * a for a, b in zip(out, up, strict=True)]
    fastest = sqrt(MU / size * (1 + e) / (1 - e))
    return {axis: size * (1 - e) * towards[k] for k, axis in enumerate(AXES)} | {
        f"v{axis}": fastest * across[k] for k, axis in enumerate(AXES)
    }
