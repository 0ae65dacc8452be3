"""Checks of what a user states. Each raises a ValueError of one line that names the user's own thing."""

from __future__ import annotations

import difflib
import math
from collections.abc import Collection, Iterable, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import MISSING, Field, fields
from typing import Any

import casadi as ca
import numpy as np

from .compiled import Limit, Variable

COMPARISONS = {ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_AND, ca.OP_OR, ca.OP_NOT}


def new_name(kind: str, name: Any, taken: Iterable[str], place: str) -> str:
    """What messages call a new thing, whose name must be a non-empty string that is not among `taken`."""
    if not isinstance(name, str) or not name.strip():
        raise ValueError(f"{place}: the name of a {kind} must be a non-empty string, not {name!r}")
    check_text(name, f"{place}: the name of a {kind}")
    if name in taken:
        raise ValueError(f"{place}: the name '{name}' is used twice")
    return f"{kind} '{name}' of {place}"


def check_text(value: Any, what: str) -> None:
    """Raise ValueError unless `value` is a text that files can hold, as names and units are written into them."""
    if not isinstance(value, str):
        raise ValueError(f"{what} must be a string, not {shown(value)}")
    wrong = next((character for character in value if character == "\0" or "\ud800" <= character <= "\udfff"), None)
    if wrong is not None:
        kind = "a NUL character" if wrong == "\0" else "half of a surrogate pair"
        text = ascii(value) if len(value) <= 60 else "a long text"
        raise ValueError(f"{what}, {text}, has {kind}, which no file can hold; all other characters can be used")


def unit(value: Any, what: str) -> str:
    """The unit of what messages call `what`: any text, "" if there is none."""
    check_text(value, f"the unit of {what}")
    return str(value)


def number(value: Any, what: str) -> float:
    """A finite real number."""
    if isinstance(value, str | bytes | ca.SX):
        raise ValueError(f"{what} must be a number, not {shown(value)}")
    try:
        result = float(value)
    except OverflowError:
        result = math.inf
    except (TypeError, ValueError, RuntimeError, NotImplementedError):
        raise ValueError(f"{what} must be a number, not {shown(value)}") from None
    if not math.isfinite(result):
        raise ValueError(f"{what} must be finite, not {result}")
    return result


def interval(value: Any, what: str) -> tuple[float, float]:
    """A finite pair (lower, upper), lower <= upper; one value where they are not `apart`."""
    try:
        lower, upper = value
    except (TypeError, ValueError):
        raise ValueError(f"{what} must be a pair (lower, upper), not {shown(value)}") from None
    lower, upper = number(lower, f"the lower end of {what}"), number(upper, f"the upper end of {what}")
    if lower > upper:
        raise ValueError(f"{what}: an empty interval, {lower:g} > {upper:g}")
    return lower, upper if apart(lower, upper) else lower


def whole(value: Any, what: str) -> tuple[float, float]:
    """The bounds of a whole number, which are whole themselves."""
    limits = interval(value, f"the bounds of {what}")
    if any(side != round(side) or abs(side) > 2**53 for side in limits):
        raise ValueError(f"the bounds of {what}, a whole number, must be whole numbers, not ({limits[0]:g}, {limits[1]:g})")
    return limits


def choices(values: Any, what: str) -> tuple[Any, ...]:
    """Two or more different texts, numbers or truth values."""
    labels = () if isinstance(values, str) or not isinstance(values, Iterable) else tuple(values)
    labels = tuple(one.item() if isinstance(one, np.generic) else one for one in labels)
    if len(labels) < 2 or len({*map(str, labels)}) < len(labels) or not all(isinstance(one, str | bool | int | float) for one in labels):
        raise ValueError(f"the choices of {what} must be two or more different texts, numbers or truth values, not {shown(values)}")
    for label in labels:
        check_text(str(label), f"a choice of {what}")
    return labels


def apart(lower: float, upper: float) -> bool:
    """Whether two ends of an interval are far enough apart to be told from each other.

    Where they are not, rounding alone leaves the interval, and no solver finds its way inside: it is one value.
    """
    return math.isinf(upper - lower) or upper - lower > max(1e-12 * max(abs(lower), abs(upper)), 1e-300)


def fixed_or_interval(value: Any, what: str) -> tuple[float, float]:
    """A number, which is fixed, or a pair, which is free within it."""
    if (isinstance(value, Sequence) and not isinstance(value, str)) or (isinstance(value, np.ndarray) and value.ndim == 1):
        return interval(value, what)
    fixed = number(value, what)
    return fixed, fixed


def within(inner: tuple[float, float], outer: tuple[float, float], what: str) -> tuple[float, float]:
    """`inner`, if it lies inside `outer`."""
    if inner[0] < outer[0] or inner[1] > outer[1]:
        shown = f"{inner[0]:g}" if inner[0] == inner[1] else f"({inner[0]:g}, {inner[1]:g})"
        raise ValueError(f"{what} is {shown}, outside its bounds ({outer[0]:g}, {outer[1]:g})")
    return inner


def intersection(first: tuple[float, float], second: tuple[float, float], what: str) -> tuple[float, float]:
    """The intersection of two intervals; an error if it is empty by more than rounding."""
    lower, upper = max(first[0], second[0]), min(first[1], second[1])
    if lower > upper and apart(upper, lower):
        raise ValueError(f"{what}: nothing lies both in ({first[0]:g}, {first[1]:g}) and in ({second[0]:g}, {second[1]:g})")
    return lower, upper if apart(lower, upper) else lower


def positive(value: Any, what: str) -> float:
    """A positive finite number."""
    result = number(value, what)
    if result <= 0:
        raise ValueError(f"{what} must be positive, not {result:g}")
    return result


def scale(value: Any, default: float, what: str) -> float:
    """A positive number, or the default where none is given."""
    return default if value is None else positive(value, f"the scale of {what}")


def limit(name: str, lower: Any, upper: Any, given_unit: Any, given_scale: Any, what: str) -> Limit:
    """A row lower <= expression <= upper, of which one side may be missing.

    What counts as one in it is by default the span of two limits; of one limit, or an equality, it is 1, but at least a thousandth of
    the limit's size: so at the usual tolerance of 1e-6 none has to be met to more than nine digits, which scaled solvers cannot reach.
    """
    if lower is None and upper is None:
        raise ValueError(f"{what} has neither a lower nor an upper limit")
    low = -math.inf if lower is None else number(lower, f"the lower limit of {what}")
    high = math.inf if upper is None else number(upper, f"the upper limit of {what}")
    if low > high:
        raise ValueError(f"{what}: an empty interval, {low:g} > {high:g}")
    high = high if apart(low, high) else low
    finite = [abs(side) for side in (low, high) if math.isfinite(side)]
    default = high - low if len(finite) == 2 and high > low else max([1.0, *(1e-3 * size for size in finite)])
    return Limit(name, low, high, scale(given_scale, default, what), unit(given_unit, what))


def period(value: Any, bounds: tuple[float, float], what: str) -> float | None:
    """A period, whose length must be that of the bounds."""
    if value is None:
        return None
    length = number(value, f"the period of {what}")
    if length <= 0 or not math.isclose(length, bounds[1] - bounds[0], rel_tol=1e-9):
        raise ValueError(f"the bounds of {what} must be one period ({length:g}) wide, not ({bounds[0]:g}, {bounds[1]:g})")
    return length


def expression(value: Any, known: Collection[AbstractSet[int]], what: str, hint: str) -> ca.MX:
    """A scalar CasADi expression of known symbols only, which are given by sets of their hashes; plain numbers are expressions too."""
    if isinstance(value, bool | np.bool_) or (isinstance(value, ca.MX) and _compares(value)):
        raise ValueError(
            f"{what} is a comparison, {shown(value)}, which is 1 where it holds and 0 elsewhere: for a limit, state what is on the left "
            "as an expression and the limit as lower=... or upper=...; for a number that switches, write casadi.if_else(..., 1, 0)"
        )
    if isinstance(value, ca.MX):
        if value.shape != (1, 1):
            raise ValueError(f"{what} must be a scalar, not of shape {value.shape}")
        for symbol in ca.symvar(value):
            if not any(symbol.__hash__() in hashes for hashes in known):
                raise ValueError(f"{what} uses '{symbol.name()}', {hint}")
        if value.is_constant() and not math.isfinite(float(value)):
            raise ValueError(f"{what} must be finite, not {float(value)}")
        return value
    return ca.MX(number(value, what))


def _compares(value: ca.MX) -> bool:
    """Whether an expression is a comparison or joins comparisons, times a sign or not."""
    if value.is_constant() or value.n_dep() == 0:
        return False
    return value.op() in COMPARISONS or (value.op() == ca.OP_NEG and _compares(value.dep(0)))


def guess(value: Any, what: str) -> Any:
    """A number, a pair of numbers (a straight line), or (times, values): two sequences of the same length, times increasing."""
    try:
        first, second = value
    except (TypeError, ValueError, RuntimeError, NotImplementedError):
        if isinstance(value, Sequence) or (isinstance(value, np.ndarray) and value.ndim):
            raise ValueError(f"{what} must be a number, a pair of numbers or a pair (times, values), not {shown(value)}") from None
        return number(value, what)
    if not any(isinstance(part, Sequence | np.ndarray) and np.ndim(np.asarray(part, dtype=object)) for part in (first, second)):
        return number(first, what), number(second, what)
    try:
        times, values = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"{what}: times and values must be two sequences of numbers, not {shown(value)}") from None
    if times.ndim != 1 or times.shape != values.shape or len(times) < 2:
        raise ValueError(f"{what}: times and values must be two sequences of the same length, at least 2")
    if not (np.all(np.isfinite(times)) and np.all(np.isfinite(values)) and np.all(np.diff(times) > 0)):
        raise ValueError(f"{what}: times must increase, and all must be finite")
    return times, values


def guessed(value: Any, variable: Variable, what: str) -> Any:
    """A guess as `guess` or `number` returns it, if it lies within the bounds of its variable, but for rounding."""
    samples = np.atleast_1d(value[1] if np.ndim(value) == 2 else value)
    slack = 1e-9 * max(variable.span, abs(variable.lower), abs(variable.upper))
    outside = samples[(samples < variable.lower - slack) | (samples > variable.upper + slack)]
    if len(outside):
        raise ValueError(f"{what} is {outside[0]:g}, outside its bounds ({variable.lower:g}, {variable.upper:g})")
    return value


def shown(value: Any) -> str:
    """A value on one line."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 80 else f"{text[:77]}..."


def check_positive(name: str, value: Any) -> None:
    """Raise ValueError that names what is no positive number."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not math.isfinite(value) or value <= 0:
        raise ValueError(f"{name} must be a positive number, not {value!r}")


def check_interval(name: str, value: Any, interval: str) -> None:
    """Raise ValueError unless `value` is a number in an interval such as "(0, 1]" or "[0, inf)"."""
    lower, upper = map(float, interval[1:-1].split(","))
    number = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
    if not (number and lower <= value <= upper) or (value == lower and interval[0] == "(") or (value == upper and interval[-1] == ")"):
        raise ValueError(f"{name} must be in {interval}, not {value!r}")


def check_count(name: str, value: Any, least: int) -> None:
    """Raise ValueError unless `value` is a whole number of at least `least`."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise ValueError(f"{name} must be a whole number of at least {least}, not {value!r}")


def check_choice(name: str, value: Any, choices: Iterable[str]) -> None:
    """Raise ValueError unless `value` is one of these words."""
    words = [*choices]
    if not isinstance(value, str) or value not in words:
        shown = " or ".join(map(repr, words)) if len(words) == 2 else f"one of {', '.join(map(repr, words))}"
        raise ValueError(f"{name} must be {shown}, not {value!r}")


def unknown(what: str, word: Any, known: Iterable[str]) -> str:
    """The message for a word that is none of those known: the nearest, and all."""
    words = [*known]
    near = difflib.get_close_matches(str(word), words, n=1)
    return f"unknown {what} {word!r}{f', did you mean {near[0]}?' if near else ';'} there are {', '.join(words)}"


def settings_of(value: Any) -> list[Field[Any]]:
    """The settings of a dataclass as its constructor takes them: those that are also positional first."""
    return sorted((one for one in fields(value) if one.init), key=lambda one: bool(one.kw_only))


def short_repr(value: Any) -> str:
    """A dataclass of settings as its constructor is called, without those that have their default value."""
    shown = [f"{one.name}={given!r}" for one in settings_of(value) if not _is_default(given := getattr(value, one.name), one)]
    return f"{type(value).__name__}({', '.join(shown)})"


def _is_default(value: Any, setting: Field[Any]) -> bool:
    default = setting.default if setting.default_factory is MISSING else setting.default_factory()
    return value is default or (type(value) is type(default) and bool(value == default))
