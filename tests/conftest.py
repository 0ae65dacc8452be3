"""What all tests share."""

import os
import signal
import sys

import pytest
from hypothesis import settings

# Numpy is not imported yet. Each worker has one core, and threads for small matrices take more time than they save.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

# A shell that starts the tests in the background makes them ignore Ctrl-C, which some of them are about.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# How long an example takes says nothing of what it does: machines are noisy. Most properties are of pure functions of few numbers.
settings.register_profile("macs", deadline=None, max_examples=50)
settings.load_profile("macs")

LONGEST = (
    "test_every_point_of_a_front_flown_again",
    "test_points_that_the_default_search_calls_verified_are_right",
    "test_goddard_on_the_papers_mesh",
    "test_the_two_step_design_is_dominated",
    "test_with_gradients_the_front_is_as_exact_as_its_mesh",
    "test_the_ends_of_the_skips_front_fly",
)
"""Tests of minutes: they begin first, so that no worker waits in the end for another one's."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the longest tests first; with `--dist loadgroup` those that share a fixture of their module stay together: it is made once."""
    places = {name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: places.get(item.name.partition("[")[0], len(LONGEST)))
    for item in items:
        if isinstance(item, pytest.Function):
            fixtures = item._fixtureinfo.name2fixturedefs.values()
            if any(definitions[-1].scope == "module" for definitions in fixtures):
                item.add_marker(pytest.mark.xdist_group(item.path.stem))


@pytest.fixture(autouse=True)
def close_figures():
    """A figure that a test leaves open would be one of the next test's, too."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
