"""Functions that call externals, in layers: what is called between Functions that CasADi knows whole.

So cut, a Function is evaluated at many points with one call of each external in a layer for all of them, and pickles: externals go as
Python's own functions do, by module and name.
"""

from __future__ import annotations

import copyreg
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from .externals import EXTERNALS, External
from .switching import inlined, nodes


@dataclass(frozen=True, eq=False)
class Layer:
    """A Function, or derivatives of an order of an external, for several sets of inputs side by side."""

    arguments: ca.Function  # inputs of the whole, and values of the calls before -> inputs of the call
    called: ca.Function | tuple[External, int]
    count: int

    def at(self, k: int, arguments: Sequence[ca.MX]) -> list[ca.MX]:
        """Its values for so many times as many sets."""
        if isinstance(self.called, ca.Function):
            return list(self.called.map(self.count * k).call(arguments))
        external, order = self.called
        return [external.points(order, self.count * k)(arguments[0])]


@dataclass(frozen=True, eq=False)
class Layers:
    """A Function as calls, each of inputs and of values of the calls before, and what becomes of all these; names as CasADi has them."""

    calls: tuple[Layer, ...]
    last: ca.Function
    names: tuple[str, list[str], list[str]]

    def mapped(self, k: int) -> ca.Function:
        """The Function for k sets of inputs side by side."""
        name, inputs, outputs = self.names
        sizes = [self.last.size_in(i) for i in range(len(inputs))]
        known = [ca.MX.sym(word, rows, columns * k) for word, (rows, columns) in zip(inputs, sizes, strict=True)]
        for call in self.calls:
            known += call.at(k, call.arguments.map(k).call(known))
        return ca.Function(name, known[: len(inputs)], self.last.map(k).call(known), inputs, outputs)


def calls_externals(function: ca.Function) -> bool:
    """Whether there is a call of an external anywhere in a Function."""
    return bool(EXTERNALS) and any(part.name() in EXTERNALS for part in (function, *function.find_functions()))


@lru_cache(maxsize=128)
def mapped(function: ca.Function, k: int) -> ca.Function:
    """The Function for k sets of inputs side by side; externals are called once for all of them."""
    layers = layers_of(function) if calls_externals(function) else None
    return function.map(k) if layers is None else layers.mapped(k)


@lru_cache(maxsize=32)
def layers_of(function: ca.Function) -> Layers | None:
    """The layers of a Function; None where no call of an external can be taken out of it, as from an iteration."""
    symbols = function.mx_in()
    outputs = function.call(symbols, True, False)
    column = ca.cse(inlined(ca.veccat(*(one.nz[:] for one in outputs)), calls_externals))
    depths: dict[int, int] = {}
    places: dict[tuple[int, int], ca.MX] = {}
    found: dict[tuple[int, str], list[ca.MX]] = {}
    every = nodes(column)
    for node in every:
        depth = max((depths[node.dep(i).__hash__()] for i in range(node.n_dep())), default=0)
        if node.op() == ca.OP_CALL:
            depth += 1
            found.setdefault((depth, str(node.which_function().__hash__())), []).append(node)
        depths[node.__hash__()] = depth
    groups = [group for _, group in sorted(found.items(), key=lambda item: item[0][0])]
    if not any(group[0].which_function().name() in EXTERNALS for group in groups):
        return None
    arguments, values = [], []
    for group in groups:
        one = group[0].which_function()
        arguments.append([ca.horzcat(*(ca.densify(node.dep(i)) for node in group)) for i in range(one.n_in())])
        own = [
            ca.MX.sym("v", one.sparsity_out(i) if len(group) == 1 else ca.repmat(one.sparsity_out(i), 1, len(group)))
            for i in range(one.n_out())
        ]
        values.append(own)
        for i, value in enumerate(own):
            places |= {(node.__hash__(), i): part for node, part in zip(group, ca.horzsplit(value, one.size2_out(i)), strict=True)}
    results = [node for node in every if node.is_output() and (node.dep(0).__hash__(), node.which_output()) in places]
    parts = [places[node.dep(0).__hash__(), node.which_output()] for node in results]
    flat = ca.graph_substitute([*(one for own in arguments for one in own), column], results, parts)
    *replaced, last = flat
    left, known, calls = iter(replaced), list(symbols), []
    for group, own, results in zip(groups, arguments, values, strict=True):
        one = group[0].which_function()
        inputs = _flat(ca.Function("arguments", known, [next(left) for _ in own]))
        points = EXTERNALS.get(one.name())
        count = len(group) * (points.count if points else 1)
        calls.append(Layer(inputs, (points.external, points.order) if points else one, count))
        known = [*known, *results]
    split = ca.vertsplit(last, np.cumsum([0, *(one.nnz() for one in outputs)]).tolist())
    whole = [ca.MX(one.sparsity(), part) for one, part in zip(outputs, split, strict=True)]
    return Layers(tuple(calls), _flat(ca.Function("last", known, whole)), (function.name(), function.name_in(), function.name_out()))


def check_externals(function: ca.Function, inputs: Sequence[np.ndarray]) -> None:
    """Check the externals that a Function calls at samples of its inputs (size, k): see `External.check`."""
    layers = layers_of(function) if calls_externals(function) else None
    known = [np.asarray(one, dtype=float) for one in inputs]
    for call in layers.calls if layers else ():
        k = known[0].shape[1]
        arguments = [np.array(one) for one in call.arguments.map(k).call(known)]
        if isinstance(call.called, ca.Function):
            known += [np.array(one) for one in call.called.map(call.count * k).call(arguments)]
        else:
            call.called[0].check(arguments[0].T)
            known.append(call.called[0].evaluate(call.called[1], arguments[0].T).T)


def _flat(function: ca.Function) -> ca.Function:
    """The Function as a flat list of scalar operations, where its parts allow that."""
    try:
        return function.expand()
    except RuntimeError:
        return function


def _packed(function: ca.Function) -> tuple[Any, ...]:
    """How a Function pickles: one that calls externals by its layers."""
    layers = layers_of(function) if calls_externals(function) else None
    return (ca.Function.deserialize, (function.serialize(),)) if layers is None else (_whole, (layers.calls, layers.last, layers.names))


def _whole(calls: tuple[Layer, ...], last: ca.Function, names: tuple[str, list[str], list[str]]) -> ca.Function:
    return Layers(calls, last, names).mapped(1)


copyreg.pickle(ca.Function, _packed)
