"""Explicit Runge-Kutta methods: one table of coefficients, one step, and how far a step may go.

Sources: Hairer, Norsett and Wanner, "Solving Ordinary Differential Equations I", 2nd ed., Springer 1993, II.1 (the classical methods,
tables 1.1 and 1.2) and II.5; Cooper and Verner, "Some explicit Runge-Kutta methods of high order", SIAM J. Numer. Anal. 9(3), 1972 (order 8
in 11 stages, all coefficients in Q(sqrt 21)); Hairer and Wanner, "... II", IV.2 (stability functions).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, log, sqrt
from typing import Any

import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem

from ..phases.adjoint import slopes
from ..phases.writer import state_along

UNSTABLE_GROWTH = log(1e3)
"""A mode that decays by this much really, and grows by this much in computation, is unstable."""


@dataclass(frozen=True)
class Tableau:
    """The coefficients of an explicit method of s stages."""

    name: str
    order: int  # the global error falls with this power of the step
    A: tuple[tuple[float, ...], ...]  # row i has the i coefficients of the stages before stage i
    b: tuple[float, ...]

    @property
    def c(self) -> tuple[float, ...]:
        """Places of the stages in the step, (s,): the sums of the rows of A."""
        return tuple(float(sum(row)) for row in self.A)

    @property
    def quadrature(self) -> dict[float, float]:
        """Weights of what depends on time alone, by places in the step."""
        weights = {place: sum(b for c, b in zip(self.c, self.b, strict=True) if c == place) for place in self.c}
        return {place: weight for place, weight in weights.items() if weight}

    @property
    def matrix(self) -> np.ndarray:
        """A in full, (s, s), strictly lower triangular."""
        full = np.zeros((len(self.b), len(self.b)))
        for i, row in enumerate(self.A):
            full[i, :i] = row
        return full

    @property
    def growth(self) -> np.ndarray:
        """Coefficients (s + 1,) of the stability function R(z) = 1 + z b'(1 - z A)^-1 1, from the constant term on."""
        power, terms = np.ones(len(self.b)), [1.0]
        for _ in self.b:
            terms.append(float(np.array(self.b) @ power))
            power = self.matrix @ power
        return np.array(terms)

    def stability(self, z: np.ndarray) -> np.ndarray:
        """R(z): the factor of a step of length h for y' = lambda y, where z = h lambda; any shape, complex or not."""
        return np.polynomial.polynomial.polyval(z, self.growth)

    def step(self, rates: Callable[[float, Any], Any], y: Any, h: Any) -> tuple[Any, list[Any]]:
        """One step."""
        slopes: list[Any] = []
        for c, row in zip(self.c, self.A, strict=True):
            slopes.append(rates(c, moved(y, h, row, slopes)))
        return moved(y, h, self.b, slopes), slopes


def moved(y: Any, h: Any, weights: Sequence[float], slopes: Sequence[Any]) -> Any:
    """y + h times the weighted sum of slopes, without the terms whose weight is 0."""
    for weight, slope in zip(weights, slopes, strict=True):
        if weight:
            y = y + (h * weight) * slope
    return y


def _cooper_verner() -> Tableau:
    s = sqrt(21.0)
    A = (
        (),
        (1 / 2,),
        (1 / 4, 1 / 4),
        (1 / 7, (-7 - 3 * s) / 98, (21 + 5 * s) / 49),
        ((11 + s) / 84, 0.0, (18 + 4 * s) / 63, (21 - s) / 252),
        ((5 + s) / 48, 0.0, (9 + s) / 36, (-231 + 14 * s) / 360, (63 - 7 * s) / 80),
        ((10 - s) / 42, 0.0, (-432 + 92 * s) / 315, (633 - 145 * s) / 90, (-504 + 115 * s) / 70, (63 - 13 * s) / 35),
        (1 / 14, 0.0, 0.0, 0.0, (14 - 3 * s) / 126, (13 - 3 * s) / 63, 1 / 9),
        (1 / 32, 0.0, 0.0, 0.0, (91 - 21 * s) / 576, 11 / 72, (-385 - 75 * s) / 1152, (63 + 13 * s) / 128),
        (*(1 / 14, 0.0, 0.0, 0.0, 1 / 9, (-733 - 147 * s) / 2205), *((515 + 111 * s) / 504, (-51 - 11 * s) / 56, (132 + 28 * s) / 245)),
        (
            *(0.0, 0.0, 0.0, 0.0, (-42 + 7 * s) / 18, (-18 + 28 * s) / 45),
            *((-273 - 53 * s) / 72, (301 + 53 * s) / 72, (28 - 28 * s) / 45, (49 - 7 * s) / 18),
        ),
    )
    b = (1 / 20, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 49 / 180, 16 / 45, 49 / 180, 1 / 20)
    return Tableau("rk8", 8, A, b)


TABLEAUX: dict[str, Tableau] = {
    method.name: method
    for method in (
        Tableau("euler", 1, ((),), (1.0,)),
        Tableau("midpoint", 2, ((), (1 / 2,)), (0.0, 1.0)),
        Tableau("heun", 2, ((), (1.0,)), (1 / 2, 1 / 2)),
        Tableau("kutta3", 3, ((), (1 / 2,), (-1.0, 2.0)), (1 / 6, 2 / 3, 1 / 6)),
        Tableau("rk4", 4, ((), (1 / 2,), (0.0, 1 / 2), (0.0, 0.0, 1.0)), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
        Tableau("rk38", 4, ((), (1 / 3,), (-1 / 3, 1.0), (1.0, -1.0, 1.0)), (1 / 8, 3 / 8, 3 / 8, 1 / 8)),
        _cooper_verner(),
    )
}
"""All there are: Euler, explicit midpoint, Heun (trapezoidal), Kutta's third order, the classical one, the 3/8 rule, Cooper and Verner."""


def check_steps(
    problem: CompiledProblem,
    scheme: Tableau,
    places: Mapping[str, np.ndarray],
    method: str,
    settings: Mapping[str, int],
    own: Collection[str] = (),
) -> None:
    """Raise a ValueError that names the phase, the step, the scheme and what to change, where steps cannot be stable. places (N + 1,).

    An explicit method multiplies a decaying mode of rate lambda by R(h lambda) with each step: where that is more than 1, what should
    vanish grows. Before any work only the dynamics within the bounds are known, so that only what is certain is refused: a mode that
    decays during the shortest phase there may be, and grows by a lot in these steps, at each of several points. `settings`: the number of
    intervals, or nodes, and of steps; the intervals of phases that are `own` do not follow from the former.
    """
    for phase in problem.phases:
        shares, length = np.diff(places[phase.name]), max(phase.duration[0], phase.tf.lower - phase.t0.upper)
        found = _growing(problem, phase, scheme, length * shares, phase.name in own) if length > 0 else None
        if found is None:
            continue
        (rate, name), h = found, length * float(shares.max())
        finer = np.geomspace(1.0, 1e4, 5000)
        enough = finer[np.abs(scheme.stability(rate * h / finer)) <= 1.0]
        (count, value), (_, steps) = settings.items()
        cure = "far shorter ones"
        if len(enough):
            more = "" if phase.name in own else f"{count}={ceil(value * enough[0]) + 1} or more, or "
            cure = f"{more}steps={ceil(steps * enough[0])}"
        factor = float(np.abs(scheme.stability(np.array(rate * h))))
        raise ValueError(
            f"{method}: phase '{phase.name}': steps of {h:.4g} {phase.time_unit} are too long for '{name}', which decays at a rate of "
            f"{-rate.real:.3g} per {phase.time_unit}: {scheme.name} multiplies it by {factor:.3g} in each; take {cure}"
        )


def _growing(
    problem: CompiledProblem, phase: CompiledPhase, scheme: Tableau, steps: np.ndarray, middle: bool
) -> tuple[complex, str] | None:
    """A mode that should vanish and grows in `steps` (N,), its rate and state, if there is one at each point, from the initial to the final
    or guessed states, and in the `middle` of the bounds, under low, middle and high controls."""
    length, controls = steps.sum(), phase.controls
    t0 = float(np.clip(phase.guesses.get("t0", phase.t0.upper), phase.t0.lower, phase.t0.upper))
    s = np.array([t0, t0 + length, *(problem.guesses.get(v.name, 0.5 * (v.lower + v.upper)) for v in problem.parameters)])
    first = np.array([[0.5 * sum(limits)] for limits in phase.initial])
    along = [state_along(phase, i, value, s[:1], s[1:2], np.linspace(0.0, 1.0, 5))[0] for i, value in enumerate(first)]
    x = np.vstack([np.array(along).T, *([[0.5 * (v.lower + v.upper) for v in phase.states]] if middle else [])]).repeat(3, axis=0)
    u = np.array([[v.lower + level * v.span for v in controls] for level in (0.0, 0.5, 1.0)] * (len(x) // 3)).reshape(len(x), len(controls))
    try:
        by_x = slopes(phase, x, u, np.full(len(x), t0 + 0.5 * length), s, np.zeros(phase.integrands.size1_out(0)))[0].swapaxes(1, 2)
    except RuntimeError:  # the dynamics have no derivatives
        return None
    span, found = np.array([v.span for v in phase.states]), []
    for rates, vectors in map(np.linalg.eig, by_x if np.isfinite(by_x).all() else ()):
        each = np.log(np.maximum(np.abs(scheme.stability(np.multiply.outer(steps, rates))), 1e-300))
        sums = np.cumsum(np.vstack([np.zeros(len(rates)), each]), axis=0)
        growth = (sums - np.minimum.accumulate(sums, axis=0)).max(axis=0)  # over consecutive steps: others between may let it decay
        growth = np.where((rates.real * length < -UNSTABLE_GROWTH) & (growth > UNSTABLE_GROWTH), growth, 0.0)
        if not growth.any():
            return None
        worst = int(growth.argmax())
        found.append((complex(rates[worst]), phase.states[int(np.argmax(np.abs(vectors[:, worst]) / span))].name))
    return found[0] if found else None
