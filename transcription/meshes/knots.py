"""Meshes whose edges lie at the switches of the controls, and at the ends of contacts with limits, and move with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TypeVar

import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem
from problems.problem import Problem

from ..meshed import Meshed
from ..phases.mesh import PhaseMesh
from ..trajectories.limits import paths_and_peaks
from ..trajectories.trajectory import PhaseTrajectory, Trajectory
from .switches import INSIDE, LOWER, UPPER, Switch, contacts, stretches, switches

Method = TypeVar("Method", bound=Meshed)

TAU = np.linspace(-1.0, 1.0, 65)
"""Where controls are looked at on each element."""
NEAR, NEAREST = 0.05, 1e-3
"""Switches of two controls that are no further apart than so many elements, or than this relative to the phase, share a knot; no knot
is so near to an end of the phase."""
BESIDE = 1.0
"""Elements within which a contact with a limit begins, or ends, at the switch of a control beside it."""
PRESSED = 0.01
"""A moving edge at an end of its range, but for this share of it, would go on."""
ORDER, LESS = 4, 2
"""Least degree of the states on a mesh with knots, and how much lower the degree of the controls is. On singular arcs, where controls enter
linearly and hardly matter, those of the degree of the states oscillate; two degrees lower they do not."""
ENOUGH, MORE = 4, 2
"""An arc on which all controls are constant keeps so many elements of the mesh before, but of more only half, if that is more: nothing but
the states has to be described there. Other arcs of controls that switch get so many more: there they are of a lower degree than before."""
MOSTLY = 0.9
"""Share of a phase on which a control without switches is on a bound, to count as being there."""


def switched(method: Method, problem: Problem | CompiledProblem, trajectory: Trajectory) -> Method | None:
    """The next method to try, on meshes whose edges lie at the switches of a trajectory's controls, and move.

    First, each control is constant on each arc on which it is on a bound. A control that is free there has local optima of its own, in
    which it leaves its bound gradually while the edge stays behind. Called again with what that method found: the switches that came or
    went, and edges that could move no further, begin anew; once they stay, all controls are free, so that an arc on which none should be
    constant shows. Called with what that method found: None, unless there are other switches now.

    Controls stay within their bounds between nodes, too. Elements between the switches are as fine as before, or finer, and fewer where all
    controls are on bounds. Not every proposal is better: compare.
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
    places = knots(found, phase_contacts(statement, phase, parameters), mesh, edges.pressed)
    # Within the ranges the solver has moved the edges itself: where a control comes near a bound slowly, it knows better.
    if edges.reach(places):
        return mesh if edges.pressed.any() else replace(mesh, constant=()) if mesh.constant else None
    if len(places) >= max(method.most_elements, 2 * method.elements):
        return None
    return with_knots(mesh, places, on_bounds(phase, found, places))


def at_switches(method: Method, trajectory: Trajectory) -> Method | None:
    """The same method on the meshes of a trajectory that it made, with all moving edges at switches of controls, where a finer mesh is to
    begin: its edges may have left them.

    Where an edge may move, an objective has many local optima that differ by less than what counts, since one element of high degree
    describes the end of an arc nearly as well as two do. In these, the costates are known less well.
    """
    if not method.moves_edges:
        return None
    found = {}
    for phase in trajectory.phases:
        if method.mesh_of(phase.name).moving and phase.tf > phase.t0:
            edges = _Edges.of(method, phase)
            places = knots(phase_switches(phase), {}, edges.mesh, edges.pressed)
            if not edges.reach(places):
                return None
            found[phase.name] = edges.mesh.moved(np.array(places))
    return method.remeshed(found) if found else None


@dataclass(frozen=True, eq=False)
class _Edges:
    """The mesh of a phase as it lies in a trajectory; whether its moving edges are at the lower or the upper ends of their ranges, -1 or 1,
    or within, 0; and these ranges (m, 2)."""

    mesh: PhaseMesh
    pressed: np.ndarray
    ranges: np.ndarray

    @classmethod
    def of(cls, method: Meshed, phase: PhaseTrajectory) -> _Edges:
        """Those of a phase of a trajectory that the method made."""
        given = method.mesh_of(phase.name)
        mesh, ranges = given.found_in(phase.state.edges), given.ranges()
        known, (low, high) = np.array(mesh.edges)[list(mesh.moving)], ranges.T
        slack = PRESSED * (high - low)
        return cls(mesh, np.where(known <= low + slack, -1, np.where(known >= high - slack, 1, 0)), ranges)

    def reach(self, places: Sequence[float]) -> bool:
        """Whether there are as many places as moving edges, each within the range of its edge."""
        low, high = self.ranges.T
        return len(places) == len(low) and bool((low <= places).all() and (places <= high).all())


def phase_switches(phase: PhaseTrajectory) -> dict[str, list[Switch]]:
    """The switches of each control of a phase by its name; periodic controls have no bounds, and none."""
    return {name: switches(*values) for name, values in _samples(phase).items()}


def phase_contacts(statement: CompiledPhase, phase: PhaseTrajectory, parameters: np.ndarray) -> dict[str, list[Switch]]:
    """Where each state and each path constraint of a phase reaches and leaves its limits."""
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
    """On which of the arcs between `places` each control is on a bound, from its switches; a periodic one never is."""
    middles = 0.5 * (np.array([0.0, *places]) + np.array([*places, 1.0]))
    arcs: dict[str, list[int]] = {v.name: [] for v in phase.control_variables if v.period}
    for name, own in found.items():
        between = [one.before if one.before == other.after else INSIDE for other, one in pairwise(own)]
        sides = [own[0].before, *between, own[-1].after] if own else [_mostly(*_samples(phase)[name])]
        arcs[name] = [j for j, k in enumerate(np.searchsorted([one.place for one in own], middles)) if sides[int(k)] != INSIDE]
    return arcs


@dataclass
class _Knot:
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
        """Whether a control is another one behind it."""
        return any(self.before[name] != self.after[name] or self.after[name] == INSIDE for name in self.after)


def knots(
    found: Mapping[str, Sequence[Switch]], touching: Mapping[str, Sequence[Switch]], mesh: PhaseMesh, pressed: np.ndarray
) -> list[float]:
    """Where edges are to move, increasing. pressed (m,)."""
    edges = np.array(mesh.edges)
    known = edges[list(mesh.moving)]
    target = known.copy()
    for i in np.flatnonzero((pressed[:-1] > 0) & (pressed[1:] < 0)).tolist():
        target[i : i + 2] = target[i : i + 2].mean()
    groups: list[_Knot] = []
    sharp = np.array([one.place for those in found.values() for one in those])

    def length(place: float) -> float:
        return float(np.diff(edges)[np.clip(np.searchsorted(edges, place, side="right") - 1, 0, mesh.elements - 1)])

    events = [(name, one) for name, those in found.items() for one in those]
    for name, those in touching.items():
        events += [(name, one) for one in those if (np.abs(sharp - one.place) > BESIDE * length(one.place)).all()]
    for control, switch in sorted(events, key=lambda pair: pair[1].place):
        near, place = max(NEAREST, NEAR * length(switch.place)), switch.place
        nearest = int(np.argmin(np.abs(known - place))) if len(known) else 0
        if len(known) and abs(known[nearest] - place) <= near:
            place = float(target[nearest])
        last = groups[-1] if groups else None
        if last is None or not (place == last.end or (place - last.end <= near and control not in last.after)):
            last = _Knot(place)
            groups.append(last)
        last.add(control, switch, place)
    return [one.place for one in groups if one.real and NEAREST < one.place < 1.0 - NEAREST]


def with_knots(mesh: PhaseMesh, places: Sequence[float], constant: Mapping[str, Sequence[int]]) -> PhaseMesh:
    """A mesh with moving edges at `places`; between these, controls are `constant` on arcs.

    Each arc has as many elements as the mesh has there, spread likewise. Where the mesh has no moving edges, its degrees become those of a
    mesh with knots, arcs on which all controls are constant have fewer elements, and the others more, if any are constant anywhere.
    """
    first, switching = not mesh.moving, any(len(arcs) for arcs in constant.values())
    index = np.arange(mesh.elements + 1.0)
    ends = np.interp([0.0, *places, 1.0], mesh.edges, index)
    edges, moving = [0.0], []
    for j, ((low, high), end) in enumerate(zip(pairwise(ends), [*places, 1.0], strict=True)):
        bang = bool(constant) and all(j in arcs for arcs in constant.values())
        count = max(1, round(high - low))
        if first:
            count = max(min(count, ENOUGH), round(0.5 * count)) if bang else count + (MORE if switching else 0)
        edges += [*np.interp(np.linspace(low, high, count + 1)[1:-1], index, mesh.edges).tolist(), end]
        moving.append(len(edges) - 1)
    order = max(mesh.order, ORDER) if first else mesh.order
    held = tuple((name, tuple(arcs)) for name, arcs in constant.items())
    return PhaseMesh(tuple(edges), order, order - LESS if first else mesh.control_order, tuple(moving[:-1]), held)


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
    """The bound on which a control is nearly all of the time; INSIDE if there is none."""
    parts = stretches(places, values)
    share = {side: sum(part.length for part in parts if part.label == side) for side in (LOWER, UPPER)}
    side = max(share, key=lambda one: share[one])
    return side if share[side] >= MOSTLY else INSIDE
