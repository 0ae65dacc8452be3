"""The table of contents of the collection."""

from __future__ import annotations

from importlib import import_module

from .published import Published

ROOMS: dict[str, dict[str, str]] = {
    "smooth": {
        "brachistochrone": "the quickest way down",
        "bryson_max_range": "as far as possible in a given time",
        "hypersensitive": "a boundary layer at each end of a long rest",
        "linear_tangent": "the quickest way to a height and a speed",
    },
    "paths": {
        "breakwell": "least effort below a ceiling",
        "bryson_denham": "least effort below a ceiling, at several heights",
        "obstacle": "past two discs, with hardly any room",
        "rayleigh": "an oscillator with a mixed constraint",
    },
    "switching": {
        "catalyst_mixing": "the best blend along a reactor, singular",
        "f8": "the quickest return of an aircraft to trim, bang-bang, with local optima",
        "lotka_fishing": "fishing prey and predators to rest, singular",
        "moon_landing": "least propellant to a soft landing, bang-bang",
        "rocket": "the greatest height of a rocket with drag, singular",
    },
    "phases": {
        "schwartz": "two phases, the first around an ellipse",
    },
}
"""For each room its problems, with one line on each."""


def cases() -> dict[str, tuple[str, str]]:
    """For each problem the address of its function, and one line on it."""
    return {name: (f"{_module(room, name)}:problem", text) for room, texts in ROOMS.items() for name, text in texts.items()}


def published(name: str) -> tuple[Published, ...]:
    """The published optima of a problem, that for its default data first. Raises ValueError if there is no such problem."""
    room = next((room for room, texts in ROOMS.items() if name in texts), None)
    if room is None:
        raise ValueError(f"there is no problem '{name}' in the collection; there are {', '.join(cases())}")
    return import_module(_module(room, name)).PUBLISHED


def _module(room: str, name: str) -> str:
    return f"{__package__}.{room}.{name}"
