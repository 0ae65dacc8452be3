"""Checks of a front, point by point, by three questions, none of which trusts the search that found it.

1. Are the trajectories that are stored those of the decision vectors that are stored?
2. Does the transcription, evaluated anew, give the objectives that are stored, and a feasible point?
3. Simulated by an independent integrator, do the controls lead where the transcription says, to a feasible trajectory and to its
   objectives?
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from problems.compiled import CompiledProblem
from problems.vector import CompiledVectorProblem
from transcription import from_dict
from transcription.base import NLP, Transcription
from transcription.trajectories.simulate import simulate, worst_violation
from transcription.trajectories.trajectory import PhaseTrajectory

from ..evaluation.blackbox import evaluated_again
from ..evaluation.evaluator import CONVERGED
from .point import Point
from .points import Points
from .verified import missed, objective_scales

EQUAL = 1e-9
"""Numbers that another run of the same arithmetic on another machine may give, in scales."""


@dataclass(frozen=True)
class Check:
    """Result for one point."""

    point: int
    mismatch: float  # largest scaled difference between stored and recomputed trajectories
    violation: float  # of the transcription, evaluated anew at the stored decision
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
    """Check every point of a front. Those of a vector problem are evaluated again."""
    stated = front.stated()
    if isinstance(stated, CompiledVectorProblem):
        return _verify_rows(front, stated, tolerance)
    problem = front.compiled()
    nlps: dict[Transcription, NLP] = {}

    def nlp_of(point: Point) -> NLP:
        if point.transcription is None:
            raise ValueError("the front does not say how its problem was transcribed")
        method = transcription or from_dict(point.transcription)
        if method not in nlps:
            nlps[method] = method.transcribe(problem)
        nlp = nlps[method]
        if tuple(v.name for v in nlp.variables) != tuple(v.name for v in point.variables):
            raise ValueError(
                f"the decision vector of point {point.index} ({len(point.variables)} entries) is not that of its transcription "
                f"({len(nlp.variables)} entries)"
            )
        return nlp

    scales, limit = objective_scales(front), front.stats["tolerance"]

    def check(index: int, point: Point, nlp: NLP) -> Check:
        mismatch, where = _mismatch(point, nlp)
        objectives, violation, worst = _recomputed(point, nlp)
        defect, simulated, most, miss = _simulated(point, problem, scales, rtol, atol, method)
        failures = (
            (not mismatch <= EQUAL, f"stored {where} differ from the decision vector by {mismatch:.1e}"),
            (not objectives <= EQUAL, f"stored objectives differ from recomputed ones by {objectives:.1e}"),
            (not abs(violation - point.violation) <= limit, f"stored violation {point.violation:.1e}, recomputed {violation:.1e}"),
            (point.status != CONVERGED, f"its status is '{point.status}'"),
            (not violation <= limit, f"violates {worst} by {violation:.1e} (tolerance {limit:.0e})"),
            (not defect <= tolerance, f"simulated, it ends {defect:.1e} away (tolerance {tolerance:.1e})"),
            (not simulated <= tolerance, f"simulated, it violates {most} by {simulated:.1e} (tolerance {tolerance:.1e})"),
            (not miss <= tolerance, f"simulated, its objectives differ by {miss:.1e} (tolerance {tolerance:.1e})"),
        )
        return Check(index, mismatch, violation, objectives, defect, simulated, miss, tuple(reason for wrong, reason in failures if wrong))

    # All of them first: what is wrong with the front as such is reported before any simulation.
    programs = [nlp_of(point) for point in front]
    return [check(index, point, nlp) for index, (point, nlp) in enumerate(zip(front, programs, strict=True))]


def _verify_rows(front: Points, problem: CompiledVectorProblem, tolerance: float) -> list[Check]:
    """Checks of the points of a vector problem: each is evaluated again, and compared. There are no trajectories to be wrong."""
    names = [v.name for v in problem.variables]
    if len(front) and [v.name for v in front.variables] != names:
        raise ValueError(f"the variables of the front are not {', '.join(names)}")
    F, violation, violations = evaluated_again(problem, front.decision)
    off = np.abs(F - front.F) / np.maximum(1.0, np.abs(F))
    apart = np.abs(F - front.F) / objective_scales(front)
    off, apart = (np.where(np.isfinite(one), one, np.inf).max(axis=1, initial=0.0) for one in (off, apart))
    allowed = max(tolerance, front.stats["tolerance"])

    def check(i: int, point: Point) -> Check:
        worst = max(violations[i], key=lambda name: violations[i][name], default="")
        changed = not abs(violation[i] - point.violation) <= allowed
        failures = (
            (not np.isfinite(violation[i]), "evaluated again, it fails"),
            (not apart[i] <= tolerance, f"evaluated again, its objectives differ by {apart[i]:.1e} (tolerance {tolerance:.1e})"),
            (changed, f"stored violation {point.violation:.1e}, evaluated again {violation[i]:.1e}"),
            (point.status != CONVERGED, f"its status is '{point.status}'"),
            (not violation[i] <= allowed, f"violates {worst} by {violation[i]:.1e} (tolerance {allowed:.0e})"),
        )
        reasons = tuple(reason for wrong, reason in failures if wrong)
        return Check(i, 0.0, float(violation[i]), float(off[i]), 0.0, float(violation[i]), float(apart[i]), reasons)

    return [check(i, point) for i, point in enumerate(front)]


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


def _phase_differences(one: PhaseTrajectory, two: PhaseTrajectory) -> dict[str, float]:
    span = [max(abs(two.t0), abs(two.tf), two.tf - two.t0) or 1.0]  # a phase without duration may lie at 0
    states, controls = two.state_variables, two.control_variables
    same_bases = (one.state.basis, one.control.basis) == (two.state.basis, two.control.basis)
    return {
        "times": max(
            _difference(one.time[:, None], two.time[:, None], span),
            _difference(one.state.edges[:, None], two.state.edges[:, None], span),
            _difference(one.control.edges[:, None], two.control.edges[:, None], span),
        ),
        "states": max(
            _difference(one.states, two.states, states),
            _difference(one.state.coefficients, two.state.coefficients, states),
        ),
        "controls": max(
            _difference(one.controls, two.controls, controls),
            _difference(one.control.coefficients, two.control.coefficients, controls),
        ),
        "path constraints": _difference(one.paths, two.paths, two.path_limits),
        "bases": 0.0 if same_bases else np.inf,
    }


def _difference(one: Any, two: Any, scales: Sequence[Any]) -> float:
    """Largest difference of two arrays, columns divided by their scales; infinite where shapes differ or only one is a number."""
    a, b = np.asarray(one, dtype=float), np.asarray(two, dtype=float)
    if a.shape != b.shape:
        return np.inf
    scale = np.array([getattr(item, "scale", item) for item in scales], dtype=float)
    difference = np.where((a == b) | (np.isnan(a) & np.isnan(b)), 0.0, np.abs(a - b)) / scale
    return float(np.where(np.isnan(difference), np.inf, difference).max(initial=0.0))


def _recomputed(point: Point, nlp: NLP) -> tuple[float, float, str]:
    """How far the stored objectives are off, the violation, and the constraint that is violated most."""
    F, violation = nlp.evaluate(point.decision[None])
    off = np.abs(F[0] - point.F) / np.maximum(1.0, np.abs(F[0]))
    violations = nlp.violations(point.decision)
    return float(np.where(np.isnan(off), np.inf, off).max()), float(violation[0]), max(violations, key=lambda key: violations[key])


def _simulated(
    point: Point, problem: CompiledProblem, scales: np.ndarray, rtol: float, atol: float, method: str
) -> tuple[float, float, str, float]:
    """Largest defect and violation of the simulated controls, the constraint that is violated most, and the objectives' largest miss."""
    if point.trajectory is None:
        return np.inf, np.inf, "everything", np.inf
    found = simulate(problem, point.trajectory, rtol=rtol, atol=atol, method=method)
    worst, violation = worst_violation(problem, found)
    return found.max_defect, violation, worst, missed(found, point.objectives, scales)
