"""Physical programming (Messac 1996): ranges of preference instead of weights; with fuzzy boundaries, Chai and others (2017)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from problems.checks import check_interval, positive
from problems.compiled import Objective

from .preference import Preference
from .preference_functions import RANGE_NAMES, FuzzyFunction, ObjectiveClass, PreferenceFunction, preference_functions
from .ranges import Ranges, check_among, named, places
from .stage import Operand, Stage, log10


@dataclass(frozen=True, repr=False)
class PhysicalProgramming(Preference):
    """Minimises log10 of the mean of preference functions, which say how ideal or tolerable each value of an objective is.

    A preference function has the same value at the k-th boundary for every objective, rises steeper from range to range, and is once
    continuously differentiable (eqs. 20-25 of Chai and others 2017, with the sign of eq. 23 mended). Below the first boundary it falls
    exponentially and stays positive. The fifth boundary is a hard limit. Ranges of objectives are not needed, and units do not matter.

    Degrees: k at the boundary J_k, linear between; below 1 the objective is ideal, above 5 unacceptable.

    Parameters
    ----------
    classes : dict
        By name: `Smaller`, `Larger`, `Value` or `Range`. An objective that is not named is free.
    beta : float
        Factor of the steps between the values at the boundaries, with one for other objectives. It is raised until each preference function
        is convex, and so monotone, on each side: `functions[name].beta`.

    Examples
    --------
    >>> from macs.decisions import PhysicalProgramming, Smaller
    >>> wish = PhysicalProgramming({"flight time": Smaller(120, 140, 170, 210, 260)})
    >>> round(float(wish.functions["flight time"](120)), 3)
    0.1
    """

    classes: Mapping[str, ObjectiveClass]
    beta: float = 1.5

    DEGREE: ClassVar[str] = "degree"
    SMALLER: ClassVar[bool] = True
    MARKS: ClassVar[tuple[tuple[float, str], ...]] = tuple((k + 0.5, name) for k, name in enumerate(RANGE_NAMES))

    def __post_init__(self) -> None:
        classes = named(self.classes, "classes")
        for name, one in classes.items():
            if not isinstance(one, ObjectiveClass) or type(one) is ObjectiveClass:
                raise ValueError(f"the class of '{name}' must be Smaller, Larger, Value or Range, not {one!r}")
        object.__setattr__(self, "classes", classes)
        check_interval("beta", self.beta, "(1, inf)")

    @cached_property
    def functions(self) -> dict[str, PreferenceFunction]:
        """The preference function of each objective, by name.

        Raises ValueError if lengths of ranges differ by too many orders of magnitude.
        """
        return dict(zip(self.classes, preference_functions(list(self.classes.values()), self.beta), strict=True))

    def minimised(self) -> dict[str, Callable[[Operand], Operand]]:
        """What is averaged, by name."""
        return dict(self.functions)

    def check(self, goals: Sequence[Objective]) -> None:
        """Raise ValueError for names that are none of these goals', and classes that go the other way."""
        self._places(goals)

    def _places(self, goals: Sequence[Objective]) -> dict[str, int]:
        found = places(self.classes, goals)
        for name, place in found.items():
            self.classes[name].check(goals[place])
        return found

    def stages(self, goals: Sequence[Objective], ranges: Ranges | None = None) -> tuple[Stage, ...]:
        found, functions = self._places(goals), self.minimised()

        def value(J: Sequence[Operand], peaks: Sequence[Operand]) -> Operand:
            return log10(sum(function(J[found[name]]) for name, function in functions.items()) / len(functions))

        def limits(J: Sequence[Operand]) -> list[Operand]:
            return [limit for name, one in self.classes.items() for limit in one.limits(J[found[name]])]

        names = tuple(words for name, one in self.classes.items() for words in one.limit_names(goals[found[name]]))
        return (Stage("log10 of preference", value, limits=limits, limit_names=names),)

    def degrees(self, goals: Sequence[Objective], ranges: Ranges | None, objectives: np.ndarray) -> np.ndarray:
        J = np.asarray(objectives, dtype=float)
        result = np.full(J.shape, np.nan)
        for name, place in self._places(goals).items():
            result[:, place] = self.classes[name].degree(J[:, place])
        return result

    def _curve_label(self) -> str:
        return "preference"

    def _curves(self, goals: Sequence[Objective], ranges: Ranges) -> list[Any]:
        from .pictures import Curve

        found, minimised = self._places(goals), self.minimised()
        curves = []
        for name, one in self.classes.items():
            crisp = self.functions[name]
            marks = [boundary for boundary, _ in crisp.boundaries]
            margin = 0.08 * (marks[-1] - marks[0])
            fuzzy = () if minimised[name] is crisp else (("fuzzy preference function", minimised[name]),)
            low, high, goal = marks[0] - margin, marks[-1] + margin, goals[found[name]]
            directed = one.SENSE is not None
            curves.append(Curve(goal, found[name], (*fuzzy, ("preference function", crisp)), low, high, tuple(marks), one.degree, directed))
        return curves


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
    >>> from macs.decisions import FuzzyPhysicalProgramming, Smaller
    >>> FuzzyPhysicalProgramming({"flight time": Smaller(120, 140, 170, 210, 260)}, spread={"flight time": 5.0}).spreads
    {'flight time': 5.0}
    """

    _: KW_ONLY
    spread: float | Mapping[str, float] = 0.1
    printed: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.spread, Mapping):
            given = {name: positive(value, f"the spread of '{name}'") for name, value in named(self.spread, "spread").items()}
            check_among(given, self.classes, "spread", "class", "classes")
            for name in self.classes:
                if name not in given:
                    raise ValueError(f"'{name}' has a class but no spread")
            object.__setattr__(self, "spread", given)
        else:
            object.__setattr__(self, "spread", positive(self.spread, "spread"))
        if not isinstance(self.printed, bool):
            raise ValueError(f"printed must be True or False, not {self.printed!r}")

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
