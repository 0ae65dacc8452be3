"""A front as labelled arrays and back: the root, and a group for each phase. Nothing here knows files.

`ROOT` and `PhaseArrays.table` are all that a front's file has; its reader refuses anything else. Floats go through untouched. Decisions
have a column for each variable that any point has, and `place`, where in the point's own vector it stands, -1 if it has no such variable.
Attributes are texts and numbers; what has structure is JSON.

In a phase each state, control and path constraint is an array `(point, node)` of its own name, and so are each costate and the Hamiltonian;
fronts without any costates have none of theirs. Between the ends of elements, states, controls and costates are the sums of their
coefficients times the functions of their basis on [-1, 1]. Points whose meshes differ in size are padded with NaN; their true lengths are
the arrays `<dimension>_count`, 0 for a point that has none.

A new column of `Points` with an entry for each point is one more line of `points.COLUMNS`, optional for the sake of older files.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from problems.compiled import Limit, Objective, Variable
from transcription.base import CONVERGED, FAILED, INFEASIBLE, TIMEOUT
from transcription.numerics.polynomials import BASES
from transcription.trajectories.costates import Costates, PhaseCostates
from transcription.trajectories.trajectory import PhaseTrajectory, PiecewisePolynomial, Trajectory, ran_over

from ..io.netcdf import COUNT, NUMBER, TEXT, FileArray, Group, Labelled, words
from ..io.text import document
from .columns import (
    checked,
    distinct,
    legal_names,
    named_columns,
    named_table,
    padded,
    read_attribute,
    read_documents,
    read_limits,
    read_named,
    read_variables,
    variable_columns,
    variable_table,
)
from .curve import curve_of
from .points import COLUMNS, Points
from .provenance import read_source, read_stats, source_attributes, stats_attributes

FORMAT = "MACS front"
FORMAT_VERSION = 3

ROOT: dict[str, FileArray] = {
    "objectives": FileArray(("point", "objective"), NUMBER, "objectives in the user's senses", "see objective_unit"),
    "objective": FileArray(("objective",), TEXT, "name of the objective"),
    "objective_unit": FileArray(("objective",), TEXT, "unit of the objective"),
    "objective_sense": FileArray(("objective",), TEXT, "minimize or maximize"),
    "objective_scale": FileArray(("objective",), NUMBER, "scale of the objective, NaN if none was stated", "see objective_unit"),
    **{column.array: column.stored for column in COLUMNS.values() if column.stored},
    "simulated_objectives": FileArray(
        ("point", "objective"), NUMBER, "objectives as simulated, in the user's senses", "see objective_unit", optional=True
    ),
    "tolerances": FileArray(
        ("point", "objective"), NUMBER, "what the simulated objective may differ by, NaN if not judged", "see objective_unit", optional=True
    ),
    "weights": FileArray(
        ("point", "objective"),
        NUMBER,
        "weights of the objectives, all minimised, in the sum to which costates belong, NaN without costates",
        "see objective_unit",
        optional=True,
    ),
    "curve_objectives": FileArray(("curve_place", "objective"), NUMBER, "curve, NaN in its gaps", "see objective_unit", optional=True),
    "transcription": FileArray(("point",), TEXT, "transcription of the point, as JSON"),
    **named_table("violations", "constraint", "scaled residual of the constraint", "constraint"),
    **named_table("excursions", "quantity", "by how much, scaled, the quantity leaves its bounds between nodes", "quantity"),
    "parameters": FileArray(("point", "parameter"), NUMBER, "static decision variables", "see parameter_unit"),
    "parameter": FileArray(("parameter",), TEXT, "name of the parameter"),
    "parameter_unit": FileArray(("parameter",), TEXT, "unit of the parameter"),
    "decision": FileArray(("point", "variable"), NUMBER, "decision vector, NaN where the point has no such variable", "see variable_unit"),
    "place": FileArray(("point", "variable"), COUNT, "place of the variable in the point's own decision vector, -1 if it has none"),
    **variable_table("variable", "entry of the decision vector"),
}

AT_NODES = {"state": "states", "control": "controls", "path": "paths"}
"""Kinds of quantities that have an array each, and the attribute of a trajectory that has all of a kind at its nodes."""
MEANING = (
    "those of the sum of weights times objectives, all minimised; the weights (point, objective) in the root are not negative and of sum 1"
    " in the objectives' own units"
)
"""Attribute `costates` of a phase that has some."""

Names = Mapping[str, Sequence[str]]
"""Names of the states, controls and path constraints of a phase, by their kind."""


# Phases


class Pieces(NamedTuple):
    """The arrays of the piecewise polynomials of one kind of quantity, and their dimensions."""

    kind: str
    edges: str  # array of the ends of the elements
    edge: str
    element: str
    entry: str

    @property
    def coefficients(self) -> str:
        """Array (point, element, function, entry)."""
        return f"{self.kind}_coefficients"

    @property
    def dimensions(self) -> tuple[str, str, str]:
        """Those in which points may differ."""
        return self.edge, self.element, f"{self.kind}_function"

    def table(self, unit: str, of_entries: str) -> dict[str, FileArray]:
        """The arrays, with the units of time and of coefficients."""
        what, some = f"{self.kind}s", self is COSTATES
        at = ("point", *self.dimensions[1:], self.entry)
        each = f"coefficients of the {what} on each element, in the basis {self.kind}_basis"
        known = f"basis of the {what} on [-1, 1]: {', '.join(BASES)}"
        return {
            self.edges: FileArray(("point", self.edge), NUMBER, f"ends of the elements of the {what}", unit, some),
            self.coefficients: FileArray(at, NUMBER, each, of_entries, some),
            f"{self.kind}_basis": FileArray(("point",), TEXT, known, "1", some),
            **_counts_table(self.dimensions, some),
        }

    def write(self, several: Sequence[PiecewisePolynomial | None], entries: int) -> dict[str, np.ndarray]:
        """The polynomials of all points as arrays."""
        shapes = [(0, 0, 0) if one is None else (len(one.edges), *one.coefficients.shape[:2]) for one in several]
        return {
            self.edges: padded(_each(several, "edges"), (0,)),
            self.coefficients: padded(_each(several, "coefficients"), (0, 0, entries)),
            f"{self.kind}_basis": words(["" if one is None else one.basis for one in several]),
            **_counts(self.dimensions, shapes),
        }

    def read(self, data: Labelled, phase: str, there: np.ndarray) -> list[PiecewisePolynomial | None]:
        """The polynomials of the points of a mask `there` (n,); the others have none."""
        counts = _read_counts(data, phase, self.dimensions, there)
        if np.any(there & (counts[:, 0] != counts[:, 1] + 1)):
            raise ValueError(f"phase '{phase}': '{self.edge}_count' is not that of its elements and 1")
        edges, coefficients, bases = data[self.edges], data[self.coefficients], data[f"{self.kind}_basis"]
        wrong = [word for word in bases[there] if word not in BASES]
        if wrong:
            raise ValueError(f"phase '{phase}': there is no basis '{wrong[0][:30]}'")
        return [
            PiecewisePolynomial(edges[i, :ends].copy(), coefficients[i, :elements, :functions].copy(), bases[i]) if there[i] else None
            for i, (ends, elements, functions) in enumerate(counts.tolist())
        ]


STATES = Pieces("state", "edges", "edge", "element", "state")
CONTROLS = Pieces("control", "control_edges", "control_edge", "control_element", "control")
COSTATES = Pieces("costate", "costate_edges", "costate_edge", "costate_element", "state")


def _counts_table(dimensions: Iterable[str], costates: bool = False) -> dict[str, FileArray]:
    without = ", 0 without costates" if costates else ""
    return {
        f"{one}_count": FileArray(("point",), COUNT, f"number of entries of the point along {one}{without}", optional=costates)
        for one in dimensions
    }


def _counts(dimensions: Sequence[str], shapes: Sequence[tuple[int, ...]]) -> dict[str, np.ndarray]:
    return {f"{one}_count": np.array(column, dtype=int) for one, column in zip(dimensions, zip(*shapes, strict=True), strict=True)}


def _read_counts(data: Labelled, phase: str, dimensions: Iterable[str], there: np.ndarray) -> np.ndarray:
    """The lengths (n, dimensions) of points, at least 1 for those of a mask `there` (n,)."""
    sizes, found = data.sizes, []
    for dimension in dimensions:
        count = data[f"{dimension}_count"]
        if np.any((count < 0) | (count > sizes[dimension]) | (there & (count == 0))):
            raise ValueError(f"phase '{phase}': '{dimension}_count' is not between 1 and {sizes[dimension]}")
        found.append(count)
    return np.stack(found, axis=1)


def _each(items: Sequence[Any], attribute: str) -> list[Any]:
    """An attribute of each item; None for None."""
    return [None if item is None else getattr(item, attribute) for item in items]


def phase_table(time_unit: str) -> dict[str, FileArray]:
    """The arrays of every phase."""
    unit = time_unit or "1"
    return {
        "time": FileArray(("point", "node"), NUMBER, f"{ran_over(time_unit)} of the node", unit),
        **_counts_table(["node"]),
        **STATES.table(unit, "see state_unit"),
        **CONTROLS.table(unit, "see control_unit"),
        **variable_table("state", "state"),
        **variable_table("control", "control"),
        **variable_table("path", "path constraint", limits=True),
    }


DIMENSIONS = {dimension for array in (*ROOT.values(), *phase_table("").values()) for dimension in array.dimensions}
CLOSEST = "_closest"


def group_names(phases: Iterable[str]) -> dict[str, str]:
    """The group of each phase."""
    return legal_names(phases, "phase", {CLOSEST, *ROOT, *DIMENSIONS})


def quantity_names(names: Names) -> dict[str, list[str]]:
    """The arrays of the states, controls and path constraints of a phase, by their kind."""
    taken = {*phase_table(""), *DIMENSIONS}
    found: dict[str, list[str]] = {}
    for kind in AT_NODES:
        found[kind] = list(legal_names(names[kind], kind, taken).values())
        taken |= {*found[kind]}
    return found


class PhaseArrays:
    """The arrays of one phase, from the names of its states, controls and path constraints, and their units."""

    def __init__(self, names: Names, units: Names, time_unit: str) -> None:
        self.quantities = quantity_names(names)
        arrays = {array for those in self.quantities.values() for array in those}
        wanted = [*(f"costate of {name}" for name in names["state"]), "hamiltonian"]
        taken = {*phase_table(""), *DIMENSIONS, *arrays}
        *self.costates, self.hamiltonian = legal_names(wanted, "costate", taken).values()
        per, time = "weighted objectives", time_unit or "1"
        error = "relative error of costates integrated backward, NaN for others"
        self.of_costates = {
            **{
                array: FileArray(("point", "node"), NUMBER, f"costate of {state}", f"{per} per {unit}" if unit else per, optional=True)
                for array, state, unit in zip(self.costates, names["state"], units["state"], strict=True)
            },
            self.hamiltonian: FileArray(("point", "node"), NUMBER, "Hamiltonian", f"{per} per {time}", optional=True),
            **COSTATES.table(time, "as those of the costates"),
            "costate_error": FileArray(("point",), NUMBER, error, optional=True),
        }
        of_quantities = {
            array: FileArray(("point", "node"), NUMBER, name, unit or "1")
            for kind in AT_NODES
            for array, name, unit in zip(self.quantities[kind], names[kind], units[kind], strict=True)
        }
        self.table = phase_table(time_unit) | of_quantities | self.of_costates


def write_phase(name: str, phases: Sequence[PhaseTrajectory | None], costates: Sequence[PhaseCostates | None]) -> Labelled:
    """The trajectories and costates of one phase of all points, at least one of which has some."""
    first = next(phase for phase in phases if phase is not None)
    variables: dict[str, tuple[Variable, ...] | tuple[Limit, ...]]
    variables = {"state": first.state_variables, "control": first.control_variables, "path": first.path_limits}
    names = {kind: [v.name for v in those] for kind, those in variables.items()}
    layout = PhaseArrays(names, {kind: [v.unit for v in those] for kind, those in variables.items()}, first.time_unit)
    time = padded(_each(phases, "time"), (0,))
    arrays = {"time": time, **_counts(["node"], [(0 if one is None else len(one.time),) for one in phases])}
    for kind, attribute in AT_NODES.items():
        values = padded(_each(phases, attribute), (0, len(names[kind])))
        arrays |= {array: values[..., i] for i, array in enumerate(layout.quantities[kind])}
        arrays |= variable_columns(variables[kind], kind, limits=kind == "path")
    arrays |= STATES.write(_each(phases, "state"), len(names["state"])) | CONTROLS.write(_each(phases, "control"), len(names["control"]))
    attrs = {"phase": name, "time_unit": first.time_unit}
    if any(one is not None for one in costates):
        values = padded(_each(costates, "at_nodes"), (time.shape[1], len(names["state"])))
        arrays |= {array: values[..., i] for i, array in enumerate(layout.costates)}
        arrays[layout.hamiltonian] = padded(_each(costates, "hamiltonian"), (time.shape[1],))
        arrays |= COSTATES.write(_each(costates, "polynomial"), len(names["state"]))
        arrays["costate_error"] = layout.table["costate_error"].of(_each(costates, "error"))
        attrs["costates"] = MEANING
    return Labelled(arrays, layout.table, attrs)


def read_phase(name: str, group: Group, points: int) -> tuple[list[PhaseTrajectory | None], list[PhaseCostates | None]]:
    """The trajectories and costates of one phase from its group. Raises ValueError for what no phase can have."""
    time_unit = read_attribute(group.attrs, "time_unit", str)
    # The names of states, controls and path constraints are arrays themselves: they are needed to know which others there have to be.
    names = {kind: group.arrays[kind].tolist() if kind in group.arrays else [] for kind in AT_NODES}
    for kind, those in names.items():
        if not all(isinstance(one, str) for one in those):
            raise ValueError(f"'{kind}' has numbers, not texts")
        distinct(those, f"entries of '{kind}' in phase '{name}'")
    layout = PhaseArrays(names, {kind: [""] * len(those) for kind, those in names.items()}, time_unit)
    data = checked(layout.table, group)
    if data.sizes["point"] != points:
        raise ValueError(f"phase '{name}' has {data.sizes['point']} points, the front has {points}")
    there = data["node_count"] > 0
    nodes = _read_counts(data, name, ["node"], there)[:, 0].tolist()
    values = {kind: _joined(data, arrays) for kind, arrays in layout.quantities.items()}
    state, control = STATES.read(data, name, there), CONTROLS.read(data, name, there)
    states, controls, limits = read_variables(data, "state"), read_variables(data, "control"), read_limits(data, "path")
    phases = [
        None
        if one is None or other is None
        else PhaseTrajectory(
            name=name,
            time_unit=time_unit,
            time=data["time"][i, :count].copy(),
            **{attribute: values[kind][i, :count].copy() for kind, attribute in AT_NODES.items()},
            state=one,
            control=other,
            state_variables=states,
            control_variables=controls,
            path_limits=limits,
        )
        for i, (count, one, other) in enumerate(zip(nodes, state, control, strict=True))
    ]
    return phases, _read_costates(data, name, layout, names["state"], nodes)


def _joined(data: Labelled, arrays: Sequence[str]) -> np.ndarray:
    """Arrays (point, node) as one (point, node, array)."""
    return np.stack([data[array] for array in arrays], axis=-1) if arrays else np.empty((*data["time"].shape, 0))


def _read_costates(data: Labelled, phase: str, layout: PhaseArrays, states: Sequence[str], nodes: list[int]) -> list[PhaseCostates | None]:
    missing = [array for array in layout.of_costates if array not in data.arrays]
    if len(missing) == len(layout.of_costates):
        return [None] * len(nodes)
    if missing:
        raise ValueError(f"phase '{phase}': '{missing[0]}' is missing from it")
    there = data["costate_element_count"] > 0
    if np.any(there & (np.array(nodes) == 0)):
        raise ValueError(f"phase '{phase}': a point has costates, and no nodes")
    values, hamiltonian, errors = _joined(data, layout.costates), data[layout.hamiltonian], data["costate_error"].tolist()
    return [
        None
        if one is None
        else PhaseCostates(
            tuple(states), values[i, :count].copy(), hamiltonian[i, :count].copy(), one, None if np.isnan(errors[i]) else errors[i]
        )
        for i, (count, one) in enumerate(zip(nodes, COSTATES.read(data, phase, there), strict=True))
    ]


def costates_of_point(weights: np.ndarray, phases: Mapping[str, PhaseCostates | None]) -> Costates | None:
    """The costates of one point, from its weights (m,) and those of its phases. Raises ValueError if some of these are missing only."""
    known = {name: one for name, one in phases.items() if one is not None}
    if len(known) not in (0, len(phases)) or bool(known) != bool(np.isfinite(weights).all()):
        raise ValueError("a point has costates in some phases only, or without weights")
    return Costates(weights, known) if known else None


# The root


def root_dataset(front: Points) -> Labelled:
    """Everything of a front but its trajectories."""
    parameters = [
        p.parameters if front.dynamic else dict(zip([v.name for v in p.variables], p.decision.tolist(), strict=True)) for p in front
    ]
    names = list(dict.fromkeys(name for row in parameters for name in row))
    units = {variable.name: variable.unit for variable in front.variables}
    values = [[row.get(name, np.nan) for name in names] for row in parameters]
    arrays = {
        "objectives": front.objectives,
        "objective": words(front.names),
        "objective_unit": words(front.units),
        "objective_sense": words(front.senses),
        "objective_scale": ROOT["objective_scale"].of([goal.scale for goal in front.goals]),
        "simulated_objectives": front.simulated_F * front.signs,
        "tolerances": front.tolerances,
        "transcription": words([document(transcription) for transcription in front.transcriptions]),
        "parameters": np.array(values, dtype=float).reshape(len(front), len(names)),
        "parameter": words(names),
        "parameter_unit": words([units.get(name, "") for name in names]),
        "decision": front.decision,
        "place": _places(front),
        **named_columns(front.violations, "violations", "constraint"),
        **named_columns(front.excursions, "excursions", "quantity"),
        **variable_columns(front.variables, "variable"),
    }
    if any(one is not None for one in front.costates):
        none = np.full(len(front.goals), np.nan)
        arrays["weights"] = np.array([none if one is None else one.weights for one in front.costates])
        with suppress(ValueError):  # there is no curve; it is for others: one that is read is made from the points again
            arrays["curve_objectives"] = curve_of(front).sample()
    arrays |= {column.array: column.stored.of(getattr(front, name)) for name, column in COLUMNS.items() if column.stored}
    return Labelled(arrays, ROOT, _attributes(front))


def phase_names(front: Points) -> list[str]:
    """The phases that the trajectories of a front have; none for a black box."""
    return next((list(point.trajectory) for point in front if point.trajectory is not None), [])


def phase_dataset(front: Points, name: str) -> Labelled:
    """The trajectories and costates of one phase, all points. Raises KeyError if there is no such phase."""
    phases = [None if trajectory is None else trajectory[name] for trajectory in front.trajectories]
    if all(phase is None for phase in phases):
        raise KeyError(f"no point has a phase '{name}'")
    return write_phase(name, phases, [None if one is None else one[name] for one in front.costates])


def _places(front: Points) -> np.ndarray:
    places = np.full(front.decision.shape, -1, dtype=np.int32)
    for row, columns in zip(places, front.places, strict=True):
        row[columns] = np.arange(len(columns))
    return places


def _attributes(front: Points) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        **source_attributes(front.source),
        **stats_attributes(front.stats),
        "solver": document(front.solver),
        "message": front.message,
    }


# Reading: everything raises ValueError for what no front can have


def root_columns(root: Labelled) -> dict[str, Any]:
    """What `Points` is made of, but its trajectories, from `root_dataset`."""
    senses, scales = root["objective_sense"], root["objective_scale"]
    _check_entries(root, "status", (CONVERGED, INFEASIBLE, FAILED, TIMEOUT))
    _check_entries(root, "objective_sense", ("minimize", "maximize"))
    distinct(root["objective"].tolist(), "objectives")
    variables = read_variables(root, "variable")
    distinct(variables, "entries of the decision vector")
    own = [_own_columns(row) for row in root["place"]]
    rows = {name: root[column.array] for name, column in COLUMNS.items() if column.array in root.arrays}
    signs = np.where(senses == "minimize", 1.0, -1.0)
    stats = read_stats(root.attrs)
    if "verify" not in stats and not np.isnan(rows.get("defect", np.nan)).all():
        raise ValueError("the attribute 'stats' does not say what its simulated points may miss")
    for name in ("tolerances", "within"):
        if name in root.arrays and not (np.isnan(root[name]) | (root[name] > 0.0) & np.isfinite(root[name])).all():
            raise ValueError(f"'{name}' has numbers that are not above 0")
    return rows | {
        "F": root["objectives"] * signs,
        "simulated_F": root["simulated_objectives"] * signs if "simulated_objectives" in root.arrays else None,
        "tolerances": root["tolerances"] if "tolerances" in root.arrays else None,
        "decision": [row[columns] for row, columns in zip(root["decision"], own, strict=True)],
        "goals": [
            Objective(name, unit, sense, None if np.isnan(scale) else scale)
            for name, unit, sense, scale in zip(root["objective"], root["objective_unit"], senses, scales.tolist(), strict=True)
        ],
        "variables": [[variables[column] for column in columns.tolist()] for columns in own] if own else variables,
        "violations": read_named(root, "violations", "constraint"),
        "excursions": read_named(root, "excursions", "quantity"),
        "transcriptions": read_documents(root["transcription"], "transcription", _is_transcription),
        "problem": read_source(root.attrs),
        "solver": read_documents([read_attribute(root.attrs, "solver", str)], "solver", _is_solver)[0],
        "stats": stats,
        "message": read_attribute(root.attrs, "message", str),
        "sort": False,
    }


def _is_transcription(value: Any) -> bool:
    return value is None or (isinstance(value, dict) and isinstance(value.get("method"), str) and isinstance(value.get("settings"), dict))


def _is_solver(value: Any) -> bool:
    return isinstance(value, dict) and isinstance(value.get("name", ""), str) and isinstance(value.get("settings", {}), dict)


def _check_entries(data: Labelled, name: str, known: Sequence[str]) -> None:
    wrong = [entry for entry in data[name] if entry not in known]
    if wrong:
        raise ValueError(f"'{name}' is '{wrong[0][:30]}', not one of {', '.join(known)}")


def _own_columns(places: np.ndarray) -> np.ndarray:
    """The columns of a point's own decision vector, in its order, from the place of each column."""
    order = np.argsort(places)
    columns = order[np.count_nonzero(places < 0) :]
    if not np.array_equal(places[columns], np.arange(len(columns))):
        raise ValueError("'place' does not number the entries of a decision vector")
    return columns


def read_flights(root: Labelled, phases: Mapping[str, Group]) -> dict[str, Any]:
    """The points' trajectories and costates from the root and the groups of its phases, by their names; nothing if there are no phases."""
    if not phases:
        return {}
    columns, adjoints = zip(*(read_phase(name, group, root.sizes["point"]) for name, group in phases.items()), strict=True)
    names = root["parameter"].tolist()
    distinct(names, "parameters")
    own = {v.name: v for v in read_variables(root, "variable") if v.integer}
    found: list[Trajectory | None] = []
    for parameters, *several in zip(root["parameters"].tolist(), *columns, strict=True):
        known = tuple(phase for phase in several if phase is not None)
        if known and len(known) < len(several):
            raise ValueError("a point has a trajectory in some phases only")
        meant = {name: own[name].meant(value) if name in own else value for name, value in zip(names, parameters, strict=True)}
        found.append(Trajectory(known, meant) if known else None)
    weights = root["weights"] if "weights" in root.arrays else np.full((len(found), len(root["objective"])), np.nan)
    by_point = [dict(zip(phases, several, strict=True)) for several in zip(*adjoints, strict=True)]
    return {"trajectories": found, "costates": [costates_of_point(*one) for one in zip(weights, by_point, strict=True)]}
