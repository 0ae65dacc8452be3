"""Kinds of published tables: the keys that a study file states for each, and how the same figures are computed from our fronts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from msgspec import Meta

from macs.preferences import FuzzySatisfactory, Preference, Ranges, from_dict
from problems.checks import unknown
from problems.compiled import Objective

from ..execution.task import FinalStates
from ..files import Number, Section, Text, check_known, errors_begin_with, is_number
from ..measures.indicators import hypervolume_at
from ..measures.scale import Scale
from ..measures.statistics import summarise
from .choices import chosen
from .comparison import Comparison
from .run_measures import samples, spent
from .tables import Cell, Column

if TYPE_CHECKING:
    from problems.compiled import CompiledProblem
    from problems.vector import CompiledVectorProblem

Figures = Mapping[str, Cell]
"""The figures of a row by key."""
STATISTICS: Mapping[str, Callable[[np.ndarray], float]] = {
    "greatest": np.max,
    "least": np.min,
    "mean": np.mean,
    "standard deviation": lambda values: np.std(values, ddof=1) if len(values) > 1 else np.nan,
    "variance": lambda values: np.var(values, ddof=1) if len(values) > 1 else np.nan,
}
ROW, STATISTIC = ("problem", "by"), "statistic"
"""Keys of a row that are no figures."""


BEST, EQUAL = "best ", 5
"""Beginning of the statistic of a payoff table; digits, of the range of an objective, in which equal values agree."""


def figures_of(row: Mapping[str, Any]) -> list[str]:
    """The keys of a row's figures."""
    return [key for key in row if key not in (*ROW, STATISTIC)]


class Published(Section, tag_field="of", kw_only=True):
    """A published table, and the same figures of our runs. A kind of table is a class of this module."""

    # `problem` and `by`, figures by key, and `statistic` where the kind has them.
    rows: Annotated[list[dict[str, Any]], Meta(min_length=1, description="a list of tables")]
    source: Text = ""  # the paper
    note: Text = ""  # how the paper's figures were obtained
    differs: Text = ""  # what differs in ours

    statistics: ClassVar[bool] = False  # whether there are several rows for each solver, by their `statistic`: usually one of `STATISTICS`
    statistic_head: ClassVar[str] = STATISTIC
    population: ClassVar[bool] = False  # whether ours are of solvers with a population alone
    further: ClassVar[Mapping[str, Column]] = {}  # columns after those of the paper, of our figures alone

    def theirs(self, row: Mapping[str, Any]) -> Figures:
        """The figures of a row of the paper."""
        return row

    @property
    def columns(self) -> Mapping[str, Column] | None:
        """{key of a figure: head of its column}; None where the keys are names of objectives."""
        return None

    def ours(self, comparison: Comparison) -> dict[str, list[Figures]]:
        """{solver: rows of figures} of our runs."""
        raise NotImplementedError

    def remark(self, comparison: Comparison) -> str:
        """A sentence on how our figures were obtained."""
        raise NotImplementedError

    def check_problem(self, problem: CompiledProblem | CompiledVectorProblem) -> None:
        """Raise ValueError if the table cannot be of this problem."""

    def __post_init__(self) -> None:
        seen: list[tuple[str, ...]] = []
        for place, row in enumerate(self.rows, 1):
            with errors_begin_with(f"row {place}"):
                self._check_row(row)
                name = tuple(row[key] for key in (*ROW, STATISTIC) if key in row)
                if name in seen:
                    raise ValueError(f"it is of the same as row {seen.index(name) + 1}: {', '.join(name)}")
                seen.append(name)

    def _check_statistic(self, given: Any) -> None:
        if not isinstance(given, str) or given not in STATISTICS:
            raise ValueError(f"{STATISTIC} must be one of {', '.join(STATISTICS)}, not {given!r}")

    def _check_row(self, row: Mapping[str, Any]) -> None:
        if not all(isinstance(row.get(key), str) for key in ROW):
            raise ValueError(f"it must be a table with problem and by, not {row!r}")
        if self.statistics:
            self._check_statistic(row.get(STATISTIC))
        elif STATISTIC in row:
            raise ValueError(f"{STATISTIC}: this kind of table has none")
        keys = figures_of(row)
        if self.columns is not None:
            check_known("key", keys, self.columns)
        for key in keys:
            if not is_number(row[key]):
                raise ValueError(f"{key} must be a finite number, not {row[key]!r}")
        if not keys:
            raise ValueError(f"it has no figure: {', '.join(self.columns) if self.columns else 'of some objective'}")


class Indicators(Published, tag="indicators"):
    """GD and IGD to the points of the union of all runs of the same solver, as papers have them that report one solver, and the time of a
    run. Beside them ours to the union of all solvers."""

    columns: ClassVar[Mapping[str, Column]] = {
        "gd_mean": Column("mean GD", digits=4),
        "gd_variance": Column("variance", digits=4),
        "igd_mean": Column("mean IGD", digits=4),
        "igd_variance": Column("variance", digits=4),
        "seconds": Column("time", "s", digits=4),
    }
    further: ClassVar[Mapping[str, Column]] = {f"{key}_all": Column(f"mean {key.upper()}, all solvers", digits=4) for key in ("gd", "igd")}

    def ours(self, comparison: Comparison) -> dict[str, list[Figures]]:
        times, together = spent(comparison)["time [s]"], self._statistics(comparison)
        rows: dict[str, list[Figures]] = {}
        for solver in comparison.runs:
            if solver in together:
                alone = self._statistics(comparison.only(solver)).get(solver, {})
                seconds = {"seconds": float(np.mean(times[solver]))} if solver in times else {}
                rows[solver] = [{**alone, **seconds, "gd_all": together[solver]["gd_mean"], "igd_all": together[solver]["igd_mean"]}]
        return rows

    @staticmethod
    def _statistics(comparison: Comparison) -> dict[str, Figures]:
        """By solver, of the indicators to the union of all that are compared; none if that is empty."""
        union = comparison.union() if comparison.every else None
        if union is None or not len(union.front):
            return {}
        found = samples(comparison, union, curve=False)
        pairs = {who: (summarise(found["GD"][who]), summarise(found["IGD"][who])) for who in found["GD"]}
        keys = ("gd_mean", "gd_variance", "igd_mean", "igd_variance")
        return {who: dict(zip(keys, (gd.mean, gd.variance, igd.mean, igd.variance), strict=True)) for who, (gd, igd) in pairs.items()}

    def remark(self, comparison: Comparison) -> str:
        union = comparison.union()
        if not len(union.front):
            return "no run found a point."
        scale = Scale.of(union.front, what=union.what, curve=False).describe().split(". Hypervolume")[0]
        own = "GD and IGD are to the points of the union of the solver's own runs, in its own ranges"
        return f"{own}; for all solvers together, {scale[0].lower()}{scale[1:]}. Variance with divisor n - 1."


class Hypervolume(Published, tag="hypervolume", kw_only=True):
    """The volume up to a point in the users' units: best, median and worst of all runs; a failed run has none."""

    point: Annotated[list[Number], Meta(min_length=1, description="a list of numbers, one for each objective")]

    columns: ClassVar[Mapping[str, Column]] = {key: Column(key, digits=5) for key in ("best", "median", "worst")}

    def ours(self, comparison: Comparison) -> dict[str, list[Figures]]:
        rows: dict[str, list[Figures]] = {}
        for solver, fronts in comparison.fronts.items():
            values = [hypervolume_at(front, self.point) for front in fronts] + [0.0] * comparison.failures.get(solver, 0)
            if values:
                rows[solver] = [{"best": max(values), "median": float(np.median(values)), "worst": min(values)}]
        return rows

    def remark(self, comparison: Comparison) -> str:
        goals = zip(comparison.known.goals, self.point, strict=True)
        words = ", ".join(f"{goal.name} {value:g} {goal.unit}".rstrip() for goal, value in goals)
        best = comparison.reference(None)
        return f"hypervolume in the objectives' units, up to {words}; that of {best.what} is {hypervolume_at(best.front, self.point):.5g}."

    def check_problem(self, problem: CompiledProblem | CompiledVectorProblem) -> None:
        if len(self.point) != len(problem.goals):
            names = ", ".join(goal.name for goal in problem.goals)
            raise ValueError(f"point: {len(self.point)} numbers, but {len(problem.goals)} objectives: {names}")


class Objectives(Published, tag="objectives"):
    """Statistics of each objective over the points of all runs."""

    statistics: ClassVar[bool] = True

    def ours(self, comparison: Comparison) -> dict[str, list[Figures]]:
        found = {solver: [front.objectives for front in fronts if len(front)] for solver, fronts in comparison.fronts.items()}
        names = comparison.known.names
        return {solver: _statistics(dict(zip(names, np.vstack(each).T, strict=True))) for solver, each in found.items() if each}

    def remark(self, comparison: Comparison) -> str:
        without = [solver for solver, fronts in comparison.fronts.items() if fronts and not any(map(len, fronts))]
        none = f" No run of {', '.join(without)} has a point that counts." if without else ""
        return f"over the points of all runs; deviation and variance with divisor n - 1.{none}"


class End(Section):
    """A state at the end of the flight, and its target: the figure is `factor` times the distance between them."""

    name: Text
    state: Text
    at: Number
    unit: Text = ""
    factor: Number = 1.0


class Ends(Objectives, tag="ends", kw_only=True):
    """Statistics, over the points of all runs, of the distance of final states from their targets."""

    ends: Annotated[list[End], Meta(min_length=1, description="a list of tables")]

    @property
    def columns(self) -> Mapping[str, Column]:
        return {end.name: Column(end.name, end.unit, digits=4) for end in self.ends}

    def ours(self, comparison: Comparison) -> dict[str, list[Figures]]:
        rows: dict[str, list[Figures]] = {}
        for solver, runs in comparison.counting.items():
            found = [one for one in runs if len(one.front)]
            if found:
                values = {end.name: np.concatenate([_final(one.ends, end) for one in found]) - end.at for end in self.ends}
                rows[solver] = _statistics({end.name: end.factor * np.abs(values[end.name]) for end in self.ends})
        return rows

    def check_problem(self, problem: CompiledProblem | CompiledVectorProblem) -> None:
        known = [v.name for phase in problem.phases for v in phase.states]
        for end in self.ends:
            if end.state not in known:
                raise ValueError(_no_state(end, known))

    def __post_init__(self) -> None:
        names = [end.name for end in self.ends]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"ends: '{name}' is there twice")
        super().__post_init__()


class Feasibility(Published, tag="feasibility"):
    """The generations in which one and in which all of a population were feasible, and the number of points found."""

    population: ClassVar[bool] = True

    columns: ClassVar[Mapping[str, Column]] = {
        "first_feasible": Column("first feasible, mean", digits=4),
        "first_feasible_median": Column("median", digits=4),
        "first_feasible_never": Column("never"),
        "all_feasible": Column("all feasible, mean", digits=4),
        "all_feasible_median": Column("median", digits=4),
        "all_feasible_never": Column("never"),
        "points": Column("not dominated, claimed", digits=4),
        "counted": Column("points of a front that count", digits=4),
    }

    def ours(self, comparison: Comparison) -> dict[str, list[Figures]]:
        rows: dict[str, list[Figures]] = {}
        for solver, runs in comparison.runs.items():
            populations = [run.front.stats["population"] for run in runs if "population" in run.front.stats]
            if not populations:
                continue
            figures: dict[str, Cell] = {}
            count = len(populations) + comparison.failures.get(solver, 0)
            for key in ("first_feasible", "all_feasible"):
                reached = [one[key] for one in populations if one[key] is not None]
                figures[key] = float(np.mean(reached)) if reached else None
                # A run that failed, or never got there, is later than any other.
                middle = float(np.median([*reached, *[np.inf] * (count - len(reached))]))
                figures[f"{key}_median"] = middle if np.isfinite(middle) else None
                figures[f"{key}_never"] = count - len(reached)
            figures["points"] = float(np.mean([one["nondominated"] for one in populations]))
            figures["counted"] = float(np.mean([len(one.front) for one in comparison.counting[solver]]))
            rows[solver] = [figures]
        return rows

    def remark(self, comparison: Comparison) -> str:
        return "generations from 1, the first population; means of the runs that got there; points are means of a run."


class PayoffTable(Published, tag="payoff"):
    """The ends of the front: for each objective, the point of all runs that is best in it, and then in the others in their order. The
    `statistic` of a row is "best" and the name of an objective."""

    statistics: ClassVar[bool] = True

    def ours(self, comparison: Comparison) -> dict[str, list[Figures]]:
        goals, rows = comparison.known.goals, dict[str, list[Figures]]()
        for solver, fronts in comparison.fronts.items():
            found = [front for front in fronts if len(front)]
            if not found:
                continue
            F, objectives = (np.vstack([getattr(front, name) for front in found]) for name in ("F", "objectives"))
            ranges = np.where(np.ptp(F, axis=0) > 0, np.ptp(F, axis=0), 1.0)
            rows[solver] = []
            for i, goal in enumerate(goals):
                order = [i, *(k for k in range(len(goals)) if k != i)]
                # Solves agree to some digits only.
                keys = np.round((F - F.min(axis=0)) / ranges, EQUAL)[:, order[::-1]].T
                best = objectives[np.lexsort(keys)[0]]
                rows[solver].append(
                    {STATISTIC: BEST + goal.name, **{one.name: float(value) for one, value in zip(goals, best, strict=True)}}
                )
        return rows

    def remark(self, comparison: Comparison) -> str:
        return "for each objective, the point of all runs that is best in it, and then in the others in their order."

    def check_problem(self, problem: CompiledProblem | CompiledVectorProblem) -> None:
        names = {BEST + goal.name: goal.name for goal in problem.goals}
        check_known(STATISTIC, [row[STATISTIC] for row in self.rows], names)

    def _check_statistic(self, given: Any) -> None:
        if not isinstance(given, str) or not given.startswith(BEST):
            raise ValueError(f"{STATISTIC} must be '{BEST}' and the name of an objective, not {given!r}")


class Degrees(Published, tag="degrees", kw_only=True):
    """How well each choice of solvers that decide satisfies each objective. The `statistic` of a row names the choice; its figures are the
    degrees by name of objectives."""

    # The preference by which all choices are measured, {"method": ..., "settings": {...}}. Default: each by its own.
    by: dict[str, Any] | None = None
    # Values of lambda for which eq. (53) of Bae and others is evaluated at the memberships, those of the paper's rows, too. Then these
    # are in order of priority.
    regulating: tuple[Number, ...] = ()

    statistics: ClassVar[bool] = True
    statistic_head: ClassVar[str] = "choice"

    @property
    def columns(self) -> Mapping[str, Column]:
        found = {name: Column(name, "degree", digits=4) for name in self._names}
        return found | {key: Column(key, digits=4) for key in self._more}

    def theirs(self, row: Mapping[str, Any]) -> Figures:
        degrees = [row.get(name) for name in self._names]
        if not self.regulating or None in degrees:
            return row
        return {**row, **self._satisfactory(np.array(degrees, dtype=float))}

    def ours(self, comparison: Comparison) -> dict[str, list[Figures]]:
        rows: dict[str, list[Figures]] = {}
        for one in chosen(comparison):
            degrees = one.degrees(self.preference)
            named = dict(zip((goal.name for goal in one.point.goals), degrees.tolist(), strict=True))
            more = self._satisfactory(np.array([named[name] for name in self._names])) if self.regulating else {}
            mark = "" if one.point.verified else " (not verified)"
            rows.setdefault(one.solver, []).append({STATISTIC: one.label + mark, **named, **more})
        return rows

    def remark(self, comparison: Comparison) -> str:
        by = "the preference that chose" if self.preference is None else repr(self.preference)
        return f"degrees of ours by {by}.{''.join(f' {one}' for one in self._optima())}"

    def check_problem(self, problem: CompiledProblem | CompiledVectorProblem) -> None:
        names = [goal.name for goal in problem.goals]
        check_known("objective", self._names, names)
        if self.preference is not None:
            with errors_begin_with("by"):
                none = dict.fromkeys(names, 0.0)
                self.preference.stages(problem.goals, Ranges(none, none))

    @property
    def preference(self) -> Preference | None:
        """The preference by which all choices are measured."""
        return None if self.by is None else from_dict(self.by)

    @property
    def _names(self) -> list[str]:
        """Names of the objectives."""
        return list(dict.fromkeys(key for row in self.rows for key in figures_of(row)))

    @property
    def _more(self) -> list[str]:
        return ["kappa", *(f"(53) at {weight:g}" for weight in self.regulating)] if self.regulating else []

    def _satisfactory(self, degrees: np.ndarray) -> Figures:
        """kappa and eq. (53), for each lambda, at memberships (m,)."""
        goals = [Objective(name, "", "maximize") for name in self._names]
        ranges = Ranges(dict.fromkeys(self._names, 1.0), dict.fromkeys(self._names, 0.0))
        goal = FuzzySatisfactory({}, self._names)
        values = [replace(goal, regulating=weight).stages(goals, ranges)[0].numbers(degrees[None])[0] for weight in self.regulating]
        return dict(zip(self._more, map(float, [goal.kappa(goals, ranges, degrees[None])[0], *values]), strict=True))

    def _optima(self) -> list[str]:
        """For each lambda, the least value of eq. (53) over the paper's rows and both ends of its front."""
        ends = np.eye(len(self._names))
        known = {f"best {name}": self._satisfactory(end) for name, end in zip(self._names, ends, strict=True)} if self.regulating else {}
        known |= {row[STATISTIC]: self.theirs(row) for row in self.rows}
        found = []
        for weight, key in zip(self.regulating, self._more[1:], strict=True):
            values = {name: value for name, figures in known.items() if isinstance(value := figures.get(key), float)}
            least = min(values, key=lambda name: values[name])
            found.append(f"With lambda = {weight:g}, eq. (53) is least, of the paper's rows and ends, at '{least}': {values[least]:.4g}.")
        return found

    def _check_statistic(self, given: Any) -> None:
        if not isinstance(given, str) or not given:
            raise ValueError(f"{STATISTIC} must name a choice, not {given!r}")

    def __post_init__(self) -> None:
        if self.by is not None:
            with errors_begin_with("by"):
                from_dict(self.by)
        super().__post_init__()


def _statistics(columns: Mapping[str, np.ndarray]) -> list[Figures]:
    """A row for each of `STATISTICS`, of samples by name."""
    return [{STATISTIC: name, **{key: float(of(values)) for key, values in columns.items()}} for name, of in STATISTICS.items()]


def _final(ends: FinalStates, end: End) -> np.ndarray:
    """A state (n,) at the end of the last phase that has it."""
    found = [states[end.state] for states in ends.values() if end.state in states]
    if not found:
        raise ValueError(f"paper: {_no_state(end, [name for states in ends.values() for name in states])}")
    return found[-1]


def _no_state(end: End, known: Sequence[str]) -> str:
    return f"ends: '{end.name}': {unknown('state', end.state, dict.fromkeys(known))}"
