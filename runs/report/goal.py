"""Goal attainment: how far the best value of one objective has come from a bad to a good one, over the evaluations of every run.

mu = 1 - (J - J*) / (Jmax - J*), section VI C of Chai et al., "Solving multiobjective constrained trajectory optimization problem by an
extended evolutionary algorithm", IEEE Transactions on Cybernetics 50(4), 2020; of whichever sense: J* is the good value, Jmax the bad one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from msgspec import Meta

from macs.front import Front

from ..batch.store import StoredRun
from ..files import Number, Section, check_known, checked, errors_begin_with
from ..measures.attainment import Band, History, band
from .comparison import Comparison
from .plots import convergence_figure
from .tables import Cell, Head, Table, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from problems.compiled import CompiledProblem, Objective
    from problems.vector import CompiledVectorProblem

NEVER = (np.array([0.0]), np.array([np.nan]))
"""The history of a failed run."""
Share = Annotated[float, Meta(gt=0, le=1, description="a number above 0 and at most 1")]


class StatedGoal(Section):
    """The table `[goal]` of a study."""

    objective: Annotated[str, Meta(description="the name of an objective")]
    best: Number  # best, worst: values of the objective, in the user's unit, with attainment 1 and 0
    worst: Number
    # Attainments for which tables state the evaluations.
    shares: Annotated[tuple[Share, ...], Meta(description="a list of numbers above 0 and at most 1")] = (0.9, 0.95, 0.99)

    def __post_init__(self) -> None:
        if self.best == self.worst:
            raise ValueError(f"best and worst of '{self.objective}' are both {self.best:g}: they must differ")

    @classmethod
    def of(cls, given: Any, problems: Mapping[str, CompiledProblem | CompiledVectorProblem]) -> StatedGoal:
        """The goal that a study states for problems by label. Raises ValueError that names the key that is wrong."""
        with errors_begin_with("goal"):
            goal: StatedGoal = checked(given, cls)
            for name, problem in problems.items():
                known = {one.name: one for one in problem.goals}
                with errors_begin_with(f"problem '{name}'"):
                    check_known("objective", [goal.objective], known)
                sense = known[goal.objective].sense
                if (goal.best < goal.worst) != (sense == "minimize"):
                    better, values = "less" if sense == "minimize" else "more", f"{goal.best:g} beside {goal.worst:g}"
                    raise ValueError(f"'{goal.objective}' is to {sense}, so best must be {better} than worst, not {values}")
        return goal

    def history(self, run: StoredRun, goals: Sequence[Objective]) -> History:
        """The attainment of a run at each of its samples; NaN before its first feasible point."""
        k = self._place(goals)
        best = [goals[k].sign * min((row[k] for row in F), default=np.nan) for F in run.history["F"]]
        return np.array(run.history["evaluations"], dtype=float), np.fmax.accumulate(self._attained(np.array(best)))

    def of_front(self, front: Front) -> float:
        """The attainment of the best point of a front; NaN if it is empty."""
        k = self._place(front.goals)
        return float(self._attained(front.goals[k].sign * front.F[:, k].min())) if len(front) else np.nan

    def _attained(self, values: np.ndarray) -> np.ndarray:
        """The attainment of values of the objective: 1 at the best, 0 at the worst."""
        return 1.0 - (values - self.best) / (self.worst - self.best)

    def _place(self, goals: Sequence[Objective]) -> int:
        return [one.name for one in goals].index(self.objective)


@dataclass(frozen=True, eq=False)
class GoalAttainment:
    """The attainment of the goal on one problem, for each transcription and solver: of failed runs, too, which attain nothing."""

    problem: str  # its label
    goal: StatedGoal
    objective: Objective
    histories: dict[tuple[str, str], Sequence[History]] = field(default_factory=dict)
    simulated: dict[tuple[str, str], Sequence[float]] = field(default_factory=dict)  # empty where points are not simulated
    seconds: dict[tuple[str, str], Sequence[float]] = field(default_factory=dict)

    def tables(self) -> dict[str, Table]:
        """{name of a file: table} of the attainment in the end, and of the evaluations to reach shares of it."""
        heads: list[Head | str] = [Head("transcription", grouped=True), "solver", "runs"]
        heads += [Head(name, digits=4) for name in ("median attained", "lower quartile", "upper quartile")]
        heads += [Head("median, simulated", digits=4)] if self.simulated else []
        heads += [*(Head(f"evaluations to {share:g}") for share in self.goal.shares), Head("time of a run", "s", digits=3)]
        rows: list[list[Cell]] = []
        for cell, runs in self.histories.items():
            b = band(runs, larger=True, moments=sum(len(x) for x, _ in runs))
            final: list[Cell] = [_finite(part[-1]) for part in (b.median, b.lower, b.upper)]
            # NaN is worse than any.
            final += [_finite(np.median(np.nan_to_num(self.simulated[cell], nan=-np.inf)))] if self.simulated else []
            took = float(np.median(self.seconds[cell])) if self.seconds[cell] else None
            rows.append([*cell, b.runs, *final, *(_reached(b, share) for share in self.goal.shares), took])
        unit = f" {self.objective.unit}" if self.objective.unit else ""
        how = ", not simulated"
        if self.simulated:
            how = ", except those simulated: of the points of each run in the end that are feasible when simulated"
        note = (
            f"Of the best {self.objective.name} of a run so far: 1 is {self.goal.best:g}{unit}, 0 is {self.goal.worst:g}{unit}. Median and "
            "quartiles are over the runs; one without a feasible point has attained nothing. A dash: that share of runs did not reach it. "
            f"Values are those of the transcription{how}."
        )
        return {f"{self.problem}-goal-attainment": table(heads, rows, f"{self.problem}: {self._what}.", [note])}

    def figures(self) -> dict[str, Figure]:
        """{name of a file: figure} of median and quartiles over evaluations, a line for each transcription and solver."""
        several = [len({cell[side] for cell in self.histories}) > 1 for side in (0, 1)]
        named = {
            ", ".join(word for word, shown in zip(cell, several, strict=True) if shown) or cell[1]: runs
            for cell, runs in self.histories.items()
        }
        figure = convergence_figure(named, xlabel="evaluations", ylabel=self._what, larger=True, log=False)
        return {f"{self.problem}-goal-attainment": figure}

    @property
    def _what(self) -> str:
        return f"goal attainment of {self.objective.name}"


def goal_attainments(comparisons: Sequence[Comparison], study: Mapping[str, Any]) -> list[GoalAttainment]:
    """The attainment of the goal that a study states, on each of its problems; also as simulated if it verifies. Empty if there is
    no goal."""
    if study.get("goal") is None:
        return []
    goal = StatedGoal.of(study["goal"], {})
    found: dict[str, GoalAttainment] = {}
    for comparison in comparisons:
        goals = comparison.known.goals
        objective = next(one for one in goals if one.name == goal.objective)
        here = found.setdefault(comparison.problem, GoalAttainment(comparison.problem, goal, objective))
        for solver, runs in comparison.runs.items():
            cell, failed = (comparison.place(solver), solver), comparison.failures.get(solver, 0)
            known = [*(goal.history(run, goals) for run in runs if run.history.get("F")), *[NEVER] * failed]
            if known:
                here.histories[cell], here.seconds[cell] = known, [run.wall_time for run in runs]
            if known and study.get("verify") is not None:
                here.simulated[cell] = [*map(goal.of_front, comparison.fronts[solver]), *[np.nan] * failed]
    return [one for one in found.values() if one.histories]


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _reached(b: Band, share: float) -> int | None:
    """Evaluations after which the median run reached a share; None if it never did."""
    there = np.flatnonzero(b.median >= share)
    return int(b.x[there[0]]) if len(there) else None
