"""Published tables beside ours: the `[[paper]]` sections of a study, row by row, and the same figures of our runs.

A kind of table is a class: the keys that a study file states, and how its figures are computed from our fronts.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from msgspec import Meta

from macs.baselines.population import PopulationSolver
from macs.decisions import FuzzySatisfactory, Preference, Ranges, from_dict, trade_offs
from macs.fronts.pictures.flight_plot import along
from macs.io.text import counted
from problems.compiled import Objective

from ..files import Number, Section, Text, check_known, checked, errors_begin_with, is_number
from ..measures.indicators import Scale, hypervolume_at, normalised
from ..measures.statistics import summarise
from .choices import RunChoice, chosen
from .comparison import SEARCHED, Comparison, Counting, samples, spent
from .tables import Cell, Head, PrintedNumber, Table, table

if TYPE_CHECKING:
    from macs.front import Front
    from macs.solvers.solver import Solver
    from problems.compiled import CompiledProblem
    from problems.vector import CompiledVectorProblem
    from transcription.trajectories.trajectory import Trajectory

Figures = Mapping[str, Cell]
"""The figures of a row by key."""
Point = Annotated[list[Number], Meta(min_length=1, description="a list of numbers, one for each objective")]
STATISTICS: Mapping[str, Callable[[np.ndarray], float]] = {
    "greatest": np.max,
    "least": np.min,
    "mean": np.mean,
    "standard deviation": lambda values: np.std(values, ddof=1) if len(values) > 1 else np.nan,
    "variance": lambda values: np.var(values, ddof=1) if len(values) > 1 else np.nan,
}
ROW, STATISTIC, GAIN = ("problem", "by"), "statistic", "better by"
"""Keys of a row that are no figures, and of the least gain on a design."""


def figures_of(row: Mapping[str, Any]) -> list[str]:
    """The keys of a row's figures."""
    return [key for key in row if key not in (*ROW, STATISTIC)]


class PublishedTable(Section, tag_field="of", kw_only=True):
    """A published table, and the same figures of our runs."""

    # `problem` and `by`, figures by key, and `statistic` where the kind has them.
    rows: Annotated[list[dict[str, Any]], Meta(min_length=1, description="a list of tables")]
    source: Text = ""  # the paper
    note: Text = ""  # how the paper's figures were obtained
    differs: Text = ""  # what differs in ours; "{runs}" stands for the number of our runs

    statistic_head: ClassVar[str] = ""  # head of the column of `statistic`, where there are several rows for each solver
    words: ClassVar[Collection[str] | None] = None  # what it may be in a row of the paper: one of these, if none any; None: rows have none
    population: ClassVar[bool] = False  # whether ours are of solvers with a population alone
    further: ClassVar[Mapping[str, Head]] = {}  # columns after those of the paper, of our figures alone
    how: ClassVar[str] = ""  # how our figures were obtained

    @property
    def columns(self) -> Mapping[str, Head] | None:
        """{key of a figure: head of its column}; None where the keys are names of objectives, or in `heads`."""
        return None

    @property
    def heads(self) -> Mapping[str, Head]:
        """{key: head of its column} of figures other than objectives, where there are no `columns`."""
        return {}

    @property
    def named(self) -> list[str]:
        """The keys of all figures of the paper, in the order of its rows."""
        return list(dict.fromkeys(key for row in self.rows for key in figures_of(row)))

    def ours(self, comparison: Comparison, solver: str) -> list[Figures]:
        """Rows of figures of a solver's runs; empty if it has none."""
        raise NotImplementedError

    def completed(self, row: Figures) -> Figures:
        """A row, the paper's or ours, with the figures that follow from its others."""
        return row

    def remark(self, comparison: Comparison) -> str:
        """A sentence on how our figures were obtained."""
        return self.how

    def printed(self, comparison: Comparison) -> Sequence[Sequence[float]]:
        """The objectives of points that the paper prints, which figures of fronts show."""
        return ()

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

    def _check_row(self, row: Mapping[str, Any]) -> None:
        if not all(isinstance(row.get(key), str) for key in ROW):
            raise ValueError(f"it must be a table with problem and by, not {row!r}")
        given = row.get(STATISTIC)
        if self.words is None and STATISTIC in row:
            raise ValueError(f"{STATISTIC}: this kind of table has none")
        if self.words is not None and (not isinstance(given, str) or (self.words and given not in self.words)):
            known = f"one of {', '.join(self.words)}" if self.words else "a text"
            raise ValueError(f"{STATISTIC} must be {known}, not {given!r}")
        keys = figures_of(row)
        if self.columns is not None:
            check_known("key", keys, self.columns)
        for key in keys:
            if not is_number(row[key]):
                raise ValueError(f"{key} must be a finite number, not {row[key]!r}")
        if not keys:
            raise ValueError(f"it has no figure: {', '.join(self.columns) if self.columns else 'of some objective'}")


class Indicators(PublishedTable, tag="indicators"):
    """GD and IGD to the points of the union of all runs of the same solver, as papers have them that report one solver, and the time of a
    run. Beside them ours to the union of all solvers."""

    columns: ClassVar[Mapping[str, Head]] = {
        "gd_mean": Head("mean GD", digits=4),
        "gd_variance": Head("variance", digits=4),
        "igd_mean": Head("mean IGD", digits=4),
        "igd_variance": Head("variance", digits=4),
        "seconds": Head("time", "s", digits=4),
    }
    further: ClassVar[Mapping[str, Head]] = {f"{key}_all": Head(f"mean {key.upper()}, all solvers", digits=4) for key in ("gd", "igd")}

    def ours(self, comparison: Comparison, solver: str) -> list[Figures]:
        if solver not in comparison.runs or not len(comparison.fronts[solver]) + comparison.failures.get(solver, 0):
            return []
        own, figures = comparison.only(solver), dict[str, Cell]()
        for among in (own, comparison):
            union = among.union() if among.every else None
            if union is not None and len(union.front):
                found = samples(own, union, curve=False)
                gd, igd = (summarise(found[name][solver]) for name in ("GD", "IGD"))
                if among is own:
                    figures |= {"gd_mean": gd.mean, "gd_variance": gd.variance, "igd_mean": igd.mean, "igd_variance": igd.variance}
                else:
                    figures |= {"gd_all": gd.mean, "igd_all": igd.mean}
        times = spent(own)[SEARCHED].get(solver)
        return [figures | ({"seconds": float(np.mean(times))} if times else {})] if figures else []

    def remark(self, comparison: Comparison) -> str:
        union = comparison.union()
        if not len(union.front):
            return "no run found a point."
        scale = Scale.of(union.front, what=union.what, curve=False).describe().split(". Hypervolume")[0]
        own = "GD and IGD are to the points of the union of the solver's own runs, in its own ranges"
        points = {solver: [*map(len, fronts)] for solver, fronts in comparison.fronts.items()}
        some = [f"{np.count_nonzero(one)} of {len(one)} of {solver}" for solver, one in points.items() if not all(one)]
        means = f" Means are of the runs that have a point that counts: {', '.join(some)}." if some else ""
        return f"{own}; for all solvers together, {scale[0].lower()}{scale[1:]}. Variance with divisor n - 1.{means}"


class Hypervolume(PublishedTable, tag="hypervolume", kw_only=True):
    """The volume up to a point in the users' units: best, median and worst of all runs; a failed run has none."""

    point: Point
    points: tuple[Point, ...] = ()  # of the paper's front, where it prints them

    columns: ClassVar[Mapping[str, Head]] = {key: Head(key, digits=5) for key in ("best", "median", "worst")}

    def ours(self, comparison: Comparison, solver: str) -> list[Figures]:
        values = [hypervolume_at(front, self.point) for front in comparison.fronts[solver]] + [0.0] * comparison.failures.get(solver, 0)
        return [{"best": max(values), "median": float(np.median(values)), "worst": min(values)}] if values else []

    def remark(self, comparison: Comparison) -> str:
        goals = zip(comparison.known.goals, self.point, strict=True)
        words = ", ".join(f"{goal.name} {value:g} {goal.unit}".rstrip() for goal, value in goals)
        best = comparison.reference(None)
        return f"hypervolume in the objectives' units, up to {words}; that of {best.what} is {hypervolume_at(best.front, self.point):.5g}."

    def printed(self, comparison: Comparison) -> Sequence[Sequence[float]]:
        return self.points if comparison.problem in {row["problem"] for row in self.rows} else ()

    def check_problem(self, problem: CompiledProblem | CompiledVectorProblem) -> None:
        for one in (self.point, *self.points):
            if len(one) != len(problem.goals):
                names = ", ".join(goal.name for goal in problem.goals)
                raise ValueError(f"point: {len(one)} numbers, but {len(problem.goals)} objectives: {names}")


class Measure(Section):
    """A figure of a flight: of one state, `factor` times its value or, where there is a target, its distance from that."""

    name: Text
    state: Text
    # Of the whole flight, or at its beginning or end.
    take: Literal["least", "greatest", "first", "last"] = "last"
    at: Number | None = None  # the target
    unit: Text = ""
    factor: Number = 1.0

    def of(self, found: Counting) -> np.ndarray:
        """Its values (n,) on the n points of a run that count, at the end as simulated."""
        if self.take == "last":
            values = [one[self.state] for one in found.ends.values() if self.state in one][-1]
        else:
            values = np.array([TAKEN[self.take](_whole(one.trajectory, self.state)) for one in found.front if one.trajectory])
        return self.factor * (values if self.at is None else np.abs(values - self.at))


TAKEN: Mapping[str, Callable[[np.ndarray], float]] = {"least": np.nanmin, "greatest": np.nanmax, "first": lambda values: values[0]}


def _whole(flight: Trajectory, state: str) -> np.ndarray:
    """A state along all phases of a flight that have it."""
    return np.concatenate([along(phase, state)[1] for phase in flight.phases if state in phase.names])


class Objectives(PublishedTable, tag="objectives"):
    """Those statistics that the paper has, over the points of all runs, of each objective and of measures of their flights."""

    measures: tuple[Measure, ...] = ()

    statistic_head: ClassVar[str] = STATISTIC
    words: ClassVar[Collection[str] | None] = STATISTICS

    @property
    def heads(self) -> Mapping[str, Head]:
        return {one.name: Head(one.name, one.unit, digits=4) for one in self.measures}

    def ours(self, comparison: Comparison, solver: str) -> list[Figures]:
        values = dict(zip(comparison.known.names, _objectives(comparison.fronts[solver]).T, strict=False))
        runs = [one for one in comparison.counting.get(solver, ()) if len(one.front)]
        values |= {one.name: np.concatenate([one.of(run) for run in runs]) for one in self.measures if runs}
        kinds = [name for name in STATISTICS if values and name in {row[STATISTIC] for row in self.rows}]
        return [{STATISTIC: name, **{key: float(STATISTICS[name](found)) for key, found in values.items()}} for name in kinds]

    def remark(self, comparison: Comparison) -> str:
        without = [solver for solver, fronts in comparison.fronts.items() if fronts and not any(map(len, fronts))]
        none = f" No run of {', '.join(without)} has a point that counts." if without else ""
        spread = {row[STATISTIC] for row in self.rows} & {"standard deviation", "variance"}
        return f"over the points of all runs{'; deviation and variance with divisor n - 1' if spread else ''}.{none}"

    def check_problem(self, problem: CompiledProblem | CompiledVectorProblem) -> None:
        if len(self.heads) < len(self.measures):
            raise ValueError("measures: no two may have the same name")
        for one in self.measures:
            with errors_begin_with(f"measures: '{one.name}'"):
                check_known("state", [one.state], {v.name: None for phase in problem.phases for v in phase.states})


def _objectives(fronts: Sequence[Front]) -> np.ndarray:
    """Objectives (n, m) of the points of several fronts together; (0, 0) if there is none."""
    return np.vstack([front.objectives for front in fronts if len(front)] or [np.empty((0, 0))])


class Feasibility(PublishedTable, tag="feasibility"):
    """The generations in which one and in which all of a population were feasible, and the number of points found."""

    population: ClassVar[bool] = True
    columns: ClassVar[Mapping[str, Head]] = {
        **{
            f"{key}{more}": head
            for key, words in (("first_feasible", "first feasible"), ("all_feasible", "all feasible"))
            for more, head in (("", Head(f"{words}, mean", digits=4)), ("_median", Head("median", digits=4)), ("_never", Head("never")))
        },
        "points": Head("not dominated in the last population", digits=4),
        "counted": Head("points of a front that count", digits=4),
    }
    how: ClassVar[str] = "generations from 1, the first population; means of the runs that got there; points are means of a run."

    def ours(self, comparison: Comparison, solver: str) -> list[Figures]:
        populations = [run.front.stats["population"] for run in comparison.runs.get(solver, ()) if "population" in run.front.stats]
        if not populations:
            return []
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
        return [figures]


BEST = "best "
"""Beginning of the statistic of a payoff table."""


class PayoffTable(PublishedTable, tag="payoff"):
    """The ends of the front. The `statistic` of a row is "best" and the name of an objective."""

    statistic_head: ClassVar[str] = STATISTIC
    words: ClassVar[Collection[str] | None] = ()
    how: ClassVar[str] = "for each objective, the point of all runs that is best in it, and then in the others in their order."

    def ours(self, comparison: Comparison, solver: str) -> list[Figures]:
        goals, objectives, rows = comparison.known.goals, _objectives(comparison.fronts[solver]), list[Figures]()
        if len(objectives):
            F = objectives * [goal.sign for goal in goals]
            # Solves agree to some digits only: what is equal within 1e-5 of the range is equal.
            keys = np.round(normalised(F, F)[0], 5)
            for i, goal in enumerate(goals):
                order = [i, *(k for k in range(len(goals)) if k != i)]
                best = objectives[np.lexsort(keys[:, order[::-1]].T)[0]].tolist()
                rows.append({STATISTIC: BEST + goal.name, **dict(zip(comparison.known.names, best, strict=True))})
        return rows

    def printed(self, comparison: Comparison) -> Sequence[Sequence[float]]:
        names = comparison.known.names
        return [[row[name] for name in names] for row in self.rows if row["problem"] == comparison.problem and {*names} <= row.keys()]

    def check_problem(self, problem: CompiledProblem | CompiledVectorProblem) -> None:
        check_known(STATISTIC, [row[STATISTIC] for row in self.rows], {BEST + goal.name: goal.name for goal in problem.goals})


EQ_53 = "(53) at {:g}"
"""Key of the value of that equation of Bae and others for a lambda."""


class Degrees(PublishedTable, tag="degrees", kw_only=True):
    """How well each choice of solvers that decide satisfies each objective. The `statistic` of a row names the choice; its figures are the
    degrees by name of objectives."""

    # The preference by which all choices are measured, {"method": ..., "settings": {...}}. Default: each by its own.
    by: dict[str, Any] | None = None
    # Values of lambda for which eq. (53) of Bae and others is evaluated at the memberships, those of the paper's rows, too. Then these
    # are in order of priority.
    regulating: tuple[Number, ...] = ()

    statistic_head: ClassVar[str] = "choice"
    words: ClassVar[Collection[str] | None] = ()

    @property
    def columns(self) -> Mapping[str, Head]:
        found = {name: Head(name, "degree", digits=4) for name in self.named}
        more = ["kappa", *map(EQ_53.format, self.regulating)] if self.regulating else []
        return found | {key: Head(key, digits=4) for key in more}

    def ours(self, comparison: Comparison, solver: str) -> list[Figures]:
        rows: list[Figures] = []
        for one in chosen(comparison):
            if one.solver == solver:
                mark = "" if one.point.verified else " (not verified)"
                degrees = zip((goal.name for goal in one.point.goals), one.degrees(self.preference).tolist(), strict=True)
                rows.append({STATISTIC: one.label + mark, **dict(degrees)})
        return rows

    def completed(self, row: Figures) -> Figures:
        found, degrees = dict(row), np.array([[row.get(name) for name in self.named]], dtype=float)
        goals = [Objective(name, "", "maximize") for name in self.named]
        ranges = Ranges(dict.fromkeys(self.named, 1.0), dict.fromkeys(self.named, 0.0))
        for key, goal in self._weighed.items() if np.isfinite(degrees).all() else ():
            found["kappa"] = float(goal.kappa(goals, ranges, degrees)[0])
            found[key] = float(goal.stages(goals, ranges)[0].numbers(degrees)[0])
        return found

    def remark(self, comparison: Comparison) -> str:
        by = "the preference that chose" if self.preference is None else repr(self.preference)
        return f"degrees of ours by {by}.{''.join(f' {one}' for one in self.optima())}"

    def optima(self) -> list[str]:
        """For each lambda, the least value of eq. (53) over the paper's rows and the ends of its front."""
        known: dict[str, Figures] = {f"best {name}": {one: float(one == name) for one in self.named} for name in self.named}
        known |= {row[STATISTIC]: row for row in self.rows}
        figures = {name: self.completed(row) for name, row in known.items()}
        found = []
        for key, goal in self._weighed.items():
            value, name = min((float(str(one[key])), name) for name, one in figures.items() if key in one)
            found.append(f"With lambda = {goal.regulating:g}, eq. (53) is least, of the paper's rows and ends, at '{name}': {value:.4g}.")
        return found

    def check_problem(self, problem: CompiledProblem | CompiledVectorProblem) -> None:
        names = [goal.name for goal in problem.goals]
        check_known("objective", self.named, names)
        if self.preference is not None:
            with errors_begin_with("by"):
                none = dict.fromkeys(names, 0.0)
                self.preference.stages(problem.goals, Ranges(none, none))

    @property
    def preference(self) -> Preference | None:
        """The preference by which all choices are measured."""
        return None if self.by is None else from_dict(self.by)

    @property
    def _weighed(self) -> dict[str, FuzzySatisfactory]:
        """What minimises eq. (53), for each lambda, by the key of its values."""
        return {EQ_53.format(weight): FuzzySatisfactory({}, self.named, regulating=weight) for weight in self.regulating}

    def __post_init__(self) -> None:
        if self.by is not None:
            with errors_begin_with("by"):
                from_dict(self.by)
        super().__post_init__()
        with errors_begin_with("regulating"):
            _ = self._weighed


class TradeOffTable(PublishedTable, tag="trade-offs", kw_only=True):
    """What all objectives change by where one gets better fastest, for one choice, in ranges of the choice: positive is better, too. The
    `statistic` of a row is the objective that gets better by 1."""

    choice: Text  # its label

    statistic_head: ClassVar[str] = "better"
    words: ClassVar[Collection[str] | None] = ()

    @property
    def columns(self) -> Mapping[str, Head]:
        return {name: Head(name) for name in self.named}

    def ours(self, comparison: Comparison, solver: str) -> list[Figures]:
        return [row for one in self._chosen(comparison) if one.solver == solver for row in self.gains(one)]

    def gains(self, one: RunChoice) -> list[Figures]:
        """The rows of a choice; none where its gradients are not known, for a reason that the remark has."""
        goals, best, worst = one.point.goals, one.ranges.best, one.ranges.worst
        spans = np.array([worst[goal.name] - best[goal.name] for goal in goals])
        with suppress(ValueError):
            matrix = trade_offs(one.point).matrix * spans[:, None] / spans
            by_goal = (dict(zip((goal.name for goal in goals), row, strict=True)) for row in matrix.tolist())
            return [{STATISTIC: goal.name, **row} for goal, row in zip(goals, by_goal, strict=True)]
        return []

    def remark(self, comparison: Comparison) -> str:
        messages = [message for one in self._chosen(comparison) for message in trade_offs(one.point).messages]
        said = "".join(f" {message[0].upper()}{message[1:]}." for message in messages)
        return f"of the choice '{self.choice}', in the ranges by which objectives were normalised.{said}"

    def _chosen(self, comparison: Comparison) -> list[RunChoice]:
        return [one for one in chosen(comparison) if one.label == self.choice]

    def check_problem(self, problem: CompiledProblem | CompiledVectorProblem) -> None:
        check_known("objective", self.named, [goal.name for goal in problem.goals])


class DominatedDesigns(PublishedTable, tag="designs"):
    """Designs with a figure for every objective; for each, of all runs, the verified point of the greatest least gain in all objectives,
    each a share of the design's figure. Where that is not positive, no point dominates the design."""

    statistic_head: ClassVar[str] = "beside"
    further: ClassVar[Mapping[str, Head]] = {GAIN: Head(GAIN, "%", digits=3)}

    def ours(self, comparison: Comparison, solver: str) -> list[Figures]:
        # Points that a simulation confirms; of fronts that were not simulated all.
        objectives = _objectives([front[front.verified | ~front.was_simulated] for front in comparison.fronts[solver]])
        goals, rows = comparison.known.goals, list[Figures]()
        for row in self.rows if len(objectives) else ():
            if row["problem"] == comparison.problem:
                figures = np.array([row[goal.name] for goal in goals])
                gains = (np.array([goal.sign for goal in goals]) * (figures - objectives) / np.abs(figures)).min(axis=1)
                best = dict(zip(comparison.known.names, objectives[gains.argmax()].tolist(), strict=True))
                rows.append({STATISTIC: row["by"], **best, GAIN: 100.0 * float(gains.max())})
        return rows

    def remark(self, comparison: Comparison) -> str:
        every = {solver: self.ours(comparison, solver) for solver in comparison.fronts}
        counts = [
            f"{solver} dominates {sum(float(str(one[GAIN])) > 0.0 for one in found)} of {len(found)} designs"
            for solver, found in every.items()
            if found
        ]
        return (
            f"{', '.join(counts) or 'no point that counts'}. Beside each design, the point that is better in all objectives by the largest "
            "share of its figures; a share that is negative: no point dominates it, and this one comes nearest."
        )

    def check_problem(self, problem: CompiledProblem | CompiledVectorProblem) -> None:
        for row in self.rows:
            missing = [goal.name for goal in problem.goals if not row.get(goal.name)]
            if missing:
                raise ValueError(f"the design '{row['by']}' has no {', '.join(missing)} other than 0: gains are shares of all figures")


KINDS = Indicators | Hypervolume | Objectives | Feasibility | PayoffTable | Degrees | TradeOffTable | DominatedDesigns


def papers(given: Any) -> list[PublishedTable]:
    """The published tables that a study states. Raises ValueError that names the section, the row and the key that is wrong."""
    if isinstance(given, str | Mapping) or not isinstance(given, Sequence):
        raise ValueError(f"paper must be a list of tables, [[paper]], not a {type(given).__name__}")
    found = []
    for number, paper in enumerate(given, 1):
        with errors_begin_with(_section(number, paper)):
            found.append(checked(paper, KINDS))
    return found


def _section(number: int, paper: Any) -> str:
    """Name of a section in messages."""
    of = paper.get("of") if isinstance(paper, Mapping) else None
    return f"[[paper]] {number}{f', of {of}' if isinstance(of, str) else ''}"


def check_against(given: Any, problems: Mapping[str, CompiledProblem | CompiledVectorProblem], solvers: Mapping[str, Solver]) -> None:
    """Raise ValueError unless published tables are of problems, objectives and solvers that a study has."""
    for number, paper in enumerate(papers(given), 1):
        with errors_begin_with(_section(number, given[number - 1])):
            if paper.population and not any(isinstance(solver, PopulationSolver) for solver in solvers.values()):
                raise ValueError(f"it is of solvers with a population, and none of the study's has one: {', '.join(solvers)}")
            for place, row in enumerate(paper.rows, 1):
                with errors_begin_with(f"row {place}"):
                    check_known("problem", [row["problem"]], problems)
                    if paper.columns is None:
                        check_known("objective", figures_of(row), [*(goal.name for goal in problems[row["problem"]].goals), *paper.heads])
            for label in dict.fromkeys(row["problem"] for row in paper.rows):
                with errors_begin_with(f"problem '{label}'"):
                    paper.check_problem(problems[label])


def published_tables(comparisons: Sequence[Comparison], study: Mapping[str, Any]) -> dict[str, Table]:
    """{name of a file: table} of the paper's rows and ours, problem by problem. Problems without finished runs are left out."""
    stated = papers(study.get("paper") or [])
    names = ["published"] if len(stated) == 1 else [f"published-{number}" for number in range(1, len(stated) + 1)]
    found = {name: _beside(comparisons, paper, study) for name, paper in zip(names, stated, strict=True)}
    return {name: one for name, one in found.items() if one is not None}


def _beside(comparisons: Sequence[Comparison], paper: PublishedTable, study: Mapping[str, Any]) -> Table | None:
    """One published table and ours; None if there are no runs of its problems."""
    columns = paper.columns
    keys = [*(columns or dict.fromkeys([*paper.named, *paper.heads])), *paper.further]
    timed = "seconds" in keys
    rows: list[list[Cell]] = []
    notes: list[str] = []
    for problem in dict.fromkeys(row["problem"] for row in paper.rows):
        here = [comparison for comparison in comparisons if comparison.problem == problem]
        rows_here = [row for row in paper.rows if row["problem"] == problem]
        theirs = [{key: PrintedNumber(value) if isinstance(value, float) else value for key, value in row.items()} for row in rows_here]
        if not here:
            continue
        took = max((row["seconds"] for row in theirs if "seconds" in row), default=None)

        def cells(figures: Figures, took: float | None) -> list[Cell]:
            own, figures = figures.get("seconds"), paper.completed(figures)
            ratio: list[Cell] = [took / own if took and isinstance(own, float) else None] if timed else []
            return [*([figures.get(STATISTIC)] if paper.statistic_head else []), *(figures.get(key) for key in keys), *ratio]

        rows += [[problem, row["by"], None, *cells(row, None)] for row in theirs]
        seen = set[tuple[str, str]]()
        for comparison in here:
            for solver in comparison.fronts:
                figures, place = paper.ours(comparison, solver), comparison.place(solver)
                if figures and (solver, place) not in seen:  # one that works apart is on each of the others' comparisons
                    runs = len(comparison.fronts[solver]) + comparison.failures.get(solver, 0)
                    rows += [[problem, f"{solver}, {place}", runs, *cells(one, took)] for one in figures]
                    seen.add((solver, place))
        remarks = {comparison.transcription: paper.remark(comparison) for comparison in here}
        if len(set(remarks.values())) == 1:
            notes.append(f"{problem}: {remarks[here[0].transcription]}")
        else:
            notes += [f"{problem}, {place}: {note}" for place, note in remarks.items()]
    if not rows:
        return None
    heads: list[Head | str] = [Head("problem", grouped=True), *(Head(name, grouped=bool(paper.statistic_head)) for name in ("by", "runs"))]
    heads += [paper.statistic_head] if paper.statistic_head else []
    units = {goal.name: goal.unit for comparison in comparisons for goal in comparison.known.goals}
    known = {**(columns or paper.heads), **paper.further}
    heads += [known.get(key) or Head(key, units.get(key, ""), digits=4) for key in keys]
    heads += [Head("the paper's time / ours", digits=2)] if timed else []
    caption = f"Beside {paper.source}" if paper.source else "Beside published figures"
    words = [f"{word}: {with_count(text, study)}." for word, text in (("The paper", paper.note), ("What differs", paper.differs)) if text]
    return table(heads, rows, f"{caption}.", [*notes, *words])


def with_count(text: str, study: Mapping[str, Any]) -> str:
    """A text of a study with the number of its runs in place of "{runs}"."""
    return text.replace("{runs}", counted(int(study.get("runs", 0)), "run"))
