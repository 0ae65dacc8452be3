"""Choice: the point that was chosen, how well it satisfies each objective, and the steps that led to it; a turn of a dialogue."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from problems.compiled import Objective

from ..fronts.point import Point
from ..io.text import html_block, html_table, numbers, text_table
from ..preferences.preference import Preference
from ..preferences.ranges import Ranges, confidence, sense_and_unit
from ..preferences.stage import ordering
from .trade_offs import TradeOffs, trade_offs


@dataclass(frozen=True)
class Step:
    """One step on the way to a choice: a gradient solve of one stage of a preference.

    Attributes
    ----------
    name : str
        Of the stage.
    value : float
        What the stage attained; infinite where a hard limit is exceeded.
    objectives, degrees : dict
        By name, in the user's units and senses; how well each is satisfied.
    status : str
        "converged", or why not.
    about : dict
        Further numbers by name, such as lambda and kappa.
    message : str
        What is to be known of the step.

    Examples
    --------
    >>> from macs.decisions import Step
    >>> Step("achievement", 0.2, {"flight time": 180.0}, {"flight time": 0.8}, "converged").message
    ''
    """

    name: str
    value: float
    objectives: Mapping[str, float]
    degrees: Mapping[str, float]
    status: str
    about: Mapping[str, float] = field(default_factory=dict)
    message: str = ""


@dataclass(frozen=True, eq=False, repr=False)
class Choice:
    """The point that was chosen.

    Attributes
    ----------
    point : Point
        Of the problem itself: simulated, with its `optimality`, and `costates` and `weights` where it is optimal.
    values : tuple of float
        Of the stages of the preference, smaller is better; infinite where a hard limit is exceeded.
    degrees : dict
        How well each objective is satisfied, by name; see the class of the preference.
    history : tuple of Step
        The steps that led to it, in their order.
    preference : Preference
    ranges : Ranges
        By which objectives were normalised.
    message : str
        What is to be known of the choice; usually empty.
    stopped : str
        What ended the work before its end: Ctrl-C or a time limit; usually empty.

    Examples
    --------
    >>> import macs, problems
    >>> problem = problems.load("goddard")
    >>> front = macs.sweep(problem, points=3, starts=1)
    >>> from macs.decisions import ReferencePoint, decide
    >>> choice = decide(problem, ReferencePoint({"flight time": 180.0}), start=front, starts=1)
    >>> sorted(choice.objectives)
    ['flight time', 'horizontal speed']
    """

    point: Point
    values: tuple[float, ...]
    degrees: Mapping[str, float]
    history: tuple[Step, ...]
    preference: Preference
    ranges: Ranges
    message: str = ""
    stopped: str = ""

    @classmethod
    def of(cls, point: Point, preference: Preference, ranges: Ranges, message: str = "") -> Choice:
        """A point that is known, judged by a preference."""
        J = np.array([[*point.objectives.values()]])
        _, values = ordering(preference.stages(point.goals, ranges), J, confidence(point.alone()))
        degrees = dict(zip(point.objectives, preference.degrees(point.goals, ranges, J)[0].tolist(), strict=True))
        return cls(point, tuple(np.nan_to_num(values[0], posinf=np.inf).tolist()), degrees, (), preference, ranges, message)

    @property
    def value(self) -> float:
        """The value of the preference, of its first stage if there are several."""
        return self.values[0]

    @property
    def objectives(self) -> dict[str, float]:
        """Objectives of the point by name, in the user's units and senses."""
        return self.point.objectives

    @cached_property
    def trade_offs(self) -> TradeOffs | None:
        """What more of one objective would cost the others; None for a single objective, and for a point without a trajectory."""
        return trade_offs(self.point) if len(self.point.goals) > 1 and self.point.trajectory is not None else None

    @property
    def stats(self) -> dict[str, Any]:
        """Costs, those of the payoff table included if it was found on the way; the seed, and more, as of a front."""
        return dict(self.point.alone().stats)

    def __repr__(self) -> str:
        return f"<Choice by {self.preference!r}: {self.point.title}; value {self.value:.6g}>"

    def _repr_html_(self) -> str:
        """For notebooks: each objective with its degree, and the point."""
        degrees = [[name, degree_text(degree)] for name, degree in self.degrees.items()]
        table = html_table([["objective", "degree"]], degrees, [True, False])
        return html_block(repr(self.preference), table, [self.message] if self.message else []) + self.point._repr_html_()

    def table(self) -> str:
        """The choice as plain text: each objective with its range and its degree, the steps, and the message."""
        lines = [repr(self.preference), "", self.degrees_table(), ""]
        if self.history:
            about = list(dict.fromkeys(name for step in self.history for name in step.about))
            heads = {"step": [step.name for step in self.history], "status": [step.status for step in self.history]}
            heads["value"] = [f"{step.value:.6g}" for step in self.history]
            heads |= {name: [f"{step.about[name]:.6g}" if name in step.about else "-" for step in self.history] for name in about}
            lines += [choices_table(self.point.goals, heads, self.history, self)]
            lines += [f"{step.name}: {step.message}" for step in self.history if step.message]
        return "\n".join([*lines, *(["", self.message] if self.message else [])])

    def texts(self, name: str, values: Sequence[float]) -> list[str]:
        """Values of an objective as text, with the digits that tables of a front with these ranges have."""
        return numbers(values, (self.point.tolerances or {}).get(name, np.nan), [self.ranges.best[name], self.ranges.worst[name], *values])

    def degrees_table(self) -> str:
        """Each objective with its range and its degree, as plain text."""
        rows = [
            [
                *(goal.name, sense_and_unit(goal)),
                *self.texts(goal.name, [one[goal.name] for one in (self.objectives, self.ranges.best, self.ranges.worst)]),
                degree_text(self.degrees[goal.name]),
            ]
            for goal in self.point.goals
        ]
        return text_table([["objective", "", "chosen", "best", "worst", "degree"]], rows, [True, True, *[False] * 4])


@dataclass(frozen=True, eq=False)
class Turn:
    """One turn of a dialogue.

    Attributes
    ----------
    asked : str
        What the person asked for, in words.
    preference : Preference
        What it means.
    choice : Choice or None
        What was chosen by it; None: nothing yet.
    alternatives : tuple of Choice
        Others about it.

    Examples
    --------
    >>> from macs.decisions import Turn, WeightedSum
    >>> Turn("quicker", WeightedSum({"flight time": 1.0})).choice is None  # nothing chosen yet
    True
    """

    asked: str
    preference: Preference
    choice: Choice | None = None
    alternatives: tuple[Choice, ...] = ()


def choices_table(
    goals: Sequence[Objective], heads: Mapping[str, Sequence[str]], rows: Sequence[Choice | Step | None], last: Choice | None
) -> str:
    """A row for each choice or step as plain text: the cells under each head, then its objectives, with digits as in the last choice, and
    their degrees."""
    titles = [*heads, *(goal.name for goal in goals), *["degree"] * len(goals)]
    units = [*[""] * len(heads), *map(sense_and_unit, goals), *(goal.name for goal in goals)]
    values = [[np.nan if one is None else one.objectives[goal.name] for one in rows] for goal in goals]
    texts = [["-"] * len(rows) if last is None else last.texts(goal.name, column) for goal, column in zip(goals, values, strict=True)]
    cells = [
        [
            *own,
            *(column[k].replace("nan", "-") for column in texts),
            *("-" if one is None else degree_text(one.degrees[goal.name]) for goal in goals),
        ]
        for k, (one, *own) in enumerate(zip(rows, *heads.values(), strict=True))
    ]
    return text_table([titles, units], cells, [title in ("step", "status", "asked") for title in titles])


def degree_text(degree: float) -> str:
    """A degree as text; "-" for an objective that does not enter."""
    return "-" if np.isnan(degree) else f"{degree + 0.0:.3f}"
