"""Trajectories: states and controls, interpolated by the polynomials of the method that made them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import ClassVar, TypeVar

import numpy as np

from problems.compiled import Limit, Variable

from ..numerics.polynomials import basis_matrix

Item = TypeVar("Item")
LENGTHS, ANGLES = {"m", "km", "cm", "mm", "ft", "mi", "nmi", "AU"}, {"rad", "deg", "°", "rev"}
"""Units by which a phase runs over something else than time."""


def ran_over(unit: str) -> str:
    """What a phase runs over, by its `time_unit`."""
    return "distance" if unit in LENGTHS else "angle" if unit in ANGLES else "time"


def moment(at: str, unit: str) -> str:
    """A time for messages, or a distance or an angle where a phase runs over these."""
    over = ran_over(unit)
    return f"{'t =' if over == 'time' else over} {at} {unit}".rstrip()


@dataclass(frozen=True, eq=False, repr=False)
class PiecewisePolynomial:
    """Polynomials on consecutive elements, right-continuous.

    Parameters
    ----------
    edges : array (N + 1,)
        Increasing ends of the elements, in time.
    coefficients : array (N, degree + 1, k)
        Of `k` quantities in the basis, on each element.
    basis : str
        One of `polynomials.BASES`: "lobatto", "legendre" (values at those nodes) or "bernstein".

    Examples
    --------
    >>> import numpy as np
    >>> from transcription import PiecewisePolynomial
    >>> line = PiecewisePolynomial(np.array([0.0, 1.0]), np.array([[[0.0], [2.0]]]), "lobatto")
    >>> float(line(0.5)[0])
    1.0
    """

    edges: np.ndarray
    coefficients: np.ndarray
    basis: str

    def __repr__(self) -> str:
        elements, coefficients, quantities = self.coefficients.shape
        ends = f"from {self.edges[0]:g} to {self.edges[-1]:g}"
        return f"PiecewisePolynomial({quantities} of degree {coefficients - 1} on {elements} elements {ends})"

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """Values at `times` (any shape), with a last axis of length k. Times outside the elements use the nearest element."""
        times = np.asarray(times, dtype=float)
        flat = times.ravel()
        # Not by np.clip, which takes longer than all the rest of a single time.
        element = np.minimum(np.maximum(self.edges.searchsorted(flat, side="right") - 1, 0), len(self.edges) - 2)
        left, right = self.edges[element], self.edges[element + 1]
        length = np.where(right > left, right - left, 1.0)
        values = basis_matrix(self.basis, self.coefficients.shape[1] - 1, 2.0 * (flat - left) / length - 1.0)
        return np.einsum("ni,nik->nk", values, self.coefficients[element]).reshape(*times.shape, self.coefficients.shape[2])

    def times(self, tau: np.ndarray) -> np.ndarray:
        """Times (N, len(tau)) of local coordinates `tau` in [-1, 1] on each element."""
        return self.edges[:-1, None] + 0.5 * (1.0 + tau) * np.diff(self.edges)[:, None]

    def on_element(self, j: int, tau: np.ndarray) -> np.ndarray:
        """Values on element `j` at local coordinates `tau` in [-1, 1], shape (len(tau), k): its own polynomial also at both ends."""
        return basis_matrix(self.basis, self.coefficients.shape[1] - 1, tau) @ self.coefficients[j]

    def on_elements(self, tau: np.ndarray) -> np.ndarray:
        """The same on every element, shape (N, len(tau), k)."""
        return basis_matrix(self.basis, self.coefficients.shape[1] - 1, tau) @ self.coefficients

    def on(self, elements: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Values on `elements` (n,) at local coordinates `tau` (n, p) of each, shape (n, p, k)."""
        values = basis_matrix(self.basis, self.coefficients.shape[1] - 1, tau.ravel())
        return values.reshape(*tau.shape, -1) @ self.coefficients[elements]

    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Values (N, k) at the beginning and at the end of each element, also where elements have no length."""
        ends = self.on_elements(np.array([-1.0, 1.0]))
        return ends[:, 0], ends[:, 1]


@dataclass(frozen=True, eq=False, repr=False)
class PhaseTrajectory:
    """One phase of a trajectory, at nodes and between them.

    `time` (n,) increases strictly and contains the ends of the elements and the points in between at which the method imposes the dynamics;
    `states` (n, nx), `controls` (n, nu) and `paths` (n, npath) are the values there; `state`, which is continuous, and `control`
    interpolate. A periodic control is continued beyond its bounds inside an element, so that it interpolates the short way round. All in
    the user's units.

    Parameters
    ----------
    name, time_unit : str
    time, states, controls, paths : array
    state, control : PiecewisePolynomial
    state_variables, control_variables : tuple of Variable
    path_limits : tuple of Limit

    Examples
    --------
    >>> from macs import sweep
    >>> from problems import load
    >>> from transcription import DFET
    >>> front = sweep(load("goddard"), DFET(6, 6, basis="bernstein"), points=3, starts=1)
    >>> flight = front[1].trajectory["ascent"]
    >>> print(len(flight.time) == len(flight["y"]), round(float(flight["y"][-1]), 3))
    True 10.0
    """

    name: str
    time_unit: str
    time: np.ndarray
    states: np.ndarray
    controls: np.ndarray
    paths: np.ndarray
    state: PiecewisePolynomial
    control: PiecewisePolynomial
    state_variables: tuple[Variable, ...]
    control_variables: tuple[Variable, ...]
    path_limits: tuple[Limit, ...]

    def __repr__(self) -> str:
        size = f"{len(self.time)} nodes on {len(self.state.edges) - 1} elements"
        return f"PhaseTrajectory('{self.name}', {self.t0:g} to {self.tf:g} {self.time_unit}, {size}, [{', '.join(self.names)}])"

    def _repr_html_(self) -> str:
        """For notebooks: a title, and a row for each quantity with a small line over time. Names are escaped."""
        limits: tuple[Variable | Limit, ...] = (*self.state_variables, *self.control_variables, *self.path_limits)
        kinds = [*(["state"] * self.states.shape[1]), *(["control"] * self.controls.shape[1]), *(["path"] * self.paths.shape[1])]
        rows = [_cells(("", "kind", "unit", "first", "last", "least", "most", "over time"), "th")]
        columns = np.hstack([self.states, self.controls, self.paths]).T
        for name, kind, unit, values in zip(self.names, kinds, (limit.unit for limit in limits), columns, strict=True):
            numbers = [f"{value + 0.0:.6g}" for value in (values[0], values[-1], values.min(), values.max())]
            rows.append(f"{_cells((name, kind, unit, *numbers), 'td')}<td>{_line(self.time, values)}</td>")
        table = "".join(f"<tr>{row}</tr>" for row in rows)
        title = f"{escape(self.name)}: {self.t0:.6g} to {self.tf:.6g} {escape(self.time_unit)}, {len(self.time)} nodes"
        return f"<div><b>{title}</b></div><table>{table}</table>"

    @property
    def t0(self) -> float:
        return float(self.state.edges[0])

    @property
    def tf(self) -> float:
        return float(self.state.edges[-1])

    @property
    def edge_states(self) -> np.ndarray:
        """States (N + 1, nx) at the ends of the elements: the most accurate that the method knows."""
        left, right = self.state.ends()
        return np.vstack([left, right[-1:]])

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the states, controls and path constraints, in that order."""
        limits: tuple[Variable | Limit, ...] = (*self.state_variables, *self.control_variables, *self.path_limits)
        return tuple(limit.name for limit in limits)

    def __getitem__(self, name: str) -> np.ndarray:
        """Values at the nodes (`time`) of the state, control or path constraint called `name`."""
        if name not in self.names:
            raise KeyError(f"phase '{self.name}' has no '{name}'; it has {', '.join(self.names)}")
        return np.hstack([self.states, self.controls, self.paths])[:, self.names.index(name)]

    def controls_on(self, j: int, tau: np.ndarray) -> np.ndarray:
        """Controls (len(tau), nu) on element `j` at local coordinates `tau` in [-1, 1], within the bounds of those that are periodic."""
        return wrapped(self.control.on_element(j, tau), self.control_variables)

    def controls_on_elements(self, tau: np.ndarray) -> np.ndarray:
        """The same on every element, shape (N, len(tau), nu)."""
        return wrapped(self.control.on_elements(tau), self.control_variables)

    def sampled(self, tau: np.ndarray, parameters: Sequence[float] | np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """States (k, nx), controls (k, nu), times (k,) at `tau` of all elements, one after the other; s holds t0, tf and the parameters."""
        times, x, u = self.state.times(tau), self.state.on_elements(tau), self.controls_on_elements(tau)
        s = np.array([self.t0, self.tf, *parameters])
        return x.reshape(times.size, x.shape[2]), u.reshape(times.size, u.shape[2]), times.ravel(), s

    def at(self, time: float | np.ndarray) -> dict[str, float | np.ndarray]:
        """States and controls by name at a time, or at an array of times, interpolated by the method's own polynomials.

        Where a control jumps, at an end of an element, it has its value just after the jump.

        Raises
        ------
        ValueError
            If a time lies outside the phase.
        """
        times = np.asarray(time, dtype=float)
        # A phase of no duration may end before it begins, by the tolerance of a feasible point.
        first, last = sorted((self.t0, self.tf))
        slack = 1e-12 * max(1.0, abs(first), abs(last))
        if not ((times >= first - slack) & (times <= last + slack)).all():
            raise ValueError(f"phase '{self.name}' lasts from {self.t0:g} to {self.tf:g} {self.time_unit}; asked for {time}")
        values = np.concatenate([self.state(times), wrapped(self.control(times), self.control_variables)], axis=-1)
        columns = np.moveaxis(values, -1, 0) if times.ndim else values.tolist()
        return dict(zip((v.name for v in (*self.state_variables, *self.control_variables)), columns, strict=True))


class Named(Mapping[str, Item]):
    """Items by name, in order; where there is none of a name, the KeyError says which there are."""

    what: ClassVar[str] = "phase"

    @property
    @abstractmethod
    def by_name(self) -> Mapping[str, Item]:
        """All of them."""

    def __getitem__(self, name: str) -> Item:
        if name not in self.by_name:
            raise KeyError(f"no {self.what} '{name}'; there are {', '.join(self.by_name)}")
        return self.by_name[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.by_name)

    def __len__(self) -> int:
        return len(self.by_name)


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Named[PhaseTrajectory]):
    """A whole trajectory: its phases by name, in the order in which they were declared, and its static parameters.

    Parameters
    ----------
    phases : tuple of PhaseTrajectory
    parameters : mapping
        Values by name.

    Examples
    --------
    >>> from macs import sweep
    >>> from problems import load
    >>> from transcription import DFET
    >>> front = sweep(load("goddard"), DFET(6, 6, basis="bernstein"), points=3, starts=1)
    >>> list(front[1].trajectory), front[1].trajectory.parameters
    (['ascent'], {})
    """

    phases: tuple[PhaseTrajectory, ...]
    parameters: Mapping[str, float]  # whole numbers as ints

    def __repr__(self) -> str:
        phases = ", ".join(f"'{phase.name}' {phase.t0:g} to {phase.tf:g} {phase.time_unit}" for phase in self.phases)
        parameters = "".join(f", {name}={value:g}" for name, value in self.parameters.items())
        return f"Trajectory({phases}{parameters})"

    def _repr_html_(self) -> str:
        """For notebooks: a table for each phase, with a small line of each quantity over time."""
        values = ", ".join(f"{escape(name)} {value:.6g}" for name, value in self.parameters.items())
        parts = [*(phase._repr_html_() for phase in self.phases), *([f"<div>parameters: {values}</div>"] if values else [])]
        return f"<div>{''.join(parts)}</div>"

    @property
    def by_name(self) -> Mapping[str, PhaseTrajectory]:
        return {phase.name: phase for phase in self.phases}


def wrapped(controls: np.ndarray, variables: tuple[Variable, ...]) -> np.ndarray:
    """Controls (..., nu) of which the periodic ones are brought back into their bounds."""
    result = np.array(controls, dtype=float)
    for i, v in enumerate(variables):
        if v.period:
            result[..., i] = v.lower + np.mod(result[..., i] - v.lower, v.period)
    return result


def unwrapped(coefficients: np.ndarray, variables: tuple[Variable, ...]) -> np.ndarray:
    """Coefficients (N, degree + 1, nu), periodic ones the short way round in an element; half a period goes down."""
    result = np.array(coefficients, dtype=float)
    for i, v in enumerate(variables):
        for k in range(1, result.shape[1] if v.period else 0):
            step = result[:, k, i] - result[:, k - 1, i]
            result[:, k, i] -= v.period * np.floor(step / v.period + 0.5)
    return result


def _cells(cells: tuple[str, ...], tag: str) -> str:
    """Cells of a row: the first three flush left."""
    sides = ("left", "left", "left", *["right"] * len(cells))
    style = 'style="padding:1px 8px;text-align:'
    return "".join(f'<{tag} {style}{side}">{escape(cell)}</{tag}>' for cell, side in zip(cells, sides, strict=False))


def _line(times: np.ndarray, values: np.ndarray) -> str:
    """An SVG of values over time; a constant, up to round-off, is a level line in the middle."""
    wide, high, most = 140, 26, 120  # pixels; values that are joined
    some = np.unique(np.linspace(0, len(times) - 1, min(most, len(times))).round().astype(int))
    x, y = times[some], values[some]
    span, height = float(np.ptp(x)), float(np.ptp(y))
    across = 2 + (wide - 4) * (x - x[0]) / (span or 1.0)
    flat = height <= 1e-9 * max(float(np.abs(y).max()), 1e-300)
    up = np.full(len(y), 0.5 * high) if flat else high - 3 - (high - 6) * (y - y.min()) / height
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(across, up, strict=True))
    line = f'<polyline points="{points}" fill="none" stroke="#0072B2" stroke-width="1.3"/>'
    return f'<svg xmlns="http://www.w3.org/2000/svg" width="{wide}" height="{high}" role="img" aria-label="over time">{line}</svg>'
