"""What fronts, points, trajectories and studies show in notebooks."""

import base64
import io
import re
import warnings
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib import image
from synthetic_fronts import black_box, empty, flights, marked

from macs import NSGA2
from macs.decisions import Choice, Ranges, WeightedSum
from problems.compiled import Objective, Variable
from runs import Study

LARGEST = 150_000
EVIL = '<script>alert("x")</script>&$'


def shown(what) -> ElementTree.Element:
    """Its HTML, read by a parser that takes nothing that is not closed or escaped; small, and without a script."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        text = what._repr_html_()
    assert len(text) < LARGEST and "<script" not in text
    return ElementTree.fromstring(f"<body>{text}</body>")


def cells(page: ElementTree.Element) -> list[list[str]]:
    return [["".join(cell.itertext()) for cell in row] for row in page.iter("tr")]


def picture(page: ElementTree.Element) -> np.ndarray:
    (one,) = page.iter("img")
    assert one.get("alt")
    return image.imread(io.BytesIO(base64.b64decode(one.get("src").removeprefix("data:image/png;base64,"))))


def test_a_front_is_its_table_and_a_picture():
    front = flights(5)
    page = shown(front)
    rows = cells(page)
    assert rows[0][:3] == ["#", "time", "height"] and len(rows) == 2 + len(front)
    assert [float(row[1]) for row in rows[2:]] == pytest.approx(front.objectives[:, 0], rel=1e-5)
    assert picture(page).std() > 0.01, "not blank"


@pytest.mark.parametrize("front", [empty(), empty(closest=None), black_box(0, 5), black_box(200, 3), flights(3, status=["failed"] * 3)])
def test_every_front_can_be_shown(front):
    page = shown(front)
    assert picture(page).std() > 0.0 and len(cells(page)) <= 2 + 30 and front.message in "".join(page.itertext())


def test_rows_that_are_not_verified_come_last_and_are_grey():
    front = marked(flights(4), [True, False, True, True])
    page = shown(front)
    rows = list(page.iter("tr"))[2:]
    assert ["".join(row[0].itertext()) for row in rows] == ["0", "2", "3", "1"]
    assert [bool(row.get("style")) for row in rows] == [False, False, False, True]
    assert "Grey: Not verified" in "".join(page.itertext())


@pytest.mark.slow
def test_a_point_is_its_objectives_and_a_picture():
    front = marked(flights(3), [True, False, True])
    page = shown(front[1])
    assert [row[0] for row in cells(page)] == ["objective", "time", "height"] and "not verified" in "".join(page.itertext())
    assert float(cells(page)[1][3]) == pytest.approx(1.01 * front.objectives[1, 0], abs=5e-3), "as simulated, with digits of the front"
    assert picture(page).std() > 0.01
    picture(shown(black_box()[0]))
    failed = flights(1, trajectories=[None], status=["failed"])[0]
    assert not list(shown(failed).iter("img"))


def test_a_trajectory_has_a_line_for_each_quantity():
    flight = flights(1)[0].trajectory
    page = shown(flight)
    rows = cells(page)
    assert [row[0] for row in rows if row[0]] == ["h", "v", "u", "load", "h"] and len(list(page.iter("table"))) == 2
    assert rows[1][1:3] == ["state", "km"] and float(rows[1][3]) == pytest.approx(flight["climb"]["h"][0], rel=1e-5)
    first = next(line for line in page.iter() if line.tag.endswith("polyline"))
    heights = -np.array([float(place.split(",")[1]) for place in first.get("points").split()])
    assert np.corrcoef(heights, flight["climb"]["h"])[0, 1] > 0.999, "up is more"


@pytest.mark.slow
def test_words_of_the_user_are_escaped():
    goals = [Objective(EVIL, EVIL), Objective("b", "")]
    front = black_box(3, 2, goals=goals, variables=[Variable(f"{EVIL}{k}", 0.0, 1.0, EVIL) for k in range(3)], message=EVIL)
    page = shown(front)
    assert cells(page)[0][1] == EVIL and EVIL in "".join(page.itertext())
    assert cells(shown(front[0]))[1][0] == EVIL
    choice = Choice.of(front[0], WeightedSum({EVIL: 1.0, "b": 1.0}), Ranges.of(front))
    assert any(EVIL in row[0] for row in cells(shown(choice)))
    flight = flights(1)[0].trajectory
    (climb, coast) = flight.phases
    object.__setattr__(climb, "name", EVIL)
    assert EVIL in "".join(shown(type(flight)((climb, coast), {EVIL: 1.0})).itertext())


def test_two_dollars_make_no_mathematics():
    ax = black_box(3, 2, goals=[Objective("price in $", "$"), Objective(r"$\frac{$", "")]).plot()
    ax.figure.draw_without_rendering()
    assert re.sub(r"\\\$", "$", ax.get_xlabel()) == "← price in $ [$]"


@pytest.mark.slow
def test_a_study_and_its_state_are_tables(tmp_path):
    study = Study("small", problems=["four_bar_truss"], solvers={EVIL: NSGA2(population=8)}, evaluations=40, runs=2, seed=1)
    assert cells(shown(study))[1] == ["four_bar_truss", "no transcription", EVIL, "40", "2"]
    summary = study.run(tmp_path / "out")
    page = shown(summary)
    assert cells(page)[1][:6] == ["four_bar_truss", "no transcription", EVIL, "2", "0", "0"]
    assert "2 of 2 runs finished" in "".join(page.itertext())
