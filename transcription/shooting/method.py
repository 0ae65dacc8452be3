"""Shooting: the dynamics integrated by explicit Runge-Kutta steps under controls that are given by their values at nodes.

Betts, "Practical Methods for Optimal Control and Estimation Using Nonlinear Programming", 2nd ed., SIAM 2010, 3.3 and 3.4 (single and
multiple shooting); Bock and Plitt, "A multiple shooting algorithm for direct solution of optimal control problems", IFAC 1984. For the
steps see `runge_kutta.py`.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem
from problems.problem import Problem

from ..assembly import Assembly
from ..base import NLP, Transcription
from ..phases.layout import Layout
from ..phases.writer import Ends
from .control_law import DEGREES, ControlLaw
from .phase import ShootingPhase
from .runge_kutta import tableau
from .stability import check_steps
from .step import Step, StepMesh


@dataclass(frozen=True, kw_only=True, repr=False)
class Shooting(Transcription):
    """What single and multiple shooting have in common.

    Parameters
    ----------
    scheme : str
        A Runge-Kutta method: "euler", "midpoint", "heun", "kutta3", "rk4", "rk38" (the 3/8 rule) or "rk8" (Cooper and Verner's of order 8).
    steps : int
        Equal steps of that method on each interval.
    control : "constant", "linear" or "spline"
        What controls are between their nodes: constant, with a value for each interval between two of them; straight lines or a cubic
        spline through a value at each. Their bounds hold at the nodes: everywhere, but for splines.
    control_nodes : int, optional
        How many equally spaced nodes the controls have, both ends among them; by default those of the states. No step leads across one:
        where they fall into a step, it is divided.
    path_points : int
        Path constraints hold, and peaks are looked at, at the ends of all steps and at as many equally spaced points inside each, which
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

    def __post_init__(self) -> None:
        name = type(self).__name__
        least = {**self._counted, "steps": 1, "control_nodes": 2, "path_points": 0}
        for setting, smallest in least.items():
            value = getattr(self, setting)
            if setting == "control_nodes" and value is None:
                continue
            if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < smallest:
                raise ValueError(f"{name}: {setting} must be an integer of at least {smallest}, not {value!r}")
        try:
            tableau(self.scheme)
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from None
        if self.control not in DEGREES:
            raise ValueError(f"{name}: control must be one of {', '.join(map(repr, DEGREES))}, not {self.control!r}")

    @property
    @abstractmethod
    def _counted(self) -> dict[str, int]:
        """The setting that says how many intervals there are, and its least value."""

    @property
    @abstractmethod
    def _intervals(self) -> int:
        """How many intervals there are between nodes."""

    @property
    @abstractmethod
    def _apart(self) -> bool:
        """Whether the states at the nodes are variables of their own."""

    def to_dict(self) -> dict[str, Any]:
        """See `Transcription.to_dict`."""
        settings = asdict(self)
        return {"method": type(self).__name__, "settings": {**{name: settings[name] for name in self._counted}, **settings}}

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in self.to_dict()['settings'].items())})"

    def transcribe(self, problem: Problem | CompiledProblem) -> NLP:
        """Write `problem` as an NLP; see `Transcription.transcribe`. Raises ValueError, too, where steps are too long to be stable."""
        compiled = problem.compile() if isinstance(problem, Problem) else problem
        scheme, law = tableau(self.scheme), ControlLaw(self.control, self.control_nodes or self._intervals + 1)
        mesh = StepMesh.of(self._intervals, self.steps, law.edges)
        (count,) = self._counted
        check_steps(compiled, scheme, mesh.places, f"{type(self).__name__}: ", {count: getattr(self, count), "steps": self.steps})

        def writer(phase: CompiledPhase, layout: Layout, ends: Ends) -> ShootingPhase:
            points = [i / (self.path_points + 1) for i in range(self.path_points + 1)]
            if law.jumps and _sees_controls(phase):
                points.append(1.0)
            return ShootingPhase(mesh, law, Step(scheme, law.degree, points, phase), phase, layout, ends, apart=self._apart)

        return Assembly(compiled, writer).nlp(self)


@dataclass(frozen=True, repr=False)
class SingleShooting(Shooting):
    """Each phase is integrated in one go from its initial states; its final states are the only ones that are variables.

    Made for searches that propagate their candidates (`inner="propagate"`): one pass gives trajectory, objectives and all residuals.
    Bounds of states hold at the nodes. Gradient tools work, too, but the cost of derivatives grows with the square of the number of nodes:
    `MultipleShooting` is made for these.

    Parameters
    ----------
    nodes : int
        Of each phase, equally spaced, both ends among them.
    scheme, steps, control, control_nodes, path_points
        See `Shooting`; `steps` are those between two nodes.
    """

    nodes: int

    @property
    def _counted(self) -> dict[str, int]:
        return {"nodes": 2}

    @property
    def _intervals(self) -> int:
        return self.nodes - 1

    @property
    def _apart(self) -> bool:
        return False


@dataclass(frozen=True, repr=False)
class MultipleShooting(Shooting):
    """The states at the nodes between equal intervals are variables of their own, and each interval is integrated from its left one.

    The problem is larger, but sparse, and much less nonlinear than by single shooting: for gradient tools.

    Parameters
    ----------
    intervals : int
        Of each phase, of equal length.
    scheme, steps, control, control_nodes, path_points
        See `Shooting`; `steps` are those of each interval.
    """

    intervals: int

    @property
    def _counted(self) -> dict[str, int]:
        return {"intervals": 1}

    @property
    def _intervals(self) -> int:
        return self.intervals

    @property
    def _apart(self) -> bool:
        return True


def _sees_controls(phase: CompiledPhase) -> bool:
    """Whether path constraints or peaks depend on controls, so that both values count where these jump."""
    return any(function.jac_sparsity(0, 1).nnz() > 0 for function in (phase.path, phase.peaks) if function.numel_out(0))
