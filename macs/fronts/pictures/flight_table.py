"""Table of one trajectory for spreadsheets."""

from __future__ import annotations

from typing import Any

from transcription.trajectories.costates import Costates
from transcription.trajectories.trajectory import Trajectory

from ...io.text import csv_table
from .flight_plot import has_length
from .style import per


def flight_table(trajectory: Trajectory, costates: Costates | None) -> str:
    """Comma-separated values, a row for each node: phase, time, states, controls, path constraints, and the costates and the Hamiltonian.

    Phases without length have no costates.

    Parameters
    ----------
    trajectory : Trajectory
    costates : Costates or None
        Of the trajectory.
    """
    columns: dict[tuple[str, str, str], list[Any]] = {}
    count = 0
    for phase in trajectory.phases:
        columns.setdefault(("", "phase", ""), []).extend([phase.name] * len(phase.time))
        every = [("", "time", phase.time_unit, phase.time)]
        every += [("state", v.name, v.unit, phase[v.name]) for v in phase.state_variables]
        every += [("control", v.name, v.unit, phase[v.name]) for v in phase.control_variables]
        every += [("path", limit.name, "", phase[limit.name]) for limit in phase.path_limits]
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
    return csv_table([one[1:] for one in order], rows)
