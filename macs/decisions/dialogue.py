"""Dialogue: choosing with a person, step by step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from os import PathLike
from textwrap import shorten
from typing import TYPE_CHECKING, Any

import numpy as np

from problems.catalogue import is_catalogued
from problems.checks import check_count
from problems.compiled import CompiledProblem, Objective
from problems.problem import Problem
from transcription.base import Transcription, check_method, check_problem
from transcription.catalogue import from_dict

from ..evaluation.evaluator import CONVERGED
from ..front import Front
from ..fronts.point import Point
from ..fronts.points import Points
from ..fronts.verified import VERIFY
from ..io.atomic import check_target
from ..io.text import counted
from ..preferences.achievement import ReferencePoint
from ..preferences.catalogue import from_dict as preference_from_dict
from ..preferences.catalogue import to_dict
from ..preferences.preference import Preference
from ..preferences.ranges import Ranges, confidence, shown
from ..refinement.places import achieved
from .choice import Choice, Turn, choices_table
from .decide import decide
from .dialogue_file import FILE_VERSION, FORMAT, ChoiceRecord, DialogueRecord, TurnRecord, packed, read, readable, write
from .improving import around, improved, neutral

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ONLY_RANKED = "only points that are known were ranked, since there is no problem to solve"
BLACK_BOX = "only points that are known were ranked, since a black box has no derivatives"


class Dialogue:
    """Choosing with a person: what they ask for, what is chosen by it, and what they ask for next.

    With a problem, points are found by `decide`, from the points of the front and those chosen before; without one, these points are only
    ranked, and the messages of choices say so. A call that raises an error adds no turn.

    Parameters
    ----------
    front : Front
        Of any solver; of a black box, too.
    problem : Problem, optional
        That of the front.
    transcription : Transcription, optional
        For `decide`. Default: meshes that are found.
    ranges : Ranges, optional
        By which objectives are normalised. Default: those of the front.
    seed : int
        Of random starts.

    Attributes
    ----------
    front, problem, transcription, ranges, seed
    history : tuple of Turn

    Raises
    ------
    ValueError
        For a front without feasible points, and a problem that is not that of the front.

    Examples
    --------
    >>> import macs, problems
    >>> front = macs.sweep(problems.load("goddard"), points=3, starts=1)
    >>> from macs.decisions import Dialogue, ReferencePoint
    >>> dialogue = Dialogue(front)  # without the problem, points are ranked
    >>> choice = dialogue.prefer(ReferencePoint({"flight time": 180.0}))
    >>> choice = dialogue.choose()
    >>> choice = dialogue.improve("horizontal speed")
    >>> dialogue.save("dialogue.json")
    >>> len(Dialogue.load("dialogue.json").history) == len(dialogue.history)
    True
    """

    def __init__(
        self,
        front: Points,
        problem: Problem | CompiledProblem | None = None,
        transcription: Transcription | None = None,
        *,
        ranges: Ranges | None = None,
        seed: int = 0,
    ) -> None:
        if not isinstance(front, Points):
            raise ValueError(f"a dialogue is about a front, not {front!r}")
        if not (front.status == CONVERGED).any():
            raise ValueError(f"the front has no feasible point to choose{f': {front.message}' if front.message else ''}")
        self.problem: CompiledProblem | None = None
        if problem is not None:
            if front.source is None:
                raise ValueError("the front is of a black box: it has no problem")
            check_problem(problem)
            self.problem = front.source.check(problem, "the front")
            front = front.replace(problem=self.problem)
        check_method(transcription)
        check_count("seed", seed, 0)
        self.front, self.transcription, self.seed = Front.of(front), transcription, int(seed)
        self.ranges = Ranges.of(front) if ranges is None else ranges
        self.ranges.ends(front.goals)
        self.history: tuple[Turn, ...] = ()

    def __repr__(self) -> str:
        last = "nothing chosen yet" if self.choice is None else self.choice.point.title
        return f"<Dialogue of {counted(len(self.history), 'turn')}: {last}>"

    @property
    def goals(self) -> tuple[Objective, ...]:
        """The objectives."""
        return self.front.goals

    @property
    def preference(self) -> Preference:
        """What is asked for at present; at first to be as near as can be to the best values of all objectives."""
        return self.history[-1].preference if self.history else neutral(self.ranges)

    @property
    def choice(self) -> Choice | None:
        """The latest choice; None if there is none yet."""
        return next((turn.choice for turn in reversed(self.history) if turn.choice is not None), None)

    @property
    def alternatives_found(self) -> tuple[Choice, ...]:
        """What `alternatives` found for the present turn."""
        return self.history[-1].alternatives if self.history else ()

    @property
    def known(self) -> Front:
        """The points of the front, and after these those that were found in the dialogue."""
        if not self.found:
            return self.front
        several = [self.front, *(point.alone() for point in self.found)]
        # A front that was not simulated does not say what its points may miss.
        verify = [points.stats["verify"] for points in several if "verify" in points.stats][:1]
        known = Points.concatenate(several)
        return Front.of(known.replace(stats={**known.stats, **({"verify": verify[0]} if verify else {})}))

    @property
    def found(self) -> list[Point]:
        """The points of the history that are not of the front, each once."""
        every = [one.point for turn in self.history for one in (turn.choice, *turn.alternatives) if one is not None]
        return list({(id(point._points), point.index): point for point in every if point._points is not self.front}.values())

    # What a person asks for

    def prefer(self, preference: Preference, asked: str | None = None) -> None:
        """Ask for something else from now on; `choose` makes a choice by it.

        Parameters
        ----------
        preference : Preference
        asked : str, optional
            The same in words, for the history. Default: the name of the method and the objectives.

        Raises
        ------
        ValueError
            If it is of other objectives, or asks for values beyond the ranges.
        """
        if not isinstance(preference, Preference):
            raise ValueError(f"preference must be a Preference such as WeightedSum({{'flight time': 1.0}}), not {preference!r}")
        preference.check(self.goals)
        preference.stages(self.goals, self.ranges)
        self.history = (*self.history, Turn(asked or preference.words, preference))

    def choose(self, preference: Preference | None = None, asked: str | None = None) -> Choice:
        """The choice by what is asked for at present, made once; or by a preference that is asked for now, as by `prefer`."""
        before = self.history
        if preference is not None:
            self.prefer(preference, asked)
        turn = self.history[-1] if self.history else Turn("near the best of all", self.preference)
        if turn.choice is None:
            try:
                turn = replace(turn, choice=self._chosen(turn.preference))
            except BaseException:
                self.history = before
                raise
            self.history = (*self.history[:-1], turn)
        assert turn.choice is not None
        return turn.choice

    def improve(self, name: str, to: float | None = None, giving: Mapping[str, float] | None = None) -> Choice:
        """The choice where one objective is better than in the present choice, which stays in the history.

        In physical programming the boundaries are moved accordingly (steps 5 to 7 of Chai and others 2017); other preferences become a
        `Nimbus` from the present choice. Either way the objective may not become worse than it is.

        Parameters
        ----------
        name : str
        to : float, optional
            The value asked for. Default: as good as can be.
        giving : dict, optional
            By name: the values until which others may become worse; those that are not named then may not. Without it, others may change
            as they will, in physical programming within their boundaries.

        Raises
        ------
        ValueError
            For unknown names, a value that is not better than the present one or lies beyond its range, and limits that are not worse.
        """
        now = self.choose()
        wanted = improved(self.preference, self.ranges, now.point, name, to, giving)
        return self.choose(wanted, self._asked(name, to, giving or {}))

    def alternatives(self, k: int = 4) -> tuple[Choice, ...]:
        """Up to k other choices about the present one, judged by what is asked for at present. `take` makes one of them the present one.

        Each has the present values as its reference point, but for one objective in turn, which is better by a tenth of its range, in the
        next round by two tenths, and so on. What exceeds hard limits that the present choice meets is left out, and so is what is there
        already. Ctrl-C ends it without any.
        """
        check_count("k", k, 1)
        now = self.choose()
        found: list[Choice] = []
        for part in (0.1 * k for k in range(1, 6)):
            for goal in self.goals:
                preference = around(self.ranges, now.point, goal, part)
                if len(found) == k or preference is None:
                    continue
                one = self._another(preference, [now, *found])
                if one is not None and np.isfinite(one.value) >= np.isfinite(now.value):
                    found.append(one)
        self.history = (*self.history[:-1], replace(self.history[-1], alternatives=tuple(found)))
        return tuple(found)

    def take(self, number: int) -> Choice:
        """Make one of the `alternatives`, counted from 1, the present choice.

        Raises ValueError if there is none of that number.
        """
        there = self.alternatives_found
        if isinstance(number, bool) or not isinstance(number, int | np.integer) or not 1 <= number <= len(there):
            known = f"there are 1 to {len(there)}" if there else "ask for `alternatives` first"
            raise ValueError(f"there is no alternative {number!r}: {known}")
        turn = Turn(f"alternative {number}", self.preference, there[number - 1])
        self.history = (*self.history, turn)
        return there[number - 1]

    def undo(self) -> None:
        """Forget the last turn.

        Raises ValueError if there is none.
        """
        if not self.history:
            raise ValueError("there is nothing to undo")
        self.history = self.history[:-1]

    # Seeing and storing

    def table(self) -> str:
        """The history as plain text: a row for each turn, with the objectives and their degrees."""
        turns = self.history
        heads = {"turn": [str(k + 1) for k in range(len(turns))], "asked": [shorten(turn.asked, 60, placeholder=" …") for turn in turns]}
        return choices_table(self.goals, heads, [turn.choice for turn in turns], self.choice)

    def plot(self, by: Preference | None = None, figure: Any = None) -> Sequence[Axes]:
        """Axes with the degrees of all choices as bars, turn by turn, and one for each objective with its values.

        Parameters
        ----------
        by : Preference, optional
            Whose degrees are shown. Default: of each turn its own; the first turn's where they go opposite ways.
        figure : Figure, optional
            Default: a new one.

        Raises
        ------
        ValueError
            If nothing was chosen yet.
        """
        from .figures import draw_history

        made = [(turn.asked, turn.choice) for turn in self.history if turn.choice is not None]
        return draw_history(self.goals, self.ranges, [asked for asked, _ in made], [choice for _, choice in made], by, figure)

    def save(self, path: str | PathLike[str]) -> None:
        """Write everything to one JSON file, whole or not at all: the present choice, the history, and all points.

        Raises
        ------
        OSError
            If it cannot be written; a file that was there before is still there.
        ValueError
            For a preference of a class of the user's own.
        """
        check_target(path)
        write(self._record(), path)

    @staticmethod
    def load(path: str | PathLike[str], problem: Problem | CompiledProblem | None = None, trust: bool = False) -> Dialogue:
        """Read a dialogue that `save` wrote; it goes on where it was. No code of the file is run.

        Parameters
        ----------
        path : path
        problem : Problem, optional
            Needed to go on with `decide` for a problem that is not in the catalogue; without it, points are ranked.
        trust : bool
            Whether the code at the address of the problem may be run.

        Raises
        ------
        FileNotFoundError
            If there is no such file.
        ValueError
            If it is not a dialogue, is damaged, or of another problem.
        """
        record, points = read(path)
        if problem is None and record.solves:
            problem = own_problem(points, trust)
        with readable(path):
            ranges = Ranges(**record.ranges)
            method = None if record.transcription is None else from_dict(record.transcription)
            dialogue = Dialogue(points[: record.front], problem, method, ranges=ranges, seed=record.seed)
            dialogue._restore(record, points if problem is None else points.replace(problem=dialogue.problem))
        return dialogue

    def _record(self) -> DialogueRecord:
        """What a file has."""
        every = [*self.front, *self.found]
        place = {(id(point._points), point.index): k for k, point in enumerate(every)}

        def one(choice: Choice) -> ChoiceRecord:
            return ChoiceRecord(
                point=place[id(choice.point._points), choice.point.index],
                objectives=choice.objectives,
                degrees=dict(choice.degrees),
                values=list(choice.values),
                verified=choice.point.verified,
                message=choice.message,
            )

        return DialogueRecord(
            format=FORMAT,
            version=FILE_VERSION,
            choice=None if self.choice is None else one(self.choice),
            units=dict(zip(self.front.names, self.front.units, strict=True)),
            senses=dict(zip(self.front.names, self.front.senses, strict=True)),
            ranges=self.ranges.to_dict(),
            seed=self.seed,
            solves=self.problem is not None,
            transcription=None if self.transcription is None else self.transcription.to_dict(),
            history=[
                TurnRecord(
                    asked=turn.asked,
                    preference=to_dict(turn.preference),
                    choice=None if turn.choice is None else one(turn.choice),
                    alternatives=[one(each) for each in turn.alternatives],
                )
                for turn in self.history
            ],
            front=len(self.front),
            points=packed(self.known),
        )

    def _restore(self, record: DialogueRecord, points: Points) -> None:
        """Take the history from a file, with its points."""

        def one(choice: ChoiceRecord, preference: Preference) -> Choice:
            if not 0 <= choice.point < len(points):
                raise ValueError(f"it has no point {choice.point}")
            point = self.front[choice.point] if choice.point < record.front else points[choice.point]
            return Choice.of(point, preference, self.ranges, choice.message)

        for turn in record.history:
            preference = preference_from_dict(turn.preference)
            self.prefer(preference, turn.asked)
            chosen = None if turn.choice is None else one(turn.choice, preference)
            others = tuple(one(each, preference) for each in turn.alternatives)
            self.history = (*self.history[:-1], Turn(turn.asked, preference, chosen, others))

    def _chosen(self, preference: Preference) -> Choice:
        known = self.known
        if self.problem is not None and self.transcription is None and isinstance(preference, ReferencePoint):
            slopes, hoped = np.array(preference.lines(self.goals, self.ranges)).T
            with suppress(ValueError):  # of a front with too few points
                point = achieved(known, hoped * self.front.signs, 1.0 / np.abs(slopes))[0]
                if point.verified:
                    return Choice.of(self._own(point), preference, self.ranges)
        if self.problem is not None:
            verify = self.front.stats.get("verify", VERIFY)
            choice = decide(self.problem, self.transcription, preference, ranges=self.ranges, start=known, seed=self.seed, verify=verify)
            return replace(choice, point=self._own(choice.point))
        ranking = preference.rank(known, self.ranges)
        words = ONLY_RANKED if self.front.dynamic else BLACK_BOX
        return Choice.of(self._own(ranking.best), preference, self.ranges, " ".join(filter(None, [ranking.message, f"{words}."])))

    def _another(self, preference: Preference, others: Sequence[Choice]) -> Choice | None:
        """The choice by a preference that is not there already, judged by what is asked for at present; None if there is none."""
        spans = self.ranges.spans(self.goals)
        taken = np.array([[*one.objectives.values()] for one in others])

        def new(J: np.ndarray) -> bool:
            return bool(np.all(np.max(np.abs(taken - J) / spans, axis=1) > 1e-3))

        if self.problem is not None:
            one = self._chosen(preference)
            if one.stopped:
                raise KeyboardInterrupt(one.stopped)
            found = [one.point] if new(np.array([*one.objectives.values()])) else []
            message = one.message
        else:
            known = self.known
            order = [int(i) for i in preference.rank(known, self.ranges).order if confidence(known)[i] < 2]
            found = [self._own(known[i]) for i in order[: len(others) + 1] if new(known.objectives[i])][:1]
            message = ""
        return Choice.of(found[0], self.preference, self.ranges, message) if found else None

    def _own(self, point: Point) -> Point:
        """The same point as the front or the history have it, if it is there."""
        of_front = np.flatnonzero((self.front.F == point.F).all(axis=1))
        there = [*(self.front[int(i)] for i in of_front), *(one for one in self.found if np.array_equal(one.F, point.F))]
        return next((one for one in there if np.array_equal(one.decision, point.decision)), point)

    def _asked(self, name: str, to: float | None, giving: Mapping[str, float]) -> str:
        """What `improve` asks for, in words."""
        goals = {goal.name: goal for goal in self.goals}
        limits = " and ".join(f"{other} until {shown(limit, goals[other])}" for other, limit in giving.items())
        return f"better {name}{'' if to is None else f': {shown(to, goals[name])}'}{f', giving {limits}' if giving else ''}"


def own_problem(points: Points, trust: bool) -> Problem | None:
    """The problem that points name, if it has dynamics and may be loaded: it is in the catalogue, or its code is trusted."""
    source = points.source
    if source is None or source.vector or not source.address or not (trust or is_catalogued(source.address)):
        return None
    return replace(source, trusted=trust).load()
