"""Reference front of the skip entry by gradients: the program that made the table beside the case.

    python -m runs.truths.skip [--points 36] [--out FILE.csv]

A sweep on the case's own mesh, from one end of the front to the other; points that a simulation does not confirm are left out.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from macs import Front, sweep
from macs.io.atomic import write_whole
from problems import load
from problems.cases.skip_entry import skip


def text(front: Front) -> str:
    """The table as text, with a header: its verified points alone."""
    rows = [",".join(f"{value:.7g}" for value in point.simulated.values()) for point in front if point.verified and point.simulated]
    return (
        "\n".join(
            [
                "# skip: front by gradients; made by: python -m runs.truths.skip",
                "# terminal mass kg, terminal speed m/s, as simulated",
                *rows,
            ]
        )
        + "\n"
    )


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description="Make the reference front of the skip entry again.")
    parser.add_argument("--points", type=int, default=36)
    parser.add_argument("--out")
    given = parser.parse_args()
    try:
        front = sweep(load("skip"), points=given.points)
    except ValueError as error:
        parser.error(str(error))
    write_whole(given.out or Path(skip.__file__).with_name("skip.csv"), text(front).encode())
    print(front.table())


if __name__ == "__main__":
    main()
