"""Fronts and trajectories as tables of comma-separated values, for spreadsheets."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from os import PathLike
from typing import Any

import numpy as np

from transcription.trajectories.costates import has_length

from ..io.atomic import write_whole
from ..io.text import label, per


def save_csv(front: Any, path: str | PathLike[str]) -> None:
    """Write a row for each point; see `Front.to_csv`."""
    verified = {True: "yes", False: "no", None: ""}
    columns: dict[tuple[str, str], Sequence[Any]] = {
        ("point", ""): range(len(front)),
        **{(goal.name, goal.unit): values.tolist() for goal, values in zip(front.goals, front.objectives.T, strict=True)},
        ("verified", ""): [verified[point.verified] for point in front],
        ("status", ""): front.status.tolist(),
        **_chosen_columns(front),
        ("violation", ""): front.violation.tolist(),
        **(_simulated_columns(front) if front.was_simulated.any() else {}),
    }
    _write_table(path, [*columns], zip(*columns.values(), strict=True))


def _chosen_columns(front: Any) -> dict[tuple[str, str], list[Any]]:
    """Parameters, and when each phase begins and ends; of points without trajectories all their variables."""
    if not front.dynamic:
        return {(v.name, v.unit): front.decision[:, k].tolist() for k, v in enumerate(front.variables)}
    units = {variable.name: variable.unit for variable in front.variables}
    flights = front.trajectories
    known = next((flight for flight in flights if flight is not None), None)
    if known is None:
        return {}
    parameters = {
        (name, units.get(name, "")): [None if one is None else one.parameters[name] for one in flights] for name in known.parameters
    }
    times = {
        (f"{phase.name}: {end}", phase.time_unit): [None if one is None else getattr(one[phase.name], end) for one in flights]
        for phase in known.phases
        for end in ("t0", "tf")
    }
    return parameters | times


def save_point_csv(point: Any, path: str | PathLike[str]) -> None:
    """Write a row for each node of a trajectory; see `Point.to_csv`."""
    trajectory, costates = point.trajectory, point.costates
    if trajectory is None:
        save_csv(point.alone(), path)
        return
    columns: dict[tuple[str, str, str], list[Any]] = {}
    count = 0
    for phase in trajectory.phases:
        columns.setdefault(("", "phase", ""), []).extend([phase.name] * len(phase.time))
        every = [("", "time", phase.time_unit, phase.time)]
        every += [("state", v.name, v.unit, phase[v.name]) for v in phase.state_variables]
        every += [("control", v.name, v.unit, phase[v.name]) for v in phase.control_variables]
        every += [("path", limit.name, limit.unit, phase[limit.name]) for limit in phase.path_limits]
        if costates is not None and has_length(trajectory, phase):
            units = {v.name: v.unit for v in phase.state_variables}
            every += [("costate", f"costate of {name}", per(units[name]), values) for name, values in costates[phase.name].items()]
            every.append(("costate", "Hamiltonian", per(phase.time_unit), costates[phase.name].hamiltonian))
        for kind, name, unit, values in every:
            # Of what an earlier phase does not have, the cells are empty.
            column = columns.setdefault((kind, name, unit), [])
            column += [None] * (count - len(column)) + values.tolist()
        count += len(phase.time)
    order = sorted(columns, key=lambda one: ["", "state", "control", "path", "costate"].index(one[0]))
    rows = zip(*(columns[one] + [None] * (count - len(columns[one])) for one in order), strict=True)
    _write_table(path, [one[1:] for one in order], rows)


def _write_table(path: str | PathLike[str], heads: Sequence[tuple[str, str]], rows: Iterable[Sequence[Any]]) -> None:
    """Write a table whose heads are names with units; numbers in full, empty cells for None and NaN."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([label(*head) for head in heads])
    for row in rows:
        writer.writerow(["" if value is None or (isinstance(value, float) and np.isnan(value)) else value for value in row])
    write_whole(path, text.getvalue().encode())


def _simulated_columns(front: Any) -> dict[tuple[str, str], list[float]]:
    """What a simulation found by name and unit; NaN for a point that was not simulated."""
    vector = front.source is not None and front.source.vector
    how = "evaluated again" if vector else "simulated"
    simulated = (front.simulated_F * front.signs).T
    return {
        **({} if vector else {("defect", ""): front.defect.tolist()}),
        **{(f"{goal.name}, {how}", goal.unit): column.tolist() for goal, column in zip(front.goals, simulated, strict=True)},
        (f"violation, {how}", ""): front.simulated_violation.tolist(),
    }
