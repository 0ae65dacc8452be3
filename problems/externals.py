"""Functions that CasADi cannot look into, such as a simulator written with NumPy, a table of another package or a compiled library, in a
problem's expressions.

In a graph, such a function is a call of `ExternalPoints`, its derivatives too: of one point in what users state, of all at once where it is
evaluated (`layers.py`). First derivatives are complex steps (Squire and Trapp, SIAM Review 40(1), 1998) or central differences, of all
points in one call; second ones are differences of the first.
"""

from __future__ import annotations

import ctypes
import os
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from .switching import called

EXTERNALS: dict[str, ExternalPoints] = {}
"""By the names of their Functions. CasADi keeps none alive."""
_raised: list[BaseException] = []
_placeholders: dict[tuple[str, str], tuple[ca.MX, str, str]] = {}


def reraise() -> None:
    """Raise what an external function raised while CasADi, which would swallow it, called it."""
    if _raised:
        error = _raised[0]
        _raised.clear()
        raise error


def external(
    function: Callable[..., Any] | str | os.PathLike[str],
    *,
    states: Sequence[Any] = (),
    controls: Sequence[Any] = (),
    parameters: Sequence[Any] = (),
    derivatives: str | Callable[..., Any] = "complex",
    outputs: Sequence[str] | int | None = None,
) -> ca.MX:
    """What a function of arrays returns, as an expression: rates for `Phase.dynamics`, or part of any other expression.

    It is called once for all points of a step, or for all perturbations of these. The same row must always give the same, whatever rows
    stand beside it; NaN means outside its domain. An exception in it ends the work.

    Parameters
    ----------
    function : callable or path
        `function(states, controls, parameters, time)` takes arrays (batch, n), columns in the order of the names, and time (batch,), and
        returns (batch, outputs), or (batch,) for one output. One that takes a single row works too, and is slow. Or `"model.so:rates"`: a
        function of a compiled library with CasADi's C interface. Its inputs are the states, controls and parameters one after the other;
        one that is called `t` or `time`, or the last one if it is one number too many, is time.
    states, controls, parameters : sequence of str or MX
        What the columns are: names of the phase's states and controls and of the problem's parameters, or expressions.
    derivatives : "complex", "finite" or callable
        Complex steps, which lose no digits; central differences; or a function of the same arguments that returns (batch, outputs, inputs),
        time last or left out. Where complex steps turn out wrong, a warning says so and differences are used. Of a library, the
        derivatives that it exports, or differences.
    outputs : sequence of str or int, optional
        Names of what is returned, or their number. Default: the names of `states` if a trial call returns as many values, else that number.

    Returns
    -------
    MX
        A column, one row for each output.

    Raises
    ------
    ValueError
        Where names or derivatives make no sense, or a library or its function is not there or takes other inputs; by `Problem.compile`,
        for another shape, no finite number or not always the same.

    Examples
    --------
    >>> from problems import external
    >>> external(lambda states, controls, parameters, time: controls - states, states=["x"], controls=["u"]).shape
    (1, 1)
    """
    groups = {"states": states, "controls": controls, "parameters": parameters}
    address = Path(function) if isinstance(function, str | os.PathLike) else None
    name = address.name if address else getattr(function, "__name__", type(function).__name__)
    symbols = []
    for kind, group in groups.items():
        if isinstance(group, str | ca.MX):
            raise ValueError(f"external '{name}': {kind} must be a list, such as {kind}=['x'], not {group!r}")
        symbols.append([placeholder(kind, one) if isinstance(one, str) else ca.MX(one) for one in group])
    inputs = [*(str(one) for group in groups.values() for one in group), "time"]
    if address:
        function = library(address.absolute(), inputs)
    if not callable(function):
        raise ValueError(f"external: a function of (states, controls, parameters, time) is needed, not {function!r}")
    if derivatives not in ("complex", "finite") and not callable(derivatives):
        raise ValueError(f"external '{name}': derivatives must be 'complex', 'finite' or a function, not {derivatives!r}")
    if isinstance(function, Native) and derivatives == "complex":
        derivatives = function.jacobian if function.slopes is not None else "finite"
    made = External(function, name, inputs, [len(group) for group in symbols], derivatives)
    if outputs is None:
        outputs = made.tried(np.ones((13, len(inputs)))) or len(states)
        outputs = list(states) if outputs == len(states) and all(isinstance(one, str) for one in states) else outputs
    made.outputs = [f"output {k}" for k in range(outputs)] if isinstance(outputs, int) else [*outputs]
    result: ca.MX = made.points(0, 1)(ca.vertcat(*(one for group in symbols for one in group), placeholder("time", "time")))
    return result


def placeholder(kind: str, name: str) -> ca.MX:
    """The symbol that stands for a state, control, parameter or time until a phase puts its own in its place."""
    symbol, _, _ = _placeholders.setdefault((kind, name), (ca.MX.sym(name), kind, name))
    return symbol


def named(value: Any, symbols: Mapping[str, Mapping[str, ca.MX]], what: str) -> Any:
    """An expression with a phase's symbols, by kind and name, in the place of names. Raises ValueError for one that it does not have."""
    known = {symbol.__hash__(): (kind, name) for symbol, kind, name in _placeholders.values()}
    found = [symbol for symbol in ca.symvar(value) if symbol.__hash__() in known] if known and isinstance(value, ca.MX) else []
    own = []
    for kind, name in (known[symbol.__hash__()] for symbol in found):
        if name not in symbols[kind]:
            raise ValueError(f"{what} has an external of {kind}=['{name}']; there are {', '.join(symbols[kind]) or 'none'}")
        own.append(symbols[kind][name])
    return ca.substitute([value], found, own)[0] if found else value


def output_names(value: Any) -> list[str]:
    """The names of what an external returns. Raises ValueError if this is none."""
    call = called(value) if isinstance(value, ca.MX) else None
    points = EXTERNALS.get(call.which_function().name()) if call is not None else None
    if points is None:
        raise ValueError(f"dynamics takes rates by name, or what problems.external(...) returns, not {value!r}")
    return points.external.outputs


class Native:
    """A CasADi Function whose inside is not known, as a function of rows; other processes load it by its path.

    `values` is (inputs) -> (outputs), time last, `slopes` their derivatives (outputs, inputs), or None. `again` is a function and its
    arguments, which load it. `depends` (outputs, inputs) is False where an output does not depend on an input.
    """

    def __init__(
        self, name: str, values: ca.Function, slopes: ca.Function | None, again: tuple[Any, ...], depends: np.ndarray | None = None
    ) -> None:
        self.__name__, self.values, self.slopes, self.again, self.depends = name, values, slopes, again, depends

    def __reduce__(self) -> tuple[Any, ...]:
        return self.again

    def __call__(self, *parts: np.ndarray) -> np.ndarray:
        return self._at(self.values, parts)

    def jacobian(self, *parts: np.ndarray) -> np.ndarray:
        """(batch, outputs, inputs)."""
        assert self.slopes is not None
        return self._at(self.slopes, parts).reshape(len(parts[0]), self.values.size1_in(0), -1).swapaxes(1, 2)

    def _at(self, function: ca.Function, parts: Sequence[np.ndarray]) -> np.ndarray:
        """Its values, a row for each row; NaN where it fails."""
        X = np.ascontiguousarray(np.column_stack(parts))
        buffer, evaluate = _mapped(function, len(X))
        found = np.empty((len(X), function.numel_out(0)))
        buffer.set_arg(0, X.data)
        buffer.set_res(0, found.data)
        evaluate()
        if not buffer.ret():
            return found
        return np.concatenate([self._at(function, [row[None]]) for row in X]) if len(X) > 1 else np.full_like(found, np.nan)


@lru_cache(maxsize=256)
def _mapped(function: ca.Function, count: int) -> tuple[Any, Callable[[], None]]:
    """What calls a Function so many times."""
    return function.map(count).buffer()


def library(address: Path, inputs: Sequence[str]) -> Native:
    """A function of a compiled library, "file:function", for inputs of these names, time last. Raises ValueError if it is not there or
    takes other inputs."""
    path, _, name = str(address).rpartition(":")
    what = f"external '{address.name}'"
    if not path or not name.isidentifier():
        raise ValueError(f"{what}: the file of a library and its function are needed, such as 'model.so:rates'")
    if not Path(path).is_file():
        raise ValueError(f"{what}: there is no file {path}")
    try:
        symbols = ctypes.CDLL(path)
    except OSError as error:
        raise ValueError(f"{what}: the library cannot be loaded: {error}") from None
    if not hasattr(symbols, f"{name}_n_in"):  # without it, CasADi would call any C function of this name, with the wrong arguments
        raise ValueError(f"{what}: the library has no function '{name}' of CasADi's C interface, with '{name}_n_in' beside it")
    function = ca.external(name, path)
    sizes, words = [function.nnz_in(i) for i in range(function.n_in())], function.name_in()
    if sum(sizes) not in (len(inputs), len(inputs) - 1):
        given = ", ".join(f"{word} ({size})" for word, size in zip(words, sizes, strict=True))
        raise ValueError(
            f"{what} takes {sum(sizes)} numbers, {given}; states, controls and parameters are {len(inputs) - 1}, {', '.join(inputs[:-1])}, "
            "and time may be one more"
        )
    X = ca.MX.sym("X", len(inputs))
    at = [i for i in range(len(sizes)) if words[i] in ("t", "time") and sizes[i] == 1] if sum(sizes) == len(inputs) else []
    order = [i for i in range(len(sizes)) if i not in at[:1]] + at[:1]
    starts = dict(zip(order, np.cumsum([0, *(sizes[i] for i in order)]), strict=False))
    parts = [ca.MX(function.sparsity_in(i), X[int(starts[i]) : int(starts[i]) + sizes[i]]) for i in range(len(sizes))]
    values = ca.densify(ca.veccat(*function.call(parts)))
    slopes = depends = None
    with suppress(RuntimeError):  # it exports no derivatives
        jacobian = ca.jacobian(values, X)
        slopes = ca.Function("slopes", [X], [ca.densify(jacobian)])
        depends = np.array(ca.DM(jacobian.sparsity(), 1.0).full(), bool)
    again = library, (address, list(inputs))
    return Native(address.name, ca.Function("values", [X], [values]), slopes, again, depends)


class External:
    """A function of rows, its derivatives, and what is known of both. Values and derivatives take and return arrays with a row a point."""

    def __init__(
        self, function: Callable[..., Any], name: str, inputs: list[str], counts: list[int], derivatives: str | Callable[..., Any]
    ) -> None:
        self.function, self.name, self.inputs, self.derivatives = function, name, inputs, derivatives
        self.outputs: list[str] = []
        self.one_row, self.checked = False, False
        self.noise, self.spans = float(np.finfo(float).eps), np.ones(len(inputs))
        self._made: dict[tuple[int, int], ExternalPoints] = {}  # by order of derivatives and number of points
        self._columns = [slice(end - count, end) for count, end in zip(counts, np.cumsum(counts), strict=True)]
        self._last: dict[tuple[int, bytes], np.ndarray] = {}

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_made": {}, "_last": {}}

    @property
    def size(self) -> list[int]:
        """How many derivatives of each order there are at a point."""
        return [len(self.outputs) * len(self.inputs) ** order for order in range(3)]

    @property
    def known(self) -> np.ndarray:
        """(outputs, inputs): False where an output does not depend on an input."""
        own = self.function.depends if isinstance(self.function, Native) else None
        return np.ones((len(self.outputs), len(self.inputs)), bool) if own is None else own

    def points(self, order: int, count: int) -> ExternalPoints:
        """The Function of derivatives of an order at so many points."""
        return self._made.get((order, count)) or self._made.setdefault((order, count), ExternalPoints(self, order, count))

    def evaluate(self, order: int, X: np.ndarray) -> np.ndarray:
        """Derivatives of an order (k, size) at points (k, inputs), each as a column-major matrix of those of the order before."""
        # Solvers ask for values, first and second derivatives at the same points, one after the other, in shooting at a row at a time.
        key = order, X.tobytes()
        known = self._last.pop(key, None)
        if known is None:
            k, n = X.shape
            some = max(1, 100_000 // n**order)  # rows in memory at once
            found = [(self.values, self.jacobian, self.hessian)[order](X[first : first + some]) for first in range(0, k, some)]
            known = np.concatenate(found).reshape(k, -1)
        self._last[key] = known
        while len(self._last) > max(3, 10_000 // max(known.size, 1)):
            del self._last[next(iter(self._last))]
        return known

    def values(self, X: np.ndarray) -> np.ndarray:
        """What the function returns, (k, outputs)."""
        found = self._called(self.function, X)
        return self._shaped(found[:, None] if found.ndim == 1 and len(self.outputs) == 1 else found, (len(X), len(self.outputs)))

    def _shaped(self, found: np.ndarray, wanted: tuple[int, ...]) -> np.ndarray:
        """An array of the user's, if it has the shape that is wanted."""
        if found.shape == wanted:
            return found
        hint = "; np.stack([...], axis=-1) makes columns of arrays (batch,)" if found.shape == wanted[::-1] else ""
        raise ValueError(f"external '{self.name}' must return an array {wanted} of {', '.join(self.outputs)}, not {found.shape}{hint}")

    def jacobian(self, X: np.ndarray) -> np.ndarray:
        """(k, inputs, outputs)."""
        k, n = X.shape
        if callable(self.derivatives):
            found = self._called(self.derivatives, X)
            if found.shape != (k, len(self.outputs), n):  # without time
                found = np.pad(self._shaped(found, (k, len(self.outputs), n - 1)), ((0, 0), (0, 0), (0, 1)))
            return found.swapaxes(1, 2)
        if self.derivatives == "complex":
            step = 1e-30
            found = self.values((X + 1j * step * np.eye(n)[:, None]).reshape(n * k, n)).imag / step
        else:
            steps = self.spans * np.cbrt(3.0 * self.noise)
            moves = np.array([1.0, -1.0])[:, None, None, None] * np.diag(steps)[:, None]
            after, before = self.values((X + moves).reshape(2 * n * k, n)).reshape(2, n * k, -1)
            found = (after - before) / np.repeat(2.0 * steps, k)[:, None]
        return found.reshape(n, k, -1).swapaxes(0, 1)

    def hessian(self, X: np.ndarray) -> np.ndarray:
        """(k, inputs, inputs, outputs), by differences of first derivatives."""
        k, n = X.shape
        steps = self.spans * np.sqrt(self.noise ** (2 / 3) if self.derivatives == "finite" else np.finfo(float).eps)
        first, *moved = self.jacobian((X + np.vstack([np.zeros(n), np.diag(steps)])[:, None]).reshape(-1, n)).reshape(n + 1, k, n, -1)
        found = (np.array(moved) - first) / steps[:, None, None, None]
        return 0.5 * (found.transpose(1, 0, 2, 3) + found.transpose(1, 2, 0, 3))

    def tried(self, X: np.ndarray) -> int:
        """How many outputs there are, and whether the function takes one row at a time, by a trial; 0 where it fails."""
        for self.one_row, rows in ((False, X), (True, X[:1])):
            with suppress(Exception):
                found = self._called(self.function, rows)
                if found.ndim in (1, 2) and len(found) == len(rows):
                    return found.shape[1] if found.ndim == 2 else 1
        self.one_row = False
        return 0

    def check(self, X: np.ndarray) -> None:
        """Raise ValueError, or warn, where the function is not what is needed, from its results at points (k, inputs)."""
        if self.checked:
            return
        if not self.one_row:
            self.tried(X)
        begin, W = time.perf_counter(), self.values(X)
        if self.one_row:
            each = (time.perf_counter() - begin) / len(X)
            self._warn(
                f"takes one row at a time, {1e6 * each:.3g} us each: derivatives at 100 points take {100 * each * len(self.inputs):.2g} s. "
                "Written for arrays (batch, n), it is called once for all of them"
            )
        sizes = np.nanmax(np.abs(np.where(np.isfinite(W), W, np.nan)), axis=0, initial=0.0)
        for other, why in ((self.values(X), "when it is called again"), (self.values(X[::-1])[::-1], "when other rows stand beside them")):
            if not np.allclose(W, other, rtol=1e-9, atol=1e-12 * sizes, equal_nan=True):
                raise ValueError(f"external '{self.name}' returns other values for the same rows {why}: it has a memory, or mixes rows")
        good, worst = X[np.isfinite(W).all(axis=1)], int(np.isfinite(W).sum(axis=0).argmin())
        if not len(good):
            raise ValueError(f"external '{self.name}': '{self.outputs[worst]}' is not a finite number anywhere within the bounds")
        spans = np.ptp(good, axis=0)
        self.spans = np.where(spans > 0.0, spans, np.maximum(np.abs(good).max(axis=0), 1.0))
        self._check_derivatives(good[:12], np.where(sizes > 0.0, sizes, 1.0))
        self.checked, self._last = True, {}

    def _check_derivatives(self, X: np.ndarray, sizes: np.ndarray) -> None:
        """Estimate the noise of values, of these sizes, and compare the derivatives with differences."""
        given, n = self.derivatives, X.shape[1]
        # Fourth differences of smooth values are nothing but noise: More and Wild, "Estimating computational noise", SISC 33(3), 2011.
        along = np.arange(-2.0, 3.0)[:, None, None] * 1e-6 * self.spans
        fourth = np.array([1.0, -4.0, 6.0, -4.0, 1.0]) @ self.values((X + along).reshape(-1, n)).reshape(5, -1)
        last = np.nanmedian(np.abs(fourth.reshape(len(X), -1)), axis=0) / np.sqrt(70.0)
        self.noise = float(np.clip(np.nanmax(last / sizes), np.finfo(float).eps, 1e-3))
        self.derivatives = "finite"
        differences = self.jacobian(X)
        if given == "finite":
            return
        noise, self.noise = self.noise, 8.0 * self.noise
        apart, self.noise = np.abs(self.jacobian(X) - differences), noise
        self.derivatives = given
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                exact = self.jacobian(X)
        except (TypeError, ValueError, NotImplementedError):
            if given != "complex":
                raise
            exact = np.full_like(differences, np.inf)
        large = np.nanmax(np.abs(differences), axis=0, initial=0.0) + (sizes * self.noise ** (2 / 3)) / self.spans[:, None]
        # Where differences of two steps disagree, as at kinks, they judge nothing.
        wrong = ~(np.abs(exact - differences) <= 1e-3 * large) & (apart <= 1e-4 * large)
        if not wrong.any():
            return
        _, i, j = np.argwhere(wrong)[0]
        what = f"the derivative of '{self.outputs[j]}' by '{self.inputs[i]}'"
        k = np.flatnonzero(wrong[:, i, j])[0]
        both = f"{exact[k, i, j]:g} as given, and {differences[k, i, j]:g} by differences"
        if given != "complex" and not (isinstance(self.function, Native) and self.function.depends is None):
            raise ValueError(f"external '{self.name}': {what} is {both}")
        self.derivatives = "finite"
        self._warn(
            f"{what} is wrong by complex steps, as by np.abs, float() or tables for real numbers: differences are used, as by "
            "derivatives='finite'; or give derivatives=jacobian"
            if given == "complex"
            else f"{what} is {both}, which are used"
        )

    def _warn(self, message: str) -> None:
        warnings.warn(f"external '{self.name}': {message}", stacklevel=2)

    def _called(self, function: Callable[..., Any], X: np.ndarray) -> np.ndarray:
        """A function of the user's at points: arrays, or, where it takes one, row by row."""
        parts = [X[:, columns] for columns in self._columns]
        try:
            with np.errstate(all="ignore"):
                if not self.one_row:
                    return np.asarray(function(*parts, X[:, -1]))
                return np.array([np.ravel(function(*(part[k] for part in parts), X[k, -1])) for k in range(len(X))])
        except Exception as error:
            row = ", ".join(f"{name} = {value:g}" for name, value in zip(self.inputs, X[0].real, strict=True))
            error.add_note(f"raised by external '{self.name}', called with {len(X)} rows, the first of them {row}")
            raise


class ExternalPoints(ca.Callback):
    """Derivatives of an order of an external at several points, (inputs, count) -> (size, count)."""

    def __init__(self, external: External, order: int, count: int) -> None:
        ca.Callback.__init__(self)
        self.external, self.order, self.count = external, order, count
        name = f"external_{len(EXTERNALS)}"
        EXTERNALS[name] = self
        self.construct(name, {})

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(len(self.external.inputs), self.count)

    def get_sparsity_out(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self.external.size[self.order], self.count)

    def has_eval_buffer(self) -> bool:
        return True

    def eval_buffer(self, inputs: Any, outputs: Any) -> int:
        """What is raised comes back as NaN, and is kept for `reraise`."""
        found = np.frombuffer(outputs[0])
        try:
            X = np.array(np.frombuffer(inputs[0])).reshape(self.count, -1)
            found[:] = self.external.evaluate(self.order, X).ravel()
        except BaseException as error:
            _raised.append(error)
            found[:] = np.nan
        return 0

    def has_jacobian(self) -> bool:
        return self.order < 2

    def get_jacobian(self, name: str, inputs: Any, outputs: Any, options: Any) -> ca.Function:
        X, W = ca.MX.sym("X", self.sparsity_in(0)), ca.MX.sym("W", self.sparsity_out(0))
        values = ca.vec(self.external.points(self.order + 1, self.count)(X))
        chosen = np.flatnonzero(np.tile(self._block.ravel(order="F"), self.count))
        return ca.Function(name, [X, W], [ca.MX(self._blocks, values.nz[chosen.tolist()])], inputs, outputs, options)

    def has_jac_sparsity(self, output: int, of: int) -> bool:
        return True

    def get_jac_sparsity(self, output: int, of: int, symmetric: bool) -> ca.Sparsity:  # without it, derivatives are taken to be dense
        return self._blocks

    @property
    def _block(self) -> np.ndarray:
        """Which derivatives of a point may differ from 0."""
        known = self.external.known
        return known if self.order == 0 else (known[:, :, None] & known[:, None]).reshape(-1, known.shape[1], order="F")

    @property
    def _blocks(self) -> ca.Sparsity:
        """A block for each point."""
        return ca.kron(ca.DM.eye(self.count), ca.sparsify(ca.DM(self._block.astype(float)))).sparsity()
