"""`macs study`: batches from the command line; `macs report` and `macs serve`: pages for the browser."""

from __future__ import annotations

import shlex
import sys
from argparse import Namespace
from contextlib import nullcontext, suppress
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
    from ..execution.processes import cluster
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


# Pages for the browser


def page_report(arguments: Namespace) -> int:
    """A front or a study as one file for the browser."""
    from ..browser.pages import write_page

    source = find_source(arguments.source)
    out = Path(arguments.html) if arguments.html else _beside(source)
    if not arguments.html:
        out.parent.mkdir(exist_ok=True)
    elif out.suffix.lower() not in (".html", ".htm"):
        raise WrongCall(f"--html {out}: the name of a page ends with .html")
    try:
        with wrong_call_on_value_error():
            write_page(source, out, trust=arguments.trust, progress=True)
    except OSError as error:
        raise WrongCall(str(error)) from error
    print(f"page in {out}")
    return DONE


def serve(arguments: Namespace) -> int:
    """The same page, live, from a server that only reads; until Ctrl-C."""
    from ..browser.live import followed
    from ..browser.server import Server

    path = find_source(arguments.source)
    with wrong_call_on_value_error():
        server = Server(followed(path, arguments.trust), arguments.host, arguments.port)
    with suppress(KeyboardInterrupt), server:
        if not server.local:
            print("warning: everybody on the network can read this; without --host only this machine can", file=sys.stderr)
        print(f"{path} is shown at {server.url} until Ctrl-C", flush=True)
        server.serve_forever()
    return DONE


def find_source(word: str) -> Path:
    """A front's file or a study's folder; for the name of a study the folder that it ran into by default."""
    ran = Path("out") / word
    return ran if not Path(word).exists() and (ran / "study.json").is_file() else Path(word)


def _beside(source: Path) -> Path:
    """Where the page of a front or study is written by default. Raises `WrongCall` if there is no such front or study."""
    if source.is_dir():
        if not (source / "study.json").is_file():
            raise WrongCall(f"'{source}' contains no study: there is no study.json in it")
        return source / "report" / "report.html"
    if not source.is_file():
        raise WrongCall(f"there is no file or folder '{source}'")
    return source.with_suffix(".html")
