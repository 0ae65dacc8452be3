"""Problems of any size: a ride in many phases, and a row of masses on springs."""

from __future__ import annotations

from problems import Problem
from problems.phase import Phase


def ride(phases: int) -> Problem:
    """A ride from rest to rest in so many linked phases, each with a path constraint: its time against its effort."""
    problem, longest = Problem(f"ride of {phases} phases"), 3.0 * phases
    legs: list[Phase] = []
    efforts = []
    for i in range(phases):
        first, last = i == 0, i == phases - 1
        leg = problem.phase(f"leg {i}", t0=0.0 if first else (0.0, longest), tf=(0.5, longest), duration=(0.5, 3.0))
        x = leg.state("x", bounds=(-1.0, phases + 1.0), initial=0.0 if first else None, final=float(phases) if last else None)
        v = leg.state("v", bounds=(-3.0, 3.0), initial=0.0 if first else None, final=0.0 if last else None)
        u = leg.control("u", bounds=(-1.0, 1.0))
        leg.dynamics(x=v, v=u - 0.1 * v * v)
        leg.path("energy", v * v, upper=9.0)
        if legs:
            problem.link(legs[-1], leg)
        legs.append(leg)
        problem.constraint(f"way of leg {i}", leg.final(x) - leg.initial(x), lower=0.1)
        efforts.append(leg.integral(u * u))
    problem.minimize("time", legs[-1].tf)
    problem.minimize("effort", sum(efforts))
    return problem


def masses(count: int) -> Problem:
    """So many masses in a row, each on springs to its neighbours, and a force on each: effort against the way of the last."""
    problem = Problem(f"{count} masses")
    phase = problem.phase("swing", t0=0.0, tf=1.0)
    x = [phase.state(f"x{i}", bounds=(-2.0, 2.0), initial=0.0) for i in range(count)]
    v = [phase.state(f"v{i}", bounds=(-4.0, 4.0), initial=0.0) for i in range(count)]
    u = [phase.control(f"u{i}", bounds=(-1.0, 1.0)) for i in range(count)]
    pulls = [(x[i + 1] if i + 1 < count else 0.0) - 2.0 * x[i] + (x[i - 1] if i else 0.0) for i in range(count)]
    rates = {f"x{i}": v[i] for i in range(count)} | {f"v{i}": pulls[i] + u[i] for i in range(count)}
    phase.dynamics(**rates)
    problem.minimize("effort", phase.integral(sum(one * one for one in u)))
    problem.maximize("way", phase.final(x[-1]))
    return problem
