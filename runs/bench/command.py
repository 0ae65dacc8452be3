"""`macs bench`: measures, prints and saves, also after Ctrl-C."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from macs.io.interrupts import Stopped

from . import density, fronts, functions, inner, methods, passages, peers, population, prefer, scale, search, standard, study
from .measured import Row, save
from .page import Effort, header_of, write_page
from .scale import generation

BENCHMARKS: dict[str, Any] = {
    **{name: functions.Contest(name) for name in functions.NAMES},
    "density": density,
    "front": fronts,
    "generation": generation,
    "inner": inner,
    "methods": methods,
    "passages": passages,
    "peers": peers,
    "population": population,
    "prefer": prefer,
    "scale": scale,
    "search": search,
    "standard": standard,
    "study": study,
}
KINDS = tuple(sorted(BENCHMARKS))
SEEDS, QUICK_SEEDS = (1, 2, 3, 4, 5), (1,)
SEEDED = (*functions.NAMES, "prefer", "search")
"""Benchmarks that are repeated with other seeds."""
STUDIES = functions.NAMES
"""Benchmarks whose runs may be made at the same time, and kept."""


def bench(kinds: Sequence[str], effort: Effort, path: str | None, page: str | None = None) -> bool:
    """Run some of `KINDS`, one after the other; write all numbers to the CSV file `path`, if there is one.

    The report of a single one is also written to `page`, if there is one and it was not interrupted. Returns whether all targets are met,
    see `Target`.
    """
    header = header_of(kinds[0], effort, page) if page else None
    measured: list[tuple[str, Row]] = []
    missed: list[str] = []
    for kind in kinds:
        rows: list[Row] = []
        ended = _run(kind, rows, effort)
        measured += [(kind, row) for row in rows]
        if rows:
            text = BENCHMARKS[kind].report(rows)
            print(text, end="\n\n", flush=True)
            if page and header and not ended:
                write_page(page, kind, header, text)
                print(f"page in {page}")
            missed += [f"{kind}: {one.what}" for one in BENCHMARKS[kind].targets(rows) if not one.met]
        if ended:
            kept = f"; the same command goes on with the searches in {effort.keep}" if effort.keep and kind in STUDIES else ""
            print(f"interrupted: these are the values measured until then{kept}", file=sys.stderr)
            break
    if path:
        save(path, measured)
        print(f"values in {path}")
    if missed and len(kinds) > 1:
        print("MISSED:", *missed, sep="\n  ")
    return not missed


def _run(kind: str, rows: list[Row], effort: Effort) -> bool:
    """Measure; returns whether Ctrl-C was pressed."""
    quick, count = effort.quick, effort.seeds
    seeds = tuple(range(1, count + 1)) if count else QUICK_SEEDS if quick else SEEDS
    cases = [case for case in inner.INNER if case.quick or not quick]
    sets = {name: BENCHMARKS[name] for name in functions.NAMES}
    whole = {"seeds": count or functions.SEEDS, "jobs": effort.jobs, "keep": effort.keep, "only": effort.solvers or None}
    work: dict[str, Callable[[], None]] = {
        **{name: (partial(one.quick, rows) if quick else partial(one.bench, rows, **whole)) for name, one in sets.items()},
        "density": lambda: density.bench_density(rows, density.QUICK if quick else density.CASES),
        "front": lambda: fronts.bench_fronts(rows, fronts.QUICK if quick else fronts.Effort()),
        "generation": lambda: generation.bench_generation(rows, generation.QUICK if quick else generation.FULL),
        "inner": lambda: inner.bench_inner(rows, inner.QUICK if quick else inner.Effort(), cases),
        "methods": lambda: methods.bench_methods(rows, methods.Effort(methods.QUICK) if quick else methods.Effort()),
        "passages": lambda: passages.bench_passages(rows, passages.QUICK if quick else passages.Effort()),
        "peers": lambda: peers.bench_peers(rows, peers.QUICK if quick else peers.Effort()),
        "population": lambda: population.bench_population(rows, population.QUICK if quick else population.Effort()),
        "prefer": lambda: prefer.bench_prefer(rows, seeds, quick),
        "scale": lambda: scale.bench_scale(rows, scale.QUICK if quick else scale.FULL),
        "search": lambda: search.bench_search(rows, seeds, quick),
        "standard": lambda: standard.bench_standard(rows, standard.Effort(standard.QUICK) if quick else standard.Effort()),
        "study": lambda: study.bench_study(rows, study.QUICK if quick else study.Effort()),
    }
    try:
        work[kind]()
    except (Stopped, KeyboardInterrupt):
        return True
    return False
