"""`macs report` and `macs serve`: pages for the browser, from the command line."""

from __future__ import annotations

import sys
from argparse import Namespace
from contextlib import suppress
from pathlib import Path

from .answers import DONE, WrongCall, wrong_call_on_value_error


def report(arguments: Namespace) -> int:
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
