"""Golden fronts: what a change that should change no number is held against, by hand.

    python -P tests/golden.py freeze FILE     writes objectives and counts of twenty problems, three seeds each
    python -P tests/golden.py check FILE      computes them again, prints what differs; exit code 1 if anything does

The file belongs to one machine: last bits depend on the processor. About five minutes with `--jobs 2`; names after the file choose some.
"""

import argparse
import json
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

import macs
from macs import MACS, NSGA3, Front
from problems import load
from transcription import parse

SEEDS = (1, 2, 3)
REL = 1e-9
"""Relative difference of objectives from which they differ."""

FRONTS: dict[str, Callable[[int], Front]] = {
    "goddard": lambda s: MACS().solve(load("goddard"), evaluations=200, seed=s),
    "goddard, rounds": lambda s: MACS().solve(load("goddard"), seed=s),
    "goddard, paper": lambda s: MACS.paper().solve(load("goddard"), parse("dfet:4x6"), evaluations=120, seed=s),
    "goddard, NSGA3": lambda s: NSGA3(population=20).solve(load("goddard"), parse("dfet:4x6"), evaluations=120, seed=s),
    "goddard, sweep": lambda s: macs.sweep(load("goddard"), points=8, seed=s),
    "orbit_rise": lambda s: MACS(refine=False).solve(load("orbit_rise"), evaluations=200, seed=s),
    "orbit_rise, payoff": lambda s: macs.payoff(load("orbit_rise"), seed=s),
    "landing_site": lambda s: MACS().solve(load("landing_site"), evaluations=300, seed=s),
    "reentry_case1": lambda s: MACS(refine=False, agents=5).solve(load("reentry_case1"), evaluations=100, seed=s, verify=None),
    "reentry_case3": lambda s: MACS(refine=False, agents=5).solve(load("reentry_case3"), evaluations=100, seed=s, verify=None),
    "welded_beam": lambda s: MACS().solve(load("welded_beam"), evaluations=1500, seed=s),
    "welded_beam, rounds": lambda s: MACS().solve(load("welded_beam"), seed=s),
    "four_bar_truss": lambda s: MACS(archive=50).solve(load("four_bar_truss"), evaluations=3000, seed=s),
    "aerocapture": lambda s: MACS().solve(load("aerocapture"), evaluations=300, seed=s),
    "brachistochrone": lambda s: macs.payoff(load("standard/brachistochrone"), seed=s),
    "dubins": lambda s: macs.payoff(load("standard/dubins"), parse("dfet:8x3"), seed=s),
    "hypersensitive": lambda s: macs.payoff(load("standard/hypersensitive"), seed=s),
    "crane": lambda s: macs.payoff(load("standard/crane"), seed=s),
    "bryson_denham": lambda s: macs.payoff(load("standard/bryson_denham"), seed=s),
    "van_der_pol": lambda s: MACS().solve(load("standard/van_der_pol"), parse("dfet:6x3"), evaluations=100, seed=s),
}


def computed(job: tuple[str, int]) -> dict[str, list]:
    """Objectives of the front of a job, and what it counted."""
    front = FRONTS[job[0]](job[1])
    counts = [int(front.stats.get(key, 0)) for key in ("evaluations", "gradient_solves", "inner_iterations")]
    return {"F": np.asarray(front.F).tolist(), "counts": counts, "verified": [bool(one) for one in front.verified]}


def differences(name: str, old: dict[str, list], new: dict[str, list]) -> str:
    """What differs between two results; empty if nothing does."""
    A, B = np.array(old["F"]), np.array(new["F"])
    words = []
    if A.shape != B.shape:
        words.append(f"{len(B)} points for {len(A)}")
    elif A.size and (worst := float(np.max(np.abs(A - B) / np.maximum(np.abs(A), 1e-12)))) > REL:
        words.append(f"objectives by {worst:.1e}")
    if old["counts"] != new["counts"]:
        words.append(f"evaluations, solves, iterations {new['counts']} for {old['counts']}")
    if old["verified"] != new["verified"]:
        words.append(f"{sum(new['verified'])} verified for {sum(old['verified'])}")
    return f"{name}: {'; '.join(words)}" if words else ""


def main() -> int:
    """Freeze or check."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("verb", choices=("freeze", "check"))
    parser.add_argument("file", type=Path)
    parser.add_argument("names", nargs="*", help="some of the fronts (default: all)")
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    jobs = [(name, seed) for name in given.names or FRONTS for seed in SEEDS]
    with ProcessPoolExecutor(given.jobs) as pool:
        found = {f"{name}, seed {seed}": one for (name, seed), one in zip(jobs, pool.map(computed, jobs), strict=True)}
    if given.verb == "freeze":
        given.file.write_text(json.dumps(found), encoding="utf-8")
        return 0
    old = json.loads(given.file.read_text(encoding="utf-8"))
    words = [line for name, one in found.items() if (line := differences(name, old[name], one))]
    print(*words or [f"{len(found)} fronts are as they were"], sep="\n")
    return bool(words)


if __name__ == "__main__":
    sys.exit(main())
