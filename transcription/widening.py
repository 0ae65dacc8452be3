"""Scalar Functions for many calls at once: each operation on all of them, which spares the interpreter most of its work."""

from __future__ import annotations

import casadi as ca


def widened(function: ca.Function, k: int) -> ca.Function:
    """What `function.map(k)` is, to the last bit, but operation by operation instead of call by call, where that is possible.

    Parameters
    ----------
    function : Function
        Of dense inputs and outputs. If it is no list of scalar operations, the answer is `function.map(k)`.
    k : int
        Of how many calls the inputs stand side by side; so do the outputs.
    """
    if k == 1:
        return function
    if not function.is_a("SXFunction"):
        return function.map(k)
    shapes = [function.size_in(i) for i in range(function.n_in())]
    symbols = [ca.MX.sym(f"i{i}", rows, columns * k) for i, (rows, columns) in enumerate(shapes)]
    entries = [
        ca.horzsplit(ca.reshape(symbol, rows * columns, k).T) if rows * columns else []
        for symbol, (rows, columns) in zip(symbols, shapes, strict=True)
    ]
    found: list[list[ca.MX]] = [[ca.MX(k, 1)] * function.nnz_out(i) for i in range(function.n_out())]
    memory: dict[int, ca.MX] = {}
    for i in range(function.n_instructions()):
        operation, out, of = function.instruction_id(i), function.instruction_output(i), function.instruction_input(i)
        if operation == ca.OP_INPUT:
            memory[out[0]] = entries[of[0]][of[1]]
        elif operation == ca.OP_OUTPUT:
            found[out[0]][out[1]] = memory[of[0]]
        elif operation == ca.OP_CONST:
            memory[out[0]] = ca.MX(function.instruction_constant(i))
        elif len(of) == 1:
            memory[out[0]] = ca.MX.unary(operation, memory[of[0]])
        else:
            memory[out[0]] = ca.MX.binary(operation, memory[of[0]], memory[of[1]])
    results = []
    for i, columns in enumerate(found):
        whole = [ca.repmat(column, k, 1) if column.numel() < k else column for column in columns]
        rows, width = function.size_out(i)
        results.append(ca.reshape(ca.horzcat(*whole).T, rows, width * k) if columns else ca.MX(rows, width * k))
    return ca.Function(function.name(), symbols, results)
