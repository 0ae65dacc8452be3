"""The benchmark of growth on tiny sizes: what it measures, fits and says; never how fast anything is."""

from __future__ import annotations

import json
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

from runs.bench import command, scale
from runs.bench.measured import Row
from runs.bench.scale import child, generation, growth
from runs.bench.scale.chains import masses, ride
from runs.bench.scale.series import SERIES
from runs.cli import main

TINY = {"elements": (4, 8, 12), "nodes": (4, 8, 12), "intervals": (4, 8, 12), "phases": (1, 2, 3), "masses": (1, 2, 3)}
TINY |= {"points": (2, 3, 4), "agents": (4, 6, 8)}
FEW = tuple(replace(one, quick=TINY[one.unit]) for one in SERIES if one.name == "set-up, single shooting")


@pytest.mark.parametrize("one", SERIES, ids=lambda one: one.name)
def test_every_series_does_its_work(one):
    for size in TINY[one.unit][:2]:
        assert one.prepare(size)() is not None
    for sizes in (one.sizes, one.quick):
        assert not sizes or (len(sizes) >= growth.FITTED and (np.diff(sizes) > 0).all())


def test_problems_have_the_size_that_is_asked_for():
    assert len(ride(3).compile().phases) == 3 and len(ride(3).compile().links) == 2
    assert len(masses(3).compile().phases[0].states) == 6


def test_exponents_are_those_of_powers():
    sizes = np.array([10.0, 20.0, 40.0])
    assert growth.exponent(sizes, 3.0 * sizes**1.5) == pytest.approx(1.5)
    row = Row("work", "things")
    growth.add_round(row, (5, 10, 20, 40), [(5, 9.0, 0.0), (10, 1.0, 20.0), (20, 2.0, 40.0), (40, 4.0, 80.0)])
    assert row.of("time") == pytest.approx(1.0) and row.of("memory") == pytest.approx(1.0) and row.of("size") == 40
    growth.add_round(row, (10, 20, 40), [(10, 1.0, 1.0), (20, 2.0, 2.0), (40, 4.0, 4.0)])
    assert len(row.values["time"]) == 2 and len(row.values["memory"]) == 1  # a few MB say nothing


def test_of_repetitions_the_quickest_counts_and_the_first_peak():
    row = Row("work", "things")
    first, again = [(10, 2.0, 20.0), (20, 4.0, 40.0), (40, 4.0, 80.0)], [(10, 1.0, 80.0), (20, 2.0, 80.0), (40, 9.0, 80.0)]
    growth.add_round(row, (10, 20, 40), [*first, *again])
    assert row.of("time") == pytest.approx(1.0) and row.of("memory") == pytest.approx(1.0) and row.of("seconds at 40") == 4.0
    growth.add_round(row, (10, 20, 40), first[:2])
    assert row.values["unfinished"] == [1.0] and len(row.values["time"]) == 1


def test_what_grows_faster_than_asked_is_named():
    rows = [
        Row("first", "nodes", {"time": [1.0, 1.05, 3.0], "memory": [1.0]}),
        Row("second", "nodes", {"time": [1.9, 2.0, 2.1]}),
        Row("third", "points", {"time": [0.5], "memory": [1.5]}),
        Row("fourth", "points", {"unfinished": [1.0]}),
    ]
    assert all(one.met for one in scale.targets(rows[:1]))
    found = [("2.00 (second)", False), ("1.50 (third)", False), ("fourth", False)]
    assert [(one.measured, one.met) for one in scale.targets(rows)] == found
    assert all(len(line) <= 140 for line in scale.report(rows).splitlines())
    assert "MISSED" in scale.report(rows) and "MISSED" not in scale.report(rows[:1])


def test_a_repetition_is_prepared_anew_and_all_sizes_come_before_the_next(capsys):
    made = []

    def prepare(size):
        made.append(size)
        return lambda: None

    one = replace(SERIES[0], prepare=prepare)
    child.measure(one, (7, 8), 3)
    assert made == [7, 7, 8, 7, 8, 7, 8]
    assert [json.loads(line)[:2] for line in capsys.readouterr().out.splitlines()] == [[one.name, size] for size in made[1:]]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="processes are forked")
def test_the_command(capsys, monkeypatch):
    """Tiny sizes in processes of their own; the exit code follows the exponents."""
    monkeypatch.setattr(growth.bench_scale, "__defaults__", (FEW,))
    monkeypatch.setattr(growth, "ASKED", 99.0)
    assert main(["bench", "scale", "--quick"]) == 0
    text = capsys.readouterr().out
    assert "GROWTH" in text and all(one.name in text for one in FEW) and "met" in text
    monkeypatch.setattr(growth, "ASKED", -99.0)
    assert main(["bench", "scale", "--quick"]) == 1
    assert "MISSED" in capsys.readouterr().out
    assert "scale" in command.KINDS


@pytest.mark.slow
def test_generations_grow_as_their_work_does():
    def prepare(size: int):
        def run(generations: int) -> None:
            began = time.process_time()
            while time.process_time() - began < 5e-6 * size * size * generations:
                pass

        return run

    quadratic = generation.Growing("quadratic", "things", "Np^2", 2, prepare, (), (20, 40, 80))
    rows: list[Row] = []
    generation.bench_generation(rows, generation.Effort(rounds=1, quick=True), [quadratic])
    assert rows[0].of("exponent") == pytest.approx(2.0, abs=0.2) and rows[0].of("seconds") == pytest.approx(5e-6 * 6400, rel=0.2)
    wrong = Row("re-entry, 120 individuals", "nodes", {"exponent": [0.9, 1.3, 1.4]})
    right = Row("re-entry, 200 nodes", "individuals", {"exponent": [0.9, 1.3, 1.4]})
    assert [one.met for one in generation.targets([wrong, right])] == [False, True]
    assert "quadratic" in generation.report(rows) and "section IV-D" in generation.report(rows)


@pytest.mark.parametrize("one", generation.SERIES, ids=lambda one: one.name)
def test_each_series_of_generations_runs(one):
    one.prepare(one.quick[0])(2)


def test_the_ride_has_the_limits_that_are_asked_for():
    assert [len(generation.limited(count).compile().phases[0].paths) for count in (3, 6)] == [3, 6]
