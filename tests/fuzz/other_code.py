"""Flights by code of their own: plain terms, LSODA and plain sums, where MACS has CasADi Functions and DOP853."""

from typing import Any

import numpy as np
from random_flights import PlainPhase, PlainProblem
from random_terms import numeric
from scipy.integrate import solve_ivp

TIMES, CLOSE_TIMES = np.linspace(0.0, 1.0, 21), np.linspace(0.0, 1.0, 2001)
"""Places on an element where paths and peaks are sampled, and where there are narrow ones."""


def flown(plain: PlainProblem, point: Any) -> tuple[dict[str, float], dict[str, float]]:
    """A point flown from its controls: by how much what is flown differs from what it says, in the units of a verified point; and its
    objectives as flown."""
    misses: dict[str, float] = {}
    objectives: dict[str, float] = {}
    trajectory, parameters, before = point.trajectory, point.parameters, None
    names = [*(name for phase in plain.phases for name, *_ in phase.paths), *(name for name, *_ in plain.objectives)]
    times = CLOSE_TIMES if any(name.startswith("narrow") for name in names) else TIMES
    for phase in plain.phases:
        arc = trajectory[phase.name]
        states = dict(zip(phase.states, arc.edge_states[0].tolist(), strict=True))
        if plain.linked and before is not None:
            states |= {name: value for name, value in before.items() if name in states}
        # The integrals of all objectives of this phase are further states.
        integrands = [term for _, _, kind, its, term in plain.objectives if its is phase and kind == "integral"]
        y = np.array([*states.values(), *np.zeros(len(integrands))])
        peaks = {name: -np.inf for name, _, kind, its, _ in plain.objectives if its is phase and kind == "peak"}
        for j, (begin, end) in enumerate(zip(arc.state.edges, arc.state.edges[1:], strict=False)):
            y, seen = _element(phase, arc, j, float(begin), float(end), y, parameters, integrands, times)
            expected = arc.edge_states[j + 1]
            for k, (name, (lower, upper)) in enumerate(phase.states.items()):
                label = f"state {phase.name}.{name}"
                misses[label] = max(misses.get(label, 0.0), _ratio(abs(y[k] - expected[k]), upper - lower))
            for values in seen:
                for name, (lower, upper) in {**phase.states, **phase.controls}.items():
                    label = f"bounds of {phase.name}.{name}"
                    # Bounds that rounding cannot tell from one value are one.
                    size = max(upper - lower, 1e-9 * max(abs(lower), abs(upper)), 1e-290)
                    misses[label] = max(misses.get(label, 0.0), _excess(values[name], lower, upper, size))
                for name, term, lower, upper in phase.paths:
                    label, scale = f"path {phase.name}.{name}", _scale(lower, upper)
                    misses[label] = max(misses.get(label, 0.0), _excess(numeric(term, values), lower, upper, scale))
                for name, _, kind, its, term in plain.objectives:
                    if kind == "peak" and its is phase:
                        peaks[name] = max(peaks[name], numeric(term, values))
        before = dict(zip(phase.states, y.tolist(), strict=False))
        for name, (lower, upper) in phase.finals.items():
            span = phase.states[name][1] - phase.states[name][0]
            misses[f"final {phase.name}.{name}"] = _excess(before[name], lower, upper, span)
        left = list(y[len(states) :])
        for name, _, kind, its, term in plain.objectives:
            if its is not phase:
                continue
            if kind == "tf":
                objectives[name] = float(arc.tf)
            elif kind == "final":
                objectives[name] = numeric(term, before | parameters)
            elif kind == "integral":
                objectives[name] = float(left.pop(0))
            else:
                objectives[name] = peaks[name]
    return misses, objectives


def _element(
    phase: PlainPhase,
    arc: Any,
    j: int,
    begin: float,
    end: float,
    y: np.ndarray,
    parameters: dict[str, float],
    integrands: list[Any],
    times: np.ndarray,
) -> tuple[np.ndarray, list[dict[str, float]]]:
    """The end of an element that begins at y, and all values at some of its places."""
    names = list(phase.states)

    def values(s: float, state: np.ndarray) -> dict[str, float]:
        controls = arc.controls_on(j, np.array([2.0 * s - 1.0]))[0].tolist()
        known = dict(zip(names, state.tolist(), strict=False)) | dict(zip(phase.controls, controls, strict=True))
        return known | parameters | {"t": begin + s * (end - begin)}

    def rates(s: float, state: np.ndarray) -> list[float]:
        known = values(s, state)
        return [(end - begin) * numeric(term, known) for term in (*phase.rates.values(), *integrands)]

    if not np.isfinite(y).all():
        return np.full(len(y), np.nan), []
    sizes = np.array([upper - lower for lower, upper in phase.states.values()] + [1.0] * len(integrands))
    found = solve_ivp(rates, (0.0, 1.0), y, method="LSODA", t_eval=times, rtol=1e-9, atol=np.maximum(1e-11 * sizes, 1e-14))
    if not found.success or found.y.shape[1] < len(times):
        return np.full(len(y), np.nan), []
    return found.y[:, -1], [values(float(s), state) for s, state in zip(times, found.y.T, strict=True)]


def _scale(lower: float, upper: float) -> float:
    """In which a path constraint is verified: the span of two limits; of one, or an equality, its size, and at least one."""
    if np.isfinite(lower) and np.isfinite(upper) and upper > lower:
        return upper - lower
    return max(1.0, abs(lower) if np.isfinite(lower) else abs(upper))


def _excess(value: float, lower: float, upper: float, scale: float) -> float:
    return _ratio(max(lower - value, value - upper, 0.0), scale) if np.isfinite(value) else np.inf


def _ratio(amount: float, scale: float) -> float:
    if not np.isfinite(amount):
        return np.inf
    return 0.0 if amount == 0.0 else amount / max(scale, 1e-300)
