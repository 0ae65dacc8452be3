"""A front as labelled arrays and back: the root, and a group for each phase's trajectories. Nothing here knows files.

`ROOT`, `PHASE` and the names of states, controls and path constraints are all that a front's file has; its reader refuses anything else.
Floats go through untouched. Decisions have a column for each variable that any point has, and `place`, where in the point's own vector it
stands, -1 if it has no such variable. In a phase, each state, control and path constraint is an array of its own name; trajectories whose
meshes differ in size are padded with NaN, and their true lengths stand beside them (`node_count`, `element_count`, ...). Attributes are
texts and numbers; what has structure is JSON.

A new column of `Points` with an entry for each point is one more line of `ROOT`, with its `rows`, and `optional` for the sake of the files
that do not have it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from problems.compiled import Objective
from transcription.base import CONVERGED, FAILED, INFEASIBLE, TIMEOUT
from transcription.numerics.polynomials import BASES

from ..io.netcdf import Group, Labelled, words
from ..io.text import document
from .columns import (
    COUNT,
    NUMBER,
    TEXT,
    Column,
    checked,
    distinct,
    labelled,
    legal_names,
    named_columns,
    named_table,
    padded,
    read_attribute,
    read_document,
    read_documents,
    read_limits,
    read_named,
    read_variables,
    variable_columns,
    variable_table,
)
from .costate_arrays import MEANING, costate_columns, costate_names, costate_table, of_phase, read_costates, whole
from .points import Points
from .provenance import read_source, read_stats, source_attributes, stats_attributes

if TYPE_CHECKING:
    from transcription.trajectories.costates import PhaseCostates
    from transcription.trajectories.trajectory import PhaseTrajectory, Trajectory

FORMAT = "MACS front"
VERSION = 3

ROOT: dict[str, Column] = {
    "objectives": Column(("point", "objective"), NUMBER, "objectives in the user's senses", "see objective_unit"),
    "objective": Column(("objective",), TEXT, "name of the objective"),
    "objective_unit": Column(("objective",), TEXT, "unit of the objective"),
    "objective_sense": Column(("objective",), TEXT, "minimize or maximize"),
    "objective_scale": Column(("objective",), NUMBER, "scale of the objective, NaN if none was stated", "see objective_unit"),
    "violation": Column(("point",), NUMBER, "largest scaled residual of any constraint", rows="violation"),
    "status": Column(("point",), TEXT, "converged, infeasible, failed or timeout", rows="status"),
    "optimality": Column(("point",), NUMBER, "scaled residual of Pareto optimality, NaN if not computed", rows="optimality"),
    "note": Column(("point",), TEXT, "remark on the point", rows="notes"),
    "defect": Column(
        ("point",), NUMBER, "largest scaled difference of a simulated state, NaN if not simulated", rows="defect", optional=True
    ),
    "simulated_violation": Column(
        ("point",), NUMBER, "largest scaled residual of any constraint as simulated", rows="simulated_violation", optional=True
    ),
    "simulated_objectives": Column(
        ("point", "objective"), NUMBER, "objectives as simulated, in the user's senses", "see objective_unit", optional=True
    ),
    "weights": Column(
        ("point", "objective"),
        NUMBER,
        "weights of the objectives, all minimised, in the sum to which costates belong, NaN without costates",
        "see objective_unit",
        optional=True,
    ),
    "verified": Column(("point",), COUNT, "1 if the simulation agrees with the point, else 0", rows="verified", optional=True),
    "transcription": Column(("point",), TEXT, "transcription of the point, as JSON"),
    **named_table("violations", "constraint", "scaled residual of the constraint", "constraint"),
    **named_table("excursions", "quantity", "by how much, scaled, the quantity leaves its bounds between nodes", "quantity"),
    "parameters": Column(("point", "parameter"), NUMBER, "static decision variables", "see parameter_unit"),
    "parameter": Column(("parameter",), TEXT, "name of the parameter"),
    "parameter_unit": Column(("parameter",), TEXT, "unit of the parameter"),
    "decision": Column(("point", "variable"), NUMBER, "decision vector, NaN where the point has no such variable", "see variable_unit"),
    "place": Column(("point", "variable"), COUNT, "place of the variable in the point's own decision vector, -1 if it has none"),
    **variable_table("variable", "entry of the decision vector"),
}

ARRAYS = {
    "time": ("node",),
    "states": ("node", "state"),
    "controls": ("node", "control"),
    "paths": ("node", "path"),
    "edges": ("edge",),
    "state_coefficients": ("element", "state_function", "state"),
    "control_edges": ("control_edge",),
    "control_coefficients": ("control_element", "control_function", "control"),
}
"""What a phase holds of each point. Between `edges`, the ends of the elements, states and controls are the sums of their coefficients times
the functions of their basis (`state_basis`, `control_basis`) on [-1, 1]."""
SPLIT = {"states": "state", "controls": "control", "paths": "path"}
"""Those of them that are written as an array for each entry of their last dimension, by its own name."""
LENGTHS = ("node", "edge", "element", "state_function", "control_edge", "control_element", "control_function")
"""The dimensions in which points may differ; `<dimension>_count` (point) are the true lengths."""


def phase_table(time_unit: str) -> dict[str, Column]:
    """The arrays of every phase."""
    unit = time_unit or "1"
    described = {
        "time": ("time of the node", unit),
        "edges": ("ends of the elements of the states", unit),
        "state_coefficients": ("coefficients of the states on each element, in the basis state_basis", "see state_unit"),
        "control_edges": ("ends of the elements of the controls", unit),
        "control_coefficients": ("coefficients of the controls on each element, in the basis control_basis", "see control_unit"),
    }
    return {
        **{name: Column(("point", *ARRAYS[name]), NUMBER, *described[name]) for name in described},
        **{f"{dimension}_count": Column(("point",), COUNT, f"number of entries of the point along {dimension}") for dimension in LENGTHS},
        "state_basis": Column(("point",), TEXT, f"basis of the states on [-1, 1]: {', '.join(BASES)}"),
        "control_basis": Column(("point",), TEXT, f"basis of the controls on [-1, 1]: {', '.join(BASES)}"),
        **variable_table("state", "state"),
        **variable_table("control", "control"),
        **variable_table("path", "path constraint", limits=True),
    }


DIMENSIONS = {dimension for column in (*ROOT.values(), *phase_table("").values()) for dimension in column.dimensions}
CLOSEST = "_closest"


def group_names(phases: Iterable[str]) -> dict[str, str]:
    """The group of each phase."""
    return legal_names(phases, "phase", {CLOSEST, *ROOT, *DIMENSIONS})


def quantity_names(names: Mapping[str, Iterable[str]]) -> dict[str, list[str]]:
    """The arrays of the states, controls and path constraints of a phase (the keys), by their names."""
    taken = {*phase_table(""), *DIMENSIONS}
    found: dict[str, list[str]] = {}
    for kind in SPLIT.values():
        found[kind] = list(legal_names(names[kind], kind, taken).values())
        taken |= {*found[kind]}
    return found


def _taken(names: Mapping[str, Iterable[str]]) -> set[str]:
    """The names of the arrays of a phase, but for those of its costates."""
    return {*phase_table(""), *DIMENSIONS, *(array for arrays in quantity_names(names).values() for array in arrays)}


def _quantity_table(names: Mapping[str, Sequence[str]], units: Mapping[str, Sequence[str]]) -> dict[str, Column]:
    arrays = quantity_names(names)
    return {
        array: Column(("point", "node"), NUMBER, name, unit or "1")
        for kind in SPLIT.values()
        for array, name, unit in zip(arrays[kind], names[kind], units[kind], strict=True)
    }


# Writing


def root_dataset(front: Points) -> Labelled:
    """Everything of a front but its trajectories."""
    parameters = [point.parameters for point in front]
    names = list(dict.fromkeys(name for row in parameters for name in row))
    units = {variable.name: variable.unit for variable in front.variables}
    values = [[row.get(name, np.nan) for name in names] for row in parameters]
    arrays = {
        "objectives": front.objectives,
        "objective": words(front.names),
        "objective_unit": words(front.units),
        "objective_sense": words(front.senses),
        "objective_scale": _numbers([goal.scale for goal in front.goals]),
        "simulated_objectives": front.simulated_F * front.signs,
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
    for name, column in ROOT.items():
        if column.rows:
            arrays[name] = CONVERSIONS[column.kind](getattr(front, column.rows))
    return labelled(ROOT, {name: arrays[name] for name in ROOT if name in arrays}, _attributes(front))


def phase_names(front: Points) -> list[str]:
    """The phases that the trajectories of a front have; none for a black box."""
    return next((list(point.trajectory) for point in front if point.trajectory is not None), [])


def phase_dataset(front: Points, name: str) -> Labelled:
    """The trajectories of one phase, all points. Raises KeyError if there is no such phase."""
    phases = [None if point.trajectory is None else point.trajectory[name] for point in front]
    first = next((phase for phase in phases if phase is not None), None)
    if first is None:
        raise KeyError(f"no point has a phase '{name}'")
    rows = [None if phase is None else _arrays(phase) for phase in phases]
    tables = {array: padded([None if row is None else row[array] for row in rows], like.shape) for array, like in _arrays(first).items()}
    variables: dict[str, tuple[Any, ...]]
    variables = {"state": first.state_variables, "control": first.control_variables, "path": first.path_limits}
    names = {kind: [v.name for v in those] for kind, those in variables.items()}
    units = {kind: [v.unit for v in those] for kind, those in variables.items()}
    arrays = split(tables, names)
    arrays |= {f"{dimension}_count": _counts(rows, dimension) for dimension in LENGTHS}
    arrays |= {
        "state_basis": words(["" if phase is None else phase.state.basis for phase in phases]),
        "control_basis": words(["" if phase is None else phase.control.basis for phase in phases]),
        **variable_columns(first.state_variables, "state"),
        **variable_columns(first.control_variables, "control"),
        **variable_columns(first.path_limits, "path", limits=True),
    }
    table = phase_table(first.time_unit) | _quantity_table(names, units)
    taken = _taken(names)
    table |= costate_table(names["state"], units["state"], first.time_unit, taken)
    costates = costate_columns(of_phase(front.costates, name), arrays["time"].shape[1], costate_names(names["state"], taken))
    about = {"costates": MEANING} if costates else {}
    return labelled(table, arrays | costates, {"phase": name, "time_unit": first.time_unit, **about})


def split(arrays: Mapping[str, np.ndarray], names: Mapping[str, Iterable[str]]) -> dict[str, np.ndarray]:
    """Arrays of a phase by name, those of `SPLIT` as one for each of their names."""
    entries = quantity_names(names)
    found = {name: values for name, values in arrays.items() if name not in SPLIT}
    for name, kind in SPLIT.items():
        found |= {entry: arrays[name][..., i] for i, entry in enumerate(entries[kind])}
    return found


def _numbers(values: Sequence[float | None]) -> np.ndarray:
    return np.array([np.nan if value is None else value for value in values], dtype=float)


def _whole(values: np.ndarray) -> np.ndarray:
    return np.asarray(values, dtype=np.int32)


CONVERSIONS: dict[str, Callable[[Any], np.ndarray]] = {TEXT: words, NUMBER: _numbers, COUNT: _whole}
"""From columns of `Points` to arrays of a file, by their kind."""


def _counts(rows: Sequence[Mapping[str, np.ndarray] | None], dimension: str) -> np.ndarray:
    array, axis = next((name, dims.index(dimension)) for name, dims in ARRAYS.items() if dimension in dims)
    return np.array([0 if row is None else row[array].shape[axis] for row in rows], dtype=int)


def _arrays(phase: PhaseTrajectory) -> dict[str, np.ndarray]:
    return {
        "time": phase.time,
        "states": phase.states,
        "controls": phase.controls,
        "paths": phase.paths,
        "edges": phase.state.edges,
        "state_coefficients": phase.state.coefficients,
        "control_edges": phase.control.edges,
        "control_coefficients": phase.control.coefficients,
    }


def _places(front: Points) -> np.ndarray:
    places = np.full(front.decision.shape, -1, dtype=np.int32)
    for row, columns in zip(places, front.places, strict=True):
        row[columns] = np.arange(len(columns))
    return places


def _attributes(front: Points) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "format_version": VERSION,
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
    rows = {column.rows: root[name] for name, column in ROOT.items() if column.rows and name in root.arrays}
    signs = np.where(senses == "minimize", 1.0, -1.0)
    stats = read_stats(root.attrs)
    if "verify" not in stats and not np.isnan(rows.get("defect", np.nan)).all():
        raise ValueError("the attribute 'stats' does not say what its simulated points may miss")
    return rows | {
        "F": root["objectives"] * signs,
        "simulated_F": root["simulated_objectives"] * signs if "simulated_objectives" in root.arrays else None,
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
        "solver": read_document(root.attrs, "solver"),
        "stats": stats,
        "message": read_attribute(root.attrs, "message", str),
        "sort": False,
    }


def _is_transcription(value: Any) -> bool:
    return value is None or (isinstance(value, dict) and isinstance(value.get("method"), str) and isinstance(value.get("settings"), dict))


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
    from transcription.trajectories.trajectory import Trajectory

    if not phases:
        return {}
    columns, adjoints = zip(*(_read_phase(name, group, root.sizes["point"]) for name, group in phases.items()), strict=True)
    names = root["parameter"].tolist()
    distinct(names, "parameters")
    found: list[Trajectory | None] = []
    for parameters, *several in zip(root["parameters"].tolist(), *columns, strict=True):
        known = tuple(phase for phase in several if phase is not None)
        if known and len(known) < len(several):
            raise ValueError("a point has a trajectory in some phases only")
        found.append(Trajectory(known, dict(zip(names, parameters, strict=True))) if known else None)
    weights = root["weights"] if "weights" in root.arrays else np.full((len(found), len(root["objective"])), np.nan)
    costates = [
        whole(row, dict(zip(phases, several, strict=True))) for row, several in zip(weights, zip(*adjoints, strict=True), strict=True)
    ]
    return {"trajectories": found, "costates": costates}


def _read_phase(name: str, group: Group, points: int) -> tuple[list[PhaseTrajectory | None], list[PhaseCostates | None]]:
    from transcription.trajectories.trajectory import PhaseTrajectory, PiecewisePolynomial

    time_unit = read_attribute(group.attrs, "time_unit", str)
    # The names of states, controls and path constraints are arrays themselves: they are needed to know which others there have to be.
    names = {kind: group.arrays[kind].tolist() if kind in group.arrays else [] for kind in SPLIT.values()}
    for kind, those in names.items():
        if not all(isinstance(one, str) for one in those):
            raise ValueError(f"'{kind}' has numbers, not texts")
        distinct(those, f"entries of '{kind}' in phase '{name}'")
    table = phase_table(time_unit) | _quantity_table(names, {kind: [""] * len(those) for kind, those in names.items()})
    taken = _taken(names)
    table |= costate_table(names["state"], [""] * len(names["state"]), time_unit, taken)
    data = checked(table, group)
    if data.sizes["point"] != points:
        raise ValueError(f"phase '{name}' has {data.sizes['point']} points, the front has {points}")
    tables = {array: data[array] for array in ARRAYS if array not in SPLIT}
    tables |= {array: _joined(data, entries) for array, entries in zip(SPLIT, quantity_names(names).values(), strict=True)}
    states, controls = read_variables(data, "state"), read_variables(data, "control")
    limits = read_limits(data, "path")
    found: list[PhaseTrajectory | None] = []
    for i, lengths in enumerate(_lengths(data, name)):
        if not lengths["node"]:
            found.append(None)
            continue
        array = {
            key: tables[key][i][tuple(slice(lengths.get(dimension)) for dimension in dimensions)].copy()
            for key, dimensions in ARRAYS.items()
        }
        phase = PhaseTrajectory(
            name=name,
            time_unit=time_unit,
            time=array["time"],
            states=array["states"],
            controls=array["controls"],
            paths=array["paths"],
            state=PiecewisePolynomial(array["edges"], array["state_coefficients"], data["state_basis"][i]),
            control=PiecewisePolynomial(array["control_edges"], array["control_coefficients"], data["control_basis"][i]),
            state_variables=states,
            control_variables=controls,
            path_limits=limits,
        )
        found.append(phase)
    nodes = [0 if one is None else len(one.time) for one in found]
    return found, read_costates(data, name, names["state"], costate_names(names["state"], taken), nodes)


def _joined(data: Labelled, entries: Sequence[str]) -> np.ndarray:
    """Arrays of one quantity each, shape (point, node), as one (point, node, quantity)."""
    return np.stack([data[entry] for entry in entries], axis=-1) if entries else np.empty((*data["time"].shape, 0))


def _lengths(data: Labelled, name: str) -> list[dict[str, int]]:
    """How long each dimension is for each point; 0 nodes for a point without a trajectory."""
    counts = {dimension: data[f"{dimension}_count"] for dimension in LENGTHS}
    there = counts["node"] > 0
    for dimension, count in counts.items():
        if np.any((count < 0) | (count > data.sizes[dimension]) | (there & (count == 0))):
            raise ValueError(f"phase '{name}': '{dimension}_count' is not between 1 and {data.sizes[dimension]}")
    for edge, element in (("edge", "element"), ("control_edge", "control_element")):
        if np.any(there & (counts[edge] != counts[element] + 1)):
            raise ValueError(f"phase '{name}': '{edge}_count' is not that of its elements and 1")
    for basis in ("state_basis", "control_basis"):
        wrong = [word for word, one in zip(data[basis], there, strict=True) if one and word not in BASES]
        if wrong:
            raise ValueError(f"phase '{name}': there is no basis '{wrong[0][:30]}'")
    return [dict(zip(counts, row, strict=True)) for row in zip(*(count.tolist() for count in counts.values()), strict=True)]
