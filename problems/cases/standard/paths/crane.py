"""Container crane: the least swing of a container that is moved from a ship to a truck.

Sakawa and Shindo, "Optimal control of container cranes", Automatica 18, 1982; Augustin and Maurer, "Sensitivity analysis and real-time
control of a container crane under state constraints", in "Online Optimization of Large Scale Systems", 2001, who add the effort of the
controls with a small weight.
"""

from __future__ import annotations

from ....problem import Problem
from ..published import Published

PUBLISHED = (Published("swing", 0.0375194596, 5e-8, "Betts, A Collection of Optimal Control Test Problems, 2015: 3.75194596e-2"),)


def problem(weight: float = 0.01) -> Problem:
    """Position of the trolley, length of the rope, angle of swing, and their rates."""
    problem = Problem("crane")
    move = problem.phase("move", t0=0.0, tf=9.0)
    ends = {"x": (0.0, 10.0), "rope": (22.0, 14.0), "angle": (0.0, 0.0), "vx": (0.0, 2.5), "vrope": (-1.0, 0.0), "rate": (0.0, 0.0)}
    bounds = {"x": (-5, 15), "rope": (5, 25), "angle": (-1, 1), "vx": (-2.5, 2.5), "vrope": (-1, 1), "rate": (-1, 1)}
    s = {name: move.state(name, bounds=bounds[name], initial=first, final=last) for name, (first, last) in ends.items()}
    trolley = move.control("trolley", bounds=(-2.83374, 2.83374))
    hoist = move.control("hoist", bounds=(-0.80865, 0.71265))
    move.dynamics(
        x=s["vx"],
        rope=s["vrope"],
        angle=s["rate"],
        vx=trolley + 17.2656 * s["angle"],
        vrope=hoist,
        rate=-(trolley + 27.0756 * s["angle"] + 2 * s["vrope"] * s["rate"]) / s["rope"],
    )
    problem.minimize("swing", move.integral(0.5 * (s["angle"] ** 2 + s["rate"] ** 2 + weight * (trolley**2 + hoist**2))))
    move.guess(**ends, trolley=0, hoist=0)
    return problem
