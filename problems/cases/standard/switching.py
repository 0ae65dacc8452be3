"""Problems with bang-bang controls."""

from __future__ import annotations

from math import cos, pi, radians, sin

import casadi as ca

from ...problem import Problem
from .published import optimum


@optimum("time", 30.0, 0.0, "Logsdon and Biegler 1989: 30, with the switch at 20")
def car() -> Problem:
    """The quickest way from rest to rest, bang-bang.

    Over 300 m, braking twice as hard as the car accelerates. Logsdon and Biegler, "Accurate solution of differential-algebraic
    optimization problems", Industrial and Engineering Chemistry Research 28, 1989.
    """
    problem = Problem("car")
    drive = problem.phase("drive", t0=0.0, tf=(1.0, 100.0))
    drive.state("x", bounds=(-10, 400), initial=0, final=300, unit="m")
    v = drive.state("v", bounds=(-10, 100), initial=0, final=0, unit="m/s")
    u = drive.control("u", bounds=(-2, 1), unit="m/s2")
    drive.dynamics(x=v, v=u)
    problem.minimize("time", drive.tf, unit="s")
    return problem


@optimum(
    "time",
    3.780855775,
    1e-8,
    "Sager, mintoc.de: 3.78086; its four arcs, integrated: see tests",
    local=(6.035, 5.742, 5.729, 4.400),
    remark="local optima as published by Kaya and Noakes 2003 and others; a single start often ends in one of them",
)
def f8() -> Problem:
    """The quickest return of an aircraft to trim, bang-bang, with local optima.

    Angle of attack, pitch angle and pitch rate; the elevator is a control within its limits, at which it stays by itself. Kaya and Noakes,
    "Computational method for time-optimal switching control", JOTA 117(1), 2003; dynamics of Garrard and Jordan, "Design of nonlinear
    automatic flight control systems", Automatica 13, 1977; "F-8 aircraft" of mintoc.de (Sager 2012).
    """
    ELEVATOR = 0.05236
    problem = Problem("f8")
    turn = problem.phase("return", t0=0.0, tf=(0.1, 20.0))
    attack = turn.state("attack", bounds=(-2, 2), initial=0.4655, final=0, unit="rad")
    pitch = turn.state("pitch", bounds=(-2, 2), initial=0, final=0, unit="rad")
    rate = turn.state("rate", bounds=(-2, 2), initial=0, final=0, unit="rad/s")
    u = turn.control("elevator", bounds=(-ELEVATOR, ELEVATOR), unit="rad")
    turn.dynamics(
        attack=-0.877 * attack
        + rate
        - 0.088 * attack * rate
        + 0.47 * attack**2
        - 0.019 * pitch**2
        - attack**2 * rate
        + 3.846 * attack**3
        - 0.215 * u
        + 0.28 * attack**2 * u
        + 0.47 * attack * u**2
        + 0.63 * u**3,
        pitch=rate,
        rate=-4.208 * attack
        - 0.396 * rate
        - 0.47 * attack**2
        - 3.564 * attack**3
        - 20.967 * u
        + 6.265 * attack**2 * u
        + 46.0 * attack * u**2
        + 61.4 * u**3,
    )
    problem.minimize("time", turn.tf, unit="s")
    return problem


@optimum("time", 1.2540747293, 1e-9, "its switch by shooting: see tests; Maurer and Osmolovskii 2004: 1.2540747")
def fast_oscillator() -> Problem:
    """The quickest way of an oscillator, bang-bang.

    One switch, from the upper bound to the lower one. Maurer and Osmolovskii, "Second order sufficient conditions for time-optimal bang-
    bang control", SIAM Journal on Control and Optimization 42(6), 2004.
    """
    BEGINNING, END = (-0.4, 0.6), (0.6, 0.4)
    problem = Problem("fast_oscillator")
    swing = problem.phase("swing", t0=0.0, tf=(0.1, 20.0))
    x = swing.state("x", bounds=(-5, 5), initial=BEGINNING[0], final=END[0])
    y = swing.state("y", bounds=(-5, 5), initial=BEGINNING[1], final=END[1])
    u = swing.control("u", bounds=(-1, 1))
    swing.dynamics(x=y, y=-x + y * (1 - x**2) + u)
    problem.minimize("time", swing.tf)
    return problem


@optimum(
    "fuel",
    7.68862,
    1e-5,
    "found with this program, nine arcs of constant thrust have 7.688928, integrated: see tests; Betts 2010: 7.91015",
    local=(7.910147051,),
    remark="the optimum of the literature is symmetric in time, and a local one",
)
def free_flying_robot() -> Problem:
    """Least fuel of jets, to a place and an attitude.

    Each pair pushes forwards or backwards; fuel is the sum of what all four jets do. Sakawa, "Trajectory planning of a free-flying robot
    by using the optimal control", Optimal Control Applications and Methods 20, 1999; Betts 2010, section 6.13.
    """
    ARM = 0.2
    problem = Problem("free_flying_robot")
    flight = problem.phase("flight", t0=0.0, tf=12.0)
    ends = {"x": (-10.0, 0.0), "y": (-10.0, 0.0), "heading": (pi / 2, 0.0), "vx": (0.0, 0.0), "vy": (0.0, 0.0), "rate": (0.0, 0.0)}
    bounds = {"x": (-20, 20), "y": (-20, 20), "heading": (-2 * pi, 2 * pi), "vx": (-10, 10), "vy": (-10, 10), "rate": (-3, 3)}
    s = {name: flight.state(name, bounds=bounds[name], initial=first, final=last) for name, (first, last) in ends.items()}
    jets = [flight.control(f"jet {i}", bounds=(0, 1)) for i in (1, 2, 3, 4)]
    left, right = jets[0] - jets[1], jets[2] - jets[3]
    flight.dynamics(
        x=s["vx"],
        y=s["vy"],
        heading=s["rate"],
        vx=(left + right) * ca.cos(s["heading"]),
        vy=(left + right) * ca.sin(s["heading"]),
        rate=ARM * (left - right),
    )
    flight.path("left", jets[0] + jets[1], upper=1.0)
    flight.path("right", jets[2] + jets[3], upper=1.0)
    problem.minimize("fuel", flight.integral(sum(jets)))
    flight.guess(**ends)
    return problem


@optimum("impulse", 1.420312599049, 1e-10, "closed form: no thrust for 0.239259, full thrust for 1.157549")
def moon_landing() -> Problem:
    """Least propellant to a soft landing, bang-bang.

    The objective is the impulse, the propellant times the exhaust speed. Meditch, "On the problem of optimal thrust programming for a
    lunar soft landing", IEEE Transactions on Automatic Control 9(4), 1964; with the data of PSOPT's example.
    """
    EXHAUST, GRAVITY, THRUST = 2.349, 1.0, 1.227
    problem = Problem("moon_landing")
    fall = problem.phase("landing", t0=0.0, tf=(0.1, 10.0))
    fall.state("altitude", bounds=(-20, 20), initial=1.0, final=0.0)
    speed = fall.state("speed", bounds=(-20, 20), initial=-0.783, final=0.0)
    mass = fall.state("mass", bounds=(0.01, 1.0), initial=1.0)
    thrust = fall.control("thrust", bounds=(0, THRUST))
    fall.dynamics(altitude=speed, speed=thrust / mass - GRAVITY, mass=-thrust / EXHAUST)
    problem.minimize("impulse", fall.integral(thrust))
    fall.guess(altitude=(1, 0), speed=(-0.783, 0), mass=(1, 0.5), thrust=0.5 * THRUST, tf=1.5)
    return problem


@optimum("time", 28.630408, 5e-6, "Betts 2010, section 6.8: 28.630408")
def reorientation() -> Problem:
    """The quickest turn of a spacecraft, bang-bang.

    From rest to rest. A turn about the axis itself is not the quickest. Fleming, Sekhavat and Ross, "Minimum-time reorientation of an
    asymmetric rigid body", AIAA GNC 2008, with the inertia of the X-ray Timing Explorer; Betts 2010, section 6.8. The four quaternions are
    states; Betts has the fourth as an algebraic variable.
    """
    INERTIA, TORQUE, TURN = (5621.0, 4547.0, 2364.0), 50.0, radians(150.0)
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


@optimum("time", 9.140911746, 1e-9, "the six arcs of its bang-bang controls: see tests; COPS 3.0, problem 8: 9.14093")
def robot_arm() -> Problem:
    """The quickest turn of an arm, bang-bang.

    The ends differ in the turn alone; a shorter arm turns faster. Weinreb and Bryson, "Optimal control of systems with hard control
    bounds", IEEE Transactions on Automatic Control 30, 1985; problem 8 of Dolan, More and Munson, "Benchmarking optimization software with
    COPS 3.0", Argonne ANL/MCS-TM-273, 2004.
    """
    LENGTH = 5.0
    problem = Problem("robot_arm")
    turn = problem.phase("turn", t0=0.0, tf=(1.0, 30.0))
    reach = turn.state("reach", bounds=(0, LENGTH), initial=4.5, final=4.5)
    angle_ends = {"heading": (0.0, 2 * pi / 3), "elevation": (pi / 4, pi / 4)}
    turn.state("heading", bounds=(-pi, pi), initial=0, final=2 * pi / 3, unit="rad")
    elevation = turn.state("elevation", bounds=(0, pi), initial=pi / 4, final=pi / 4, unit="rad")
    rates = {name: turn.state(f"{name} rate", bounds=(-10, 10), initial=0, final=0) for name in ("reach", *angle_ends)}
    forces = {name: turn.control(f"{name} force", bounds=(-1, 1)) for name in rates}
    inertia = ((LENGTH - reach) ** 3 + reach**3) / 3
    turn.dynamics(
        **rates,
        **{
            "reach rate": forces["reach"] / LENGTH,
            "heading rate": forces["heading"] / (inertia * ca.sin(elevation) ** 2),
            "elevation rate": forces["elevation"] / inertia,
        },
    )
    problem.minimize("time", turn.tf)
    turn.guess(reach=4.5, **angle_ends, tf=10.0)
    return problem


@optimum("time", 2.982279943, 1e-9, "the four arcs of its bang-bang controls: see tests")
def two_link_arm() -> Problem:
    """The quickest way of an arm with two links, bang-bang.

    Rates of both joints, the angle between the links and that of the first. Weinreb 1985; Luus, "Iterative Dynamic Programming", 2000,
    section 12.4.2; Moon, "Two-link robotic arm" in the test problems of the Handbook of Test Problems in Local and Global Optimization;
    PSOPT, example twolinkarm.
    """
    problem = Problem("two_link_arm")
    move = problem.phase("move", t0=0.0, tf=(1.0, 10.0))
    ends = {"a": (0.0, 0.0), "b": (0.0, 0.0), "elbow": (0.5, 0.5), "shoulder": (0.0, 0.522)}
    a, b, elbow, _ = (move.state(name, bounds=(-2, 2), initial=first, final=last) for name, (first, last) in ends.items())
    u, v = (move.control(name, bounds=(-1, 1)) for name in "uv")
    sin, cos = ca.sin(elbow), ca.cos(elbow)
    inertia = 31 / 36 + 9 / 4 * sin**2
    move.dynamics(
        a=(sin * (9 / 4 * cos * a**2 + 2 * b**2) + 4 / 3 * (u - v) - 3 / 2 * cos * v) / inertia,
        b=-(sin * (7 / 2 * a**2 + 9 / 4 * cos * b**2) - 7 / 3 * v + 3 / 2 * cos * (u - v)) / inertia,
        elbow=b - a,
        shoulder=a,
    )
    problem.minimize("time", move.tf)
    move.guess(**ends, u=0, v=0, tf=3.0)
    return problem
