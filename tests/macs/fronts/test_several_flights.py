"""Pictures of a few trajectories of a front, and the marks of the same points among its objectives."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import to_hex
from synthetic_fronts import black_box, flights, marked

from macs.fronts.pictures.style import COLORS


def test_a_color_for_each_trajectory_in_every_panel():
    front = flights(5)
    axes = front.plot_trajectories([0, 4])
    assert [ax.get_ylabel() for ax in axes] == ["h [km]", "v [km/s]", "u [km/s²]", "load [km²/s³]"]
    for ax in axes:
        assert {to_hex(line.get_color()).upper() for line in ax.lines if line.get_linestyle() == "-"} == set(COLORS[:2])
    figure = axes[0].figure
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert [text[:3] for text in words] == ["#0:", "#4:"] and "time" in words[0] and "height" in words[0]
    ends = [max(phase.tf for phase in front[i].trajectory.phases) for i in (0, 4)]
    assert axes[0].get_xlim()[1] >= max(ends)
    drawn = [line.get_xdata() for line in axes[0].lines if line.get_linestyle() == "-"]
    assert np.isclose(np.nanmax(np.concatenate(drawn)), max(ends))


def test_dots_are_ends_of_phases_and_hollow_nodes_of_what_is_not_verified():
    axes = marked(flights(3), [True, False, True]).plot_trajectories([0, 1])
    dots = [line for line in axes[0].lines if line.get_marker() == "o"]
    full = [line for line in dots if to_hex(line.get_markerfacecolor()) != "#ffffff"]
    hollow = [line for line in dots if line not in full]
    assert len(full) == 2 and all(len(line.get_xdata()) == 1 for line in full)
    assert hollow and {to_hex(line.get_color()).upper() for line in hollow} == {COLORS[1]}
    words = [text.get_text() for text in axes[0].figure.legends[0].get_texts()]
    assert "not verified" not in words[0] and words[1].endswith("not verified")
    # What was not simulated is said, but drawn in full, as by a point's own picture.
    axes = flights(3).plot_trajectories([0, 1])
    assert all(to_hex(line.get_markerfacecolor()) != "#ffffff" for line in axes[0].lines if line.get_marker() == "o")
    assert all(text.get_text().endswith("not simulated") for text in axes[0].figure.legends[0].get_texts())


@pytest.mark.parametrize(
    ("front", "points", "said"), [(flights(3), [], "one to"), (flights(9), range(8), "one to"), (black_box(), [2], "2 has no")]
)
def test_what_cannot_be_drawn_is_said(front, points, said):
    with pytest.raises(ValueError, match=said):
        front.plot_trajectories(points)
    with pytest.raises(ValueError, match="at most 7"):
        flights(9).plot(marked=range(8))


@pytest.mark.parametrize("objectives", [2, 4])
def test_marked_points_have_the_colors_of_their_trajectories(objectives):
    front = black_box(6, objectives)
    ax = front.plot(marked=[1, -1])
    words = [text.get_text() for text in ax.get_legend().get_texts()]
    assert [text[:3] for text in words] == ["#1:", "#5:"]
    if objectives == 4:
        drawn = [line for line in ax.lines if line.get_label() in words]
        assert [to_hex(line.get_color()).upper() for line in drawn] == list(COLORS[:2])
    else:
        drawn = [one for one in ax.collections if one.get_label() in words]
        assert [to_hex(one.get_edgecolor()[0]).upper() for one in drawn] == list(COLORS[:2])
        assert np.array_equal(drawn[1].get_offsets()[0][-1], front.objectives[-1, min(objectives - 1, 1)])


def test_other_points_are_drawn_beside_those_of_two_objectives():
    front = black_box(6, 2)
    many, few = np.random.default_rng(0).uniform(size=(101, 2)), front.objectives[:3] + 0.1
    ax = front.plot(beside={"known": many, "another": few})
    assert [text.get_text() for text in ax.get_legend().get_texts()[:2]] == ["known", "another"]
    drawn = {line.get_marker(): np.column_stack(line.get_data()) for line in ax.lines if len(line.get_xdata())}
    assert np.array_equal(drawn["o"], many) and np.array_equal(drawn["x"], few)
    with pytest.raises(ValueError, match="two objectives, not of 3"):
        black_box(6, 3).plot(beside={"known": many})


@pytest.mark.slow
def test_a_shorter_trajectory_is_above_a_longer_one():
    front = flights(5)
    ends = [point.trajectory.phases[-1].tf for point in front]
    short, long = int(np.argmin(ends)), int(np.argmax(ends))
    ax = front.plot_trajectories([short, long])[0]
    lines = [to_hex(line.get_color()).upper() for line in ax.lines if line.get_linestyle() == "-"]
    assert lines.index(COLORS[1]) < lines.index(COLORS[0])
