"""A front as labelled arrays and back: the root, and a group for each phase's trajectories.

Nothing here knows files. Floats go through untouched. Decisions have a column for each variable that any point has, and `place`, where in
the point's own vector it stands, -1 if it has no such variable. Trajectories whose meshes differ in size are padded with NaN; their true
lengths stand beside them (`node_count`, `element_count`, ...). Attributes are strings and integers; what has structure is JSON.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from problems.compiled import Limit, Objective

from .labelled import Labelled, document, named_columns, read_named, read_variables, variable_columns, words
from .points import Points
from .provenance import Source

if TYPE_CHECKING:
    from transcription.trajectories.trajectory import PhaseTrajectory, Trajectory

FORMAT = "MACS front"
VERSION = 2

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
LENGTHS = ("node", "edge", "element", "state_function", "control_edge", "control_element", "control_function")
"""The dimensions in which points may differ; `<dimension>_count` (point) are the true lengths."""


def root_dataset(front: Points) -> Labelled:
    """Everything of a front but its trajectories."""
    names = list(dict.fromkeys(name for point in front for name in point.parameters))
    parameters = [[point.parameters.get(name, np.nan) for name in names] for point in front]
    variables: dict[str, Any] = {
        "objectives": (("point", "objective"), front.objectives),
        "violation": (("point",), front.violation),
        "status": (("point",), front.status),
        "parameters": (("point", "parameter"), np.array(parameters, dtype=float).reshape(len(front), len(names))),
        "decision": (("point", "variable"), front.decision),
        "place": (("point", "variable"), _places(front)),
        "transcription": (("point",), words([document(transcription) for transcription in front.transcriptions])),
        "note": (("point",), words(front.notes)),
        "optimality": (("point",), np.array([np.nan if value is None else value for value in front.optimality])),
        "objective_unit": (("objective",), words(front.units)),
        "objective_sense": (("objective",), words(front.senses)),
        "objective_scale": (("objective",), np.array([np.nan if goal.scale is None else goal.scale for goal in front.goals])),
        **named_columns(front.violations, "violations", "constraint"),
        **named_columns(front.excursions, "excursions", "quantity"),
        **variable_columns(front.variables, "variable"),
        "objective": (("objective",), words(front.names)),
        "parameter": (("parameter",), words(names)),
    }
    return Labelled(variables, _attributes(front))


def root_columns(root: Labelled) -> dict[str, Any]:
    """What `Front` is made of, but its trajectories, from `root_dataset`. Raises KeyError or ValueError where something is missing."""
    signs = np.where(root["objective_sense"] == "minimize", 1.0, -1.0)
    scales = root["objective_scale"]
    solver, stats = (json.loads(str(root.attrs[key])) for key in ("solver", "stats"))
    variables = read_variables(root, "variable")
    own = [np.argsort(row)[np.count_nonzero(row < 0) :] for row in root["place"]]
    return {
        "F": root["objectives"] * signs,
        "decision": [row[columns] for row, columns in zip(root["decision"], own, strict=True)],
        "violation": root["violation"],
        "status": root["status"],
        "goals": [
            Objective(str(name), str(unit), str(sense), None if np.isnan(scale) else float(scale))
            for name, unit, sense, scale in zip(root["objective"], root["objective_unit"], root["objective_sense"], scales, strict=True)
        ],
        "variables": [[variables[column] for column in columns.tolist()] for columns in own] if own else variables,
        "notes": [str(note) for note in root["note"]],
        "violations": read_named(root, "violations", "constraint"),
        "excursions": read_named(root, "excursions", "quantity"),
        "optimality": root["optimality"],
        "problem": _read_source(root.attrs),
        "transcriptions": [json.loads(str(text)) for text in root["transcription"]],
        "solver": solver,
        "stats": stats,
        "message": str(root.attrs["message"]),
        "sort": False,
    }


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
    variables: dict[str, Any] = {
        array: (("point", *dimensions), _padded([None if row is None else row[array] for row in rows], _arrays(first)[array].shape))
        for array, dimensions in ARRAYS.items()
    }
    variables |= {f"{dimension}_count": (("point",), _counts(rows, dimension)) for dimension in LENGTHS}
    variables |= variable_columns(first.state_variables, "state") | variable_columns(first.control_variables, "control")
    variables |= variable_columns(first.path_limits, "path")
    variables["state_basis"] = (("point",), words(["" if phase is None else phase.state.basis for phase in phases]))
    variables["control_basis"] = (("point",), words(["" if phase is None else phase.control.basis for phase in phases]))
    return Labelled(variables, {"phase": name, "time_unit": first.time_unit})


def trajectories(root: Labelled, phases: Sequence[Labelled]) -> list[Trajectory | None] | None:
    """The points' trajectories from `root_dataset` and `phase_dataset`; None if there are no phases."""
    from transcription.trajectories.trajectory import Trajectory

    if not phases:
        return None
    columns = [_read_phase(phase) for phase in phases]
    names = [str(name) for name in root["parameter"]]
    found: list[Trajectory | None] = []
    for parameters, *flight in zip(root["parameters"].tolist(), *columns, strict=True):
        known = [phase for phase in flight if phase is not None]
        found.append(Trajectory(tuple(known), dict(zip(names, parameters, strict=True))) if known else None)
    return found


def _read_phase(data: Labelled) -> list[PhaseTrajectory | None]:
    from transcription.trajectories.trajectory import PhaseTrajectory, PiecewisePolynomial

    states, controls = read_variables(data, "state"), read_variables(data, "control")
    limits = tuple(Limit(v.name, v.lower, v.upper, v.scale) for v in read_variables(data, "path"))
    found: list[PhaseTrajectory | None] = []
    for i in range(data.sizes["point"]):
        length = {dimension: int(data[f"{dimension}_count"][i]) for dimension in LENGTHS}
        if not length["node"]:
            found.append(None)
            continue
        array = {
            name: data[name][i][tuple(slice(length.get(dimension)) for dimension in dimensions)].copy()
            for name, dimensions in ARRAYS.items()
        }
        phase = PhaseTrajectory(
            name=str(data.attrs["phase"]),
            time_unit=str(data.attrs["time_unit"]),
            time=array["time"],
            states=array["states"],
            controls=array["controls"],
            paths=array["paths"],
            state=PiecewisePolynomial(array["edges"], array["state_coefficients"], str(data["state_basis"][i])),
            control=PiecewisePolynomial(array["control_edges"], array["control_coefficients"], str(data["control_basis"][i])),
            state_variables=states,
            control_variables=controls,
            path_limits=limits,
        )
        found.append(phase)
    return found


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


def _padded(rows: Sequence[np.ndarray | None], like: tuple[int, ...]) -> np.ndarray:
    """Arrays of the same rank in one, NaN where they end; `like` is the shape to take where there is none."""
    shapes = [row.shape for row in rows if row is not None] or [like]
    padded = np.full((len(rows), *np.max(shapes, axis=0)), np.nan)
    for i, row in enumerate(rows):
        if row is not None:
            padded[i][tuple(slice(length) for length in row.shape)] = row
    return padded


def _counts(rows: Sequence[Mapping[str, np.ndarray] | None], dimension: str) -> np.ndarray:
    array, axis = next((name, dims.index(dimension)) for name, dims in ARRAYS.items() if dimension in dims)
    return np.array([0 if row is None else row[array].shape[axis] for row in rows], dtype=int)


def _attributes(front: Points) -> dict[str, Any]:
    stats = front.stats
    return {
        "format": FORMAT,
        "format_version": VERSION,
        **_source(front.source),
        **{key: document(stats[key]) for key in ("seed", "evaluations", "tolerance", "wall_time", "versions")},
        "solver": document(front.solver),
        "stats": document(stats),
        "message": front.message,
    }


def _places(front: Points) -> np.ndarray:
    places = np.full(front.decision.shape, -1, dtype=np.int32)
    for row, columns in zip(places, front.places, strict=True):
        row[columns] = np.arange(len(columns))
    return places


def _source(source: Source | None) -> dict[str, str]:
    """Without the address if the data that it takes cannot be written down: then the problem has to be passed again."""
    if source is None:
        return {"problem": "", "fingerprint": "", "address": "", "data": "{}"}
    try:
        address, data = source.address, document(dict(source.data), strict=True)
    except TypeError:
        address, data = "", "{}"
    return {"problem": source.name, "fingerprint": source.fingerprint, "address": address, "data": data}


def _read_source(attributes: Mapping[Any, Any]) -> Source | None:
    """None for a black box, which has no fingerprint."""
    name, fingerprint, address = (str(attributes[key]) for key in ("problem", "fingerprint", "address"))
    return Source(name, fingerprint, address, json.loads(attributes["data"])) if fingerprint else None
