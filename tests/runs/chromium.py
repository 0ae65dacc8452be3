"""Headless Chromium for tests: whether there is one, and questions to a page in it."""

from __future__ import annotations

import json
import shutil
import time
from pathlib import Path
from urllib.request import urlopen

import pytest

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")
NEEDS_CHROMIUM = [
    pytest.mark.skipif(
        not (BROWSER and DRIVER), reason="there is no Chromium with its driver on this machine: apt-get install chromium-driver"
    ),
    pytest.mark.xdist_group("chromium"),
]


def started():
    """A browser; to be quit by the caller."""
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    for word in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--window-size=1300,1000", "--use-angle=swiftshader"):
        options.add_argument(word)
    options.add_argument("--enable-unsafe-swiftshader")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    driver.set_script_timeout(30)
    return driver


def wait(browser, condition: str) -> None:
    """Until a condition in the page holds."""
    for _ in range(600):
        if browser.execute_script(f"return Boolean({condition})"):
            return
        time.sleep(0.05)
    raise AssertionError(f"not within 30 s: {condition}")


def errors(browser) -> list[str]:
    """What the console has, but for remarks of the driver on software rendering."""
    return [one["message"] for one in browser.get_log("browser") if one["level"] == "SEVERE" or "Violation" in one["message"]]


def opened_alone(page: Path, settled: float = 1.0) -> tuple[float, float, list[str]]:
    """Open a page in a new browser as its readers do: nothing listens to it meanwhile.

    A driver listens to the console. Each error that a script throws then has the browser read that script again for the lines of its trace:
    of the drawing package this takes half a second that no reader waits for. The browser has `settled` seconds to end its own start.
    Returns the seconds until the page says that its figures are there, the seconds of processor time of its main thread until it has been
    read and drawn, and the errors that it has thrown and not caught.
    """
    import websocket

    marks = """
        window.marks = { errors: [] };
        new MutationObserver(() => { window.marks.ready ??= performance.now(); })
            .observe(document, { subtree: true, attributes: true, attributeFilter: ["data-ready"] });
        addEventListener("load", () => { window.marks.loaded = true; });
        addEventListener("error", (event) => window.marks.errors.push(event.message));
        addEventListener("unhandledrejection", (event) => window.marks.errors.push(String(event.reason)));
        """
    browser = started()
    try:
        with urlopen(f"http://{browser.capabilities['goog:chromeOptions']['debuggerAddress']}/json/version") as answer:
            connection = websocket.create_connection(json.load(answer)["webSocketDebuggerUrl"], suppress_origin=True, timeout=60)

        def ask(method: str, session: str | None = None, **parameters):
            message = {"id": 1, "method": method, "params": parameters} | ({"sessionId": session} if session else {})
            connection.send(json.dumps(message))
            while "id" not in (answer := json.loads(connection.recv())):
                pass  # events
            return answer["result"]

        def value(expression: str):
            return ask("Runtime.evaluate", session, expression=expression, returnByValue=True)["result"].get("value")

        target = ask("Target.createTarget", url="about:blank", newWindow=True)["targetId"]
        session = ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        ask("Page.enable", session)
        ask("Performance.enable", session, timeDomain="threadTicks")
        ask("Page.addScriptToEvaluateOnNewDocument", session, source=marks)
        time.sleep(settled)
        ask("Page.navigate", session, url=page.as_uri())
        for _ in range(600):
            if value("Boolean(window.marks?.ready && window.marks.loaded)"):
                break
            time.sleep(0.1)
        time.sleep(0.5)  # what is drawn in later frames
        seconds, errors = value("[window.marks.ready / 1000, window.marks.errors]")
        work = next(one["value"] for one in ask("Performance.getMetrics", session)["metrics"] if one["name"] == "TaskDuration")
        connection.close()
    finally:
        browser.quit()
    return seconds, work, errors
