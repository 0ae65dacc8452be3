"""A published table beside ours: mean and variance of GD and IGD against the union of all runs, and the time of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..measures.scale import Scale
from ..measures.statistics import summarise
from .ground import Ground
from .measuring import samples, spent
from .tables import Cell, Column, Table, table

KEYS = ("gd_mean", "gd_variance", "igd_mean", "igd_variance", "seconds")
"""What a study's `[paper.PROBLEM]` may hold, and the columns of the table."""


def check(paper: Mapping[str, Any]) -> None:
    """Raise ValueError that names what a study's section `paper` holds and should not."""
    for label, figures in paper.items():
        if label in ("source", "note", "differs"):
            if not isinstance(figures, str):
                raise ValueError(f"paper: {label} must be a text, not {figures!r}")
            continue
        if not isinstance(figures, Mapping):
            raise ValueError(f"paper: '{label}' must be a table of {', '.join(KEYS)}, not {figures!r}")
        for key, value in figures.items():
            if key not in KEYS:
                raise ValueError(f"paper.{label}: unknown key '{key}'; there are {', '.join(KEYS)}")
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise ValueError(f"paper.{label}: {key} must be a number, not {value!r}")


def published_table(grounds: Sequence[Ground], paper: Mapping[str, Any]) -> Table | None:
    """The paper's rows and ours, problem by problem; None where the paper says nothing of any.

    GD and IGD are against the points of the union of all runs, as published tables have them, normalised by its range.
    """
    rows: list[list[Cell]] = []
    notes = []
    for ground in grounds:
        figures = paper.get(ground.problem)
        if figures is None:
            continue
        rows.append([ground.problem, "the paper", None, *(figures.get(key) for key in KEYS), None])
        union = ground.union()
        found, times = samples(ground, union, curve=False), spent(ground)["time [s]"]
        for solver in ground.runs:
            if solver not in found["GD"]:
                continue
            cells: list[Cell] = []
            for name in ("GD", "IGD"):
                summary = summarise(found[name][solver])
                cells += [summary.mean, summary.variance]
            seconds = float(np.mean(times[solver])) if solver in times else None
            ratio = figures["seconds"] / seconds if seconds and "seconds" in figures else None
            rows.append([ground.problem, f"{solver}, {ground.transcription}", len(found["GD"][solver]), *cells, seconds, ratio])
        scale = Scale.of(union.front, like=ground.known, what=union.what).describe().split(". Hypervolume")[0]
        notes.append(f"{ground.problem}: {scale[0].lower()}{scale[1:]}; GD and IGD to its points.")
    if not rows:
        return None
    heads: list[Column | str] = [Column("problem", grouped=True), "by", "runs"]
    heads += [Column("mean GD", digits=4), Column("variance", digits=4), Column("mean IGD", digits=4), Column("variance", digits=4)]
    heads += [Column("time", "s", digits=4), Column("times as fast", digits=2)]
    caption = f"Beside {paper['source']}" if "source" in paper else "Beside published figures"
    told = [f"The paper: {paper['note']}."] if "note" in paper else []
    told += [f"What differs: {paper['differs']}."] if "differs" in paper else []
    return table(heads, rows, f"{caption}.", [*notes, *told, "Variance with divisor n - 1."])
