"""Pages in headless Chromium: clicks, keys, ranges, no error on the console, and how quickly a large study opens.

Skipped where there is no Chromium with its driver (Debian: chromium, chromium-driver).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from chromium import NEEDS_CHROMIUM, errors, started, wait
from synthetic_fronts import black_box, flights, marked

from runs.browser import page as pages
from runs.browser.curves import differences
from runs.browser.front_page import front_page
from runs.browser.points import about, columns, details, goals_data, samples_of

pytest.importorskip("plotly")
webdriver = pytest.importorskip("selenium.webdriver")
pytestmark = NEEDS_CHROMIUM


def opened(browser, tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "page.html"
    path.write_bytes(content)
    browser.get(path.as_uri())
    wait(browser, "document.documentElement.dataset.ready === 'yes'")


def test_a_click_selects_a_point_and_shows_its_trajectory(browser, tmp_path):
    front = marked(flights(5), [True, False, True, True, True])
    opened(browser, tmp_path, front_page(front))
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


@pytest.mark.slow
def test_points_that_are_not_verified_are_hollow_and_named(browser, tmp_path):
    opened(browser, tmp_path, front_page(marked(flights(5), [True, False, True, True, False])))
    symbols = browser.execute_script("return byId('plot').data.map((one) => [one.marker.symbol, one.x.length])")
    assert symbols == [["circle", 3], ["circle-open", 2]]
    assert browser.execute_script("return document.querySelectorAll('tr.unverified .badge').length") == 2


@pytest.mark.slow
def test_rows_are_reached_and_selected_by_keys_and_sorted_by_titles(browser, tmp_path):
    from selenium.webdriver.common.keys import Keys

    front = flights(5)
    opened(browser, tmp_path, front_page(front))
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
    opened(browser, tmp_path, front_page(front))
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


@pytest.mark.slow
def test_a_rectangle_in_the_figure_marks_ranges(browser, tmp_path):
    opened(browser, tmp_path, front_page(flights(8)))
    x, y, width, height = browser.execute_script(
        "const r = document.querySelector('#plot .nsewdrag').getBoundingClientRect(); return [r.x, r.y, r.width, r.height]"
    )
    actions = webdriver.ActionChains(browser)
    pointer = actions.w3c_actions.pointer_action
    pointer.move_to_location(int(x + 2), int(y + 2)).pointer_down()
    pointer.move_to_location(int(x + width / 4), int(y + height / 2)).move_to_location(int(x + width / 2), int(y + height - 2)).pointer_up()
    actions.perform()
    wait(browser, "state.ranges.every(Boolean)")
    wanted = browser.execute_script("return [wantedPoints().length, state.points.length]")
    assert 0 < wanted[0] < wanted[1]
    assert errors(browser) == []


def study_like(runs: int, points: int) -> bytes:
    """The page of a comparison of so many runs."""
    front = flights(points)
    samples = samples_of([front] * runs)
    packed = pages.packed(details(front, samples))
    told = [
        {"solver": f"solver {k % 4}", "number": k // 4 + 1, "block": str(k), "points": columns(front), "about": about(front)}
        for k in range(runs)
    ]
    comparison = {"name": "many", "goals": goals_data(front.goals), "solvers": [f"solver {k}" for k in range(4)], "runs": told}
    progress = {"total": runs, "finished": runs, "failed": 0, "cells": [], "failures": []}
    data = {"title": "many", "kind": "study", "comparisons": [comparison], "progress": progress}
    return pages.page(data, {str(k): packed for k in range(runs)})


@pytest.mark.slow
def test_a_hundred_runs_of_a_hundred_points_open_in_two_seconds(tmp_path):
    pages_of = {"few": front_page(flights(10)), "many": study_like(100, 100)}
    seconds: dict[str, list[float]] = {"few": [], "many": []}
    worked: dict[str, list[float]] = {"few": [], "many": []}
    for _ in range(2):
        for name, content in pages_of.items():
            browser = started()  # a new one, as it keeps what it has compiled
            try:
                browser.execute_cdp_cmd("Performance.enable", {"timeDomain": "threadTicks"})
                opened(browser, tmp_path, content)
                seconds[name].append(browser.execute_script("return performance.now()") / 1000)
                measured = browser.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]
                worked[name].append(next(one["value"] for one in measured if one["name"] == "TaskDuration"))
                assert browser.execute_script("return state.points.length") == {"few": 10, "many": 10_000}[name]
                assert errors(browser) == []
            finally:
                browser.quit()
    # Two seconds, or on a machine that others work on at most twice the work of a page of ten points, most of which is to read the
    # drawing package.
    assert min(seconds["many"]) < 2.0 or min(worked["many"]) < 2.0 * min(worked["few"]), (seconds, worked)
    few, many = ([min(measured[name]) for measured in (seconds, worked)] for name in pages_of)
    print(f"10 points: {few[0]:.2f} s, {few[1]:.2f} s of work; 10 000: {many[0]:.2f} s, {many[1]:.2f} s")


@pytest.mark.slow
def test_figures_that_were_never_seen_are_printed(browser, tmp_path):
    opened(browser, tmp_path, front_page(flights(3)))
    browser.execute_script("window.scrollTo(0, 0); document.body.style.paddingTop = '9000px'; select(state.points[0].key)")
    wait(browser, "byId('flights').dataset.drawn === state.selected")
    drawn = "return [...document.querySelectorAll('.panel-plot')].filter((one) => one.data).length"
    assert browser.execute_script(drawn) == 0
    browser.execute_cdp_cmd("Page.printToPDF", {})
    assert browser.execute_script(drawn) == browser.execute_script("return document.querySelectorAll('.panel-plot').length") > 0
