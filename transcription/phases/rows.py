"""The rows of constraints that a method writes, and what an NLP evaluates at many points: the structure that its derivatives have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np

from problems.layers import mapped

from ..numerics.batched import expanded


@dataclass(frozen=True, eq=False)
class Pointwise:
    """A Function y -> w of columns, at k points."""

    function: ca.Function
    inputs: ca.MX  # in the variables z
    values: ca.MX  # symbols of what it returns

    @classmethod
    def of(cls, function: ca.Function, inputs: Sequence[ca.MX]) -> Pointwise:
        """From a Function of several inputs and outputs, all of them columns, and its inputs at the points, side by side."""
        symbols = [ca.MX.sym(function.name_in(i), function.numel_in(i)) for i in range(function.n_in())]
        one = ca.Function(function.name(), [ca.vertcat(*symbols)], [ca.densify(ca.vertcat(*function.call(symbols)))])
        every = ca.densify(ca.vertcat(*inputs))
        return cls(expanded(one), every, ca.MX.sym("w", one.numel_out(0), every.shape[1]))

    @property
    def count(self) -> int:
        """Number of points, k."""
        return self.inputs.shape[1]

    @cached_property
    def evaluated(self) -> ca.MX:
        """What it returns, (size of w, k), in the variables."""
        return mapped(self.function, self.count)(self.inputs)


@dataclass(frozen=True, eq=False)
class Parts:
    """An NLP as rows L(z, w) and scores(q(z, w)), L and q affine, each w evaluated at points whose inputs are affine in z."""

    points: tuple[ca.Function, ...]  # y -> w for one point: each Function that is evaluated at points
    inputs: ca.Function  # z -> the inputs (size of y, k) at the points of each of these
    affine: ca.Function  # z, each w (size of w, k) -> (L, q), columns
    scores: ca.Function  # q -> (F, the rows of g after L)

    @classmethod
    def of(cls, z: ca.MX, points: Sequence[Pointwise], rows: ca.MX, quantities: ca.MX, scores: ca.Function) -> Parts:
        affine = ca.Function("affine", [z, *(one.values for one in points)], [ca.densify(rows), ca.densify(quantities)])
        return cls(tuple(one.function for one in points), ca.Function("inputs", [z], [one.inputs for one in points]), affine, scores)


@dataclass(frozen=True, eq=False)
class EndSlots:
    """Slots of a phase's times, of its initial and final states (nx,), and of the parameters."""

    t0: int
    tf: int
    initial: np.ndarray
    final: np.ndarray
    parameters: np.ndarray

    @property
    def statics(self) -> np.ndarray:
        """Slots of s = [t0, tf, *parameters]."""
        return np.array([self.t0, self.tf, *self.parameters], dtype=int)


@dataclass
class Rows:
    """Rows of constraints as they come together; a list `points` gets what is evaluated `at_points`."""

    points: list[Pointwise] | None = None
    expressions: list[ca.MX] = field(default_factory=list)
    lower: list[np.ndarray] = field(default_factory=list)
    upper: list[np.ndarray] = field(default_factory=list)
    scale: list[np.ndarray] = field(default_factory=list)
    labels: list[str] = field(default_factory=list)
    propagated: list[bool] = field(default_factory=list)
    dynamics: dict[str, slice] = field(default_factory=dict)
    """Where the rows of dynamics of each phase are."""
    samples: dict[tuple[str, str], list[slice]] = field(default_factory=dict)
    """Where the rows of each of its path constraints ("path"), peaks ("peak"), bounded hidden states ("state") and absolute values ("size")
    are, by its name and that word."""

    def add(
        self,
        expression: ca.MX,
        lower: object,
        upper: object,
        scale: object,
        labels: str | Sequence[str],
        *,
        propagated: bool = False,
        of: tuple[str, str] | None = None,
    ) -> None:
        """A matrix of rows, column by column; limits, scale, label for each or all; `propagated`: satisfied by propagation; `of`: they are
        samples of one quantity of a phase, so that their multipliers are found again, see `samples`."""
        count = expression.numel()
        if of is not None:
            self.samples.setdefault(of, []).append(slice(self.count, self.count + count))
        self.expressions.append(ca.vec(expression))
        for target, value in ((self.lower, lower), (self.upper, upper), (self.scale, scale)):
            target.append(np.broadcast_to(np.asarray(value, dtype=float), count))
        self.propagated.append(propagated)
        self.labels.extend([labels] * count if isinstance(labels, str) else labels)

    def at_points(self, function: ca.Function, *inputs: ca.MX) -> list[ca.MX]:
        """The outputs of a Function of columns at k points, side by side: matrices (size of the output, k) of inputs (size, k)."""
        sizes = [function.numel_out(i) for i in range(function.n_out())]
        if not sum(sizes):
            return [ca.MX(0, inputs[0].shape[1])] * len(sizes)
        point = Pointwise.of(function, inputs)
        if self.points is not None:
            self.points.append(point)
        values = point.evaluated if self.points is None else point.values
        return ca.vertsplit(values, np.cumsum([0, *sizes]).tolist())

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.labels)

    @property
    def propagated_equations(self) -> ca.MX:
        """Scaled residuals (count, 1) of the equations that propagation satisfies."""
        chosen = [i for i, propagated in enumerate(self.propagated) if propagated and (self.lower[i] == self.upper[i]).all()]
        return ca.vertcat(ca.MX(0, 1), *(self.expressions[i] / self.scale[i] for i in chosen))

    @property
    def left(self) -> np.ndarray:
        """Indices of the rows that propagation does not satisfy."""
        return np.flatnonzero(np.repeat(~np.array(self.propagated, dtype=bool), [e.numel() for e in self.expressions]))


@dataclass(frozen=True, eq=False)
class Written:
    """What objectives and constraints see of a phase, as columns; samples of parts of peaks (parts, k); least values of `magnitudes`."""

    first_control: ca.MX
    last_control: ca.MX
    integrals: ca.MX
    peak_samples: ca.MX
    magnitudes: ca.MX = field(default_factory=lambda: ca.MX(0, 1))
