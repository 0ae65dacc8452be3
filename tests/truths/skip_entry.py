"""Reference fronts of the skip entries by gradients: the program that made the tables beside the cases.

    python tests/truths/skip_entry.py skip|smv [--points 36] [--out FILE.csv]

A sweep on the case's own mesh between the ends of the front; points that a simulation does not confirm are left out.
"""

import argparse
from pathlib import Path

from macs import Front, sweep
from macs.io.atomic import write_whole
from problems import load
from problems.cases import skip_entry

CASES = ("skip", "smv")


def text(name: str, front: Front) -> str:
    """The table of a case as text, with a header: its verified points alone."""
    rows = [",".join(f"{value:.7g}" for value in point.simulated.values()) for point in front if point.verified and point.simulated]
    titles = ", ".join(f"{objective} {unit}" for objective, unit in zip(front.names, front.units, strict=True))
    head = [f"# {name}: front by gradients; made by: python tests/truths/skip_entry.py {name}", f"# {titles}, as simulated"]
    return "\n".join([*head, *rows]) + "\n"


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description="Make the reference front of a skip entry again.")
    parser.add_argument("case", choices=CASES)
    parser.add_argument("--points", type=int, default=36)
    parser.add_argument("--out")
    given = parser.parse_args()
    try:
        front = sweep(load(given.case), points=given.points)
    except ValueError as error:
        parser.error(str(error))
    beside = Path(skip_entry.__file__).with_name(f"{given.case}.csv")
    write_whole(given.out or beside, text(given.case, front).encode())
    print(front.table())


if __name__ == "__main__":
    main()
