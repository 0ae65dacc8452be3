"""Shooting: the dynamics integrated by explicit Runge-Kutta steps under controls that are given by their values at nodes.

Betts, "Practical Methods for Optimal Control and Estimation Using Nonlinear Programming", 2nd ed., SIAM 2010, 3.3 and 3.4 (single and
multiple shooting); Bock and Plitt, "A multiple shooting algorithm for direct solution of optimal control problems", IFAC 1984. For the
steps see `runge_kutta.py`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from problems.checks import check_choice, check_count
from problems.compiled import CompiledPhase, CompiledProblem
from problems.problem import Problem

from ..assembly import Assembly
from ..base import NLP, Transcription
from ..meshed import Meshed
from ..meshes.refinement import by_density, next_intervals
from ..phases.layout import Layout
from ..phases.mesh import PhaseMesh
from ..phases.rows import EndSlots
from ..trajectories.trajectory import PhaseTrajectory, Trajectory
from .control_law import DEGREES, ControlLaw
from .phase import ShootingPhase
from .runge_kutta import TABLEAUX, check_steps
from .step import RungeKuttaStep, StepMesh


@dataclass(frozen=True, kw_only=True)
class Shooting(Transcription):
    """Settings and transcription that single and multiple shooting share.

    Parameters
    ----------
    scheme : str
        A Runge-Kutta method: "euler", "midpoint", "heun", "kutta3", "rk4", "rk38" (the 3/8 rule) or "rk8" (Cooper and Verner's of order 8).
    steps : int
        Equal steps of that method on each interval.
    control : "constant", "linear" or "spline"
        Controls between their nodes: constant, with a value for each interval between two of them; straight lines or a cubic
        spline through a value at each. Constant and linear ones stay within their bounds everywhere, splines only at the nodes.
    control_nodes : int, optional
        Number of equally spaced nodes of the controls, both ends among them; by default those of the states. No step leads across one:
        where they fall into a step, it is divided. Among intervals of other lengths they lie in the same intervals, at the same parts.
    path_points : int
        Path constraints are imposed, and peaks sampled, at the ends of all steps and at as many equally spaced points inside each, which
        are reached by a step of the same method of that part of its length.

    Raises
    ------
    ValueError
        For numbers that are no integers or too small, an unknown scheme or kind of control.
    """

    scheme: str = "rk4"
    steps: int = 1
    control: str = "constant"
    control_nodes: int | None = None
    path_points: int = 0

    further = ("steps",)
    options = {"control": tuple(DEGREES), "control_nodes": (), "scheme": tuple(TABLEAUX)}  # noqa: RUF012 - never changed
    _counted: ClassVar[tuple[str, int]]
    """The setting from which the number of intervals follows, and its least value, which makes one."""
    _apart: ClassVar[bool]
    """Whether the states at the nodes are variables of their own."""

    def __post_init__(self) -> None:
        name = type(self).__name__
        for setting, least in (self._counted, ("steps", 1), ("path_points", 0)):
            check_count(f"{name}: {setting}", getattr(self, setting), least)
        if self.control_nodes is not None:
            check_count(f"{name}: control_nodes", self.control_nodes, 2)
        check_choice(f"{name}: scheme", self.scheme, TABLEAUX)
        check_choice(f"{name}: control", self.control, DEGREES)

    def transcribe(self, problem: Problem | CompiledProblem) -> NLP:
        """Write `problem` as an NLP; see `Transcription.transcribe`. Raises ValueError, too, where steps are too long to be stable."""
        compiled = problem.compile()
        self._check_steps(compiled)

        def writer(phase: CompiledPhase, layout: Layout, ends: EndSlots) -> ShootingPhase:
            mesh, points = self.mesh_of(phase.name), [i / (self.path_points + 1) for i in range(self.path_points + 1)]
            law = self._law(mesh)
            if law.jumps and _sees_controls(phase):
                points.append(1.0)
            step = RungeKuttaStep(TABLEAUX[self.scheme], law.degree, points, phase)
            return ShootingPhase(self._steps(mesh), law, step, phase, layout, ends, apart=self._apart)

        return Assembly(compiled, writer).nlp(self)

    def _check_steps(self, problem: CompiledProblem) -> None:
        """Raise ValueError where steps are too long to be stable."""
        meshes, (count, _) = {phase.name: self.mesh_of(phase.name) for phase in problem.phases}, self._counted
        places = {name: self._steps(mesh).places for name, mesh in meshes.items()}
        own = [name for name, mesh in meshes.items() if mesh != Shooting.mesh_of(self, name)]
        settings = {count: getattr(self, count), "steps": self.steps}
        check_steps(problem, TABLEAUX[self.scheme], places, type(self).__name__, settings, own)

    def mesh_of(self, phase: str) -> PhaseMesh:
        """The intervals of a phase, by its name: equal ones."""
        setting, least = self._counted
        return PhaseMesh.uniform(getattr(self, setting) - least + 1, TABLEAUX[self.scheme].order)

    def _law(self, mesh: PhaseMesh) -> ControlLaw:
        """Controls on nodes that lie among these intervals as equally spaced ones do among equal intervals."""
        nodes = self.control_nodes or mesh.elements + 1
        return ControlLaw(self.control, PhaseMesh(tuple(mesh.image(np.linspace(0.0, 1.0, nodes)).tolist()), DEGREES[self.control]))

    def _steps(self, mesh: PhaseMesh) -> StepMesh:
        """The steps of a phase on these intervals: equal within each, but for those that a node of the controls divides."""
        return StepMesh.of(mesh.elements, self.steps, np.linspace(0.0, 1.0, self.control_nodes or mesh.elements + 1)).on(mesh)


@dataclass(frozen=True)
class SingleShooting(Shooting):
    """Each phase is integrated in one go from its initial states; its final states are the only ones that are variables.

    Made for searches that propagate their candidates (`inner="propagate"`): one pass gives trajectory, objectives and all residuals.
    Bounds of states are imposed at the nodes. Gradient tools work, too, but the cost of derivatives grows with the square of the number of
    nodes: `MultipleShooting` is made for these. Derivatives that would take more than 2 GB are refused.

    Parameters
    ----------
    nodes : int
        Number of nodes of each phase, at least 2, equally spaced, both ends included.
    scheme, steps, control, control_nodes, path_points
        See `Shooting`; `steps` are those between two nodes.

    Examples
    --------
    >>> from problems import load
    >>> from transcription import SingleShooting
    >>> nlp = SingleShooting(40, control="linear").transcribe(load("goddard"))
    >>> len(nlp.variables) >= len(nlp.free)
    True
    """

    nodes: int

    _counted = "nodes", 2
    _apart = False
    word = "shooting"
    examples = (
        "shooting:200 (200 nodes), shooting:200x2:linear:rk8 (2 steps between each, linear controls, another Runge-Kutta scheme), "
        "shooting:200:spline:21 (controls on 21 nodes)"
    )


@dataclass(frozen=True)
class MultipleShooting(Meshed, Shooting):
    """The states at the nodes between intervals are variables of their own, and each interval is integrated from its left one.

    The problem is larger, but sparse, and much less nonlinear than by single shooting: for gradient tools.

    Parameters
    ----------
    intervals : int
        Number of intervals of each phase, of equal length.
    mesh : mapping, optional
        Phases that have intervals of their own: name -> (edges, order), edges relative to the phase, increasing from 0 to 1, and the order
        of the scheme; see `PhaseMesh`.
    scheme, steps, control, control_nodes, path_points
        See `Shooting`; `steps` are those of each interval, of equal length.

    Raises
    ------
    ValueError
        As for `Shooting`; also for edges that do not increase from 0 to 1, and for another order than that of the scheme.

    Examples
    --------
    >>> from problems import load
    >>> from transcription import MultipleShooting
    >>> nlp = MultipleShooting(20).transcribe(load("goddard"))
    >>> len(nlp.variables) >= len(nlp.free)
    True
    """

    intervals: int
    mesh: tuple[tuple[str, PhaseMesh], ...] | Mapping[str, Any] | None = field(default=None, kw_only=True)

    most_elements: ClassVar[int] = 400
    _counted = "intervals", 1
    _apart = True
    word = "multiple-shooting"
    examples = "multiple-shooting:40 (intervals), the rest as for shooting"

    def __post_init__(self) -> None:
        Shooting.__post_init__(self)
        super().__post_init__()
        for phase, mesh in self.meshes.items():
            if mesh.order != self.order:
                raise ValueError(
                    f"MultipleShooting: phase '{phase}': on a mesh for {self.scheme} the order is {self.order}, not {mesh.order}"
                )

    @property
    def elements(self) -> int:  # type: ignore[override]
        """The number of intervals of a phase that has no mesh of its own."""
        return self.intervals

    @property
    def order(self) -> int:  # type: ignore[override]
        """The order of the scheme, which is the degree of the states on each step."""
        return TABLEAUX[self.scheme].order

    def transcribe(self, problem: Problem | CompiledProblem) -> NLP:
        compiled = problem.compile()
        self.check_phases(compiled)
        return super().transcribe(compiled)

    def remeshed(self, meshes: Mapping[str, PhaseMesh], *, bounded: bool = False) -> MultipleShooting:
        """Straight lines between values within bounds stay within these."""
        other = super().remeshed(meshes)
        return replace(other, control="linear") if bounded and self.control == "spline" else other

    def adapted(
        self, problem: CompiledProblem, trajectory: Trajectory, errors: Mapping[str, np.ndarray], of_controls: Mapping[str, np.ndarray]
    ) -> MultipleShooting:
        """Intervals by the density of the trajectory, more even where their steps would be too long to be stable."""
        degree, most = DEGREES[self.control], max(self.most_elements, 2 * self.elements)

        def next_mesh(old: PhaseMesh, phase: PhaseTrajectory, least: float) -> PhaseMesh:
            return next_intervals(old, phase, errors[phase.name], of_controls[phase.name], degree, least, most)

        return by_density(self, problem, trajectory, next_mesh)

    def suits(self, problem: CompiledProblem) -> bool:
        """Whether all steps may be stable."""
        try:
            self._check_steps(problem)
        except ValueError:
            return False
        return True

    def alternatives(self) -> tuple[MultipleShooting, ...]:
        """As many equal intervals."""
        equal = {name: PhaseMesh.uniform(mesh.elements, mesh.order) for name, mesh in self.meshes.items()}
        return () if equal == self.meshes else (self.remeshed(equal),)


def _sees_controls(phase: CompiledPhase) -> bool:
    """Whether path constraints or peaks depend on controls, so that both values count where these jump."""
    return any(function.jac_sparsity(0, 1).nnz() > 0 for function in (phase.path, phase.peaks) if function.numel_out(0))
