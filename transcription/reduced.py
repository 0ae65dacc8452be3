"""A problem in its free variables alone: the states follow by propagation, and what constraints are left are functions of the rest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
import scipy.sparse as sp

from problems.compiled import Variable

from .base import expanded
from .batched import Batched
from .layout import Layout
from .phase_writer import PhaseWriter


class SparseJacobian:
    """Derivatives of the outputs of a Function of z, at many points."""

    def __init__(self, function: ca.Function) -> None:
        z = ca.MX.sym("z", function.size1_in(0))
        jacobian = ca.jacobian(function(z), z)
        self.shape = jacobian.shape
        self.rows, self.columns = (np.array(index, dtype=int) for index in jacobian.sparsity().get_triplet())
        values = ca.vertcat(*[jacobian.nz[:]]) if jacobian.nnz() else ca.MX(0, 1)
        self._values = Batched(expanded(ca.Function("jacobian", [z], [values])))

    def times(self, Z: np.ndarray, S: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Some rows of the derivatives at Z (k, n), times S (k, n, d); shape (k, len(rows), d)."""
        (values,) = self._values(Z)
        matrices = (sp.csr_matrix((v, (self.rows, self.columns)), shape=self.shape)[rows] for v in values)
        return np.array([matrix @ s for matrix, s in zip(matrices, S, strict=True)]).reshape(len(Z), len(rows), S.shape[2])


@dataclass(frozen=True, eq=False)
class Flown:
    """Propagated vectors `Z` (k, n), and the values (k, rows) of what is left to satisfy."""

    Z: np.ndarray
    values: np.ndarray


class Reduced:
    """What propagation leaves to satisfy: lower <= values <= upper.

    The rows are the final states that are imposed, then all variables that are not free (states), then those constraints of the NLP that
    propagation does not satisfy.

    Attributes
    ----------
    lower, upper, scale : arrays (rows,)
    equation : array (rows,) of bool
    """

    def __init__(
        self,
        layout: Layout,
        writers: Sequence[PhaseWriter],
        march: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
        peaks: tuple[np.ndarray, ca.Function],
        rest: tuple[ca.Function, np.ndarray, np.ndarray, np.ndarray],
    ) -> None:
        self._layout, self._writers, self._march = layout, writers, march
        self.free = np.array(layout.free, dtype=int)
        self._dependent = np.setdiff1d(np.arange(len(layout.variables)), self.free)
        self._imposed = np.flatnonzero(np.concatenate([writer.ends.final for writer in writers]) < 0)
        self._peaks, largest = peaks
        self._largest = SparseJacobian(largest)
        function, g_lower, g_upper, g_scale = rest
        self._rest, self._rest_jacobian = Batched(function), SparseJacobian(function)
        finals: list[tuple[Variable, tuple[float, float]]] = [
            pair for writer in writers for pair in zip(writer.phase.states, writer.phase.final, strict=True)
        ]
        imposed = [finals[i] for i in self._imposed]
        dependent = [layout.variables[i] for i in self._dependent]
        self.lower = np.concatenate([[low for _, (low, _) in imposed], [v.lower for v in dependent], g_lower])
        self.upper = np.concatenate([[high for _, (_, high) in imposed], [v.upper for v in dependent], g_upper])
        self.scale = np.concatenate([[v.scale for v, _ in imposed], [v.scale for v in dependent], g_scale])
        self.equation = self.lower == self.upper
        self._inside = self._rows_inside(writers)

    def fly(self, Z: np.ndarray) -> Flown:
        """Propagate vectors (k, n), of which only the free entries matter."""
        Z, finals = self._march(Z)
        parts = [finals[:, self._imposed], Z[:, self._dependent]]
        return Flown(Z, np.hstack([*parts, self._rest(Z)[0]] if self._rest_jacobian.shape[0] else parts))

    def derivatives(self, flown: Flown, rows: np.ndarray) -> np.ndarray:
        """Total derivatives by the free variables of the rows that a mask chooses, (k, count, d)."""
        extended = self._layout.extended(flown.Z)
        S = np.zeros((*extended.shape, len(self.free)))
        S[:, self.free, np.arange(len(self.free))] = 1.0
        interior = bool((rows & self._inside).any())
        finals = np.concatenate([writer.sensitivity(extended, S, interior) for writer in self._writers], axis=1)
        n = flown.Z.shape[1]
        if len(self._peaks):
            S[:, self._peaks] = self._largest.times(flown.Z, S[:, :n], np.arange(len(self._peaks)))
        imposed, dependent = np.split(rows, np.cumsum([len(self._imposed), len(self._dependent)]))[:2]
        parts = [finals[:, self._imposed[imposed]], S[:, self._dependent[dependent]]]
        chosen = np.flatnonzero(rows[len(imposed) + len(dependent) :])
        if len(chosen):
            parts.append(self._rest_jacobian.times(flown.Z, S[:, :n], chosen))
        return np.concatenate(parts, axis=1)

    def _rows_inside(self, writers: Sequence[PhaseWriter]) -> np.ndarray:
        """Rows that need the states inside the elements."""
        inside = np.concatenate([*(writer.interior for writer in writers), self._peaks])
        rest = np.zeros(self._rest_jacobian.shape[0], dtype=bool)
        rest[self._rest_jacobian.rows[np.isin(self._rest_jacobian.columns, inside)]] = True
        return np.concatenate([np.zeros(len(self._imposed), dtype=bool), np.isin(self._dependent, inside), rest])
