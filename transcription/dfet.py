"""Direct Finite Elements in Time on spectral bases.

The weak form of the dynamics on each element, with discontinuous states and controls and free values at the ends of the elements: Vasile,
"Finite elements in time: a direct transcription method for optimal control problems", AIAA 2010-8275; Ricciardi, Vasile and Maddock, IEEE
CEC 2016, eqs. (3)-(12). Written there with a slip: in eq. (8) tau is measured from the middle of the element, and the two boundary terms of
eq. (11) are different unknowns, the values at the left and at the right end.

With controls of the degree of the states this is the (l+1)-stage Gauss-Legendre implicit Runge-Kutta method: the values at the ends of the
elements converge with order 2(l+1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from problems.compiled import CompiledProblem
from problems.problem import Problem

from .assembly import Assembly
from .base import NLP, Transcription
from .dfet_phase import DFETPhase
from .dfet_tables import Tables


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

    Raises
    ------
    ValueError
        For numbers that are not positive integers, or an unknown basis.
    """

    elements: int
    order: int
    control_order: int | None = None
    basis: str = "lobatto"

    def __post_init__(self) -> None:
        least = {"elements": 1, "order": 0, "control_order": 0}
        for name, value in (("elements", self.elements), ("order", self.order), ("control_order", self.degree_of_controls)):
            if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least[name]:
                raise ValueError(f"DFET: {name} must be an integer of at least {least[name]}, not {value!r}")
        if self.basis not in ("lobatto", "bernstein"):
            raise ValueError(f"DFET: basis must be 'lobatto' or 'bernstein', not {self.basis!r}")

    @property
    def degree_of_controls(self) -> int:
        """q."""
        return self.order if self.control_order is None else self.control_order

    def transcribe(self, problem: Problem | CompiledProblem) -> NLP:
        """Write `problem` as an NLP; see `Transcription.transcribe`."""
        compiled = problem.compile() if isinstance(problem, Problem) else problem
        tables = Tables(self.order, self.degree_of_controls, self.basis)
        return Assembly(compiled, lambda phase, layout, ends: DFETPhase(self.elements, tables, phase, layout, ends)).nlp(self)
