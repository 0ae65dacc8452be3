"""Choosing where to land on rough ground: effort of the diverts against hazard of the sites. As many local fronts as there are hollows.

Landers that descend in a given time may end their horizontal flight, at rest, wherever they like; the farther, the more effort. The ground
gets safer towards a plain in the distance and is full of hollows, each of which is a trap for searches that follow slopes: each of the
landers has to find the right one of some two hundred. The true front is known because effort and hazard are both plain functions of the
site: the least effort to get there is a closed form.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from ..problem import Problem

DURATION = 40.0
VELOCITY = (0.02, -0.01)
PLAIN = (2.0, 1.4)
"""The safest region, km from below the lander."""
FAR = 2.5
"""Distance over which the ground gets safer by one."""
HOLLOW, ROUGH = 0.42, 0.2
"""Distance of the hollows, km, and half their depth."""
REACH = 3.0
LANDERS = 3
ENOUGH = 3000
"""Points of a front that are kept; as good as any more."""


def problem(landers: int = LANDERS) -> Problem:
    """The case for some landers at once, whose efforts and hazards are added; cubic flights are exact on its mesh, and so is its front."""
    problem = Problem("landing_site")
    divert = problem.phase("divert", t0=0.0, tf=DURATION)
    rates: dict[str, Any] = {}
    effort, danger = ca.MX(0), ca.MX(0)
    for i in range(1, landers + 1):
        site = []
        for axis, velocity in zip("xy", VELOCITY, strict=True):
            place = divert.state(f"{axis}{i}", bounds=(-REACH, REACH), initial=0, unit="km")
            speed = divert.state(f"v{axis}{i}", bounds=(-0.5, 0.5), initial=velocity, final=0, unit="km/s")
            thrust = divert.control(f"a{axis}{i}", bounds=(-0.012, 0.012), unit="km/s2")
            rates |= {f"{axis}{i}": speed, f"v{axis}{i}": thrust}
            effort += divert.integral(1e6 * thrust**2)
            site.append(divert.final(place))
        danger += hazard(site[0], site[1], cos=ca.cos)
    divert.dynamics(**rates)
    problem.minimize("effort", effort, unit="m2/s3")
    problem.minimize("hazard", danger)
    problem.default_transcription = "dfet:1x3"
    problem.default_evaluations = 10_000
    return problem


def hazard(x: Any, y: Any, cos: Any = np.cos) -> Any:
    """The hazard of landing at (x, y) km."""
    slope = ((x - PLAIN[0]) ** 2 + (y - PLAIN[1]) ** 2) / FAR**2
    k = 2 * np.pi / HOLLOW
    return slope + ROUGH * (2 - cos(k * x) - cos(k * (y + 0.3 * x)))


def least_effort(x: Any, y: Any) -> Any:
    """Least effort, m2/s3, to come to rest at (x, y) km: thrust that is linear in time, the minimum-energy transfer (Bryson and Ho)."""
    T = DURATION
    squares = [12 * d**2 / T**3 - 12 * d * v / T**2 + 4 * v**2 / T for d, v in zip((x, y), VELOCITY, strict=True)]
    return 1e6 * (squares[0] + squares[1])


def reference(landers: int = LANDERS) -> np.ndarray:
    """The true front of some landers. Each of an optimal team is optimal by itself: their fronts are added point by point, and sifted.

    Effort and hazard (k, 2), in pieces.
    """
    front = alone = single()
    for _ in range(landers - 1):
        front = _sifted((front[:, None] + alone).reshape(-1, 2))
    return front


@lru_cache(maxsize=1)
def single(rings: int = 4000, angles: int = 2400) -> np.ndarray:
    """The true front of one lander, by a scan of the whole ground: equal effort is a circle, and a site is optimal if no site on the way
    out to its circle is safer.

    Effort and hazard (k, 2), in pieces: one for each hollow that is worth flying to.
    """
    center = 0.5 * DURATION * np.array(VELOCITY)
    radius = np.linspace(0.0, np.linalg.norm(np.array(PLAIN) - center) + HOLLOW, rings)
    step = 2 * np.pi / angles
    directions = step * np.arange(angles)

    def on_ring(r: np.ndarray, angle: np.ndarray) -> np.ndarray:
        return hazard(center[0] + r * np.cos(angle), center[1] + r * np.sin(angle))

    best = np.array([directions[np.argmin(on_ring(r, directions))] for r in radius])
    for width in step * 0.5 ** np.arange(20):
        # Nearer and nearer to the lowest point between neighbours.
        trial = best[:, None] + width * np.array([-1.0, 0.0, 1.0])
        best = trial[np.arange(rings), np.argmin(on_ring(radius[:, None], trial), axis=1)]
    sites = center[:, None] + radius * np.stack([np.cos(best), np.sin(best)])
    return _sifted(np.column_stack([least_effort(*sites), on_ring(radius, best)]))


def _sifted(points: np.ndarray) -> np.ndarray:
    """The points (k, 2) that none dominates, in order of effort; of too many only some."""
    points = points[np.lexsort(points.T[::-1])]
    lowest = np.minimum.accumulate(points[:, 1])
    front = points[np.concatenate([[True], points[1:, 1] < lowest[:-1]])]
    return front[np.unique(np.linspace(0, len(front) - 1, min(len(front), ENOUGH)).round().astype(int))]
