"""Headless Chromium for tests: whether there is one, and questions to a page in it."""

import shutil
import time
from pathlib import Path

import pytest

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")
NEEDS_CHROMIUM = [
    pytest.mark.skipif(
        not (BROWSER and DRIVER), reason="there is no Chromium with its driver on this machine: apt-get install chromium-driver"
    ),
    pytest.mark.xdist_group("chromium"),
]


def started(webgl: bool = True):
    """A browser; to be quit by the caller. WebGL needs a graphics card, here an emulated one, which takes 100 ms to paint a page; without
    it Chromium paints by its own means, as on a machine without such a card."""
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    graphics = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader") if webgl else ("--disable-gpu",)
    for word in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--window-size=1300,1000", *graphics):
        options.add_argument(word)
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


READY = "document.documentElement.dataset.ready === 'yes'"
"""The figures of a page are there."""


def opened(browser, address: str) -> None:
    """Open a page."""
    browser.get(address)
    wait(browser, READY)


def errors(browser) -> list[str]:
    """What the console has, but for remarks of the driver on software rendering."""
    return [one["message"] for one in browser.get_log("browser") if one["level"] == "SEVERE" or "Violation" in one["message"]]


def work_of(page: Path, ready: str) -> float:
    """Seconds of processor time that the main thread of a new browser, which has compiled nothing yet, works until a condition in a page
    holds and the page is drawn."""
    browser = started()
    try:
        browser.get("about:blank")
        time.sleep(1.0)  # the browser ends its own start
        browser.execute_cdp_cmd("Performance.enable", {"timeDomain": "threadTicks"})
        browser.get(page.as_uri())
        wait(browser, ready)
        time.sleep(0.5)  # what is drawn in later frames
        assert errors(browser) == []
        metrics = browser.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]
    finally:
        browser.quit()
    return next(one["value"] for one in metrics if one["name"] == "TaskDuration")
