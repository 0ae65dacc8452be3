import os
import signal
import threading
import time
from pathlib import Path

import pytest

pytest.importorskip("distributed")

from kills import running_cluster
from test_study import Inline, numbers, slow, stamps, wait_for

from runs.batch.running import WorkersLost
from runs.cli import main
from runs.execution.processes import cluster


@pytest.fixture
def scheduler():
    """A scheduler and two workers, processes of their own; with their address."""
    with running_cluster() as made:
        yield made.address, [made.scheduler, *made.workers]


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_gives_the_same_numbers(scheduler, tmp_path):
    address, (_, first, _) = scheduler

    def kill():
        wait_for(lambda: len(stamps(tmp_path)) >= 1)
        os.kill(first.pid, signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    with cluster(address) as executor:
        summary = slow(8).run(tmp_path / "out", executor=executor)
    killer.join()
    assert summary.finished == 8 and first.wait(timeout=5) == -signal.SIGKILL
    assert numbers(summary) == numbers(slow(8).run(tmp_path / "here", executor=Inline()))


@pytest.mark.slow
def test_a_scheduler_that_is_killed_loses_nothing_that_is_finished(scheduler, tmp_path):
    address, (main_process, *_) = scheduler

    def kill():
        wait_for(lambda: len(stamps(tmp_path)) >= 1)
        main_process.kill()

    killer = threading.Thread(target=kill)
    killer.start()
    began = time.monotonic()
    with pytest.raises(WorkersLost, match="the same command continues with them"), cluster(address) as executor:
        slow(8).run(tmp_path / "out", executor=executor)
    killer.join()
    assert time.monotonic() - began < 90
    before = stamps(tmp_path)
    assert before
    assert slow(8).run(tmp_path / "out", executor=Inline()).finished == 8 and before.items() <= stamps(tmp_path).items()


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "127.0.0.1:notaport"])
def test_an_address_that_nobody_answers_is_one_line_within_seconds(tmp_path, monkeypatch, capfd, address):
    monkeypatch.chdir(tmp_path)
    began = time.monotonic()
    assert main(["study", "run", "goddard-table3", "--dask", address]) == 2
    assert time.monotonic() - began < 20
    said = capfd.readouterr()
    assert said.err.count("\n") == 1 and address in said.err and not Path("out").exists()
