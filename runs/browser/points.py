"""A front as plain data: its points as columns; of a point once it is selected its parameters, residuals and curves over time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from macs.front import Front
from macs.fronts.pictures.flight_plot import costate_ranges
from macs.fronts.point import Point
from macs.fronts.tables import footer, headline, parameters_of
from macs.io.text import per
from problems.compiled import Limit, Objective, Variable
from transcription.trajectories.costates import Costates, has_length
from transcription.trajectories.trajectory import PhaseTrajectory, PiecewisePolynomial, Trajectory, ran_over


@dataclass(frozen=True)
class CurveLimits:
    """How finely curves are stored. A page with 10 000 points has 15 MB with these, and opens in a second."""

    most: int = 400  # samples of a curve, on a page with few points
    fewest: int = 48  # and on one with many
    numbers: int = 3_000_000  # that all curves of a page may have together, about
    # Samples of a polynomial on one element, both ends included; of a constant or a straight line there are two.
    finest: int = 41
    coarsest: int = 3
    digits: int = 6  # of the range of a curve, to which its values are rounded
    most_digits: int = 10  # of its largest value: the rest is round-off
    # Differences of this order are stored: they are small where a curve is smooth, and take a third of the room of values, compressed.
    order: int = 3


LIMITS = CurveLimits()


def samples_of(fronts: Sequence[Front]) -> int:
    """How many samples a curve may have in a page with all points of these fronts."""
    count = sum(map(len, fronts)) * max(map(_curve_count, fronts), default=1)
    return int(np.clip(LIMITS.numbers // max(count, 1), LIMITS.fewest, LIMITS.most))


def _curve_count(front: Front) -> int:
    """Number of curves that a point has."""
    for trajectory, costates in zip(front.trajectories, front.costates, strict=True):
        if trajectory is not None:
            adjoint = 0 if costates is None else 1 + max(len(phase) for phase in costates.values())
            return sum(len(phase.names) + adjoint for phase in trajectory.phases)
    return 1


def goals_data(goals: Sequence[Objective]) -> list[dict[str, Any]]:
    """Name, unit and sense of each objective."""
    return [{"name": goal.name, "unit": goal.unit, "sense": goal.sense} for goal in goals]


def columns(front: Front) -> dict[str, Any]:
    """The points as columns, numbers in full, in the user's units and senses; None for what is not known, as "verified" of points that were
    not simulated."""
    was = front.was_simulated
    return {
        "count": len(front),
        "tolerances": finite(front.resolution),
        "parameters": [
            {"name": name, "unit": unit, "resolution": resolution if resolution > 0 else None, "values": values}
            for name, unit, resolution, values in parameters_of(front)
        ],
        "objectives": [finite(column) for column in front.objectives.T],
        "simulated": [finite(column * sign) for column, sign in zip(front.simulated_F.T, front.signs, strict=True)],
        "verified": [bool(mark) if known else None for mark, known in zip(front.verified, was, strict=True)],
        "violation": finite(front.violation),
        "defect": finite(front.defect),
        "simulated_violation": finite(front.simulated_violation),
        "optimality": list(front.optimality),
        "status": front.status.tolist(),
    }


def about(front: Front) -> dict[str, Any]:
    """The lines above and below the table of a front, and how much points may differ from their simulation."""
    below = footer(front) if len(front) else [front.message or "There is no point."]
    return {"headline": headline(front), "footer": below, "tolerance": front.stats.get("verify"), "dynamic": front.dynamic}


def curve_data(front: Front, samples: int = 160) -> dict[str, Any] | None:
    """The front as a curve, where it is known: of each of its pieces places along it with the objectives there, and its points with
    theirs; None where slopes are not known, or there are not two objectives."""
    try:
        curve = front.curve().within()
    except ValueError:
        return None
    s, h = (one[:, None] for one in curve.placed(front.F))
    pieces = []
    for part in curve.parts:
        own = np.isclose(part.places, s, rtol=0, atol=1e-9) & np.isclose(part.heights, h, rtol=0, atol=1e-9)
        points, nodes = np.nonzero(own)
        nodes, first = np.unique(nodes, return_index=True)
        at, points = part.places[nodes], points[first]
        places = np.union1d(part.spread(2 + int(samples * np.ptp(part.places))), at)
        objectives = [finite(column) for column in curve.at_parameter(places).T]
        pieces.append({"places": places.tolist(), "objectives": objectives, "points": points.tolist(), "at": at.tolist()})
    return {"pieces": pieces, "error": curve.error}


def finite(values: np.ndarray) -> list[float | None]:
    """Values as a list, None for those that are not finite."""
    return [value if np.isfinite(value) else None for value in values.tolist()]


def details(front: Front, samples: int) -> list[dict[str, Any]]:
    """What is shown of each point once it is selected."""
    return [_detail(point, samples) for point in front]


def _detail(point: Point, samples: int) -> dict[str, Any]:
    """A point's note, weights, parameters (without a trajectory all variables), residuals by constraint, excesses between nodes, curves."""
    known = {variable.name: variable for variable in point.variables}
    parameters = []
    for name, value in point.parameters.items():
        variable = known.get(name)
        bounds = {} if variable is None else {"unit": variable.unit, "lower": variable.lower, "upper": variable.upper}
        parameters.append({"name": name, "value": value, **bounds})
    return {
        "note": point.note,
        "weights": None if point.weights is None else list(point.weights.values()),
        "parameters": parameters,
        "violations": point.violations,
        "excursions": point.excursions or {},
        "phases": [] if point.trajectory is None else curves(point.trajectory, point.costates, samples),
    }


def curves(trajectory: Trajectory, costates: Costates | None, most: int) -> list[dict[str, Any]]:
    """The phases of a trajectory: states, controls, path constraints, costates and the Hamiltonian, of at most so many samples."""
    least = None if costates is None else costate_ranges(trajectory, costates)
    found = []
    for phase in trajectory.phases:
        written = _PhaseCurves(most)
        written.polynomial("state", phase.state_variables, phase.state, phase.state.on_elements, jumps=False)
        written.polynomial("control", phase.control_variables, phase.control, phase.controls_on_elements, jumps=True)
        for limit, values in zip(phase.path_limits, phase.paths.T, strict=True):
            written.add(limit.name, "path", limit.unit, limit, phase.time, values)
        lasts = has_length(trajectory, phase)
        if costates is not None and least is not None and lasts:
            _add_costates(written, phase, costates, least)
        times = {"t0": phase.t0, "tf": phase.tf, "lasts": lasts, "elements": len(phase.state.edges) - 1}
        over = {"over": ran_over(phase.time_unit), "unit": phase.time_unit}
        found.append({"name": phase.name, **over, **times, "times": written.times, "quantities": written.quantities})
    return found


def _add_costates(written: _PhaseCurves, phase: PhaseTrajectory, costates: Costates, least: Mapping[str | None, float]) -> None:
    """Add the costates of a phase and its Hamiltonian."""
    own = costates[phase.name]
    units = {variable.name: variable.unit for variable in phase.state_variables}
    variables = [Variable(name, -np.inf, np.inf, per(units[name])) for name in own.names]
    written.polynomial("costate", variables, own.polynomial, own.polynomial.on_elements, jumps=True, least=least)
    none = Limit("", -np.inf, np.inf)
    written.add("Hamiltonian", "hamiltonian", per(phase.time_unit), none, phase.time, own.hamiltonian, least[None])


class _PhaseCurves:
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
        tau = np.linspace(-1.0, 1.0, 2 if coefficients <= 2 else int(np.clip(self._most // elements, LIMITS.coarsest, LIMITS.finest)))
        times, values = polynomial.times(tau), on_elements(tau)
        if jumps:
            times, values = times.ravel(), np.concatenate(list(values))
        else:
            times = np.append(times[:, :-1].ravel(), times[-1, -1])
            values = np.concatenate([*values[:, :-1], values[-1, -1:]])
        for variable, v in zip(variables, values.T, strict=True):
            t = times
            if variable.period:  # a gap wherever it wraps around
                after = np.flatnonzero(np.abs(np.diff(v)) > 0.5 * variable.period) + 1
                t, v = np.insert(t, after, t[after]), np.insert(v, after, np.nan)
            self.add(variable.name, kind, variable.unit, variable, t, v, (least or {}).get(variable.name, 0.0))

    def add(self, name: str, kind: str, unit: str, limits: Variable | Limit, t: np.ndarray, v: np.ndarray, least: float = 0.0) -> None:
        """Add a quantity."""
        if len(t) > self._most:
            kept = thinned(v, self._most)
            t, v = t[kept], v[kept]
        place = self._known.setdefault(t.tobytes(), len(self.times))
        if place == len(self.times):
            self.times.append(differences(t))
        lower, upper = finite(np.array([limits.lower, limits.upper], dtype=float))
        about_it = {"name": name, "kind": kind, "unit": unit, "lower": lower, "upper": upper, "least": least}
        self.quantities.append({**about_it, "t": place, "v": differences(v)})


def thinned(values: np.ndarray, most: int) -> np.ndarray:
    """Indices of the samples that stay if there are to be at most `most`: of each of equal pieces the first, least, greatest and last."""
    edges = np.linspace(0, len(values), max(most // 4, 1) + 1).astype(int)
    kept: set[int] = set()
    for first, end in pairwise(edges.tolist()):
        piece = values[first:end]
        if len(piece):
            kept |= {first, end - 1}
        if not np.isnan(piece).all():
            kept |= {first + int(np.nanargmin(piece)), first + int(np.nanargmax(piece))}
    return np.array(sorted(kept))


def differences(values: np.ndarray) -> list[int | None]:
    """Rounded values as whole numbers that take little room.

    The first is the number of decimals, which may be negative. Then follow the third differences of the values times that power of ten, as
    if zeros came before the first: cumulative sums, taken three times, are the values again. None stands for a value that is not finite;
    differences pass over it.
    """
    is_finite = np.isfinite(values)
    known = values[is_finite]
    span, largest = (float(np.ptp(known)), float(np.abs(known).max())) if len(known) else (0.0, 0.0)
    unit = max(span * 10.0**-LIMITS.digits, largest * 10.0**-LIMITS.most_digits)
    decimals = int(np.clip(-np.floor(np.log10(unit)), -300, 300)) if unit > 0 else 0
    whole = np.rint(known * 10.0**decimals).astype(np.int64)
    for _ in range(LIMITS.order):
        whole = np.diff(whole, prepend=0)
    steps = iter(whole.tolist())
    return [decimals, *(next(steps) if one else None for one in is_finite)]
