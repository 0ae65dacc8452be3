"""The mesh of one phase: where its elements end, and the degrees of its states and controls on them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from problems.checks import check_count

SHORTEST_ELEMENT = 1e-9
"""Shortest element, relative to its phase: below, its length is mostly rounding."""


@dataclass(frozen=True, repr=False)
class PhaseMesh:
    """Elements of any lengths, of one order."""

    edges: tuple[float, ...]  # ends of the elements, relative to the phase: increasing from 0 to 1
    order: int  # degree of the states on each element
    control_order: int | None = None  # degree of the controls on each element; by default the method's own rule
    # Those of the inner edges, 1 to N - 1, whose places are variables of the NLP and begin where `edges` has them. The edges between two
    # of these, or one and an end of the phase, share the distance as they do here.
    moving: tuple[int, ...] = ()
    # Controls that have one value on some arcs: which of these, 0 to m, where m moving edges part m + 1 arcs.
    constant: tuple[tuple[str, tuple[int, ...]], ...] = ()

    def __post_init__(self) -> None:
        try:
            edges = np.array(self.edges, dtype=float)
        except (TypeError, ValueError):
            edges = np.empty((0, 0))
        if edges.ndim != 1 or len(edges) < 2 or (edges[0], edges[-1]) != (0.0, 1.0) or not (np.diff(edges) >= SHORTEST_ELEMENT).all():
            raise ValueError(f"edges of a mesh must increase from 0 to 1, by at least {SHORTEST_ELEMENT:g} each, not {self.edges!r}")
        check_count("order of a mesh", self.order, 0)
        object.__setattr__(self, "edges", tuple(edges.tolist()))
        object.__setattr__(self, "order", int(self.order))
        if self.control_order is not None:
            check_count("control_order of a mesh", self.control_order, 0)
            object.__setattr__(self, "control_order", int(self.control_order))
        object.__setattr__(self, "moving", _indices("moving edges", self.moving, 1, self.elements - 1))
        object.__setattr__(self, "constant", self._arcs(self.constant))

    def __repr__(self) -> str:
        controls = "" if self.control_order is None else f", controls of order {self.control_order}"
        moving = f", {len(self.moving)} of {self.elements - 1} inner edges moving" if self.moving else ""
        constant = "".join(f", {name} constant on {len(arcs)} of {len(self.moving) + 1} arcs" for name, arcs in self.constant)
        return f"PhaseMesh({self.elements} elements of order {self.order}{controls}{moving}{constant})"

    @classmethod
    def uniform(cls, elements: int, order: int) -> PhaseMesh:
        """Equal elements."""
        return cls(tuple(np.linspace(0.0, 1.0, elements + 1).tolist()), order)

    @classmethod
    def of(cls, given: Any) -> PhaseMesh:
        """From (edges, order) and perhaps more, or a mapping of these names. Raises ValueError for anything else."""
        if isinstance(given, PhaseMesh):
            return given
        try:
            return cls(**given) if isinstance(given, dict) else cls(*given)
        except TypeError:
            raise ValueError(f"the mesh of a phase is written (edges, order[, control_order[, moving]]), not {given!r}") from None

    @property
    def elements(self) -> int:
        """N."""
        return len(self.edges) - 1

    @property
    def places(self) -> np.ndarray:
        """The edges (N + 1,) in mean lengths of an element; exactly whole numbers for equal elements, so that bits are the same."""
        places = self.elements * np.array(self.edges)
        whole = np.rint(places)
        return np.where(np.abs(places - whole) < 1e-15 * self.elements, whole, places)

    def image(self, places: np.ndarray) -> np.ndarray:
        """Where places (k,) on equal elements, relative to the phase, lie on these: each in its element, in the same proportion."""
        own, equal = self.places, np.arange(self.elements + 1.0)
        return places if np.array_equal(own, equal) else np.interp(places, np.linspace(0.0, 1.0, self.elements + 1), self.edges)

    def inside(self, nodes: np.ndarray) -> np.ndarray:
        """Local coordinates (k,) in [-1, 1], relative to the phase: shape (N, k)."""
        places = self.places
        return (places[:-1, None] + 0.5 * (1.0 + np.asarray(nodes)) * np.diff(places)[:, None]) / self.elements

    @property
    def _ends_of_arcs(self) -> tuple[int, ...]:
        """Indices (m + 2,) of the moving edges and the two ends."""
        return (0, *self.moving, self.elements)

    @property
    def arcs(self) -> np.ndarray:
        """The arc (N,) in which each element lies."""
        return np.searchsorted(self.moving, np.arange(self.elements), side="right")

    def ranges(self) -> np.ndarray:
        """Bounds (m, 2) of the moving edges' places: two neighbours never meet; beside an end there is more room."""
        distances = np.diff(np.array(self.edges)[list(self._ends_of_arcs)])
        reach = np.full((2, len(self.moving)), 0.45)
        reach[0, :1], reach[1, -1:] = 0.9, 0.9
        places = np.array(self.edges)[list(self.moving)]
        return np.stack([places - reach[0] * distances[:-1], places + reach[1] * distances[1:]], axis=-1)

    @property
    def shares(self) -> np.ndarray:
        """Derivatives (N + 1, m) of the places of all edges by those of the moving ones."""
        knots = np.array(self.edges)[list(self._ends_of_arcs)]
        return np.array([np.interp(self.edges, knots, one) for one in np.eye(len(knots))[1:-1]]).reshape(-1, len(self.edges)).T

    def with_elements(self, edges: Sequence[float], order: int, control_order: int | None) -> PhaseMesh:
        """Other elements, and degrees on them, with the same moving edges and arcs. Raises ValueError if these are not among `edges`."""
        j = np.searchsorted(edges, [self.edges[k] - SHORTEST_ELEMENT for k in self.moving])
        if any(k >= len(edges) or abs(edges[k] - self.edges[one]) > SHORTEST_ELEMENT for k, one in zip(j, self.moving, strict=True)):
            raise ValueError("a moving edge of a mesh has to stay one of its edges")
        return PhaseMesh(tuple(edges), order, control_order, tuple(j.tolist()), self.constant)

    def found_in(self, edges: np.ndarray) -> PhaseMesh:
        """This mesh with its moving edges where a trajectory has them, whose elements end at `edges` (N + 1,): from there they can move as
        far again; else as it is."""
        if len(edges) != len(self.edges) or not self.moving or not edges[-1] > edges[0]:
            return self
        places, own, moving = (edges - edges[0]) / (edges[-1] - edges[0]), np.array(self.edges), list(self.moving)
        moved = own + self.shares @ (np.clip(places[moving], *self.ranges().T) - own[moving])
        # Beyond rounding, of times far from 0 too, it is another one.
        return replace(self, edges=tuple(moved.tolist())) if np.abs(places - moved).max() <= 1e-9 else self

    def to_dict(self) -> dict[str, Any]:
        """As plain data; what a mesh does not have is left out."""
        plain: dict[str, Any] = {"edges": list(self.edges), "order": self.order}
        if self.control_order is not None:
            plain["control_order"] = self.control_order
        if self.moving:
            plain["moving"] = list(self.moving)
        return plain | {"constant": {name: list(arcs) for name, arcs in self.constant}} if self.constant else plain

    def _arcs(self, given: Any) -> tuple[tuple[str, tuple[int, ...]], ...]:
        """The controls that are constant, sorted by name, and on which arcs. Raises ValueError if they are not such."""
        try:
            named = {str(name): arcs for name, arcs in dict(given).items()}
        except (TypeError, ValueError):
            raise ValueError(f"constant controls of a mesh must be a mapping of their names to arcs, not {given!r}") from None
        arcs = {name: _indices(f"arcs on which '{name}' is constant", named[name], 0, len(self.moving)) for name in sorted(named)}
        return tuple((name, those) for name, those in arcs.items() if those)


def _indices(what: str, given: Any, least: int, most: int) -> tuple[int, ...]:
    """Different whole numbers within a range, sorted. Raises ValueError if they are not such."""
    if not isinstance(given, Iterable) or isinstance(given, str | bytes):
        raise ValueError(f"{what} must be a sequence of whole numbers, not {given!r}")
    indices = tuple(given)
    for one in indices:
        if isinstance(one, bool) or not isinstance(one, int | np.integer) or not least <= one <= most:
            raise ValueError(f"{what} must be among {least} to {most}, not {one!r}")
    if len(set(indices)) < len(indices):
        raise ValueError(f"{what} must differ, not {given!r}")
    return tuple(sorted(map(int, indices)))


def as_meshes(given: Any) -> tuple[tuple[str, PhaseMesh], ...]:
    """Meshes by name of the phase, sorted, from a mapping or from pairs. Raises ValueError that names the phase."""
    try:
        named = {str(name): mesh for name, mesh in dict(given).items()}
    except (TypeError, ValueError):
        raise ValueError(f"mesh must be a mapping of phases' names to (edges, order), not {given!r}") from None
    meshes = []
    for name in sorted(named):
        try:
            meshes.append((name, PhaseMesh.of(named[name])))
        except ValueError as error:
            raise ValueError(f"phase '{name}': {error}") from None
    return tuple(meshes)
