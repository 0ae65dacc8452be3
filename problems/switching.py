"""Where the expressions of a phase jump: the comparisons, signs and roundings in their graphs.

`if_else(x > 0, a, b)` has the derivatives of a on one side and of b on the other. That it jumps from one to the other where a trajectory
crosses x = 0 is in no derivative, nor does an independent simulation contradict it. So what a gradient solver takes for an optimum need not
be one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

COMPARISONS = (ca.OP_LT, ca.OP_LE)
ROUNDINGS = (ca.OP_FLOOR, ca.OP_CEIL, ca.OP_EQ, ca.OP_NE)
REMAINDERS = (ca.OP_FMOD, ca.OP_REMAINDER)
DEEP, LONGEST = 100, 80
"""How deep expressions are compared; characters of one that is shown."""


@dataclass(frozen=True, eq=False)
class Switching:
    """The k switches of a phase, with which its rates, integrands, path constraints or peaks may jump."""

    labels: tuple[str, ...]  # labels, differences: What switches, in the user's names, and what is 0 there; empty for roundings
    differences: tuple[str, ...]
    # (x, u, t, s) -> a number that changes where each switches, its value, and its difference, or 1 without one: (3 k)
    states: ca.Function
    sides: ca.Function  # (x, u, t, s, w) -> all rows that may jump, with the values w (k) of the switches


def switching(groups: Mapping[str, Sequence[ca.MX]], expressions: Sequence[ca.MX], known: Sequence[ca.MX]) -> Switching | None:
    """The switches in expressions of a phase's symbols; None without any. Those of `known` symbols alone, such as time, are left out: a
    trajectory does not decide when they switch."""
    column = inlined(ca.vertcat(*expressions))
    fixed = {symbol.__hash__() for symbol in known}
    kinds = [kind for kind in _kinds(column) if not {symbol.__hash__() for symbol in ca.symvar(kind[0])} <= fixed]
    if not kinds:
        return None
    values = [ca.MX.sym(f"w{k}", kind[0].shape) for k, kind in enumerate(kinds)]
    w = ca.MX.sym("w", sum(value.numel() for value in values))
    parts = ca.vertsplit(w, [0, *(sum(value.numel() for value in values[: k + 1]) for k in range(len(values)))])
    nodes = [(node, part) for kind, part in zip(kinds, parts, strict=True) for node in kind]
    replacements = [ca.reshape(part, node.shape) for node, part in nodes]
    (sides,) = ca.graph_substitute([column], [node for node, _ in nodes], replacements)
    changing, differences, labels, words = [], [], [], []
    for first, *_ in kinds:
        change, difference = _change(first)
        changing.append(change)
        differences.append(ca.MX.ones(*first.shape) if difference is None else difference)
        labels += [_text(first)] * first.numel()
        words += ["" if difference is None else _text(difference)] * first.numel()
    inputs = [ca.MX.sym(word, len(symbols)) for word, symbols in groups.items()]
    scalars = [symbol for symbols in groups.values() for symbol in symbols]
    entries = [vector[i] for vector, symbols in zip(inputs, groups.values(), strict=True) for i in range(len(symbols))]
    flat = ca.vertcat(*(ca.densify(ca.vec(one)) for one in (*changing, *(kind[0] for kind in kinds), *differences)))
    found, sides = ca.substitute([flat, ca.densify(sides)], scalars, entries)
    states = ca.Function("switches", inputs, [found], list(groups), ["switches"])
    return Switching(tuple(labels), tuple(words), states, ca.Function("sides", [*inputs, w], [sides], [*groups, "w"], ["sides"]))


def inlined(expression: ca.MX) -> ca.MX:
    """The expression with the operations of Functions that it calls in their place, as far as they have any to show."""
    while True:
        calls = [
            (node, node.dep(0), called)
            for node in _nodes(expression)
            if node.is_output() and ((called := node.dep(0).which_function()).is_a("MXFunction") or called.is_a("SXFunction"))
        ]
        if not calls:
            return expression
        values = [called.call([call.dep(i) for i in range(call.n_dep())], True, False)[node.which_output()] for node, call, called in calls]
        (expression,) = ca.graph_substitute([expression], [node for node, *_ in calls], values)


def same(one: ca.MX, other: ca.MX) -> bool:
    """Whether two expressions are made of the same operations."""
    return bool(one.op() == other.op() and one.shape == other.shape and ca.is_equal(one, other, DEEP))


def switches_like(expression: ca.MX, condition: ca.MX) -> list[ca.MX]:
    """The nodes of an expression that are the same comparison as a condition."""
    return [node for node in _nodes(expression) if node.op() in COMPARISONS and same(node, condition)]


def _kinds(expression: ca.MX) -> list[list[ca.MX]]:
    """The nodes that switch; those that are the same together."""
    kinds: list[list[ca.MX]] = []
    for node in _nodes(expression):
        if node.op() not in (*COMPARISONS, *ROUNDINGS, *REMAINDERS, ca.OP_SIGN):
            continue
        kind = next((kind for kind in kinds if same(kind[0], node)), None)
        if kind is None:
            kinds.append([node])
        else:
            kind.append(node)
    return kinds


def _text(expression: ca.MX) -> str:
    """An expression in the user's names, or, if that is long, what it is of."""
    text = str(expression)
    return text if len(text) <= LONGEST else f"an expression of {', '.join(sorted({symbol.name() for symbol in ca.symvar(expression)}))}"


def _change(node: ca.MX) -> tuple[ca.MX, ca.MX | None]:
    """A number that changes where a node switches, and what is 0 there; None where that is not one number."""
    op = node.op()
    if op in REMAINDERS:
        ratio = node.dep(0) / node.dep(1)
        return ca.floor(ratio + 0.5 if op == ca.OP_REMAINDER else ratio), None
    if op in ROUNDINGS:
        return node, None
    return node, node.dep(0) if op == ca.OP_SIGN else node.dep(0) - node.dep(1)


def _nodes(expression: ca.MX) -> Iterator[ca.MX]:
    """All nodes of a graph, each once."""
    seen, left = set(), [expression]
    while left:
        node = left.pop()
        if node.__hash__() not in seen:
            seen.add(node.__hash__())
            left += [node.dep(i) for i in range(node.n_dep())]
            yield node
