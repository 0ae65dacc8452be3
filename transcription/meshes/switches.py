"""Switches of controls: where, along a phase, a control passes from one bound to the other, leaves or reaches one, or jumps.

On a coarse mesh a switch is smeared over the element in which it lies: the control leaves its bound somewhere before and reaches the other
somewhere behind. What survives is its integral, since the states depend on it. A switch is therefore put where a control that jumps has
the same integral over the smeared stretch, and so is a short pulse, which a coarse mesh shows as a hump.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

LOWER, INSIDE, UPPER = -1, 0, 1
"""Labels of a stretch: on the lower bound, on none, on the upper bound."""
ON_BOUND = 1e-2
"""A value is on a bound if it is nearer than this, in spans."""
SMEARED, PULSE = 1.25, 2.25
"""Elements over which a switch, and a pulse, may be smeared; what takes longer is an arc of its own."""
BRIEF = 0.1
"""Contact with a bound of less than so many elements, between two stretches inside, is a touch of one stretch."""
HUMP = 0.25
"""What does not get so far from a bound between two stretches on it, in spans, is no pulse."""
JUMP, STEEPER = 0.2, 3.0
"""A jump inside the bounds, in spans, that counts, and how many times larger it has to be than the changes on both elements beside it:
a control that oscillates on an arc where it hardly matters jumps, too."""


@dataclass(frozen=True)
class Switch:
    """One switch.

    Attributes
    ----------
    place : float
        Relative to the phase, in (0, 1).
    before, after : int
        LOWER, INSIDE or UPPER.
    certainty : float
        In (0, 1]: 1 where two elements meet, or a single one shows both sides; less the wider it is smeared, and where an arc inside the
        bounds begins or ends.
    """

    place: float
    before: int
    after: int
    certainty: float


@dataclass(frozen=True)
class Stretch:
    """A part of a phase, from `start` to `end`, relative to the phase, over samples `first` to `last`, with one label."""

    start: float
    end: float
    first: int
    last: int
    label: int

    @property
    def length(self) -> float:
        return self.end - self.start


def stretches(places: np.ndarray, values: np.ndarray) -> list[Stretch]:
    """The stretches of a control.

    Parameters
    ----------
    places : array (N, k)
        Where, relative to the phase, each of N elements is sampled, both ends included.
    values : array (N, k)
        The control there, as a fraction of the way from its lower to its upper bound.
    """
    t, marks = places.ravel(), labels(values.ravel())
    changes = np.flatnonzero(np.diff(marks))
    firsts, lasts = np.append(0, changes + 1), np.append(changes, len(t) - 1)
    ends = 0.5 * (t[changes] + t[changes + 1])
    starts, ends = np.append(t[0], ends), np.append(ends, t[-1])
    found = [
        Stretch(*one) for one in zip(starts.tolist(), ends.tolist(), firsts.tolist(), lasts.tolist(), marks[firsts].tolist(), strict=True)
    ]
    return _without_touches(found, places)


def switches(places: np.ndarray, values: np.ndarray) -> list[Switch]:
    """The switches of a control, in the order of time; places and values as for `stretches`."""
    t, u = places.ravel(), np.clip(values.ravel(), 0.0, 1.0)
    parts, found = stretches(places, values), []
    for i, part in enumerate(parts):
        before = parts[i - 1].label if i else None
        after = parts[i + 1].label if i + 1 < len(parts) else None
        if part.label == INSIDE:
            stretch = slice(part.first, part.last + 1)
            found += _passages(part, t[stretch], u[stretch], before, after, _elements(places, part))
            found += _jumps(places, values, part)
        elif before is not None and before != INSIDE:
            found.append(Switch(part.start, before, part.label, 1.0))
    return sorted((one for one in found if t[0] < one.place < t[-1]), key=lambda one: one.place)


def _passages(part: Stretch, t: np.ndarray, u: np.ndarray, before: int | None, after: int | None, elements: float) -> list[Switch]:
    """The switches at the ends of a stretch inside the bounds, between stretches with these labels; None for an end of the phase."""
    bound = after if before is None else before
    if bound is None:
        return []
    if elements > (SMEARED if after == -bound else PULSE):
        ends = [Switch(part.start, before, INSIDE, 0.5)] if before is not None else []
        return ends + ([Switch(part.end, INSIDE, after, 0.5)] if after is not None else [])
    distance = u if bound == LOWER else 1.0 - u
    away = min(float(np.trapezoid(distance, t)), part.length)
    certainty = 1.0 / max(1.0, elements)
    if after == -bound:
        return [Switch(part.end - away, bound, after, certainty)]
    if not distance.max() >= HUMP:
        return []
    if before is None:
        return [Switch(part.start + away, -bound, bound, 0.5 * certainty)]
    if after is None:
        return [Switch(part.end - away, bound, -bound, 0.5 * certainty)]
    middle = float(np.trapezoid(distance * t, t) / np.trapezoid(distance, t))
    first = min(max(middle - 0.5 * away, part.start), part.end - away)
    return [Switch(first, bound, -bound, 0.5 * certainty), Switch(first + away, -bound, bound, 0.5 * certainty)]


def _jumps(places: np.ndarray, values: np.ndarray, part: Stretch) -> list[Switch]:
    """Jumps at edges within a stretch inside the bounds."""
    change = np.abs(values[1:, 0] - values[:-1, -1])
    own = np.ptp(values, axis=1)
    size = values.shape[1]
    return [
        Switch(float(places[j + 1, 0]), INSIDE, INSIDE, 0.5)
        for j in np.flatnonzero((change > JUMP) & (change > STEEPER * np.maximum(own[1:], own[:-1]))).tolist()
        if part.first <= j * size and (j + 2) * size - 1 <= part.last
    ]


def labels(u: np.ndarray) -> np.ndarray:
    """LOWER, INSIDE or UPPER for values as fractions of the way from the lower to the upper bound."""
    return np.where(u <= ON_BOUND, LOWER, np.where(u >= 1.0 - ON_BOUND, UPPER, INSIDE))


def _elements(places: np.ndarray, part: Stretch) -> float:
    """How many elements a stretch covers, in parts of each."""
    starts, ends = places[:, 0], places[:, -1]
    return float((np.clip(np.minimum(part.end, ends) - np.maximum(part.start, starts), 0.0, None) / (ends - starts)).sum())


def _without_touches(parts: Sequence[Stretch], places: np.ndarray) -> list[Stretch]:
    """The stretches, where those that only touch a bound are part of what lies around them."""
    kept: list[Stretch] = []
    for i, part in enumerate(parts):
        inner = 0 < i < len(parts) - 1
        touch = part.label != INSIDE and inner and parts[i - 1].label == parts[i + 1].label == INSIDE and _elements(places, part) < BRIEF
        label = INSIDE if touch else part.label
        if kept and kept[-1].label == label:
            kept[-1] = Stretch(kept[-1].start, part.end, kept[-1].first, part.last, label)
        else:
            kept.append(Stretch(part.start, part.end, part.first, part.last, label))
    return kept
