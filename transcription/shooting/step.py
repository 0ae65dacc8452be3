"""One explicit Runge-Kutta step of a phase: the states and integrals after it, and samples of constraints and peaks on the way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from problems.compiled import CompiledPhase

from ..numerics.batched import expanded
from ..numerics.polynomials import basis_matrix
from ..phases.mesh import PhaseMesh
from ..phases.writer import wrapped_controls
from .runge_kutta import Tableau


class RungeKuttaStep:
    """A step as Functions of its inputs: the states at its beginning, the coefficients of the controls, its start and length, and s.

    Integrals are quadrature states of the same method. A point inside the step is reached by a step of the same method of that part of its
    length, which is as accurate as the step itself. The absolute values and roots of integrals that depend on states or time are sampled
    at the stages of the method, whose `weights` (stages,) are not 0.
    """

    def __init__(self, scheme: Tableau, degree: int, points: Sequence[float], phase: CompiledPhase) -> None:
        self.scheme, self.degree, self.points, self.phase = scheme, degree, tuple(points), phase
        self.rows = len(phase.paths) + len(phase.peak_of)
        varying = {row for i in (0, 2) for row in phase.sizes.jac_sparsity(0, i).row()}
        self.sized, self.weights = sorted(varying), np.array([b for b in scheme.b if b])
        functions = (phase.dynamics, phase.integrands, phase.path, phase.peak_parts, phase.sizes)
        self.symbolic = all(expanded(function).is_a("SXFunction") for function in functions)
        nx, nu = len(phase.states), len(phase.controls)
        self.inputs = nx + nu * (degree + 1) + 2 + phase.dynamics.size1_in(3)

    @cached_property
    def forward(self) -> ca.Function:
        """(y, C, start, h, s) -> (y after the step, samples (rows, points) in the order of time, sizes (`sized`, stages)); y are states and
        integrals so far."""
        nx, nq = len(self.phase.states), self.phase.integrands.size1_out(0)
        y, others = self._kind.sym("y", nx + nq), self._symbols()
        after, samples, sizes = self._whole(y[:nx, :], *others)
        return self._function("step", [y, *others], [ca.vertcat(after[:nx, :], y[nx:, :] + after[nx:, :]), samples, sizes])

    @property
    def plain(self) -> bool:
        """Whether there are no calls among them, of tables for instance."""
        step = self.forward
        return self.symbolic and all(step.instruction_id(i) != ca.OP_CALL for i in range(step.n_instructions()))

    @cached_property
    def at_end(self) -> ca.Function:
        """(x at the end, C, start, h, s) -> samples (rows, 1) there."""
        x, (C, start, h, s) = self._kind.sym("x", len(self.phase.states)), self._symbols()
        return self._function("at_end", [x, C, start, h, s], [self._sample(x, C, 1.0, start, h, s)])

    def inside(self, places: np.ndarray) -> ca.Function:
        """(x, C, start, h, s) -> states (nx, places) at places in [0, 1]."""
        x, others = self._kind.sym("x", len(self.phase.states)), self._symbols()
        return self._function("inside", [x, *others], [ca.horzcat(*(self._reached(x, float(place), *others) for place in places))])

    def gradient(self, *, samples: bool) -> ca.Function:
        """(x, C, start, h, s) -> derivatives (results, inputs) of states, integrals [samples, point after point, sizes likewise]."""
        x, others = self._kind.sym("x", len(self.phase.states)), self._symbols()
        after, *values = self._whole(x, *others)
        results = ca.vertcat(after, *map(ca.vec, values)) if samples else after
        return self._function("gradient", [x, *others], [ca.jacobian(results, ca.veccat(x, *others))])

    @cached_property
    def end_gradient(self) -> ca.Function:
        """(x at the end, C, start, h, s) -> derivatives (rows, inputs) of the samples there."""
        x, (C, start, h, s) = self._kind.sym("x", len(self.phase.states)), self._symbols()
        inputs = [x, C, start, h, s]
        return self._function("end_gradient", inputs, [ca.jacobian(self._sample(x, C, 1.0, start, h, s), ca.veccat(*inputs))])

    @property
    def _kind(self) -> Any:
        return ca.SX if self.symbolic else ca.MX

    def _symbols(self) -> list[Any]:
        sym, phase = self._kind.sym, self.phase
        return [sym("C", len(phase.controls), self.degree + 1), sym("start"), sym("h"), sym("s", phase.dynamics.size1_in(3))]

    def _function(self, name: str, inputs: list[Any], outputs: list[Any]) -> ca.Function:
        return ca.Function(name, inputs, [ca.densify(output) for output in outputs], {"cse": True})

    def _whole(self, x: Any, C: Any, start: Any, h: Any, s: Any) -> tuple[Any, Any, Any]:
        """States after the step and integrals over it; samples; sizes."""
        nx, sizes = len(self.phase.states), []

        def rates(c: float, y: Any) -> Any:
            inputs = y[:nx, :], self.controls(C, c), start + c * h, s
            sizes.append(self.phase.sizes(*inputs)[self.sized, :])
            return ca.vertcat(self.phase.dynamics(*inputs), self.phase.integrands(*inputs))

        after, _ = self.scheme.step(rates, ca.vertcat(x, self._kind.zeros(self.phase.integrands.size1_out(0))), h)
        columns = [
            self._sample(after[:nx, :] if place == 1.0 else self._reached(x, place, C, start, h, s), C, place, start, h, s)
            for place in self.points
        ]
        counted = [column for column, b in zip(sizes, self.scheme.b, strict=True) if b]
        return after, ca.horzcat(self._kind(self.rows, 0), *columns), ca.horzcat(*counted)

    def _reached(self, x: Any, place: float, C: Any, start: Any, h: Any, s: Any) -> Any:
        """States at a place in [0, 1]."""
        if place == 0.0:
            return x
        return self.scheme.step(
            lambda c, state: self.phase.dynamics(state, self.controls(C, c * place), start + c * place * h, s), x, place * h
        )[0]

    def _sample(self, x: Any, C: Any, place: float, start: Any, h: Any, s: Any) -> Any:
        """Path constraints and peaks (rows,) at a place where the states are x."""
        inputs = x, self.controls(C, place), start + place * h, s
        return ca.vertcat(self.phase.path(*inputs), self.phase.peak_parts(*inputs))

    def controls(self, C: Any, place: float) -> Any:
        """Controls (nu,) at a place in [0, 1], within the bounds of those that are periodic."""
        weights = basis_matrix("lobatto", self.degree, np.array([2.0 * place - 1.0])).T
        return wrapped_controls(C @ ca.sparsify(ca.DM(weights)), self.phase)


@dataclass(frozen=True, eq=False)
class StepMesh:
    """The ends of steps: `places` (N + 1,), relative to the phase; `ends` (M + 1,), which of these are ends of intervals."""

    places: np.ndarray
    ends: np.ndarray

    @classmethod
    def of(cls, intervals: int, steps: int, nodes: np.ndarray) -> StepMesh:
        """`intervals` equal ones of `steps` equal steps each; a step across one of the nodes of controls becomes two."""
        whole = np.linspace(0.0, 1.0, intervals * steps + 1)
        right = np.clip(np.searchsorted(whole, nodes), 1, len(whole) - 1)
        # Places that are nearer to each other, relative to the phase, are one.
        apart = np.minimum(np.abs(nodes - whole[right - 1]), np.abs(nodes - whole[right])) > 1e-9
        places = np.sort(np.concatenate([whole, nodes[apart]]))
        return cls(places, np.searchsorted(places, whole[::steps]))

    def on(self, mesh: PhaseMesh) -> StepMesh:
        """The same steps on intervals of other lengths."""
        return StepMesh(mesh.image(self.places), self.ends)

    @property
    def steps(self) -> int:
        """Number of steps, N."""
        return len(self.places) - 1
