"""What can be compared: all runs of a study on one problem and one transcription, by solver, and what they are measured against."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from macs.front import Front

from ..batch.store import Run, Store
from ..execution.task import CRASHED, MEMORY, TIMEOUT
from ..measures.references import Reference, look_up, union
from .verified import Verified

EACH = "each on its own"
"""What is said for the transcription of a ground without a common one."""
FAILED = (CRASHED, TIMEOUT, MEMORY)
"""What counts as a failure of the solver. A killed, missing or unreadable run says nothing of it, and is left out and told."""


@dataclass(frozen=True, eq=False)
class Ground:
    """Attributes
    ----------
    problem, transcription : str
        Labels.
    runs : solver -> its finished runs
    fronts : solver -> what counts of each of them, and of foreign solvers the fronts that were given
    verified : solver -> the same of each of them with what was found out about it
    failures : solver -> how many of its runs failed
    left_out : solver -> how many others have no front
    """

    problem: str
    transcription: str
    runs: Mapping[str, Sequence[Run]]
    fronts: Mapping[str, Sequence[Front]]
    verified: Mapping[str, Sequence[Verified]]
    failures: Mapping[str, int]
    left_out: Mapping[str, int]

    @property
    def name(self) -> str:
        """For people."""
        return f"{self.problem}, {self.transcription}"

    def place(self, solver: str) -> str:
        """The transcription that a solver works on."""
        runs = self.runs.get(solver)
        return runs[0].cell.transcription if runs else self.transcription

    @property
    def every(self) -> list[Front]:
        """All fronts."""
        return [front for fronts in self.fronts.values() for front in fronts]

    @property
    def known(self) -> Front:
        """A front that says names, units and senses of the objectives."""
        return self.every[0]

    def union(self) -> Reference:
        """The non-dominated points of all runs. Raises ValueError if there are none."""
        fronts = self.every
        together = union([front if front.source is not None else front.objectives for front in fronts])  # others have no trajectories
        assert isinstance(together, Front)  # as all of them are
        return Reference(together, f"the union of {len(fronts)} run{'' if len(fronts) == 1 else 's'}", False)

    def reference(self, given: Any) -> Reference:
        """What the study says that fronts are measured against; see `look_up`."""
        source = self.known.source
        address, data = (source.address, source.data) if source is not None else ("", {})
        return look_up(given, self.problem, address, data, self.known.goals) or self.union()


def grounds(store: Store, others: Mapping[str, Sequence[Front]]) -> list[Ground]:
    """The grounds of a study with at least one front; `others` are fronts of foreign solvers, on the problem whose objectives they have."""
    cells: dict[tuple[str, str], dict[str, list[Run]]] = {}
    apart: dict[str, dict[str, list[Run]]] = {}
    for run in store.runs():
        problem, transcription, solver = run.cell.labels
        here = apart.setdefault(problem, {}) if run.cell.apart else cells.setdefault((problem, transcription), {})
        here.setdefault(solver, []).append(run)
    for problem, solvers in apart.items():
        # Solvers on terms of their own are compared with the others wherever these are; if there are none, among themselves.
        for place in [place for place in cells if place[0] == problem] or [(problem, EACH)]:
            cells[place] = cells.get(place, {}) | solvers
    found = []
    for (problem, transcription), solvers in cells.items():
        finished = {solver: [run for run in runs if run.finished] for solver, runs in solvers.items()}
        verified = {solver: [Verified.of(run, store.definition.get("verify")) for run in runs] for solver, runs in finished.items()}
        fronts: dict[str, Sequence[Front]] = {solver: [one.front for one in ones] for solver, ones in verified.items()}
        if not any(fronts.values()):
            continue
        goals = next(front for one in fronts.values() for front in one).goals
        fronts |= {name: given for name, given in others.items() if all(front.goals == goals for front in given)}
        failures = {solver: sum(run.status in FAILED for run in runs) for solver, runs in solvers.items()}
        left_out = {solver: len(runs) - len(finished[solver]) - failures[solver] for solver, runs in solvers.items()}
        found.append(Ground(problem, transcription, finished, fronts, verified, failures, left_out))
    return found
