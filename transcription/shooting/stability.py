"""Refuses step sizes for which an explicit Runge-Kutta method is certainly unstable.

An explicit method multiplies a decaying mode of rate lambda by R(h lambda) with each step (Hairer and Wanner, "Solving Ordinary
Differential Equations II", IV.2). Where that is more than 1, what should vanish grows.

Before any work only the dynamics within the bounds are known. So only what is certain is refused: a step that is too long although the
phase is as short as it may be; a mode that decays during so short a phase, and grows by a lot if it is computed with these steps; and that
at each of several points, from the initial to the final or guessed states, under low, middle and high controls.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
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


def check_steps(
    problem: CompiledProblem,
    scheme: Tableau,
    places: Mapping[str, np.ndarray],
    prefix: str,
    settings: Mapping[str, int],
    own: Collection[str] = (),
) -> None:
    """Raise a ValueError that names the phase, the step, the scheme and what to change, where steps cannot be stable. places (N + 1,)."""
    p = np.array([problem.guesses.get(v.name, 0.5 * (v.lower + v.upper)) for v in problem.parameters])
    for phase in problem.phases:
        shares = np.diff(places[phase.name])
        n, widest = len(shares), float(shares.max())
        length = max(phase.duration[0], phase.tf.lower - phase.t0.upper)
        modes = _modes(phase, length, p, middle=phase.name in own) if length > 0 else []
        growing = [_growing(scheme, rates * length, shares) for rates, _ in modes]
        if not modes or not all(found.any() for found in growing):
            continue
        (rates, names), found = modes[0], np.flatnonzero(growing[0])
        factors = np.abs(scheme.stability(rates[found] * length * widest))
        worst, h = found[np.argmax(factors)], length * widest
        finer = np.geomspace(1.0, FINEST, 5000)
        enough = finer[np.abs(scheme.stability(rates[worst] * h / finer)) <= 1.0]
        (count, value), (_, steps) = settings.items()
        cure = "far shorter ones"
        if len(enough):
            more = "" if phase.name in own else f"{count}={ceil(value * enough[0]) + 1} or more, or "
            cure = f"{more}steps={ceil(steps * enough[0])}"
        such = ("the longest step", f"there are {n} in all") if phase.name in own else ("each step", f"there are {n}")
        raise ValueError(
            f"{prefix}phase '{phase.name}': steps of {h:.4g} {phase.time_unit} are too long for '{names[worst]}', which decays at a rate "
            f"of {-rates[worst].real:.3g} per {phase.time_unit}: {such[0]} of {scheme.name} multiplies it by {factors.max():.3g}, and "
            f"{such[1]}; take {cure}"
        )


def _growing(scheme: Tableau, decay: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Which modes, of rates `decay` per phase, should vanish and grow instead over some of the steps that follow each other, which take
    `shares` (N,) of the phase."""
    lengths, place = np.unique(shares, return_inverse=True)
    growth = np.log(np.maximum(np.abs(scheme.stability(np.multiply.outer(lengths, decay))), 1e-300))[place]
    sums = np.cumsum(np.vstack([np.zeros(len(decay)), growth]), axis=0)
    return (decay.real < -FACTOR) & ((sums - np.minimum.accumulate(sums, axis=0)).max(axis=0) > FACTOR)


def _modes(phase: CompiledPhase, length: float, p: np.ndarray, *, middle: bool) -> list[tuple[np.ndarray, list[str]]]:
    """Eigenvalues (nx,) of the linearised dynamics at each of the points, and in the middle of the bounds of the states if it is wanted;
    and the state that each of them is most about.

    None where there are no derivatives to know them by, or no numbers, or where at one of the points nothing decays fast enough to be
    refused: eigenvalues of many states take long.
    """
    inputs = [ca.MX.sym(name, phase.dynamics.size1_in(i)) for i, name in enumerate("xuts")]
    try:
        jacobian = ca.Function("jacobian", inputs, [ca.densify(ca.jacobian(phase.dynamics(*inputs), inputs[0]))])
    except RuntimeError:
        return []
    t0 = float(np.clip(phase.guesses.get("t0", phase.t0.upper), phase.t0.lower, phase.t0.upper))
    start, s = np.array([t0]), np.array([t0, t0 + length, *p])
    span, found = np.array([v.span for v in phase.states]), []
    first = [np.array([0.5 * sum(limits)]) for limits in phase.initial]
    states = np.array([state_along(phase, i, value, start, start + length, POINTS)[0] for i, value in enumerate(first)]).T
    bounds = [[0.5 * (v.lower + v.upper) for v in phase.states]]
    for x in np.vstack([states, bounds]) if middle else states:
        for level in (0.0, 0.5, 1.0):
            u = [v.lower + level * v.span for v in phase.controls]
            matrix = np.array(jacobian(x, u, t0 + 0.5 * length, s))
            if not np.isfinite(matrix).all() or _fastest(matrix) * length < FACTOR:
                return []
            rates, vectors = np.linalg.eig(matrix)
            found.append((rates, [phase.states[i].name for i in np.argmax(np.abs(vectors) / span[:, None], axis=0)]))
    return found


def _fastest(matrix: np.ndarray) -> float:
    """A rate at least as large as that of the fastest decay, from the circles of Gershgorin about the diagonal, by rows and by columns."""
    rates, sizes = np.diag(matrix), np.abs(matrix)
    return float(min((sizes.sum(axis=axis) - np.abs(rates) - rates).max() for axis in (0, 1)))
