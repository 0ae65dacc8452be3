"""`macs study`: batches from the command line."""

from __future__ import annotations

import sys
from argparse import Namespace
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

from .answers import DONE, FAILED, INTERRUPTED, WrongCall, wrong_call_on_value_error


def study(arguments: Namespace) -> int:
    """Run a study, show its state, or report on it."""
    return {"run": run, "status": status, "report": report}[arguments.action](arguments)


def run(arguments: Namespace) -> int:
    """Make the runs that are missing."""
    from ..batch.running import WorkersLost
    from ..execution.workers import cluster
    from ..study import Study

    if arguments.dask and arguments.jobs:
        raise WrongCall("--jobs is for this machine, --dask for a cluster: give one of them")
    with wrong_call_on_value_error():
        batch = Study.load(arguments.study, trust=arguments.trust)
        batch = batch if arguments.runs is None else replace(batch, runs=arguments.runs)
        batch = batch.quick() if arguments.quick else batch
    out = Path(arguments.out or Path("out") / batch.name)
    again = "finished runs are kept; the same command goes on from there"
    try:
        with wrong_call_on_value_error(), cluster(arguments.dask) if arguments.dask else nullcontext() as executor:
            summary = batch.run(out, jobs=arguments.jobs or 1, executor=executor, retry=arguments.retry, progress=True)
    except KeyboardInterrupt:
        print(f"interrupted; {again}", file=sys.stderr)
        return INTERRUPTED
    except WorkersLost as error:
        print(error, file=sys.stderr)
        return FAILED
    except OSError as error:
        raise WrongCall(f"{error.strerror or error}; {again}") from error
    print(f"{summary}\n\nin {out}")
    return DONE if summary.finished == len(summary.runs) else FAILED


def status(arguments: Namespace) -> int:
    """The state of a study."""
    from ..batch.store import Store

    with wrong_call_on_value_error():
        summary = Store.open(arguments.folder).summary()
    print(summary)
    return DONE if summary.finished == len(summary.runs) else FAILED


def report(arguments: Namespace) -> int:
    """Tables on the terminal, and with the figures in the study's folder."""
    from ..report.report import FOLDER
    from ..report.report import report as write

    foreign: dict[str, list[str]] = {}
    for word in arguments.join or []:
        name, equals, path = word.partition("=")
        if not (name and equals and path):
            raise WrongCall(f"--join {word}: write NAME=FILE")
        foreign.setdefault(name, []).append(path)
    try:
        with wrong_call_on_value_error():
            found = write(arguments.folder, foreign=foreign, figures=not arguments.no_figures, progress=True, trust=arguments.trust)
    except OSError as error:
        raise WrongCall(str(error)) from error
    print(f"{found}\n\n{len(found.files)} files in {Path(arguments.folder) / FOLDER}")
    return DONE
