"""Derivatives of an NLP from those of what it evaluates at points, which are small, and constants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ..base import NLP
from ..phases.pointwise import Parts
from ..stopping import check_stopping


class FromPoints:
    """Derivatives of an NLP that has parts, in a symbol `z` of its variables.

    With y = A z + b at all points, w = f(y), rows L = C w + D z and quantities q = C' w + D' z, all but f' and f'' are constants.
    """

    def __init__(self, nlp: NLP, parts: Parts) -> None:
        self.z = ca.MX.sym("z", len(nlp.variables))
        self._frame = frame = _framed(parts, self.z)
        inputs = parts.inputs.call([self.z])
        self._inputs = [(y[one.vary, :], y[one.fixed, :]) for one, y in zip(frame.points, inputs, strict=True)]
        found = [one.slopes.map(v.shape[1])(v, rest) for one, (v, rest) in zip(frame.points, self._inputs, strict=True)]
        self.rows, self.q = parts.affine.call([self.z, *(w for w, _ in found)])
        self._values_by_z = _product(ca.MX(frame.slopes, ca.veccat(*(slopes for _, slopes in found))), frame.A)

    def gradients(self) -> list[ca.MX]:
        """dF/dz, dg/dz, F and g."""
        F, c, dF, dc = self._frame.scores(self.q)
        rows = self._by_z(self._frame.rows)
        return [self._along(dF), ca.vertcat(rows, self._along(dc)), F, ca.vertcat(self.rows, c)]

    def hessian(self, of_F: ca.MX, of_g: ca.MX) -> ca.MX:
        """The upper triangle of the Hessian of of_F'F + of_g'g."""
        frame, count = self._frame, self.rows.numel()
        of_rows, of_scores = of_g[:count], ca.vertcat(of_F, of_g[count:])
        _, _, dF, dc = frame.scores(self.q)
        of_q = _product(ca.vertcat(dF, dc).T, of_scores)
        of_values = ca.densify(_product(frame.rows[1].T, of_rows) + _product(frame.quantities[1].T, of_q))
        first, halves, sparsities = 0, [], []
        for one, (v, rest) in zip(frame.points, self._inputs, strict=True):
            check_stopping()
            curvature, sparsity = one.curvature()
            size, k = curvature.size1_in(2), v.shape[1]
            halves.append(curvature.map(k)(v, rest, ca.reshape(of_values[first : first + size * k], size, k)))
            sparsities.append((sparsity, k))
            first += size * k
        H = _product(frame.A.T, _product(ca.MX(_diagonal(sparsities), ca.veccat(*halves)), frame.A))
        if frame.curved:
            q = self._by_z([part[frame.curved, :] for part in frame.quantities])
            H += _product(q.T, _product(frame.curvature(self.q, of_scores), q))
        return ca.triu(H + H.T)

    def _along(self, by_q: ca.MX) -> ca.MX:
        """The derivatives by z of what has these by the quantities."""
        used = np.flatnonzero(np.diff(by_q.sparsity().colind())).tolist()
        return _product(by_q[:, used], self._by_z([part[used, :] for part in self._frame.quantities]))

    def _by_z(self, slopes: Sequence[ca.DM]) -> ca.MX:
        """The derivatives by z of what has these by z and by the values at the points."""
        return slopes[0] + _product(slopes[1], self._values_by_z)


class _Point:
    """A Function at one point, where some of its inputs vary with z and the others do not.

    Attributes
    ----------
    vary, fixed : list of int
        Which of its inputs do which.
    slopes : Function
        (varying, fixed) -> (w, nonzeros of its Jacobian by those that vary).
    sparsity : Sparsity
        Of this Jacobian.
    """

    def __init__(self, function: ca.Function, vary: np.ndarray) -> None:
        size, kind = function.numel_in(0), kind_of(function)
        fixed = np.setdiff1d(np.arange(size), vary)
        self.vary, self.fixed = vary.tolist(), fixed.tolist()
        self._symbols = kind.sym("v", len(vary)), kind.sym("c", len(fixed)), kind.sym("of_w", function.numel_out(0))
        v, rest, _ = self._symbols
        self._values = function(ca.vertcat(v, rest)[np.argsort(np.concatenate([vary, fixed])).tolist()])
        J = ca.jacobian(self._values, v)
        self.slopes, self.sparsity = ca.Function("slopes", [v, rest], [self._values, J.nz[:]]), J.sparsity()

    def curvature(self) -> tuple[ca.Function, ca.Sparsity]:
        """(varying, fixed, of_w) -> nonzeros of half of the Hessian of of_w'w by those that vary, of which the other half is the same
        transposed; and its sparsity."""
        v, rest, of_w = self._symbols
        H: Any = ca.triu(ca.hessian(ca.dot(of_w, self._values), v)[0])
        H *= ca.DM(H.sparsity(), np.where(np.equal(*H.sparsity().get_triplet()), 0.5, 1.0))
        return ca.Function("curvature", [v, rest, of_w], [H.nz[:]]), H.sparsity()


@dataclass(frozen=True, eq=False)
class _Frame:
    """What of the derivatives of an NLP is known before z is.

    Attributes
    ----------
    points : list of _Point
    A : DM
        Derivatives by z of all inputs that vary, at all points.
    slopes : Sparsity
        Of the Jacobians at all points.
    rows, quantities : tuple of DM
        Derivatives of L and of q by z and by the values at all points.
    scores : Function
        q -> (F, c, dF/dq, dc/dq).
    curvature : Function
        (q, of_scores) -> half of the Hessian of of_scores'(F, c) by those quantities that are `curved`.
    curved : list of int
    """

    points: list[_Point]
    A: ca.DM
    slopes: ca.Sparsity
    rows: tuple[ca.DM, ca.DM]
    quantities: tuple[ca.DM, ca.DM]
    scores: ca.Function
    curvature: ca.Function
    curved: list[int]


def _framed(parts: Parts, z: ca.MX) -> _Frame:
    inputs = parts.inputs.call([z], True, False)
    A = ca.vertsplit(_constant(ca.veccat(*inputs), z), np.cumsum([0, *(y.numel() for y in inputs)]).tolist())
    points, varying, sparsities = [], [], []
    for function, y, by_z in zip(parts.points, inputs, A, strict=True):
        check_stopping()
        size, k = y.shape
        vary = np.unique(np.array(by_z.sparsity().row(), dtype=int) % size)
        points.append(_Point(function, vary))
        sparsities.append((points[-1].sparsity, k))
        varying.append(by_z[(vary[None] + size * np.arange(k)[:, None]).ravel().tolist(), :])
    values = [ca.MX.sym("w", *parts.affine.size_in(i + 1)) for i in range(len(points))]
    joined = ca.MX.sym("w", sum(value.numel() for value in values))
    split = ca.vertsplit(joined, np.cumsum([0, *(value.numel() for value in values)]).tolist())
    values = [ca.reshape(one, *value.shape) for one, value in zip(split, values, strict=True)]
    L, q = parts.affine.call([z, *values], True, False)
    rows, quantities = ((_constant(one, z, joined), _constant(one, joined, z)) for one in (L, q))
    return _Frame(points, ca.vertcat(*varying), _diagonal(sparsities), rows, quantities, *_curved(parts.scores))


def _diagonal(blocks: Sequence[tuple[ca.Sparsity, int]]) -> ca.Sparsity:
    """The sparsity of a matrix with so many of each of these on its diagonal."""
    return ca.diagcat(*(ca.kron(ca.DM.eye(k), ca.DM(one, 1.0)) for one, k in blocks)).sparsity()


def _constant(expression: ca.MX, symbol: ca.MX, *others: ca.MX) -> ca.DM:
    """The derivatives of an affine expression by this one of its symbols."""
    symbols = [symbol, *others]
    slopes = ca.Function("constant", symbols, [ca.jacobian(expression, symbol)])
    return ca.sparsify(slopes(*(ca.DM.zeros(*one.shape) for one in symbols)))


def _curved(scores: ca.Function) -> tuple[ca.Function, ca.Function, list[int]]:
    """Of a Function of quantities: q -> (F, c, dF/dq, dc/dq); (q, of_scores) -> half of the Hessian by those quantities that have any, and
    which these are."""
    kind = kind_of(scores)
    q, of_scores = kind.sym("q", scores.numel_in(0)), kind.sym("of_scores", scores.numel_out(0) + scores.numel_out(1))
    F, c = scores(q)
    H = ca.hessian(ca.dot(of_scores, ca.vertcat(F, c)), q)[0]
    curved = np.unique(np.array(H.sparsity().row(), dtype=int)).tolist()
    with_slopes = ca.Function("scores", [q], [F, c, ca.jacobian(F, q), ca.jacobian(c, q)])
    return with_slopes, ca.Function("curvature", [q, of_scores], [0.5 * H[curved, curved]]), curved


def _product(left: ca.DM | ca.MX, right: ca.DM | ca.MX) -> ca.MX:
    """A sparse product, which takes no time where there is nothing."""
    return ca.mtimes(left, right) if left.nnz() and right.nnz() else ca.MX(left.shape[0], right.shape[1])


def kind_of(function: ca.Function) -> Any:
    """The kind of symbols that a Function is made of: derivatives of flat lists of scalar operations are best made, and fastest, as such
    lists; a Callback allows none."""
    return ca.SX if function.is_a("SXFunction") else ca.MX
