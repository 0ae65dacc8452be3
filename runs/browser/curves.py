"""Trajectories as curves to be drawn: states, controls, path constraints, costates and the Hamiltonian over time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from macs.fronts.pictures.flight_plot import costate_ranges
from macs.io.text import per
from problems.compiled import Limit, Variable
from transcription.trajectories.costates import Costates, PhaseCostates, has_length
from transcription.trajectories.trajectory import PhaseTrajectory, PiecewisePolynomial, Trajectory

DIGITS = 6
"""Digits of the range of a curve to which its values are rounded."""
MOST_DIGITS = 10
"""Digits of its largest value that are kept at most: the rest is round-off."""
ORDER = 3
"""Differences that are taken of the values of a curve: they are small where it is smooth, and take a third of the room."""
FINEST, COARSEST = 41, 3
"""Samples of a polynomial on one element, both ends included; of a constant or a straight line there are two."""


def curves(trajectory: Trajectory, costates: Costates | None, most: int) -> list[dict[str, Any]]:
    """The phases of a trajectory as plain data."""
    found = []
    least = None if costates is None else costate_ranges(trajectory, costates)
    for phase in trajectory.phases:
        writer = _Writer(most)
        writer.polynomial("state", phase.state_variables, phase.state, phase.state.on_elements, jumps=False)
        writer.polynomial("control", phase.control_variables, phase.control, phase.controls_on_elements, jumps=True)
        for limit, values in zip(phase.path_limits, phase.paths.T, strict=True):
            writer.add(limit.name, "path", limit.unit, limit, phase.time, values)
        if costates is not None and least is not None and has_length(trajectory, phase):
            _write_costates(writer, phase, costates[phase.name], least)
        found.append(
            {
                "name": phase.name,
                "unit": phase.time_unit,
                "t0": phase.t0,
                "tf": phase.tf,
                "lasts": has_length(trajectory, phase),
                "elements": len(phase.state.edges) - 1,
                "times": writer.times,
                "quantities": writer.quantities,
            }
        )
    return found


def _write_costates(writer: _Writer, phase: PhaseTrajectory, own: PhaseCostates, least: Mapping[str | None, float]) -> None:
    """Add the costates of a phase and its Hamiltonian."""
    units = {variable.name: variable.unit for variable in phase.state_variables}
    writer.polynomial(
        "costate",
        [Variable(name, -np.inf, np.inf, per(units[name])) for name in own.names],
        own.polynomial,
        own.polynomial.on_elements,
        jumps=True,
        least=least,
    )
    none = Limit("", -np.inf, np.inf)
    writer.add("Hamiltonian", "hamiltonian", per(phase.time_unit), none, phase.time, own.hamiltonian, least[None])


class _Writer:
    """Collects the quantities of a phase; curves with the same times share them."""

    def __init__(self, most: int) -> None:
        self.times: list[list[int | None]] = []
        self.quantities: list[dict[str, Any]] = []
        self._most = most
        self._known: dict[bytes, int] = {}

    def polynomial(
        self,
        kind: str,
        variables: Sequence[Variable],
        polynomial: PiecewisePolynomial,
        on_elements: Callable[[np.ndarray], np.ndarray],
        jumps: bool,
        least: Mapping[str | None, float] | None = None,
    ) -> None:
        """Add quantities that are polynomials on elements; without `jumps` they are continuous, and each end is sampled once."""
        elements, coefficients, _ = polynomial.coefficients.shape
        count = 2 if coefficients <= 2 else int(np.clip(self._most // elements, COARSEST, FINEST))
        tau = np.linspace(-1.0, 1.0, count)
        times, values = polynomial.times(tau), on_elements(tau)
        if jumps:
            times, values = times.ravel(), np.concatenate(list(values))
        else:
            times = np.append(times[:, :-1].ravel(), times[-1, -1])
            values = np.concatenate([*values[:, :-1], values[-1, -1:]])
        for variable, column in zip(variables, values.T, strict=True):
            t, v = _without_wraps(times, column, variable.period)
            self.add(variable.name, kind, variable.unit, variable, t, v, (least or {}).get(variable.name, 0.0))

    def add(self, name: str, kind: str, unit: str, limits: Variable | Limit, t: np.ndarray, v: np.ndarray, least: float = 0.0) -> None:
        """Add a quantity."""
        if len(t) > self._most:
            kept = thinned(v, self._most)
            t, v = t[kept], v[kept]
        key = t.tobytes()
        if key not in self._known:
            self._known[key] = len(self.times)
            self.times.append(differences(t))
        lower, upper = (float(bound) if np.isfinite(bound) else None for bound in (limits.lower, limits.upper))
        self.quantities.append(
            {
                "name": name,
                "kind": kind,
                "unit": unit,
                "lower": lower,
                "upper": upper,
                "least": least,
                "t": self._known[key],
                "v": differences(v),
            }
        )


def thinned(values: np.ndarray, most: int) -> np.ndarray:
    """Indices of the samples that stay if there are to be at most `most`: of each of equal pieces the first, least, greatest and last."""
    edges = np.linspace(0, len(values), max(most // 4, 1) + 1).astype(int)
    kept: set[int] = set()
    for first, end in pairwise(edges.tolist()):
        piece = values[first:end]
        if not len(piece):
            continue
        gaps = np.isnan(piece)
        kept |= {first, end - 1}
        if not gaps.all():
            kept |= {first + int(np.nanargmin(piece)), first + int(np.nanargmax(piece))}
    return np.array(sorted(kept))


def differences(values: np.ndarray) -> list[int | None]:
    """Values with `DIGITS` digits of their range, as whole numbers that take little room.

    The first of them is the number of decimals, which may be negative. Then follow the differences of order `ORDER` of the values times
    that power of ten, as if zeros came before the first: cumulative sums, taken so many times, are the values again. None stands for a
    value that is not finite; differences pass over it.
    """
    finite = np.isfinite(values)
    known = values[finite]
    span, largest = (float(np.ptp(known)), float(np.abs(known).max())) if len(known) else (0.0, 0.0)
    unit = max(span * 10.0**-DIGITS, largest * 10.0**-MOST_DIGITS)
    decimals = int(np.clip(-np.floor(np.log10(unit)), -300, 300)) if unit > 0 else 0
    whole = np.rint(known * 10.0**decimals).astype(np.int64)
    for _ in range(ORDER):
        whole = np.diff(whole, prepend=0)
    steps = iter(whole.tolist())
    return [decimals, *(next(steps) if is_known else None for is_known in finite)]


def _without_wraps(t: np.ndarray, v: np.ndarray, period: float | None) -> tuple[np.ndarray, np.ndarray]:
    """A curve with a gap wherever a periodic value wraps around."""
    if not period:
        return t, v
    after = np.flatnonzero(np.abs(np.diff(v)) > 0.5 * period) + 1
    return np.insert(t, after, t[after]), np.insert(v, after, np.nan)
