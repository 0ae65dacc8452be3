"""A cart from rest to rest: least effort against least time, of which the front is 12 / T^3."""

from functools import cache

from scipy.optimize import brentq

from macs import Front, payoff
from macs.decisions import Ranges
from problems import Problem
from problems.compiled import CompiledProblem
from transcription import DFET

MESH = DFET(4, 3)
RANGES = Ranges({"effort": 12 / 64, "time": 0.5}, {"effort": 96.0, "time": 4.0})
WIDE_E, WIDE_T = 96 - 12 / 64, 3.5


@cache
def cart() -> CompiledProblem:
    """From rest to rest over a distance of 1. Of least effort in a time T is the force 6/T^2 - 12 t/T^3, and the effort 12/T^3 (Bryson and
    Ho, "Applied Optimal Control", 1975): cubic, so that a mesh of any cubic elements is exact."""
    problem = Problem("cart")
    trip = problem.phase("trip", t0=0, tf=(0.5, 4.0))
    x = trip.state("x", bounds=(-1, 2), initial=0, final=1)
    v = trip.state("v", bounds=(-5, 5), initial=0, final=0)
    u = trip.control("u", bounds=(-60, 60))
    trip.dynamics(x=v, v=u + 0 * x)
    problem.minimize("effort", trip.integral(u**2))
    problem.minimize("time", trip.tf)
    # Compiled once: its NLPs are kept with it.
    return problem.compile()


@cache
def ends() -> Front:
    return payoff(cart(), MESH, starts=1)


def effort(T: float) -> float:
    return 12 / T**3


def both(T: float) -> tuple[float, float]:
    """Normalised objectives."""
    return (effort(T) - 12 / 64) / WIDE_E, (T - 0.5) / WIDE_T


def balanced(e: float, t: float) -> float:
    """The time at which the sum of e * effort and t * time is least."""
    return (36 * e / t) ** 0.25


def crossing(first: tuple[float, float], second: tuple[float, float]) -> float:
    """The time at which (effort - target) / width and (time - target) / width are equal."""
    return brentq(lambda T: (effort(T) - first[0]) / first[1] - (T - second[0]) / second[1], 0.5, 4.0, xtol=1e-14)


def in_time(value: float) -> float:
    """The time of an effort."""
    return (12 / value) ** (1 / 3)


DIAGONAL = crossing((12 / 64, WIDE_E), (0.5, WIDE_T))
"""Where both memberships are equal."""
