"""Benchmark of fronts as curves: what a curve takes, and whether points that are solved anew lie within its estimated error."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from macs import sweep
from macs.fronts.curve import FrontCurve, alone
from macs.gradients.scalarised import Scalarised
from macs.io.console import Steps
from macs.refinement.places import KnownPoints
from problems import Problem, load
from transcription import Transcription

from .contract import SECONDS, Bench, Effort, Row, Target, column, finished
from .searches import SearchCase, cart_pole

COLUMNS = "points:.0f solves:.0f ends:.0f error:.1e targets:.0f within:.0% farthest:.1e lines:.0f mesh:.1e"


def asked(case: str) -> tuple[float, int]:
    """The error that the curve of a case is to have, and after how many solves at most."""
    return (3e-4, 15) if case in ("goddard", "orbit_rise") else (1e-3, 25)


def curve_rounds(given: SearchCase | str, effort: Effort, steps: Steps) -> Callable[[int], Iterable[Row]]:
    """A round makes a front with its curve, then solves random targets anew."""
    case = given if isinstance(given, SearchCase) else SearchCase(given, partial(load, given))
    (problem, mesh), (error, _) = case.stated(), asked(case.name)
    swept = partial(sweep, problem, starts=1, verify=None, progress=False)

    def measured(number: int) -> Iterable[Row]:
        began = time.perf_counter()
        front = finished(swept(mesh, error=error))
        curve, seconds = front.curve(), time.perf_counter() - began
        known, places = KnownPoints(front), np.random.default_rng(number).random(effort.evaluations or 100)
        lines = [curve.least + curve.ranges * [place, 1.0 - place] for place in places[~np.isnan(curve.at(places)[0])]]
        steps(f"curve: {case.name}, {len(lines)} targets anew")
        anew = [one for one in known.solved(*(Scalarised(line, curve.ranges, units=known.units) for line in lines)) if one.row is None]
        away = curve.distances(np.array([one.F for one in anew]) * front.signs)
        F, costates = np.array([*front.F, *(one.F for one in anew)]), [*front.costates, *(one.columns["costates"] for one in anew)]
        good = [k for k in np.flatnonzero(alone(F, curve.ranges)) if costates[k] is not None]
        exact = FrontCurve.through(front.goals, F[good], np.array([costates[k].weights for k in good]), [])
        steps(f"curve: {case.name}, on a finer mesh")
        other = exact.distances(finished(swept(finer(mesh, problem), points=5, start=front)).objectives).max()
        counts = {"points": len(front), "solves": front.stats["gradient_solves"], "ends": front.stats["solves_for"]["ends"]}
        counts |= {"targets": len(anew), "lines": even_points(exact, error)}
        errors = {"error": curve.error, "within": np.mean(away <= curve.error), "farthest": away.max(), "mesh": other}
        yield Row.once(case.name, f"{error:g}", seconds=seconds, **counts, **errors)

    return measured


def finer(mesh: Any, problem: Problem) -> Transcription:
    """The mesh with each element cut in two."""
    old = {name: mesh.mesh_of(name) for name in problem.phases}
    edges = {
        name: np.insert(one.edges, range(1, one.elements + 1), np.convolve(one.edges, [0.5, 0.5], "valid")) for name, one in old.items()
    }
    return mesh.remeshed({name: replace(one, edges=tuple(edges[name])) for name, one in old.items()})


def even_points(curve: FrontCurve, error: float) -> float:
    """The least number of points in even steps along the line between the ends, whose straight lines err by less; NaN if too many."""
    places = np.linspace(0.0, 1.0, 4001)
    heights, slopes, _ = curve.at(places)
    for count in range(3, 500):
        nodes = np.linspace(0.0, 1.0, count)
        nodes = nodes[~np.isnan(curve.at(nodes)[0])]
        apart = np.abs(np.interp(places, nodes, curve.at(nodes)[0]) - heights) * np.sqrt(2.0 / (1.0 + slopes**2))
        if np.nanmax(apart) < error:
            return count
    return np.nan


def targets(rows: Sequence[Row]) -> list[Target]:
    """What is asked of the error, of the solves, and of the targets."""
    found = list[Target]()
    for row in rows:
        solves, error, others, (wanted, most) = row.of("solves"), row.of("error"), row.of("lines") - 2 + row.of("ends"), asked(row.case)
        found += [
            Target(
                row.case, f"an error of {wanted:g} from {most} solves", f"{error:.1e} from {solves:.0f}", error <= wanted and solves <= most
            ),
            Target(row.case, "95 % of the targets within", f"{row.of('within'):.0%}", row.of("within") >= 0.95),
            Target(row.case, "half of the solves of lines", f"{solves:.0f} of {others:.0f}", 2 * solves <= others),
        ]
    return found


CASES = (
    SearchCase("goddard", partial(load, "goddard"), "dfet:6x6:bernstein"),
    SearchCase("orbit_rise", partial(load, "orbit_rise"), "dfet:10x5:bernstein"),
    SearchCase("cart-pole", cart_pole, "dfet:16x6:bernstein"),
    SearchCase("skip", partial(load, "skip")),
    SearchCase("reentry_case1", lambda: load("reentry_case1").with_objectives("cross-range", "heat load")),
    SearchCase("smv", lambda: load("smv").with_objectives("terminal speed", "terminal mass")),
)
CURVE = Bench(
    title="curve",
    about="CURVE: `sweep(error=)` from one start, on one mesh: points, gradient solves, those for the ends, the estimated error in ranges "
    "of the objectives; of random targets, solved anew, how many lie within it, and the farthest. Lines: even points, straight lines, for "
    "the wanted error; they take as many solves for ends. Mesh: how far five points on halved elements lie from the front.",
    full=Effort(CASES),
    quick=Effort(CASES[:1], evaluations=20),
    prepare=curve_rounds,
    columns=(*(column(name, "", name, form=form) for name, form in (one.split(":") for one in COLUMNS.split())), SECONDS),
    targets=targets,
)
