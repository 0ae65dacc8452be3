"""Derivatives of an NLP from constants and the small derivatives of the Functions that it evaluates at points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from problems.layers import mapped

from ..base import NLP
from ..phases.rows import Parts

SHARED_PART = 0.25
"""What points have in common is evaluated once for all where it is at least this part of the instructions of one point."""


class FromPoints:
    """Derivatives of an NLP that has parts, in a symbol `z` of its variables.

    With y = A z + b at all points, w = f(y), rows L = C w + D z and quantities q = C' w + D' z, all but f' and f'' are constants. Where
    much of f depends on inputs p alone that are the same at all points, as on the shape of a vehicle, it is evaluated once: w = f(y, u(p)),
    and A has rows u'(p) dp/dz.
    """

    def __init__(self, nlp: NLP, parts: Parts) -> None:
        self.z = ca.MX.sym("z", len(nlp.variables))
        self._A: ca.DM | ca.MX
        self._A, every = self._prepare(parts)
        self._inputs, self._shared = list[tuple[ca.MX, ca.MX]](), list[tuple[ca.MX, _Common]]()
        for one, common, y in zip(self._points, every, parts.inputs.call([self.z]), strict=True):
            v = y[one.vary, :]
            if common is not None:
                p = y[common.of, 0]
                u, slopes = common.slopes(p)
                v = ca.vertcat(v, ca.repmat(u, 1, y.shape[1]))
                self._A = self._A + _product(common.to, _product(slopes, common.A))
                self._shared.append((p, common))
            self._inputs.append((v, y[one.fixed, :]))
        found = [mapped(one.slopes, v.shape[1])(v, rest) for one, (v, rest) in zip(self._points, self._inputs, strict=True)]
        self.rows, self.q = parts.affine.call([self.z, *(w for w, _ in found)])
        self._slopes = ca.MX(self._blocks, ca.veccat(*(slopes for _, slopes in found)))
        self._values_by_z = _product(self._slopes, self._A)

    def _prepare(self, parts: Parts) -> tuple[ca.DM, list[_Common | None]]:
        """The constant parts: derivatives A by z of all varying inputs, at all points, and the common part of each Function."""
        inputs = parts.inputs.call([self.z], True, False)
        A = ca.vertsplit(_constant(ca.veccat(*inputs), self.z), np.cumsum([0, *(y.numel() for y in inputs)]).tolist())
        begins = parts.inputs.call([ca.DM.zeros(self.z.numel())])
        points, varying, sparsities, alike = [], [], [], []
        for function, y, begin, by_z in zip(parts.points, inputs, begins, A, strict=True):
            size, k = y.shape
            vary = np.unique(np.array(by_z.sparsity().row(), dtype=int) % size)
            alike.append(np.intersect1d(vary, _alike(ca.horzcat(by_z, ca.vec(begin)), size)))
            points.append(one := _Point(function, vary, alike[-1]))
            sparsities.append((one.sparsity, k))
            rows = by_z[(vary[None] + size * np.arange(k)[:, None]).ravel().tolist(), :]
            if one.u:
                none = ca.DM(one.count - len(vary), self.z.numel())
                rows = ca.vertcat(*(part for own in ca.vertsplit(rows, len(vary)) for part in (own, none)))
            varying.append(rows)
        sizes = [rows.shape[0] for rows in varying]
        common = [
            _common(one, own, by_z[own.tolist(), :], before, sum(sizes), k)
            for one, own, by_z, before, (_, k) in zip(points, alike, A, np.cumsum([0, *sizes[:-1]]), sparsities, strict=True)
        ]
        values = [ca.MX.sym("w", *parts.affine.size_in(i + 1)) for i in range(len(points))]
        joined = ca.MX.sym("w", sum(value.numel() for value in values))
        split = ca.vertsplit(joined, np.cumsum([0, *(value.numel() for value in values)]).tolist())
        values = [ca.reshape(one, *value.shape) for one, value in zip(split, values, strict=True)]
        L, q = parts.affine.call([self.z, *values], True, False)
        rows, quantities = ((_constant(one, self.z, joined), _constant(one, joined, self.z)) for one in (L, q))
        self._points, self._of_rows, self._of_quantities, self._blocks = points, rows, quantities, _diagonal(sparsities)
        self._scores, self._curvature, self._curved = _curved(parts.scores)
        return ca.vertcat(*varying), common

    def gradients(self) -> list[ca.MX]:
        """dF/dz, dg/dz, F and g."""
        F, c, dF, dc = self._scores(self.q)
        rows = self._by_z(self._of_rows)
        return [self._along(dF), ca.vertcat(rows, self._along(dc)), F, ca.vertcat(self.rows, c)]

    def hessian(self, of_F: ca.MX, of_g: ca.MX) -> ca.MX:
        """The upper triangle of the Hessian of of_F'F + of_g'g."""
        count = self.rows.numel()
        of_rows, of_scores = of_g[:count], ca.vertcat(of_F, of_g[count:])
        _, _, dF, dc = self._scores(self.q)
        of_q = _product(ca.vertcat(dF, dc).T, of_scores)
        of_values = ca.densify(_product(self._of_rows[1].T, of_rows) + _product(self._of_quantities[1].T, of_q))
        first, halves, sparsities = 0, [], []
        for one, (v, rest) in zip(self._points, self._inputs, strict=True):
            curvature, sparsity = one.curvature()
            size, k = curvature.size1_in(2), v.shape[1]
            halves.append(mapped(curvature, k)(v, rest, ca.reshape(of_values[first : first + size * k], size, k)))
            sparsities.append((sparsity, k))
            first += size * k
        H = _product(self._A.T, _product(ca.MX(_diagonal(sparsities), ca.veccat(*halves)), self._A))
        for p, common in self._shared:
            of_u = ca.densify(_product(_product(self._slopes, common.to).T, of_values))
            H += _product(common.A.T, _product(common.curvature(p, of_u), common.A))
        if self._curved:
            q = self._by_z([part[self._curved, :] for part in self._of_quantities])
            H += _product(q.T, _product(self._curvature(self.q, of_scores), q))
        return ca.triu(H + H.T)

    def _along(self, by_q: ca.MX) -> ca.MX:
        """Derivatives by z, by the chain rule from those by the quantities."""
        used = np.flatnonzero(np.diff(by_q.sparsity().colind())).tolist()
        return _product(by_q[:, used], self._by_z([part[used, :] for part in self._of_quantities]))

    def _by_z(self, slopes: Sequence[ca.DM]) -> ca.MX:
        """Total derivatives by z, from those by z and by the values at the points."""
        return slopes[0] + _product(slopes[1], self._values_by_z)


@dataclass(frozen=True, eq=False)
class _Common:
    """The part u(p) of a Function that is the same at all of its points."""

    of: list[int]  # which inputs are p
    slopes: ca.Function  # p -> (u, du/dp)
    curvature: ca.Function  # (p, of_u) -> half of the Hessian of of_u'u
    A: ca.DM  # dp/dz
    to: ca.DM  # derivatives by u of all inputs that vary, at all points of all Functions


class _Point:
    """A Function at one point, where some of its inputs vary with z and the others do not."""

    def __init__(self, function: ca.Function, vary: np.ndarray, alike: np.ndarray) -> None:
        size, kind = function.numel_in(0), kind_of(function)
        fixed = np.setdiff1d(np.arange(size), vary)
        self.vary, self.fixed = vary.tolist(), fixed.tolist()
        v, rest, of_w = kind.sym("v", len(vary)), kind.sym("c", len(fixed)), kind.sym("of_w", function.numel_out(0))
        values = function(ca.vertcat(v, rest)[np.argsort(np.concatenate([vary, fixed])).tolist()])
        p, self.u = v[np.flatnonzero(np.isin(vary, alike)).tolist()], list[Any]()
        if kind is ca.SX and p.numel():
            kept, symbols, u = ca.extract_parametric(values, p)
            if u and ca.Function("u", [p], u).n_instructions() >= SHARED_PART * function.n_instructions():
                v, values, self.u = ca.vertcat(v, *symbols), kept, [p, ca.vertcat(*u)]
        self._symbols, self._values = (v, rest, of_w), values
        self.count, J = v.numel(), ca.jacobian(self._values, v)
        self.slopes, self.sparsity = ca.Function("slopes", [v, rest], [self._values, J.nz[:]]), J.sparsity()

    def curvature(self) -> tuple[ca.Function, ca.Sparsity]:
        """(varying, fixed, of_w) -> nonzeros of half of the Hessian of of_w'w by those that vary, of which the other half is the same
        transposed; and its sparsity."""
        v, rest, of_w = self._symbols
        H: Any = ca.triu(ca.hessian(ca.dot(of_w, self._values), v)[0])
        H *= ca.DM(H.sparsity(), np.where(np.equal(*H.sparsity().get_triplet()), 0.5, 1.0))
        return ca.Function("curvature", [v, rest, of_w], [H.nz[:]]), H.sparsity()


def _alike(rows: ca.DM, size: int) -> np.ndarray:
    """Which of the rows of several blocks of so many rows are the same in all blocks."""
    count = rows.shape[0] // size
    unlike = ca.sparsify(rows - ca.repmat(rows[:size, :], count, 1))
    return np.setdiff1d(np.arange(size), np.array(unlike.sparsity().row(), dtype=int) % size) if count > 1 else np.empty(0, dtype=int)


def _common(one: _Point, of: np.ndarray, A: ca.DM, before: int, size: int, k: int) -> _Common | None:
    """The common part of a Function at its k points, whose varying inputs come after so many and are among so many of all Functions."""
    if not one.u:
        return None
    p, u = one.u
    of_u = ca.SX.sym("of_u", u.numel())
    slopes = ca.Function("slopes", [p], [u, ca.jacobian(u, p)])
    curvature = ca.Function("curvature", [p, of_u], [0.5 * ca.hessian(ca.dot(of_u, u), p)[0]])
    each = ca.vertcat(ca.DM(len(one.vary), u.numel()), ca.DM.eye(u.numel()))
    to = ca.vertcat(ca.DM(before, u.numel()), ca.repmat(each, k, 1), ca.DM(size - before - k * each.shape[0], u.numel()))
    return _Common(of.tolist(), slopes, curvature, A, to)


def _diagonal(blocks: Sequence[tuple[ca.Sparsity, int]]) -> ca.Sparsity:
    """The sparsity of a block-diagonal matrix with given numbers of these blocks."""
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
