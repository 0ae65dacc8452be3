"""Flights with smooth controls, without active constraints along the way."""

from __future__ import annotations

from math import pi

import casadi as ca

from ...problem import Problem
from .published import optimum


@optimum("range", 1248.031, 5e-4, "Betts 2010, section 6.5: 1248.031")
def hang_glider() -> Problem:
    """As far as possible through a thermal.

    From a height of 1000 m to one of 900 m; the thermal is at 250 m. Bulirsch, Nerz, Pesch and von Stryk, "Combining direct and indirect
    methods in optimal control: range maximization of a hang glider", 1993; Betts 2010, section 6.5, whose speeds at the ends are those of
    the best steady glide; problem 9 of COPS 3.0 with rounded data.
    """
    MASS, GRAVITY, AREA, DENSITY = 100.0, 9.80665, 14.0, 1.13
    DRAG, INDUCED = 0.034, 0.069662
    UPDRAFT, RADIUS = 2.5, 100.0
    SPEED, SINK = 13.2275675, -1.28750052
    problem = Problem("hang_glider")
    glide = problem.phase("glide", t0=0.0, tf=(10.0, 200.0))
    x = glide.state("x", bounds=(0, 1500), initial=0, unit="m")
    glide.state("y", bounds=(0, 1100), initial=1000, final=900, unit="m")
    vx = glide.state("vx", bounds=(0, 15), initial=SPEED, final=SPEED, unit="m/s")
    vy = glide.state("vy", bounds=(-4, 4), initial=SINK, final=SINK, unit="m/s")
    lift = glide.control("lift", bounds=(0, 1.4))
    away = (x / RADIUS - 2.5) ** 2
    sink = vy - UPDRAFT * (1 - away) * ca.exp(-away)
    speed = ca.sqrt(vx**2 + sink**2)
    # Forces are along the air's and across it: half the density times area and speed, times the components of the speed.
    share = 0.5 * DENSITY * AREA * speed / MASS
    drag = DRAG + INDUCED * lift**2
    glide.dynamics(x=vx, y=vy, vx=-share * (lift * sink + drag * vx), vy=share * (lift * vx - drag * sink) - GRAVITY)
    problem.maximize("range", glide.final(x), unit="m")
    glide.guess(x=(0, 1250), y=(1000, 900), vx=13.23, vy=-1.288, lift=1.0, tf=105.0)
    return problem


@optimum("time", 0.554570878335, 1e-10, "closed form; COPS 3.0, problem 10: 0.554571")
def linear_tangent() -> Problem:
    """The quickest way to a height and a speed.

    A particle that starts at rest. Bryson and Ho, "Applied Optimal Control", 1975, section 2.4; "particle steering" of Dolan, More and
    Munson, "Benchmarking optimization software with COPS 3.0", Argonne ANL/MCS-TM-273, 2004.
    """
    THRUST, HEIGHT, SPEED = 100.0, 5.0, 45.0
    problem = Problem("linear_tangent")
    rise = problem.phase("rise", t0=0.0, tf=(0.05, 2.0))
    rise.state("x", bounds=(-100, 100), initial=0)
    vx = rise.state("vx", bounds=(-100, 100), initial=0, final=SPEED)
    rise.state("y", bounds=(-100, 100), initial=0, final=HEIGHT)
    vy = rise.state("vy", bounds=(-100, 100), initial=0, final=0)
    u = rise.control("u", bounds=(-pi / 2, pi / 2), unit="rad")
    rise.dynamics(x=vx, vx=THRUST * ca.cos(u), y=vy, vy=THRUST * ca.sin(u))
    problem.minimize("time", rise.tf)
    rise.guess(x=(0, 12), vx=(0, SPEED), y=(0, HEIGHT), vy=0, u=0, tf=1.0)
    return problem


@optimum("radius", 1.5252777006, 1e-9, "Bryson and Ho 1975, section 2.5: 1.525; by the maximum principle, see tests")
def orbit_raising() -> Problem:
    """From the earth's orbit to that of Mars by a small thrust.

    The direction of thrust is a vector no longer than 1. Moyer and Pinkham, "Several trajectory optimization techniques", 1964; Bryson and
    Ho, "Applied Optimal Control", 1975, section 2.5. In units of the first orbit; the data are those of YAPSS.
    """
    THRUST, FLOW, DURATION = 0.1405, 0.0749, 3.32
    problem = Problem("orbit_raising")
    rise = problem.phase("rise", t0=0.0, tf=DURATION)
    r = rise.state("r", bounds=(1, 10), initial=1)
    vr = rise.state("vr", bounds=(-10, 10), initial=0, final=0)
    vt = rise.state("vt", bounds=(-10, 10), initial=1)
    ur, ut = (rise.control(name, bounds=(-1.1, 1.1)) for name in ("ur", "ut"))
    force = THRUST / (1 - FLOW * rise.time)
    rise.dynamics(r=vr, vr=vt**2 / r - 1 / r**2 + force * ur, vt=-vr * vt / r + force * ut)
    rise.path("length", ur**2 + ut**2, upper=1.0)
    problem.constraint("circular", rise.final(vt - ca.sqrt(1 / r)), lower=0.0, upper=0.0)
    problem.maximize("radius", rise.final(r))
    rise.guess(r=(1.0, 1.5), vr=0, vt=(1.0, 0.5), ur=(0, 1), ut=(1, 0))
    return problem
