"""What benchmarks ask is judged by medians, and the exit code of `macs bench` is 1 where it is missed."""

from __future__ import annotations

from dataclasses import replace

import pytest

from runs.bench import Effort, command, fronts, inner, passages, peers, population, prefer, search, standard, study
from runs.bench.command import BENCHMARKS
from runs.bench.fronts import contest
from runs.bench.functions import NAMES
from runs.bench.measured import Row, Target, verdicts
from runs.cli import main

AROUND = (0.5, 1.0, 3.0)
"""Of which the best, the worst and the mean would say something else than the median, 1."""


def times(limit: float) -> list[float]:
    """Values with this median."""
    return [limit * one for one in AROUND]


def a_study(speed: float, beyond: float) -> list[Row]:
    return [
        Row("goddard", study.ONE, {"speed": [1.0], "beyond": times(beyond)}),
        Row("goddard", study.TWO, {"speed": times(speed), "beyond": [0.5], "work": [1.0], "seconds": [1.0]}),
        Row(study.LIMIT, study.TWO, {"speed": [2.0]}),
    ]


def an_inner(speed: float, moved: float, converged: float) -> list[Row]:
    case, seconds = "goddard, warm", {"seconds": [1.0, 1.0, 1.0], "off, median": [0.0], "off, largest": [0.0]}
    shared = {**seconds, "iterations": [1.0], "fallbacks": [0.0]}
    return [
        Row(case, inner.BASELINE, {**shared, "speed": [1.0] * 3, "moved": [0.3], "converged": [0.9, 1.0, 1.0]}),
        Row(case, inner.PROJECTION, {**shared, "speed": [2.0] * 3, "moved": [0.05], "converged": [1.0]}),
        Row(case, inner.DEFAULT, {**shared, "speed": times(speed), "moved": times(moved), "converged": [converged, 1.0, 1.0]}),
    ]


def a_front(ratio: float, good: float) -> list[Row]:
    shared = {"volume": [1.0], "evaluations": [1.0], "gradient_solves": [1.0], "seconds": [1.0]}
    ours = Row("goddard", contest.OURS, {**shared, "ratio": [1.0], "good": [1.0]})
    others = [Row("goddard", who, {**shared, "ratio": times(ratio), "good": [good] * 3}) for who in (contest.PROPAGATE, contest.PROJECTION)]
    return [ours, *others, *(Row("goddard", who, {**shared, "ratio": [0.5], "good": [1.0]}) for who in (contest.SWEEP, contest.SWEEPS))]


def a_search(ratio: float) -> list[Row]:
    shared = {"gd": [0.1], "igd": [0.1], "gradient_solves": [1.0], "seconds": [1.0]}
    ours = Row("landing_site", search.OURS, {**shared, "ratio": times(ratio), "evaluations": [20_000.0]})
    return [ours, Row("landing_site", search.THEIRS, {**shared, "ratio": [1.0], "evaluations": [0.0]})]


def a_peer(ratio: float, optima: int) -> list[Row]:
    ours = Row("isoperimetric", peers.OURS, {"seconds": [0.5] * 3, "optimum": [0.0796] * optima, "ratio": [ratio]})
    return [ours, Row("isoperimetric", peers.YAPSS, {"seconds": [0.5], "optimum": [0.0796], "ratio": [1.0]})]


def a_guided(ratio: float) -> list[Row]:
    shared = {name: [1.0] for name in ("missing", "worse", "inside", "points", "part", "evaluations", "gradient_solves", "seconds")}
    return [Row("zdt1", prefer.EVEN, {**shared, "ratio": [1.0]}), Row("zdt1", prefer.GUIDED, {**shared, "ratio": times(ratio)})]


def a_passage(speed: float, table: float) -> list[Row]:
    shared = {"microseconds": [1.0], "error": [1e-9]}
    return [
        Row("passages", who, {**shared, "speed": times(value)})
        for who, value in {passages.AGAINST: 1.0, passages.SINGLY: speed, passages.TABLE: table}.items()
    ]


def a_population(speed: float) -> list[Row]:
    found = {population.SINGLY: [1.0] * 3, population.TOGETHER: times(speed), population.COMPILED: times(1.0)}
    return [Row("reentry_case1", who, {"speed": values, "candidates": [5000.0]}) for who, values in found.items()]


def a_generation(power: float) -> list[Row]:
    return [Row("re-entry, 120 individuals", "nodes", {"size": [800.0], "seconds": [1.0], "exponent": times(power)})]


def optima(*kinds: str, memory: float = 100.0) -> list[Row]:
    return [Row("zermelo", who, {"memory": [memory], "published": [1.0]}) for who in kinds]


MET_AND_MISSED = {
    "front": [(a_front(1 / 1.2, 1.0), 0), (a_front(1 / 1.4, 1.0), 1), (a_front(1 / 1.4, 0.0), 0)],
    "generation": [(a_generation(1.15), 0), (a_generation(1.16), 1)],
    "inner": [
        (an_inner(15.0, 0.07, 1.0), 0),
        (an_inner(14.9, 0.07, 1.0), 1),
        (an_inner(15.0, 0.071, 1.0), 1),
        (an_inner(15.0, 0.07, 0.8), 1),
    ],
    "methods": [([Row("zermelo", "agree", {"published": [1.0]})], 0), ([Row("zermelo", "DISAGREE", {"published": [1.0]})], 1)],
    "passages": [(a_passage(5.0, 200.0), 0), (a_passage(4.9, 200.0), 1), (a_passage(5.0, 199.0), 1)],
    "peers": [(a_peer(1.5, 3), 0), (a_peer(1.51, 3), 1), (a_peer(1.0, 2), 1)],
    "population": [(a_population(4.0), 0), (a_population(3.9), 1)],
    "prefer": [(a_guided(0.33), 0), (a_guided(0.34), 1)],
    "scale": [([Row("set-up", "nodes", {"time": times(1.1)})], 0), ([Row("set-up", "nodes", {"time": times(1.11)})], 1)],
    "search": [(a_search(1.01), 0), (a_search(1.009), 1)],
    "standard": [
        (optima(*["right"] * 17, standard.UNVERIFIED), 0),
        (optima(*["right"] * 16, standard.UNVERIFIED, standard.UNVERIFIED), 1),
        (optima(*["right"] * 17, standard.WRONG), 1),
        (optima(*["right"] * 18, memory=1501.0), 1),
    ],
    "study": [(a_study(1.7, 0.05), 0), (a_study(1.69, 0.05), 1), (a_study(1.7, 0.051), 1)],
}
"""Rows, and how many targets they miss."""
CASES = [(kind, rows, missed) for kind, given in MET_AND_MISSED.items() for rows, missed in given]


@pytest.mark.parametrize(("kind", "rows", "missed"), CASES, ids=[f"{kind}-{missed}" for kind, _, missed in CASES])
def test_the_exit_code_follows_the_medians(kind, rows, missed, monkeypatch, capsys):
    monkeypatch.setattr(command, "_run", lambda one, found, effort: found.extend(rows) or False)
    assert main(["bench", kind]) == (1 if missed else 0)
    assert capsys.readouterr().out.count("MISSED") == missed


def test_every_benchmark_that_asks_anything_is_tested():
    assert set(BENCHMARKS) - set(MET_AND_MISSED) - set(NAMES) == {"density"} and BENCHMARKS["density"].targets([]) == []


def test_what_could_not_be_measured_is_missed():
    rows = a_population(4.0)
    rows[1] = replace(rows[1], values={"speed": []})
    assert [one.met for one in population.targets(rows)] == [False]
    assert [one.met for one in fronts.targets(a_front(1 / 1.4, 0.0))] == [True], "no other inner level is as good"


def test_a_search_with_fewer_evaluations_is_not_judged():
    rows = a_search(0.5)
    rows[0].values["evaluations"] = [2000.0]
    assert search.targets(rows) == []


def test_verdicts_are_a_table():
    assert verdicts([]) == []
    lines = verdicts([Target("one", "at most 1", "0.5", True), Target("another one", "none", "two", False)])
    assert lines[2:] == ["one          at most 1  0.5       met", "another one  none       two       MISSED"]


def test_all_that_is_missed_is_named_at_the_end(monkeypatch, capsys):
    found = {"population": a_population(3.9), "study": a_study(1.7, 0.06)}
    monkeypatch.setattr(command, "_run", lambda one, rows, effort: rows.extend(found[one]) or False)
    assert not command.bench(tuple(found), Effort(quick=True), None)
    end = capsys.readouterr().out.splitlines()[-3:]
    assert end == ["MISSED:", "  population: in one call, without a compiler", "  study: one process"]
