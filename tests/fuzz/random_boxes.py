"""Random black boxes: functions of rows as careless users write them, with bounds of every kind."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

Function = Callable[[np.ndarray], Any]


@dataclass(frozen=True)
class Box:
    """A function of rows (n, d) with its bounds; an `honest` one returns plain numbers, the same for the same row. Bounds may be so narrow
    that nothing is left to decide."""

    function: Function
    bounds: Any
    honest: bool
    kind: str
    narrow: bool


def random_box(seed: int) -> Box:
    """A black box."""
    rng = np.random.default_rng(seed)
    d, m = int(rng.integers(1, 7)), int(rng.choice([1, 2, 2, 3]))
    bounds = [_bounds(rng) for _ in range(d)]
    honest = rng.random() < 0.6
    names = HONEST if honest else CARELESS
    kind = str(rng.choice(list(names)))
    weights, shifts = rng.normal(size=(d, m)), rng.normal(size=m)

    def plain(X: np.ndarray) -> np.ndarray:
        # Without matrix products, whose rounding depends on the number of rows.
        return np.cos((X[:, :, None] * weights).sum(axis=1) + shifts) + 0.1 * (np.tanh(X)[:, :, None] * weights**2).sum(axis=1)

    limits: Any = {f"v{i}": pair for i, pair in enumerate(bounds)} if rng.random() < 0.3 else bounds
    narrow = any(high - low <= 1e-12 * max(abs(low), abs(high), 1e-288) for low, high in bounds)
    return Box(names[kind](plain, rng), limits, honest, kind, narrow)


def _bounds(rng: np.random.Generator) -> tuple[float, float]:
    middle = float(rng.choice([0.0, 1.0, -1e6, 1e12], p=[0.5, 0.28, 0.2, 0.02]))
    size = float(10.0 ** rng.integers(-3, 4))
    if rng.random() < 0.01:
        return middle, float(np.nextafter(middle, np.inf))
    low, high = middle - size, middle + size
    return (low, high) if low < high else (low, float(np.nextafter(low, np.inf)))


def _with(change: Callable[[np.ndarray, np.ndarray], Any]) -> Callable[[Function, np.random.Generator], Function]:
    return lambda plain, rng: lambda X: change(plain(X), X)


def _holes(F: np.ndarray, X: np.ndarray) -> np.ndarray:
    F[np.sin(40 * X[:, 0]) > 0.6] = np.nan
    return F


def _constrained(F: np.ndarray, X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return F, np.stack([F[:, 0] - 0.5, -F.sum(axis=1) - 1.0], axis=1)


def _raises_later(plain: Function, rng: np.random.Generator) -> Function:
    calls = [0]

    def function(X: np.ndarray) -> np.ndarray:
        calls[0] += 1
        if calls[0] > 3:
            raise RuntimeError("the licence server does not answer")
        return np.asarray(plain(X))

    return function


HONEST: dict[str, Callable[[Function, np.random.Generator], Function]] = {
    "smooth": _with(lambda F, X: F),
    "steps": _with(lambda F, X: np.round(F, 1)),
    "constant": _with(lambda F, X: np.zeros_like(F)),
    "one constant objective": _with(lambda F, X: np.concatenate([F[:, :-1], np.full((len(F), 1), 3.0)], axis=1)),
    "large": _with(lambda F, X: 1e200 * F),
    "tiny": _with(lambda F, X: 1e-200 * F),
    "far from zero": _with(lambda F, X: 1e9 + F),
    "holes": _with(_holes),
    "all NaN": _with(lambda F, X: np.full_like(F, np.nan)),
    "infinite": _with(lambda F, X: np.where(F > 0.5, np.inf, F)),
    "constrained": _with(_constrained),
    "never feasible": _with(lambda F, X: (F, np.ones(len(F)) + F[:, 0] ** 2)),
    "single precision": _with(lambda F, X: F.astype(np.float32)),
    "whole numbers": _with(lambda F, X: np.round(10 * F).astype(int)),
    "lists": _with(lambda F, X: F.tolist()),
    "changes its rows": lambda plain, rng: lambda X: plain(np.multiply(X, 0.5, out=X)),
}
CARELESS: dict[str, Callable[[Function, np.random.Generator], Function]] = {
    "complex": _with(lambda F, X: F + 1j),
    "masked": _with(lambda F, X: np.ma.masked_greater(F, 0.5)),
    "wrong length": _with(lambda F, X: F[:-1]),
    "transposed": _with(lambda F, X: np.vstack([F, F]).T),
    "booleans": _with(lambda F, X: F > 0),
    "words": _with(lambda F, X: [["a"] * F.shape[1]] * len(F)),
    "None": _with(lambda F, X: None),
    "a number": _with(lambda F, X: 1.0),
    "a dict": _with(lambda F, X: {"f": F}),
    "three values": _with(lambda F, X: (F, F, F)),
    "objects": _with(lambda F, X: F.astype(object)),
    "other columns later": lambda plain, rng: lambda X: plain(X) if len(X) % 2 else np.hstack([plain(X), plain(X)]),
    "raises": _with(lambda F, X: 1 / 0),
    "raises later": _raises_later,
    "dates": _with(lambda F, X: F.astype("datetime64[s]")),
    "no rows": _with(lambda F, X: np.empty((0, F.shape[1]))),
}
