"""A problem in its free variables alone: the states follow by propagation, and what constraints are left are functions of the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from problems.compiled import Deriving, remembered

from ..numerics.batched import Batched
from .layout import Layout
from .writer import PhaseWriter, filled

PROPAGATED = 1e-12
"""Largest scaled residual of the equations of states at which fast propagation is good enough."""


@dataclass(frozen=True, eq=False)
class Propagated:
    """Propagated vectors `Z` (k, n), values (k, rows) of the constraints that are left, and F (k, m) and g (k, r) where known."""

    Z: np.ndarray
    values: np.ndarray
    scores: tuple[np.ndarray, np.ndarray] | None = None


class Reduced(Deriving):
    """lower <= values <= upper (rows,): imposed final states, variables that are not free, rows that propagation does not satisfy."""

    def __init__(
        self,
        layout: Layout,
        writers: Sequence[PhaseWriter],
        peaks: tuple[np.ndarray, ca.Function],
        rest: tuple[ca.Function, np.ndarray, np.ndarray, np.ndarray],
        scores: tuple[ca.Function, np.ndarray] | None = None,
    ) -> None:
        self._layout, self._writers = layout, writers
        self.differentiated = np.zeros(2, dtype=int)  # number of batches, and of vectors, whose derivatives were taken so far
        self._peaks, self._largest = peaks
        self._rest, g_lower, g_upper, g_scale = rest
        self._scores = scores
        self._dependent = np.flatnonzero(~_marked(layout.free, len(layout.variables)))
        finals = [
            replace(v, lower=low, upper=high)
            for writer in writers
            for v, (low, high) in zip(writer.phase.states, writer.phase.final, strict=True)
        ]
        self._imposed = np.flatnonzero(np.concatenate([writer.ends.final for writer in writers]) < 0)
        rows = [*(finals[i] for i in self._imposed), *(layout.variables[i] for i in self._dependent)]
        self.lower = np.append([v.lower for v in rows], g_lower)
        self.upper = np.append([v.upper for v in rows], g_upper)
        self.scale = np.append([v.scale for v in rows], g_scale)
        self.equation = self.lower == self.upper
        self.inside = self._rows_inside()
        self._among_ends = np.cumsum(~self.inside) - 1

    def propagate(self, Z: np.ndarray) -> Propagated:
        """Propagate vectors (k, n), of which only the free entries matter."""
        propagated, values, residual, *scores = self._propagation(False)(Z)
        if not residual.max(initial=0.0) <= PROPAGATED:
            unsolved = ~(residual.max(axis=1) <= PROPAGATED)
            propagated[unsolved], values[unsolved], _, *again = self._propagation(True)(Z[unsolved])
            for found, better in zip(scores, again, strict=True):
                found[unsolved] = better
        return Propagated(propagated, values, (scores[0], scores[1]) if scores else None)

    def derivatives(self, propagated: Propagated, rows: np.ndarray) -> np.ndarray:
        """Total derivatives by the free variables of the rows with these indices, (k, count, d)."""
        interior = bool(self.inside[rows].any())
        self.differentiated += 1, len(propagated.Z)
        function, chosen = self._derivatives(interior), rows if interior else self._among_ends[rows]
        count, d = len(self.inside) if interior else int(np.sum(~self.inside)), len(self._layout.free)
        found = np.empty((len(propagated.Z), len(rows), d))
        some = max(1, 20_000_000 // max(1, count * d))  # derivatives in memory at once
        for first in range(0, len(found), some):
            part = propagated.Z[first : first + some]
            found[first : first + some] = function(part)[0].reshape(len(part), count, d)[:, chosen]
        return found

    @property
    def instructions(self) -> int:
        """Of the compiled function, for each vector that is propagated."""
        return self._propagation(False).instructions

    @property
    def instructions_of_derivatives(self) -> int:
        """Of the compiled function, for the derivatives at the ends of each vector."""
        return self._derivatives(False).instructions

    @remembered
    def _propagation(self, robust: bool) -> Batched:
        function = self._propagation_function(robust)
        if robust:
            return Batched(function, compiled=False)
        wide = (lambda k: self._propagation_function(robust, k)) if all(writer.wide for writer in self._writers) else None
        return Batched(function, compiled=self._compilable, wide=wide)

    @remembered
    def _derivatives(self, interior: bool) -> Batched:
        return Batched(self._total(interior=interior), compiled=self._compilable)

    @property
    def _compilable(self) -> bool:
        return all(writer.compilable for writer in self._writers)

    def _propagation_function(self, robust: bool, k: int = 1) -> ca.Function:
        """z -> (propagated z, values, residuals of the equations of states [, F, g]); for k vectors side by side, if writers are `wide`."""
        start = ca.MX.sym("z", len(self._layout.variables), k)
        extended, finals, residuals = self._layout.extended_symbol(start), [], []
        for writer in self._writers:
            extended, final, residual = writer.propagate(extended, robust=robust)
            finals.append(final)
            residuals.append(residual)
        z, *found = self._judged().map(k).call([extended, ca.vertcat(*finals)])
        return ca.Function("propagation", [start], [ca.densify(value) for value in (z, found[0], ca.vertcat(*residuals), *found[1:])])

    def _judged(self) -> ca.Function:
        """(propagated extended vector, final states of all phases) -> (z with its peaks, values [, F, g])."""
        n, count = len(self._layout.variables), sum(len(writer.phase.states) for writer in self._writers)
        extended, finals = ca.MX.sym("extended", self._layout.total), ca.MX.sym("finals", count)
        z = extended[: n + self._layout.hidden]
        z = self._layout.replaced(z, self._peaks, self._largest(z))
        scores = self._scores[0].call([z]) if self._scores else []
        rest = scores[1][self._scores[1].tolist(), :] if self._scores else self._rest(z)
        values = ca.vertcat(finals[self._imposed.tolist(), :], z[self._dependent.tolist(), :], rest)
        return ca.Function("judged", [extended, finals], [ca.densify(value) for value in (z[:n], values, *scores)])

    def _total(self, *, interior: bool) -> ca.Function:
        """Propagated z -> derivatives of the values by the free variables, (d, rows); without `interior`, only of rows at the ends."""
        z = ca.MX.sym("z", len(self._layout.variables))
        extended, S, finals = self._layout.extended_symbol(z), ca.MX(self._layout.seeds()), []
        extended = filled(self._writers, extended)
        known = extended[: z.numel() + self._layout.hidden]
        for writer in self._writers:
            S, final = writer.sensitivity(extended, S, interior=interior)
            finals.append(final)
        S = S[: known.numel(), :]
        if interior:
            S = self._layout.replaced(S, self._peaks, _jacobian(self._largest, known) @ S)
        rest = np.flatnonzero(interior | ~self.inside[len(self.inside) - self._rest.numel_out(0) :])
        by_z = _jacobian(self._rest, known)[rest.tolist(), :]
        dependent = self._dependent[interior | ~self.inside[len(self._imposed) :][: len(self._dependent)]]
        A = ca.vertcat(ca.vertcat(*finals)[self._imposed.tolist(), :], S[dependent.tolist(), :], by_z @ S)
        return ca.Function("total", [z], [ca.densify(A.T)])

    def _rows_inside(self) -> np.ndarray:
        """Rows that need the states inside the elements."""
        slots = np.concatenate([*(writer.interior for writer in self._writers), self._peaks])
        inside = _marked(self._layout.index(slots), self._layout.total)
        rest = np.zeros(self._rest.numel_out(0), dtype=bool)
        rows, columns = self._rest.jac_sparsity(0, 0).get_triplet()
        rest[np.array(rows, dtype=int)[inside[columns]]] = True
        return np.concatenate([np.zeros(len(self._imposed), dtype=bool), inside[self._dependent], rest])


def _marked(places: Sequence[int] | np.ndarray, count: int) -> np.ndarray:
    """Which of 0 ... count - 1 are among these places, (count,) of bool. The time is proportional to count, that of NumPy's sets is not."""
    found = np.zeros(count, dtype=bool)
    found[places] = True
    return found


def _jacobian(function: ca.Function, at: ca.MX) -> ca.MX:
    """The derivatives of a Function of one vector, there."""
    z = ca.MX.sym("z", at.numel())
    return ca.Function("jacobian", [z], [ca.jacobian(function(z), z)])(at)
