"""One trajectory and its mesh: whether it is good enough, and if not, the next finer mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from problems.compiled import CompiledProblem

from ..base import Meshed
from ..phases.mesh import PhaseMesh
from ..trajectories.simulate import Simulation, simulate
from ..trajectories.trajectory import Trajectory
from .errors import PhaseErrors, phase_errors

Method = TypeVar("Method", bound=Meshed)

SAFETY = 0.5
"""Share of the tolerance that the elements of a phase are to have together, were their errors equal."""
COST = 10.0
"""Multiple of the tolerance by which objectives may be off, in ranges of the front: their loss by poorly described controls is of second
order."""


@dataclass(frozen=True, eq=False)
class Verdict:
    """The independent assessment of a trajectory on its mesh.

    Attributes
    ----------
    simulation : Simulation
        Of the whole trajectory.
    errors : list of PhaseErrors
        Element by element.
    tolerance, feasible : float
        Of defects; of constraints, simulated and between nodes, in their scales.
    """

    simulation: Simulation
    errors: list[PhaseErrors]
    tolerance: float
    feasible: float

    @property
    def excess(self) -> float:
        """The largest amount by which states and path constraints leave their limits between nodes, in their scales."""
        return max((float(phase.excess.max()) for phase in self.errors), default=0.0)

    @property
    def leaving(self) -> float:
        """The same for controls."""
        return max((float(phase.leaving.max()) for phase in self.errors), default=0.0)

    @property
    def error(self) -> float:
        """The largest of defect, excess and simulated violation, in units of what they may be."""
        return max(self.simulation.max_defect / self.tolerance, max(self.excess, self.simulation.violation) / self.feasible)

    def complaints(self) -> list[str]:
        """Messages about what is not good enough, of which controls may not leave their bounds at all; empty if all is."""
        found = []
        if not self.simulation.max_defect <= self.tolerance:
            found.append(f"simulated, it ends {self.simulation.max_defect:.1e} away")
        if self.leaving > 0.0:
            found.append(f"a control leaves its bounds by {self.leaving:.1e} between nodes")
        if not self.excess <= self.feasible:
            found.append(f"a state or path constraint leaves its limits by {self.excess:.1e} between nodes")
        if not found and not self.simulation.violation <= self.feasible:
            worst = max(self.simulation.violations, key=lambda key: self.simulation.violations[key])
            found.append(f"simulated, it violates '{worst}' by {self.simulation.violation:.1e}")
        return found

    def scores(self, method: Meshed, trajectory: Trajectory, *, integrals: bool = False) -> list[np.ndarray]:
        """For each phase the error of each element (N,), in units of what it may be; that of integrals too, if wanted."""
        total = sum(float(phase.defect.sum()) for phase in self.errors)
        # What an error at one element becomes at the end of the trajectory, at least.
        growth = max(1.0, self.simulation.max_defect / total) if 0.0 < total < np.inf and np.isfinite(self.simulation.max_defect) else 1.0
        count = sum(len(phase.defect) for phase in self.errors)
        found = []
        for name, phase in zip(trajectory, self.errors, strict=True):
            lengths = np.diff(method.mesh_of(name).edges)
            parts = [
                growth * phase.defect * count / (SAFETY * self.tolerance),
                phase.excess / self.feasible,
                lengths * phase.tail**2 * count / (COST * self.tolerance),
            ]
            if integrals:
                parts.append(phase.integral * count / self.tolerance)
            found.append(np.max(parts, axis=0))
        return found

    def worst_place(self, method: Meshed, trajectory: Trajectory) -> str:
        """The place of the largest error, in words."""
        scores = self.scores(method, trajectory)
        names = list(trajectory)
        i = int(np.argmax([score.max() for score in scores]))
        j = int(np.argmax(scores[i]))
        phase, steep = trajectory[names[i]], self.errors[i].steep[j]
        time = phase.state.times(np.nan_to_num([steep]))[j, 0]
        why = "" if np.isnan(steep) else ", where a control switches or is steep"
        return f"the mesh is coarsest for phase '{names[i]}' near {time:.6g} {phase.time_unit}{why}"


def judge(problem: CompiledProblem, trajectory: Trajectory, tolerance: float, feasible: float) -> Verdict:
    """The assessment of a trajectory by an integrator a thousand times more exact than `tolerance`; see `Verdict`."""
    rtol = float(np.clip(1e-3 * tolerance, 1e-13, 1e-9))
    return Verdict(
        simulation=simulate(problem, trajectory, rtol=rtol, atol=0.1 * rtol),
        errors=phase_errors(problem, trajectory, rtol=rtol, atol=0.1 * rtol),
        tolerance=tolerance,
        feasible=feasible,
    )


def next_method(method: Method, verdict: Verdict, trajectory: Trajectory, *, integrals: bool = False) -> Method:
    """The method on finer meshes, with controls that stay within their bounds where one leaves them between nodes.

    `integrals`: refine where integrals are wrong, too. The same method where no mesh can be refined further.
    """
    finer, most = {}, max(method.most_elements, 2 * method.elements)
    scores = verdict.scores(method, trajectory, integrals=integrals)
    for name, phase, score in zip(trajectory, verdict.errors, scores, strict=True):
        old = method.mesh_of(name)
        edges, order = refine(np.array(old.edges), old.order, score, phase.rate, phase.steep, most=most, highest=method.highest_order)
        mesh = PhaseMesh(tuple(edges.tolist()), order)
        if mesh != old:
            finer[name] = mesh
    return method.remeshed(finer, bounded=verdict.leaving > 0.0)


SMOOTH = 0.8
"""Rate of decay of Legendre coefficients from which on a higher degree is worth more than shorter elements."""
SLOWEST = 1e-3
"""A rate below this is none."""
WORST_SHARE = 0.1
"""Elements whose error is at least this share of the largest are refined together."""
LAYER = 0.3
"""Half width, on [-1, 1], of the element that is put around a place where a control changes steeply."""
SHORTEST = 1e-7
"""No element is cut to less than this length, relative to its phase."""
MARGIN = 0.1
"""Distance from the ends of an element, on [-1, 1], within which it is not cut."""


def refine(
    edges: np.ndarray, order: int, error: np.ndarray, rate: np.ndarray, steep: np.ndarray, *, most: int, highest: int
) -> tuple[np.ndarray, int]:
    """A finer mesh of one phase.

    The elements of large error are refined; if none reaches the goal, those with the largest ones. Of these, the smooth ones ask for the
    order that is enough at their rate of decay, if that is not above the highest; the others are cut: around the place where a control is
    steep, else in halves.

    Parameters
    ----------
    edges : array (N + 1,)
        Increasing from 0 to 1.
    order : int
        Degree of the states on all elements.
    error : array (N,)
        What is to become at most 1. Infinite or no number: as bad as can be.
    rate : array (N,)
        At which coefficients decay with the degree; see `errors.decay_rates`.
    steep : array (N,)
        Where, on [-1, 1], a control is much steeper than elsewhere on the element; NaN if it is not.
    most, highest : int
        Number of elements, and order, that are not exceeded.

    Returns
    -------
    edges : array
        All the old ones among them.
    order : int
        The same arrays and order where nothing more may be done.
    """
    error = np.where(np.isnan(error), np.inf, error)
    marked = error >= min(1.0, WORST_SHARE * error.max(initial=0.0))
    more = np.array([degrees(e, r) for e, r in zip(error, rate, strict=True)])
    smooth = np.isnan(steep) & (rate >= SMOOTH) & (order + more <= highest)
    raised = order + int(min(more[marked & smooth].max(initial=0.0), max(2, order // 2 + 1)))
    cut = [j for j in np.flatnonzero(marked & ~smooth) if edges[j + 1] - edges[j] >= 2.0 * SHORTEST]
    worst_first = sorted(cut, key=lambda j: (-error[j], j))
    return split(edges, {int(j): cuts(steep[j]) for j in worst_first}, most), raised


def degrees(error: float, rate: float) -> float:
    """The further degrees, at least one, that bring a smooth element's error down to 1: at its ends it falls by exp(-2 rate) with each."""
    if error <= 1.0 or rate == np.inf:
        return 1.0 if np.isfinite(error) else np.inf
    return max(1.0, float(np.ceil(np.log(error) / (2.0 * rate)))) if rate > SLOWEST else np.inf


def cuts(steep: float) -> list[float]:
    """Where, on (-1, 1), to cut an element: on both sides of the place where a control is steep, else in the middle."""
    if np.isnan(steep):
        return [0.0]
    return [tau for tau in (steep - LAYER, steep + LAYER) if abs(tau) < 1.0 - MARGIN] or [0.0]


def split(edges: np.ndarray, cut: dict[int, list[float]], most: int) -> np.ndarray:
    """Cut elements, in the order in which they are given, as long as there are at most `most` elements."""
    added: list[float] = []
    for j, places in cut.items():
        if len(edges) - 1 + len(added) + len(places) > most:
            continue
        added += [edges[j] + 0.5 * (1.0 + tau) * (edges[j + 1] - edges[j]) for tau in places]
    return np.sort(np.concatenate([edges, added])) if added else edges
