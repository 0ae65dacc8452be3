"""Problems of the benchmark of fronts: catalogued ones, and three as others state them; some have one valley, some have many."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from problems import Problem, load
from problems.phase import Phase

GRAVITY = 9.80665e-3
"""In km/s2."""


@dataclass(frozen=True)
class Case:
    """A problem, and the word of its transcription."""

    name: str
    build: Callable[[], Problem]
    transcription: str


def cart_pole() -> Problem:
    """Swing-up of a pole of 0.5 m and 0.3 kg on a cart of 1 kg, after Kelly, SIAM Review 59(4), 2017, with a free time and a low roof."""
    M, m, length, g = 1.0, 0.3, 0.5, 9.81
    problem = Problem("cart-pole")
    swing = problem.phase("swing", t0=0.0, tf=(1.0, 4.0))
    x = swing.state("x", bounds=(-2, 2), initial=0, final=1, unit="m")
    angle = swing.state("angle", bounds=(-2 * ca.pi, 2 * ca.pi), initial=0, final=ca.pi, unit="rad")
    v = swing.state("v", bounds=(-10, 10), initial=0, final=0, unit="m/s")
    w = swing.state("w", bounds=(-20, 20), initial=0, final=0, unit="rad/s")
    force = swing.control("force", bounds=(-20, 20), unit="N")
    c, s = ca.cos(angle), ca.sin(angle)
    D = M + m * (1 - c**2)
    turning = -(length * m * c * s * w**2 + force * c + (m + M) * g * s) / (length * D)
    swing.dynamics(x=v, angle=w, v=(length * m * s * w**2 + force + m * g * c * s) / D, w=turning)
    swing.path("place of the tip", x + length * s, lower=-0.6, upper=1.6)
    problem.minimize("time", swing.tf, unit="s")
    problem.minimize("energy", swing.integral(force**2), unit="N^2 s")
    return problem


def bioreactor() -> Problem:
    """Fed batch with inhibited growth, in the manner of Park and Ramirez, AIChE Journal 34(9), 1988: yield against productivity."""
    problem = Problem("fed batch")
    batch = problem.phase("batch", t0=0.0, tf=(5.0, 40.0), time_unit="h")
    cells = batch.state("cells", bounds=(0, 50), initial=1.0, unit="g/L")
    food = batch.state("food", bounds=(0, 50), initial=5.0, unit="g/L")
    made = batch.state("made", bounds=(0, 50), initial=0.0, unit="g/L")
    volume = batch.state("volume", bounds=(1, 10), initial=2.0, unit="L")
    feed = batch.control("feed", bounds=(0, 1.0), unit="L/h")
    growth = 0.4 * food / (0.5 + food + food**2 / 50)
    making = 0.1 * growth + 0.02 * food / (food + 0.1)
    thinning = feed / volume
    batch.dynamics(
        cells=growth * cells - thinning * cells,
        food=-growth * cells / 0.5 - making * cells / 1.2 + thinning * (100 - food),
        made=making * cells - thinning * made,
        volume=feed,
    )
    product = batch.final(made * volume)
    problem.maximize("product", product, unit="g")
    problem.maximize("productivity", product / batch.tf, unit="g/h")
    return problem


def rocket() -> Problem:
    """Payload against time to orbit of a rocket with two stages over a flat earth, with the centrifugal force of a round one."""
    problem = Problem("two-stage rocket")
    payload = problem.parameter("payload", bounds=(0.5, 8.0), unit="t")
    first = problem.phase("first stage", t0=0.0, tf=(50.0, 150.0))
    second = problem.phase("second stage", t0=(50.0, 150.0), tf=(150.0, 500.0))

    def body(stage: Phase, thrust: float, impulse: float, masses: tuple[float, float], at_rest: bool) -> tuple[ca.MX, ...]:
        """Thrust in t km/s2, specific impulse in s; returns height, speeds and mass."""
        begins = {"initial": 0.0} if at_rest else {}
        h = stage.state("h", bounds=(0, 300), unit="km", **begins)
        vx = stage.state("vx", bounds=(-1, 9), unit="km/s", **begins)
        vy = stage.state("vy", bounds=(-2, 4), unit="km/s", **begins)
        mass = stage.state("mass", bounds=masses, unit="t")
        pitch = stage.control("pitch", bounds=(-0.5, 1.6), unit="rad")
        throttle = stage.control("throttle", bounds=(0.3, 1.0))
        push = thrust * throttle / mass
        stage.dynamics(
            h=vy,
            vx=push * ca.cos(pitch),
            vy=push * ca.sin(pitch) - GRAVITY + vx**2 / 6400,
            mass=-thrust * throttle / (impulse * GRAVITY),
        )
        return h, vx, vy, mass

    _, _, _, lower = body(first, 1.9, 300.0, (15, 130), True)
    h, vx, vy, upper = body(second, 0.35, 340.0, (2, 40), False)
    problem.constraint("launch mass", first.initial(lower) - payload, lower=115.0, upper=115.0)
    problem.link(first, second, states=["h", "vx", "vy"])
    problem.constraint("staging", second.initial(upper) - (first.final(lower) - 8.0), lower=0, upper=0)
    problem.constraint("propellant of the first stage", first.final(lower) - payload, lower=30.0)
    problem.constraint("propellant of the second stage", second.final(upper) - payload, lower=2.0)
    problem.constraint("altitude", second.final(h), lower=200, upper=200)
    problem.constraint("orbital speed", second.final(vx), lower=7.6)
    problem.constraint("level", second.final(vy), lower=0, upper=0)
    problem.maximize("payload", payload, unit="t")
    problem.minimize("time to orbit", second.tf, unit="s")
    return problem


CASES = (
    Case("goddard", lambda: load("goddard"), "dfet:4x6"),
    Case("orbit_rise", lambda: load("orbit_rise"), "dfet:30x1"),
    Case("rocket", rocket, "dfet:8x4"),
    Case("cart-pole", cart_pole, "dfet:10x5"),
    Case("landing_site", lambda: load("landing_site"), "dfet:1x3"),
    Case("bioreactor", bioreactor, "dfet:12x3:bernstein"),
)
