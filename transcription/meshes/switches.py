"""Switches: where, along a phase, a control passes from one bound to the other, leaves or reaches one, or jumps, and where a state or a
path constraint reaches or leaves a limit.

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
CONTACT, LASTING = 5e-3, 0.5
"""A state, or a path constraint, is at a limit if it is nearer than this, in its own range on the phase, for at least so many elements.
A gap of less is none."""
LEVELS = (1.0, 4.0, 16.0)
"""Multiples of that distance at which it is seen how fast a limit is reached."""
SLOWEST = 1.25
"""Ratio of the times between these levels below which nothing is concluded: the distance grows as the sixth power of time."""
BRIEF = 0.1
"""Contact with a bound of less than so many elements, between two stretches inside, is a touch of one stretch."""
HUMP = 0.25
"""What does not get so far from a bound between two stretches on it, in spans, is no pulse."""
JUMP, STEEPER = 0.2, 3.0
"""A jump inside the bounds, in spans, that counts, and how many times larger it has to be than the changes on both elements beside it:
a control that oscillates on an arc where it hardly matters jumps, too."""


@dataclass(frozen=True)
class Switch:
    """One switch."""

    place: float  # relative to the phase, in (0, 1)
    before: int  # before, after: LOWER, INSIDE or UPPER
    after: int
    # In (0, 1]: 1 where two elements meet, or a single one shows both sides; less the wider it is smeared, and where an arc inside the
    # bounds begins or ends.
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
    """The stretches of a control. places (N, k), values (N, k)."""
    t, marks = places.ravel(), labels(values.ravel())
    changes = np.flatnonzero(np.diff(marks))
    firsts, lasts = np.append(0, changes + 1), np.append(changes, len(t) - 1)
    ends = 0.5 * (t[changes] + t[changes + 1])
    starts, ends = np.append(t[0], ends), np.append(ends, t[-1])
    return [
        Stretch(*one) for one in zip(starts.tolist(), ends.tolist(), firsts.tolist(), lasts.tolist(), marks[firsts].tolist(), strict=True)
    ]


def switches(places: np.ndarray, values: np.ndarray) -> list[Switch]:
    """The switches of a control, in the order of time; places and values as for `stretches`."""
    t, u = places.ravel(), np.clip(values.ravel(), 0.0, 1.0)
    parts, found = _without(stretches(places, values), places, (LOWER, UPPER), INSIDE, BRIEF), []
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


def contacts(places: np.ndarray, values: np.ndarray, lower: float, upper: float) -> list[Switch]:
    """Where a state or a path constraint reaches and leaves its limits, or only touches one: from INSIDE to INSIDE. places, values (N,
    k)."""
    near = CONTACT * float(np.ptp(values))
    if not near > 0.0 or lower == upper:
        return []
    parts = stretches(places, np.where(values <= lower + near, 0.0, np.where(values >= upper - near, 1.0, 0.5)))
    for limit in (LOWER, UPPER):
        parts = _without(parts, places, (INSIDE,), limit, LASTING)
    # At the ends of a phase, too: a limit is often the first value, or the last.
    ends = Stretch(parts[0].start, parts[0].start, 0, 0, INSIDE), Stretch(parts[-1].end, parts[-1].end, 0, 0, INSIDE)
    parts = [one for one in _without([ends[0], *parts, ends[1]], places, (LOWER, UPPER), INSIDE, LASTING) if one.length > 0.0]
    t, found = places.ravel(), []
    for i, part in enumerate(parts):
        if part.label == INSIDE:
            continue
        distance = (values - lower if part.label == LOWER else upper - values).ravel() / near
        before = parts[i - 1].label if i else None
        after = parts[i + 1].label if i + 1 < len(parts) else None
        start = _reached(t[part.first :: -1], distance[part.first :: -1]) if before == INSIDE else part.start
        end = _reached(t[part.last :], distance[part.last :]) if after == INSIDE else part.end
        if start >= end:
            found.append(Switch(0.5 * (part.start + part.end), INSIDE, INSIDE, 0.25))
            continue
        found += [Switch(start, before, part.label, 0.5)] if before is not None else []
        # A limit that follows at once has its own beginning.
        found += [Switch(end, part.label, after, 0.5)] if after == INSIDE else []
    return found


def _reached(t: np.ndarray, distance: np.ndarray) -> float:
    """Where a limit is reached, seen from there: the distance grows as some power of the time from it, which three levels tell."""
    beyond = [np.flatnonzero(distance >= level) for level in LEVELS]
    if not all(len(one) for one in beyond):
        return float(t[0])
    near, middle, far = (
        float(np.interp(level, distance[k[0] - 1 : k[0] + 1], t[k[0] - 1 : k[0] + 1])) if k[0] else float(t[0])
        for level, k in zip(LEVELS, beyond, strict=True)
    )
    growth = (far - middle) / (middle - near) if middle != near else np.inf
    return near - (middle - near) / (growth - 1.0) if growth > SLOWEST else near


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


def _without(parts: Sequence[Stretch], places: np.ndarray, labels: Sequence[int], around: int, least: float) -> list[Stretch]:
    """The stretches, where those with one of `labels` that cover less than `least` elements, between two with the label `around`, are part
    of these."""
    kept: list[Stretch] = []
    for i, part in enumerate(parts):
        between = 0 < i < len(parts) - 1 and parts[i - 1].label == parts[i + 1].label == around
        label = around if between and part.label in labels and _elements(places, part) < least else part.label
        if kept and kept[-1].label == label:
            kept[-1] = Stretch(kept[-1].start, part.end, kept[-1].first, part.last, label)
        else:
            kept.append(Stretch(part.start, part.end, part.first, part.last, label))
    return kept
