"""Pages in headless Chromium: clicks, keys, ranges, no error on the console, and how quickly a large study opens.

Skipped where there is no Chromium with its driver (Debian: chromium, chromium-driver).
"""

import time
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from chromium import NEEDS_CHROMIUM, READY, errors, opened, started, wait, work_of
from synthetic_fronts import black_box, flights, marked

from macs import Front, sweep
from problems import load
from runs.browser import page as pages
from runs.browser.pages import front_page, run_data
from runs.browser.points import details, differences, goals_data, samples_of
from transcription import parse

pytest.importorskip("plotly")
webdriver = pytest.importorskip("selenium.webdriver")
pytestmark = NEEDS_CHROMIUM


def show(browser, tmp_path: Path, content: bytes) -> None:
    """Open a page."""
    (tmp_path / "page.html").write_bytes(content)
    opened(browser, (tmp_path / "page.html").as_uri())


def test_a_click_selects_a_point_and_shows_its_trajectory(browser, tmp_path):
    front = marked(flights(5), [True, False, True, True, True])
    show(browser, tmp_path, front_page(front))
    wait(browser, "document.querySelector('#plot .points path')")
    place = browser.execute_script(
        "const r = document.querySelector('#plot .points path').getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]"
    )
    actions = webdriver.ActionChains(browser)
    actions.w3c_actions.pointer_action.move_to_location(*map(int, place))
    actions.click().perform()
    wait(browser, "state.selected && document.getElementById('flights').dataset.drawn === state.selected")
    index = browser.execute_script("return selectedPoint().index")
    assert f"Point {index} selected" in browser.execute_script("return byId('announcements').textContent")
    names = {name for phase in front[index].trajectory.values() for name in phase.names}
    drawn = browser.execute_script("return [...document.querySelectorAll('.panel-plot')].map((one) => one.getAttribute('aria-label'))")
    assert {label.split(",")[0] for label in drawn} == names
    browser.execute_script("document.querySelector('.panel-plot').scrollIntoView()")
    wait(browser, "document.querySelector('.panel-plot').data")
    last = browser.execute_script("return document.querySelector('.panel-plot').data[0].y.at(-1)")
    assert last == pytest.approx(front[index].trajectory["climb"].edge_states[-1, 0], rel=1e-5)
    times, heights = browser.execute_script("const { x, y } = document.querySelector('.panel-plot').data[0]; return [x, y]")
    assert heights == pytest.approx(front[index].trajectory["climb"].at(np.array(times))["h"], rel=1e-5)
    values = np.array([-3.5e14, 0.0, np.nan, 2.25e14])
    told = browser.execute_script("return curveValues(arguments[0])", differences(values))
    assert np.array(told, dtype=float) == pytest.approx(values, nan_ok=True)
    assert browser.execute_script("return document.querySelectorAll('#table tr[aria-selected=true]').length") == 1
    assert errors(browser) == []


def test_a_page_opens_with_the_knee_and_its_trajectory(browser, tmp_path):
    front = flights(5, F=np.array([[1.0, 5.0], [2.0, 1.5], [3.0, 1.2], [4.0, 1.1], [5.0, 1.0]]))
    for knee, verified in ((1, [True] * 5), (2, [True, False, True, True, True])):
        show(browser, tmp_path, front_page(marked(front, verified)))
        wait(browser, "document.getElementById('flights').dataset.drawn === state.selected")
        assert browser.execute_script("return selectedPoint().index") == knee
    show(browser, tmp_path, front_page(black_box(5, 3)))
    assert browser.execute_script("return tableOrder().indexOf(selectedPoint())") == 2
    assert errors(browser) == []


def test_numbers_are_those_of_the_table_and_details_are_shown_on_demand(browser, tmp_path):
    front = marked(flights(4), [True] * 4)
    cells = "return [...document.querySelectorAll('#table tbody tr')].map((row) => [...row.cells].map((one) => one.textContent))"
    heads = "return [...document.querySelectorAll('#table th button')].map((one) => one.textContent)"
    show(browser, tmp_path, front_page(front))
    assert browser.execute_script(heads) == ["#", "time", "height", "mass", "status"]
    assert browser.execute_script(cells) == [line.split() for line in front.table().splitlines()[5:9]]
    time, height = front.table().splitlines()[6].split()[1:3]
    assert browser.execute_script("return inWords(state.points[1])") == f"time {time} s, height {height} km"
    browser.execute_script("byId('table-details').querySelector('input').click()")
    assert "defect" in browser.execute_script(heads) and "defect" in browser.execute_script("return byId('point').textContent")
    show(browser, tmp_path, front_page(marked(flights(4), [True, False, True, True])))
    assert "defect" in browser.execute_script(heads) and browser.execute_script(
        "return byId('table-details').querySelector('input').checked"
    )
    assert errors(browser) == []


SLID = """
const range = byId('along-range'), done = arguments[1];
range.value = arguments[0];
range.dispatchEvent(new Event('input'));
requestAnimationFrame(() => setTimeout(() => done(range.getAttribute('aria-valuetext')), 50));
"""
"""Move the slider; returns what it says."""
MOVING = """
const [{ traces }] = panels.filter(({ quantity }) => quantity.name === arguments[0]);
return traces.find(({ meta }) => meta !== null);
"""
"""The interpolated trace of the panel of a quantity."""
WORK = """
const took = [];
for (slide.place = 10; slide.place < 40; slide.place += 1) {
  const began = performance.now();
  redrawAlong();
  document.body.offsetHeight; // the page is laid out
  took.push(performance.now() - began);
}
return took.sort((a, b) => a - b)[15];
"""
"""Milliseconds of work for a redraw, the median of 30."""


@cache
def ascents() -> Front:
    return sweep(load("goddard"), parse("dfet:4x6:bernstein"), points=10, starts=1)


def test_a_slider_moves_along_the_front_with_interpolated_trajectories(browser, tmp_path):
    from selenium.webdriver.common.keys import Keys

    whole = ascents()
    front, between = whole[[k for k in range(10) if k != 5]], whole[5]
    show(browser, tmp_path, front_page(front))
    places = browser.execute_script("return slide.places.map(({ values }) => values[0])")
    place = int(np.argmin(np.abs(np.array(places) - between.objectives["flight time"])))
    said = browser.execute_async_script(SLID, place)
    assert said.startswith(f"flight time {places[place]:.1f} s, horizontal speed 0.") and said.endswith("km/s, interpolated")
    wait(browser, "panels.some(({ traces }) => traces.some(({ meta }) => meta !== null))")
    for name, values in between.trajectory["ascent"].at(np.linspace(0.0, between.trajectory["ascent"].tf, 50)).items():
        trace = browser.execute_script(MOVING, name)
        times, found = np.array(trace["x"]), np.array(trace["y"])
        assert times[-1] == pytest.approx(places[place], rel=2e-3)
        spread = np.ptp([one.trajectory["ascent"][name] for one in front], axis=None)
        assert np.abs(np.interp(np.linspace(0.0, times[-1], 50), times, found) - values).max() < 0.005 * spread, (
            name
        )  # straight lines between two points: 0.009
    note = browser.execute_script("return byId('along-note').textContent")
    assert note.startswith('Between points 4 and 5, interpolated, not simulated; front.at({"flight time": ')
    assert browser.execute_script("return byId('plot').data.find(({ meta }) => meta === 'curve').x.length") == len(places) + 1
    browser.execute_script("byId('along-range').focus()")
    webdriver.ActionChains(browser).send_keys(Keys.END).perform()
    wait(browser, "byId('along-range').getAttribute('aria-valuetext').startsWith('Point 8: ')")
    webdriver.ActionChains(browser).send_keys(Keys.ARROW_LEFT).perform()
    wait(browser, "byId('along-range').getAttribute('aria-valuetext').endsWith('interpolated')")
    wait(browser, "byId('plot').data.find(({ meta }) => meta === 'along').x[0] === placeShown().values[0]")
    assert browser.execute_script("return panels.length") >= 8 and browser.execute_script(WORK) < 50
    browser.execute_async_script(SLID, 20)
    browser.execute_script("keep(state.points[6].key, true)")  # new panels, before the old ones have settled
    time.sleep(0.5)
    # Two valleys: between them nothing is interpolated.
    parts = """
    const [{ places, objectives, points, at }] = slide.run.curve.pieces;
    const cut = places.findIndex((one) => one > 0.5 * (at[3] + at[4]));
    slide.run.curve.pieces = [[0, cut, 0, 4], [cut, places.length, 4, 9]].map(([i, j, first, end]) => {
      const [own, across, up] = [places, ...objectives].map((list) => list.slice(i, j));
      return { places: own, objectives: [across, up], points: points.slice(first, end), at: at.slice(first, end) };
    });
    slide.run = null;
    endSlide();
    return cut;
    """
    cut = browser.execute_script(parts)
    assert not browser.execute_async_script(SLID, cut).endswith("interpolated")
    assert "that of point 4, the nearest" in browser.execute_script("return byId('along-note').textContent")
    browser.execute_script("select(state.points[2].key)")
    assert browser.execute_script("return slide.place === null && byId('along-range').getAttribute('aria-valuetext')").startswith(
        "Point 2:"
    )
    marker = "moveAlong(30); return byId('plot').querySelectorAll(`.trace${byId('plot')._fullData[markers()[0]].uid} .point`).length"
    assert browser.execute_script(marker) == 1, "from the first move on, not only at rest"
    assert errors(browser) == []


PAINTED = """
const [moves, done] = arguments, range = byId('along-range'), took = [];
const step = (began) => {
  if (began) took.push(performance.now() - began);
  if (took.length === 25) return done(took.sort((a, b) => a - b)[12]);
  const now = performance.now();
  if (moves) {
    range.value = 20 + took.length;
    range.dispatchEvent(new Event('input'));
  } else byId('along-words').textContent = String(now);
  requestAnimationFrame(() => requestAnimationFrame(() => step(now)));
};
step();
"""
"""Milliseconds until a place of the slider, or a word alone, is on the screen, the median of 25."""


@pytest.mark.slow
def test_a_place_of_the_slider_is_painted_as_soon_as_a_word_is(tmp_path):
    from selenium.webdriver.common.keys import Keys

    browser = started(webgl=False)
    try:
        show(browser, tmp_path, front_page(ascents()))
        browser.execute_async_script(SLID, 20)
        wait(browser, "panels.length >= 8 && panels.some(({ traces }) => traces.some(({ meta }) => meta !== null))")
        word, place = (min(browser.execute_async_script(PAINTED, moves) for _ in range(3)) for moves in (False, True))
        # 50 ms are asked for: it took 33, two frames, also with ten other programs at work. On a busy machine a word takes longer, too.
        assert place < 1.5 * word, (place, word)
        browser.execute_script("byId('along-range').focus()")
        webdriver.ActionChains(browser).send_keys(*[Keys.ARROW_RIGHT] * 30).perform()
        wait(browser, "slide.place === 74")
        assert errors(browser) == []
    finally:
        browser.quit()


@pytest.mark.slow
def test_rows_are_reached_and_selected_by_keys_and_sorted_by_titles(browser, tmp_path):
    from selenium.webdriver.common.keys import Keys

    front = flights(5)
    show(browser, tmp_path, front_page(front))
    browser.execute_script("document.querySelector('#table tbody tr').focus()")
    webdriver.ActionChains(browser).send_keys(Keys.ARROW_DOWN, Keys.ARROW_DOWN, Keys.ENTER).perform()
    assert browser.execute_script("return selectedPoint().index") == 2
    assert browser.execute_script("return document.querySelectorAll('#table tr[tabindex=\"0\"]').length") == 1
    button = browser.find_elements("css selector", "#table th button")[2]
    button.click()
    shown = browser.execute_script(
        "return [...document.querySelectorAll('#table tbody tr')].map((row) => Number(row.dataset.key.split(':')[1]))"
    )
    assert shown == front.objectives[:, 1].argsort(kind="stable").tolist()
    assert browser.execute_script("return document.querySelectorAll('#table th')[2].getAttribute('aria-sort')") == "ascending"
    assert errors(browser) == []


@pytest.mark.slow
def test_ranges_filter_figure_and_table_whether_typed_or_brushed(browser, tmp_path):
    front = black_box(6, 3)
    show(browser, tmp_path, front_page(front))
    values = sorted(front.objectives[:, 0])
    least = browser.find_element("css selector", "#preferences input[type=number]")
    least.send_keys(repr(0.5 * (values[1] + values[2])))
    browser.execute_script("document.activeElement.blur()")
    assert browser.execute_script("return document.querySelectorAll('#table tbody tr').length") == 4
    assert browser.execute_script("return byId('plot').data[0].x.length") == 2  # outside, grey
    for kind in ("three", "parallel"):
        browser.execute_script(f"document.querySelector('[data-kind={kind}]').click()")
        wait(browser, f"byId('plot').data?.[0]?.type === '{'scatter3d' if kind == 'three' else 'parcoords'}'")
    assert browser.execute_script("return byId('plot').data[0].dimensions[0].constraintrange !== undefined")
    # A brush along the second axis: as the figure tells of it.
    high = float(sorted(front.objectives[:, 1])[2])
    brush = "Plotly.restyle('plot', {'dimensions[0].constraintrange': [null], 'dimensions[1].constraintrange': [[[-1e9, arguments[0]]]]})"
    browser.execute_script(brush, high)
    wait(browser, "document.querySelectorAll('#table tbody tr').length === 3")
    browser.find_element("xpath", "//button[text()='Any values']").click()
    assert browser.execute_script("return document.querySelectorAll('#table tbody tr').length") == 6
    assert errors(browser) == []


def study_like(runs: int, points: int) -> bytes:
    """The page of a comparison of so many runs."""
    front = flights(points)
    samples = samples_of([front] * runs)
    packed = pages.packed(details(front, samples))
    told = [run_data(front, f"solver {k % 4}", k // 4 + 1, str(k)) for k in range(runs)]
    comparison = {"name": "many", "goals": goals_data(front.goals), "solvers": [f"solver {k}" for k in range(4)], "runs": told}
    progress = {"total": runs, "finished": runs, "failed": 0, "cells": [], "failures": []}
    data = {"title": "many", "kind": "study", "comparisons": [comparison], "progress": progress}
    return pages.page(data, {str(k): packed for k in range(runs)})


def package_alone() -> bytes:
    """A page with nothing but a figure of three points, and the drawing package as it comes."""
    from plotly.offline import get_plotlyjs

    draw = "Plotly.newPlot('plot', [{ x: [1, 2, 3], y: [1, 2, 3] }]).then(() => { document.documentElement.dataset.ready = 'yes'; });"
    body = f'<div id="plot"></div><script>{get_plotlyjs()}</script><script>{draw}</script>'
    return f'<!DOCTYPE html><html><head><meta charset="utf-8"></head><body>{body}</body></html>'.encode()


@pytest.mark.slow
def test_a_hundred_runs_of_a_hundred_points_open_with_the_work_of_the_drawing_package(tmp_path):
    contents = {"package alone": package_alone(), "10 points": front_page(flights(10)), "10 000 points": study_like(100, 100)}
    assert len(contents["10 000 points"]) < 15e6
    path, work = tmp_path / "page.html", dict.fromkeys(contents, float("inf"))

    def is_quick() -> bool:
        # 0.95, was 0.85: the trajectory of the knee, four figures more, is drawn at once.
        return work["10 000 points"] < 1.25 * work["package alone"] and work["10 points"] < 0.95 * work["package alone"]

    for _ in range(3):  # side by side: the least of each is what its page costs, whatever else the machine does
        for name, content in contents.items():
            path.write_bytes(content)
            work[name] = min(work[name], work_of(path, READY))
        if is_quick():
            break
    # Two seconds are asked for: on two idle cores it took 1.2 s with this work. On a busy machine seconds say nothing of the page.
    assert is_quick(), work


@pytest.mark.slow
def test_without_the_drawing_package_there_are_the_table_and_a_word(browser, tmp_path):
    path = tmp_path / "page.html"
    path.write_bytes(front_page(flights(3)).replace(b"'unsafe-eval' blob:;", b"'unsafe-eval';"))
    browser.get(path.as_uri())
    wait(browser, "byId('plot-note').textContent.includes('cannot be read')")
    browser.execute_script("select(state.points[1].key)")
    wait(browser, "byId('flights-note').textContent.includes('Point 1')")
    assert browser.execute_script("return document.querySelectorAll('#table tbody tr').length") == 3
    assert ["Content Security Policy" in one for one in errors(browser)] == [True]
