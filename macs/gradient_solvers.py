"""Gradient tools as solvers, so that studies and the command line can name them beside searches."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from problems.checks import check_choice, check_count
from problems.compiled import CompiledProblem
from problems.problem import Problem
from problems.vector import CompiledVectorProblem, without_dynamics
from transcription.base import Transcription

from .evaluation.evaluator import CONVERGED, Evaluator
from .front import Front
from .fronts.builders import nearest_violation
from .gradient_tools import AUTO, check_starts, optimize, payoff, sweep
from .gradients.ends import METHODS, check_points
from .solvers.solver import Solver
from .solvers.start import Call, drawing

MESHES = ("fixed", "mended", "adaptive", "density")


@dataclass(frozen=True)
class GradientSolver(Solver):
    """A gradient tool with the calls and the contract of a solver; see `Optimum`, `Payoff` and `Sweep`.

    It evaluates no candidates: `evaluations` and `inner` are not used, and its cost is in `gradient_solves` and `inner_iterations`. No
    checkpoint keeps a run of it: it begins again.
    """

    starts: int | str = AUTO  # number of starts of each solve; "auto": as many as pay, see `macs.optimize`
    # What follows on a transcription that is given: nothing; points that a simulation does not confirm are solved again (`Front.mended`);
    # each point gets a mesh of its own (`Front.refine_mesh`); or as many elements, where trajectories need them
    # (`Front.refine_mesh(more=False)`).
    mesh: str = "fixed"

    def __post_init__(self) -> None:
        name = type(self).__name__
        check_starts(f"{name}: starts", self.starts)
        check_choice(f"{name}: mesh", self.mesh, MESHES)

    def check_vector(self, problem: CompiledVectorProblem) -> None:
        """Raise ValueError: there are no derivatives."""
        raise ValueError(f"{type(self).__name__} needs derivatives, but {without_dynamics(problem.name)}: use a search, such as MACS")

    @abstractmethod
    def find(self, problem: Problem | CompiledProblem, transcription: Transcription | None, **terms: Any) -> Front:
        """The front of the gradient tool; `terms` are arguments that all of these have."""

    @property
    def searches_until_done(self) -> bool:
        """See `SearchMethod.searches_until_done`: it evaluates no candidates."""
        return True

    def _solve(
        self,
        problem: Problem | CompiledProblem,
        transcription: Transcription | None,
        inner: Any,
        start: Any,
        verify: float | None,
        call: Call,
    ) -> Front:
        """The front of `find` on the meshes of the setting. Words for random first candidates are not used."""
        remeshed = transcription is not None and self.mesh in ("adaptive", "density")
        terms = {
            "start": start if drawing(start) is None else None,
            "starts": self.starts,
            **{name: getattr(call, name) for name in ("seed", "tolerance", "time_limit", "progress")},
        }
        front = self.find(problem, transcription, **terms, verify=None if remeshed else verify)
        left = None if call.time_limit is None else call.time_limit - front.stats["wall_time"]
        if transcription is not None and "stopped" not in front.stats and len(front) and (left is None or left > 0.0):
            front = self.remeshed(front, left, call.progress)
        return front.verify(verify) if remeshed and verify is not None else front

    def remeshed(self, front: Front, time_limit: float | None, progress: bool | None) -> Front:
        """What was found on a transcription that was given, on the meshes that the setting asks for."""
        if self.mesh == "fixed":
            return front
        if self.mesh == "mended":
            return front.mended(time_limit=time_limit, progress=progress)
        return front.refine_mesh(more=self.mesh == "adaptive", time_limit=time_limit, progress=progress)

    @property
    def certifies(self) -> bool:
        """See `SearchMethod.certifies`."""
        return True

    def begin(self, evaluator: Evaluator, budget: int, rng: np.random.Generator, start: np.ndarray | None = None) -> Any:
        """Not possible: there are no derivatives of a plain function. Raises ValueError."""
        self._refuse()

    def advance(self, state: Any, evaluator: Evaluator, budget: int) -> None:
        """See `begin`."""
        self._refuse()

    def _refuse(self) -> NoReturn:
        raise ValueError(f"{type(self).__name__} needs derivatives: it solves problems with dynamics, not plain functions")


@dataclass(frozen=True)
class Payoff(GradientSolver):
    """The ends of a front by gradients: `macs.payoff` as a solver."""

    def find(self, problem: Problem | CompiledProblem, transcription: Transcription | None, **terms: Any) -> Front:
        """See `payoff`."""
        return payoff(problem, transcription, **terms)


@dataclass(frozen=True)
class Optimum(GradientSolver):
    """The best of one objective by gradients, a front of one point: `macs.optimize` as a solver."""

    objective: str | None = None  # its name. Default: the first one.

    def find(self, problem: Problem | CompiledProblem, transcription: Transcription | None, **terms: Any) -> Front:
        """See `optimize`, also for what it raises where it is ended before the first solve. If no solve converged, the front is empty, and
        `closest` is the least infeasible point."""
        point = optimize(problem, transcription, objective=self.objective, **terms)
        alone = point.alone()
        if point.status != CONVERGED:
            alone = alone.take([]).replace(closest=point, message=f"no solve converged; {nearest_violation(point)}")
        return Front.of(alone)


@dataclass(frozen=True)
class Sweep(GradientSolver):
    """A front by gradients, point after point: `macs.sweep` as a solver."""

    points: int = 10
    method: str = "pascoletti-serafini"  # see `macs.sweep`

    def __post_init__(self) -> None:
        super().__post_init__()
        check_count("Sweep: points", self.points, 2)
        check_choice("Sweep: method", self.method, METHODS)

    def check_objectives(self, m: int) -> None:
        """See `SearchMethod.check_objectives`."""
        check_points(self.points, m)

    def find(self, problem: Problem | CompiledProblem, transcription: Transcription | None, **terms: Any) -> Front:
        """See `sweep`."""
        return sweep(problem, transcription, points=self.points, method=self.method, **terms)
