"""The next finer mesh of a trajectory: by the errors of its elements, or by a density function of its states.

Zhao and Tsiotras, "Density functions for mesh refinement in numerical optimal control", J. Guidance 34(1), 2011; Chai, Savvaris, Tsourdos
and Xia, "An interactive fuzzy physical programming for solving multiobjective skip entry problem", IEEE T. Aerospace and Electronic Systems
53(5), 2017, section IV, eqs. (15)-(19). Eq. (18) is misprinted there: the curvature of a graph is |x''| / (1 + x'^2)^(3/2). The sum in eq.
(19) is taken over the states.

A density is linear on each of k cells of a phase and may jump between them: `places` (k + 1,) are the ends of the cells, and `values` (k,
2) its values at both ends of each. Only its shape counts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from problems.compiled import CompiledProblem

from ..meshed import Meshed
from ..phases.mesh import PhaseMesh
from ..trajectories.trajectory import PhaseTrajectory, Trajectory
from .errors import PhaseErrors, state_scales
from .verdict import ElementScores, Verdict

Method = TypeVar("Method", bound=Meshed)

DENSITY_FLOORS = (0.25, 0.5, 0.75, 1.0)
"""The floor of a density, as a part of its mean, and those that are tried where intervals get too long by it: none is longer than the mean
one divided by this. Where all states are straight lines their curvature is 0, but constraints, peaks and what controls do are still to be
seen there, and decays that have died out must stay stable."""
LAYERS = (0.3, 0.06, 0.012)
"""Distances, on [-1, 1], from a place where a control changes steeply, at which its element is cut: the first, or all of them where the
error is `graded`, since nothing tells how thin the layer is."""


@dataclass(frozen=True)
class RefinementNumbers:
    """Rules of refinement; errors in units of the tolerance."""

    smooth: float = 0.8  # rate of decay of Legendre coefficients from which on a higher degree is worth more than shorter elements
    worst_share: float = 0.1  # elements whose error is at least this share of the largest are refined together
    graded: float = 1e2  # error from which on elements are cut in graded lengths
    most_pieces: int = 4  # of an element: its error says little about meshes that are much finer
    merged: float = 0.1  # error that two elements may have when they are merged
    control_order: int = 3  # tried first where a lower one is not enough: from fewer coefficients no rate of decay can be seen


REFINEMENT = RefinementNumbers()


def curvatures(places: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Curvatures (k + 1, nx) of the graphs of quantities over their places, by the corrected eq. (18) and finite differences.

    Shooting knows the states best at the ends of its steps, and where controls jump at a node, states have a kink there, which no
    derivative inside a step sees but a second difference does. places (k + 1,), x (k + 1, nx).
    """
    h, slopes = np.diff(places)[:, None], np.diff(x, axis=0) / np.diff(places)[:, None]
    bends = 2.0 * np.diff(slopes, axis=0) / (h[1:] + h[:-1])
    # The slope of the parabola through three points in its middle.
    slope = (h[1:] * slopes[:-1] + h[:-1] * slopes[1:]) / (h[1:] + h[:-1])
    inner = np.abs(bends) / (1.0 + slope**2) ** 1.5
    return np.concatenate([inner[:1], inner, inner[-1:]])


def curvature_density(kappa: np.ndarray, c: float | np.ndarray = 1.0) -> np.ndarray:
    """Eq. (19), (k + 1,): the root of the sum over states of (c kappa^(1/3))^2, for curvatures (k + 1, nx)."""
    return np.sqrt(((c * np.cbrt(kappa)) ** 2).sum(axis=1))


def lowered(places: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Quantities (k + 1, nx), scaled so that no slope of a graph is larger than 1: curvature falls with the third power of slope."""
    return x / np.maximum(np.abs(np.diff(x, axis=0) / np.diff(places)[:, None]).max(axis=0), 1.0)


def trajectory_density(phase: PhaseTrajectory) -> tuple[np.ndarray, np.ndarray]:
    """The density of a phase's trajectory over relative places, from its states, which have a kink where controls jump."""
    edges = phase.state.edges
    places = (edges - edges[0]) / (edges[-1] - edges[0])
    if len(places) < 3:
        return places, np.ones((len(places) - 1, 2))
    x = lowered(places, phase.edge_states / state_scales(phase))
    # Curvatures far below the third power of this, per length of the phase, are rounding of straight lines.
    return places, 0.03 + continuous(curvature_density(curvatures(places, x)))


def continuous(values: np.ndarray) -> np.ndarray:
    """Values (k, 2) on the cells, of a density (k + 1,) at their ends."""
    return np.stack([values[:-1], values[1:]], axis=-1)


def integrals(places: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Integrals (k + 1,) of a density from the first place to each, not normalised: eq. (16)."""
    return np.append(0.0, np.cumsum(0.5 * np.diff(places) * values.sum(axis=1)))


def normalised(places: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The same density with a mean of 1: eq. (15), if the places go from 0 to 1. A density that is zero everywhere becomes constant."""
    total = integrals(places, values)[-1]
    return values * ((places[-1] - places[0]) / total) if total > 0.0 else np.ones_like(values)


def raised(places: np.ndarray, values: np.ndarray, least: float = DENSITY_FLOORS[0]) -> np.ndarray:
    """The density with a mean of 1 and values of at least `least`: a constant part of `least`, and the rest in the old shape."""
    return least + (1.0 - least) * normalised(places, values)


def equidistributed(places: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """The ends (count + 1,) of intervals that have the same share of the integral of a density each: eq. (17)."""
    total = integrals(places, values)
    if not (np.isfinite(total).all() and total[-1] > 0.0 and (values >= 0.0).all()):
        raise ValueError("a density must be finite and nowhere negative, and its integral positive")
    wanted = total[-1] * np.arange(1, count) / count
    cell = np.clip(np.searchsorted(total, wanted, side="right") - 1, 0, len(values) - 1)
    left, right = values[cell].T
    h, rest = np.diff(places)[cell], wanted - total[cell]
    # The smaller root s of left s + (right - left) s^2 / (2 h) = rest, without cancellation.
    root = np.sqrt(np.maximum(left**2 + 2.0 * rest * (right - left) / h, 0.0))
    step = np.divide(2.0 * rest, left + root, out=np.zeros_like(rest), where=left + root > 0.0)
    inner = np.minimum(places[cell] + step, places[cell + 1])
    return np.concatenate([places[:1], inner, places[-1:]])


def next_method(method: Method, verdict: Verdict, trajectory: Trajectory) -> Method:
    """The method on finer meshes, its controls bounded everywhere if one leaves its bounds between nodes; the same if none can be finer."""
    all_scores, bounded = verdict.scores(), verdict.leaving > verdict.wanted.leaving
    by_phase = dict(zip(trajectory, all_scores, strict=True))
    others, of_controls = {name: one.others for name, one in by_phase.items()}, {name: one.controls for name, one in by_phase.items()}
    own = method.adapted(verdict.problem, trajectory, others, of_controls)
    if own is not None:
        return own.remeshed({}, bounded=bounded)
    finer = {}
    for name, errors, scores in zip(trajectory, verdict.errors, all_scores, strict=True):
        old = method.mesh_of(name)
        mesh = _finer(method, old, trajectory[name], errors, scores)
        if mesh != old:
            finer[name] = mesh
    return method.remeshed(finer, bounded=bounded)


def redistributed(method: Method, problem: CompiledProblem, trajectory: Trajectory) -> Method:
    """The method with as many elements in each phase, spread by the trajectory's density; moving edges stay."""

    def next_mesh(old: PhaseMesh, phase: PhaseTrajectory, least: float) -> PhaseMesh:
        places, values = trajectory_density(phase)
        edges = equidistributed(places, raised(places, values, least), old.elements)
        return old if old.moving else PhaseMesh(tuple(edges.tolist()), old.order, old.control_order)

    return by_density(method, problem, trajectory, next_mesh)


def by_density(
    method: Method, problem: CompiledProblem, trajectory: Trajectory, next_mesh: Callable[[PhaseMesh, PhaseTrajectory, float], PhaseMesh]
) -> Method:
    """The method on the next mesh of each phase that has a duration, with the least floor of the density that suits the problem."""
    old = {name: method.mesh_of(name) for name, phase in trajectory.items() if phase.tf > phase.t0}
    for least in DENSITY_FLOORS:
        found = method.remeshed({name: next_mesh(mesh, trajectory[name], least) for name, mesh in old.items()})
        if found.suits(problem):
            break
    return found


def next_intervals(
    old: PhaseMesh, phase: PhaseTrajectory, errors: np.ndarray, of_controls: np.ndarray, degree: int, least: float, most: int
) -> PhaseMesh:
    """The next mesh of a phase, by its density: more intervals if errors (N,) require them, or if no error does."""
    places, values = trajectory_density(phase)
    right = max(errors.max(initial=0.0), of_controls.max(initial=0.0)) <= 1.0
    count = min(max(most, old.elements), int(np.ceil(1.5 * old.elements))) if right else old.elements
    curved = count * raised(places, values, least)
    # Errors of a step fall with the order and one more, those of controls of this degree twice as fast as their last coefficient.
    shorter = np.maximum(errors ** (1.0 / (old.order + 1)), of_controls ** (0.5 / max(degree, 1)))
    # A step that is too long becomes somewhat shorter than that, but no more than four times: its error says little about finer meshes.
    shorter = np.minimum(np.nan_to_num(np.where(shorter > 1.0, 1.25 * shorter, shorter), nan=4.0), 4.0)
    needed = shorter / np.diff(places)
    density = np.maximum(curved, (needed * old.elements / (len(places) - 1))[:, None])
    count = max(count, min(most, int(np.ceil(integrals(places, density)[-1] - 1e-9))))
    return PhaseMesh(tuple(equidistributed(places, density, count).tolist()), old.order)


def where_controls_gain(method: Method, verdict: Verdict, trajectory: Trajectory) -> Method:
    """The method with elements cut where other controls would gain: at the jumps of these, else in the middle; no edge moves."""
    finer = {}
    most = max((float(gain.amounts.max()) for gain in verdict.gains.values()), default=0.0)
    for name, gain in verdict.gains.items():
        old = method.mesh_of(name).found_in(trajectory[name].state.edges)
        worst_first = [int(j) for j in np.argsort(-gain.amounts, kind="stable") if gain.amounts[j] >= REFINEMENT.worst_share * most > 0]
        # Elements that are integrated in several steps are judged by these.
        if worst_first and len(gain.amounts) == old.elements:
            # Switches that are found leave fewer.
            limit = 2 * max(method.most_elements, 2 * method.elements)
            edges = split(np.array(old.edges), {j: gain.places[j].tolist() or [0.0] for j in worst_first}, limit)
            finer[name] = PhaseMesh(tuple(edges.tolist()), old.order, old.control_order)
    return method.remeshed(finer)


def _finer(method: Meshed, old: PhaseMesh, trajectory: PhaseTrajectory, errors: PhaseErrors, scores: ElementScores) -> PhaseMesh:
    """The next mesh of one phase."""
    most = max(method.most_elements, 2 * method.elements)
    degree = trajectory.control.coefficients.shape[1] - 1
    apart = method.orders_controls and degree < method.most_control_order(old.order) and bool(trajectory.control_variables)
    # Controls whose degree is that of the states get a higher one with them.
    rate = errors.rate if apart else np.minimum(errors.rate, errors.control_rate)
    rate = np.where(scores.sums > scores.states, np.minimum(rate, errors.integrand_rate), rate)
    poor = scores.controls >= min(1.0, REFINEMENT.worst_share * scores.all.max(initial=0.0))
    smooth = np.isnan(errors.steep) & (errors.control_rate >= REFINEMENT.smooth)
    # Where a higher degree of the controls alone mends what is wrong, elements need not be cut for it.
    error = np.where(apart & poor & smooth, scores.others, scores.all)
    if apart and (poor & smooth).any() and error.max(initial=0.0) < 1.0:
        edges, order = np.array(old.edges), old.order
    else:
        kept = np.isin(np.arange(len(old.edges)), old.moving)
        # Where nothing is wrong, a finer mesh is to confirm that: it has all that this one has.
        kept |= scores.all.max(initial=0.0) <= 1.0
        remain = merged(np.array(old.edges), old.order, scores.all, kept)
        before = np.array(old.edges)
        edges, order = refine(
            before, old.order, error, rate, errors.steep, most=most + int(np.count_nonzero(~remain)), highest=method.highest_order
        )
        if len(edges) > len(before) or order > old.order:
            edges = edges[~np.isin(edges, before[~remain])]
    control_order = old.control_order
    if apart and (poor & smooth).any():
        more = max(degrees(e, r) for e, r in zip(scores.controls[poor & smooth], errors.control_rate[poor & smooth], strict=True))
        raised = int(min(method.most_control_order(order), max(degree + min(more, order), REFINEMENT.control_order)))
        control_order = raised if raised > degree else control_order
    return old.with_elements(edges.tolist(), order, control_order)


def refine(
    edges: np.ndarray, order: int, error: np.ndarray, rate: np.ndarray, steep: np.ndarray, *, most: int, highest: int
) -> tuple[np.ndarray, int]:
    """A finer mesh of one phase.

    The elements of large error are refined; if none reaches the goal, those with the largest ones. Of these, the smooth ones ask for the
    order that is enough at their rate of decay, unless that is above the highest or it is cheaper to cut them; the others are cut: around
    the place where a control is steep, else into as many equal parts as their error asks for. edges (N + 1,), error (N,), rate (N,), steep
    (N,).
    """
    error = np.where(np.isnan(error), np.inf, error)
    marked = error >= min(1.0, REFINEMENT.worst_share * error.max(initial=0.0))
    more = np.array([degrees(e, r) for e, r in zip(error, rate, strict=True)])
    # Where no rate can be told and much is wrong, nothing says that one degree more would be enough.
    told = np.isfinite(rate) | (error < REFINEMENT.graded)
    smooth = marked & np.isnan(steep) & (rate >= REFINEMENT.smooth) & told & (order + more <= highest)
    extra = int(min(more[smooth].max(initial=0.0), max(2, order // 2 + 1)))
    shorter = {int(j): pieces(error[j], 2 * order) for j in np.flatnonzero(smooth)}
    room = most - (len(edges) - 1)
    if extra and len(error) * extra > (order + 1) * sum(k - 1 for k in shorter.values()) <= (order + 1) * room // 2:
        smooth, extra = np.zeros(len(error), dtype=bool), 0
    cut = [int(j) for j in np.flatnonzero(marked & ~smooth) if edges[j + 1] - edges[j] >= 1e-7]
    worst_first = sorted(cut, key=lambda j: (-error[j], j))
    places = {j: cuts(steep[j], shorter.get(j) or pieces(error[j], order + 1), bool(error[j] >= REFINEMENT.graded)) for j in worst_first}
    return split(edges, places, most), order + extra


def pieces(error: float, power: int) -> int:
    """The number of equal parts, at least two, in each of which an error that falls with this power of their length is at most 1."""
    return int(np.clip(np.ceil(error ** (1.0 / max(power, 1))), 2, REFINEMENT.most_pieces))


def degrees(error: float, rate: float) -> float:
    """The further degrees, at least one, that reduce a smooth element's error to 1: at its ends, each reduces the error by exp(-2 rate)."""
    if error <= 1.0 or rate == np.inf:
        return 1.0 if np.isfinite(error) else np.inf
    return max(1.0, float(np.ceil(np.log(error) / (2.0 * rate)))) if rate > 1e-3 else np.inf


def cuts(steep: float, parts: int = 2, graded: bool = False) -> list[float]:
    """The places on (-1, 1) to cut an element: on both sides of the place where a control is steep, else into equal parts."""
    if np.isnan(steep):
        return np.linspace(-1.0, 1.0, parts + 1)[1:-1].tolist()
    distances = LAYERS if graded else LAYERS[:1]
    if abs(steep) >= 1.0 - LAYERS[0]:
        # At an end: the layer may begin there.
        return sorted(float(np.sign(steep)) * (1.0 - distance) for distance in distances)
    return sorted(steep + side * distance for distance in distances for side in (-1.0, 1.0) if abs(steep + side * distance) < 0.9)


def split(edges: np.ndarray, cut: dict[int, list[float]], most: int) -> np.ndarray:
    """Cut elements, in the given order, as long as there are at most `most` elements."""
    added: list[float] = []
    for j, places in cut.items():
        room = most - (len(edges) - 1 + len(added))
        if len(places) > room:
            places = [0.0] if room > 0 else []
        added += [edges[j] + 0.5 * (1.0 + tau) * (edges[j + 1] - edges[j]) for tau in places]
    return np.sort(np.concatenate([edges, added])) if added else edges


def merged(edges: np.ndarray, order: int, error: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """The mask (N + 1,) of the edges that remain after merging neighbouring elements with errors far below the tolerance, unless one is
    four times as long as the other.

    `kept` (N + 1,): edges that remain in any case. No element takes part twice.
    """
    remain = np.ones(len(edges), dtype=bool)
    small = REFINEMENT.merged * 2.0 ** -(order + 2)
    j = 1
    while j < len(edges) - 1:
        lengths = edges[j] - edges[j - 1], edges[j + 1] - edges[j]
        if not kept[j] and max(error[j - 1], error[j]) < small and max(lengths) <= 4.0 * min(lengths):
            remain[j] = False
            j += 1
        j += 1
    return remain
