"""The next finer mesh of a trajectory, from the errors of its elements."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from problems.compiled import CompiledProblem

from ..meshed import Meshed
from ..phases.mesh import PhaseMesh
from ..trajectories.trajectory import PhaseTrajectory, Trajectory
from .density import LEAST, equidistributed, raised, trajectory_density
from .errors import PhaseErrors
from .verdict import ElementScores, Verdict

Method = TypeVar("Method", bound=Meshed)


def next_method(method: Method, verdict: Verdict, trajectory: Trajectory) -> Method:
    """The method on finer meshes, with controls that stay within their bounds where one leaves them between nodes. The same method where no
    mesh can be refined further."""
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
    """The method with as many elements in each phase as before, spread by the density of the trajectory; see `density`. Phases whose edges
    move keep theirs."""
    found = method
    for least in LEAST:
        meshes = {}
        for name, phase in trajectory.items():
            old = method.mesh_of(name)
            if phase.tf > phase.t0 and not old.moving:
                places, values = trajectory_density(phase)
                edges = equidistributed(places, raised(places, values, least), old.elements)
                meshes[name] = PhaseMesh(tuple(edges.tolist()), old.order, old.control_order)
        found = method.remeshed(meshes)
        if found.suits(problem):
            break
    return found


def where_controls_gain(method: Method, verdict: Verdict, trajectory: Trajectory) -> Method:
    """The method on meshes of which the elements are cut on which other controls would gain: where these jump, else in the middle. All
    edges stay in their places, and controls are constant nowhere."""
    finer = {}
    most = max((float(gain.amounts.max()) for gain in verdict.gains.values()), default=0.0)
    for name, gain in verdict.gains.items():
        old = method.mesh_of(name).found_in(trajectory[name].state.edges)
        worst_first = [int(j) for j in np.argsort(-gain.amounts, kind="stable") if gain.amounts[j] >= WORST_SHARE * most > 0]
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
    poor = scores.controls >= min(1.0, WORST_SHARE * scores.all.max(initial=0.0))
    smooth = np.isnan(errors.steep) & (errors.control_rate >= SMOOTH)
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
        raised = int(min(method.most_control_order(order), max(degree + min(more, order), LEAST_CONTROL_ORDER)))
        control_order = raised if raised > degree else control_order
    return old.with_elements(edges.tolist(), order, control_order)


SMOOTH = 0.8
"""Rate of decay of Legendre coefficients from which on a higher degree is worth more than shorter elements."""
SLOWEST = 1e-3
"""A rate below this is none."""
WORST_SHARE = 0.1
"""Elements whose error is at least this share of the largest are refined together."""
LAYERS = (0.3, 0.06, 0.012)
"""Distances, on [-1, 1], from a place where a control changes steeply, at which its element is cut: the first, or all of them where the
error is `GRADED`, since nothing tells how thin the layer is."""
GRADED = 1e2
"""Error, in units of what it may be, from which on elements are cut in graded lengths."""
SHORTEST = 1e-7
"""No element is cut to less than this length, relative to its phase."""
MARGIN = 0.1
"""Distance from the ends of an element, on [-1, 1], within which it is not cut."""
MOST_PIECES = 4
"""An element is cut into so many at most: its error says little about meshes that are much finer."""
MERGED, UNEVEN = 0.1, 4.0
"""Error, in units of what it may be, that two elements may have when they are merged, and how much longer than the other one may be."""
LEAST_CONTROL_ORDER = 3
"""Degree of controls that is tried first where a lower one is not enough: from fewer coefficients no rate of decay can be seen."""


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
    marked = error >= min(1.0, WORST_SHARE * error.max(initial=0.0))
    more = np.array([degrees(e, r) for e, r in zip(error, rate, strict=True)])
    # Where no rate can be told and much is wrong, nothing says that one degree more would be enough.
    told = np.isfinite(rate) | (error < GRADED)
    smooth = marked & np.isnan(steep) & (rate >= SMOOTH) & told & (order + more <= highest)
    extra = int(min(more[smooth].max(initial=0.0), max(2, order // 2 + 1)))
    shorter = {int(j): pieces(error[j], 2 * order) for j in np.flatnonzero(smooth)}
    room = most - (len(edges) - 1)
    if extra and len(error) * extra > (order + 1) * sum(k - 1 for k in shorter.values()) <= (order + 1) * room // 2:
        smooth, extra = np.zeros(len(error), dtype=bool), 0
    cut = [int(j) for j in np.flatnonzero(marked & ~smooth) if edges[j + 1] - edges[j] >= SHORTEST]
    worst_first = sorted(cut, key=lambda j: (-error[j], j))
    places = {j: cuts(steep[j], shorter.get(j) or pieces(error[j], order + 1), bool(error[j] >= GRADED)) for j in worst_first}
    return split(edges, places, most), order + extra


def pieces(error: float, power: int) -> int:
    """The number of equal parts, at least two, in each of which an error that falls with this power of their length is at most 1."""
    return int(np.clip(np.ceil(error ** (1.0 / max(power, 1))), 2, MOST_PIECES))


def degrees(error: float, rate: float) -> float:
    """The further degrees, at least one, that bring a smooth element's error down to 1: at its ends it falls by exp(-2 rate) with each."""
    if error <= 1.0 or rate == np.inf:
        return 1.0 if np.isfinite(error) else np.inf
    return max(1.0, float(np.ceil(np.log(error) / (2.0 * rate)))) if rate > SLOWEST else np.inf


def cuts(steep: float, parts: int = 2, graded: bool = False) -> list[float]:
    """Where, on (-1, 1), to cut an element: on both sides of the place where a control is steep, else into equal parts."""
    if np.isnan(steep):
        return np.linspace(-1.0, 1.0, parts + 1)[1:-1].tolist()
    distances = LAYERS if graded else LAYERS[:1]
    if abs(steep) >= 1.0 - LAYERS[0]:
        # At an end: the layer may begin there.
        return sorted(float(np.sign(steep)) * (1.0 - distance) for distance in distances)
    return sorted(steep + side * distance for distance in distances for side in (-1.0, 1.0) if abs(steep + side * distance) < 1.0 - MARGIN)


def split(edges: np.ndarray, cut: dict[int, list[float]], most: int) -> np.ndarray:
    """Cut elements, in the order in which they are given, as long as there are at most `most` elements."""
    added: list[float] = []
    for j, places in cut.items():
        room = most - (len(edges) - 1 + len(added))
        if len(places) > room:
            places = [0.0] if room > 0 else []
        added += [edges[j] + 0.5 * (1.0 + tau) * (edges[j + 1] - edges[j]) for tau in places]
    return np.sort(np.concatenate([edges, added])) if added else edges


def merged(edges: np.ndarray, order: int, error: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """The mask (N + 1,) of the edges that remain when neighbouring elements that are far better than they need to be become one.

    `kept` (N + 1,): edges that remain in any case. No element takes part twice.
    """
    remain = np.ones(len(edges), dtype=bool)
    small = MERGED * 2.0 ** -(order + 2)
    j = 1
    while j < len(edges) - 1:
        lengths = edges[j] - edges[j - 1], edges[j + 1] - edges[j]
        if not kept[j] and max(error[j - 1], error[j]) < small and max(lengths) <= UNEVEN * min(lengths):
            remain[j] = False
            j += 1
        j += 1
    return remain
