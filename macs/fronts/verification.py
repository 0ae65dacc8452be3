"""Checks of a front, point by point, by three questions, none of which trusts the search that found it.

1. Are the trajectories that are stored those of the decision vectors that are stored?
2. Does the transcription, evaluated again, give the objectives that are stored, and a feasible point?
3. Simulated by an independent integrator, do the controls lead where the transcription says, to a feasible trajectory and to its
   objectives?
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np

from problems.vector import CompiledVectorProblem
from transcription import from_dict
from transcription.base import NLP, Transcription
from transcription.trajectories.simulate import simulate_all
from transcription.trajectories.trajectory import PhaseTrajectory

from ..evaluation.evaluator import CONVERGED
from .point import Point
from .points import Points
from .verified import evaluated_independently, objective_scales, simulated_independently

OTHER_MACHINE = 1e-9
"""Numbers that another run of the same arithmetic on another machine may give, in scales."""


@dataclass(frozen=True)
class Check:
    """Result for one point."""

    point: int
    mismatch: float  # largest scaled difference between stored and recomputed trajectories
    violation: float  # of the transcription, evaluated again at the stored decision
    objectives: float  # largest difference between stored and recomputed objectives, relative to the larger of 1 and the objective
    defect: float  # largest defect of the independent integration
    simulated: float  # largest violation of the simulated trajectory
    missed: float  # largest difference between the stored and the simulated objectives, integrals and peaks included, in `objective_scales`
    reasons: tuple[str, ...]  # why the point fails; empty if it does not

    @property
    def ok(self) -> bool:
        """Nothing is wrong with the point."""
        return not self.reasons


def verify(
    front: Points,
    *,
    tolerance: float,
    rtol: float = 1e-10,
    atol: float = 1e-11,
    method: str = "DOP853",
    transcription: Transcription | None = None,
) -> list[Check]:
    """Check every point of a front. Those of a vector problem, which have no trajectories to be wrong, are evaluated again."""
    scales, limit = objective_scales(front), front.stats["tolerance"]
    stated = front.stated()
    if isinstance(stated, CompiledVectorProblem):
        names = [v.name for v in stated.variables]
        if len(front) and [v.name for v in front.variables] != names:
            raise ValueError(f"the variables of the front are not {', '.join(names)}")
        found, again = evaluated_independently(front), "evaluated again"
        recomputed = [("", 0.0, F, violation, worst) for F, violation, worst in zip(found.F, found.violation, found.worst, strict=True)]
        limit = max(tolerance, limit)
    else:
        # What is wrong with the front as such is reported before any simulation.
        programs, again = _programs(front, transcription), "simulated"
        recomputed = [_recomputed(point, nlp) for point, nlp in zip(front, programs, strict=True)]
        found = simulated_independently(front, partial(simulate_all, stated, rtol=rtol, atol=atol, method=method))
    missed = found.off(front, scales).max(axis=1, initial=0.0)
    before = "recomputed" if front.dynamic else again
    defect, simulated = (np.where(np.isnan(column), np.inf, column) for column in (found.defect, found.violation))

    def check(i: int, point: Point) -> Check:
        where, mismatch, F, violation, worst = recomputed[i]
        off = np.abs(F - point.F) / np.maximum(1.0, np.abs(F))
        objectives = float(np.where(np.isnan(off), np.inf, off).max(initial=0.0))
        failures = [
            (not front.dynamic and not np.isfinite(F).all(), f"{again}, it fails"),
            (not mismatch <= OTHER_MACHINE, f"stored {where} differ from the decision vector by {mismatch:.1e}"),
            (front.dynamic and not objectives <= OTHER_MACHINE, f"stored objectives differ from recomputed ones by {objectives:.1e}"),
            (not abs(violation - point.violation) <= limit, f"stored violation {point.violation:.1e}, {before} {violation:.1e}"),
            (point.status != CONVERGED, f"its status is '{point.status}'"),
            (not violation <= limit, f"violates {worst} by {violation:.1e} (tolerance {limit:.0e})"),
            (not defect[i] <= tolerance, f"{again}, it ends {defect[i]:.1e} away (tolerance {tolerance:.1e})"),
            (
                front.dynamic and not simulated[i] <= tolerance,
                f"{again}, it violates {found.worst[i] or 'everything'} by {simulated[i]:.1e} (tolerance {tolerance:.1e})",
            ),
            (not missed[i] <= tolerance, f"{again}, its objectives differ by {missed[i]:.1e} (tolerance {tolerance:.1e})"),
        ]
        reasons = tuple(reason for wrong, reason in failures if wrong)
        return Check(i, mismatch, float(violation), objectives, float(defect[i]), float(simulated[i]), float(missed[i]), reasons)

    return [check(i, point) for i, point in enumerate(front)]


def _programs(front: Points, transcription: Transcription | None) -> list[NLP]:
    """The transcribed problem of each point."""
    nlps: dict[Transcription, NLP] = {}
    found = []
    for point in front:
        if point.transcription is None:
            raise ValueError("the front does not say how its problem was transcribed")
        method = transcription or from_dict(point.transcription)
        nlp = nlps[method] if method in nlps else nlps.setdefault(method, method.transcribe(front.compiled()))
        if tuple(v.name for v in nlp.variables) != tuple(v.name for v in point.variables):
            raise ValueError(
                f"the decision vector of point {point.index} ({len(point.variables)} entries) is not that of its transcription "
                f"({len(nlp.variables)} entries)"
            )
        found.append(nlp)
    return found


def _recomputed(point: Point, nlp: NLP) -> tuple[str, float, np.ndarray, float, str]:
    """What differs most between the stored trajectory and that of the decision vector, and by how much; the objectives (m,) and violation
    of the decision vector, and the constraint that is violated most."""
    mismatch, where = _mismatch(point, nlp)
    F, violation = nlp.evaluate(point.decision[None])
    violations = nlp.violations(point.decision)
    return where, mismatch, F[0], float(violation[0]), max(violations, key=lambda key: violations[key])


def _mismatch(point: Point, nlp: NLP) -> tuple[float, str]:
    """Largest scaled difference between the stored trajectory and that of the decision vector, and what differs."""
    stored, remade = point.trajectory, nlp.unpack(point.decision)
    if stored is None or list(stored) != list(remade):
        return np.inf, "phases"
    differences = {"parameters": _difference(list(stored.parameters.values()), list(remade.parameters.values()), nlp.problem.parameters)}
    for name, phase in remade.items():
        for kind, difference in _phase_differences(stored[name], phase).items():
            differences[f"{kind} of phase '{name}'"] = difference
    where = max(differences, key=lambda key: differences[key])
    return differences[where], where


PARTS = {
    "times": ("time", "state.edges", "control.edges"),
    "states": ("states", "state.coefficients"),
    "controls": ("controls", "control.coefficients"),
    "path constraints": ("paths",),
}
"""Arrays of a phase that belong together."""


def _phase_differences(one: PhaseTrajectory, two: PhaseTrajectory) -> dict[str, float]:
    span = [max(abs(two.t0), abs(two.tf), two.tf - two.t0) or 1.0]  # a phase without duration may lie at 0
    scales = dict(zip(PARTS, (span, two.state_variables, two.control_variables, two.path_limits), strict=True))
    arrays = {part: [(attrgetter(name)(one), attrgetter(name)(two)) for name in names] for part, names in PARTS.items()}
    found = {part: max(_difference(*pair, scales[part]) for pair in pairs) for part, pairs in arrays.items()}
    same_bases = (one.state.basis, one.control.basis) == (two.state.basis, two.control.basis)
    return {**found, "bases": 0.0 if same_bases else np.inf}


def _difference(one: Any, two: Any, scales: Sequence[Any]) -> float:
    """Largest difference of two arrays, columns divided by their scales; infinite where shapes differ or only one is a number."""
    a, b = np.asarray(one, dtype=float), np.asarray(two, dtype=float)
    if a.shape != b.shape:
        return np.inf
    scale = np.array([getattr(item, "scale", item) for item in scales], dtype=float)
    difference = np.where((a == b) | (np.isnan(a) & np.isnan(b)), 0.0, np.abs(a - b)) / scale
    return float(np.where(np.isnan(difference), np.inf, difference).max(initial=0.0))
