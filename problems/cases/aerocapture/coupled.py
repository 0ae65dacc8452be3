"""Shape and passage together: how compact a capsule is against its heat shield, each shape with the bank angle that captures it.

Armellin and Lavagna (see `mars`), section 4: five variables, two objectives, and limits of lift over drag and of the length. The passage at
constant bank is solved inside of the evaluation, so that no equality is left. Shapes of which nothing can be said, such as a rear cone in
the flow, are failed evaluations.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...vector import VectorProblem
from .designs import BOUNDS, LENGTH, LIFT_TO_DRAG, assess, shapes_of
from .dispersions import Capsule, DispersedOutcome, Dispersions, outcomes
from .mars import ARRIVAL_SPEED, EXIT_SPEED, exit_speeds
from .passage import PASSAGE, Passage

__all__ = ["Dispersions", "dispersed", "problem", "reference", "reference_designs"]

VARIABLES = (
    ("nose radius", "base radii"),
    ("rear radius", "base radii"),
    ("front angle", "deg"),
    ("rear angle", "deg"),
    ("angle of attack", "deg"),
)
PACKING, SHIELD = "inverse packing efficiency", "TPS mass fraction"


def problem(*, arrival_speed: float = ARRIVAL_SPEED, exit_speed: float = EXIT_SPEED) -> VectorProblem:
    """The case.

    Parameters
    ----------
    arrival_speed : float
        Excess speed of the hyperbola, m/s.
    exit_speed : float
        Speed at which the air is left, m/s. It decides the path angle there and the delta v of the circular orbit.
    """
    passage = _passage(arrival_speed, exit_speed)
    problem = VectorProblem("aerocapture")
    for (name, unit), bounds in zip(VARIABLES, BOUNDS, strict=True):
        problem.variable(name, bounds=bounds, unit=unit)
    problem.minimize(PACKING, unit="1/m2")
    problem.minimize(SHIELD, unit="%")
    problem.constraint("lift over drag", lower=LIFT_TO_DRAG)
    problem.constraint("length", lower=LENGTH, unit="m")
    # Active only where lift over drag is far below its limit.
    problem.constraint("part of the lift that captures", upper=1.0)

    @problem.function
    def evaluate(X: np.ndarray) -> dict[str, np.ndarray]:
        found = assess(X, passage)
        ratio = np.abs(found.lift_to_drag)
        return {
            PACKING: found.packing,
            SHIELD: found.shield,
            "lift over drag": ratio,
            "length": found.length,
            "part of the lift that captures": np.abs(found.lift) / np.maximum(ratio, 1e-12),
        }

    problem.default_evaluations = 2000
    return problem


def reference() -> np.ndarray:
    """The front (k, 2): inverse packing efficiency, 1/m2, and TPS mass fraction, %; by `python tests/truths/aerocapture.py`.

    Slender capsules, a jump, and blunt ones.
    """
    return reference_designs()[:, :2]


def reference_designs() -> np.ndarray:
    """The rows of `reference` with the five variables (k, 7)."""
    return np.loadtxt(Path(__file__).with_name("front.csv"), delimiter=",")


def _passage(arrival_speed: float = ARRIVAL_SPEED, exit_speed: float = EXIT_SPEED) -> Passage:
    """The passage between two speeds, see `problem`. Raises ValueError if there is none."""
    if not 0.0 <= arrival_speed <= 20e3:
        raise ValueError(f"arrival_speed: must be from 0 to 20000 m/s, not {arrival_speed!r}")
    least, greatest = exit_speeds()
    if not least < exit_speed < greatest:
        raise ValueError(f"exit_speed: must be between {least:.1f} and {greatest:.1f} m/s, not {exit_speed!r}")
    return replace(PASSAGE, arrival_speed=arrival_speed, exit_speed=exit_speed)


def dispersed(front: Any, dispersions: Dispersions) -> list[dict[str, DispersedOutcome]]:
    """What becomes of each point of a front under dispersions, with its constant bank and with one solved anew for each case."""
    X, passage = np.array([np.asarray(row) for row in front.decision]), _passage(**front.source.data)
    found, (shapes, _) = assess(X, passage), shapes_of(X)
    columns = found.ballistic, found.lift_to_drag, shapes.nose, found.entry_angle, found.bank
    capsules = [
        Capsule(ballistic, ratio, nose, angle, bank, entry_speed=passage.entry_speed)
        for ballistic, ratio, nose, angle, bank in zip(*(column.tolist() for column in columns), strict=True)
    ]
    return outcomes(capsules, dispersions)
