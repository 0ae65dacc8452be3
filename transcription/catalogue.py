"""Transcriptions by name: for the command line ("dfet:4x6") and for files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .base import Transcription
from .dfet.method import DFET
from .shooting.control_law import DEGREES
from .shooting.method import MultipleShooting, SingleShooting
from .shooting.runge_kutta import TABLEAUX

METHODS: dict[str, type[Transcription]] = {"DFET": DFET, "SingleShooting": SingleShooting, "MultipleShooting": MultipleShooting}
EXAMPLES = (
    "dfet:4x6 (4 elements of order 6), dfet:4x6:bernstein, dfet:40x2:bernstein:1 (controls of order 1), shooting:200 (200 nodes), "
    "shooting:200x2:linear:rk8 (2 steps between each, linear controls, another Runge-Kutta scheme), shooting:200:spline:21 (controls on 21 "
    "nodes), multiple-shooting:40 (intervals)"
)
SHOOTING = {"shooting": SingleShooting, "multiple-shooting": MultipleShooting}


def parse(text: str) -> Transcription:
    """A transcription from one word, as on the command line. Raises ValueError that shows how it is written."""
    method, mesh, *options = (*text.split(":"), "")[: text.count(":") + 2]
    first, cross, second = mesh.partition("x")
    numbers = first.isdecimal() and (second.isdecimal() or not cross)
    if method.lower() in SHOOTING and numbers:
        settings = {**({"steps": int(second)} if cross else {}), **_options(text, [word for word in options if word])}
        return SHOOTING[method.lower()](int(first), **settings)
    said = [option for option in options if option]
    orders = [option for option in said if option.isdecimal()]
    if method.lower() != "dfet" or not numbers or not cross or len(orders) > 1 or len(said) - len(orders) > 1:
        raise ValueError(f"unknown transcription '{text}'; write it as {EXAMPLES}")
    basis = next((option for option in said if option not in orders), "lobatto")
    return DFET(int(first), int(second), basis=basis, control_order=int(orders[0]) if orders else None)


def _options(text: str, words: list[str]) -> dict[str, Any]:
    """What is said of shooting after its mesh, in any order: the kind of control, its number of nodes, the scheme."""
    found: dict[str, Any] = {}
    for word in words:
        name = "control" if word in DEGREES else "scheme" if word in TABLEAUX else "control_nodes" if word.isdecimal() else ""
        if not name or name in found:
            known = f"{', '.join(DEGREES)}; {', '.join(TABLEAUX)}; or a number of nodes of the controls"
            raise ValueError(f"transcription '{text}': '{word}' is said twice or unknown; there are {known}")
        found[name] = int(word) if name == "control_nodes" else word
    return found


def word(method: Transcription) -> str | None:
    """How a transcription is said in one word, such that `parse` gives it again; None if it cannot be."""
    words: list[str] = []
    if isinstance(method, DFET) and isinstance(method.elements, int):
        mesh, order = f"dfet:{method.elements}x{method.order}", "" if method.control_order is None else f":{method.control_order}"
        words = [mesh + order, f"{mesh}:{method.basis}{order}"]
    elif isinstance(method, SingleShooting | MultipleShooting):
        name = next(name for name, kind in SHOOTING.items() if isinstance(method, kind))
        count = method.nodes if isinstance(method, SingleShooting) else method.intervals
        said = [f"{name}:{count}" + (f"x{method.steps}" if method.steps > 1 else "")]
        for value, default in ((method.control, "constant"), (method.control_nodes, None), (method.scheme, "rk4")):
            said += [str(value)] if value != default else []
        words = [":".join(said)]
    return next((one for one in words if parse(one) == method), None)


def from_dict(data: Mapping[str, Any]) -> Transcription:
    """A transcription from what `Transcription.to_dict` gave. Raises ValueError if there is no such method or setting."""
    method = data.get("method")
    if method not in METHODS:
        raise ValueError(f"unknown transcription {method!r}; there are {', '.join(METHODS)}")
    try:
        return METHODS[method](**data.get("settings", {}))
    except TypeError as error:
        raise ValueError(f"transcription {method}: {error}") from None
