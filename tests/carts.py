"""A cart whose speed is its control: x' = u is integrated exactly by every method, so that what is off was put there by the test."""

from dataclasses import replace

import numpy as np

from macs import Front
from macs.fronts.builders import from_vectors
from problems import Problem
from transcription import DFET

MESH = DFET(2, 1)


def cart(of_objective: float | None = None, **limits: float) -> Problem:
    """x' = u with u in [0, 2] for two seconds; `limits` are those of a hundred times the final x."""
    problem = Problem("cart")
    phase = problem.phase("run", t0=0.0, tf=2.0)
    x = phase.state("x", bounds=(-5, 5), initial=0)
    u = phase.control("u", bounds=(0, 2))
    phase.dynamics(x=u)
    if limits:
        problem.constraint("enough", 100.0 * phase.final(x), **limits)
    problem.maximize("distance", phase.final(x), unit="m", scale=of_objective)
    problem.minimize("effort", phase.integral(u**2), scale=of_objective)
    return problem


def points(problem: Problem, *controls: list[float], method: DFET = MESH) -> Front:
    """A front of these controls at the nodes, one row a point."""
    nlp = method.transcribe(problem)
    Z = nlp.propagate(nlp.first_guess(np.array(controls, dtype=float)))
    some = {"status": ["converged"] * len(Z), "optimality": [None] * len(Z)}
    return Front.of(from_vectors(nlp, Z, {"name": "by hand"}, {"tolerance": 1e-6}, **some))


def constant(*values: float) -> list[list[float]]:
    """Controls that are constant on `MESH`."""
    return [[value] * 4 for value in values]


def slowed(front: Front, share: float) -> Front:
    """The same points, but with controls that are less by a share."""
    changed = []
    for trajectory in front.trajectories:
        (phase,) = trajectory.phases
        control = replace(phase.control, coefficients=(1.0 - share) * phase.control.coefficients)
        changed.append(replace(trajectory, phases=(replace(phase, control=control),)))
    return front.replace(trajectories=changed)
