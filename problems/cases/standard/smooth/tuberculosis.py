"""Tuberculosis: treatment of two strains, one of which resists, at the least cost of the resistant cases and of the treatment.

Jung, Lenhart and Feng, "Optimal control of treatments in a two-strain tuberculosis model", Discrete and Continuous Dynamical Systems B 2,
2002; Betts, "Practical Methods for Optimal Control Using Nonlinear Programming", third edition, 2020, chapter 10; GPOPS-II (Patterson and
Rao 2014).
"""

from __future__ import annotations

from ....problem import Problem
from ..published import Published

PEOPLE = 30000.0
INFECTION, REINFECTION, RESISTANT_INFECTION, DEATH = 13.0, 13.0, 0.029, 0.0143
PROGRESS, RESISTANT_PROGRESS, TREATED, CURED, FAILING, RESISTING = 0.5, 1.0, 2.0, 1.0, 0.4, 0.1
FINDING_COST, HOLDING_COST = 50.0, 500.0
START = {"susceptible": 76, "treated": 1, "latent": 36, "resistant latent": 2, "infectious": 4, "resistant infectious": 1}
"""In parts of 120 of all people."""
PUBLISHED = (Published("cost", 5152.0731, 5e-2, "Betts 2020, chapter 10: 5152.07310"),)


def problem() -> Problem:
    """Finding latent cases, and holding infectious ones to their treatment, are the controls."""
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
