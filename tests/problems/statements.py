"""What the tests of statements share."""

import pytest

from problems import Phase, Problem

NAN, INF = float("nan"), float("inf")


def glider(**times) -> tuple[Problem, Phase]:
    problem = Problem("glider")
    phase = problem.phase("descent", **({"t0": 0.0, "tf": (1.0, 2.0)} | times))
    phase.state("height", bounds=(0, 10), initial=5)
    phase.control("flap", bounds=(-1, 1))
    phase.dynamics(height=-phase["flap"])
    problem.minimize("time", phase.tf)
    return problem, phase


def bare() -> tuple[Problem, Phase]:
    problem = Problem("glider")
    return problem, problem.phase("descent", t0=0, tf=1)


def refused(action, *words: str) -> None:
    """The call raises a ValueError on one line that quotes the words."""
    with pytest.raises(ValueError) as caught:
        action()
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message, f"'{word}' is missing from: {message}"
