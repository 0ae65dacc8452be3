"""What an NLP evaluates at many points, and how it is put together from that: the structure that its derivatives have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

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
        return self.function.map(self.count)(self.inputs)


@dataclass(frozen=True, eq=False)
class Parts:
    """An NLP as rows L(z, w) and scores(q(z, w)), where L and q are affine and each w is evaluated at points, whose inputs are affine
    in z."""

    points: tuple[ca.Function, ...]  # y -> w for one point: each Function that is evaluated at points
    inputs: ca.Function  # z -> the inputs (size of y, k) at the points of each of these
    affine: ca.Function  # z, each w (size of w, k) -> (L, q), columns
    scores: ca.Function  # q -> (F, the rows of g after L)
