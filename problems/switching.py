"""Where the expressions of a phase jump, by the comparisons, signs and roundings in their graphs; expressions of the two sides.

`if_else(x > 0, a, b)` has the derivatives of a on one side and of b on the other; the jump between them is in no derivative.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, product

import casadi as ca
import numpy as np

COMPARISONS = (ca.OP_LT, ca.OP_LE)
REMAINDERS = (ca.OP_FMOD, ca.OP_REMAINDER)
STEPPED = (*COMPARISONS, ca.OP_SIGN, ca.OP_EQ, ca.OP_NE, ca.OP_FLOOR, ca.OP_CEIL, *REMAINDERS)


@dataclass(frozen=True, eq=False)
class Switching:
    """The k switches of a phase, with which its rates, integrands, path constraints or peaks may jump."""

    labels: tuple[str, ...]  # labels, differences: What switches, in the user's names, and what is 0 there; empty for roundings
    differences: tuple[str, ...]
    states: ca.Function  # (x, u, t, s) -> the value of each switch, and its difference, 1 without one (2 k)
    sides: ca.Function  # (x, u, t, s, w) -> all rows that may jump, with the values w (k) of the switches


def switching(groups: Mapping[str, Sequence[ca.MX]], expressions: Sequence[ca.MX], known: Sequence[ca.MX]) -> Switching | None:
    """The switches in expressions of a phase's symbols; None without any. Those of `known` symbols alone, such as time, are left out: a
    trajectory does not decide when they switch."""
    column, fixed = inlined(ca.vertcat(*expressions)), {symbol.__hash__() for symbol in known}
    kinds: list[list[ca.MX]] = []  # nodes that are the same together
    for node in nodes(column):
        if node.op() in STEPPED and not {symbol.__hash__() for symbol in ca.symvar(node)} <= fixed:
            if like := [kind for kind in kinds if same(kind[0], node)]:
                like[0].append(node)
            else:
                kinds.append([node])
    if not kinds:
        return None
    firsts = [kind[0] for kind in kinds]
    w = ca.MX.sym("w", sum(node.numel() for node in firsts))
    parts = ca.vertsplit(w, np.cumsum([0, *(node.numel() for node in firsts)]).tolist())
    pairs = [(node, _at(node, ca.reshape(part, node.shape))) for kind, part in zip(kinds, parts, strict=True) for node in kind]
    sides, stepped = column, {node.__hash__() for node, _ in pairs}
    while stepped & {node.__hash__() for node in nodes(sides)}:  # there may be remainders of remainders
        (sides,) = ca.graph_substitute([sides], *(list(one) for one in zip(*pairs, strict=True)))
    zeros = [_difference(node) for node in firsts]
    labels = [_text(node) for node in firsts for _ in range(node.numel())]
    words = ["" if zero is None else _text(zero) for zero, node in zip(zeros, firsts, strict=True) for _ in range(node.numel())]
    inputs = [ca.MX.sym(word, len(symbols)) for word, symbols in groups.items()]
    scalars = [symbol for symbols in groups.values() for symbol in symbols]
    entries = [vector[i] for vector, symbols in zip(inputs, groups.values(), strict=True) for i in range(len(symbols))]
    differences = [ca.MX.ones(*node.shape) if zero is None else zero for zero, node in zip(zeros, firsts, strict=True)]
    flat = ca.vertcat(*(ca.densify(ca.vec(one)) for one in (*map(_step, firsts), *differences)))
    found, sides = ca.substitute([flat, ca.densify(sides)], scalars, entries)
    return Switching(tuple(labels), tuple(words), ca.Function("switches", inputs, [found]), ca.Function("sides", [*inputs, w], [sides]))


def inlined(expression: ca.MX, wanted: Callable[[ca.Function], bool] = lambda function: True) -> ca.MX:
    """The expression with the operations of Functions that it calls in their place, as far as they have any to show and are `wanted`."""
    flat = ("MXFunction", "SXFunction")
    while True:
        every = [(node, call.which_function()) for node in nodes(expression) if (call := called(node)) is not None]
        outputs = [node for node, function in every if function.class_name() in flat and wanted(function)]
        if not outputs:
            return expression
        calls = [node.dep(0) for node in outputs]
        values = [call.which_function().call([call.dep(i) for i in range(call.n_dep())], True, False) for call in calls]
        chosen = [value[node.which_output()] for value, node in zip(values, outputs, strict=True)]
        (expression,) = ca.graph_substitute([expression], outputs, chosen)


def called(node: ca.MX) -> ca.MX | None:
    """The call of a Function that a node is a result of, if it is one."""
    return node.dep(0) if node.is_output() and node.dep(0).op() == ca.OP_CALL else None


def same(one: ca.MX, other: ca.MX) -> bool:
    """Whether two expressions are made of the same operations."""
    return bool(one.op() == other.op() and one.shape == other.shape and ca.is_equal(one, other, 100))


def _difference(node: ca.MX) -> ca.MX | None:
    """What is 0 where a node switches; None where that is not one number."""
    if node.op() in COMPARISONS:
        return node.dep(0) - node.dep(1)
    return node.dep(0) if node.op() == ca.OP_SIGN else None


def _step(node: ca.MX) -> ca.MX:
    """The value of a node that is constant between its switches: of a remainder, the quotient, rounded."""
    if node.op() not in REMAINDERS:
        return node
    quotient = node.dep(0) / node.dep(1)
    return ca.sign(quotient) * ca.floor(ca.fabs(quotient)) if node.op() == ca.OP_FMOD else ca.floor(quotient + 0.5)


def _at(node: ca.MX, step: ca.MX) -> ca.MX:
    """A node where that value is a given one."""
    return node.dep(0) - node.dep(1) * step if node.op() in REMAINDERS else step


def _text(expression: ca.MX) -> str:
    """An expression in the user's names, or, if that is long, what it is of."""
    text = str(expression)
    return text if len(text) <= 80 else f"an expression of {', '.join(sorted({symbol.name() for symbol in ca.symvar(expression)}))}"


def nodes(expression: ca.MX) -> list[ca.MX]:
    """All nodes of a graph, each once, after those that it depends on."""
    seen: dict[int, ca.MX] = {}
    entered: set[int] = set()
    left = [expression]
    while left:
        node = left[-1]
        if node.__hash__() in entered:
            seen.setdefault(node.__hash__(), left.pop())
        else:
            entered.add(node.__hash__())
            left += [node.dep(i) for i in range(node.n_dep()) if node.dep(i).__hash__() not in entered]
    return list(seen.values())


def sides(
    expressions: Mapping[str, ca.MX], values: Callable[[ca.MX], tuple[float, float] | None]
) -> tuple[dict[str, ca.MX], dict[str, ca.MX], int]:
    """Expressions before and after a switch, with `values` of the comparisons that switch in their place; and how many these are."""
    flat = {name: inlined(expr) for name, expr in expressions.items()}
    comparisons = [node for node in nodes(ca.vertcat(*flat.values())) if node.op() in COMPARISONS]
    found = [(node, pair) for node in comparisons if (pair := values(node))]
    before, after = (
        {
            name: ca.graph_substitute([expr], [node for node, _ in found], [ca.MX(pair[k]) for _, pair in found])[0]
            for name, expr in flat.items()
        }
        for k in (0, 1)
    )
    return before, after, len(found)


def at_time(node: ca.MX, time: ca.MX, when: float) -> tuple[float, float] | None:
    """The values of a comparison of time alone just before and after a time; None where it does not switch then."""
    if [one.__hash__() for one in ca.symvar(node)] != [time.__hash__()]:
        return None
    step, function = 1e-9 * max(1.0, abs(when)), ca.Function("value", [time], [node])
    before, after = (float(function(at)) for at in (when - step, when + step))
    return (before, after) if before != after else None


def value_at(condition: ca.MX, ranges: Mapping[int, tuple[float, float]]) -> bool | None:
    """Whether a condition holds within ranges of its symbols, by their hashes; None where these do not tell."""
    symbols = ca.symvar(condition)
    if not all(symbol.__hash__() in ranges for symbol in symbols):
        return None
    function, corners = ca.Function("value", symbols, [condition]), product(*(ranges[symbol.__hash__()] for symbol in symbols))
    found = {float(function(*corner)) for corner in corners}
    return bool(found.pop()) if len(found) == 1 else None


def corners(expressions: Sequence[ca.MX], time: ca.MX, ends: tuple[float, float], most: int = 100) -> tuple[float, ...]:
    """The times between two at which tables of time have corners, or comparisons of time switch; without any, or with more than
    `most`, none. Tables are linear interpolants of expressions that are linear in time."""
    seen: list[ca.MX] = []
    for node in nodes(inlined(ca.vertcat(*expressions))):
        call = called(node)
        table = call is not None and call.which_function().class_name() == "LinearInterpolant" and call.dep(0).numel() == 1
        if (table or node.op() in COMPARISONS) and [one.__hash__() for one in ca.symvar(node)] == [time.__hash__()]:
            line = call.dep(0) if table and call is not None else node.dep(0) - node.dep(1)
            if ca.jacobian(line, time).is_constant():
                seen.append(ca.jacobian(node, time) if table else node)
    if not seen or not ends[0] < ends[1]:
        return ()
    function, found = ca.Function("steps", [time], [ca.densify(ca.vertcat(*seen))]), list[float]()
    grid = np.linspace(*ends, 1025)
    left = list(zip(pairwise(grid.tolist()), pairwise(np.array(function(grid[None])).T), strict=True))
    while left and len(found) <= most:
        (a, b), (at_a, at_b) = left.pop()
        middle = 0.5 * (a + b)
        if not np.allclose(at_a, at_b, rtol=1e-9, atol=0.0):
            if b - a < 1e-12 * (ends[1] - ends[0]) or not a < middle < b:
                found.append(middle)
            else:
                at_middle = np.array(function(middle)).ravel()
                left += [((a, middle), (at_a, at_middle)), ((middle, b), (at_middle, at_b))]
    near = 1e-9 * (ends[1] - ends[0])
    inside = sorted(time for time in found if ends[0] + near < time < ends[1] - near)
    return tuple(inside) if len(found) <= most else ()
