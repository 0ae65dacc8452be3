"""Reference front of `aerocapture` by searches and by gradients: the program that made the table beside the case.

    python tests/truths/aerocapture.py [--evaluations 200000] [--points 400] [--out FILE.csv]

Searches of 100 times the paper's budget find the branches. Then the least heat shield is sought for many values of the inverse packing
efficiency, with its two parts and the lift over drag as smooth limits, from the nearest points that are known.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from macs import MACS, NSGA2
from macs.io.atomic import write_whole
from macs.pareto.dominance import nondominated
from problems import load
from problems.cases.aerocapture import coupled
from problems.cases.aerocapture.capsule import VOLUME
from problems.cases.aerocapture.designs import BOUNDS, LENGTH, LIFT_TO_DRAG, assess

SEEDS = (1, 2, 3)
STARTS = 3
"""For each value of the inverse packing efficiency."""
SPAN = np.ptp(BOUNDS, axis=1)
APART = 1e-3
"""Points of the table differ by this part of the range in one of the objectives."""


def searched(evaluations: int) -> np.ndarray:
    """Variables (k, 5) of the non-dominated points of all searches."""
    found = []
    for seed in SEEDS:
        for solver in (MACS(agents=20, archive=200), NSGA2(population=300)):
            front = solver.solve(load("aerocapture"), evaluations=evaluations, seed=seed)
            print(f"{type(solver).__name__}, seed {seed}: {len(front)} points", flush=True)
            found += [point.decision for point in front]
    return np.array(found)


def objectives(X: np.ndarray) -> np.ndarray:
    """Inverse packing efficiency and heat shield (k, 2) of rows (k, 5); infinite where a limit is exceeded by more than rounding."""
    found = assess(X)
    with np.errstate(invalid="ignore"):
        good = (found.reason == "") & (np.abs(found.lift_to_drag) >= LIFT_TO_DRAG - 1e-9) & (found.length >= LENGTH - 1e-9)
    return np.where(good[:, None], np.stack([found.packing, found.shield], axis=1), np.inf)


def best_shield(packing: float, starts: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Variables of least heat shields at an inverse packing efficiency, by sequential quadratic programming from each start."""
    results = []
    for start in starts:
        side = np.sign(assess(start[None]).lift_to_drag[0])

        def slack(x: np.ndarray, side: float = side) -> np.ndarray:
            one = assess(x * SPAN)
            room = VOLUME * packing
            return np.array(
                [room - 2.0 * one.base[0], room - one.length[0], side * one.lift_to_drag[0] - LIFT_TO_DRAG, one.length[0] - LENGTH]
            )

        found = minimize(
            lambda x: assess(x * SPAN).shield[0],
            start / SPAN,
            method="SLSQP",
            bounds=[(low / span, high / span) for (low, high), span in zip(BOUNDS, SPAN, strict=True)],
            constraints={"type": "ineq", "fun": slack},
            options={"ftol": 1e-12, "maxiter": 200},
        )
        if np.isfinite(found.x).all():
            results.append(np.clip(found.x * SPAN, *np.transpose(BOUNDS)))
    return results


def front(evaluations: int, points: int) -> np.ndarray:
    """The front (k, 7): both objectives and the five variables, by inverse packing efficiency."""
    known = searched(evaluations)
    F = objectives(known)
    known, F = known[np.isfinite(F).all(axis=1)], F[np.isfinite(F).all(axis=1)]
    better = []
    for packing in np.linspace(F[:, 0].min(), F[:, 0].max(), points):
        nearest = known[np.argsort(np.abs(F[:, 0] - packing), kind="stable")[:STARTS]]
        better += best_shield(packing, nearest)
    X = np.vstack([known, *(row[None] for row in better)])
    F = objectives(X)
    rows = np.flatnonzero(np.isfinite(F).all(axis=1))
    rows = rows[nondominated(F[rows])]
    rows = rows[np.argsort(F[rows, 0], kind="stable")]
    span, kept = np.ptp(F[rows], axis=0), list(rows[:1])
    for row in rows[1:]:
        if (np.abs(F[row] - F[kept[-1]]) >= APART * span).any() or row == rows[-1]:
            kept.append(row)
    print(f"{len(kept)} points, {np.count_nonzero(np.array(kept) >= len(known))} of them by gradients")
    return np.hstack([F[kept], X[kept]])


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description="Make the reference front of aerocapture again.")
    parser.add_argument("--evaluations", type=int, default=200_000)
    parser.add_argument("--points", type=int, default=400)
    parser.add_argument("--out")
    given = parser.parse_args()
    rows = front(given.evaluations, given.points)
    lines = [",".join(f"{value:.9g}" for value in row) for row in rows]
    head = [
        "# aerocapture: front by searches and gradients; made by: python tests/truths/aerocapture.py",
        "# inverse packing efficiency 1/m2, TPS mass fraction %, " + ", ".join(f"{name} {unit}" for name, unit in coupled.VARIABLES),
    ]
    beside = Path(coupled.__file__).with_name("front.csv")
    write_whole(given.out or beside, ("\n".join([*head, *lines]) + "\n").encode())


if __name__ == "__main__":
    main()
