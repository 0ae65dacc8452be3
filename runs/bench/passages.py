"""Benchmark of the passages of aerocapture: Newton's method on collocation and the table, against `solve_bvp`, at known accuracy."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from time import process_time
from typing import Any

import numpy as np
from scipy.integrate import solve_bvp

from macs.io.console import Steps
from problems.cases.aerocapture.passage import PASSAGE, Passage, Passages, passages, tabulated

from .contract import Bench, Effort, Row, Target, column, rounds_of, side_by_side

SINGLY, TOGETHER, TABLE = "ours, one by one", "ours, in one call", "table, in one call"
AGAINST = "solve_bvp, 1e-8"
"""The paper's accuracy."""
ASKED_OF_PASSAGES = {SINGLY: 5.0, TABLE: 200.0}
"""Times as fast as `solve_bvp`."""


@dataclass(frozen=True)
class Coefficients:
    """Numbers of ballistic coefficients, 40 to 1000 kg/m2: of the solvers, and of a call of the table."""

    few: int = 20
    many: int = 1000

    @property
    def name(self) -> str:
        """Of its rows."""
        return f"passages, 40 to 1000 kg/m2, {self.few} coefficients"


def passage_rounds(case: Coefficients, effort: Effort, steps: Steps) -> Callable[[int], Iterable[Row]]:
    """Each round solves all coefficients in each way; errors are those against a fine mesh."""
    few, many = (np.geomspace(40.0, 1000.0, count) for count in (case.few, case.many))
    ways: dict[str, tuple[np.ndarray, Callable[[], np.ndarray]]] = {
        f"solve_bvp, {tolerance:.0e}".replace("e-0", "e-"): (few, partial(by_solve_bvp, few, PASSAGE, tolerance))
        for tolerance in (1e-6, 1e-8)
    }
    ways[SINGLY] = few, lambda: np.vstack([columns(passages(bc)) for bc in few])
    ways[TOGETHER] = few, lambda: columns(passages(few))
    ways[TABLE] = many, lambda: columns(tabulated(many))
    exact = {len(bc): columns(passages(bc, Passage(intervals=24))) for bc in (few, many)}
    errors = {who: float(np.abs(work() / exact[len(bc)] - 1.0).max()) for who, (bc, work) in ways.items()}

    def measured(number: int) -> Iterable[Row]:
        timed = side_by_side({who: work for who, (_, work) in ways.items()}, number, process_time)
        seconds = {who: timed[who][0] / len(bc) for who, (bc, _) in ways.items()}
        return [
            Row.once(case.name, who, speed=seconds[AGAINST] / taken, microseconds=1e6 * taken, error=errors[who])
            for who, taken in seconds.items()
        ]

    return measured


def columns(solutions: Passages) -> np.ndarray:
    """Lift, entry angle and arc, which `solve_bvp` gives, too: (n, 3)."""
    return np.column_stack([solutions.lift, solutions.entry_angle, solutions.arc])


def by_solve_bvp(coefficients: np.ndarray, passage: Passage, tolerance: float) -> np.ndarray:
    """Lift, entry angle, rad, and arc (n, 3) of ballistic coefficients, kg/m2, by `solve_bvp`, one after the other."""
    return np.array([one_by_solve_bvp(bc, passage, tolerance) for bc in coefficients])


def one_by_solve_bvp(ballistic: float, passage: Passage, tolerance: float) -> tuple[float, float, float]:
    """One passage as a user of `solve_bvp` states it at its best: vectorised, with all derivatives, and the guess of our own solver on 80
    nodes, the number of 10 to 160 that takes least."""
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

    def boundary(a: np.ndarray, b: np.ndarray, _: Any) -> np.ndarray:
        return np.array([a[0], a[1], b[0], b[1] - passage.slowing, b[2] - passage.exit_angle])

    # The guess: a parabola in depth on each side of the lowest point, at 0.28 of the arc with a drag of 0.25, and the angle that follows.
    share, lowest = np.linspace(0.0, 1.0, 80), 0.28
    side = np.where(share < lowest, lowest, 1.0 - lowest)
    deepest, arc = np.log(0.25 / drag), 18.4 + 2.75 * np.log(ballistic / 120.0)
    guess = np.array(
        [
            deepest * (1.0 - ((share - lowest) / side) ** 2),
            passage.slowing * np.clip((share - 0.1) / 0.4, 0.0, 1.0),
            np.clip(2.0 * deepest / (arc * k) * (share - lowest) / side**2, -0.2, 0.2),
        ]
    )
    lift = -0.146 - 0.02 * np.log(ballistic / 120.0)
    solution = solve_bvp(
        rates, boundary, share, guess, [arc, lift], fun_jac=derivatives, bc_jac=lambda *_: ends, tol=tolerance, max_nodes=20_000
    )
    if not solution.success:
        raise RuntimeError(f"solve_bvp, ballistic coefficient {ballistic:g} kg/m2: {solution.message}")
    return float(solution.p[1]), float(solution.y[2, 0]), float(solution.p[0])


def targets(rows: Sequence[Row]) -> list[Target]:
    """Ours are so many times as fast."""
    return [
        Target(row.who, f"at least {least:.0f} times as fast", row.short("speed"), row.of("speed") >= least)
        for row in rows
        if (least := ASKED_OF_PASSAGES.get(row.who))
    ]


PASSAGES = Bench(
    title="passages",
    about=f"PASSAGES: the boundary value problem of aerocapture, against {AGAINST}, in turn; median, and quartiles or least and greatest. "
    "solve_bvp has vectorised rates, all derivatives and the same guess, and no heat load, which ours have. Error: greatest of "
    "lift, entry angle and arc, relative to a fine mesh. Microseconds of this process for a coefficient depend on the machine and "
    "its load.",
    full=Effort((Coefficients(),), rounds=7),
    quick=Effort((Coefficients(few=5),), rounds=2),
    prepare=passage_rounds,
    columns=(
        ("times as", "fast", lambda row: "1" if row.who == AGAINST else row.spread("speed")),
        column("", "microseconds", "microseconds"),
        column("greatest", "error", "error", form=".0e"),
        rounds_of("speed"),
    ),
    targets=targets,
)
