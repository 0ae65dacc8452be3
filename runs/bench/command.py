"""`macs bench`: measures, prints and saves, also after Ctrl-C."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence

from macs.io.interrupts import Stopped

from . import density, fronts, inner, methods, passages, peers, population, prefer, scale, search, standard, study
from .measured import Row, save
from .scale import generation

BENCHMARKS = {
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
KINDS = tuple(BENCHMARKS)
SEEDS, QUICK_SEEDS = (1, 2, 3, 4, 5), (1,)


def bench(kinds: Sequence[str], quick: bool, path: str | None) -> bool:
    """Run some of `KINDS`, one after the other; write all numbers to the CSV file `path`, if there is one.

    Returns whether no two verified optima of one problem disagree, which no noise explains, and no cost grows faster than linearly, which
    little does: exponents do not depend on the speed of the machine.
    """
    measured: list[tuple[str, Row]] = []
    for kind in kinds:
        rows: list[Row] = []
        ended = _run(kind, rows, quick)
        measured += [(kind, row) for row in rows]
        if rows:
            print(BENCHMARKS[kind].report(rows), end="\n\n", flush=True)
        if ended:
            print("interrupted: these are the values measured until then", file=sys.stderr)
            break
    if path:
        save(path, measured)
        print(f"values in {path}")
    of = {kind: [row for one, row in measured if one == kind] for kind in ("methods", "scale")}
    return not methods.disagreements(of["methods"]) and not scale.superlinear(of["scale"])


def _run(kind: str, rows: list[Row], quick: bool) -> bool:
    """Measure; returns whether Ctrl-C was pressed."""
    cases = [case for case in inner.INNER if case.quick or not quick]
    work: dict[str, Callable[[], None]] = {
        "density": lambda: density.bench_density(rows, density.QUICK if quick else density.CASES),
        "front": lambda: fronts.bench_fronts(rows, fronts.QUICK if quick else fronts.Effort()),
        "generation": lambda: generation.bench_generation(rows, generation.QUICK if quick else generation.FULL),
        "inner": lambda: inner.bench_inner(rows, inner.QUICK if quick else inner.Effort(), cases),
        "methods": lambda: methods.bench_methods(rows, methods.Effort(methods.QUICK) if quick else methods.Effort()),
        "passages": lambda: passages.bench_passages(rows, passages.QUICK if quick else passages.Effort()),
        "peers": lambda: peers.bench_peers(rows, peers.QUICK if quick else peers.Effort()),
        "population": lambda: population.bench_population(rows, population.QUICK if quick else population.Effort()),
        "prefer": lambda: prefer.bench_prefer(rows, QUICK_SEEDS if quick else SEEDS, quick),
        "scale": lambda: scale.bench_scale(rows, scale.QUICK if quick else scale.FULL),
        "search": lambda: search.bench_search(rows, QUICK_SEEDS if quick else SEEDS, quick),
        "standard": lambda: standard.bench_standard(rows, standard.Effort(standard.QUICK) if quick else standard.Effort()),
        "study": lambda: study.bench_study(rows, study.QUICK if quick else study.Effort()),
    }
    try:
        work[kind]()
    except (Stopped, KeyboardInterrupt):
        return True
    return False
