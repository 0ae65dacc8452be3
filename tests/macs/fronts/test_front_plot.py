import io
import subprocess
import sys
import warnings
from itertools import pairwise
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.colors import to_hex
from synthetic_fronts import black_box, costated, empty, flights, marked

from macs.decisions import Choice, Ranges, WeightedSum
from macs.fronts.pictures.flight_plot import _dense
from macs.fronts.pictures.style import COLORS, axis_label, axis_number, blank_figure, caption, draw_limits
from problems.compiled import Objective, Variable


@pytest.mark.parametrize(
    "front",
    [
        flights(1),
        empty(closest=None),
        black_box(0, 3),
        black_box(0, 4),
        black_box(2, 4, F=np.ones((2, 4))),
        marked(flights(3, status=["converged", "infeasible", "failed"]), [True, False, False], [True, True, False]),
        *(marked(black_box(4, m), [True, False, True, False]) for m in (1, 3, 5)),
        marked(black_box(3, 5), [False] * 3),
    ],
)
def test_every_front_can_be_drawn(front):
    picture = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        front.plot().figure.savefig(picture, format="png", dpi=50)
    assert picture.getvalue().startswith(b"\x89PNG")


def test_axes_have_units_and_senses_the_numbers_of_the_table_and_a_style_that_does_not_leak():
    ax = flights().plot()
    assert ax.get_xlabel() == "\N{LEFTWARDS ARROW} time [s]" and ax.get_ylabel() == "height [km]\N{NO-BREAK SPACE}\N{RIGHTWARDS ARROW}"
    assert "best height" in ax.get_legend().get_texts()[1].get_text()
    offsets = ax.collections[0].get_offsets()
    assert np.array_equal(offsets, flights().objectives)
    front = black_box(3, 2, F=np.array([[5.35104, 700.0], [67069.2, 300.0], [835267.4, 12.0142]]))
    ax, table = front.plot(), front.table()
    for value in ("5.3510", "835267"):
        assert value in table.split()
    assert [text.get_text().split(" (")[0] for text in ax.get_legend().get_texts()] == ["best f0: 5.3510 kg", "best f1: 12.014"]
    known = marked(front.replace(F=np.array([[-5.35104, 700.0], [6.706, 300.0], [8.352, 12.0142]])), [True] * 3)
    cells = known.table().splitlines()[5].split()
    assert known[0].title == f"f0 {cells[1]} kg, f1 {cells[2]}" == "f0 -5.35 kg, f1 700.0"
    assert (
        caption(known[0]) == "f0 \N{MINUS SIGN}5.35 kg, f1 700.0"
        and "<td" in known[0]._repr_html_()
        and "-5.351" not in known[0]._repr_html_()
    )
    assert {"-5.35", "700.0"} <= set(Choice.of(known[0], WeightedSum({"f0": 1.0, "f1": 1.0}), Ranges.of(known)).degrees_table().split())
    before = dict(matplotlib.rcParams)
    ax = blank_figure().add_subplot()
    assert flights().plot(ax=ax) is ax
    space = blank_figure().add_subplot(projection="3d")
    assert black_box(5, 3).plot(space) is space and space.get_zlabel()
    assert {k: v for k, v in matplotlib.rcParams.items() if before[k] != v} == {}


def told(ax) -> dict[str, np.ndarray]:
    """What is drawn as a scatter plot, by its label."""
    return {drawn.get_label(): np.asarray(drawn.get_offsets()) for drawn in ax.collections}


def test_points_that_are_not_verified_are_hollow_and_never_the_best():
    """The first point has the least time, the last the greatest height; a simulation confirms neither."""
    front = marked(flights(5), [False, True, True, True, False])
    assert front.F.argmin(axis=0).tolist() == [0, 4]
    ax = front.plot()
    found = told(ax)
    assert np.array_equal(found["not verified"], front.objectives[[0, 4]])
    assert np.array_equal(ax.collections[0].get_offsets(), front.objectives[1:4])
    hollow = next(drawn for drawn in ax.collections if drawn.get_label() == "not verified")
    assert len(hollow.get_facecolors()) == 0 < len(ax.collections[0].get_facecolors())
    best = {label: place for label, place in found.items() if label.startswith("best ")}
    assert sorted(label[-4:] for label in best) == ["(#1)", "(#3)"]
    assert "not verified" in [text.get_text() for text in ax.get_legend().get_texts()]
    nothing = told(marked(flights(5), [False] * 5).plot())
    assert "not verified" in nothing and not any(label.startswith("best ") for label in nothing)


def test_points_that_were_not_simulated_are_drawn_in_full():
    front = marked(flights(3), [False, True, False], [False, True, True])
    ax = front.plot()
    assert np.array_equal(ax.collections[0].get_offsets(), front.objectives[:2])
    assert "not verified" not in told(flights(3).plot())
    titles = [one.plot().get_title(loc="left") or one.plot().get_title() for one in (front, flights(3), black_box(3))]
    assert [title.endswith(", 3 points, not simulated") for title in titles] == [False, True, False]
    said = [point.plot()[0].figure.get_suptitle().endswith("; not simulated") for point in (front[0], front[1])]
    assert said == [True, False]


def test_parallel_coordinates_end_where_verified_points_do():
    """The axes' ends are the best and worst of these; a point that is not verified has a broken line, which may leave them."""
    F = np.array([[0.0, 0.0, 0.0, 0.0], [1.0, 4.0, 2.0, 3.0], [3.0, 2.0, 4.0, 1.0]])
    ax = marked(black_box(3, 4, F=F), [False, True, True]).plot()
    lines = {line.get_linestyle(): line.get_ydata() for line in ax.lines if len(line.get_xdata()) == 4}
    assert sorted(lines) == ["-", "--"] and (lines["--"] > 1.0).all()
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["not verified"]
    assert [text.get_text() for text in ax.texts] == ["1", "3", "2", "4", "2", "4", "1", "3"]
    assert black_box(3, 4).plot().get_legend() is None


@pytest.mark.slow
def test_long_names_and_messages_stay_within_the_picture():
    names = [f"expected economic loss number {k} due to floods" for k in range(5)]
    front = black_box(4, 5, goals=[Objective(name, "M$") for name in names])
    ax = front.plot()
    ax.figure.draw_without_rendering()
    shown = [text.get_window_extent() for text in ax.get_xticklabels()]
    assert all(one.x1 < other.x0 for one, other in pairwise(shown)) and shown[-1].x1 < ax.figure.bbox.x1
    picture = front[1].plot()[0].figure
    picture.draw_without_rendering()
    assert picture._suptitle.get_window_extent().x1 < picture.bbox.x1
    nothing = (
        empty().replace(message="no feasible point in 500 evaluations; the nearest violates the load by 3 of its scale, 2000 kN").plot()
    )
    nothing.figure.draw_without_rendering()
    message = next(text for text in nothing.texts if "no feasible" in text.get_text()).get_window_extent()
    assert nothing.bbox.x0 <= message.x0 and message.x1 <= nothing.bbox.x1


@pytest.mark.parametrize("length", [-3.7e-6, 2e-6])
def test_a_phase_without_length_has_no_costates_and_the_picture_says_so(length):
    *_, costate, hamiltonian = axes = costated(length)[1].plot(costates=True)
    assert max(np.nanmax(np.abs(ax.lines[0].get_ydata())) for ax in (costate, hamiltonian)) <= 1.0
    assert [len([line for line in ax.lines if len(line.get_xdata()) > 2]) for ax in (costate, hamiltonian)] == [2, 2], "lines and dots"
    assert np.abs([*costate.get_ylim(), *hamiltonian.get_ylim()]).max() < 10.0
    figure = hamiltonian.figure
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["climb", "coast (no length)"]
    assert axes[4].get_title("right") == "no costates of coast: without length"
    axes = costated(1.0)[1].plot(costates=True)
    assert [text.get_text() for text in axes[0].figure.legends[0].get_texts()] == ["climb", "coast"]
    assert axes[4].get_title("right") == ""


def test_a_path_instead_of_a_figure_is_refused_with_the_remedy(tmp_path):
    front, box = flights(3), black_box()
    for call in (lambda: front.plot("x.png"), lambda: front[1].plot("x.png"), lambda: front.plot_trajectories([0], "x.png"),
                 lambda: box.plot_variables(Path("x.png")), lambda: box[2].plot("x.png")):  # fmt: skip
        with pytest.raises(ValueError, match=r"drawn into a figure, not into a file: .* front\.plot\(\)\.figure\.savefig\('x\.png'\)"):
            call()


@pytest.mark.slow
def test_pictures_need_no_display(tmp_path):
    code = "from synthetic_fronts import flights; f = flights(); f.plot().figure.savefig('a.png'); f[0].plot()[0].figure.savefig('b.png')"
    environment = {"PATH": "", "PYTHONPATH": ":".join(sys.path), "MPLBACKEND": "TkAgg", "MPLCONFIGDIR": str(tmp_path)}
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=environment, check=True, timeout=60)
    assert (tmp_path / "a.png").stat().st_size > 1000 and (tmp_path / "b.png").stat().st_size > 1000


@pytest.mark.slow
def test_legends_stand_above_the_axes_and_below_the_title():
    """Also of long names, which are wrapped: no data can be behind them."""
    long = [Objective(f"an objective with a long name, number {k}, as users have them", "kg m2/s2") for k in range(2)]
    for front in (
        flights(6),
        marked(flights(3), [False] * 3),
        black_box(9, 2, goals=long),
        marked(black_box(4, 5), [True, False, True, False]),
    ):
        ax = front.plot()
        ax.figure.draw_without_rendering()
        legend, title = ax.get_legend().get_window_extent(), ax._left_title.get_window_extent()
        assert legend.y0 >= ax.bbox.y1 - 1.0 and title.y0 >= legend.y1 - 1.0
        assert legend.x1 <= ax.figure.bbox.x1 + 1.0 and title.y1 <= ax.figure.bbox.y1 + 1.0


@pytest.mark.parametrize(
    ("values", "limits", "expected"),
    [
        ([0.9999999992, 1.0], (0.0, 1.0), (0.0, 1.0)),  # a control on its bound
        ([0.3, 0.3], (-1.5, 1.5), (-1.5, 1.5)),
        ([0.0, 2e-7], (-10.0, 10.0), (-10.0, 10.0)),  # round-off of zero
        ([0.01, 0.01], (-1.5, 1.5), (0.009, 0.011)),  # too small to be read within its bounds
        ([6378.0, 6378.0], (1.0, 1e9), (5740.2, 7015.8)),
        ([5.0, 5.0], (-np.inf, np.inf), (4.5, 5.5)),
        ([0.0, 0.0], (-np.inf, 0.5), (-1.0, 1.0)),
        ([0.0, 0.4], (-10.0, 10.0), (0.0, 0.4)),  # no constant
        ([0.0, 0.4], (-0.1, 0.5), (-0.1, 0.5)),  # with its limits
    ],
)
def test_constants_are_drawn_within_their_bounds_or_about_their_value(values, limits, expected):
    ax = blank_figure().add_subplot()
    draw_limits(ax, np.array(values), [(None, *limits)])
    low, high = ax.get_ylim()
    room = 0.06 * (expected[1] - expected[0])
    assert (low + room, high - room) == pytest.approx(expected, rel=1e-6, abs=1e-9)
    assert [line.get_ydata()[0] for line in ax.lines] == [bound for bound in limits if expected[0] <= bound <= expected[1]]


def test_limits_of_paths_are_drawn_over_their_own_phase():
    """The load reaches its limit of 2; it has none below."""
    flight = flights()[0]
    ax = flight.plot()[3]
    dashed = [line for line in ax.lines if line.get_linestyle() == "--"]
    assert len(dashed) == 1 and set(dashed[0].get_ydata()) == {2.0}
    assert list(dashed[0].get_xdata()) == [flight.trajectory["climb"].t0, flight.trajectory["climb"].tf]
    control = flights()[0].trajectory["climb"].control
    times, values = _dense(control.edges, control.on_element, 0, None)
    assert np.isnan(values).sum() == len(control.edges) - 1
    first = values[: np.flatnonzero(np.isnan(values))[0]]
    assert first[-1] == pytest.approx(control.on_element(0, np.array([1.0]))[0, 0])
    assert times[np.flatnonzero(np.isnan(values))[0] + 1] == control.edges[1]


def test_trajectories_that_are_not_verified_say_so_and_have_hollow_nodes():
    front = marked(flights(3, status=["converged", "converged", "infeasible"]), [True, False, False])
    titles, hollow = [], []
    for point in front:
        axes = point.plot()
        titles.append(axes[0].figure.get_suptitle())
        hollow.append([line.get_markerfacecolor() for line in axes[0].lines if line.get_marker() == "o"])
    assert not hollow[0] and hollow[1] == hollow[2] == ["white", "white"]
    assert [title.rpartition("; ")[2] for title in titles[1:]] == ["not verified", "not feasible"] and ";" not in titles[0]


@pytest.mark.slow
def test_designs_that_are_not_verified_are_hollow():
    F = np.array([[1.0, 4.0], [2.0, 3.0], [3.0, 2.0], [4.0, 1.0]])
    front = marked(black_box(4, 2, F=F, status=["converged"] * 3 + ["infeasible"]), [True, False, True, False])
    ax = front.plot_variables()[0]
    found = told(ax)
    assert np.array_equal(found["not verified"][:, 1], front.decision[[1], 0])
    assert np.array_equal(found["not feasible"][:, 1], front.decision[[3], 0])
    assert [text.get_text() for text in ax.figure.legends[0].get_texts()] == ["not verified", "not feasible"]
    assert ax.figure.get_suptitle() == "black box: 4 points" and front[1].plot()[0].figure.get_suptitle().endswith("; not verified")


def test_long_labels_stay_beside_their_panels():
    """A label never breaks within its unit, and is no longer than its panel is high."""
    wide = black_box(4, 2, variables=[Variable(f"the angle of attack that is commanded, {k}", 0.0, 1.0, "kg m2/s2") for k in range(3)])
    axes = wide.plot_variables()
    axes[0].figure.draw_without_rendering()
    for ax in axes:
        assert ax.yaxis.label.get_window_extent().height <= 1.25 * ax.bbox.height
        assert ax.get_ylabel().endswith("[kg\N{NO-BREAK SPACE}m²/s²]")


@pytest.mark.parametrize(
    ("unit", "shown"),
    [("m2/s3", "m²/s³"), ("1/m2", "1/m²"), ("N^2 s", "N² s"), ("N2 m2 s", "N² m² s"), ("t N2", "t N2"), ("m s^-2", "m s⁻²"), ("%", "%")],
)
def test_powers_of_units_are_raised(unit, shown):
    assert axis_label("x", unit).replace("\N{NO-BREAK SPACE}", " ") == f"x [{shown}]"


def test_numbers_beside_axes_have_no_powers_of_ten_below_ten_millions():
    values = (17344.2, -0.5, 1234.5, 999999.0, 1.5e6, 2e7, -3e-5)
    assert [axis_number(value) for value in values] == ["17344", "−0.5", "1234", "999999", "1500000", "2×10⁷", "−3×10⁻⁵"]


def test_round_off_of_a_constant_objective_is_no_picture():
    """As colour, along an axis, and among parallel coordinates."""
    noise = 2.9 + 1e-12 * np.arange(4)
    three = black_box(4, 3, F=np.column_stack([np.arange(4.0), 4.0 - np.arange(4), noise]))
    ax = three.plot()
    assert ax.figure.axes[1].get_ylim() == pytest.approx((2.61, 3.19)) and len({tuple(c) for c in ax.collections[0].get_facecolors()}) == 1
    ax = black_box(4, 2, F=np.column_stack([np.arange(4.0), noise])).plot()
    assert ax.get_ylim() == pytest.approx((2.61, 3.19))
    lines = black_box(4, 4, F=np.column_stack([np.arange(4.0), noise, np.arange(4.0), -np.arange(4.0)])).plot().lines
    assert {line.get_ydata()[1] for line in lines if len(line.get_ydata()) == 4} == {1.0}


# A few trajectories of a front, and the marks of the same points among its objectives


@pytest.mark.parametrize(
    ("unit", "label"), [("s", "time [s]"), ("TU", "time [TU]"), ("m", "distance [m]"), ("rad", "angle [rad]"), ("", "time")]
)
def test_the_axis_is_called_as_its_unit_says(unit, label, tmp_path):
    point = flights(1)[0]
    for phase in point.trajectory.phases:
        object.__setattr__(phase, "time_unit", unit)
    assert point.plot()[0].figure.get_supxlabel() == label
    point.to_csv(tmp_path / "point.csv")
    assert f",{label}," in (tmp_path / "point.csv").read_text(encoding="utf-8")


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
    ("front", "points", "said"), [(flights(3), [], "one to"), (flights(9), range(9), "one to"), (black_box(), [2], "2 has no")]
)
def test_what_cannot_be_drawn_is_said(front, points, said):
    with pytest.raises(ValueError, match=said):
        front.plot_trajectories(points)
    with pytest.raises(ValueError, match="at most 8"):
        flights(9).plot(marked=range(9))


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
