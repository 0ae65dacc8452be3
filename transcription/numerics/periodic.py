"""Periodic controls: values wrapped into one period, and laws that take the short way round; numpy and CasADi side by side."""

from __future__ import annotations

import casadi as ca
import numpy as np

from problems.compiled import CompiledPhase, Variable


def unwrapped_law(U: ca.MX, phase: CompiledPhase) -> ca.MX:
    """Coefficients (nu, q + 1) of which those of periodic controls follow each other the short way round: see `trajectory.unwrapped`."""
    period, divisor, _ = _periods(phase)
    if not period.any():
        return U
    law = ca.horzsplit(U)
    for k in range(1, len(law)):
        step = law[k] - law[k - 1]
        law[k] = law[k - 1] + step - period * ca.floor(step / divisor + 0.5)
    return ca.horzcat(*law)


def wrapped_controls(controls: ca.MX, phase: CompiledPhase) -> ca.MX:
    """Controls (nu, k) of which the periodic ones are brought back into their bounds: see `trajectory.wrapped`."""
    period, divisor, lower = _periods(phase)
    if not period.any():
        return controls
    turns = [ca.floor((column - lower) / divisor) for column in ca.horzsplit(controls)]
    return controls - ca.repmat(ca.DM(period), 1, controls.shape[1]) * ca.horzcat(*turns)


def _periods(phase: CompiledPhase) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Periods of the controls (nu,), 0 where there is none; the same to divide by; lower bounds."""
    period = np.array([v.period or 0.0 for v in phase.controls])
    return period, np.where(period > 0, period, 1.0), np.array([v.lower for v in phase.controls])


def wrapped(controls: np.ndarray, variables: tuple[Variable, ...]) -> np.ndarray:
    """Controls (..., nu) of which the periodic ones are brought back into their bounds."""
    result = np.array(controls, dtype=float)
    for i, v in enumerate(variables):
        if v.period:
            result[..., i] = v.lower + np.mod(result[..., i] - v.lower, v.period)
    return result


def unwrapped(coefficients: np.ndarray, variables: tuple[Variable, ...]) -> np.ndarray:
    """Coefficients (N, degree + 1, nu) of which those of periodic controls follow each other the short way round inside an element.

    A step of half a period goes down: other than `numpy.unwrap`, and exactly as the equations of a transcription have it.
    """
    result = np.array(coefficients, dtype=float)
    for i, v in enumerate(variables):
        for k in range(1, result.shape[1] if v.period else 0):
            step = result[:, k, i] - result[:, k - 1, i]
            result[:, k, i] -= v.period * np.floor(step / v.period + 0.5)
    return result
