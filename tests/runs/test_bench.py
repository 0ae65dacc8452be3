"""Benchmarks: what they measure, print, save and ask; never how fast anything is."""

import csv
import os
import signal
import sys
import time
from dataclasses import replace
from math import pi

import numpy as np
import pytest
from smooth_problems import still

from macs.io.console import Steps
from macs.io.interrupts import Stopped
from problems import Problem
from problems.cases.standard import published
from runs.bench import BENCHES, curve, growth, header_of, inner, peers, searches, work, workers
from runs.bench import published as optima
from runs.bench.contest import CONTESTS
from runs.bench.contract import Bench, Effort, Row, Target, merge, short, side_by_side, verdicts
from runs.cli import main
from transcription import DFET
from transcription.stopping import stopping

AROUND = (0.5, 1.0, 3.0)
"""Of which the best, the worst and the mean would say something else than the median, 1."""


def times(limit: float) -> list[float]:
    """Values with this median."""
    return [limit * one for one in AROUND]


def measured(kind: str, *cases, **settings) -> list[Row]:
    """The rows of a benchmark with these cases; its report has lines that fit on a screen."""
    rows: list[Row] = []
    BENCHES[kind].measure(rows, Effort(cases, **settings))
    assert all(len(line) <= 180 for line in BENCHES[kind].report(rows).splitlines())
    return rows


@pytest.fixture(autouse=True)
def interpreted(monkeypatch):
    monkeypatch.setenv("MACS_COMPILE", "0")


def a_bench(**changes) -> Bench:
    """A benchmark of numbers, whose case is the value of its first round."""

    def prepare(case, effort, steps):
        return lambda number: [Row.once(str(case), "ours", value=case * number), Row.once(str(case), "theirs", value=1.0)]

    settings = {"full": Effort((1, 10), rounds=3), "quick": Effort((1,)), "columns": (("value", "", lambda row: row.spread("value")),)}
    return replace(Bench("numbers", "NUMBERS: so many.", prepare=prepare, **settings), **changes)


def asked(least: float):
    """The target that ours of the first case has at least this median."""
    return lambda rows: [Target("first", f"at least {least:g}", rows[0].spread("value"), rows[0].of("value") >= least)]


def test_cases_are_measured_round_by_round_each_contender_first_in_turn():
    rows: list[Row] = []
    a_bench().measure(rows, Effort((1, 10), rounds=3))
    assert [(row.case, row.who, row.values["value"]) for row in rows[::2]] == [("1", "ours", [1, 2, 3]), ("10", "ours", [10, 20, 30])]
    rows.clear()
    a_bench().measure(rows, Effort((1,), rounds=9, seconds=0.0))
    assert len(rows[0].values["value"]) == 3, "no further round after so many seconds"
    order: list[str] = []
    work = {name: lambda name=name: order.append(name) for name in "abc"}
    for number in (1, 2, 3):
        assert list(side_by_side(work, number)) == ["a", "b", "c"]
    assert "".join(order) == "bcacababc"
    rows = [Row.once("a", "b", x=1.0, y=np.nan)]
    assert rows[0].spread("x") == "1.00" and rows[0].spread("y") == rows[0].spread("z") == "-" and np.isnan(rows[0].of("y"))
    merge(rows, [Row.once("a", "b", x=3.0)])
    assert rows[0].spread("x") == "2.00 [1.00, 3.00]"
    merge(rows, [Row("a", "b", {"x": [3.0, 3.0, 100.0]}), Row.once("a", "c", x=1.0)])
    assert rows[0].spread("x") == "3.00 [3.00, 3.00]" and [row.who for row in rows] == ["b", "c"]
    assert [short(v) for v in (0.0, 12.345, 1234.5, 0.05, 1e-7, np.nan, np.inf)] == ["0", "12.3", "1234", "0.0500", "1.00e-07", "-", "inf"]
    assert verdicts([]) == []
    lines = verdicts([Target("one", "at most 1", "0.5", True), Target("another one", "none", "two", False)])
    assert lines[2:] == ["one          at most 1  0.5       met", "another one  none       two       MISSED"]


@pytest.fixture
def two(monkeypatch):
    """Two benchmarks in place of all."""
    for name in list(BENCHES):
        monkeypatch.delitem(BENCHES, name)
    monkeypatch.setitem(BENCHES, "first", a_bench(targets=asked(2.0), seeded=True))
    monkeypatch.setitem(BENCHES, "second", a_bench(targets=asked(2.1)))


def test_the_command_prints_judges_and_saves_with_seeds_and_quickly_too(two, capsys, tmp_path):
    path = tmp_path / "all.csv"
    assert main(["bench", "--csv", str(path)]) == 1 and main(["bench", "first"]) == 0
    said = capsys.readouterr()
    assert said.out.count("NUMBERS: so many.") == 3 and "2.00 [1.00, 3.00]" in said.out
    assert "MISSED:\n  second: first\n" in said.out and "numbers: 10, seed 1, step 4 of 6" not in said.out
    with path.open() as file:
        table = list(csv.DictReader(file))
    assert {row["benchmark"] for row in table} == {"first", "second"} and len(table) == 24
    assert table[2] == {"benchmark": "first", "case": "1", "contender": "ours", "quantity": "value", "repetition": "2", "value": "3.0"}
    assert main(["bench", "first", "--seeds", "5"]) == 0 and "3.00 [2.00, 4.00]" in capsys.readouterr().out
    assert main(["bench", "first", "--quick"]) == 1 and "10 " not in capsys.readouterr().out


@pytest.mark.parametrize("how", [Stopped("interrupted"), KeyboardInterrupt()])
def test_ctrl_c_prints_what_there_is(two, monkeypatch, capsys, how):
    def prepare(case, effort, steps):
        if case == 10:
            raise how
        return lambda number: [Row.once(str(case), "ours", value=case)]

    monkeypatch.setitem(BENCHES, "first", a_bench(prepare=prepare))
    assert main(["bench"]) == 0
    said = capsys.readouterr()
    assert said.out.count("NUMBERS") == 1 and "interrupted: these are the values measured until then" in said.err


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_an_interrupt_ends_the_steps():
    with Steps("work", 3) as steps:
        steps.begin("first")
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.01)
        assert stopping()
        with pytest.raises(Stopped):
            steps.begin("second")


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (["studies"], ["studies", "study", "cf, charges, constrained, corpus, curve, front, generation, inner, maf, many"]),
        (["iner"], ["'iner'", "did you mean inner?"]),
        (["inner", "--csv", "nowhere/a.csv"], ["nowhere/a.csv", "there is no folder"]),
        (["inner", "--seeds", "2"], ["'inner' has none"]),
        (["zdt", "--quick", "--seeds", "2"], ["--quick has one seed"]),
        (["inner", "--jobs", "2"], ["--jobs"]),
        (["uf", "--quick", "--keep", "here"], ["--keep"]),
        (["inner", "--solvers", "MACS"], ["--solvers"]),
        (["--solvers", "MACS"], ["--solvers: of which one"]),
        (["inner", "goddard"], ["for the corpus and for curves, not for 'inner'"]),
        (["uf", "--solvers", "MACS", "RVEA"], ["unknown solver 'RVEA'"]),
        (["uf", "--solvers", "NSGA-II"], ["MACS must be among them"]),
    ],
)
def test_wrong_calls(capsys, call, words):
    assert main(["bench", *call]) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.count("\n") == 1 and all(word in said.err for word in words), said.err


def test_options_reach_the_searches_and_the_header(monkeypatch, tmp_path):
    asked = []
    monkeypatch.setitem(BENCHES, "zdt", replace(BENCHES["zdt"], whole=lambda rows, effort: asked.append(effort)))
    page = tmp_path / "zdt.md"
    call = ["bench", "zdt", "--seeds", "3", "--jobs", "2", "--keep", "here", "--solvers", "NSGA-II", "MACS", "--page", str(page)]
    assert main(["bench", "zdt"]) == main(call) == 0
    assert asked == [Effort(rounds=10), Effort(rounds=3, jobs=2, keep="here", solvers=("NSGA-II", "MACS"))]
    header = header_of("zdt", page, seeds=3, jobs=2, keep="here", solvers=("MACS", "MOEA/D"))
    assert "--seeds 3 --jobs 2 --solvers MACS MOEA/D --page" in header.command


def front_rows(ratio: float, good: float) -> list[Row]:
    others = [Row("goddard", who, {"ratio": times(ratio), "good": [good] * 3}) for who in (searches.PROPAGATE, searches.PROJECTION)]
    sweeps = [Row("goddard", who, {"ratio": [0.5], "good": [1.0]}) for who in (searches.SWEEP, searches.SWEEPS)]
    return [Row("goddard", searches.DONE, {"ratio": [1.0], "good": [1.0]}), *others, *sweeps]


def inner_rows(speed: float, moved: float, converged: float) -> list[Row]:
    case, seconds = "goddard, warm", {"seconds": [1.0, 1.0, 1.0]}
    return [
        Row(case, inner.BASELINE, {**seconds, "speed": [1.0] * 3, "moved": [0.3], "converged": [0.9, 1.0, 1.0]}),
        Row(case, inner.PROJECTION, {**seconds, "speed": [2.0] * 3, "moved": [0.05], "converged": [1.0]}),
        Row(case, inner.DEFAULT, {**seconds, "speed": times(speed), "moved": times(moved), "converged": [converged, 1.0, 1.0]}),
    ]


def study_rows(speed: float, beyond: float) -> list[Row]:
    one, two = {"speed": [1.0], "beyond": times(beyond)}, {"speed": times(speed), "beyond": [0.5], "work": [1.0], "seconds": [1.0]}
    return [Row("goddard", workers.ONE, one), Row("goddard", workers.TWO, two), Row(workers.LIMIT, workers.TWO, {"speed": [2.0]})]


def peer_rows(ratio: float, converged: int) -> list[Row]:
    ours = Row("isoperimetric", peers.OURS, {"seconds": times(ratio), "optimum": [0.0796] * converged})
    return [ours, Row("isoperimetric", peers.YAPSS, {"seconds": times(1.0), "optimum": [0.0796]})]


def search_rows(ratio: float, evaluations: float = 20_000.0) -> list[Row]:
    return [Row("landing_site", searches.OURS, {"ratio": times(ratio), "evaluations": [evaluations]})]


def curve_rows(error: float, solves: float, within: float) -> list[Row]:
    return [Row.once("cart-pole", "0.001", error=error, solves=solves, within=within, lines=36, ends=6)]


def verdict_rows(*kinds: str, memory: float = 100.0) -> list[Row]:
    return [Row("zermelo", who, {"memory": [memory], "published": [1.0]}) for who in kinds]


MET_AND_MISSED = [
    ("curve", curve_rows(0.001, 20, 0.95), 0),
    ("curve", curve_rows(0.0011, 20, 0.94), 2),
    ("curve", curve_rows(0.001, 26, 0.95), 2),
    ("front", front_rows(1 / 1.2, 1.0), 0),
    ("front", front_rows(1 / 1.4, 1.0), 1),
    ("front", front_rows(1 / 1.4, 0.0), 0),
    ("generation", [Row("re-entry, 120 individuals", "nodes", {"exponent": times(1.15)})], 0),
    ("generation", [Row("re-entry, 120 individuals", "nodes", {"exponent": times(1.16)})], 1),
    ("inner", inner_rows(15.0, 0.07, 1.0), 0),
    ("inner", inner_rows(14.9, 0.07, 1.0), 1),
    ("inner", inner_rows(15.0, 0.071, 1.0), 1),
    ("inner", inner_rows(15.0, 0.07, 0.8), 1),
    ("methods", verdict_rows("agree"), 0),
    ("methods", verdict_rows("DISAGREE"), 1),
    ("peers", peer_rows(1.5, 3), 0),
    ("peers", peer_rows(1.51, 3), 1),
    ("peers", peer_rows(1.0, 2), 1),
    ("population", [Row("reentry_case1", inner.TOGETHER, {"speed": times(4.0)})], 0),
    ("population", [Row("reentry_case1", inner.TOGETHER, {"speed": times(3.9)})], 1),
    ("population", [Row("reentry_case1", inner.TOGETHER, {"speed": []})], 1),
    ("scale", [Row("set-up", "nodes", {"time": times(1.1), "memory": [1.0]})], 0),
    ("scale", [Row("set-up", "nodes", {"time": times(1.11), "memory": [1.5]}), Row("other", "nodes", {"unfinished": [1.0]})], 3),
    ("search", search_rows(1.01), 0),
    ("search", search_rows(1.009), 1),
    ("search", search_rows(0.5, evaluations=2000.0), 0),
    ("standard", verdict_rows(*["right"] * 17, optima.UNVERIFIED), 0),
    ("standard", verdict_rows(*["right"] * 16, optima.UNVERIFIED, optima.UNVERIFIED), 1),
    ("standard", verdict_rows(*["right"] * 17, optima.WRONG), 1),
    ("standard", verdict_rows(*["right"] * 18, memory=1501.0), 1),
    ("study", study_rows(1.7, 0.05), 0),
    ("study", study_rows(1.69, 0.05), 1),
    ("study", study_rows(1.7, 0.051), 1),
    ("wild", verdict_rows(*["right"] * 8, optima.WRONG), 2),
    ("workers", [Row("sweep of the cart-pole", workers.TWO, {"speed": times(1.6)}), Row(workers.ASLEEP, "", {"part": times(0.45)})], 0),
    ("workers", [Row("sweep of the cart-pole", workers.TWO, {"speed": times(1.59)}), Row(workers.ASLEEP, "", {"part": times(0.46)})], 2),
]
"""Rows, and how many targets they miss."""


def test_targets_follow_the_medians():
    for kind, rows, missed in MET_AND_MISSED:
        assert sum(not one.met for one in BENCHES[kind].targets(rows)) == missed, (kind, rows)
    assert set(BENCHES) - {kind for kind, *_ in MET_AND_MISSED} == {"charges", "corpus", "parts", *CONTESTS}


@pytest.mark.slow
def test_inner_levels_side_by_side():
    meshes = {"goddard, cold": DFET(2, 3), "goddard, warm": DFET(2, 3), "orbit_rise, cold, 1e-9": DFET(4, 1), "needle, cold": DFET(8, 3)}
    rows = measured("inner", *(replace(case, mesh=meshes[case.name]) for case in inner.CASES if case.name in meshes))
    by_name = {(row.case, row.who): row for row in rows}
    assert {case for case, _ in by_name} == set(meshes)
    for (case, who), row in by_name.items():
        assert len(row.values["speed"]) == 1 and row.of("speed") > 0
        if who == "projection":
            assert row.of("converged") == 1.0
            assert row.of("fallbacks") == 1.0 if case == "needle, cold" else row.of("fallbacks") <= 0.2
    assert ("orbit_rise, cold, 1e-9", "propagate") in by_name and ("goddard, cold", "propagate") not in by_name
    assert by_name["goddard, warm", "projection"].of("moved") < by_name["goddard, warm", inner.BASELINE].of("moved")
    assert "No function is compiled" in BENCHES["inner"].report(rows)


def test_populations_in_one_call_and_one_by_one():
    rows = measured("population", inner.PopulationCase("shooting:130", 4), rounds=2)
    assert [row.who for row in rows] == [inner.SINGLY, inner.TOGETHER] and rows[0].values["speed"] == [1.0, 1.0]
    one, many = (np.array(row.values["candidates"]) for row in rows)
    np.testing.assert_allclose(many / one, rows[1].values["speed"])


@pytest.mark.slow
def test_searches_for_the_same_work_and_points():
    ours, theirs = measured("search", replace(searches.GODDARD, word="dfet:2x2"), evaluations=100, rounds=2)
    for row in (ours, theirs):
        assert len(row.values["ratio"]) == 2 and max(row.values["points"]) <= 10
        assert row.of("igd", np.min) > 0 and row.of("gd", np.min) >= 0
    assert ours.of("evaluations") == 100 and theirs.of("gradient_solves") > 10
    assert all(t >= o > 0 for o, t in zip(ours.values["work"], theirs.values["work"], strict=True))


@pytest.mark.slow
def test_fronts_to_the_same_quality(monkeypatch):
    monkeypatch.setattr(searches, "BUDGETS", (60, 1000))
    rows = {row.who: row for row in measured("front", searches.GODDARD)}
    assert [*rows] == ["until done", "propagate", "projection", "sweep", "sweep, ten starts"]
    ours, projection = rows["until done"], rows["projection"]
    assert ours.values["good"] == [1.0] == ours.values["ratio"] and ours.of("volume") > 0.97
    assert projection.values["evaluations"] == [1000.0] and projection.of("good") == 1.0, "60 were not enough"


def test_a_front_that_is_as_good():
    front = np.stack([np.linspace(0, 1, 30), 1 - np.sqrt(np.linspace(0, 1, 30))], axis=1)
    assert searches.as_good(front, front) and not searches.as_good(front[:-3], front), "an end is missing"
    assert searches.as_good(np.delete(front, 15, axis=0), front)
    assert not searches.as_good(front + 0.01, front) and not searches.as_good(front[:0], front)
    for case in searches.OTHERS:
        assert len(case.build().compile().goals) == 2, case.name


@pytest.mark.slow
def test_published_problems_each_in_its_own_process(capfd):
    (landing,) = measured("standard", "moon_landing")
    assert landing.who == optima.RIGHT and landing.of("published") == 1.420312599049 and abs(landing.of("error")) < 5e-4
    assert landing.of("simulated") == pytest.approx(landing.of("published") * (1 + landing.of("error")), rel=1e-12)
    assert (
        landing.of("cpu") > 0.0
        and landing.of("violation") < 1e-6
        and landing.of("iterations") >= landing.of("starts") >= 1
        and 30 < landing.of("memory") < 1500
    )
    (late,) = measured("standard", "moon_landing", seconds=0.05)
    with Steps("published problems", 1) as steps:
        lines, ended = optima.lines_of("defaults", "no_such_problem", Effort(), steps)
    assert late.who == optima.TIMEOUT and (lines, ended) == ([], optima.CRASHED) and "no_such_problem" in capfd.readouterr().err


@pytest.mark.slow
def test_methods_agree_on_published_problems():
    (row,) = measured("methods", "breakwell")
    assert row.who == optima.AGREED
    for word in optima.WORDS:
        assert row.of(f"{word} verified") == 1.0 and row.of(word) == pytest.approx(row.of("published"), rel=1e-4)
    assert "agree: 1 of 1; ended early: 0" in BENCHES["methods"].report([row])


def test_verified_optima_that_differ_are_told():
    def found(*values: float, verified: float = 1.0, words=optima.WORDS):
        return [{"method": word, "value": v, "verified": verified, "again": 0.0} for word, v in zip(words, values, strict=False)]

    verdict = {"agree": found(1.4203, 1.4204), "DISAGREE": found(1.4203, 1.4203, 1.4303), "-": found(1.4203, 1.4303, verified=0.0)}
    assert all(optima.agreement("moon_landing", lines, "").who == word for word, lines in verdict.items())
    fixed = found(1.4203, 1.4203) + found(1.4303, words=optima.WORDS[-1:])
    assert optima.agreement("moon_landing", fixed, "").who == optima.AGREED, "linear controls on nodes are somewhat worse"
    assert optima.agreement("moon_landing", [], optima.TIMEOUT).who == f"-, {optima.TIMEOUT}"


@pytest.mark.parametrize(
    ("change", "verdict"),
    [
        ({}, "right"),
        ({"simulated": 1.4213}, "WRONG"),
        ({"simulated": 1.43, "verified": 0.0}, "not verified"),
        ({"status": "failed"}, "FAILED"),
    ],
)
def test_verdicts_on_published_optima(change, verdict):
    line = {"status": "converged", "ours": 1.4204, "simulated": 1.4204, "violation": 1e-6, "verified": 1.0, "seconds": 1.0} | change
    assert optima.compared("moon_landing", published("moon_landing")[0], line).who == verdict
    assert optima.compared("mine", None, line).who == {"right": "verified", "WRONG": "verified"}.get(verdict, verdict)


def test_the_corpus_stands_beside_an_earlier_run(monkeypatch, tmp_path, capsys):
    def told(kind, address, effort, steps):
        if address == "welded_beam":  # without trajectories
            return [], ""
        right = 1.420312599049 if now["right"] else 1.5
        status = "converged" if "theirs" not in address or now["right"] else "failed"
        numbers = {"ours": right, "simulated": right, "verified": 1.0, "starts": 2, "iterations": now["iterations"], "cpu": now["cpu"]}
        return [{"status": status, **numbers}], ""

    monkeypatch.setattr(work, "lines_of", told)
    cases = ("standard/moon_landing", "welded_beam")
    monkeypatch.setitem(BENCHES, "corpus", replace(work.CORPUS, full=Effort(cases)))
    file, others = str(tmp_path / "first.csv"), ["--problems", "here/mine.py:build", "here/theirs.py:build"]
    now = {"right": True, "iterations": 40, "cpu": 1.0}
    assert main(["bench", "corpus", "--csv", file, *others]) == 0
    first = capsys.readouterr().out
    assert "solved: 3 of 3" in first and "iterations: geometric mean 40\n" in first and ", before" not in first and "welded" not in first
    now = {"right": False, "iterations": 10, "cpu": 1.5}
    assert main(["bench", "corpus", "--against", file, *others]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "solved: 1 of 3" in lines and "iterations: geometric mean 10, 0.250 times those before" in lines
    assert "solved before only: standard/moon_landing, theirs.py:build" in lines and "another optimum: mine.py:build" in lines
    assert "slower by a fifth and 0.2 s: mine.py:build" in lines and any("right, before" in line for line in lines)
    for call, word in ((["corpus", "--against", "nowhere.csv"], "nowhere.csv"), (["zdt", "--problems", "x.py:y"], "--problems")):
        assert main(["bench", *call]) == 2 and word in capsys.readouterr().err


@pytest.mark.slow
def test_a_curve_beside_points_that_are_solved_anew():
    def corner() -> Problem:
        problem = still("corner")
        a, b = problem.parameter("a", bounds=(0, 1)), problem.parameter("b", bounds=(-1, 2))
        problem.constraint("one", b - (1.0 - 1.6 * a), lower=0)
        problem.constraint("two", b - (0.6 - 0.6 * a), lower=0)
        problem.minimize("first", a)
        problem.minimize("second", b)
        return problem

    case = searches.SearchCase("corner", corner, "dfet:1x2")
    (row,) = measured("curve", case, evaluations=5)
    assert row.of("within") == 1.0 and row.of("farthest") <= row.of("error") <= 1e-3 and row.of("mesh") < 1e-6
    # The corner is at 13/25 of the line between the ends: of 26 even points one is there, and of fewer none is near enough.
    assert (
        row.of("targets") == 5 and row.of("points") + 1 < row.of("points") - 2 + row.of("ends") <= row.of("solves") < row.of("lines") == 26
    )
    assert curve.finer(DFET(2, 3), case.build()).mesh_of("wait").edges == (0.0, 0.25, 0.5, 0.75, 1.0)


def test_peers_that_are_missing_are_named(monkeypatch):
    monkeypatch.setattr(peers, "find_spec", lambda name: None)
    circle = next(example for example in peers.EXAMPLES if example.name == "isoperimetric")
    (ours,) = rows = measured("peers", circle)
    assert ours.who == peers.OURS and abs(ours.of("optimum") - 1 / (4 * pi)) < 1e-8
    assert "not installed: yapss, rockit; for a comparison: pip install" in BENCHES["peers"].report(rows)
    assert all(len(example.problem().objectives) == 1 for example in peers.EXAMPLES)


TINY = {"elements": 4, "nodes": 4, "intervals": 4, "phases": 2, "masses": 2, "points": 2, "agents": 4}


@pytest.mark.parametrize("one", [*growth.SERIES, *growth.GENERATIONS], ids=lambda one: one.name)
def test_every_series_does_its_work(one):
    if one in growth.GENERATIONS:
        one.prepare(one.sizes[0])(2)
    else:
        assert one.prepare(TINY[one.unit])() is not None


def test_exponents_are_those_of_powers():
    sizes = np.array([10.0, 20.0, 40.0])
    assert growth.exponent(sizes, 3.0 * sizes**1.5) == pytest.approx(1.5)
    one = growth.SERIES[0]
    row = growth.growth(one, (5, 10, 20, 40), [(5, 9.0, 0.0), (10, 1.0, 20.0), (20, 2.0, 40.0), (40, 4.0, 80.0)])
    assert row.of("time") == pytest.approx(1.0) and row.of("memory") == pytest.approx(1.0) and row.of("size") == 40
    first, again = [(10, 2.0, 1.0), (20, 4.0, 2.0), (40, 4.0, 4.0)], [(10, 1.0, 80.0), (20, 2.0, 80.0), (40, 9.0, 80.0)]
    row = growth.growth(one, (10, 20, 40), [*first, *again])
    assert row.of("time") == pytest.approx(1.0), "of repetitions the quickest counts"
    assert "memory" not in row.values and row.of("MB at 40") == 4.0, "the first peak counts, and a few MB say nothing"
    assert growth.growth(one, (10, 20, 40), first[:2]).values["unfinished"] == [1.0]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="processes are forked")
def test_growth_in_a_process_of_its_own():
    one = next(one for one in growth.SERIES if one.name == "set-up, single shooting")
    (row,) = measured("scale", replace(one, sizes=(4, 8, 12)))
    assert np.isfinite(row.of("time")) and row.of("size") == 12 and len(row.values["seconds at 8"]) == 1


def test_generations_grow_as_their_work_does(monkeypatch):
    clock = [0.0]
    monkeypatch.setattr(growth.time, "process_time", lambda: clock[0])

    def prepare(size: int):
        def run(generations: int) -> None:
            clock[0] += 1.0 + 5e-6 * size * size * generations

        return run

    (row,) = measured("generation", growth.Series("quadratic", "things", prepare, (20, 40, 80), "Np^2", 2))
    assert row.of("exponent") == pytest.approx(2.0) and row.of("seconds") == pytest.approx(5e-6 * 6400)
    assert "section IV-D" in BENCHES["generation"].report([row])


def test_parts_are_off_one_at_a_time():
    """From the same seeds: a part that does nothing within the budget has no gain."""
    case = next(one for one in BENCHES["parts"].full.cases if one.name == "TNK")
    rows = measured("parts", case, rounds=2, evaluations=120)
    assert {row.case for row in rows} == {"constraints"} and len({row.who for row in rows}) == len(rows) > 5
    gains = {row.who: row.values["gain"] for row in rows}
    assert gains["signs of residuals"] == [0.0, 0.0], "none of its limits is on an absolute value"
    assert any(gain != [0.0, 0.0] for gain in gains.values())


def test_charges_beside_the_processor(monkeypatch):
    monkeypatch.setattr(work.time, "process_time", iter(range(100)).__next__)
    (row,) = measured("charges", "goddard shooting:20 search", rounds=2)
    assert row.values["processor"] == [1, 1] and row.values["ratio"] == row.values["nominal"]
    rows = [Row("a", kind, {"ratio": times(ratio)}) for kind, ratio in (("search", 1.0), ("search", 1.6), ("sweep", 0.7), ("sweep", 1.4))]
    words = (
        "Of 4 (search, sweep), 3 are within a factor of 1.5 of the processor, 2 of each other, and the greatest ratio between two is 2.29"
    )
    assert f"{words}, of a search to a sweep. " in (text := " ".join(work.agreement(rows))) and "Outside: a search 1.60." in text
