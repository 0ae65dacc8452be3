"""What runs are charged, divided by what they take of a processor, five times in turn, on all transcriptions: `python tests/charges.py`."""

import sys
import time

import numpy as np

from macs import MACS
from macs.gradient_solvers import Sweep
from problems import load
from transcription import parse

FITTED = (
    "goddard dfet:4x6",
    "goddard shooting:20",
    "orbit_rise dfet:30x1",
    "reentry_case1 dfet:24x3:bernstein:1",
    "reentry_case1 shooting:200",
)
JUDGED = (
    *("goddard multiple-shooting:20", "goddard radau:10x4", "orbit_rise shooting:30", "orbit_rise multiple-shooting:30"),
    *("orbit_rise radau:15x3", "reentry_case1 multiple-shooting:60x3", "reentry_case1 radau:24x3", "skip dfet:12x4"),
    *("skip shooting:40", "skip multiple-shooting:40", "skip radau:12x4"),
)
SEARCH, SWEEP, DENSE = MACS(refine=False), Sweep(points=5, starts=1), ("reentry_case1 shooting:200", "skip shooting:40")


def ratio(case: str, solver: MACS | Sweep, seed: int) -> float:
    """Nominal seconds that a run is charged for each of the processor. A few evaluations before it pay for what is done once."""
    name, word = case.split()
    problem, took = load(name).compile(), []
    for evaluations in (1500, 4000) if solver is SEARCH else (1,):
        began = time.process_time()
        front = solver.solve(problem, parse(word), evaluations=evaluations, seed=seed, inner="propagate", verify=None, progress=False)
        took.append(time.process_time() - began)
    return 1e-9 * front.stats["charge"] / took[-1]


if __name__ == "__main__":
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    for case in (*FITTED, *JUDGED):
        for solver in (SEARCH, SWEEP)[: 1 if case in DENSE else 2]:
            found = [ratio(case, solver, seed) for seed in range(1, rounds + 1)]
            role, who = "fitted" if case in FITTED else "judged", type(solver).__name__
            print(f"{case:40s} {who:6s} {role}  {np.median(found):.2f} [{min(found):.2f}, {max(found):.2f}]", flush=True)
