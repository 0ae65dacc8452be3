"""Benchmarks: what they print and save; never how fast anything is."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from macs.io.console import Steps
from macs.io.interrupts import Stopped
from problems import load
from problems.cases import goddard
from runs.bench import Effort, command, density, fronts, inner, methods, passages, population, prefer, search, standard, study
from runs.bench.cases import BATCH, INNER
from runs.bench.fronts.contest import as_good
from runs.bench.measured import Row, short
from runs.bench.scale.series import SERIES
from runs.cli import main
from transcription import DFET

TINY = inner.Effort(least=1, rounds=1, seconds=0.1, checked=1)
COARSE = {"goddard, cold": DFET(2, 3), "goddard, warm": DFET(2, 3), "orbit_rise, cold, 1e-9": DFET(4, 1), "needle, cold": DFET(8, 3)}
SMALL = tuple(replace(case, mesh=COARSE[case.name]) for case in INNER if case.name in COARSE)
UNASKED = tuple(replace(case, asked={}) for case in SMALL)
"""Of which no speed is asked: a test says nothing about it."""


@pytest.fixture(autouse=True)
def interpreted(monkeypatch):
    monkeypatch.setenv("MACS_COMPILE", "0")


def coarse(name):
    problem = load(name)
    problem.default_transcription = "dfet:2x2"
    return problem


SOLVED = ("ours", "simulated", "violation", "seconds", "starts", "iterations", "verified", "memory")
"""What is measured of a published problem."""


def optima(*values, verified=1.0):
    """What the first transcriptions found for a problem."""
    words = zip(methods.METHODS, values, strict=False)
    return [{"method": word, "value": value, "verified": verified, "again": 0.0} for word, value in words]


@pytest.fixture
def small(monkeypatch):
    """Benchmarks that take little; those in processes of their own, which other tests measure, find what is given here."""
    monkeypatch.setattr(search, "load", coarse)
    monkeypatch.setattr(command.functions.Contest, "quick", lambda self, rows: None)  # tests of its own
    monkeypatch.setattr(command.study, "QUICK", study.Effort(rounds=1, runs=2, evaluations=20, spin=1000))
    monkeypatch.setattr(command.standard, "QUICK", ("moon_landing",))
    monkeypatch.setattr(standard, "apart", lambda *given: {"status": "converged", **dict.fromkeys(SOLVED, 1.0)})
    monkeypatch.setattr(command.density, "QUICK", (density.Flight("standard/van_der_pol", density.on(8)),))
    monkeypatch.setattr(command.methods, "QUICK", ("zermelo",))
    monkeypatch.setattr(methods, "lines_apart", lambda *given: ([json.dumps(one) for one in optima(5.4578653, 5.4578653)], ""))
    monkeypatch.setattr(command.fronts, "QUICK", fronts.Effort(fronts.QUICK.cases[:1], (1,), (100,)))
    monkeypatch.setattr(command.population, "QUICK", population.Effort(rounds=1, calls=1, candidates=3, method="shooting:130"))
    monkeypatch.setattr(command.passages, "QUICK", passages.Effort(rounds=1, coefficients=2, rows=20))
    monkeypatch.setattr(prefer, "CASES", (replace(prefer.CASES[0], evaluations=100),))
    monkeypatch.setattr(command.scale.growth.bench_scale, "__defaults__", ((replace(SERIES[0], quick=(4, 8, 12)),),))
    monkeypatch.setattr(command.scale.growth, "ASKED", 99.0)
    monkeypatch.setattr(command.generation.bench_generation, "__defaults__", ((command.generation.SERIES[-1],),))
    monkeypatch.setattr(command.inner, "INNER", UNASKED[:2])
    monkeypatch.setattr(command.inner, "QUICK", TINY)
    monkeypatch.setattr(search, "CASES", (search.Search("goddard", 40, 40, 0.0, goddard.reference),))
    monkeypatch.setattr(search.bench_search, "__defaults__", (search.CASES,))


def test_passages_side_by_side():
    """All contenders solve the same problem, to what they are asked for."""
    rows: list[Row] = []
    passages.bench_passages(rows, passages.Effort(rounds=1, coefficients=3, rows=30))
    assert [row.who for row in rows] == [*passages.RIVALS, passages.SINGLY, passages.TOGETHER, passages.TABLE]
    errors = {row.who: row.of("error") for row in rows}
    assert max(errors[who] for who in (passages.SINGLY, passages.TOGETHER, passages.TABLE)) < 1e-9
    assert errors["solve_bvp, 1e-8"] < errors["solve_bvp, 1e-6"] < 1e-6
    assert "at least 200 times as fast" in passages.report(rows)


@pytest.mark.slow
def test_inner_levels_side_by_side():
    rows: list[Row] = []
    inner.bench_inner(rows, TINY, SMALL)
    found = {(row.case, row.who): row for row in rows}
    assert {case for case, _ in found} == set(COARSE)
    for (case, who), row in found.items():
        assert len(row.values["speed"]) == 1 and row.of("speed") > 0
        if who == "projection":
            assert row.of("converged") == 1.0
            assert row.of("fallbacks") == 1.0 if case == "needle, cold" else row.of("fallbacks") <= 0.2
    assert {who for case, who in found if case.startswith("orbit")} >= {"propagate"} and ("goddard, cold", "propagate") not in found
    assert found["goddard, warm", "projection"].of("off, largest") < 1e-3 < found["goddard, warm", inner.BASELINE].of("off, largest")
    text = inner.report(rows)
    for word in ("No function is compiled", "at least 15 times as fast", "moved by at most 0.07", "fall-", "needle, cold"):
        assert word in text
    assert all(len(line) <= 170 for line in text.splitlines())


def test_batches_are_what_the_search_sends():
    for case in SMALL:
        nlp = case.mesh.transcribe(case.make())
        candidates, warm = case.batch(nlp, np.random.default_rng(0))
        again, _ = case.batch(nlp, np.random.default_rng(0))
        assert candidates.shape == (BATCH, len(nlp.free)) and np.array_equal(candidates, again)
        assert ((candidates >= nlp.lower[nlp.free]) & (candidates <= nlp.upper[nlp.free])).all()
        assert (warm is not None) == case.warm
        if warm is not None:
            assert (nlp.evaluate(warm)[1] <= case.tolerance).all()
            assert 0.0 < nlp.distance(nlp.first_guess(candidates), warm).mean() < 0.1 * len(nlp.free) ** 0.5


def test_populations_in_one_call_and_one_by_one(monkeypatch):
    monkeypatch.setenv("MACS_COMPILE", "0")
    rows: list[Row] = []
    population.bench_population(rows, population.Effort(rounds=2, calls=1, candidates=4, method="shooting:130"))
    assert [row.who for row in rows] == [population.SINGLY, population.TOGETHER]
    assert [row.case for row in rows] == ["reentry_case1, shooting:130, 4 candidates"] * 2
    assert rows[0].values["speed"] == [1.0, 1.0]
    one, many = (np.array(row.values["candidates"]) for row in rows)
    np.testing.assert_allclose(many / one, rows[1].values["speed"])
    assert "at least 4 times as fast" in population.report(rows)


@pytest.mark.slow
def test_searches_for_the_same_work_and_points(small):
    case = search.Search("goddard", 10_000, 100, 0.999, goddard.reference)
    rows: list[Row] = []
    search.bench_search(rows, (1, 2), True, (case,))
    ours, theirs = rows
    assert (ours.who, theirs.who) == ("MACS", "sweeps")
    for row in rows:
        assert len(row.values["ratio"]) == 2 and max(row.values["points"]) <= 10
        assert row.of("igd", np.min) > 0 and row.of("gd", np.min) >= 0
    assert ours.of("evaluations") == 100 and theirs.of("gradient_solves") > 10
    assert all(t >= o > 0 for o, t in zip(ours.values["work"], theirs.values["work"], strict=True))
    assert ours.spread("ratio") in search.report(rows)


def test_problems_of_others_have_two_objectives():
    for case in search.OTHERS:
        assert len(case.problem().compile().goals) == 2, case.name
    assert {"rocket", "cart-pole", "bioreactor"} < {case.name for case in search.OTHERS}


@pytest.mark.slow
def test_fronts_to_the_same_quality():
    rows: list[Row] = []
    fronts.bench_fronts(rows, fronts.Effort(fronts.QUICK.cases[:1], (1, 2), (60, 1000)))
    found = {row.who: row for row in rows}
    assert [*found] == ["until done", "propagate", "projection", "sweep", "sweep, ten starts"]
    ours, projection = found["until done"], found["projection"]
    assert ours.values["good"] == [1.0, 1.0] == ours.values["ratio"] and ours.of("volume") > 0.97
    assert projection.values["evaluations"] == [1000.0, 1000.0] and projection.of("good", np.min) == 1.0, "60 were not enough"
    np.testing.assert_allclose(np.array(projection.values["seconds"]) / ours.values["seconds"], projection.values["ratio"])
    text = fronts.report(rows)
    assert "goddard: " in text and "at most 1.3 times as long" in text and all(len(line) <= 150 for line in text.splitlines())


def test_a_front_that_is_as_good():
    front = np.stack([np.linspace(0, 1, 30), 1 - np.sqrt(np.linspace(0, 1, 30))], axis=1)
    assert as_good(front, front) and not as_good(front[:-3], front), "an end is missing"
    assert as_good(np.delete(front, 15, axis=0), front) and not as_good(front + 0.01, front) and not as_good(front[:0], front)


@pytest.mark.slow
def test_a_guided_search_beside_an_even_one():
    rows: list[Row] = []
    prefer.bench_prefer(rows, (1, 2), True, (replace(prefer.CASES[0], evaluations=3000),))
    even, guided = rows
    assert (even.who, guided.who) == (prefer.EVEN, prefer.GUIDED) and even.case == guided.case == "zdt1"
    assert even.values["evaluations"] == guided.values["evaluations"] == [3000.0, 3000.0]
    np.testing.assert_allclose(np.array(guided.values["missing"]) / even.values["missing"], guided.values["ratio"])
    assert max(guided.values["ratio"]) < prefer.ASKED and guided.of("inside") > 4 * even.of("inside")
    assert f"{guided.spread('ratio')}  met" in prefer.report(rows)
    assert all(len(line) <= 150 for line in prefer.report(rows).splitlines())


@pytest.mark.slow
def test_intervals_by_density_beside_equal_ones():
    rows: list[Row] = []
    density.bench_density(rows, (replace(density.QUICK[1], words=density.on(10, steps=7)),))
    equal, dense = rows
    assert [row.who for row in rows] == [
        "equal",
        "density",
    ] and equal.case == dense.case == "hypersensitive, multiple-shooting:10x7:linear"
    assert dense.of("defect") < 1e-2 * equal.of("defect") and abs(dense.of("error")) < abs(equal.of("error"))
    assert equal.of("error") == pytest.approx(equal.of("objective") / 1.330806904943 - 1, rel=1e-9)
    assert equal.of("defect") == equal.of("defect of run.x") and density.worst(equal) == "run.x"
    assert "smaller defect by the density: 1 of 1" in density.report(rows)
    truths = {case.name: case.true() for case in density.CASES}
    assert truths["goddard, horizontal speed"] == pytest.approx(0.903889755358877) and truths["van_der_pol"] == pytest.approx(2.8672610452)
    assert truths["goddard, flight time"] == pytest.approx(109.10894511799619) and not np.isnan(list(truths.values())).any()
    assert all(len(line) <= 150 for line in density.report(rows).splitlines())


@pytest.mark.parametrize(
    ("values", "expected"), [([0, 1, 2, 3], 0), ([0, 3, 1, 3, 0], 3), ([0, 3, 2.9, 3, 0], 1), ([1, 1, 1], 0), ([0, 1, 0, 1, 0, 1], 4)]
)
def test_controls_that_turn_round(values, expected):
    nlp = DFET(len(values), 1, control_order=0).nlp(load("standard/hypersensitive"))
    vector = np.zeros(len(nlp.variables))
    places = [i for i, v in enumerate(nlp.variables) if v.name.startswith("run.u")]
    vector[places] = values
    assert density.turns(nlp.unpack(vector)["run"]) == expected


@pytest.mark.slow
def test_published_problems_each_in_its_own_process():
    rows: list[Row] = []
    standard.bench_standard(rows, standard.Effort(("moon_landing",)))
    assert [(row.case, row.who) for row in rows] == [("moon_landing", standard.RIGHT)]
    (landing,) = rows
    assert landing.of("published") == 1.420312599049 and abs(landing.of("error")) < 5e-4
    assert landing.of("simulated") == pytest.approx(landing.of("published") * (1 + landing.of("error")), rel=1e-12)
    assert landing.of("violation") < 1e-6 and landing.of("iterations") >= landing.of("starts") >= 1 and 30 < landing.of("memory") < 1500
    text = standard.report(rows)
    assert [one.measured for one in standard.targets(rows)][:2] == ["1 of 1", "0"] and "MISSED" not in text
    assert all(len(line) <= 150 for line in text.splitlines())


@pytest.mark.slow
def test_what_does_not_end_or_crashes_is_told(capfd):
    rows: list[Row] = []
    standard.bench_standard(rows, standard.Effort(("moon_landing",), limit=0.05))
    with Steps("published problems", 1) as steps:
        found = standard.apart("no_such_problem", 0, 60.0, steps)
    rows.append(standard.compared("no_such_problem", standard.published("moon_landing")[0], found))
    assert [row.who for row in rows] == [standard.LATE, standard.CRASHED]
    assert "no_such_problem" in capfd.readouterr().err
    assert [one.met for one in standard.targets(rows)] == [False, True, True]


@pytest.mark.slow
def test_methods_agree_on_published_problems():
    rows: list[Row] = []
    methods.bench_methods(rows, methods.Effort(("zermelo",)))
    (row,) = rows
    assert row.who == methods.AGREED and [one.met for one in methods.targets(rows)] == [True]
    for word in methods.METHODS:
        assert row.of(f"{word} verified") == 1.0 and row.of(word) == pytest.approx(row.of("published"), rel=1e-4)
    text = methods.report(rows)
    assert "agree: 1 of 1; ended early: 0" in text
    assert all(len(line) <= 150 for line in text.splitlines())


def test_verified_optima_that_differ_are_told(monkeypatch, capsys):
    same, other = (1.4203, 1.4204), (1.4203, 1.4203, 1.4303)
    row = methods.compared("moon_landing", optima(*other), "")
    assert row.who == methods.DISAGREED and methods.compared("moon_landing", optima(*same), "").who == methods.AGREED
    assert methods.compared("moon_landing", optima(*other, verified=0.0), methods.LATE).who == f"-, {methods.LATE}"
    fixed = [*optima(1.4203, 1.4203), {"method": methods.METHODS[-1], "value": 1.4303, "verified": 1.0, "again": 1.0}]
    assert methods.compared("moon_landing", fixed, "").who == methods.AGREED, "linear controls on nodes are somewhat worse"
    monkeypatch.setattr(command.methods, "bench_methods", lambda rows, effort: rows.append(row))
    assert main(["bench", "methods"]) == 1
    assert capsys.readouterr().out.splitlines()[-2].split() == ["verified,", "but", "different", "none", "moon_landing", "MISSED"]


@pytest.mark.parametrize(
    ("change", "verdict"),
    [
        ({}, "right"),
        ({"simulated": 1.4213}, "WRONG"),
        ({"simulated": 1.4193}, "WRONG"),
        ({"verified": 0.0}, "not verified"),
        ({"simulated": 1.43, "verified": 0.0}, "not verified"),
        ({"status": "failed"}, "FAILED"),
    ],
)
def test_verdicts(change, verdict):
    found = {"status": "converged", "ours": 1.4204, "simulated": 1.4204, "violation": 1e-6, "verified": 1.0, "seconds": 1.0} | change
    assert standard.compared("moon_landing", standard.published("moon_landing")[0], found).who == verdict


@pytest.mark.slow
def test_the_command_prints_and_saves(small, capsys, tmp_path):
    path = tmp_path / "all.csv"
    # A study of two tiny runs takes much longer than these.
    assert main(["bench", "--quick", "--csv", str(path)]) == 1
    said = capsys.readouterr()
    titles = ("DENSITY MESHES", "INNER LEVELS", "TRANSCRIPTIONS", "PASSAGES", "POPULATIONS", "PREFERENCES", "GROWTH", "SEARCHES")
    places = [said.out.index(words) for words in (*titles, "PUBLISHED PROBLEMS", "STUDIES", f"values in {path}")]
    assert places == sorted(places)
    assert "at least 1.7 times as fast" in said.out and "at most 5 % beyond" in said.out
    assert "  study: one process" in said.out[said.out.index("MISSED:") :].splitlines()
    assert "inner levels: " in said.err and "searches: goddard" in said.err
    with path.open() as file:
        table = list(csv.DictReader(file))
    assert {row["benchmark"] for row in table} == {
        "density",
        "front",
        "generation",
        "inner",
        "methods",
        "passages",
        "peers",
        "population",
        "prefer",
        "scale",
        "search",
        "standard",
        "study",
    }
    assert {"speed", "converged", "moved", "ratio", "gd", "igd"} <= {row["quantity"] for row in table}
    assert all(np.isfinite(float(row["value"])) for row in table)


@pytest.mark.slow
@pytest.mark.parametrize("how", [Stopped("interrupted"), KeyboardInterrupt()])
def test_ctrl_c_prints_what_there_is(small, capsys, monkeypatch, how):
    measure = inner._measure

    def interrupted(case, *rest):
        if case.name == "goddard, warm":
            raise how
        measure(case, *rest)

    monkeypatch.setattr(inner, "_measure", interrupted)
    assert command.bench(("inner", "search"), Effort(quick=True), None)
    said = capsys.readouterr()
    assert "goddard, cold" in said.out and "goddard, warm" not in said.out and "SEARCHES" not in said.out
    assert "interrupted: these are the values measured until then" in said.err


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_an_interrupt_ends_the_steps():
    with Steps("work", 3) as steps:
        steps.begin("first")
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.01)
        assert steps.asked()
        with pytest.raises(Stopped):
            steps.begin("second")


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            ["bench", "studies"],
            [
                "studies",
                "study",
                "constrained, density, front, generation, inner, many, methods, passages, peers, population, prefer, scale",
            ],
        ),
        (["bench", "iner"], ["'iner'", "did you mean inner?", "search"]),
        (["bench", "inner", "--csv", "nowhere/a.csv"], ["nowhere/a.csv", "there is no folder"]),
    ],
)
def test_wrong_calls(capsys, call, words):
    assert main(call) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.count("\n") == 1 and all(word in said.err for word in words), said.err


SCRIPT = """
import sys
sys.path.insert(0, {here!r})
import test_bench
test_bench.inner.INNER, test_bench.inner.QUICK = test_bench.UNASKED[:1], test_bench.TINY
from runs.cli import main
sys.exit(main(["bench", "inner", "--quick"]))
"""


@pytest.mark.slow
def test_in_a_process():
    code = SCRIPT.format(here=str(Path(__file__).parent))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert "goddard, cold" in done.stdout and done.stderr.startswith("inner levels: goddard, cold, step 1 of 1")


def test_spreads_are_short():
    row = Row("a", "b")
    row.add(x=1.0, y=np.nan)
    assert row.spread("x") == "1.00" and row.spread("y") == row.spread("z") == "-" and np.isnan(row.of("y"))
    row.add(x=3.0)
    assert row.spread("x") == "2.00 [1.00, 3.00]"
    for value in (3.0, 3.0, 100.0):
        row.add(x=value)
    assert row.spread("x") == "3.00 [3.00, 3.00]"
    assert [short(v) for v in (0.0, 12.345, 1234.5, 0.05, 1e-7, np.nan, np.inf)] == ["0", "12.3", "1234", "0.0500", "1.00e-07", "-", "inf"]
