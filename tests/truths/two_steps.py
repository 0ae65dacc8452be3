"""The two-step designs of the aerocapture paper beside designs in one step that are better in every objective.

    python tests/truths/two_steps.py [--solutions 1 2 3 4 5]

Two steps: the shape that the paper prints, then the bank profile of least delta v for it, with the heat shield of its constant bank as the
limit. One step: shape and bank profile together, as much better as can be by the same share of all three objectives.
"""

import argparse
from collections.abc import Sequence

import numpy as np

from macs import Point, optimize
from macs.decisions import Ranges, ReferencePoint, decide
from problems import load
from problems.cases.aerocapture.coupled import PACKING, SHIELD
from problems.cases.aerocapture.designs import TABLE_2, assess
from transcription import stated

DELTA_V = "delta v"
RANGES = Ranges({PACKING: 0.4, SHIELD: 4.0, DELTA_V: 29.0}, {PACKING: 1.2, SHIELD: 20.0, DELTA_V: 110.0})
"""Of the objectives, chosen around the designs."""
RESERVED = 1.1
"""Reservation levels over aspiration levels, in all objectives, so that all gain the same share."""


def two_steps(solution: int) -> tuple[dict[str, float], Point]:
    """Objectives of a solution of Table 2 with its best bank profile, and the profile, of which packing is no objective."""
    problem = load("aerocapture_bank", shape=solution)
    profile = optimize(problem, stated(problem.default_transcription), objective=DELTA_V)
    packing = float(assess(np.array([TABLE_2[solution].design])).packing[0])
    return {PACKING: packing, **{name: profile.objectives[name] for name in (SHIELD, DELTA_V)}}, profile


def one_step(solution: int, beside: dict[str, float]) -> Point:
    """The point of `aerocapture_codesign` that is farthest below objectives, from the shape of a solution of Table 2."""
    problem = load("aerocapture_codesign", shape=solution)
    method = stated(problem.default_transcription)
    preference = ReferencePoint(beside, {name: RESERVED * value for name, value in beside.items()})
    # From one flight, and not from the ends of the front, which would be solved first.
    start = optimize(problem, method, objective=DELTA_V, starts=1)
    return decide(problem, method, preference, start=start, starts=1, ranges=RANGES).point


def main(argv: Sequence[str] | None = None) -> None:
    """Print a row of the table for each solution as it is found."""
    parser = argparse.ArgumentParser(prog="python tests/truths/two_steps.py", description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--solutions", type=int, nargs="+", choices=sorted(TABLE_2), default=sorted(TABLE_2))
    print("solution         by  eta 1/m2   TPS %  delta v m/s  verified")
    for solution in parser.parse_args(argv).solutions:
        beside, profile = two_steps(solution)
        point = one_step(solution, beside)
        for first, by, found, verified in (
            (str(solution), "two steps", beside, profile.verified),
            ("", "one step", point.objectives, point.verified),
        ):
            figures = f"{found[PACKING]:8.4f}  {found[SHIELD]:6.3f}  {found[DELTA_V]:11.3f}"
            print(f"{first:>8}  {by:>9}  {figures}  {'yes' if verified else 'no':>8}", flush=True)


if __name__ == "__main__":
    main()
