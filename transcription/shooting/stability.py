"""Refuses step sizes for which an explicit Runge-Kutta method is certainly unstable.

An explicit method multiplies a decaying mode of rate lambda by R(h lambda) with each step (Hairer and Wanner, "Solving Ordinary
Differential Equations II", IV.2). Where that is more than 1, what should vanish grows.

Before any work only the dynamics within the bounds are known. So only what is certain is refused: a step that is too long although the
phase is as short as it may be; a mode that decays during so short a phase, and grows by a lot if it is computed with these steps; and that
at each of several points, from the initial to the final or guessed states, under low, middle and high controls.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil, log

import casadi as ca
import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem

from ..phases.guess import state_along
from .runge_kutta import Tableau

FACTOR = log(1e3)
"""A mode that decays by this much really, and grows by this much in computation, is unstable."""
POINTS = np.linspace(0.0, 1.0, 5)
FINEST = 1e4
"""Most times that a message proposes to shorten a step."""


def check_steps(problem: CompiledProblem, scheme: Tableau, places: np.ndarray, prefix: str, settings: Mapping[str, int]) -> None:
    """Raise a ValueError that names the phase, the step, the scheme and what to change, where steps cannot be stable.

    Parameters
    ----------
    problem : CompiledProblem
    scheme : Tableau
    places : array (N + 1,)
        Ends of the steps, relative to a phase.
    prefix : str
        What the message begins with.
    settings : mapping
        The settings that make steps shorter: the first is the number of nodes or intervals, "steps" those between them.
    """
    p = np.array([problem.guesses.get(v.name, 0.5 * (v.lower + v.upper)) for v in problem.parameters])
    n, widest = len(places) - 1, float(np.diff(places).max())
    for phase in problem.phases:
        length = max(phase.duration[0], phase.tf.lower - phase.t0.upper)
        modes = _modes(phase, length, p) if length > 0 else []
        growing = [_growing(scheme, rates * length, n, widest) for rates, _ in modes]
        if not modes or not all(found.any() for found in growing):
            continue
        (rates, names), found = modes[0], np.flatnonzero(growing[0])
        factors = np.abs(scheme.stability(rates[found] * length * widest))
        worst, h = found[np.argmax(factors)], length * widest
        finer = np.geomspace(1.0, FINEST, 5000)
        enough = finer[np.abs(scheme.stability(rates[worst] * h / finer)) <= 1.0]
        (count, value), (_, steps) = settings.items()
        cure = f"{count}={ceil(value * enough[0]) + 1} or more, or steps={ceil(steps * enough[0])}" if len(enough) else "far shorter ones"
        raise ValueError(
            f"{prefix}phase '{phase.name}': steps of {h:.4g} {phase.time_unit} are too long for '{names[worst]}', which decays at a rate "
            f"of {-rates[worst].real:.3g} per {phase.time_unit}: each step of {scheme.name} multiplies it by {factors.max():.3g}, and "
            f"there are {n}; take {cure}"
        )


def _growing(scheme: Tableau, decay: np.ndarray, n: int, widest: float) -> np.ndarray:
    """Which modes, of rates `decay` per phase, should vanish and grow instead."""
    growth = np.log(np.maximum(np.abs(scheme.stability(decay * widest)), 1e-300))
    return (decay.real < -FACTOR) & (n * growth > FACTOR)


def _modes(phase: CompiledPhase, length: float, p: np.ndarray) -> list[tuple[np.ndarray, list[str]]]:
    """Eigenvalues (nx,) of the linearised dynamics at each of the points, and the state that each of them is most about.

    None where there are no derivatives to know them by, or no numbers.
    """
    inputs = [ca.MX.sym(name, phase.dynamics.size1_in(i)) for i, name in enumerate("xuts")]
    try:
        jacobian = ca.Function("jacobian", inputs, [ca.densify(ca.jacobian(phase.dynamics(*inputs), inputs[0]))])
    except RuntimeError:
        return []
    t0 = float(np.clip(phase.guesses.get("t0", phase.t0.upper), phase.t0.lower, phase.t0.upper))
    start, s = np.array([t0]), np.array([t0, t0 + length, *p])
    span, found = np.array([v.span for v in phase.states]), []
    middles = [np.array([0.5 * sum(first)]) for first in phase.initial]
    states = np.array([state_along(phase, i, middle, start, start + length, POINTS)[0] for i, middle in enumerate(middles)])
    for x in states.T:
        for level in (0.0, 0.5, 1.0):
            u = [v.lower + level * v.span for v in phase.controls]
            matrix = np.array(jacobian(x, u, t0 + 0.5 * length, s))
            if not np.isfinite(matrix).all():
                return []
            rates, vectors = np.linalg.eig(matrix)
            found.append((rates, [phase.states[i].name for i in np.argmax(np.abs(vectors) / span[:, None], axis=0)]))
    return found
