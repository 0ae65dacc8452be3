"""The contract of methods on elements: any phase may have a mesh of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar, Self

import numpy as np

from problems.checks import check_count
from problems.compiled import CompiledProblem

from .base import Transcription
from .phases.mesh import PhaseMesh, as_meshes
from .trajectories.trajectory import Trajectory


class Meshed(Transcription):
    """A transcription on elements: any phase may have a mesh of its own, so that mesh refinement works on it.

    An implementation is a frozen dataclass with these three settings among others (`elements` and `order` may follow from others, or be
    constants of the class), whose `__post_init__` calls that of this class. One that goes from mesh to mesh by a rule of its own has
    `adapted`, too.

    Attributes
    ----------
    elements, order : int
        Number of equal elements, and degree of the states on them, of the phases that have no mesh of their own.
    mesh : mapping or pairs, optional
        Phases that have: name -> PhaseMesh, or what `PhaseMesh.of` takes; kept as pairs, sorted by name.
    highest_order, most_elements : int
        Limits of mesh refinement in each phase; of elements, there may be twice as many as it began with, if that is more.
    orders_controls, moves_edges : bool
        Whether the method uses the `control_order` of a mesh, and its `moving` edges and `constant` controls; what it does not use is
        refused.

    Examples
    --------
    >>> from transcription import DFET, Meshed, SingleShooting
    >>> isinstance(DFET(4, 6), Meshed), isinstance(SingleShooting(40), Meshed)
    (True, False)
    """

    elements: int
    order: int
    mesh: tuple[tuple[str, PhaseMesh], ...] | Mapping[str, Any] | None
    highest_order: ClassVar[int] = 10
    most_elements: ClassVar[int] = 40
    orders_controls: ClassVar[bool] = False
    moves_edges: ClassVar[bool] = False

    def __post_init__(self) -> None:
        name = type(self).__name__
        check_count(f"{name}: elements", self.elements, 1)
        check_count(f"{name}: order", self.order, 0)
        if self.mesh is not None:
            try:
                object.__setattr__(self, "mesh", as_meshes(self.mesh) or None)
            except ValueError as error:
                raise ValueError(f"{name}: {error}") from None
        for phase, mesh in self.meshes.items():
            if mesh.control_order is not None and not self.orders_controls:
                raise ValueError(f"{name}: phase '{phase}': the order of its controls cannot be chosen")
            if (mesh.moving or mesh.constant) and not self.moves_edges:
                raise ValueError(f"{name}: phase '{phase}': the edges of its elements cannot move, nor its controls be held constant")

    @property
    def meshes(self) -> dict[str, PhaseMesh]:
        """The phases that have a mesh of their own."""
        return dict(self.mesh or ())

    def mesh_of(self, phase: str) -> PhaseMesh:
        """The mesh of a phase, by its name."""
        return self.meshes.get(phase) or PhaseMesh.uniform(self.elements, self.order)

    def most_control_order(self, order: int) -> int:
        """The highest degree that controls may have where the states have degree `order`: what mesh refinement does not exceed."""
        return order

    def remeshed(self, meshes: Mapping[str, PhaseMesh], *, bounded: bool = False) -> Self:
        """The same method on other meshes of some phases; `bounded`: with controls that stay within their bounds between nodes, too, where
        the method has such."""
        return replace(self, mesh={**self.meshes, **meshes})  # type: ignore[type-var]

    def settled(self, trajectory: Trajectory) -> Self:
        """The same method on the meshes of a trajectory that it made: moving edges begin where they are there, and can move as far
        again. To hold them there, see `PhaseMesh.moving`."""
        meshes = {name: mesh.found_in(trajectory[name].state.edges) for name, mesh in self.meshes.items() if mesh.moving}
        return self.remeshed(meshes) if meshes else self

    def adapted(
        self, problem: CompiledProblem, trajectory: Trajectory, errors: Mapping[str, np.ndarray], of_controls: Mapping[str, np.ndarray]
    ) -> Self | None:
        """The method on the next meshes for a trajectory that it made, by a rule of its own; None where elements are cut and merged, and
        their order raised, by their errors alone.

        `errors` and `of_controls`, phase -> (N,), are those of the trajectory's elements in units of what they may be: of states, limits
        and integrals, and of controls that are described poorly. Where none is more than 1, a finer mesh is to confirm it.
        """
        return None

    def suits(self, problem: CompiledProblem) -> bool:
        """Whether no element is certainly too long for the problem, so that it cannot be transcribed."""
        return True

    def alternatives(self) -> tuple[Self, ...]:
        """Other methods on much the same meshes, to be tried where solves with this one fail."""
        return ()

    def variants(self, degree: str, **other: Any) -> tuple[Self, ...]:
        """Methods much like this one, which has a `control_order`: with `other` settings; with controls of the full degree; both; with one
        more in the setting that is the `degree` of the states."""
        full = {"control_order": None, "mesh": {name: replace(mesh, control_order=None) for name, mesh in self.meshes.items()}}
        more = {degree: self.order + 1, "mesh": {name: replace(mesh, order=mesh.order + 1) for name, mesh in self.meshes.items()}}
        found = [replace(self, **changed) for changed in (other, full, {**other, **full}, more)]  # type: ignore[type-var]
        return tuple(one for one in dict.fromkeys(found) if one != self)

    def check_phases(self, problem: CompiledProblem) -> None:
        """Raise ValueError if a mesh is given for a phase, or names a control, that the problem does not have."""
        controls = {phase.name: [v.name for v in phase.controls] for phase in problem.phases}
        for name, mesh in self.meshes.items():
            if name not in controls:
                raise ValueError(
                    f"{type(self).__name__}: a mesh is given for phase '{name}'; the phases of '{problem.name}' are {', '.join(controls)}"
                )
            for control, _ in mesh.constant:
                if control not in controls[name]:
                    known = ", ".join(controls[name]) or "none"
                    raise ValueError(f"{type(self).__name__}: phase '{name}' has no control '{control}'; its controls are {known}")

    def to_dict(self) -> dict[str, Any]:
        plain = super().to_dict()
        meshes = {name: mesh.to_dict() for name, mesh in self.meshes.items()} or None
        return plain | {"settings": plain["settings"] | {"mesh": meshes}}
