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
from transcription.trajectories.simulate import simulate
from transcription.trajectories.trajectory import PhaseTrajectory

from ..evaluation.evaluator import CONVERGED
from ..io.workers import each
from .point import Point
from .points import Points
from .verified import missed, verified

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


def verify(front: Points, *, tolerance: float, rtol: float = 1e-10) -> list[Check]:
    """Check every point of a front. Those of a vector problem, which have no trajectories to be wrong, are evaluated again."""
    stated, allowed = front.stated(), front.stats["tolerance"]
    plain = front.replace(notes=[""] * len(front))
    if isinstance(stated, CompiledVectorProblem):
        names = [v.name for v in stated.variables]
        if len(front) and [v.name for v in front.variables] != names:
            raise ValueError(f"the variables of the front are not {', '.join(names)}")
        marked = verified(plain, tolerance)
        recomputed = [(0.0, "", F, v, "") for F, v in zip(marked.simulated_F, marked.simulated_violation.tolist(), strict=True)]
        allowed = max(tolerance, allowed)
    else:
        # What is wrong with the front as such is reported before any simulation.
        programs = _programs(front)
        recomputed = [_recomputed(point, nlp) for point, nlp in zip(front, programs, strict=True)]
        alone = partial(simulate, rtol=rtol, atol=0.1 * rtol)
        marked = verified(plain, tolerance, remark=False, simulations=lambda several: each(alone, stated, [(one,) for one in several]))
    off = tolerance * _infinite(missed(marked)).max(axis=1, initial=0.0)
    defect, simulated = _infinite(marked.defect), _infinite(marked.simulated_violation)

    def check(i: int, point: Point) -> Check:
        mismatch, where, F, violation, worst = recomputed[i]
        # Where they are those of a simulation, the other one below says whether they are right.
        F = point.F if np.array_equal(point.F, front.simulated_F[i]) else F
        objectives = float(_infinite(np.abs(F - point.F) / np.maximum(1.0, np.abs(F))).max(initial=0.0))
        failures = [
            (not mismatch <= OTHER_MACHINE, f"stored {where} differ from the decision vector by {mismatch:.1e}"),
            (front.dynamic and not objectives <= OTHER_MACHINE, f"stored objectives differ from recomputed ones by {objectives:.1e}"),
            (not abs(violation - point.violation) <= allowed, f"stored violation {point.violation:.1e}, recomputed {violation:.1e}"),
            (point.status != CONVERGED, f"its status is '{point.status}'"),
            (front.dynamic and not violation <= allowed, f"violates {worst} by {violation:.1e} (tolerance {allowed:.0e})"),
            (bool(marked.notes[i]), marked.notes[i]),
        ]
        reasons = tuple(reason for wrong, reason in failures if wrong)
        return Check(i, mismatch, violation, objectives, float(defect[i]), float(simulated[i]), float(off[i]), reasons)

    return [check(i, point) for i, point in enumerate(front)]


def _infinite(values: np.ndarray) -> np.ndarray:
    """The values, those that are no numbers infinite."""
    return np.where(np.isnan(values), np.inf, values)


def _programs(front: Points) -> list[NLP]:
    """The transcribed problem of each point."""
    nlps: dict[Transcription, NLP] = {}
    found = []
    for point in front:
        if point.transcription is None:
            raise ValueError("the front does not say how its problem was transcribed")
        method = from_dict(point.transcription)
        nlp = nlps[method] if method in nlps else nlps.setdefault(method, method.transcribe(front.compiled()))
        if tuple(v.name for v in nlp.variables) != tuple(v.name for v in point.variables):
            raise ValueError(
                f"the decision vector of point {point.index} ({len(point.variables)} entries) is not that of its transcription "
                f"({len(nlp.variables)} entries)"
            )
        found.append(nlp)
    return found


def _recomputed(point: Point, nlp: NLP) -> tuple[float, str, np.ndarray, float, str]:
    """By how much the stored trajectory and that of the decision vector differ, and where most; the objectives (m,) and violation of the
    decision vector, and the constraint that is violated most."""
    F, violation = nlp.evaluate(point.decision[None])
    violations = nlp.violations(point.decision)
    return *_mismatch(point, nlp), F[0], float(violation[0]), max(violations, key=lambda key: violations[key])


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
