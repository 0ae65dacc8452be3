"""Collocation at Gauss, Radau, Lobatto and Chebyshev points, on one interval or many.

On each interval of length h, with points c_i in [0, 1], the states satisfy

    x(c_i) = x_0 + h sum_j a_ij f_j,    x_1 = x_0 + h sum_j b_j f_j,

where a_ij and b_j are integrals of the polynomial through the rates f_j at the points: a polynomial whose derivative is the rate at each of
them (Hairer, Norsett and Wanner, "Solving Ordinary Differential Equations I", 2nd ed., 1993, II.7). Integrals have the weights b_j, too. On
one interval this is what the literature calls global, or pseudospectral.

- "gauss": N points, neither end among them; order 2 N at the ends of intervals. Benson, Huntington, Thorvaldsen and Rao, "Direct trajectory
  optimization and costate estimation via an orthogonal collocation method", J. Guidance 29(6), 2006.
- "radau": N points, the left end among them, the right one not; order 2 N - 1. Garg et al., "Direct trajectory optimization and costate
  estimation of finite-horizon and infinite-horizon optimal control problems using a Radau pseudospectral method", Comput. Optim. Appl.
  49(2), 2011; Patterson and Rao, "GPOPS-II", ACM TOMS 41(1), 2014.
- "lobatto": N + 1 points, both ends among them; order 2 N.
- "chebyshev": N + 1 points -cos(pi k / N), both ends among them, with the weights of Clenshaw and Curtis; order N + 1, or N + 2 for even N.
  These weights integrate polynomials of degree N only, not the products of costates and controls that an optimum balances: with controls of
  the full degree, an optimum converges like a power of N (N^-2 in the controls of a quadratic cost), here as in the differential form of
  the literature. With `control_order` N/2, whose products are integrated, it converges exponentially.

For Gauss and Radau this is the differential form D X = h/2 f of the literature, where D differentiates the polynomial of degree N through
the points and the left end (Gauss), or both (Radau). The literature's differential form for Lobatto and Chebyshev points (Elnagar, Kazemi
and Razzaghi, IEEE TAC 40(10), 1995; Fahroo and Ross, J. Guidance 25(1), 2002) imposes N + 1 equations on a polynomial of degree N: one for
each state too many, so that controls do not determine a trajectory, and nothing can be propagated. Here the polynomial that is collocated
there has degree N + 1, and the states' own, of degree N, passes through its values at the points.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, replace
from typing import Any

from problems.checks import check_choice, check_count

from ..phases.mesh import PhaseMesh
from .phase import ElementsMethod
from .tables import POINTS, Tables, collocation_tables, control_degree

CONTROLS = ("polynomial", "bernstein")


@dataclass(frozen=True)
class Collocation(ElementsMethod):
    """Collocation of states and controls that are polynomials on each interval.

    Bounds of states hold at the points and at the ends of intervals, path constraints as well. Where an end is no point, controls are
    extrapolated to it by their polynomial, as the literature does for their end values. Nothing bounds this extrapolation, nor the
    polynomials between their nodes: a bound there would take freedom from the nodes and disturb the costates at them, and what leaves its
    bounds is seen by the simulation. `control="bernstein"` bounds the whole polynomial instead; refinement of a mesh changes over to it
    where a control leaves its bounds.

    Parameters
    ----------
    intervals : int
        Number of equal intervals of each phase; 1 is global collocation.
    degree : int
        N: as many points on each interval for Gauss and Radau, one more for Lobatto and Chebyshev. The states' degree.
    points : "radau", "gauss", "lobatto" or "chebyshev"
    control_order : int, optional
        Degree of the controls; by default one less than there are points, with a value at each, and never more.
    control : "polynomial" or "bernstein"
        Controls by their values at nodes, which are bounded there; or by the coefficients of Bernstein polynomials, which bound the whole
        polynomial.
    mesh : mapping, optional
        Phases that have intervals of their own: name -> (edges, degree[, control_order[, moving]]); see `PhaseMesh`.

    Raises
    ------
    ValueError
        For numbers that are not whole or too small, unknown points, controls of a higher degree than there are points for, or edges that do
        not increase from 0 to 1.

    Examples
    --------
    >>> from problems import load
    >>> from transcription import Collocation
    >>> nlp = Collocation(1, 20, points="gauss").transcribe(load("goddard"))
    >>> len(nlp.variables) >= len(nlp.free)
    True
    """

    intervals: int
    degree: int
    _: KW_ONLY
    points: str = "radau"
    control_order: int | None = None
    control: str = "polynomial"
    mesh: tuple[tuple[str, PhaseMesh], ...] | Mapping[str, Any] | None = None

    word = POINTS
    options = {"points": POINTS, "control": CONTROLS, "control_order": ()}  # noqa: RUF012 - never changed
    examples = (
        "radau:10x4 (10 intervals of degree 4), gauss:1x40 (one polynomial), lobatto:20x3:1 (controls of order 1), "
        "chebyshev:1x60, radau:20x3:bernstein"
    )

    def __post_init__(self) -> None:
        check_choice("Collocation: points", self.points, POINTS)
        check_choice("Collocation: control", self.control, CONTROLS)
        check_count("Collocation: intervals", self.intervals, 1)
        check_count("Collocation: degree", self.degree, 1)
        super().__post_init__()
        if self.control_order is not None:
            check_count("Collocation: control_order", self.control_order, 0)
            self._check_controls("control_order", self.control_order, self.degree)
        for phase, mesh in self.meshes.items():
            check_count(f"Collocation: phase '{phase}': the degree of the mesh", mesh.order, 1)
            if mesh.control_order is not None:
                self._check_controls(f"phase '{phase}': the order of the controls", mesh.control_order, mesh.order)

    def _check_controls(self, what: str, order: int, degree: int) -> None:
        most = self.most_control_order(degree)
        if order > most:
            raise ValueError(f"Collocation: {what} is {order}, but {most + 1} {self.points} points determine no more than degree {most}")

    @property
    def elements(self) -> int:  # type: ignore[override]
        """The intervals."""
        return self.intervals

    @property
    def order(self) -> int:  # type: ignore[override]
        """The degree."""
        return self.degree

    def most_control_order(self, order: int) -> int:
        return control_degree(self.points, order)

    def remeshed(self, meshes: Mapping[str, PhaseMesh], *, bounded: bool = False) -> Collocation:
        """The coefficients of Bernstein polynomials bound them; those of high degrees would lose too many digits."""
        other = super().remeshed(meshes)
        highest = max([other.degree, *(mesh.order for mesh in other.meshes.values())])
        return replace(other, control="bernstein") if bounded and highest <= self.highest_order else other

    def alternatives(self) -> tuple[Collocation, ...]:
        """The other controls; of the full degree; both; a degree more."""
        return self.variants("degree", control=next(one for one in CONTROLS if one != self.control))

    def degree_of_controls(self, order: int, own: int | None = None) -> int:
        """The degree of controls on a mesh whose own one is `own`, where states have degree `order`: no more than the points determine."""
        return min(super().degree_of_controls(order, own), self.most_control_order(order))

    def tables(self, order: int, control_order: int) -> Tables:
        return collocation_tables(self.points, order, control_order, self.control == "bernstein")
