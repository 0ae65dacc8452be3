"""`macs study`: batches from the command line."""

from __future__ import annotations

import shlex
import sys
from argparse import Namespace
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from .answers import DONE, FAILED, INTERRUPTED, WrongCall, wrong_call_on_value_error

if TYPE_CHECKING:
    from ..report.page import Page


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
            jobs, retry, solvers = arguments.jobs or 1, arguments.retry, arguments.solvers
            summary = batch.run(out, jobs=jobs, executor=executor, retry=retry, solvers=solvers, progress=True)
    except KeyboardInterrupt:
        print(f"interrupted; {again}", file=sys.stderr)
        return INTERRUPTED
    except WorkersLost as error:
        print(error, file=sys.stderr)
        return FAILED
    except OSError as error:
        raise WrongCall(f"{error.strerror or error}; {again}") from error
    print(f"{summary}\n\nin {out}")
    asked = [run for run in summary.runs if solvers is None or run.cell.solver in solvers]
    return DONE if all(run.finished for run in asked) else FAILED


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
            page = page_of(arguments) if arguments.page else None
            drawn = not arguments.no_figures
            found = write(arguments.folder, foreign=foreign, figures=drawn, progress=True, trust=arguments.trust, page=page)
    except OSError as error:
        raise WrongCall(str(error)) from error
    print(f"{found}\n\n{len(found.files)} files in {Path(arguments.folder) / FOLDER}")
    return DONE


def page_of(arguments: Namespace) -> Page:
    """The page that a report is also written to. Raises ValueError or OSError if it cannot be, or the study's file is not found."""
    from ..batch.file import find
    from ..batch.store import Store
    from ..report.page import Page
    from ..study import Study

    if arguments.no_figures or arguments.join:
        raise WrongCall("--page is for a report with figures, of the study's own runs alone: without --no-figures and --join")
    source = arguments.study or Store.open(arguments.folder, arguments.trust).definition["name"]
    stated = f" --study {shlex.quote(arguments.study)}" if arguments.study else ""
    trusted = " --trust" if arguments.trust else ""
    command = f"macs study report {shlex.quote(arguments.folder)} --page {shlex.quote(arguments.page)}{stated}{trusted}"
    return Page(arguments.page, command, find(source), Study.load(source, trust=arguments.trust).definition())
