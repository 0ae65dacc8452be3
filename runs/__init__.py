"""Floor 4: studies of many runs, their statistics and reports, and the command line."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .measures.indicators import additive_epsilon, gd, hypervolume, igd, igd_plus
    from .study import Study

__all__ = ["Study", "additive_epsilon", "gd", "hypervolume", "igd", "igd_plus"]


def __getattr__(name: str) -> Any:
    # The command line lives here too: its help must not wait for numbers.
    if name not in __all__:
        raise AttributeError(f"module 'runs' has no attribute '{name}'")
    import_module("macs")  # it finds the other floors
    return getattr(import_module(".study" if name == "Study" else ".measures.indicators", __name__), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
