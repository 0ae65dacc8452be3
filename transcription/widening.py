"""Scalar Functions for many calls at once: each operation on all of them, which spares the interpreter most of its work."""

from __future__ import annotations

import casadi as ca


def widened(function: ca.Function, k: int) -> ca.Function:
    """k calls of a Function at once, operation by operation: to the last bit what k calls give.

    Parameters
    ----------
    function : Function
        A list of scalar operations (an SXFunction) of dense inputs and outputs.
    k : int

    Returns
    -------
    Function
        Of matrices (k, size of the input) to matrices (k, size of the output), whose rows are the calls.
    """
    symbols = [ca.MX.sym(f"i{i}", k, function.numel_in(i)) for i in range(function.n_in())]
    entries = [ca.horzsplit(symbol) if symbol.numel() else [] for symbol in symbols]
    found: list[list[ca.MX]] = [[ca.MX()] * function.numel_out(i) for i in range(function.n_out())]
    memory: dict[int, ca.MX] = {}
    for i in range(function.n_instructions()):
        operation, out, of = function.instruction_id(i), function.instruction_output(i), function.instruction_input(i)
        if operation == ca.OP_INPUT:
            memory[out[0]] = entries[of[0]][of[1]]
        elif operation == ca.OP_OUTPUT:
            value = memory[of[0]]
            found[out[0]][out[1]] = value if value.numel() == k else ca.repmat(value, k, 1)
        elif operation == ca.OP_CONST:
            memory[out[0]] = ca.MX(function.instruction_constant(i))
        elif len(of) == 1:
            memory[out[0]] = ca.MX.unary(operation, memory[of[0]])
        else:
            memory[out[0]] = ca.MX.binary(operation, memory[of[0]], memory[of[1]])
    return ca.Function(function.name(), symbols, [ca.densify(ca.horzcat(ca.MX(k, 0), *columns)) for columns in found])
