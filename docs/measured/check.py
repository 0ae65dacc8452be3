"""Lists the pages of measured results in this folder with their commands, and says which are out of date: `python docs/measured/check.py`.

A page is out of date once the files that state what it measures, a study file or the modules of a bench, are others than when it was made.
The exit code is 1 if any is, or has no header or no command that exists.
"""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

from runs.bench import sources
from runs.cli.parser import build_parser
from runs.report.page import digest, print_standing

HERE = Path(__file__).parent
STUDIES = HERE.parents[1] / "runs" / "studies"


def files_of(command: str) -> list[Path]:
    """The files that state what a command measures. Raises ValueError if there is no such command."""
    program, *words = shlex.split(command)
    try:
        arguments = build_parser().parse_args(words)
    except SystemExit:
        raise ValueError(f"there is no command '{command}'") from None
    if program == "macs" and arguments.command == "bench" and arguments.what and arguments.page:
        return sources(arguments.what)
    if program == "macs" and arguments.command == "study" and arguments.action == "report":
        return [STUDIES / f"{Path(arguments.folder).name}.toml"]
    raise ValueError(f"'{command}' makes no page")


def main(folder: Path = HERE) -> int:
    """Print a line for each page; returns the exit code."""
    pages = (page for page in folder.glob("*.md") if page.name not in ("index.md", "README.md"))
    return int(not print_standing(pages, lambda command: digest(*files_of(command))))


if __name__ == "__main__":
    sys.exit(main())
