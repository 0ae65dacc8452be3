"""Fuzzy physical programming: physical programming whose boundaries are fuzzy numbers (Chai and others 2017)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass
from functools import cached_property

from problems.checks import positive, short_repr

from ..checks import named
from ..stage import Operand
from .programming import PhysicalProgramming
from .smoothing import FuzzyFunction

SPREAD = 0.1


@dataclass(frozen=True, repr=False)
class FuzzyPhysicalProgramming(PhysicalProgramming):
    """Physical programming with fuzzy boundaries: each preference function is smoothed by a Gaussian, cut off at three spreads.

    A fuzzy preference is the mean of the crisp one around J, under exp(-((t - J) / spread)^2). It is once more continuously differentiable,
    not below the crisp one, which is convex but for the ideal range of class 4S, and tends to it with the spread. The fifth boundaries are
    hard limits as without fuzziness.

    Degrees: those of `PhysicalProgramming`, at the boundaries as given.

    Parameters
    ----------
    classes, beta
        See `PhysicalProgramming`.
    spread : float or dict
        A number: in mean lengths of the objective's ranges between J_1 and J_5. A dict: by name, in the objective's unit, for each that has
        a class.
    printed : bool
        Whether the Gaussian is centred at the nearest boundary, as eq. (35) is printed: that function jumps half-way between boundaries.

    Examples
    --------
    >>> from macs import sweep
    >>> from problems import load
    >>> from transcription import DFET
    >>> front = sweep(load("goddard"), DFET(6, 6, basis="bernstein"), points=3, starts=1)
    >>> from macs.decisions import FuzzyPhysicalProgramming, Smaller
    >>> wish = FuzzyPhysicalProgramming({"flight time": Smaller(120, 140, 170, 210, 260)}, spread={"flight time": 5.0})
    >>> print(wish.rank(front).order)  # best first
    [0 1 2]
    """

    _: KW_ONLY
    spread: float | Mapping[str, float] = SPREAD
    printed: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.spread, Mapping):
            given = {name: positive(value, f"the spread of '{name}'") for name, value in named(self.spread, "spread").items()}
            for name in given:
                if name not in self.classes:
                    raise ValueError(f"'{name}' has a spread but no class; there are classes of {', '.join(self.classes)}")
            for name in self.classes:
                if name not in given:
                    raise ValueError(f"'{name}' has a class but no spread")
            object.__setattr__(self, "spread", given)
        else:
            object.__setattr__(self, "spread", positive(self.spread, "spread"))
        if not isinstance(self.printed, bool):
            raise ValueError(f"printed must be True or False, not {self.printed!r}")

    __repr__ = short_repr

    @property
    def spreads(self) -> dict[str, float]:
        """The spread of each objective in its unit, by name."""
        if isinstance(self.spread, Mapping):
            return dict(self.spread)
        lengths = {name: [float(side.lengths.mean()) for side in one.sides] for name, one in self.classes.items()}
        return {name: self.spread * sum(both) / len(both) for name, both in lengths.items()}

    @cached_property
    def fuzzy_functions(self) -> dict[str, FuzzyFunction]:
        """The fuzzy preference function of each objective, by name."""
        return {name: FuzzyFunction(crisp, self.spreads[name], self.printed) for name, crisp in self.functions.items()}

    def minimised(self) -> dict[str, Callable[[Operand], Operand]]:
        return dict(self.fuzzy_functions)
