"""Fuzzing by hand: `python tests/fuzz/run_fuzz.py --flights 2000 --boxes 1000`; a finding is printed with its seed, and repeated by it."""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter

from fuzzing import FindingError, attempt_box, attempt_flight


def main() -> int:
    """Make the attempts; the exit code is 1 if there was a finding."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flights", type=int, default=200, help="number of random problems")
    parser.add_argument("--boxes", type=int, default=100, help="number of random black boxes")
    parser.add_argument("--seed", type=int, default=0, help="the first seed; a finding is repeated by its own, with a number of 1")
    arguments = parser.parse_args()
    findings = 0
    for attempt, count in ((attempt_flight, arguments.flights), (attempt_box, arguments.boxes)):
        outcomes, began = Counter[str](), time.perf_counter()
        for seed in range(arguments.seed, arguments.seed + count):
            try:
                outcome = attempt(seed)
                outcomes["refused" if outcome.startswith("refused") else outcome] += 1
            except FindingError as finding:
                findings += 1
                outcomes["FINDING"] += 1
                print(f"{attempt.__name__} {seed}: {finding}\n", flush=True)
        print(f"{attempt.__name__}: {dict(outcomes)} in {time.perf_counter() - began:.0f} s", flush=True)
    return int(findings > 0)


if __name__ == "__main__":
    sys.exit(main())
