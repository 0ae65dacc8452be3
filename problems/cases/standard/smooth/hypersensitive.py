"""Hypersensitive: a long way through an unstable equilibrium, with a boundary layer at each end.

Rao and Mease, "Eigenvector approximate dichotomic basis method for solving hyper-sensitive optimal control problems", Optimal Control
Applications and Methods 21, 2000. Long before its end the optimum is zero to the last digit, so that it is the sum of two closed forms:
(sqrt(2) + asinh 1)/4 and the like, the areas below the stable and the unstable branch of zero Hamiltonian.
"""

from __future__ import annotations

from ....problem import Problem
from ..published import Published

LAYERS = "closed form, the cost of its two layers: see tests"
PUBLISHED = (
    Published("cost", 1.330806904943, 1e-9, LAYERS),
    Published("cost", 1.330806904943, 1e-9, LAYERS, {"span": 5.0}, remark="narrow bounds"),
    Published("cost", 3.362056904943, 1e-9, LAYERS, {"duration": 1000.0, "start": 1.0, "end": 1.5}),
    Published(
        "cost",
        3.424566790650,
        1e-9,
        LAYERS,
        {"duration": 1000.0, "start": 1.0, "end": 1.5, "span": 5.0},
        remark="the control reaches its bound in the last layer; without it, it would rise to 7.07",
    ),
)


def problem(duration: float = 50.0, start: float = 1.5, end: float = 1.0, span: float = 50.0) -> Problem:
    """Between two states, with bounds of state and control at -`span` and `span`. The guess is a straight line."""
    problem = Problem("hypersensitive")
    run = problem.phase("run", t0=0.0, tf=duration)
    x = run.state("x", bounds=(-span, span), initial=start, final=end)
    u = run.control("u", bounds=(-span, span))
    run.dynamics(x=-(x**3) + u)
    problem.minimize("cost", run.integral(0.5 * (x**2 + u**2)))
    run.guess(x=(start, end), u=0)
    return problem
