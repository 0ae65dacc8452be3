"""`macs bench`: the table of all benchmarks; measures, prints and saves, also after Ctrl-C."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from macs.io.atomic import write_whole
from macs.io.interrupts import Stopped

from ..report.page import PageHeader, digest_of_bench
from .contest import CONTESTS
from .contract import Bench, Row, save
from .curve import CURVE
from .growth import GENERATION, SCALE
from .inner import INNER, POPULATION
from .parts import PARTS_BENCH
from .peers import PEERS
from .published import METHODS, STANDARD, WILD
from .searches import FRONT, SEARCH
from .work import CHARGES, CORPUS, earlier
from .workers import STUDY, WORKERS

BENCHES: dict[str, Bench] = {
    **CONTESTS,
    "charges": CHARGES,
    "corpus": CORPUS,
    "curve": CURVE,
    "front": FRONT,
    "generation": GENERATION,
    "inner": INNER,
    "methods": METHODS,
    "parts": PARTS_BENCH,
    "peers": PEERS,
    "population": POPULATION,
    "scale": SCALE,
    "search": SEARCH,
    "standard": STANDARD,
    "study": STUDY,
    "wild": WILD,
    "workers": WORKERS,
}


def bench(
    kinds: Sequence[str],
    *,
    quick: bool = False,
    seeds: int | None = None,
    csv: str | None = None,
    page: str | None = None,
    problems: Sequence[str] = (),
    only: Sequence[str] = (),
    against: str | None = None,
    **studies: Any,
) -> bool:
    """Run some of `BENCHES`, one after the other; write all numbers to the file `csv`, if there is one.

    `only` these cases, by their names, or problems by their addresses. Of the corpus, further `problems` by their addresses, and the CSV
    file of an earlier run whose values stand beside.
    `studies` are the settings `jobs`, `keep` and `solvers` of an `Effort`. The report of a single benchmark is also written to `page`, if
    there is one and it was not interrupted. Returns whether all targets are met.
    """
    before = earlier(against) if against else {}
    header = header_of(kinds[0], page, quick=quick, seeds=seeds, **studies) if page else None
    measured: list[tuple[str, Row]] = []
    missed: list[str] = []
    for kind in kinds:
        one, rows = BENCHES[kind], list[Row]()
        effort = one.quick if quick else one.full
        effort = replace(effort, rounds=seeds) if seeds and one.seeded else effort
        effort = replace(effort, **studies) if one.kept else effort
        known = {getattr(case, "name", case): case for case in one.full.cases}
        effort = replace(effort, cases=(*([known.get(name, name) for name in only] or effort.cases), *problems))
        interrupted = _measure(one, rows, effort)
        measured += [(kind, row) for row in rows]
        rows = [one for row in rows for one in (row, before.get(row.case)) if one is not None]
        if rows:
            text = one.report(rows)
            print(text, end="\n\n", flush=True)
            if page and header and not interrupted:
                write_whole(page, f"{header}\n\n# `macs bench {kind}`\n\nMade by `{header.command}`.\n\n```text\n{text}\n```\n".encode())
                print(f"page in {page}")
            missed += [f"{kind}: {target.what}" for target in one.targets(rows) if not target.met]
        if interrupted:
            again = f"; the same command goes on with the searches in {effort.keep}" if effort.keep else ""
            print(f"interrupted: these are the values measured until then{again}", file=sys.stderr)
            break
    if csv:
        save(csv, measured)
        print(f"values in {csv}")
    if missed and len(kinds) > 1:
        print("MISSED:", *missed, sep="\n  ")
    return not missed


def _measure(one: Bench, rows: list[Row], effort: Any) -> bool:
    """Measure; returns whether Ctrl-C was pressed."""
    try:
        one.measure(rows, effort)
    except (Stopped, KeyboardInterrupt):
        return True
    return False


def header_of(
    kind: str, page: str, *, quick: bool = False, seeds: int | None = None, jobs: int = 1, keep: Any = None, solvers: Sequence[str] = ()
) -> PageHeader:
    """The header of the page of a benchmark. Raises ValueError if it cannot be written into a comment."""
    words = ["--quick"] if quick else []
    words += ["--seeds", str(seeds)] if seeds else []
    words += ["--jobs", str(jobs)] if jobs > 1 else []
    words += ["--solvers", *solvers] if solvers else []
    return PageHeader.now(
        shlex.join(["macs", "bench", kind, *words, "--page", str(page)]), digest_of_bench(BENCHES[kind].sources), BENCHES[kind].code
    )
