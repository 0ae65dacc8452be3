"""Kills at random times: whatever is resumed has the same numbers."""

import shutil
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from kills import fronts, interrupted, interrupted_once, kill_solves, study


@pytest.mark.slow
def test_solves_that_are_killed_at_random_times_have_the_same_bits():
    assert kill_solves(6, np.random.default_rng(1)) >= 6


def test_a_killed_child_is_counted_and_what_fails_by_itself_is_no_kill():
    rng = np.random.default_rng(0)
    assert interrupted(lambda: None, 3, 1e5, rng) == 0
    with pytest.raises(AssertionError, match="ended with 1"):
        interrupted(lambda: 1 / 0, 3, 1e5, rng)


class KilledStudy(RuleBasedStateMachine):
    """A study under kills, new calls, and calls with fewer runs, in any order."""

    expected: dict[int, tuple[bytes, bytes]] = {}  # noqa: RUF012

    @initialize()
    def begin(self) -> None:
        self.folder = Path(tempfile.mkdtemp())
        self.out, self.stamps = self.folder / "out", dict[Path, int]()
        if not KilledStudy.expected:
            KilledStudy.expected = fronts(study().run(self.folder / "uninterrupted", jobs=2))

    @rule(seed=st.integers(0, 2**31))
    def kill(self, seed: int) -> None:
        interrupted_once(self.out, np.random.default_rng(seed))

    @precondition(lambda self: self.out.exists())
    @rule()
    def finish(self) -> None:
        assert fronts(study().run(self.out, jobs=2)) == self.expected

    @invariant()
    def nothing_finished_is_written_again_or_wrong(self) -> None:
        if not self.out.exists():
            return
        stamps = {path: path.stat().st_mtime_ns for path in self.out.rglob("*.nc")}
        assert self.stamps.items() <= stamps.items()
        self.stamps = stamps
        if (self.out / "study.json").exists():
            assert fronts(study().status(self.out)).items() <= self.expected.items()

    def teardown(self) -> None:
        if hasattr(self, "folder"):
            shutil.rmtree(self.folder, ignore_errors=True)


TestKilledStudy = KilledStudy.TestCase
TestKilledStudy.settings = settings(
    max_examples=3, stateful_step_count=5, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck)
)
TestKilledStudy = pytest.mark.slow(TestKilledStudy)
