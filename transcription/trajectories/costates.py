"""Costates and the Hamiltonian along a trajectory, as data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from .trajectory import PhaseTrajectory, PiecewisePolynomial, Trajectory

NO_LENGTH = 1e-6
"""Part of the whole duration that a phase lasts at most where it has no length."""


@dataclass(frozen=True, eq=False, repr=False)
class PhaseCostates(Mapping[str, np.ndarray]):
    """The costates of one phase by state, at the nodes of its trajectory.

    Where they jump they are those just after, and at tf those just before.
    """

    names: tuple[str, ...]  # the states
    at_nodes: np.ndarray  # (k, nx): At the nodes of the trajectory
    hamiltonian: np.ndarray  # (k,): There
    polynomial: PiecewisePolynomial  # the costates between the nodes
    # Of costates that were integrated backward: the largest difference from what the multipliers say at t0, and at the end of each
    # element where these are costates (DFET, Gauss, Radau), as a part of the largest costate, all in scales of their states. None for
    # those that are multipliers themselves, or follow from these exactly.
    error: float | None = None

    def __repr__(self) -> str:
        return f"PhaseCostates({len(self.at_nodes)} nodes, [{', '.join(self.names)}])"

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self.names:
            raise KeyError(f"there is no costate of '{name}'; there are those of {', '.join(self.names)}")
        return self.at_nodes[:, self.names.index(name)]

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)


@dataclass(frozen=True, eq=False, repr=False)
class Costates(Mapping[str, PhaseCostates]):
    """The costates of a whole trajectory, by phase, and the weights (m,) of the objectives, all minimised, in the sum to which they belong:
    not negative, of sum 1 in the objectives' own units."""

    weights: np.ndarray
    phases: Mapping[str, PhaseCostates]

    def __repr__(self) -> str:
        return f"Costates({', '.join(self.phases)}; weights {self.weights})"

    def __getitem__(self, name: str) -> PhaseCostates:
        if name not in self.phases:
            raise KeyError(f"no phase '{name}'; there are {', '.join(self.phases)}")
        return self.phases[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.phases)

    def __len__(self) -> int:
        return len(self.phases)


def has_length(trajectory: Trajectory, phase: PhaseTrajectory) -> bool:
    """Whether a phase has a length. The multipliers of one without are no costates. If no phase has any, all count as if they had."""
    lengths = [one.tf - one.t0 for one in trajectory.phases]
    whole = max(one.tf for one in trajectory.phases) - min(one.t0 for one in trajectory.phases)
    return phase.tf - phase.t0 > NO_LENGTH * whole or max(lengths) <= NO_LENGTH * whole
