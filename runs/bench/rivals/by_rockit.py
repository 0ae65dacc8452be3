"""Four of the examples of YAPSS as a user of rockit states them: direct collocation of degree 4, IPOPT as it comes."""

from __future__ import annotations

from importlib import import_module
from math import pi
from typing import Any

import casadi as ca


def _solved(ocp: Any, objective: Any, elements: int) -> float:
    """The optimum of what is to be minimised."""
    rockit = import_module("rockit")
    ocp.add_objective(objective)
    ocp.solver("ipopt", {"ipopt.print_level": 0, "print_time": False})
    ocp.method(rockit.DirectCollocation(N=elements))
    return float(ocp.solve().value(objective))


def goddard() -> float:
    """Height of Goddard's rocket, in one phase; mass and height in units near one."""
    rockit = import_module("rockit")
    ocp = rockit.Ocp(t0=0, T=rockit.FreeTime(40))
    h, v, m, thrust = ocp.state(scale=18000), ocp.state(scale=800), ocp.state(scale=3), ocp.control(scale=193.044)
    drag = 5.49153484923381010e-05 * v**2 * ca.exp(-h / 23800.0)
    for state, rate in ((h, v), (v, (thrust - drag) / m - 32.174), (m, -thrust / 1580.9425279876559)):
        ocp.set_der(state, rate)
    for state, value in ((h, 0), (v, 0), (m, 3)):
        ocp.subject_to(ocp.at_t0(state) == value)
    ocp.subject_to(ocp.at_tf(m) == 1)
    for value, low, high in ((h, 0, 30000), (v, 0, 15000), (m, 1, 3), (thrust, 0, 193.044)):
        ocp.subject_to(low <= (value <= high))
    ocp.subject_to((ocp.T <= 100) >= 20)
    for value, guess in ((h, 400 * ocp.t), (v, 400), (m, 2), (thrust, 90)):
        ocp.set_initial(value, guess)
    return -_solved(ocp, -ocp.at_tf(h), 40)


def orbit_raising() -> float:
    """Radius of the final orbit."""
    rockit = import_module("rockit")
    ocp = rockit.Ocp(t0=0, T=3.32)
    r, vr, vt = (ocp.state() for _ in range(3))
    ur, ut = ocp.control(order=1), ocp.control(order=1)
    force = 0.1405 / (1 - 0.0749 * ocp.t)
    for state, rate in ((r, vr), (vr, vt**2 / r - 1 / r**2 + force * ur), (vt, -vr * vt / r + force * ut)):
        ocp.set_der(state, rate)
    for state, value in ((r, 1), (vr, 0), (vt, 1)):
        ocp.subject_to(ocp.at_t0(state) == value)
    ocp.subject_to(ocp.at_tf(vr) == 0)
    ocp.subject_to(ocp.at_tf(vt - ca.sqrt(1 / r)) == 0)
    ocp.subject_to(ur**2 + ut**2 <= 1)
    for value, guess in ((r, 1 + 0.15 * ocp.t), (vt, 1 - 0.15 * ocp.t), (ur, 0.3 * ocp.t), (ut, 1 - 0.3 * ocp.t)):
        ocp.set_initial(value, guess)
    return -_solved(ocp, -ocp.at_tf(r), 40)


def isoperimetric() -> float:
    """The largest area within a closed curve of length 1."""
    rockit = import_module("rockit")
    ocp = rockit.Ocp(t0=0, T=1)
    x, y = ocp.state(), ocp.state()
    angle = ocp.control(order=1)
    ux, uy = ca.cos(angle), ca.sin(angle)
    ocp.set_der(x, ux)
    ocp.set_der(y, uy)
    for state in (x, y):
        ocp.subject_to(ocp.at_t0(state) == ocp.at_tf(state))
        ocp.subject_to(ocp.integral(state) == 0)
    # The circle may be begun anywhere.
    ocp.subject_to(ocp.at_t0(angle) == 0)
    ocp.set_initial(angle, -2 * pi * ocp.t)
    return -_solved(ocp, -ocp.integral((y * ux - x * uy) / 2), 40)


def newton() -> float:
    """Least drag of Newton's nose, with a flat front."""
    rockit = import_module("rockit")
    ocp = rockit.Ocp(t0=rockit.FreeTime(0.3), T=rockit.FreeTime(0.7))
    y, slope = ocp.state(), ocp.control(order=1)
    ocp.set_der(y, -slope)
    ocp.subject_to(ocp.at_t0(y) == 1)
    ocp.subject_to(ocp.at_tf(y) == 0)
    ocp.subject_to(ocp.t0 + ocp.T == 1)
    ocp.subject_to((ocp.t0 <= 0.99) >= 0.01)
    ocp.subject_to((slope <= 20) >= 0)
    ocp.set_initial(slope, 1)
    return _solved(ocp, ocp.integral(8 * ocp.t / (1 + slope**2)) + 4 * ocp.t0**2, 40)
