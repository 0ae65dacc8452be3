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
from typing import Any

from problems.checks import check_choice, check_count

from ..phases.mesh import PhaseMesh
from .phase import ElementsMethod
from .tables import Tables, dfet_tables

BASES = ("lobatto", "bernstein")


@dataclass(frozen=True)
class DFET(ElementsMethod):
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
        Phases that have elements of their own: name -> (edges, order[, control_order[, moving]]), edges relative to the phase, increasing
        from 0 to 1; see `PhaseMesh`. The degree of their controls is that of the mesh where it has one, else `control_order` where that is
        given, else their order. The other phases have `elements` equal ones of `order`.

    Raises
    ------
    ValueError
        For numbers that are not whole or too small, an unknown basis, or edges that do not increase from 0 to 1.

    Examples
    --------
    >>> from problems import load
    >>> from transcription import DFET
    >>> nlp = DFET(4, 6).transcribe(load("goddard"))
    >>> len(nlp.variables) >= len(nlp.free)
    True
    """

    elements: int
    order: int
    control_order: int | None = None
    basis: str = "lobatto"
    mesh: tuple[tuple[str, PhaseMesh], ...] | Mapping[str, Any] | None = None

    word = "dfet"
    options = {"basis": BASES, "control_order": ()}  # noqa: RUF012 - never changed
    examples = "dfet:4x6 (4 elements of order 6), dfet:4x6:bernstein, dfet:40x2:bernstein:1 (controls of order 1)"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.control_order is not None:
            check_count("DFET: control_order", self.control_order, 0)
        check_choice("DFET: basis", self.basis, BASES)

    def remeshed(self, meshes: Mapping[str, PhaseMesh], *, bounded: bool = False) -> DFET:
        """The coefficients of Bernstein polynomials bound them."""
        other = super().remeshed(meshes)
        return replace(other, basis="bernstein") if bounded else other

    def alternatives(self) -> tuple[DFET, ...]:
        """The other basis; controls of the degree of the states; both; a degree more."""
        return self.variants("order", basis=next(one for one in BASES if one != self.basis))

    def tables(self, order: int, control_order: int) -> Tables:
        return dfet_tables(order, control_order, self.basis)
