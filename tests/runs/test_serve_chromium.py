"""Live pages in headless Chromium: they follow a study, keep what their reader has chosen, and outlive their server."""

import threading
import time

import pytest
from chromium import NEEDS_CHROMIUM, errors, opened, wait
from misbehaving import Crashing, Gated, Plain, glide
from test_serve import process, served, study
from test_study import Inline

from runs import Study

pytest.importorskip("plotly")
webdriver = pytest.importorskip("selenium.webdriver")
pytestmark = NEEDS_CHROMIUM


def others(browser) -> list[str]:
    """Errors but that the server cannot be reached, once it has ended."""
    return [one for one in errors(browser) if "ERR_" not in one]


def seen(browser, place: str) -> None:
    """Turn to a figure, which is drawn once it is seen."""
    browser.execute_script(f"document.querySelector('{place}').scrollIntoView()")
    wait(browser, f"document.querySelector('{place}').data")


def text(browser, place: str) -> str:
    return browser.execute_script(f"return byId('{place}').textContent")


def test_a_page_follows_a_study_and_keeps_what_was_chosen(browser, tmp_path):
    out = tmp_path / "out"
    study().run(out, executor=Inline())
    with served(out, trust=True) as client:
        opened(browser, client.server.url)
        wait(browser, "state.points.length > 0 && byId('headline').textContent.startsWith('1 of 2 runs finished, 1 failed')")
        before = browser.execute_script("return state.points.length")
        # A zoom, a selection, a kept point, a range, an unfolded failure, and the focus on a row of the table.
        browser.execute_script(
            """
            select(state.points[1].key); keep(state.points[0].key, true); setRange(0, [-1, 1e9]);
            document.querySelector('#progress-failures details').open = true;
            """
        )
        wait(browser, "byId('flights').dataset.drawn?.split(' ').length === 2")
        browser.execute_script("return Plotly.relayout('plot', {'xaxis.range': [1.5, 2.5], 'yaxis.range': [2, 4]})")
        browser.execute_script("document.querySelectorAll('#table tbody tr')[1].focus()")
        browser.execute_script("document.querySelector('.panel-plot').dataset.same = 'yes'")
        row = browser.execute_script("return document.activeElement.dataset.key")
        study(runs=3).run(out, executor=Inline())
        wait(browser, f"state.points.length > {before} && byId('headline').textContent.startsWith('3 of 6 runs finished, 3 failed')")
        wait(browser, "state.comparison.attainment && byId('attainment')")
        seen(browser, "#attainment")
        assert browser.execute_script("return [selectedPoint().index, state.kept.length, state.ranges[0][1]]") == [1, 1, 1e9]
        assert browser.execute_script("return [...byId('plot').layout.xaxis.range, ...byId('plot').layout.yaxis.range]") == [1.5, 2.5, 2, 4]
        assert browser.execute_script("return document.activeElement.dataset.key") == row
        assert browser.execute_script("return document.querySelector('.panel-plot').dataset.same") == "yes"  # not drawn again
        opens = "return [...document.querySelectorAll('#progress-failures details')].map((one) => one.open)"
        wait(browser, "document.querySelectorAll('#progress-failures details').length === 3")
        assert browser.execute_script(opens) == [True, False, False]
        assert "3 of 6 runs finished, 3 failed" in text(browser, "announcements")
        assert "the root of all evil" in text(browser, "progress-failures")
        wait(browser, "byId('study-note').textContent.startsWith('Of 3 of 3')")
        # Where nothing changes, nothing is loaded again.
        browser.execute_script("performance.clearResourceTimings()")
        wait(browser, "performance.getEntriesByType('resource').length >= 3")
        asked = browser.execute_script("return performance.getEntriesByType('resource').map((one) => new URL(one.name).pathname)")
        assert set(asked) == {"/status.json"}
    assert others(browser) == []


@pytest.mark.slow
def test_texts_of_users_stay_texts_in_a_live_page(browser, tmp_path):
    evil = "<img src=x onerror=alert(1)>"
    solvers = {evil: Plain(), f"{evil} broken": Crashing()}
    Study(evil.replace("/", ""), problems={evil: glide()}, solvers=solvers, evaluations=60, runs=1, seed=1).run(
        tmp_path / "out", executor=Inline()
    )
    with served(tmp_path / "out", trust=True) as client:
        opened(browser, client.server.url)
        wait(browser, "document.querySelectorAll('#progress-failures details').length === 1 && state.comparison.tables")
        assert browser.execute_script("return document.querySelectorAll('img').length") == 0
        assert evil in text(browser, "progress-cells") and evil in text(browser, "title") and evil in text(browser, "study-tables")
    assert others(browser) == []


@pytest.mark.slow
def test_a_study_that_really_runs_is_seen_from_its_beginning_to_its_end(browser, tmp_path):
    gate = tmp_path / "gate"
    solvers = {"gated": Gated(gate=str(gate)), "broken": Crashing()}
    stated = Study("gated", problems={"glide": glide()}, solvers=solvers, evaluations=400, runs=3, seed=1)
    runner = threading.Thread(target=lambda: stated.run(tmp_path / "out", jobs=2))
    runner.start()
    while not (tmp_path / "out" / "study.json").exists():
        time.sleep(0.01)
    with process(str(tmp_path / "out"), "--port", "0", "--trust") as (server, said):
        port = said.split("http://127.0.0.1:")[1].split("/")[0]
        opened(browser, f"http://127.0.0.1:{port}/")
        wait(browser, "document.querySelectorAll('.going tbody tr').length > 0")
        wait(browser, "byId('plot').data?.some((one) => one.meta === 'going' && one.x.length)")  # points so far, as crosses
        server.kill()
        server.wait()
        wait(browser, "byId('trouble').textContent.includes('has not answered since')")
        gate.touch()  # the study goes on, and ends, without it
        runner.join()
        with process(str(tmp_path / "out"), "--port", port, "--trust"):
            wait(browser, "byId('trouble').hidden")
            wait(browser, "byId('headline').textContent.startsWith('3 of 6 runs finished, 3 failed')")
            wait(browser, "byId('progress-line').textContent.includes('has ended')")
            wait(browser, "state.comparison.tables?.length && byId('study-note').textContent.startsWith('Of 3 of 3')")
            assert browser.execute_script("return byId('plot').data.some((one) => one.meta === 'going')") is False
            browser.execute_script("document.querySelector('#table tbody tr').click()")
            wait(browser, "byId('flights').dataset.drawn === state.selected")
    assert others(browser) == []
