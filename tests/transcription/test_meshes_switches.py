"""Switches of controls: synthetic ones are found where they are, and what is none is not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from transcription.meshes.moving_edges import INSIDE, LOWER, UPPER, contacts, switches
from transcription.numerics.polynomials import bernstein_matrix

TAU = np.linspace(-1.0, 1.0, 65)


def sampled(edges, coefficients):
    """Places and values (N, 65) of polynomials of Bernstein coefficients on the elements between `edges`."""
    edges = np.asarray(edges, dtype=float)
    places = edges[:-1, None] + 0.5 * (1.0 + TAU) * np.diff(edges)[:, None]
    return places, np.array([bernstein_matrix(len(row) - 1, TAU) @ np.array(row, dtype=float) for row in coefficients])


def smeared(before, after, share):
    """Coefficients of a cubic from one bound to the other, as a coarse mesh shows a switch after `share` of an element."""
    inner = 4.0 * (before * share + after * (1.0 - share)) - before - after
    return [before, *np.clip([0.5 * inner, 0.5 * inner], 0.0, 1.0), after]


def described(found):
    return [(one.before, one.after) for one in found]


@st.composite
def bang_bang(draw):
    """Edges, coefficients of cubics, and the places of the switches, each smeared over an element between two that are on bounds."""
    n = draw(st.integers(3, 12))
    edges = np.cumsum([0.0, *(draw(st.floats(0.2, 1.0)) for _ in range(n))])
    edges /= edges[-1]
    value = draw(st.integers(0, 1))
    rows, places = [], []
    for j in range(n):
        between = 0 < j < n - 1 and len(set(rows[-1])) == 1
        # Only from a quarter to three quarters of the element can a cubic within the bounds have that integral.
        share = draw(st.floats(0.26, 0.74)) if between and draw(st.booleans()) else None
        if share is None:
            rows.append([float(value)] * 4)
        else:
            rows.append(smeared(float(value), float(1 - value), share))
            places.append(edges[j] + share * (edges[j + 1] - edges[j]))
            value = 1 - value
    return edges, rows, places


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(case=bang_bang())
def test_smeared_switches_are_found_where_they_are(case):
    edges, rows, places = case
    found = switches(*sampled(edges, rows))
    assert len(found) == len(places)
    for one, place in zip(found, places, strict=True):
        j = int(np.searchsorted(edges, place)) - 1
        assert abs(one.place - place) < 0.02 * (edges[j + 1] - edges[j])
        assert {one.before, one.after} == {LOWER, UPPER} and one.certainty == 1.0


@settings(max_examples=100, deadline=None)
@given(places=st.lists(st.floats(0.01, 0.99), min_size=1, max_size=6, unique=True), n=st.integers(3, 15), first=st.integers(0, 1))
def test_sharp_switches_are_found_where_they_are(places, n, first):
    places, edges = np.sort(places), np.linspace(0, 1, n + 1)
    step = 1.0 / (64 * n)
    if (np.diff(places, prepend=0, append=1) < 4 * step).any():
        return
    t = edges[:-1, None] + 0.5 * (1 + TAU) / n
    values = ((first + np.searchsorted(places, t)) % 2).astype(float)
    found = switches(t, values)
    assert [one.place for one in found] == pytest.approx(places, abs=step)
    assert described(found)[0] == ((UPPER, LOWER) if first else (LOWER, UPPER))


def test_a_switch_where_two_elements_meet():
    (found,) = switches(*sampled([0, 0.3, 1], [[1, 1], [0, 0]]))
    assert (found.place, found.before, found.after, found.certainty) == (0.3, UPPER, LOWER, 1.0)


def test_a_hump_is_a_pulse_of_the_same_integral_about_its_middle():
    edges = np.linspace(0, 1, 6)
    rows = [[0, 0, 0], [0, 0, 0], [0, 0, 0.9], [0.9, 0, 0], [0, 0, 0]]
    found = switches(*sampled(edges, rows))
    assert described(found) == [(LOWER, UPPER), (UPPER, LOWER)]
    width = 2 * 0.2 * 0.3
    assert found[1].place - found[0].place == pytest.approx(width, rel=0.02)
    assert 0.5 * (found[0].place + found[1].place) == pytest.approx(0.6, abs=1e-9)
    dip = switches(*sampled(edges, 1.0 - np.array(rows)))
    assert described(dip) == [(UPPER, LOWER), (LOWER, UPPER)]
    assert [one.place for one in dip] == pytest.approx([one.place for one in found], abs=0.2 / 64)


def test_a_smeared_beginning_and_end_are_switches_near_the_ends():
    found = switches(*sampled(np.linspace(0, 1, 5), [[0.6, 0.2, 0.0], [0, 0, 0], [0, 0, 0], [0, 0, 0.9]]))
    assert described(found) == [(UPPER, LOWER), (LOWER, UPPER)]
    assert found[0].place == pytest.approx(0.25 * 0.8 / 3, rel=0.03) and found[1].place == pytest.approx(1 - 0.25 * 0.3, abs=0.003)


def test_an_arc_inside_the_bounds_begins_and_ends():
    edges = np.linspace(0, 1, 11)
    rows = [[1, 1, 1], *([0.3, 0.25, 0.3], [0.35, 0.2, 0.35]) * 3, [0, 0, 0], [0, 0, 0], [0, 0, 0]]
    found = switches(*sampled(edges, rows))
    assert described(found) == [(UPPER, INSIDE), (INSIDE, LOWER)]
    assert [one.place for one in found] == pytest.approx([0.1, 0.7])
    # Where it touches a bound for an instant, it goes on.
    rows[3] = [0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.3]
    rows = [row if len(row) == 7 else [*row] for row in rows]
    assert described(switches(*sampled(edges, rows))) == [(UPPER, INSIDE), (INSIDE, LOWER)]


def test_a_smooth_control_has_none_and_one_that_jumps_inside_has_one():
    edges = np.linspace(0, 1, 5)
    assert not switches(*sampled(edges, [[0.1, 0.3], [0.3, 0.5], [0.5, 0.6], [0.6, 0.9]]))
    found = switches(*sampled(edges, [[0.1, 0.15], [0.15, 0.2], [0.8, 0.75], [0.75, 0.7]]))
    assert described(found) == [(INSIDE, INSIDE)] and found[0].place == 0.5
    # Ringing jumps as well, but not more than it changes on the elements.
    assert not switches(*sampled(edges, [[0.1, 0.6], [0.2, 0.7], [0.1, 0.8], [0.3, 0.6]]))


def test_contacts_begin_and_end():
    edges = np.linspace(0, 1, 11)
    places = edges[:-1, None] + 0.05 * (1.0 + TAU)
    # On the limit between 0.35 and 0.6, which is reached and left as a power of time: what is near it is much longer.
    for power in (1, 2, 3, 4):
        values = 1.0 - np.maximum(0.35 - places, 0.0) ** power - np.maximum(places - 0.6, 0.0) ** power
        found = contacts(places, values, -5.0, 1.0)
        assert described(found) == [(INSIDE, UPPER), (UPPER, INSIDE)]
        assert [one.place for one in found] == pytest.approx([0.35, 0.6], abs=0.003)
    # Reached from both sides at once, it is touched.
    (touch,) = contacts(places, 1.0 - (places - 0.45) ** 2, -5.0, 1.0)
    assert (touch.before, touch.after) == (INSIDE, INSIDE) and touch.place == pytest.approx(0.45, abs=0.002)
    assert described(contacts(places, -values, -1.0, np.inf)) == [(INSIDE, LOWER), (LOWER, INSIDE)]
    assert not contacts(places, values, -5.0, 1.2) and not contacts(places, values, -np.inf, np.inf)
    # No contact: one that is short, also where the phase begins or ends there; an equation; a constant.
    assert not contacts(places, places, 0.0, 1.0)
    assert not contacts(places, 1.0 - 50 * np.abs(places - 0.5), -100.0, 1.0)
    assert not contacts(places, values, 1.0, 1.0) and not contacts(places, 0 * values, 0.0, 1.0)
    # A short gap in a contact is none.
    gap = np.where(np.abs(places - 0.5) < 0.02, 0.9, values)
    assert [one.place for one in contacts(places, gap, -5.0, 1.0)] == pytest.approx([one.place for one in found], abs=1e-3)
