"""Functions of a phase that are evaluated at points of its elements."""

from __future__ import annotations

import casadi as ca

from problems.compiled import CompiledPhase


def rates_and_integrands(phase: CompiledPhase) -> ca.Function:
    """(x, u, place, share, s) -> (rates and integrands, times half of the length of the element; sizes), at one point.

    The place is that of the point and the share that of its element, relative to the phase.
    """
    x, u, place, share, s = _symbols(phase)
    half, along = 0.5 * share * (s[1] - s[0]), (x, u, s[0] + place * (s[1] - s[0]), s)
    values = [half * phase.dynamics(*along), half * phase.integrands(*along), phase.sizes(*along)]
    return ca.Function("inside", [x, u, place, share, s], values)


def at_place(function: ca.Function, chosen: list[int], phase: CompiledPhase) -> ca.Function:
    """(x, u, place, s) -> some rows of what a Function of a phase returns at this place, relative to the phase."""
    x, u, place, _, s = _symbols(phase)
    return ca.Function(function.name(), [x, u, place, s], [function(x, u, s[0] + place * (s[1] - s[0]), s)[chosen]])


def times_half_length(phase: CompiledPhase, size: int) -> ca.Function:
    """(values, share, s) -> values times half of the length of an element with this share of the phase."""
    values, (_, _, _, share, s) = ca.MX.sym("values", size), _symbols(phase)
    return ca.Function("weighted", [values, share, s], [0.5 * share * (s[1] - s[0]) * values])


def need_derivatives(phase: CompiledPhase, method: str) -> None:
    """Raise ValueError if the dynamics have no derivatives: implicit equations cannot be solved without."""
    try:
        phase.dynamics.jacobian()
    except RuntimeError:
        raise ValueError(
            f"{method}: phase '{phase.name}': the dynamics have no derivatives; give their Callback a Jacobian, "
            "or its option 'enable_fd': True"
        ) from None


def _symbols(phase: CompiledPhase) -> list[ca.MX]:
    """Symbols of x, u, place, share and s at one point."""
    sizes = {"x": len(phase.states), "u": len(phase.controls), "place": 1, "share": 1, "s": phase.dynamics.size1_in(3)}
    return [ca.MX.sym(name, size) for name, size in sizes.items()]
