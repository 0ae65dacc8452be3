"""The passage through the air as a user of `scipy.integrate.solve_bvp` states it at its best: vectorised, with all derivatives."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import solve_bvp

from problems.cases.aerocapture.passage import Passage

DEEPEST, WHERE = 0.25, 0.28
"""Drag of the guess at the lowest point, and the share of the arc at which that is."""


def solved(ballistic: float, passage: Passage, nodes: int, tolerance: float) -> tuple[float, float, float]:
    """Lift, entry angle, rad, and arc of a ballistic coefficient, kg/m2, from the guess of our own solver on so many nodes."""
    k, pull, drag = passage.stretch, passage.pull, float(passage.drag(np.array(ballistic)))
    # Without copies: arrays are filled in place.
    ends = np.zeros((5, 3)), np.zeros((5, 3)), np.zeros((5, 2))
    ends[0][0, 0] = ends[0][1, 1] = ends[1][2, 0] = ends[1][3, 1] = ends[1][4, 2] = 1.0

    def rates(_: Any, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        air, weight, sine = drag * np.exp(y[0]), pull * np.exp(y[1]), np.sin(y[2])
        turn = 0.5 * p[1] * air + (1.0 - weight) / k * np.cos(y[2])
        return p[0] * np.array([-k * sine, air + 2.0 / k * weight * sine, turn])

    def derivatives(_: Any, y: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        air, weight, sine, cosine = drag * np.exp(y[0]), pull * np.exp(y[1]), np.sin(y[2]), np.cos(y[2])
        J, by_parameters = np.zeros((3, 3, y.shape[1])), np.zeros((3, 2, y.shape[1]))
        J[0, 2] = -k * cosine
        J[1] = air, 2.0 / k * weight * sine, 2.0 / k * weight * cosine
        J[2] = 0.5 * p[1] * air, -weight / k * cosine, -(1.0 - weight) / k * sine
        turn = J[2, 0] + (1.0 - weight) / k * cosine
        by_parameters[:, 0] = -k * sine, air + J[1, 1], turn
        by_parameters[2, 1] = 0.5 * p[0] * air
        return p[0] * J, by_parameters

    def missed(a: np.ndarray, b: np.ndarray, _: Any) -> np.ndarray:
        return np.array([a[0], a[1], b[0], b[1] - passage.slowing, b[2] - passage.exit_angle])

    share = np.linspace(0.0, 1.0, nodes)
    side = np.where(share < WHERE, WHERE, 1.0 - WHERE)
    deepest, arc = np.log(DEEPEST / drag), 18.4 + 2.75 * np.log(ballistic / 120.0)
    guess = np.array(
        [
            deepest * (1.0 - ((share - WHERE) / side) ** 2),
            passage.slowing * np.clip((share - 0.1) / 0.4, 0.0, 1.0),
            np.clip(2.0 * deepest / (arc * k) * (share - WHERE) / side**2, -0.2, 0.2),
        ]
    )
    lift = -0.146 - 0.02 * np.log(ballistic / 120.0)
    found = solve_bvp(
        rates, missed, share, guess, [arc, lift], fun_jac=derivatives, bc_jac=lambda *_: ends, tol=tolerance, max_nodes=20_000
    )
    if not found.success:
        raise RuntimeError(f"solve_bvp, ballistic coefficient {ballistic:g} kg/m2: {found.message}")
    return float(found.p[1]), float(found.y[2, 0]), float(found.p[0])
