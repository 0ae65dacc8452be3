"""Meshes with moving edges at the switches of controls and at the ends of contacts with limits.

On a coarse mesh a switch is smeared over its element: the control leaves its bound before it and reaches the other bound behind it. Its
integral stays right, since the states depend on it. A switch is therefore placed so that a jumping control has the same integral over the
stretch. The same rule places a short pulse, which a coarse mesh shows as a hump.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from itertools import pairwise
from typing import TypeVar

import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem
from problems.problem import Problem

from ..meshed import Meshed
from ..phases.mesh import PhaseMesh
from ..trajectories.limits import paths_and_peaks
from ..trajectories.trajectory import PhaseTrajectory, Trajectory

Method = TypeVar("Method", bound=Meshed)

TAU = np.linspace(-1.0, 1.0, 65)
"""Where controls are looked at on each element."""


class BoundSide(IntEnum):
    """The label of a stretch: on the lower bound, on none, on the upper bound."""

    LOWER = -1
    INSIDE = 0
    UPPER = 1


LOWER, INSIDE, UPPER = BoundSide


@dataclass(frozen=True)
class SwitchNumbers:
    """Tolerances of a switch, and of switches that share an edge: lengths in elements, distances in spans, unless stated."""

    on_bound: float = 1e-2  # a value nearer to a bound is on it
    smeared: float = 1.25  # a switch may be smeared over so many elements
    pulse: float = 2.25  # and a pulse over so many; what takes longer is an arc of its own
    # A state, or a path constraint, is at a limit if it is nearer than this, in its own range on the phase, ...
    contact: float = 5e-3
    lasting: float = 0.5  # ... for at least so many elements. A gap of less is none.
    brief: float = 0.1  # contact with a bound of less, between two stretches inside, is a touch of one stretch
    hump: float = 0.25  # what does not get so far from a bound between two stretches on it is no pulse
    jump: float = 0.2  # that counts inside the bounds
    near: float = 0.05  # switches of two controls that are no further apart share an edge
    nearest: float = 1e-3  # so do those no further apart than this, relative to the phase; no edge is so near to an end of the phase


SWITCH = SwitchNumbers()


@dataclass(frozen=True)
class Switch:
    """One switch."""

    place: float  # relative to the phase, in (0, 1)
    before: int  # before, after: LOWER, INSIDE or UPPER
    after: int
    # In (0, 1]: 1 where two elements meet, or a single one shows both sides; less the wider it is smeared, and where an arc inside the
    # bounds begins or ends.
    certainty: float


@dataclass(frozen=True)
class Stretch:
    """A part of a phase, from `start` to `end`, relative to the phase, over samples `first` to `last`, with one label."""

    start: float
    end: float
    first: int
    last: int
    label: int

    @property
    def length(self) -> float:
        return self.end - self.start


def stretches(places: np.ndarray, values: np.ndarray) -> list[Stretch]:
    """The stretches of a control. places (N, k), values (N, k)."""
    t, marks = places.ravel(), labels(values.ravel())
    changes = np.flatnonzero(np.diff(marks))
    firsts, lasts = np.append(0, changes + 1), np.append(changes, len(t) - 1)
    ends = 0.5 * (t[changes] + t[changes + 1])
    starts, ends = np.append(t[0], ends), np.append(ends, t[-1])
    return [
        Stretch(*one) for one in zip(starts.tolist(), ends.tolist(), firsts.tolist(), lasts.tolist(), marks[firsts].tolist(), strict=True)
    ]


def switches(places: np.ndarray, values: np.ndarray) -> list[Switch]:
    """The switches of a control, in the order of time; places and values as for `stretches`."""
    t, u = places.ravel(), np.clip(values.ravel(), 0.0, 1.0)
    parts, found = _without(stretches(places, values), places, (LOWER, UPPER), INSIDE, SWITCH.brief), []
    for i, part in enumerate(parts):
        before = parts[i - 1].label if i else None
        after = parts[i + 1].label if i + 1 < len(parts) else None
        if part.label == INSIDE:
            stretch = slice(part.first, part.last + 1)
            found += _passages(part, t[stretch], u[stretch], before, after, _elements(places, part))
            found += _jumps(places, values, part)
        elif before is not None and before != INSIDE:
            found.append(Switch(part.start, before, part.label, 1.0))
    return sorted((one for one in found if t[0] < one.place < t[-1]), key=lambda one: one.place)


def contacts(places: np.ndarray, values: np.ndarray, lower: float, upper: float) -> list[Switch]:
    """Where a state or path constraint reaches and leaves its limits; a touch is from INSIDE to INSIDE. places, values (N, k)."""
    near = SWITCH.contact * float(np.ptp(values))
    if not near > 0.0 or lower == upper:
        return []
    parts = stretches(places, np.where(values <= lower + near, 0.0, np.where(values >= upper - near, 1.0, 0.5)))
    for limit in (LOWER, UPPER):
        parts = _without(parts, places, (INSIDE,), limit, SWITCH.lasting)
    # At the ends of a phase, too: a limit is often the first value, or the last.
    ends = Stretch(parts[0].start, parts[0].start, 0, 0, INSIDE), Stretch(parts[-1].end, parts[-1].end, 0, 0, INSIDE)
    parts = [one for one in _without([ends[0], *parts, ends[1]], places, (LOWER, UPPER), INSIDE, SWITCH.lasting) if one.length > 0.0]
    t, found = places.ravel(), []
    for i, part in enumerate(parts):
        if part.label == INSIDE:
            continue
        distance = (values - lower if part.label == LOWER else upper - values).ravel() / near
        before = parts[i - 1].label if i else None
        after = parts[i + 1].label if i + 1 < len(parts) else None
        start = _reached(t[part.first :: -1], distance[part.first :: -1]) if before == INSIDE else part.start
        end = _reached(t[part.last :], distance[part.last :]) if after == INSIDE else part.end
        if start >= end:
            found.append(Switch(0.5 * (part.start + part.end), INSIDE, INSIDE, 0.25))
            continue
        found += [Switch(start, before, part.label, 0.5)] if before is not None else []
        # A limit that follows at once has its own beginning.
        found += [Switch(end, part.label, after, 0.5)] if after == INSIDE else []
    return found


def _reached(t: np.ndarray, distance: np.ndarray) -> float:
    """The time of reaching a limit, extrapolated: the distance grows as a power of the time from it, which three levels determine."""
    levels = (1.0, 4.0, 16.0)
    beyond = [np.flatnonzero(distance >= level) for level in levels]
    if not all(len(one) for one in beyond):
        return float(t[0])
    near, middle, far = (
        float(np.interp(level, distance[k[0] - 1 : k[0] + 1], t[k[0] - 1 : k[0] + 1])) if k[0] else float(t[0])
        for level, k in zip(levels, beyond, strict=True)
    )
    growth = (far - middle) / (middle - near) if middle != near else np.inf
    # With a lower ratio, that of the sixth power, nothing is concluded.
    return near - (middle - near) / (growth - 1.0) if growth > 1.25 else near


def _passages(part: Stretch, t: np.ndarray, u: np.ndarray, before: int | None, after: int | None, elements: float) -> list[Switch]:
    """The switches at the ends of a stretch inside the bounds, between stretches with these labels; None for an end of the phase."""
    bound = after if before is None else before
    if bound is None:
        return []
    if elements > (SWITCH.smeared if after == -bound else SWITCH.pulse):
        ends = [Switch(part.start, before, INSIDE, 0.5)] if before is not None else []
        return ends + ([Switch(part.end, INSIDE, after, 0.5)] if after is not None else [])
    distance = u if bound == LOWER else 1.0 - u
    away = min(float(np.trapezoid(distance, t)), part.length)
    certainty = 1.0 / max(1.0, elements)
    if after == -bound:
        return [Switch(part.end - away, bound, after, certainty)]
    if not distance.max() >= SWITCH.hump:
        return []
    if before is None:
        return [Switch(part.start + away, -bound, bound, 0.5 * certainty)]
    if after is None:
        return [Switch(part.end - away, bound, -bound, 0.5 * certainty)]
    middle = float(np.trapezoid(distance * t, t) / np.trapezoid(distance, t))
    first = min(max(middle - 0.5 * away, part.start), part.end - away)
    return [Switch(first, bound, -bound, 0.5 * certainty), Switch(first + away, -bound, bound, 0.5 * certainty)]


def _jumps(places: np.ndarray, values: np.ndarray, part: Stretch) -> list[Switch]:
    """Jumps inside the bounds at edges, three times the changes beside them: controls that oscillate where they hardly matter jump, too."""
    change = np.abs(values[1:, 0] - values[:-1, -1])
    own = np.ptp(values, axis=1)
    size = values.shape[1]
    return [
        Switch(float(places[j + 1, 0]), INSIDE, INSIDE, 0.5)
        for j in np.flatnonzero((change > SWITCH.jump) & (change > 3.0 * np.maximum(own[1:], own[:-1]))).tolist()
        if part.first <= j * size and (j + 2) * size - 1 <= part.last
    ]


def labels(u: np.ndarray) -> np.ndarray:
    """LOWER, INSIDE or UPPER for values as fractions of the way from the lower to the upper bound."""
    return np.where(u <= SWITCH.on_bound, LOWER, np.where(u >= 1.0 - SWITCH.on_bound, UPPER, INSIDE))


def _elements(places: np.ndarray, part: Stretch) -> float:
    """The number of elements that a stretch covers, with fractions."""
    starts, ends = places[:, 0], places[:, -1]
    return float((np.clip(np.minimum(part.end, ends) - np.maximum(part.start, starts), 0.0, None) / (ends - starts)).sum())


def _without(parts: Sequence[Stretch], places: np.ndarray, labels: Sequence[int], around: int, least: float) -> list[Stretch]:
    """The stretches; those with one of `labels`, shorter than `least` elements and between two labelled `around`, join these."""
    kept: list[Stretch] = []
    for i, part in enumerate(parts):
        between = 0 < i < len(parts) - 1 and parts[i - 1].label == parts[i + 1].label == around
        label = around if between and part.label in labels and _elements(places, part) < least else part.label
        if kept and kept[-1].label == label:
            kept[-1] = Stretch(kept[-1].start, part.end, kept[-1].first, part.last, label)
        else:
            kept.append(Stretch(part.start, part.end, part.first, part.last, label))
    return kept


def switched(method: Method, problem: Problem | CompiledProblem, trajectory: Trajectory) -> Method | None:
    """The next method to try, on meshes whose edges lie at the switches of a trajectory's controls, and move; None if there is none.

    First, controls are constant on arcs on which they are on a bound: one that is free there has local optima in which it leaves its bound
    gradually while the edge stays behind. Called again with what that method found, switches that came or went, and edges that could move
    no further, begin anew; once they stay, all controls are free. Not every proposal is better: compare.
    """
    if not method.moves_edges:
        return None
    parameters = np.array([trajectory.parameters[v.name] for v in problem.compile().parameters])
    proposed = {phase.name: next_mesh(method, phase, trajectory[phase.name], parameters) for phase in problem.compile().phases}
    found = {name: mesh for name, mesh in proposed.items() if mesh is not None}
    return method.settled(trajectory).remeshed(found, bounded=True) if found else None


def next_mesh(method: Meshed, statement: CompiledPhase, phase: PhaseTrajectory, parameters: np.ndarray) -> PhaseMesh | None:
    """The mesh of one phase that `switched` proposes, if any; `parameters` are those of the problem."""
    if not phase.tf > phase.t0:
        return None
    edges = _Edges.of(method, phase)
    mesh, found = edges.mesh, phase_switches(phase)
    places = edge_places(found, phase_contacts(statement, phase, parameters), mesh, edges.pressed)
    # Within the ranges the solver has moved the edges itself: where a control comes near a bound slowly, it knows better.
    if edges.reach(places):
        return mesh if edges.pressed.any() else replace(mesh, constant=()) if mesh.constant else None
    if len(places) >= max(method.most_elements, 2 * method.elements):
        return None
    return with_edges(mesh, places, on_bounds(phase, found, places))


def at_switches(method: Method, trajectory: Trajectory) -> Method | None:
    """The same method on the meshes of its trajectory, with all moving edges put back at switches of controls, as the start of a finer
    mesh: the edges may have left them.

    Where an edge may move, an objective has many local optima that differ by less than what counts, since one element of high degree
    describes the end of an arc nearly as well as two do. In these, the costates are known less well.
    """
    if not method.moves_edges:
        return None
    found = {}
    for phase in trajectory.phases:
        if method.mesh_of(phase.name).moving and phase.tf > phase.t0:
            edges = _Edges.of(method, phase)
            places = edge_places(phase_switches(phase), {}, edges.mesh, edges.pressed)
            if not edges.reach(places):
                return None
            own = np.array(edges.mesh.edges)
            moved = own + edges.mesh.shares @ (np.array(places) - own[list(edges.mesh.moving)])
            found[phase.name] = replace(edges.mesh, edges=tuple(moved.tolist()))
    return method.remeshed(found) if found else None


@dataclass(frozen=True, eq=False)
class _Edges:
    """The mesh of a phase as it lies in a trajectory; its moving edges' ranges (m, 2), and whether each is at an end of it: -1, 0 or 1."""

    mesh: PhaseMesh
    pressed: np.ndarray
    ranges: np.ndarray

    @classmethod
    def of(cls, method: Meshed, phase: PhaseTrajectory) -> _Edges:
        """Those of a phase of a trajectory that the method made."""
        given = method.mesh_of(phase.name)
        mesh, ranges = given.found_in(phase.state.edges), given.ranges()
        known, (low, high) = np.array(mesh.edges)[list(mesh.moving)], ranges.T
        slack = 0.01 * (high - low)  # an edge so near to an end of its range would go on
        return cls(mesh, np.where(known <= low + slack, -1, np.where(known >= high - slack, 1, 0)), ranges)

    def reach(self, places: Sequence[float]) -> bool:
        """Whether there are as many places as moving edges, each within the range of its edge."""
        low, high = self.ranges.T
        return len(places) == len(low) and bool((low <= places).all() and (places <= high).all())


def phase_switches(phase: PhaseTrajectory) -> dict[str, list[Switch]]:
    """The switches of each control of a phase by its name; periodic controls have no bounds, and none."""
    return {name: switches(*values) for name, values in _samples(phase).items()}


def phase_contacts(statement: CompiledPhase, phase: PhaseTrajectory, parameters: np.ndarray) -> dict[str, list[Switch]]:
    """The places where each state and each path constraint of a phase reaches and leaves its limits."""
    edges = phase.control.edges
    times = edges[:-1, None] + 0.5 * (1.0 + TAU) * np.diff(edges)[:, None]
    states, controls = phase.state(np.minimum(times, edges[1:, None])), phase.controls_on_elements(TAU)
    s = np.array([phase.t0, phase.tf, *parameters])
    x, u = (values.reshape(times.size, values.shape[2]) for values in (states, controls))
    paths = paths_and_peaks(statement, x, u, times.ravel(), s)[0].reshape(*times.shape, len(statement.paths))
    places = _relative(times, phase)
    found = {f"state {v.name}": contacts(places, states[:, :, i], v.lower, v.upper) for i, v in enumerate(statement.states)}
    return found | {f"path {v.name}": contacts(places, paths[:, :, i], v.lower, v.upper) for i, v in enumerate(statement.paths)}


def on_bounds(phase: PhaseTrajectory, found: Mapping[str, Sequence[Switch]], places: Sequence[float]) -> dict[str, list[int]]:
    """The arcs between `places` on which each control is on a bound, from its switches; a periodic control has none."""
    middles = 0.5 * (np.array([0.0, *places]) + np.array([*places, 1.0]))
    arcs: dict[str, list[int]] = {v.name: [] for v in phase.control_variables if v.period}
    for name, own in found.items():
        between = [one.before if one.before == other.after else INSIDE for other, one in pairwise(own)]
        sides = [own[0].before, *between, own[-1].after] if own else [_mostly(*_samples(phase)[name])]
        arcs[name] = [j for j, k in enumerate(np.searchsorted([one.place for one in own], middles)) if sides[int(k)] != INSIDE]
    return arcs


@dataclass
class _SharedEdge:
    """Switches, of several controls, that share a place."""

    end: float
    members: list[tuple[float, float]] = field(default_factory=list)
    before: dict[str, int] = field(default_factory=dict)
    after: dict[str, int] = field(default_factory=dict)

    def add(self, control: str, switch: Switch, place: float) -> None:
        self.end = place
        self.members.append((place, switch.certainty))
        self.before.setdefault(control, switch.before)
        self.after[control] = switch.after

    @property
    def place(self) -> float:
        places, weights = np.array(self.members).T
        return float(places[0] if (places == places[0]).all() else weights @ places / weights.sum())

    @property
    def real(self) -> bool:
        """Whether the label of a control changes here, or it is inside its bounds behind it."""
        return any(self.before[name] != self.after[name] or self.after[name] == INSIDE for name in self.after)


def edge_places(
    found: Mapping[str, Sequence[Switch]], touching: Mapping[str, Sequence[Switch]], mesh: PhaseMesh, pressed: np.ndarray
) -> list[float]:
    """The places of moving edges, increasing. pressed (m,)."""
    edges = np.array(mesh.edges)
    known = edges[list(mesh.moving)]
    target = known.copy()
    for i in np.flatnonzero((pressed[:-1] > 0) & (pressed[1:] < 0)).tolist():
        target[i : i + 2] = target[i : i + 2].mean()
    groups: list[_SharedEdge] = []
    sharp = np.array([one.place for those in found.values() for one in those])

    def length(place: float) -> float:
        return float(np.diff(edges)[np.clip(np.searchsorted(edges, place, side="right") - 1, 0, mesh.elements - 1)])

    events = [(name, one) for name, those in found.items() for one in those]
    for name, those in touching.items():
        # Within an element of a control's switch, a contact with a limit begins, or ends, there.
        events += [(name, one) for one in those if (np.abs(sharp - one.place) > length(one.place)).all()]
    for control, switch in sorted(events, key=lambda pair: pair[1].place):
        near, place = max(SWITCH.nearest, SWITCH.near * length(switch.place)), switch.place
        nearest = int(np.argmin(np.abs(known - place))) if len(known) else 0
        if len(known) and abs(known[nearest] - place) <= near:
            place = float(target[nearest])
        last = groups[-1] if groups else None
        if last is None or not (place == last.end or (place - last.end <= near and control not in last.after)):
            last = _SharedEdge(place)
            groups.append(last)
        last.add(control, switch, place)
    return [one.place for one in groups if one.real and SWITCH.nearest < one.place < 1.0 - SWITCH.nearest]


def with_edges(mesh: PhaseMesh, places: Sequence[float], constant: Mapping[str, Sequence[int]]) -> PhaseMesh:
    """A mesh with moving edges at `places`; between these, controls are `constant` on arcs.

    Each arc has as many elements as the mesh has there, spread likewise. Where the mesh has no moving edges, its degrees become those of a
    mesh with moving edges, arcs on which all controls are constant have fewer elements, and the others more, if any are constant anywhere.
    """
    first, switching = not mesh.moving, any(len(arcs) for arcs in constant.values())
    index = np.arange(mesh.elements + 1.0)
    ends = np.interp([0.0, *places, 1.0], mesh.edges, index)
    edges, moving = [0.0], []
    for j, ((low, high), end) in enumerate(zip(pairwise(ends), [*places, 1.0], strict=True)):
        bang = bool(constant) and all(j in arcs for arcs in constant.values())
        count = max(1, round(high - low))
        if first:
            # Where all controls are constant, nothing but the states has to be described: four elements, or half of those there are. On
            # other arcs of controls that switch there are two more, since controls are of a lower degree than before.
            count = max(min(count, 4), round(0.5 * count)) if bang else count + (2 if switching else 0)
        edges += [*np.interp(np.linspace(low, high, count + 1)[1:-1], index, mesh.edges).tolist(), end]
        moving.append(len(edges) - 1)
    order = max(mesh.order, 4) if first else mesh.order
    held = tuple((name, tuple(arcs)) for name, arcs in constant.items())
    # On singular arcs, where controls enter linearly and hardly matter, those of the degree of the states oscillate; two degrees lower they
    # do not.
    return PhaseMesh(tuple(edges), order, order - 2 if first else mesh.control_order, tuple(moving[:-1]), held)


def _relative(times: np.ndarray, phase: PhaseTrajectory) -> np.ndarray:
    """Times as parts of a phase; 0 where it has no duration."""
    return (times - phase.t0) / ((phase.tf - phase.t0) or 1.0)


def _samples(phase: PhaseTrajectory) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Of each control with bounds: places (N, k), relative to the phase, and its values there, as fractions of the way between them."""
    edges = _relative(phase.control.edges, phase)
    places, values = edges[:-1, None] + 0.5 * (1.0 + TAU) * np.diff(edges)[:, None], phase.controls_on_elements(TAU)
    bounded = [(i, v) for i, v in enumerate(phase.control_variables) if v.span > 0 and not v.period]
    return {v.name: (places, (values[:, :, i] - v.lower) / v.span) for i, v in bounded}


def _mostly(places: np.ndarray, values: np.ndarray) -> int:
    """The bound that a control has for nine tenths of the time; INSIDE if there is none."""
    parts = stretches(places, values)
    share = {side: sum(part.length for part in parts if part.label == side) for side in (LOWER, UPPER)}
    side = max(share, key=lambda one: share[one])
    return side if share[side] >= 0.9 else INSIDE
