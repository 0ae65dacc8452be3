"""The table of contents of the collection."""

from __future__ import annotations

from importlib import import_module

from .published import Published

ROOMS: dict[str, dict[str, str]] = {
    "curves": {
        "brachistochrone": "the quickest way down",
        "dubins": "the shortest way of a car to a place behind it, with local optima",
        "hanging_chain": "the shape of the least potential energy",
        "isoperimetric": "the largest area within a curve",
        "newton_nose": "least drag of a body of revolution",
    },
    "smooth": {
        "batch_reactor": "the temperatures that make the most of a product",
        "bryson_max_range": "as far as possible in a given time",
        "hypersensitive": "a boundary layer at each end of a long rest",
        "stirred_tank": "a hot reaction that is cooled to rest, with a local optimum",
        "tuberculosis": "treatment of two strains at the least cost",
        "van_der_pol": "an oscillator that is brought to rest",
        "zermelo": "the quickest way of a ship in a current",
    },
    "flight": {
        "climb": "the quickest climb of a supersonic aircraft, with tables",
        "hang_glider": "as far as possible through a thermal",
        "linear_tangent": "the quickest way to a height and a speed",
        "low_thrust": "many turns around the earth, to a high orbit",
        "orbit_raising": "from the earth's orbit to that of Mars by a small thrust",
    },
    "paths": {
        "alp_rider": "an unstable system above four peaks",
        "breakwell": "least effort below a ceiling",
        "bryson_denham": "least effort below a ceiling, at two heights",
        "crane": "least swing of a container on its crane",
        "dynamic_soaring": "the weakest gradient of wind that keeps a glider up",
        "jacobson_lele": "a speed below a parabola of time",
        "obstacle": "past two discs, with hardly any room",
        "plane_change": "an orbit that is turned in the atmosphere, below a heating rate",
        "rayleigh": "an oscillator with a mixed constraint",
    },
    "switching": {
        "car": "the quickest way from rest to rest, bang-bang",
        "f8": "the quickest return of an aircraft to trim, bang-bang, with local optima",
        "fast_oscillator": "the quickest way of an oscillator, bang-bang",
        "free_flying_robot": "least fuel of jets, to a place and an attitude",
        "moon_landing": "least propellant to a soft landing, bang-bang",
        "reorientation": "the quickest turn of a spacecraft, bang-bang",
        "robot_arm": "the quickest turn of an arm, bang-bang",
        "two_link_arm": "the quickest way of an arm with two links, bang-bang",
    },
    "singular": {
        "aly_chan": "a control that is singular all along",
        "catalyst_mixing": "the best blend along a reactor, singular",
        "jacobson": "a control that is on its bound and then singular",
        "lotka_fishing": "fishing prey and predators to rest, singular",
        "rocket": "the greatest height of a rocket with drag, singular",
        "tumour": "the smallest tumour that a drug leaves, singular",
    },
    "phases": {
        "delta_iii": "a launcher in four phases",
        "missile": "along the sea, then a strike from above",
        "schwartz": "two phases, the first around an ellipse",
        "sounding_rocket": "the greatest height of a rocket, in three phases",
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
