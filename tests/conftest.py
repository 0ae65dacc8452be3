"""What all tests share."""

import sys

import pytest
from hypothesis import settings

# How long an example takes says nothing of what it does: machines are noisy.
settings.register_profile("macs", deadline=None)
settings.load_profile("macs")


@pytest.fixture(autouse=True)
def close_figures():
    """A figure that a test leaves open would be one of the next test's, too."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
