"""The places of a problem's quantities in the vector of the NLP."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from problems.compiled import Variable

HIDDEN = 2**40
"""Slots from here on are those of hidden quantities: how many variables come before them is known only in the end."""
PASSED = 1e-3
"""How much a variable passes its bounds where something else bounds what it describes, in scales."""


class Layout:
    """Collects the variables of an NLP and hands out their slots.

    A slot is the index of a variable, or a negative number for a constant, of coinciding bounds. Quantities always equal share one.
    *Hidden* quantities are no variables, but follow from them at some expense: states in between, integrals. Slots are those of the
    *extended* vector: variables, hidden quantities, constants; see `index`.
    """

    def __init__(self) -> None:
        self.variables: list[Variable] = []
        self.free: list[int] = []
        self.hidden = 0
        self._constants: list[float] = []

    def add(self, variable: Variable, *, free: bool = False) -> int:
        """One quantity; `free` if the outer search may alter it. Returns its slot."""
        if variable.lower == variable.upper:
            self._constants.append(variable.lower)
            return -len(self._constants)
        self.variables.append(variable)
        if free:
            self.free.append(len(self.variables) - 1)
        return len(self.variables) - 1

    def add_table(self, prefix: str, variables: Sequence[Variable], rows: int, columns: int, *, free: bool = False) -> np.ndarray:
        """The same quantities at rows x columns places (elements x coefficients); returns slots (rows, columns, len(variables))."""
        slots = [
            [[self.add(v.named(f"{prefix}{v.name}[{j},{k}]"), free=free) for v in variables] for k in range(columns)] for j in range(rows)
        ]
        return np.array(slots, dtype=int).reshape(rows, columns, len(variables))

    def widen(self, *slots: np.ndarray) -> None:
        """Let variables pass their bounds by `PASSED`."""
        for slot in np.concatenate(slots).tolist():
            v = self.variables[slot]
            self.variables[slot] = replace(v, lower=v.lower - PASSED * v.scale, upper=v.upper + PASSED * v.scale)

    def add_hidden(self, *shape: int) -> np.ndarray:
        """Hidden quantities; returns slots of this shape."""
        first, count = HIDDEN + self.hidden, int(np.prod(shape))
        self.hidden += count
        return np.arange(first, first + count).reshape(shape)

    @property
    def total(self) -> int:
        """Length of the extended vector."""
        return len(self.variables) + self.hidden + len(self._constants)

    def index(self, slots: np.ndarray) -> np.ndarray:
        """Indices of slots in the extended vector, a flat array."""
        flat = slots.ravel()
        return np.where(flat >= HIDDEN, flat - HIDDEN + len(self.variables), flat % self.total)

    def extended(self, Z: np.ndarray) -> np.ndarray:
        """Extended vectors (k, total) of variables (k, n): a copy, to be indexed by slots; hidden quantities are 0."""
        constants = np.broadcast_to(self._constants[::-1], (len(Z), len(self._constants)))
        return np.hstack([Z, np.zeros((len(Z), self.hidden)), constants])

    def extended_symbol(self, z: ca.MX) -> ca.MX:
        """Extended vectors (total, k) of a symbol (..., k) of the variables, and perhaps the hidden quantities, else 0."""
        missing, k = len(self.variables) + self.hidden - z.shape[0], z.shape[1]
        if not missing and not self._constants:
            return z
        return ca.vertcat(z, ca.DM.zeros(missing, k), ca.repmat(ca.DM(self._constants[::-1]), 1, k))

    def seeds(self) -> ca.DM:
        """Derivatives (total, d) of an extended vector by its free variables, before anything follows from them."""
        d = len(self.free)
        return ca.DM(ca.Sparsity.triplet(self.total, d, self.free, list(range(d))), 1.0)

    def pick(self, extended: ca.MX, slots: np.ndarray) -> ca.MX:
        """The entries of an extended symbol at slots of shape (a, b, ...), as a matrix (last axis, product of the others)."""
        shape = slots.shape[-1], int(np.prod(slots.shape[:-1]))
        return ca.reshape(extended[self.index(slots).tolist()], *shape) if slots.size else ca.MX(*shape)

    def replaced(self, extended: ca.MX, slots: np.ndarray, values: ca.MX, *, constants: bool = False) -> ca.MX:
        """A symbol of extended rows in which those among `slots` are `values`, by one permutation; constants stay, unless `constants`."""
        total, kept = extended.shape[0], np.flatnonzero((slots.ravel() >= 0) | constants)
        places = np.arange(total)
        places[self.index(slots)[kept]] = total + kept
        return ca.vertcat(extended, values)[places.tolist(), :]

    @staticmethod
    def write(extended: np.ndarray, slots: np.ndarray, values: np.ndarray) -> None:
        """Set the variables among `slots` of extended vectors (k, ...) to `values` (k, *slots.shape, ...); constants stay what they are."""
        flat, mask = slots.ravel(), slots.ravel() >= 0
        extended[:, flat[mask]] = values.reshape(len(extended), slots.size, *extended.shape[2:])[:, mask]
