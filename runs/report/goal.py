"""Goal attainment: how far the best value of one objective has come from a bad to a good one, over the evaluations of every run.

mu = 1 - (J - J*) / (Jmax - J*), section VI C of Chai et al., "Solving multiobjective constrained trajectory optimization problem by an
extended evolutionary algorithm", IEEE Transactions on Cybernetics 50(4), 2020; of whichever sense: J* is the good value, Jmax the bad one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from macs.front import Front
from problems.checks import unknown

from ..batch.file import is_number
from ..batch.store import StoredRun
from ..measures.convergence import Band, History, band
from .comparison import Comparison
from .plots import convergence_figure
from .tables import Cell, Column, Table, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from problems.compiled import CompiledProblem, Objective

NEVER = (np.array([0.0]), np.array([np.nan]))
"""What a run attained that failed."""


@dataclass(frozen=True)
class Goal:
    """What a study's table `[goal]` says.

    Attributes
    ----------
    objective : str
    best, worst : float
        Values of it, in the user's unit, that attain all and nothing.
    shares : sequence of float
        What part of the way tables say the evaluations of.

    Raises
    ------
    ValueError
        If they make no sense.
    """

    objective: str
    best: float
    worst: float
    shares: Sequence[float] = (0.9, 0.95, 0.99)

    def __post_init__(self) -> None:
        if not isinstance(self.objective, str):
            raise ValueError(f"goal: objective must be the name of an objective, not {self.objective!r}")
        for name in ("best", "worst"):
            if not is_number(getattr(self, name)):
                raise ValueError(f"goal: {name} must be a finite number, not {getattr(self, name)!r}")
        if self.best == self.worst:
            raise ValueError(f"goal: best and worst of '{self.objective}' are both {self.best:g}: there is nothing between them to attain")
        shares = self.shares
        if isinstance(shares, str) or not isinstance(shares, Sequence) or not all(is_number(one) and 0 < one <= 1 for one in shares):
            raise ValueError(f"goal: shares must be a list of numbers above 0 and at most 1, not {shares!r}")

    @classmethod
    def of(cls, given: Any, problems: Mapping[str, CompiledProblem]) -> Goal:
        """The goal that a study gives, of problems by label. Raises ValueError that says what is wrong with it."""
        keys = [field.name for field in fields(cls)]
        if not isinstance(given, Mapping):
            raise ValueError(f"goal must be a table with {', '.join(keys)}, not {given!r}")
        for key in given:
            if key not in keys:
                raise ValueError(f"goal: {unknown('key', key, keys)}")
        for key in keys[:3]:
            if key not in given:
                raise ValueError(f"goal: {key} is missing")
        goal = cls(**given)
        for name, problem in problems.items():
            known = {one.name: one for one in problem.goals}
            if goal.objective not in known:
                raise ValueError(f"goal: problem '{name}': {unknown('objective', goal.objective, known)}")
            sense = known[goal.objective].sense
            if (goal.best < goal.worst) != (sense == "minimize"):
                better = "less" if sense == "minimize" else "more"
                raise ValueError(
                    f"goal: '{goal.objective}' is to {sense}, so best must be {better} than worst, not {goal.best:g} beside {goal.worst:g}"
                )
        return goal

    def attained(self, values: np.ndarray) -> np.ndarray:
        """What part of the way values of the objective have come: 1 at the best, 0 at the worst."""
        return 1.0 - (values - self.best) / (self.worst - self.best)

    def history(self, run: StoredRun, goals: Sequence[Objective]) -> History:
        """What a run had attained at each of its samples; NaN before it had a feasible point."""
        k = self._place(goals)
        best = [goals[k].sign * min((row[k] for row in F), default=np.nan) for F in run.history["F"]]
        return np.array(run.history["evaluations"], dtype=float), np.fmax.accumulate(self.attained(np.array(best)))

    def of_front(self, front: Front) -> float:
        """What its best point attains; NaN if there is none."""
        k = self._place(front.goals)
        return float(self.attained(front.goals[k].sign * front.F[:, k].min())) if len(front) else np.nan

    def _place(self, goals: Sequence[Objective]) -> int:
        return [one.name for one in goals].index(self.objective)


@dataclass(frozen=True, eq=False)
class Attained:
    """The goal on one problem.

    Attributes
    ----------
    problem : str
        Its label.
    goal : Goal
    objective : Objective
    histories : (transcription, solver) -> one for each run
        Of failed runs, too, which attain nothing.
    flown : (transcription, solver) -> what each run attained by points that hold when they are flown
        Of failed runs, too. Empty where points are not flown.
    seconds : (transcription, solver) -> the time of each finished run
    """

    problem: str
    goal: Goal
    objective: Objective
    histories: Mapping[tuple[str, str], Sequence[History]]
    flown: Mapping[tuple[str, str], Sequence[float]]
    seconds: Mapping[tuple[str, str], Sequence[float]]

    def tables(self) -> dict[str, Table]:
        """Name of a file -> table: what was attained in the end, and the evaluations to get there."""
        heads: list[Column | str] = [Column("transcription", grouped=True), "solver", "runs"]
        heads += [Column(name, digits=4) for name in ("median attained", "lower quartile", "upper quartile")]
        heads += [Column("median as flown", digits=4)] if self.flown else []
        heads += [Column(f"evaluations to {share:g}") for share in self.goal.shares]
        heads += [Column("time of a run", "s", digits=3)]
        rows: list[list[Cell]] = []
        for cell, runs in self.histories.items():
            b = band(runs, larger=True, moments=sum(len(x) for x, _ in runs))
            final: list[Cell] = [float(part[-1]) if np.isfinite(part[-1]) else None for part in (b.median, b.lower, b.upper)]
            seconds = self.seconds[cell]
            took = float(np.median(seconds)) if seconds else None
            final += [_middle(self.flown[cell])] if self.flown else []
            rows.append([*cell, b.runs, *final, *(_reached(b, share) for share in self.goal.shares), took])
        unit = f" {self.objective.unit}" if self.objective.unit else ""
        notes = [
            f"Of the best {self.objective.name} of a run so far: 1 is {self.goal.best:g}{unit}, 0 is {self.goal.worst:g}{unit}. Median and "
            "quartiles are over the runs; one without a feasible point has attained nothing. A dash: so many runs have not got there. "
            "Values are what the transcription says of points"
            + (", but those as flown, of the points that each run has in the end and that hold." if self.flown else ", not what is flown.")
        ]
        return {f"{self.problem}-goal-attainment": table(heads, rows, f"{self.problem}: goal attainment of {self.objective.name}.", notes)}

    def figures(self) -> dict[str, Figure]:
        """Name of a file -> figure: median and quartiles over evaluations, a line for each transcription and solver."""
        methods, solvers = ({cell[side] for cell in self.histories} for side in (0, 1))
        named = {
            ", ".join(word for word, others in zip(cell, (methods, solvers), strict=True) if len(others) > 1) or cell[1]: runs
            for cell, runs in self.histories.items()
        }
        what = f"goal attainment of {self.objective.name}"
        # Runs that find something feasible late leave no corner free.
        figure = convergence_figure(named, xlabel="evaluations", ylabel=what, larger=True, log=False, inside=False)
        return {f"{self.problem}-goal-attainment": figure}


def attained(comparisons: Sequence[Comparison], given: Mapping[str, Any] | None, verify: float | None) -> list[Attained]:
    """The goal that a study gives on each of its problems, also as flown if it verifies; nothing if it gives none."""
    if given is None:
        return []
    goal = Goal.of(given, {})
    found = []
    for problem in dict.fromkeys(comparison.problem for comparison in comparisons):
        here = [comparison for comparison in comparisons if comparison.problem == problem]
        goals = here[0].known.goals
        cells = {
            (comparison.place(solver), solver): (runs, comparison.fronts[solver], comparison.failures.get(solver, 0))
            for comparison in here
            for solver, runs in comparison.runs.items()
            if len(runs) + comparison.failures.get(solver, 0)
        }
        histories = {
            cell: [*(goal.history(run, goals) for run in runs if run.history.get("F")), *[NEVER] * failed]
            for cell, (runs, _, failed) in cells.items()
        }
        flown = {
            cell: [*map(goal.of_front, fronts), *[np.nan] * failed] for cell, (_, fronts, failed) in cells.items() if verify is not None
        }
        seconds = {cell: [run.wall_time for run in runs] for cell, (runs, _, _) in cells.items()}
        objective = next(one for one in goals if one.name == goal.objective)
        known = {cell: told for cell, told in histories.items() if told}
        if known:
            found.append(Attained(problem, goal, objective, known, flown, seconds))
    return found


def _middle(values: Sequence[float]) -> float | None:
    """The median, of which NaN is the worst; None if that is NaN."""
    middle = float(np.median(np.nan_to_num(values, nan=-np.inf)))
    return middle if np.isfinite(middle) else None


def _reached(b: Band, share: float) -> int | None:
    """After how many evaluations the median run had come so far; None if it never did."""
    there = np.flatnonzero(b.median >= share)
    return int(b.x[there[0]]) if len(there) else None
