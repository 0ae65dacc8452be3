"""Shooting: the dynamics integrated by explicit Runge-Kutta steps under controls that are given by their values at nodes.

Betts, "Practical Methods for Optimal Control and Estimation Using Nonlinear Programming", 2nd ed., SIAM 2010, 3.3 and 3.4 (single and
multiple shooting); Bock and Plitt, "A multiple shooting algorithm for direct solution of optimal control problems", IFAC 1984. For the
steps see `runge_kutta.py`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from problems.checks import check_choice, check_count
from problems.compiled import CompiledPhase, CompiledProblem
from problems.problem import Problem

from ..assembly import Assembly
from ..base import NLP, Transcription
from ..phases.layout import Layout
from ..phases.writer import Ends
from .control_law import DEGREES, ControlLaw
from .phase import ShootingPhase
from .runge_kutta import TABLEAUX
from .stability import check_steps
from .step import Step, StepMesh


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
        spline through a value at each. They stay within their bounds at the nodes; but for splines, everywhere.
    control_nodes : int, optional
        Number of equally spaced nodes of the controls, both ends among them; by default those of the states. No step leads across one:
        where they fall into a step, it is divided.
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

    @property
    def _intervals(self) -> int:
        """Number of intervals between nodes."""
        setting, least = self._counted
        return int(getattr(self, setting)) - least + 1

    @classmethod
    def from_word(cls, numbers: tuple[int, ...], options: tuple[str, ...]) -> Transcription:
        """See `Transcription.from_word`: options are, in any order, a kind of control, its number of nodes, and a scheme."""
        if not 1 <= len(numbers) <= 2:
            raise ValueError(f"write it as {cls.examples}")
        settings: dict[str, Any] = dict(zip((cls._counted[0], "steps"), numbers, strict=False))
        for option in options:
            name = "control" if option in DEGREES else "scheme" if option in TABLEAUX else "control_nodes" if option.isdecimal() else ""
            if not name or name in settings:
                known = f"{', '.join(DEGREES)}; {', '.join(TABLEAUX)}; or a number of nodes of the controls"
                raise ValueError(f"'{option}' is given twice or unknown; there are {known}")
            settings[name] = int(option) if name == "control_nodes" else option
        return cls(**settings)

    def to_word(self) -> str:
        """See `Transcription.to_word`."""
        steps = f"x{self.steps}" if self.steps > 1 else ""
        defaults = (self.control, "constant"), (self.control_nodes, None), (self.scheme, "rk4")
        return ":".join([super().to_word() + steps, *(str(value) for value, default in defaults if value != default)])

    def transcribe(self, problem: Problem | CompiledProblem) -> NLP:
        """Write `problem` as an NLP; see `Transcription.transcribe`. Raises ValueError, too, where steps are too long to be stable."""
        compiled = problem.compile()
        scheme, law = TABLEAUX[self.scheme], ControlLaw(self.control, self.control_nodes or self._intervals + 1)
        mesh = StepMesh.of(self._intervals, self.steps, law.edges)
        count, _ = self._counted
        check_steps(compiled, scheme, mesh.places, f"{type(self).__name__}: ", {count: getattr(self, count), "steps": self.steps})

        def writer(phase: CompiledPhase, layout: Layout, ends: Ends) -> ShootingPhase:
            points = [i / (self.path_points + 1) for i in range(self.path_points + 1)]
            if law.jumps and _sees_controls(phase):
                points.append(1.0)
            return ShootingPhase(mesh, law, Step(scheme, law.degree, points, phase), phase, layout, ends, apart=self._apart)

        return Assembly(compiled, writer).nlp(self)


@dataclass(frozen=True)
class SingleShooting(Shooting):
    """Each phase is integrated in one go from its initial states; its final states are the only ones that are variables.

    Made for searches that propagate their candidates (`inner="propagate"`): one pass gives trajectory, objectives and all residuals.
    Bounds of states are imposed at the nodes. Gradient tools work, too, but the cost of derivatives grows with the square of the number of
    nodes: `MultipleShooting` is made for these.

    Parameters
    ----------
    nodes : int
        Of each phase, equally spaced, both ends among them.
    scheme, steps, control, control_nodes, path_points
        See `Shooting`; `steps` are those between two nodes.
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

    _counted = "intervals", 1
    _apart = True
    word = "multiple-shooting"
    examples = "multiple-shooting:40 (intervals), the rest as for shooting"


def _sees_controls(phase: CompiledPhase) -> bool:
    """Whether path constraints or peaks depend on controls, so that both values count where these jump."""
    return any(function.jac_sparsity(0, 1).nnz() > 0 for function in (phase.path, phase.peaks) if function.numel_out(0))
