"""`macs study`: batches from the command line."""

from __future__ import annotations

import sys
from argparse import Namespace
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

from .answers import DONE, INTERRUPTED, NO, WrongCall, refused


def study(arguments: Namespace) -> int:
    """Run a study, tell how one stands, or report on it."""
    return {"run": run, "status": status, "report": report}[arguments.action](arguments)


def run(arguments: Namespace) -> int:
    """Make the runs that are missing."""
    from ..batch.running import WorkersLost
    from ..execution.workers import cluster
    from ..study import Study

    if arguments.dask and arguments.jobs:
        raise WrongCall("--jobs is for this machine, --dask for a cluster: give one of them")
    with refused():
        batch = Study.load(arguments.study, trust=arguments.trust)
        batch = batch if arguments.runs is None else replace(batch, runs=arguments.runs)
        batch = batch.quick() if arguments.quick else batch
    out = Path(arguments.out or Path("out") / batch.name)
    again = "what is finished is kept, the same command goes on from there"
    try:
        with refused(), cluster(arguments.dask) if arguments.dask else nullcontext() as executor:
            summary = batch.run(out, jobs=arguments.jobs or 1, executor=executor, retry=arguments.retry, progress=True)
    except KeyboardInterrupt:
        print(f"interrupted; {again}", file=sys.stderr)
        return INTERRUPTED
    except WorkersLost as error:
        print(error, file=sys.stderr)
        return NO
    except OSError as error:
        raise WrongCall(f"{error.strerror or error}; {again}") from error
    print(f"{summary}\n\nin {out}")
    return DONE if summary.finished == len(summary.runs) else NO


def status(arguments: Namespace) -> int:
    """How a study stands."""
    from ..batch.store import Store

    with refused():
        summary = Store.open(arguments.folder).summary()
    print(summary)
    return DONE if summary.finished == len(summary.runs) else NO


def report(arguments: Namespace) -> int:
    """Tables on the terminal, and with the figures in the study's folder."""
    from macs.io.interrupts import Stopped

    from ..report.report import FOLDER
    from ..report.report import report as write

    foreign: dict[str, list[str]] = {}
    for word in arguments.join or []:
        name, equals, path = word.partition("=")
        if not (name and equals and path):
            raise WrongCall(f"--join {word}: write NAME=FILE")
        foreign.setdefault(name, []).append(path)
    try:
        with refused():
            found = write(arguments.folder, foreign=foreign, figures=not arguments.no_figures, progress=True, trust=arguments.trust)
    except Stopped:
        print("interrupted", file=sys.stderr)
        return INTERRUPTED
    except OSError as error:
        raise WrongCall(str(error)) from error
    print(f"{found}\n\n{len(found.files)} files in {Path(arguments.folder) / FOLDER}")
    return DONE
