"""Decide: choices by preferences as a solver, so that studies and the command line can name it beside searches and gradient tools."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from itertools import product
from typing import Any, ClassVar

from problems.checks import check_choice, check_count, unknown
from problems.compiled import CompiledProblem
from problems.problem import Problem
from transcription.base import Transcription

from .decisions.choice import Choice
from .decisions.decide import check_statement, raise_lambda
from .decisions.solver import DecisionSolver
from .decisions.stages import SAME_VALUE
from .front import Front
from .fronts.points import Points
from .fronts.provenance import more_costs, versions
from .gradient_solvers import GradientSolver
from .gradient_tools import AUTO, Terms, check_starts, sweep
from .gradients.scalarised import MOST_ITERATIONS
from .preferences.catalogue import from_dict, to_dict
from .preferences.goals import FuzzySatisfactory
from .preferences.preference import Preference
from .preferences.ranges import Ranges

KEYS = ("method", "settings", "vary", "loop")
"""Of a choice as plain data."""


@dataclass(frozen=True)
class Decide(GradientSolver):
    """Choices by one or several preferences, a point for each, in their order: `macs.decisions.decide` as a solver.

    Its front has every choice, those that are dominated included. `stats["choices"]` has, for each, its label, preference, degrees, values,
    steps and message as plain data; `stats["ranges"]` the ranges by which objectives were normalised. A choice is never worse than another
    of the run, by its own preference: where a later one is better, it is made again from there.
    """

    starts: int | str = AUTO  # number of starts of each solve; see `decide`
    # By label: a `Preference`, or one as plain data, {"method": ..., "settings": {...}}. As data, it may have two keys more. "vary" has
    # settings that take several values, {setting: [values]}: a choice for each, of which the label names them. "loop": true raises lambda
    # until the order of priority is kept (`satisfy`).
    choices: Mapping[str, Any] = field(default_factory=dict)
    sweep: int = 0  # points of a sweep that is made first, whose points are known then; 0: the ends of the front alone
    known: str | None = None  # file with a front of the problem, which is known instead
    ranges: Any = None  # by which objectives are normalised, {"best": {...}, "worst": {...}}. Default: those of the points that are known.

    MESHES: ClassVar[tuple[str, ...]] = ("fixed", "mended")

    def __post_init__(self) -> None:
        check_starts("Decide: starts", self.starts)
        check_choice("Decide: mesh", self.mesh, self.MESHES)
        if self.sweep != 0:
            check_count("Decide: sweep", self.sweep, 2)
        if self.known is not None and (not isinstance(self.known, str) or self.sweep):
            raise ValueError("Decide: known is the name of a file, and without a sweep")
        if not isinstance(self.choices, Mapping) or not self.choices:
            raise ValueError('Decide: choices must be a table of preferences by label, {label: {"method": ..., "settings": ...}}')
        object.__setattr__(self, "choices", {label: _plain(label, one) for label, one in self.choices.items()})
        if self.ranges is not None:
            object.__setattr__(self, "ranges", _ranges(self.ranges).to_dict())
        list(self.preferences())

    def preferences(self) -> Iterator[tuple[str, Preference, bool]]:
        """Label, preference, and whether it is a loop, of each choice."""
        for label, one in self.choices.items():
            varied = one.get("vary", {})
            for values in product(*varied.values()):
                own = dict(zip(varied, values, strict=True))
                name = ", ".join([label, *(f"{setting} {_shown(value)}" for setting, value in own.items())])
                try:
                    made = from_dict({"method": one["method"], "settings": {**one.get("settings", {}), **own}})
                except ValueError as error:
                    raise ValueError(f"Decide: choice '{name}': {error}") from None
                loop = one.get("loop", False)
                if loop and not isinstance(made, FuzzySatisfactory):
                    raise ValueError(f"Decide: choice '{name}': only FuzzySatisfactory has a loop")
                yield name, made, loop

    def find(self, problem: Problem | CompiledProblem, transcription: Transcription | None, **terms: Any) -> Front:
        """The choices; see the class."""
        preferences = list(self.preferences())
        known, limit = terms["start"], terms["time_limit"]
        check_statement(problem, transcription, preferences[0][1], known)
        for _, preference, _ in preferences:
            preference.check(problem.compile().goals)
        before: Points | None = None
        if self.known is not None:
            known = Front.load(self.known, problem=problem)
        elif self.sweep and known is None:
            shared = {key: terms[key] for key in ("seed", "tolerance", "verify", "time_limit", "progress")}
            known = before = sweep(problem, transcription, points=self.sweep, **shared)
            if "stopped" in before.stats:
                return before.take([]).replace(message=f"{before.stats['stopped']} before the first choice")
            if limit is not None and (limit := limit - before.stats["wall_time"]) <= 0.0:
                return before.take([]).replace(message="time limit before the first choice")
        own = terms["seed"], terms["tolerance"], terms["verify"], MOST_ITERATIONS, limit, None, terms["progress"]
        asked = Terms(known, self.starts, *own)
        ranges = None if self.ranges is None else _ranges(self.ranges)
        solver = DecisionSolver(problem, transcription, ranges, asked, resolves=self.mesh == "mended")
        found = solver.run(lambda: _choices(solver, preferences))
        stats = {"versions": versions(), **solver.stats()}
        if before is not None:
            stats = more_costs(before.stats, solver.solves.counts, stats["wall_time"], stats.get("stopped", ""))
        if terms["verify"] is not None:
            stats["verify"] = terms["verify"]
        points = Points.concatenate([choice.point.alone() for _, choice in found])
        about = [_about(label, choice) for label, choice in found]
        message = "; ".join(f"{label}: {choice.message}" for label, choice in found if choice.message)
        return Front.of(
            points.replace(solver=self.about(), stats={**stats, "ranges": solver.ranges.to_dict(), "choices": about}, message=message)
        )

    def remeshed(self, front: Front, time_limit: float | None, progress: bool | None) -> Front:
        """The front as it is: each choice is mended when it is made."""
        return front


def _choices(solver: DecisionSolver, preferences: list[tuple[str, Preference, bool]]) -> list[tuple[str, Choice]]:
    """The choices by label, those that were made until the work was to end."""
    found: list[tuple[str, Choice]] = []
    for label, preference, loop in preferences:
        if solver.stopped and found:
            return found
        found.append((label, _chosen(solver, preference, loop)))
    # Later choices may have found better points for earlier ones, of which solves are local.
    for k, (label, preference, loop) in enumerate(preferences):
        if solver.stopped:
            break
        best = preference.rank(solver.known, solver.ranges)
        if not loop and best.values[best.order[0]] < found[k][1].value - SAME_VALUE * max(abs(found[k][1].value), 1.0):
            found[k] = (label, _chosen(solver, preference, loop))
    return found


def _chosen(solver: DecisionSolver, preference: Preference, loop: bool) -> Choice:
    """A choice, of which the point is known from now on."""
    solver.history = []
    choice = raise_lambda(solver, preference) if loop and isinstance(preference, FuzzySatisfactory) else solver.choose(preference)
    solver.known = Points.concatenate([solver.known, choice.point.alone()])
    return choice


def _about(label: str, choice: Choice) -> dict[str, Any]:
    """A choice as plain data."""
    return {
        "label": label,
        "preference": to_dict(choice.preference),
        "degrees": dict(choice.degrees),
        "values": list(choice.values),
        "steps": [asdict(step) for step in choice.history],
        "message": choice.message,
    }


def _plain(label: Any, one: Any) -> dict[str, Any]:
    """A choice as plain data, with the keys that it has checked."""
    if isinstance(one, Preference):
        return to_dict(one)
    if not isinstance(label, str) or not isinstance(one, Mapping) or "method" not in one:
        raise ValueError(f"Decide: choice {label!r} must be a preference as a table with its method and settings, not {one!r}")
    for key in one:
        if key not in KEYS:
            raise ValueError(f"Decide: choice '{label}': {unknown('key', key, KEYS)}")
    varied = one.get("vary", {})
    if not isinstance(varied, Mapping) or not all(isinstance(values, list | tuple) and values for values in varied.values()):
        raise ValueError(f"Decide: choice '{label}': vary must be a table with a list of values for each setting, not {varied!r}")
    if not isinstance(one.get("loop", False), bool):
        raise ValueError(f"Decide: choice '{label}': loop must be true or false, not {one['loop']!r}")
    return dict(one)


def _ranges(given: Any) -> Ranges:
    if isinstance(given, Ranges):
        return given
    if not isinstance(given, Mapping) or set(given) != {"best", "worst"}:
        raise ValueError(f"Decide: ranges must be a table with best and worst, not {given!r}")
    return Ranges(**given)


def _shown(value: Any) -> str:
    return f"{value:g}" if isinstance(value, int | float) else str(value)
