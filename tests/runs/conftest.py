from __future__ import annotations

import pytest
from chromium import started


@pytest.fixture(scope="module")
def browser():
    """Headless Chromium."""
    driver = started()
    yield driver
    driver.quit()
