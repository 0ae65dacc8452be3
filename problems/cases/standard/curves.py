"""Classical problems of the best curve."""

from __future__ import annotations

from math import pi

import casadi as ca

from ...problem import Problem
from .published import optimum


@optimum("time", 0.824759143157, 1e-10, "closed form, a cycloid; PSOPT: 0.8247591")
def brachistochrone() -> Problem:
    """The quickest way down.

    From rest to a point as far below as it is ahead; the angle is from the vertical. Johann Bernoulli, Acta Eruditorum, 1696; with the
    data of PSOPT's example (Becerra, "PSOPT Optimal Control Solver User Manual").
    """
    GRAVITY = 9.8
    problem = Problem("brachistochrone")
    slide = problem.phase("slide", t0=0.0, tf=(0.1, 10.0))
    slide.state("x", bounds=(0, 20), initial=0, final=2, unit="m")
    slide.state("y", bounds=(0, 20), initial=0, final=2, unit="m")
    v = slide.state("v", bounds=(0, 20), initial=0, unit="m/s")
    angle = slide.control("angle", bounds=(0, pi), unit="rad")
    slide.dynamics(x=v * ca.sin(angle), y=v * ca.cos(angle), v=GRAVITY * ca.cos(angle))
    problem.minimize("time", slide.tf, unit="s")
    slide.guess(x=(0, 2), y=(0, 2), v=(0, 5), angle=1.0, tf=2.0)
    return problem


@optimum("length", 9.445462967348, 1e-9, "closed form, the shortest of six words: see tests", local=(10.7459, 12.5774))
def dubins() -> Problem:
    """The shortest way of a car to a place behind it, with local optima.

    The radius and the speed are one; the car may turn round once on either side. Dubins, "On curves of minimal length with a constraint on
    average curvature", American Journal of Mathematics 79, 1957. The way consists of arcs of the tightest circles and a straight line,
    which is singular; others of this kind are local optima.
    """
    PLACE = (-3.0, 1.0)
    problem = Problem("dubins")
    drive = problem.phase("drive", t0=0.0, tf=(1.0, 30.0))
    drive.state("x", bounds=(-10, 10), initial=0, final=PLACE[0])
    drive.state("y", bounds=(-10, 10), initial=0, final=PLACE[1])
    heading = drive.state("heading", bounds=(-2.5 * pi, 2.5 * pi), initial=0, unit="rad")
    turn = drive.control("turn", bounds=(-1, 1), unit="rad/s")
    drive.dynamics(x=ca.cos(heading), y=ca.sin(heading), heading=turn)
    problem.constraint("same axis", ca.sin(drive.final(heading)), lower=0, upper=0)
    problem.constraint("same direction", ca.cos(drive.final(heading)), lower=0)
    problem.minimize("length", drive.tf)
    return problem


@optimum("energy", 5.0684801110, 1e-9, "closed form, a catenary: see tests; PSOPT: 5.068480")
def hanging_chain() -> Problem:
    """The shape of the least potential energy.

    The height over the place, with its slope as the control. Problem 4 of Dolan, More and Munson, "Benchmarking optimization software with
    COPS 3.0", Argonne ANL/MCS-TM-273, 2004; among PSOPT's examples.
    """
    LENGTH, BEGINNING, END = 4.0, 1.0, 3.0
    problem = Problem("hanging_chain")
    chain = problem.phase("chain", t0=0.0, tf=1.0)
    x = chain.state("height", bounds=(-10, 10), initial=BEGINNING, final=END)
    chain.state("length", bounds=(0, 10), initial=0, final=LENGTH)
    slope = chain.control("slope", bounds=(-20, 20))
    way = ca.sqrt(1 + slope**2)
    chain.dynamics(height=slope, length=way)
    problem.minimize("energy", chain.integral(x * way))
    chain.guess(height=(BEGINNING, END), length=(0, LENGTH), slope=END - BEGINNING)
    return problem


@optimum("area", 1 / (4 * pi), 0.0, "closed form: the circle, 1 / (4 pi)")
def isoperimetric() -> Problem:
    """The largest area within a curve.

    Arc length is the time. The guess is a square. Dido's problem; as in YAPSS, with the centre of the area at the origin. The optimum is a
    circle that may be turned and begun anywhere.
    """
    problem = Problem("isoperimetric")
    curve = problem.phase("curve", t0=0.0, tf=1.0, time_unit="1")
    x, y = (curve.state(name, bounds=(-1, 1)) for name in "xy")
    ux, uy = (curve.control(name, bounds=(-2, 2)) for name in ("ux", "uy"))
    curve.dynamics(x=ux, y=uy)
    curve.path("speed", ux**2 + uy**2, lower=1.0, upper=1.0)
    for name, value in (("x", x), ("y", y)):
        problem.constraint(f"closed {name}", curve.final(value) - curve.initial(value), lower=0.0, upper=0.0)
        problem.constraint(f"mean {name}", curve.integral(value), lower=0.0, upper=0.0)
    problem.maximize("area", curve.integral((y * ux - x * uy) / 2))
    corners, side = [0.0, 0.25, 0.5, 0.75, 1.0], 0.125
    curve.guess(x=(corners, [side, side, -side, -side, side]), y=(corners, [side, -side, -side, side, side]))
    return problem


@optimum("drag", 1.499263950511, 1e-10, "closed form: r = r0 (1 + p^2)^2 / (4 p), with r0 = 0.350943")
def newton_nose() -> Problem:
    """Least drag of a body of revolution.

    The radius is the time, from that of the flat front to 1. Newton, Principia, 1687, book II, proposition 34; as in YAPSS, with a flat
    front whose radius is to be found.
    """
    problem = Problem("newton_nose")
    nose = problem.phase("nose", t0=(0.01, 0.99), tf=1.0, time_unit="1")
    nose.state("y", bounds=(0, 1), initial=1, final=0)
    slope = nose.control("slope", bounds=(0, 20))
    nose.dynamics(y=-slope)
    problem.minimize("drag", nose.integral(8 * nose.time / (1 + slope**2)) + 4 * nose.t0**2)
    nose.guess(y=(1, 0), slope=1.0, t0=0.1)
    return problem
