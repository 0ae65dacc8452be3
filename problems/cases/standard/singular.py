"""Problems with controls that are singular on an arc: neither on a bound nor given by the first derivatives."""

from __future__ import annotations

from math import pi

import casadi as ca

from ...problem import Problem
from .published import optimum


@optimum("cost", 0.0, 1e-8, "Aly and Chan 1973: 0")
def aly_chan() -> Problem:
    """A control that is singular all along.

    A swing between speed and place. Aly and Chan, "Application of a modified quasilinearization technique to totally singular optimal
    control problems", International Journal of Control 17, 1973. The optimum is u = -sin t, x = sin t, and its cost is nothing.
    """
    problem = Problem("aly_chan")
    move = problem.phase("move", t0=0.0, tf=pi / 2)
    x = move.state("x", bounds=(-5, 5), initial=0)
    v = move.state("v", bounds=(-5, 5), initial=1)
    u = move.control("u", bounds=(-1, 1))
    move.dynamics(x=v, v=u)
    problem.minimize("cost", move.integral(0.5 * (v**2 - x**2)))
    move.guess(x=0, v=1, u=0)
    return problem


@optimum("yield", 0.0480557, 1e-7, "COPS 3.0, problem 14: -4.80556e-2; with three arcs of their own: 0.04805569")
def catalyst_mixing() -> Problem:
    """The best blend along a reactor, singular.

    Length is the time. Jackson, "Optimization of chemical reactors with respect to flow configuration", JOTA 2, 1968; problem 14 of Dolan,
    More and Munson, "Benchmarking optimization software with COPS 3.0", Argonne ANL/MCS-TM-273, 2004.
    """
    problem = Problem("catalyst_mixing")
    reactor = problem.phase("reactor", t0=0.0, tf=1.0, time_unit="1")
    x = reactor.state("x", bounds=(0, 1), initial=1)
    y = reactor.state("y", bounds=(0, 1), initial=0)
    u = reactor.control("u", bounds=(0, 1))
    reactor.dynamics(x=u * (10 * y - x), y=u * (x - 10 * y) - (1 - u) * y)
    problem.maximize("yield", 1 - reactor.final(x) - reactor.final(y))
    reactor.guess(x=1, y=0, u=0)
    return problem


@optimum("cost", 0.7539838606, 1e-9, "closed form, with the switch at 1.413764: see tests; literature: 0.75398")
def jacobson() -> Problem:
    """A control that is on its bound and then singular.

    The control enters linearly, and not at all in the cost. Jacobson, Gershwin and Lele, "Computation of optimal singular controls", IEEE
    Transactions on Automatic Control 15(1), 1970. From the switch on, x = A cosh(5 - t), and the control is x.
    """
    problem = Problem("jacobson")
    move = problem.phase("move", t0=0.0, tf=5.0)
    x = move.state("x", bounds=(-10, 10), initial=0)
    v = move.state("v", bounds=(-10, 10), initial=1)
    u = move.control("u", bounds=(-1, 1))
    move.dynamics(x=v, v=u)
    problem.minimize("cost", move.integral(x**2 + v**2))
    return problem


@optimum("deviation", 1.34408, 5e-6, "Sager, mintoc.de: 1.34408, relaxed; with three arcs of their own: 1.344082")
def lotka_fishing() -> Problem:
    """Fishing prey and predators to rest, singular.

    Over twelve units of time. Sager, "Numerical methods for mixed-integer optimal control problems", 2005; "Lotka Volterra fishing
    problem" of mintoc.de. The control may be anything from 0 to 1: the relaxed problem, whose optimum is the infimum of that with 0 and 1
    alone.
    """
    problem = Problem("lotka_fishing")
    sea = problem.phase("sea", t0=0.0, tf=12.0)
    prey = sea.state("prey", bounds=(0, 20), initial=0.5)
    predators = sea.state("predators", bounds=(0, 20), initial=0.7)
    u = sea.control("fishing", bounds=(0, 1))
    sea.dynamics(prey=prey - prey * predators - 0.4 * prey * u, predators=-predators + prey * predators - 0.2 * predators * u)
    problem.minimize("deviation", sea.integral((prey - 1) ** 2 + (predators - 1) ** 2))
    return problem


@optimum(
    "height",
    1.0128369,
    5e-8,
    "COPS 3.0, problem 10: 1.01283; with three arcs of their own, each smooth: 1.0128369",
    scale=0.0128369,
    remark="differences are measured by the height that is gained",
)
def rocket() -> Problem:
    """The greatest height of a rocket with drag, singular.

    The guess is that of COPS. Goddard, "A method of reaching extreme altitudes", 1919; problem 10 of Dolan, More and Munson, "Benchmarking
    optimization software with COPS 3.0", Argonne ANL/MCS-TM-273, 2004, in units of the earth's radius, the initial mass and the weight
    there.
    """
    # Largest thrust, exhaust speed, drag at the ground at unit speed, decay of density with height, and mass without propellant.
    THRUST, EXHAUST, DRAG, DECAY, EMPTY = 3.5, 0.5, 310.0, 500.0, 0.6
    problem = Problem("rocket")
    flight = problem.phase("flight", t0=0.0, tf=(0.05, 1.0))
    h = flight.state("h", bounds=(1.0, 2.0), initial=1.0)
    v = flight.state("v", bounds=(0.0, 2.0), initial=0.0)
    m = flight.state("m", bounds=(EMPTY, 1.0), initial=1.0, final=EMPTY)
    thrust = flight.control("thrust", bounds=(0.0, THRUST))
    drag = DRAG * v**2 * ca.exp(-DECAY * (h - 1.0))
    flight.dynamics(h=v, v=(thrust - drag) / m - 1.0 / h**2, m=-thrust / EXHAUST)
    problem.maximize("height", flight.final(h))
    flight.guess(h=1.0, v=([0.0, 0.5, 1.0], [0.0, 0.25, 0.0]), m=(1.0, EMPTY), thrust=0.5 * THRUST, tf=1.0)
    return problem


@optimum("tumour", 7571.67, 2e-2, "Betts 2010, section 6.17: 7571.67; with three arcs of their own: 7571.68")
def tumour() -> Problem:
    """The smallest tumour that a drug leaves, singular.

    Volumes of the tumour and of the vessels that feed it, and the drug used so far. Ledzewicz and Schättler, "Analysis of optimal controls
    for a mathematical model of tumour anti-angiogenesis", Optimal Control Applications and Methods 29, 2008; Betts 2010, section 6.17;
    GPOPS-II (Patterson and Rao 2014).
    """
    GROWTH, BIRTH, DEATH, DRUG, LOSS = 0.084, 5.85, 0.00873, 0.15, 0.02
    DOSE, SUPPLY = 75.0, 15.0
    # Volume at which an untreated tumour would rest, mm3.
    LIMIT = ((BIRTH - LOSS) / DEATH) ** 1.5
    problem = Problem("tumour")
    care = problem.phase("care", t0=0.0, tf=(0.1, 5.0), time_unit="d")
    p = care.state("tumour", bounds=(100.0, LIMIT), initial=LIMIT / 2, unit="mm3")
    q = care.state("vessels", bounds=(100.0, LIMIT), initial=LIMIT / 4, unit="mm3")
    care.state("used", bounds=(0.0, SUPPLY), initial=0)
    u = care.control("dose", bounds=(0, DOSE))
    care.dynamics(tumour=-GROWTH * p * ca.log(p / q), vessels=q * (BIRTH - LOSS - DEATH * ca.exp(2 / 3 * ca.log(p)) - DRUG * u), used=u)
    problem.minimize("tumour", care.final(p), unit="mm3")
    care.guess(tumour=(LIMIT / 2, LIMIT / 4), vessels=(LIMIT / 4, LIMIT / 4), used=(0, SUPPLY), dose=DOSE, tf=1.0)
    return problem
