"""Functions that call externals, in layers: what is called between Functions that CasADi knows whole.

So cut, a Function is evaluated at many points with one call of each external in a layer for all of them, compares by its operations, and
pickles: externals go as Python's own functions do, by module and name.
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
class Call:
    """Derivatives of an order of an external, at several points."""

    arguments: ca.Function  # inputs of the whole, and values of the calls before -> (inputs of the external, points)
    external: External
    order: int


@dataclass(frozen=True, eq=False)
class Layers:
    """A Function as calls of externals, one after the other, and what becomes of their values."""

    calls: tuple[Call, ...]
    last: ca.Function  # inputs of the whole, and values of all calls -> outputs
    names: tuple[str, list[str], list[str]]  # of the whole, its inputs and outputs

    def mapped(self, k: int) -> ca.Function:
        """The Function for k sets of inputs side by side."""
        count = len(self.names[1])
        known = [
            ca.MX.sym(name, rows, columns * k)
            for name, (rows, columns) in zip(self.names[1], map(self.last.size_in, range(count)), strict=True)
        ]
        symbols = list(known)
        for call in self.calls:
            arguments = call.arguments.map(k)(*known)
            known.append(call.external.points(call.order, arguments.shape[1])(arguments))
        return ca.Function(self.names[0], symbols, self.last.map(k).call(known), *self.names[1:])

    @property
    def parts(self) -> tuple[ca.Function, ...]:
        """All Functions in it."""
        return *(call.arguments for call in self.calls), self.last


def calls_externals(function: ca.Function) -> bool:
    """Whether there is a call of an external anywhere in a Function."""
    return bool(EXTERNALS) and any(part.name() in EXTERNALS for part in function.find_functions())


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
    column = ca.cse(inlined(ca.vertcat(*(one.nz[:] for one in outputs)), calls_externals))
    depths: dict[int, int] = {}
    found: dict[tuple[int, External, int], list[ca.MX]] = {}
    for node in nodes(column):
        depth = max((depths[node.dep(i).__hash__()] for i in range(node.n_dep())), default=0)
        points = EXTERNALS.get(node.which_function().name()) if node.op() == ca.OP_CALL else None
        if points is not None:
            depth += 1
            found.setdefault((depth, points.external, points.order), []).append(node)
        depths[node.__hash__()] = depth
    if not found:
        return None
    groups = sorted(found.items(), key=lambda item: item[0][0])
    values = [ca.MX.sym("v", one.size(order), sum(node.dep(0).shape[1] for node in group)) for (_, one, order), group in groups]
    places = {}
    for value, (_, group) in zip(values, groups, strict=True):
        ends = np.cumsum([0, *(node.dep(0).shape[1] for node in group)]).tolist()
        places |= {node.__hash__(): part for node, part in zip(group, ca.horzsplit(value, ends), strict=True)}
    results = [node for node in nodes(column) if node.is_output() and node.dep(0).__hash__() in places]
    expressions = [ca.horzcat(*(node.dep(0) for node in group)) for _, group in groups]
    replaced = ca.graph_substitute([*expressions, column], results, [places[node.dep(0).__hash__()] for node in results])
    *arguments, last = replaced
    split = ca.vertsplit(last, np.cumsum([0, *(one.nnz() for one in outputs)]).tolist())
    whole = [ca.MX(one.sparsity(), part) for one, part in zip(outputs, split, strict=True)]
    made = tuple(
        Call(_flat(ca.Function("arguments", [*symbols, *values[:k]], [ca.densify(one)])), external, order)
        for k, (one, ((_, external, order), _)) in enumerate(zip(arguments, groups, strict=True))
    )
    names = function.name(), function.name_in(), function.name_out()
    return Layers(made, _flat(ca.Function("last", [*symbols, *values], whole)), names)


def check_externals(function: ca.Function, inputs: Sequence[np.ndarray]) -> None:
    """Check the externals that a Function calls at samples of its inputs (size, k): see `External.check`."""
    layers = layers_of(function) if calls_externals(function) else None
    known = [np.asarray(one, dtype=float) for one in inputs]
    for call in layers.calls if layers else ():
        arguments = np.array(call.arguments.map(known[0].shape[1])(*known)).T
        call.external.check(arguments)
        known.append(call.external.evaluate(call.order, arguments).T)


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


def _whole(calls: tuple[Call, ...], last: ca.Function, names: tuple[str, list[str], list[str]]) -> ca.Function:
    return Layers(calls, last, names).mapped(1)


copyreg.pickle(ca.Function, _packed)
