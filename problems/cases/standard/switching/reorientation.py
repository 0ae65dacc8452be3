"""Reorientation: the quickest turn of an asymmetric spacecraft about an axis, by 150 degrees, bang-bang in all three torques.

Fleming, Sekhavat and Ross, "Minimum-time reorientation of an asymmetric rigid body", AIAA GNC 2008, with the inertia of the X-ray Timing
Explorer; Betts 2010, section 6.8. The four quaternions are states; Betts has the fourth as an algebraic variable.
"""

from __future__ import annotations

from math import cos, radians, sin

from ....problem import Problem
from ..published import Published

INERTIA, TORQUE, TURN = (5621.0, 4547.0, 2364.0), 50.0, radians(150.0)
PUBLISHED = (Published("time", 28.630408, 5e-6, "Betts 2010, section 6.8: 28.630408"),)


def problem() -> Problem:
    """From rest to rest. A turn about the axis itself is not the quickest."""
    problem = Problem("reorientation")
    turn = problem.phase("turn", t0=0.0, tf=(20.0, 60.0))
    ends = {"q1": (0.0, sin(TURN / 2)), "q2": (0.0, 0.0), "q3": (0.0, 0.0), "q4": (1.0, cos(TURN / 2))}
    a, b, c, d = (turn.state(name, bounds=(-1.1, 1.1), initial=first, final=last) for name, (first, last) in ends.items())
    p, q, r = (turn.state(name, bounds=(-0.5, 0.5), initial=0, final=0, unit="rad/s") for name in ("w1", "w2", "w3"))
    torques = [turn.control(name, bounds=(-TORQUE, TORQUE), unit="N m") for name in ("t1", "t2", "t3")]
    x, y, z = INERTIA
    turn.dynamics(
        q1=(p * d - q * c + r * b) / 2,
        q2=(p * c + q * d - r * a) / 2,
        q3=(-p * b + q * a + r * d) / 2,
        q4=(-p * a - q * b - r * c) / 2,
        w1=(torques[0] - (z - y) * q * r) / x,
        w2=(torques[1] - (x - z) * p * r) / y,
        w3=(torques[2] - (y - x) * p * q) / z,
    )
    problem.minimize("time", turn.tf, unit="s")
    turn.guess(**ends, w1=0, w2=0, w3=0, t1=TORQUE, t2=TORQUE, t3=TORQUE, tf=30.0)
    return problem
