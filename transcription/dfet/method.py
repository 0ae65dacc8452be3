"""Direct Finite Elements in Time on spectral bases.

The weak form of the dynamics on each element, with discontinuous states and controls and free values at the ends of the elements: Vasile,
"Finite elements in time: a direct transcription method for optimal control problems", AIAA 2010-8275; Ricciardi, Vasile and Maddock, IEEE
CEC 2016, eqs. (3)-(12). Written there with a slip: in eq. (8) tau is measured from the middle of the element, and the two boundary terms of
eq. (11) are different unknowns, the values at the left and at the right end.

With controls of the degree of the states this is the (l+1)-stage Gauss-Legendre implicit Runge-Kutta method: the values at the ends of the
elements converge with order 2(l+1).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem
from problems.problem import Problem

from ..assembly import Assembly
from ..base import NLP, Transcription
from ..phases.layout import Layout
from ..phases.mesh import PhaseMesh, as_meshes
from ..phases.writer import Ends
from .element import Tables
from .phase import DFETPhase


@dataclass(frozen=True)
class DFET(Transcription):
    """Direct Finite Elements in Time.

    Parameters
    ----------
    elements : int
        Number of equal elements of each phase, N.
    order : int
        Degree of the states on each element, l; 0 makes them constant.
    control_order : int, optional
        Degree of the controls, q; that of the states by default.
    basis : "lobatto" or "bernstein"
        Lagrange polynomials on Gauss-Lobatto nodes for states and tests and on Gauss-Legendre nodes for controls, which are then bounded at
        the nodes; or Bernstein polynomials for all three, whose coefficients bound the whole polynomial.
    mesh : mapping, optional
        Phases that have elements of their own: name -> (edges, order), edges relative to the phase, increasing from 0 to 1. The degree of
        their controls is `control_order` where that is given, else their order. The other phases have `elements` equal ones of `order`.

    Raises
    ------
    ValueError
        For numbers that are not positive integers, an unknown basis, or edges that do not increase from 0 to 1.
    """

    elements: int
    order: int
    control_order: int | None = None
    basis: str = "lobatto"
    mesh: tuple[tuple[str, PhaseMesh], ...] | Mapping[str, Any] | None = None

    def __post_init__(self) -> None:
        least = {"elements": 1, "order": 0, "control_order": 0}
        for name, value in (("elements", self.elements), ("order", self.order), ("control_order", self.degree_of_controls)):
            if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least[name]:
                raise ValueError(f"DFET: {name} must be an integer of at least {least[name]}, not {value!r}")
        if self.basis not in ("lobatto", "bernstein"):
            raise ValueError(f"DFET: basis must be 'lobatto' or 'bernstein', not {self.basis!r}")
        if self.mesh is not None:
            try:
                object.__setattr__(self, "mesh", as_meshes(self.mesh) or None)
            except ValueError as error:
                raise ValueError(f"DFET: {error}") from None

    @property
    def degree_of_controls(self) -> int:
        """q, in the phases that have no mesh of their own."""
        return self.order if self.control_order is None else self.control_order

    @property
    def meshes(self) -> dict[str, PhaseMesh]:
        """The phases that have elements of their own."""
        return dict(self.mesh or ())

    def mesh_of(self, phase: str) -> PhaseMesh:
        """The mesh of a phase, by its name."""
        return self.meshes.get(phase) or PhaseMesh.uniform(self.elements, self.order)

    def remeshed(self, meshes: Mapping[str, PhaseMesh], *, basis: str | None = None) -> DFET:
        """The same method on other meshes, and in another basis where one is given."""
        return replace(self, mesh={**self.meshes, **meshes}, basis=basis or self.basis)

    def to_dict(self) -> dict[str, Any]:
        """See `Transcription.to_dict`."""
        meshes = {name: mesh.to_dict() for name, mesh in self.meshes.items()} or None
        settings = {"elements": self.elements, "order": self.order, "control_order": self.control_order, "basis": self.basis}
        return {"method": "DFET", "settings": settings | {"mesh": meshes}}

    def transcribe(self, problem: Problem | CompiledProblem) -> NLP:
        """Write `problem` as an NLP; see `Transcription.transcribe`."""
        compiled = problem.compile() if isinstance(problem, Problem) else problem
        names = [phase.name for phase in compiled.phases]
        for name in self.meshes:
            if name not in names:
                raise ValueError(f"DFET: a mesh is given for phase '{name}'; the phases of '{compiled.name}' are {', '.join(names)}")

        for phase in compiled.phases:
            _need_derivatives(phase)

        @cache
        def tables(order: int) -> Tables:
            return Tables(order, order if self.control_order is None else self.control_order, self.basis)

        def writer(phase: CompiledPhase, layout: Layout, ends: Ends) -> DFETPhase:
            mesh = self.mesh_of(phase.name)
            return DFETPhase(mesh, tables(mesh.order), phase, layout, ends)

        return Assembly(compiled, writer).nlp(self)


def _need_derivatives(phase: CompiledPhase) -> None:
    """Raise ValueError if the dynamics have no derivatives: implicit equations cannot be solved without."""
    try:
        phase.dynamics.jacobian()
    except RuntimeError:
        raise ValueError(
            f"DFET: phase '{phase.name}': the dynamics have no derivatives; give their Callback a Jacobian, or its option 'enable_fd': True"
        ) from None
