"""From the user's scalar symbols to Functions of vectors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca


def vector_function(name: str, groups: Mapping[str, Sequence[ca.MX]], expressions: Sequence[ca.MX]) -> ca.Function:
    """A Function that takes one vector a group of scalar symbols and returns the column of expressions.

    Parameters
    ----------
    name : str
        Of the Function and of its one output.
    groups : mapping of str to scalar symbols
        The inputs, in order. A group may be empty.
    expressions : sequence of scalar MX
        In those symbols. May be empty.

    Returns
    -------
    Function
    """
    inputs = [ca.MX.sym(word, len(symbols)) for word, symbols in groups.items()]
    scalars = [symbol for symbols in groups.values() for symbol in symbols]
    entries = [vector[i] for vector, symbols in zip(inputs, groups.values(), strict=True) for i in range(len(symbols))]
    column = ca.vertcat(*expressions) if expressions else ca.MX(0, 1)
    (column,) = ca.substitute([ca.densify(column)], scalars, entries)
    return ca.Function(name, inputs, [column], list(groups), [name])
