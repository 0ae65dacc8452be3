"""Costates and the Hamiltonian of the points of a front as labelled arrays of a phase, and back.

Each costate is an array `(point, node)` of its own, as its state is, and so is the Hamiltonian: NaN for a point without. Between
`costate_edges`, costates are the sums of their coefficients times the functions of their basis on [-1, 1]. Files of fronts without any
costates have none of these arrays.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from transcription.numerics.polynomials import BASES
from transcription.trajectories.costates import Costates, PhaseCostates
from transcription.trajectories.trajectory import PiecewisePolynomial

from ..io.netcdf import Labelled, words
from .columns import COUNT, NUMBER, TEXT, Column, legal_names, padded

MEANING = (
    "those of the sum of weights times objectives, all minimised; the weights (point, objective) in the root are not negative and of sum 1"
    " in the objectives' own units"
)
"""Attribute `costates` of a phase that has some."""
DIMENSIONS = ("costate_edge", "costate_element", "costate_function")


def costate_names(states: Sequence[str], taken: Iterable[str]) -> tuple[list[str], str]:
    """The arrays of the costates of these states, and that of the Hamiltonian, where these are `taken`."""
    *names, hamiltonian = legal_names([*(f"costate of {name}" for name in states), "hamiltonian"], "costate", taken).values()
    return names, hamiltonian


def costate_table(states: Sequence[str], units: Sequence[str], time_unit: str, taken: Iterable[str]) -> dict[str, Column]:
    """The arrays of `costate_columns`; none of them need be there."""
    names, hamiltonian = costate_names(states, taken)
    per = "weighted objectives"
    at_nodes = {
        array: Column(("point", "node"), NUMBER, f"costate of {state}", f"{per} per {unit}" if unit else per, optional=True)
        for array, state, unit in zip(names, states, units, strict=True)
    }
    time = time_unit or "1"
    return {
        **at_nodes,
        hamiltonian: Column(("point", "node"), NUMBER, "Hamiltonian", f"{per} per {time}", optional=True),
        "costate_edges": Column(("point", "costate_edge"), NUMBER, "ends of the elements of the costates", time, optional=True),
        "costate_coefficients": Column(
            ("point", "costate_element", "costate_function", "state"),
            NUMBER,
            "coefficients of the costates on each element, in the basis costate_basis",
            "as those of the costates",
            optional=True,
        ),
        **{
            f"{one}_count": Column(("point",), COUNT, f"number of entries of the point along {one}, 0 without costates", optional=True)
            for one in DIMENSIONS
        },
        "costate_basis": Column(("point",), TEXT, f"basis of the costates on [-1, 1]: {', '.join(BASES)}", optional=True),
        "costate_error": Column(("point",), NUMBER, "relative error of costates integrated backward, NaN for others", optional=True),
    }


def costate_columns(points: Sequence[PhaseCostates | None], nodes: int, names: tuple[Sequence[str], str]) -> dict[str, np.ndarray]:
    """The costates of one phase, all points; empty if none has any."""
    known = [one for one in points if one is not None]
    if not known:
        return {}
    nx = len(known[0].names)
    at_nodes = padded([None if one is None else one.at_nodes for one in points], (nodes, nx))
    hamiltonian = padded([None if one is None else one.hamiltonian for one in points], (nodes,))
    polynomials = [None if one is None else one.polynomial for one in points]
    arrays = {
        "costate_edges": padded([None if one is None else one.edges for one in polynomials], (0,)),
        "costate_coefficients": padded([None if one is None else one.coefficients for one in polynomials], (0, 0, nx)),
        "costate_basis": words(["" if one is None else one.basis for one in polynomials]),
        "costate_error": np.array([np.nan if one is None or one.error is None else one.error for one in points]),
    }
    shapes = [(0, 0, 0) if one is None else (len(one.edges), *one.coefficients.shape[:2]) for one in polynomials]
    counts = {f"{name}_count": np.array(column, dtype=int) for name, column in zip(DIMENSIONS, zip(*shapes, strict=True), strict=True)}
    return {**{name: at_nodes[..., i] for i, name in enumerate(names[0])}, names[1]: hamiltonian, **arrays, **counts}


def read_costates(
    data: Labelled, phase: str, states: Sequence[str], names: tuple[Sequence[str], str], nodes: Sequence[int]
) -> list[PhaseCostates | None]:
    """The costates of one phase, from `costate_columns`."""
    wanted = [*names[0], names[1], *(name for name in costate_table((), (), "", ()) if name.startswith("costate_"))]
    missing = [name for name in wanted if name not in data.arrays]
    if missing:
        if len(missing) < len(wanted):
            raise ValueError(f"phase '{phase}': '{missing[0]}' is missing from it")
        return [None] * len(nodes)
    counts = np.stack([data[f"{one}_count"] for one in DIMENSIONS], axis=1)
    there = counts[:, 1] > 0
    largest = [data.sizes[one] for one in DIMENSIONS]
    if np.any((counts < 0) | (counts > largest)) or np.any(there & ((counts[:, 0] != counts[:, 1] + 1) | (counts[:, 2] < 1))):
        raise ValueError(f"phase '{phase}': the numbers of elements of its costates are none")
    found: list[PhaseCostates | None] = []
    for i, (edges, elements, functions) in enumerate(counts.tolist()):
        if not there[i]:
            found.append(None)
            continue
        if not nodes[i] or data["costate_basis"][i] not in BASES:
            raise ValueError(f"phase '{phase}': costates without nodes, or in no known basis")
        coefficients = data["costate_coefficients"][i, :elements, :functions].copy()
        polynomial = PiecewisePolynomial(data["costate_edges"][i, :edges].copy(), coefficients, data["costate_basis"][i])
        values = np.stack([data[name][i, : nodes[i]] for name in names[0]], axis=-1)
        error = float(data["costate_error"][i])
        found.append(
            PhaseCostates(tuple(states), values, data[names[1]][i, : nodes[i]].copy(), polynomial, None if np.isnan(error) else error)
        )
    return found


def of_phase(costates: Sequence[Costates | None], phase: str) -> list[PhaseCostates | None]:
    """The costates of one phase of all points."""
    return [None if one is None else one[phase] for one in costates]


def whole(weights: np.ndarray, phases: Mapping[str, PhaseCostates | None]) -> Costates | None:
    """The costates of one point, from its weights (m,) and those of its phases. Raises ValueError if some of these are missing only."""
    known = {name: one for name, one in phases.items() if one is not None}
    if len(known) not in (0, len(phases)) or bool(known) != bool(np.isfinite(weights).all()):
        raise ValueError("a point has costates in some phases only, or without weights")
    return Costates(weights, known) if known else None
