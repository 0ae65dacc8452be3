"""Random expressions that CasADi and plain Python evaluate alike, each by its own functions."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

Term = tuple[Any, ...]
"""A number, a name, or a function of other terms: ("number", value), ("name", text), or (function, term, ...)."""
PULSE = 300.0
"""What the square of a term of size one is multiplied with in a pulse, exp(-PULSE square(...)): that is 0.1 wide."""

SMOOTH = ("+", "-", "*", "sin", "cos", "tanh", "square")
RISKY = ("/", "exp", "root", "log", "abs", "cube")
"""They may leave the numbers, or have no derivatives. Roots are of absolute values: CasADi takes the square of a root of x for x."""


def random_term(rng: np.random.Generator, names: Sequence[str], depth: int, risk: float) -> Term:
    """A term of these names; each function in it is a risky one with this probability."""
    if depth == 0 or (depth < 3 and rng.random() < 0.25):
        return ("name", str(rng.choice(list(names)))) if names and rng.random() < 0.75 else ("number", _number(rng))
    kind = str(rng.choice(RISKY if rng.random() < risk else SMOOTH))
    count = 2 if kind in "+-*/" else 1
    return (kind, *(random_term(rng, names, depth - 1, risk) for _ in range(count)))


def with_pulse(rng: np.random.Generator, term: Term, name: str, limits: tuple[float, float]) -> Term:
    """The term and a pulse where what has this name is near some value within limits, 1 % to 10 % of these wide."""
    place, width = rng.uniform(*limits), (limits[1] - limits[0]) * 10.0 ** rng.uniform(-1.0, 0.0)
    scaled = ("*", ("number", 1.0 / width), ("-", ("name", name), ("number", float(place))))
    pulse = ("exp", ("*", ("number", -PULSE), ("square", scaled)))
    return ("+", term, ("*", ("number", float(rng.choice([-1.0, 0.5, 1.0, 2.0]))), pulse))


def _number(rng: np.random.Generator) -> float:
    return float(rng.choice([0.0, 1.0, -1.0, 0.5, 2.0, round(float(rng.normal()), 3), float(10.0 ** rng.integers(-3, 4))]))


def symbolic(term: Term, values: Mapping[str, Any]) -> Any:
    """The term as an expression of CasADi, with symbols by name."""
    return _evaluated(term, values, SYMBOLIC)


def numeric(term: Term, values: Mapping[str, float]) -> float:
    """The term as a number; infinite where that is too large, NaN where it has none.

    Raises
    ------
    ZeroDivisionError
        Where it is divided by zero: CasADi may have taken 0 / x for 0, or x / x for 1.
    """
    try:
        return float(_evaluated(term, values, NUMERIC))
    except OverflowError:
        return math.inf
    except ValueError:
        return math.nan


def _evaluated(term: Term, values: Mapping[str, Any], functions: Mapping[str, Any]) -> Any:
    kind, *parts = term
    if kind == "number":
        return parts[0]
    if kind == "name":
        return values[parts[0]]
    return functions[kind](*(_evaluated(part, values, functions) for part in parts))


SYMBOLIC: dict[str, Any] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / (ca.MX(b) if not isinstance(b, ca.MX) else b),
    "square": lambda a: a * a,
    "cube": lambda a: a * a * a,
    "sin": ca.sin,
    "cos": ca.cos,
    "tanh": ca.tanh,
    "exp": ca.exp,
    "root": lambda a: ca.sqrt(ca.fabs(a)),
    "log": ca.log,
    "abs": ca.fabs,
}
NUMERIC: dict[str, Any] = SYMBOLIC | {
    "/": lambda a, b: a / b,
    "*": lambda a, b: a * b if a and b else 0.0,  # CasADi takes 0 x for 0, whatever x is
    "sin": math.sin,
    "cos": math.cos,
    "tanh": math.tanh,
    "exp": math.exp,
    "root": lambda a: math.sqrt(abs(a)),
    "log": lambda a: math.log(a) if a > 0 else -math.inf if a == 0 else math.nan,
    "abs": abs,
}
