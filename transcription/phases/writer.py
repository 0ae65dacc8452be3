"""What a method writes: one phase. The rest of an NLP is the same for all methods (`assembly.py`)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from problems.compiled import CompiledPhase

from ..trajectories.trajectory import PhaseTrajectory
from .guess import along


@dataclass(frozen=True, eq=False)
class Ends:
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
    """Rows of constraints as they come together."""

    expressions: list[ca.MX] = field(default_factory=list)
    lower: list[np.ndarray] = field(default_factory=list)
    upper: list[np.ndarray] = field(default_factory=list)
    scale: list[np.ndarray] = field(default_factory=list)
    labels: list[str] = field(default_factory=list)
    propagated: list[bool] = field(default_factory=list)

    def add(
        self, expression: ca.MX, lower: object, upper: object, scale: object, labels: str | Sequence[str], *, propagated: bool = False
    ) -> None:
        """A matrix of rows, taken column by column; limits, scale and label one for each or one for all.

        `propagated` rows are satisfied by propagation, where no final value is imposed.
        """
        count = expression.numel()
        self.expressions.append(ca.vec(expression))
        for target, value in ((self.lower, lower), (self.upper, upper), (self.scale, scale)):
            target.append(np.broadcast_to(np.asarray(value, dtype=float), count))
        self.propagated.append(propagated)
        self.labels.extend([labels] * count if isinstance(labels, str) else labels)

    @property
    def left(self) -> np.ndarray:
        """Indices of the rows that propagation does not satisfy."""
        return np.flatnonzero(np.repeat(~np.array(self.propagated, dtype=bool), [e.numel() for e in self.expressions]))


@dataclass(frozen=True, eq=False)
class Written:
    """What a phase gives to objectives and constraints: controls (nu,) at both ends, integrals (column), samples of peaks (peaks, k);
    and what the variables at `PhaseWriter.magnitudes` have to be at least (column)."""

    first_control: ca.MX
    last_control: ca.MX
    integrals: ca.MX
    peak_samples: ca.MX
    magnitudes: ca.MX = field(default_factory=lambda: ca.MX(0, 1))


class PhaseWriter(ABC):
    """One phase, written by one method. Made with the layout, in which it has put its variables, and with the phase's ends."""

    phase: CompiledPhase
    ends: Ends
    interior: np.ndarray
    """Slots of the states and hidden quantities that `sensitivity` replaces only on demand."""
    compilable: bool
    """Whether what `propagate` does fast, and `sensitivity`, can be written in C."""
    magnitudes: np.ndarray = np.empty(0, dtype=int)
    """Slots of variables that stand for absolute values: without bounds, and as small as may be once the rest is known."""
    wide: bool = False
    """Whether `propagate` takes several extended vectors side by side."""

    def fill(self, extended: ca.MX) -> ca.MX:
        """An extended symbol with the phase's hidden quantities, which follow from the variables. Most methods have none."""
        return extended

    @abstractmethod
    def write(self, extended: ca.MX, rows: Rows) -> Written:
        """Add the rows of dynamics and path constraints of an extended symbol, hidden quantities and all."""

    @abstractmethod
    def guess(self, extended: np.ndarray) -> None:
        """Fill in the states of extended vectors (k, ...), whose times, parameters, controls and initial states are set."""

    @abstractmethod
    def control_nodes(self) -> tuple[np.ndarray, np.ndarray]:
        """Slots (k, nu) of the coefficients of the controls, in their order in time, and where they lie (k,): 0 at t0, 1 at tf."""

    def guess_controls(self, t0: float, tf: float) -> dict[int, float]:
        """The user's guess of the controls, where there is one, by slot."""
        slots, share = self.control_nodes()
        found: dict[int, float] = {}
        for control, places in zip(self.phase.controls, slots.T, strict=True):
            if control.name in self.phase.guesses:
                values = along(self.phase.guesses[control.name], np.array([t0]), np.array([tf]), share)[0]
                found.update(zip(places.tolist(), np.clip(values, control.lower, control.upper), strict=True))
        return found

    @abstractmethod
    def propagate(self, extended: ca.MX, *, robust: bool) -> tuple[ca.MX, ca.MX, ca.MX]:
        """Propagation from the initial states.

        Parameters
        ----------
        extended : MX (e, 1), or (e, k) if the writer is `wide`
            An extended symbol, of which the states are to be replaced. What comes back has as many columns.
        robust : bool
            To solve the equations of states by whatever it takes; otherwise fast, if need be with a residual.

        Returns
        -------
        MX (e, 1)
            With the states and hidden quantities that the dynamics give.
        MX (nx, 1)
            The final states, also where they are imposed and so no variables.
        MX (any, 1)
            Scaled residuals of the equations of states, which have to be looked at where it is not `robust`.
        """

    @abstractmethod
    def sensitivity(self, extended: ca.MX, S: ca.MX, *, interior: bool) -> tuple[ca.MX, ca.MX]:
        """Derivatives of the states of an extended symbol, which are propagated, by the free variables.

        Parameters
        ----------
        extended : MX (e, 1)
        S : MX (e, d)
            Derivatives of the extended vector: the seeds of the layout, with the rows of initial states given. The rows of the other states
            and of hidden quantities are to be replaced.
        interior : bool
            Also inside the elements; otherwise only at their ends.

        Returns
        -------
        MX (e, d)
            With the rows of the states and hidden quantities.
        MX (nx, d)
            Of the final states, also where they are imposed.
        """

    @abstractmethod
    def interpolate(self, extended: np.ndarray, flown: PhaseTrajectory) -> None:
        """Fill in states and controls of one extended vector (1, ...) from a trajectory of the phase; bounds are seen to afterwards."""

    @abstractmethod
    def unpack(self, extended: np.ndarray) -> PhaseTrajectory:
        """The phase's trajectory from one extended vector."""
