"""Fronts and trajectories as tables of comma-separated values, for spreadsheets."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from os import PathLike
from typing import Any

import numpy as np

from transcription.trajectories.costates import Costates, has_length
from transcription.trajectories.trajectory import PhaseTrajectory, Trajectory, ran_over

from ..io.atomic import write_whole
from ..io.text import label, per


def save_csv(front: Any, path: str | PathLike[str]) -> None:
    """Write a row for each point; see `Front.to_csv`."""
    columns: dict[str, Sequence[Any]] = {
        "point": range(len(front)),
        **{label(goal.name, goal.unit): values.tolist() for goal, values in zip(front.goals, front.objectives.T, strict=True)},
        "verified": [{True: "yes", False: "no", None: ""}[point.verified] for point in front],
        "status": front.status.tolist(),
        **_chosen_columns(front),
        "violation": front.violation.tolist(),
    }
    if front.was_simulated.any():
        vector = front.source is not None and front.source.vector
        how = "evaluated again" if vector else "simulated"
        simulated = (front.simulated_F * front.signs).T.tolist()
        columns |= {} if vector else {"defect": front.defect.tolist()}
        columns |= {label(f"{goal.name}, {how}", goal.unit): values for goal, values in zip(front.goals, simulated, strict=True)}
        columns[f"violation, {how}"] = front.simulated_violation.tolist()
    _write_table(path, [*columns], zip(*columns.values(), strict=True))


def _chosen_columns(front: Any) -> dict[str, list[Any]]:
    """Parameters, and when each phase begins and ends; of points without trajectories all their variables."""
    if not front.dynamic:
        return {label(v.name, v.unit): [v.meant(value) for value in front.decision[:, k]] for k, v in enumerate(front.variables)}
    units = {variable.name: variable.unit for variable in front.variables}
    flights = front.trajectories
    known = next((flight for flight in flights if flight is not None), None)
    if known is None:
        return {}
    parameters = {
        label(name, units.get(name, "")): [None if one is None else one.parameters[name] for one in flights] for name in known.parameters
    }
    times = {
        label(f"{phase.name}: {end}", phase.time_unit): [None if one is None else getattr(one[phase.name], end) for one in flights]
        for phase in known.phases
        for end in ("t0", "tf")
    }
    return parameters | times


def save_point_csv(point: Any, path: str | PathLike[str]) -> None:
    """Write a row for each node of a trajectory; see `Point.to_csv`. What a phase does not have is empty in its rows."""
    if point.trajectory is None:
        save_csv(point.alone(), path)
        return
    phases = [_history(point.trajectory, phase, point.costates) for phase in point.trajectory.phases]
    heads = dict.fromkeys(head for columns in phases for head in columns)
    order = sorted(heads, key=lambda head: ("", "state", "control", "path", "costate").index(head[0]))
    rows = (dict(zip(columns, row, strict=True)) for columns in phases for row in zip(*columns.values(), strict=True))
    _write_table(path, [head[1] for head in order], ([row.get(head) for head in order] for row in rows))


def _history(trajectory: Trajectory, phase: PhaseTrajectory, costates: Costates | None) -> dict[tuple[str, str], list[Any]]:
    """The columns of a phase, by the kind of quantity and the head."""
    every = [("", ran_over(phase.time_unit), phase.time_unit, phase.time)]
    every += [("state", v.name, v.unit, phase[v.name]) for v in phase.state_variables]
    every += [("control", v.name, v.unit, phase[v.name]) for v in phase.control_variables]
    every += [("path", limit.name, limit.unit, phase[limit.name]) for limit in phase.path_limits]
    if costates is not None and has_length(trajectory, phase):
        units = {v.name: v.unit for v in phase.state_variables}
        every += [("costate", f"costate of {name}", per(units[name]), values) for name, values in costates[phase.name].items()]
        every.append(("costate", "Hamiltonian", per(phase.time_unit), costates[phase.name].hamiltonian))
    names = [phase.name] * len(phase.time)
    return {("", "phase"): names} | {(kind, label(name, unit)): values.tolist() for kind, name, unit, values in every}


def _write_table(path: str | PathLike[str], heads: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Write a table; numbers in full, empty cells for None and NaN."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(heads)
    for row in rows:
        writer.writerow(["" if value is None or (isinstance(value, float) and np.isnan(value)) else value for value in row])
    write_whole(path, text.getvalue().encode())
