"""The contract of a search method: settings that begin a search, advance it and conclude it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import asdict, is_dataclass
from typing import Any

import numpy as np

from problems.compiled import CompiledProblem
from transcription.base import Transcription

from ..evaluation.evaluator import Evaluator
from ..front import Front


class SearchMethod(ABC):
    """A search over several objectives, step by step.

    An implementation is a frozen dataclass of its settings with the two methods `begin` and `advance`. Its state is all that it knows
    between two iterations, and has `archive` and `closest`, each with rows `Z`, `F` and `violation`.

    A run can be kept in a checkpoint, and continue from it to the same bits. For that, the state is a dataclass of the class that `begin`
    (or what `makes_state` names) is annotated to return. Names in that annotation and in those of the fields exist at run time, not only
    for type checkers. The fields are numpy arrays (of numbers, bool or str), int, float, bool, str, None, numpy.random.Generator,
    dataclasses of these, and lists, tuples, dicts (`dict[str, ...]`) or Counters of these, annotated in full. `X | None` may be missing;
    other unions and `Any` are refused. The state is rebuilt from its fields alone, without `__init__`. So nothing else may change between
    two iterations, neither in the solver nor in objects that the state refers to; no generator may be in two fields; and arrays that are
    changed in place must not share their memory with others. An error names the field that does not comply. Budget and evaluator do not
    belong to the state.
    """

    @abstractmethod
    def begin(self, evaluator: Evaluator, budget: int, rng: np.random.Generator, start: np.ndarray | None = None) -> Any:
        """Evaluate a first population, of which the full vectors `start` (k, D) are the first; returns the state."""

    @abstractmethod
    def advance(self, state: Any, evaluator: Evaluator, budget: int) -> None:
        """One iteration, within the budget of evaluations."""

    def conclude(self, state: Any, evaluator: Evaluator) -> None:  # noqa: B027
        """Finish the state of a search that ended by itself, beyond its evaluations. Most solvers do nothing.

        If the work is to end early (`transcription.stopping`), the state keeps what was reached. A checkpoint may keep the state before
        each batch of this: called with that state, it continues to the same bits.
        """

    def tells(self, state: Any, tolerance: float) -> dict[str, Any]:
        """Entries of the state for the `stats` of a front, as plain data; for most solvers none."""
        return {}

    @property
    def makes_state(self) -> Callable[..., Any]:
        """The method that is annotated to return the class of the state, which checkpoints need."""
        return self.begin

    @property
    def certifies(self) -> bool:
        """Whether points of its fronts are to carry their `optimality`."""
        return False

    def check_objectives(self, m: int) -> None:  # noqa: B027 - most solvers have nothing to refuse
        """Raise ValueError if the settings do not suit m objectives. Called before any work, as soon as m is known."""

    def check_transcription(self, transcription: Transcription, problem: CompiledProblem) -> None:  # noqa: B027
        """Raise ValueError if the settings do not suit the transcription of a problem. Called before any work."""

    def finish(self, front: Front, time_limit: float | None, progress: bool) -> Front:
        """Further work on the front of a search that ended by itself, within so many seconds. Most solvers do none."""
        return front

    def about(self) -> dict[str, Any]:
        """Name and settings as plain data, for fronts and checkpoints."""
        if not is_dataclass(self):
            raise TypeError(f"{type(self).__name__} must be a dataclass of its settings, which its fronts record")
        return {"name": type(self).__name__, "settings": asdict(self)}
