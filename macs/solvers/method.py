"""Contract of a search method: it begins a search, advances it step by step, and concludes it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import asdict, is_dataclass
from typing import Any, get_type_hints

import numpy as np

from problems.checks import short_repr
from problems.compiled import CompiledProblem, Objective
from problems.vector import CompiledVectorProblem
from transcription.base import Transcription

from ..evaluation.evaluator import Evaluator
from ..front import Front
from ..refinement.mesh_search import SearchMeshes


class SearchMethod(ABC):
    """Search over several objectives, step by step.

    An implementation is a frozen dataclass of its settings with the two methods `begin` and `advance`. Its state has all data of the search
    between two iterations, among them `archive` and `closest`, each with columns `Z`, `F` and `violation` (see `Archive`). Budget and
    evaluator do not belong to the state.

    A checkpoint keeps the state, so that a run can continue to the same bits. For that:

    - The state is a dataclass, of the class in the return annotation of `begin`, or of another `state_class`.
    - Its fields are numpy arrays (of numbers, bool or str), int, float, bool, str, None, numpy.random.Generator, dataclasses of these, and
      lists, tuples, dicts (`dict[str, ...]`) or Counters of these. They are annotated in full, with names that exist at run time. `X |
      None` is allowed; other unions and `Any` are not.
    - The state is rebuilt from its fields alone, without `__init__`. Nothing else may change between two iterations, neither in the solver
      nor in objects that the state refers to.
    - No generator is in two fields. Arrays that are changed in place do not share memory with others.

    An error names the field that breaks one of these rules.
    """

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(**more)
        if "__repr__" not in vars(cls):  # dataclasses keep it
            cls.__repr__ = short_repr  # type: ignore[method-assign]

    @abstractmethod
    def begin(self, evaluator: Evaluator, budget: Any, rng: np.random.Generator, start: np.ndarray | None = None) -> Any:
        """The state after the evaluation of a first population, the full vectors `start` (k, D) first; `budget` is the number of
        evaluations, None for a search until it is done."""

    @abstractmethod
    def advance(self, state: Any, evaluator: Evaluator, budget: int) -> None:
        """Do one iteration within the budget of evaluations; changes `state`."""

    @property
    def searches_until_done(self) -> bool:
        """Whether a search needs no number of evaluations: it goes on in rounds, and ends when more work no longer changes the front.

        For that: `begin` with the budget None; `round_end`, up to which `advance` is called; `conclude` at the end of each round, which
        begins the next one in the state, unless `ended` then says why there is none.
        """
        return False

    def round_end(self, state: Any) -> int:
        """Number of evaluations at which the current round ends."""
        raise NotImplementedError(f"{type(self).__name__} needs a number of evaluations")

    def ended(self, state: Any) -> str:
        """Why a search is at its end, by the state alone, a word of `run.ENDED`; empty as long as it continues."""
        return ""

    def conclude(self, state: Any, evaluator: Evaluator) -> None:  # noqa: B027
        """Do the final work, such as a polish, after the last evaluation of a search that was not stopped, or of one of its rounds; most
        solvers do nothing.

        If asked to end early (`transcription.stopping`), the state keeps the results so far. A checkpoint may keep the state before each
        batch of this work: called with that state, it continues to the same bits.
        """

    def extra_stats(self, state: Any, evaluator: Evaluator) -> dict[str, Any]:
        """Further entries of a front's `stats`, as plain data; none for most solvers."""
        return {}

    @property
    def state_class(self) -> type:
        """The class of the state, for checkpoints. Raises ValueError if the annotation of `begin` does not say it."""
        name = type(self).__name__
        try:
            found = get_type_hints(self.begin).get("return")
        except NameError as error:
            raise ValueError(f"checkpoint: what {name}.begin returns is not known at run time: {error}") from error
        if not (isinstance(found, type) and is_dataclass(found)):
            raise ValueError(f"checkpoint: {name}.begin is not annotated with the class of the state that it returns")
        return found

    @property
    def certifies(self) -> bool:
        """Whether the points of its fronts get their `optimality`."""
        return False

    def check_objectives(self, m: int) -> None:  # noqa: B027 - most solvers have nothing to refuse
        """Raise ValueError if the settings do not suit m objectives. Called before any work, as soon as m is known."""

    def check_goals(self, goals: Sequence[Objective]) -> None:  # noqa: B027
        """Raise ValueError if the settings do not suit these objectives. Called before any work, as soon as they are known."""

    def check_transcription(self, transcription: Transcription, problem: CompiledProblem) -> None:  # noqa: B027
        """Raise ValueError if the settings do not suit the transcription of a problem. Called before any work."""

    def check_vector(self, problem: CompiledVectorProblem) -> None:  # noqa: B027
        """Raise ValueError if the solver or its settings need dynamics or derivatives. Called before any work."""

    @property
    def remeshes(self) -> bool:
        """Whether `finish` solves points on finer meshes, so that a search may use a coarse one."""
        return False

    def finish(self, front: Front, verify: float | None, progress: bool | None, chosen: SearchMeshes | None = None) -> Front:
        """The front, marked by a simulation of its points unless `verify` is None, after further work.

        Called if the search was not stopped. Most solvers do no further work. The time limit of the call holds for it, too. `chosen` is
        what was found out about the mesh, where none was given.
        """
        return front.verify(verify)

    def about(self) -> dict[str, Any]:
        """Name and settings of the solver as plain data, for fronts and checkpoints."""
        if not is_dataclass(self):
            raise TypeError(f"{type(self).__name__} must be a dataclass of its settings, since fronts record them")
        return {"name": type(self).__name__, "settings": asdict(self)}
