"""Problems with smooth controls, without active constraints along the way."""

from __future__ import annotations

from math import pi

import casadi as ca

from ...problem import Problem
from .published import optimum

LAYERS = "closed form, the cost of its two layers: see tests"
"""Source of the optima of `hypersensitive`."""


@optimum(
    "yield",
    0.610802921,
    1e-8,
    "the maximum principle, by shooting: see tests",
    remark="Dadebo and McAuley 1995: 0.610775, by steps of constant temperature, which cannot follow its fall at the beginning",
)
def batch_reactor() -> Problem:
    """The temperatures that make the most of a product.

    A decays into B, and B into C, over an hour. Ray, "Advanced Process Control", 1981; Renfro, Morshedi and Asbjornsen, "Simultaneous
    optimization and solution of systems described by differential/algebraic equations", Computers and Chemical Engineering 11, 1987;
    Dadebo and McAuley, "Dynamic optimization of constrained chemical engineering problems using dynamic programming", Computers and
    Chemical Engineering 19, 1995.
    """
    problem = Problem("batch_reactor")
    batch = problem.phase("batch", t0=0.0, tf=1.0, time_unit="h")
    a = batch.state("A", bounds=(0, 1), initial=1)
    b = batch.state("B", bounds=(0, 1), initial=0)
    temperature = batch.control("temperature", bounds=(298, 398), unit="K")
    forward, loss = 4000 * ca.exp(-2500 / temperature) * a**2, 620000 * ca.exp(-5000 / temperature) * b
    batch.dynamics(A=-forward, B=forward - loss)
    problem.maximize("yield", batch.final(b))
    batch.guess(A=(1, 0.2), B=(0, 0.6), temperature=330)
    return problem


@optimum("range", 1.7123149, 5e-8, "the maximum principle, by shooting: see tests; PSOPT: 1.712313")
def bryson_max_range() -> Problem:
    """As far as possible in a given time.

    The guess is no stationary point of the constraint, and gives the direction no sense of its own. Bryson, "Dynamic Optimization", 1999,
    with the data of PSOPT's example: the control is a vector whose length is an equality constraint.
    """
    GRAVITY = 1.0
    THRUST = 0.5 * GRAVITY
    problem = Problem("bryson_max_range")
    move = problem.phase("move", t0=0.0, tf=2.0)
    x = move.state("x", bounds=(-10, 10), initial=0)
    move.state("y", bounds=(-10, 10), initial=0, final=0.1)
    v = move.state("v", bounds=(-10, 10), initial=0)
    ux, uy = (move.control(name, bounds=(-10, 10)) for name in ("ux", "uy"))
    move.dynamics(x=v * ux, y=v * uy, v=THRUST - GRAVITY * uy)
    move.path("length", ux**2 + uy**2, lower=1.0, upper=1.0)
    problem.maximize("range", move.final(x))
    move.guess(x=0, y=0, v=0, ux=1, uy=0)
    return problem


@optimum("cost", 1.330806904943, 1e-9, LAYERS)
@optimum("cost", 1.330806904943, 1e-9, LAYERS, {"span": 5.0}, remark="narrow bounds")
@optimum("cost", 3.362056904943, 1e-9, LAYERS, {"duration": 1000.0, "start": 1.0, "end": 1.5})
@optimum(
    "cost",
    3.424566790650,
    1e-9,
    LAYERS,
    {"duration": 1000.0, "start": 1.0, "end": 1.5, "span": 5.0},
    remark="the control reaches its bound in the last layer; without it, it would rise to 7.07",
)
def hypersensitive(duration: float = 50.0, start: float = 1.5, end: float = 1.0, span: float = 50.0) -> Problem:
    """A boundary layer at each end of a long rest.

    Between two states, with bounds of state and control at -`span` and `span`. The guess is a straight line. Rao and Mease, "Eigenvector
    approximate dichotomic basis method for solving hyper-sensitive optimal control problems", Optimal Control Applications and Methods 21,
    2000. Long before its end the optimum is zero to the last digit, so that it is the sum of two closed forms: (sqrt(2) + asinh 1)/4 and
    the like, the areas below the stable and the unstable branch of zero Hamiltonian.
    """
    problem = Problem("hypersensitive")
    run = problem.phase("run", t0=0.0, tf=duration)
    x = run.state("x", bounds=(-span, span), initial=start, final=end)
    u = run.control("u", bounds=(-span, span))
    run.dynamics(x=-(x**3) + u)
    problem.minimize("cost", run.integral(0.5 * (x**2 + u**2)))
    run.guess(x=(start, end), u=0)
    return problem


@optimum("cost", 0.1330957305, 1e-9, "the maximum principle, by collocation: see tests; Luus 2000: 0.133094", local=(0.244425,))
def stirred_tank() -> Problem:
    """A hot reaction that is cooled to rest, with a local optimum.

    Temperature and concentration, as deviations from rest. Lapidus and Luus, "Optimal Control of Engineering Processes", 1967; Luus and
    Cormack, "Multiplicity of solutions resulting from the use of variational methods in optimal control problems", Canadian Journal of
    Chemical Engineering 50, 1972.
    """
    problem = Problem("stirred_tank")
    tank = problem.phase("tank", t0=0.0, tf=0.78)
    x = tank.state("temperature", bounds=(-1, 5), initial=0.09)
    y = tank.state("concentration", bounds=(-1, 5), initial=0.09)
    u = tank.control("cooling", bounds=(-1, 20))
    reaction = (y + 0.5) * ca.exp(25 * x / (x + 2))
    tank.dynamics(temperature=-(2 + u) * (x + 0.25) + reaction, concentration=0.5 - y - reaction)
    problem.minimize("cost", tank.integral(x**2 + y**2 + 0.1 * u**2))
    return problem


@optimum("cost", 5152.0731, 5e-2, "Betts 2020, chapter 10: 5152.07310")
def tuberculosis() -> Problem:
    """Treatment of two strains at the least cost.

    Finding latent cases, and holding infectious ones to their treatment, are the controls. Jung, Lenhart and Feng, "Optimal control of
    treatments in a two-strain tuberculosis model", Discrete and Continuous Dynamical Systems B 2, 2002; Betts, "Practical Methods for
    Optimal Control Using Nonlinear Programming", third edition, 2020, chapter 10; GPOPS-II (Patterson and Rao 2014).
    """
    PEOPLE = 30000.0
    INFECTION, REINFECTION, RESISTANT_INFECTION, DEATH = 13.0, 13.0, 0.029, 0.0143
    PROGRESS, RESISTANT_PROGRESS, TREATED, CURED, FAILING, RESISTING = 0.5, 1.0, 2.0, 1.0, 0.4, 0.1
    FINDING_COST, HOLDING_COST = 50.0, 500.0
    # In parts of 120 of all people.
    START = {"susceptible": 76, "treated": 1, "latent": 36, "resistant latent": 2, "infectious": 4, "resistant infectious": 1}
    problem = Problem("tuberculosis")
    course = problem.phase("course", t0=0.0, tf=5.0, time_unit="yr")
    people = {name: course.state(name, bounds=(0, PEOPLE), initial=part * PEOPLE / 120) for name, part in START.items()}
    s, t, l1, l2, i1, i2 = people.values()
    find, hold = (course.control(name, bounds=(0.05, 0.95)) for name in ("find", "hold"))
    failing = (1 - hold) * CURED
    caught, resistant = INFECTION * s * i1 / PEOPLE, RESISTANT_INFECTION * i2 / PEOPLE
    again = REINFECTION * t * i1 / PEOPLE
    rates = (
        DEATH * PEOPLE - caught - resistant * s - DEATH * s,
        find * TREATED * l1 - DEATH * t + (CURED - failing * (FAILING + RESISTING)) * i1 - again - resistant * t,
        caught - (DEATH + PROGRESS) * l1 - find * TREATED * l1 + failing * FAILING * i1 + again - resistant * l1,
        failing * RESISTING * i1 - (DEATH + RESISTANT_PROGRESS) * l2 + resistant * (s + l1 + t),
        PROGRESS * l1 - (DEATH + CURED) * i1,
        RESISTANT_PROGRESS * l2 - DEATH * i2,
    )
    course.dynamics(**dict(zip(START, rates, strict=True)))
    problem.minimize("cost", course.integral(l2 + i2 + 0.5 * FINDING_COST * find**2 + 0.5 * HOLDING_COST * hold**2))
    return problem


@optimum("cost", 2.8672610452, 1e-9, "the maximum principle, by shooting: see tests; PROPT manual, section 124: 2.867259")
def van_der_pol() -> Problem:
    """An oscillator that is brought to rest.

    The lower limit of the control is active at the beginning. Vassiliadis, "Computational solution of dynamic optimization problems with
    general differential-algebraic constraints", 1993; case study 6.1 of Balsa-Canto, Banga, Alonso and Vassiliadis, "Restricted second
    order information for the solution of optimal control problems using control vector parameterization", Journal of Process Control 12,
    2002.
    """
    problem = Problem("van_der_pol")
    swing = problem.phase("swing", t0=0.0, tf=5.0)
    x = swing.state("x", bounds=(-10, 10), initial=0)
    y = swing.state("y", bounds=(-10, 10), initial=1)
    u = swing.control("u", bounds=(-0.3, 1.0))
    swing.dynamics(x=(1 - y**2) * x - y + u, y=x)
    problem.minimize("cost", swing.integral(x**2 + y**2 + u**2))
    swing.guess(x=0, y=1, u=0)
    return problem


@optimum("time", 5.457865263560, 1e-10, "Bryson and Ho 1975, section 2.7: 5.46; by shooting, see tests")
def zermelo() -> Problem:
    """The quickest way of a ship in a current.

    The ship has speed 1; the current is -y. Zermelo, "Über das Navigationsproblem bei ruhender oder veränderlicher Windverteilung", ZAMM
    11, 1931; with the data of Bryson and Ho, "Applied Optimal Control", 1975, section 2.7.
    """
    problem = Problem("zermelo")
    trip = problem.phase("trip", t0=0.0, tf=(1.0, 20.0))
    trip.state("x", bounds=(-10, 20), initial=3.66, final=0)
    y = trip.state("y", bounds=(-10, 10), initial=-1.86, final=0)
    heading = trip.control("heading", bounds=(0, 2 * pi), unit="rad")
    trip.dynamics(x=ca.cos(heading) - y, y=ca.sin(heading))
    problem.minimize("time", trip.tf)
    trip.guess(x=(3.66, 0), y=(-1.86, 0), heading=pi, tf=5.0)
    return problem
