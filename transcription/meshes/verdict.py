"""Assessment of one trajectory on its mesh by simulations: its errors, their places, and whether they are within tolerance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem

from ..meshed import Meshed
from ..trajectories.arcs import Arcs
from ..trajectories.simulate import Simulation, simulate, simulate_elements
from ..trajectories.trajectory import PhaseTrajectory, Trajectory
from .errors import PhaseErrors, phase_errors, state_scales
from .minimum import Gain, OptimumMultipliers, gains


@dataclass(frozen=True)
class Wanted:
    """Tolerances of a trajectory."""

    tolerance: float  # largest defect: of the simulated states from those of the mesh, in units of what the states do
    feasible: float  # largest excess of constraints, simulated and between nodes, in their scales
    leaving: float = 0.0  # the same for controls between nodes
    # Largest error of an objective, in its unit; by default ten tolerances: the loss by poorly described controls is of second order.
    objectives: float | None = None
    # Whether a finer mesh has to confirm the objectives, too; otherwise it is enough that a simulation does, and meshes are not refined
    # for controls that polynomials of their degree describe poorly.
    confirmed: bool = True
    gain: float | None = None  # largest gain of other controls, see `minimum`, in units of objectives; by default as for objectives

    @property
    def gained(self) -> float:
        """Largest gain of other controls, in units of the objectives."""
        return self.settled if self.gain is None else self.gain

    @property
    def settled(self) -> float:
        """Largest error of an objective."""
        return 10.0 * self.tolerance if self.objectives is None else self.objectives

    @property
    def accuracy(self) -> float:
        """Relative tolerance of an integrator that is far more exact; in spans of the states' bounds, it is ten times as exact, or more."""
        return float(np.clip(1e-3 * self.tolerance, 1e-13, 1e-7))


@dataclass(frozen=True, eq=False)
class Verdict:
    """The independent assessment of a trajectory on its mesh."""

    problem: CompiledProblem
    simulation: Simulation  # of the whole trajectory
    by_elements: Simulation  # of each element by itself
    errors: list[PhaseErrors]  # element by element
    wanted: Wanted
    # Largest difference between the simulated states and those of the mesh, at the ends of elements, in units of what the states do.
    defect: float
    missed: float  # largest difference between the simulated objectives and those of the mesh, in their units
    missed_by_elements: float  # the same for the simulation of each element by itself: the error of quadratures and of peaks between nodes
    growth: float  # how much errors grow along the trajectory, where that was worth finding out; else 1
    narrow: float  # the least that any state does, in spans of its bounds
    # What controls could still gain in each phase, see `minimum`, in units of the objectives; empty where that is not known.
    gains: Mapping[str, Gain] = field(default_factory=dict)

    @property
    def gain(self) -> float:
        """The gain of other controls in all phases together."""
        return sum(float(gain.amounts.sum()) for gain in self.gains.values())

    @property
    def doubt(self) -> float:
        """The possible underestimate of objectives, in their units, due to inexact constraints: three times the violation."""
        return 3.0 * self.simulation.violation / self.narrow

    @property
    def local(self) -> float:
        """The largest defect of an element."""
        return max(float(phase.defect.max()) for phase in self.errors)

    @property
    def excess(self) -> float:
        """The largest excess of states and path constraints over their limits between nodes, in their scales."""
        return max((float(phase.excess.max()) for phase in self.errors), default=0.0)

    @property
    def leaving(self) -> float:
        """The same for controls."""
        return max((float(phase.leaving.max()) for phase in self.errors), default=0.0)

    @property
    def unstable(self) -> bool:
        """Whether no simulation of the whole can follow the trajectory: an integrator's least error, 1e-11, grows beyond the tolerance."""
        return self.growth * 1e-11 > self.wanted.tolerance

    @property
    def off(self) -> float:
        """The largest error of an objective that the simulation shows, in its unit."""
        return self.missed_by_elements if self.unstable else self.missed

    @property
    def error(self) -> float:
        """The largest of all errors, in units of the tolerance; controls that leave their bounds count like constraints."""
        wanted = self.wanted
        defect, violation = (self.local, 0.0) if self.unstable else (self.defect, self.simulation.violation)
        limits = max(self.excess, violation, self.leaving) / wanted.feasible
        return max(defect / wanted.tolerance, limits, self.off / wanted.settled)

    @property
    def remark(self) -> str:
        """A remark on a trajectory that no simulation can follow; else empty."""
        if not self.unstable:
            return ""
        return f"unstable: open-loop simulation cannot follow (errors grow by {self.growth:.0e}); each element is right to {self.local:.0e}"

    def complaints(self) -> list[str]:
        """Messages about errors above the tolerance; empty if there are none."""
        found, wanted = [], self.wanted
        if self.unstable:
            if not self.local <= wanted.tolerance:
                found.append(f"simulated by itself, an element ends {self.local:.1e} away")
        elif not self.defect <= wanted.tolerance:
            found.append(f"simulated, it ends {self.defect:.1e} of what its states do away")
        if self.leaving > wanted.leaving:
            found.append(f"a control leaves its bounds by {self.leaving:.1e} between nodes")
        if not self.excess <= wanted.feasible:
            found.append(f"a state or path constraint leaves its limits by {self.excess:.1e} between nodes")
        violations = self.by_elements.violations if self.unstable else self.simulation.violations
        if not found and violations and not max(violations.values()) <= wanted.feasible:
            worst = max(violations, key=lambda key: violations[key])
            found.append(f"simulated, it violates '{worst}' by {violations[worst]:.1e}")
        if not found and not self.off <= wanted.settled:
            found.append(f"when simulated, its objectives differ by {self.off:.1e} of the front's range")
        return found

    def scores(self) -> list[ElementScores]:
        """The errors of the elements of each phase, in units of the tolerance."""
        wanted, safety = self.wanted, 0.5  # the share of the tolerance that elements have together, were their errors equal
        total = sum(float(phase.defect.sum()) for phase in self.errors)
        # What an error at one element becomes at the end of the trajectory, at least.
        finite = 0.0 < total < np.inf and np.isfinite(self.defect) and not self.unstable
        grown = max(1.0, self.defect / total) if finite else 1.0
        count = sum(len(phase.defect) for phase in self.errors)
        found = []
        for phase in self.errors:
            states = np.maximum(grown * phase.defect * count / (safety * wanted.tolerance), phase.excess / wanted.feasible)
            controls, sums = np.zeros((2, len(states)))
            # That controls are not optimal, no simulation sees.
            if wanted.confirmed:
                controls = phase.weight * phase.tail**2 * count / wanted.settled
            if not self.missed_by_elements <= safety * wanted.settled:
                sums = phase.sums * count * self.missed_by_elements / (safety * wanted.settled)
            found.append(ElementScores(*(np.nan_to_num(part, nan=np.inf, posinf=np.inf) for part in (states, controls, sums))))
        return found

    def worst_place(self, method: Meshed, trajectory: Trajectory) -> str:
        """The place of the largest error, in words."""
        scores = [score.all for score in self.scores()]
        names = list(trajectory)
        i = int(np.argmax([score.max() for score in scores]))
        j = int(np.argmax(scores[i]))
        phase, steep = trajectory[names[i]], self.errors[i].steep[j]
        time = phase.state.times(np.nan_to_num([steep]))[j, 0]
        why = "" if np.isnan(steep) else ", where a control switches or is steep"
        return f"the mesh is coarsest for phase '{names[i]}' near {time:.6g} {phase.time_unit}{why}"


@dataclass(frozen=True, eq=False)
class ElementScores:
    """Errors (N,) of a phase's elements in units of the tolerance: states and limits; controls; integrals and peaks."""

    states: np.ndarray
    controls: np.ndarray
    sums: np.ndarray

    @property
    def others(self) -> np.ndarray:
        """All but those of controls."""
        return np.maximum(self.states, self.sums)

    @property
    def all(self) -> np.ndarray:
        """The largest of all."""
        return np.maximum(self.others, self.controls)


def judge(
    problem: CompiledProblem,
    trajectory: Trajectory,
    wanted: Wanted,
    F: np.ndarray,
    units: np.ndarray,
    optimum: OptimumMultipliers | None = None,
) -> Verdict:
    """The assessment of a trajectory by an integrator that is far more exact than the tolerance; see `Verdict`. F, units (m,)."""
    # An objective whose unit is a small part of it has to be simulated more exactly.
    rtol = max(min(wanted.accuracy, 0.1 * wanted.settled * float((units / np.maximum(np.abs(F), units)).min())), 1e-13)
    scales = {name: state_scales(phase) for name, phase in trajectory.items()}
    # The integrator's absolute tolerance is stated in spans.
    spans = {name: np.array([v.span for v in phase.state_variables]) for name, phase in trajectory.items()}
    narrow = min(float((scales[name] / spans[name]).min(initial=1.0)) for name in scales)
    atol = max(0.1 * rtol * narrow, 1e-20)
    whole = simulate(problem, trajectory, rtol=rtol, atol=atol)
    parts = simulate_elements(problem, trajectory, rtol=rtol, atol=atol)
    errors = phase_errors(problem, trajectory, parts)
    away = [
        float((np.abs(whole.trajectory[name].edge_states - phase.edge_states) / scales[name]).max()) for name, phase in trajectory.items()
    ]
    defect = float(np.max(away)) if np.isfinite(away).all() else np.inf
    total = sum(float(phase.defect.sum()) for phase in errors)
    # Where elements hardly have a share in the defect of the whole, errors grow.
    grows = defect > wanted.tolerance and total < 0.01 * defect
    return Verdict(
        problem=problem,
        simulation=whole,
        by_elements=parts,
        errors=errors,
        wanted=wanted,
        defect=defect,
        missed=_missed(problem, whole, F, units),
        missed_by_elements=_missed(problem, parts, F, units),
        growth=growth(problem, trajectory) if grows else 1.0,
        narrow=narrow,
        gains={} if optimum is None else gains(problem, trajectory, optimum, whole.quantities, units),
    )


def _missed(problem: CompiledProblem, simulation: Simulation, F: np.ndarray, units: np.ndarray) -> float:
    difference = np.abs(simulated_objectives(problem, simulation) - F)
    return float(np.where(np.isfinite(difference), difference / units, np.inf).max())


def simulated_objectives(problem: CompiledProblem, simulation: Simulation) -> np.ndarray:
    """The objectives (m,) of a simulation, all minimised."""
    return np.array([simulation.objectives[goal.name] for goal in problem.goals]) * problem.signs


def growth(problem: CompiledProblem, trajectory: Trajectory) -> float:
    """The largest factor, to first order, by which an error of a state, in scales, grows through a phase; at least 1."""
    parameters = np.array([trajectory.parameters[v.name] for v in problem.parameters])
    largest = 1.0
    for phase in problem.phases:
        transitions = _transitions(phase, trajectory[phase.name], parameters)
        if not np.isfinite(transitions).all():
            return np.inf
        reached = np.eye(len(phase.states))[None]
        for one in transitions:
            # From the beginnings of all elements so far to the end of this one.
            reached = one @ reached
            largest = max(largest, float(np.abs(reached).sum(axis=2).max()))
            if largest > 1e100:
                return np.inf
            reached = np.concatenate([reached, np.eye(len(phase.states))[None]])
    return largest


def _transitions(phase: CompiledPhase, trajectory: PhaseTrajectory, parameters: np.ndarray) -> np.ndarray:
    """Derivatives (N, nx, nx) of the states at the ends of the elements by those at their beginnings, in scales."""
    elements, nx = len(trajectory.state.coefficients), len(phase.states)
    scales, nothing = state_scales(trajectory), np.zeros((elements * (nx + 1), phase.integrands.size1_out(0)))
    rtol, step = 1e-9, 1e-5  # a state is changed, in scales, by what the integrator resolves to four digits
    changed = np.vstack([np.zeros(nx), step * np.diag(scales)])
    starts = (trajectory.edge_states[:-1, None] + changed).reshape(-1, nx)
    arcs = Arcs.of(phase, [trajectory], [parameters]).alone(np.repeat(np.arange(elements), nx + 1))
    tolerances = 0.1 * rtol * np.concatenate([scales, np.ones(nothing.shape[1])])
    ends = arcs.integrate(np.hstack([starts, nothing]), rtol, tolerances, "DOP853")[0, :, -1, :nx].reshape(elements, nx + 1, nx)
    return ((ends[:, 1:] - ends[:, :1]) / (step * scales)).swapaxes(1, 2)
