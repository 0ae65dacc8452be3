"""Studies whose points are simulated: what counts in their reports, and the published tables that need it."""

import csv
import shutil
from pathlib import Path
from zlib import crc32

import numpy as np
import pytest
from test_study import Inline

from macs import MACS, NSGA2, Front
from macs.fronts.verified import unmarked
from problems import Problem
from runs import Study
from runs.batch.store import Store
from runs.files import from_record, to_record
from runs.report.comparison import Counting, comparisons
from runs.report.comparison_tables import runs_table

MEASURES = [
    {"name": "miss", "state": "x", "at": 2.0, "unit": "cm", "factor": 100.0},
    {"name": "speed", "state": "v"},
    *({"name": take, "state": "v", "take": take} for take in ("first", "greatest")),
]
ROW = {"problem": "braking", "by": "the paper"}
STATED = ("least", "mean", "standard deviation")
PAPER = [
    {"of": "objectives", "measures": MEASURES, "rows": [{**ROW, "statistic": one, "miss": 5.0} for one in STATED]},
    {"of": "feasibility", "rows": [{**ROW, "first_feasible": 19, "points": 50}]},
    {"of": "hypervolume", "point": [0.0, 20.0], "rows": [{**ROW, "best": 3.0}]},
]


def braking(pace: float = 0.6) -> Problem:
    """v' = u - 3 v, which one element gets wrong by some percent, and v is to be at `pace` or more at the end."""
    problem = Problem("braking")
    phase = problem.phase("run", t0=0.0, tf=2.0)
    x = phase.state("x", bounds=(0, 10), initial=0, unit="m")
    v = phase.state("v", bounds=(-5, 5), initial=0, unit="m/s")
    u = phase.control("u", bounds=(0, 5))
    phase.dynamics(x=v, v=u - 3.0 * v)
    problem.constraint("pace", phase.final(v), lower=pace, scale=1.0)
    problem.maximize("distance", phase.final(x), unit="m")
    problem.minimize("effort", phase.integral(u**2))
    problem.default_transcription = "dfet:1x2"
    return problem


def study(**more) -> Study:
    solvers = {"nsga2": NSGA2(population=16), "macs": MACS(agents=4, archive=6, refine=False)}
    given = {"problems": braking(), "solvers": solvers, "evaluations": 160, "runs": 2, "seed": 1, "inner": "propagate"}
    return Study("brakes", **given | {"verify": 0.01, "paper": PAPER} | more)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("brakes") / "out"
    assert study().run(out, executor=Inline()).finished == 4
    return out


@pytest.mark.slow
def test_only_points_that_are_feasible_when_simulated_count(folder):
    """What a solver says of its objectives decides on `verified`, but those of the simulation count."""
    comparison = comparisons(Store.open(folder), {})[0]
    problem = braking()
    counts = np.zeros(3, dtype=int)
    for solver, runs in comparison.runs.items():
        for run, front, counted in zip(runs, comparison.fronts[solver], comparison.counting[solver], strict=True):
            claims = Front.load(run.path, problem)
            simulated = claims.simulate(tolerance=0.01, rtol=1e-10, atol=1e-11)
            defects = np.array([point.simulate(rtol=1e-10, atol=1e-11).max_defect for point in claims])
            right = (np.max([defects, simulated.violation], axis=0) <= 0.01).nonzero()[0]
            ends = claims.F[right][claims.F[right].argmin(axis=0)]
            off = np.abs(simulated.F - claims.F) / np.ptp(ends, axis=0)
            fully = right[off[right].max(axis=1) <= 0.01]
            best = Front.merge([simulated[right]])
            np.testing.assert_allclose(front.F, best.F, rtol=1e-5)
            assert (front.violation <= 0.01).all()
            ends = [point.trajectory["run"].edge_states[-1] for point in best]
            np.testing.assert_allclose(np.transpose([counted.ends["run"][name] for name in "xv"]), ends, rtol=1e-5)
            assert (counted.claimed, counted.verified, counted.feasible) == (len(claims), len(fully), len(right))
            counts += [len(claims), len(right), len(fully)]
    assert counts[0] > counts[1] >= counts[2] > 0, "some of them lie"


@pytest.mark.slow
def test_runs_of_old_are_simulated_by_the_report(folder, tmp_path):
    """Their fronts have no columns of a simulation, and those of another tolerance do not count either."""
    shutil.copytree(folder, tmp_path / "out")
    store = Store.open(tmp_path / "out")
    expected = comparisons(Store.open(folder), {})[0]
    for k, run in enumerate(store.runs()):
        front = Front.load(run.path, braking())
        (unmarked(front) if k % 2 else front.verify(1e-6)).save(run.path)
        record = run.path.with_suffix(".json")
        record.write_bytes(to_record({**from_record(record.read_bytes()), "front": crc32(run.path.read_bytes())}))
    for run in (runs := list(store.runs())):
        run.__dict__["front"] = Front.load(run.path, braking())
        found = Counting.of(run, 0.01)
        known = next(
            v
            for s, vs in expected.counting.items()
            for r, v in zip(expected.runs[s], vs, strict=True)
            if r.path.name == run.path.name and s == run.cell.solver
        )
        np.testing.assert_array_equal(found.front.F, known.front.F)
        assert (found.claimed, found.verified, found.feasible) == (known.claimed, known.verified, known.feasible)
    assert len(runs) == 4


@pytest.mark.slow
def test_the_report_says_how_many_were_claimed(folder):
    text = str(study().report(folder, figures=False))
    assert "points claimed, and points verified" in text and "simulated by DOP853" in text
    comparison = comparisons(Store.open(folder), {})[0]
    with (folder / "report" / "braking-dfet-1x2-claims.csv").open() as file:
        rows = {row["solver"]: row for row in csv.DictReader(file)}
    for solver, runs in comparison.counting.items():
        assert int(rows[solver]["points claimed"]) == sum(one.claimed for one in runs)
        assert int(rows[solver]["verified"]) == sum(one.verified for one in runs)
        defects = np.concatenate([run.front.defect for run in comparison.runs[solver]])
        assert float(rows[solver]["median defect of a claim"]) == pytest.approx(np.nanmedian(defects), rel=0.05)
    comparison.fronts["macs"] = [front[[]] for front in comparison.fronts["macs"]]
    assert [row[-4:] for row in runs_table([comparison]).rows if row[2] == "macs"] == [(0, np.inf, np.inf, 0.0)] * 2


def test_published_measures_and_feasibility_beside_ours(folder):
    study().report(folder, figures=False)
    comparison = comparisons(Store.open(folder), {})[0]
    x = np.concatenate([one.ends["run"]["x"] for one in comparison.counting["nsga2"]])
    with (folder / "report" / "published-1.csv").open() as file:
        rows = {(row["by"], row["statistic"]): row for row in csv.DictReader(file)}
    assert rows["the paper", "mean"]["miss [cm]"] == "5.0"
    of_all = {"least": np.min, "mean": np.mean, "standard deviation": lambda v: np.std(v, ddof=1)}
    assert {statistic for by, statistic in rows if by.startswith("nsga2")} == set(of_all), "those that the paper has"
    flights = [point.trajectory["run"] for one in comparison.counting["nsga2"] for point in one.front]
    first, most = ([take(flight["v"]) for flight in flights] for take in (lambda v: v[0], np.max))
    v = np.concatenate([one.ends["run"]["v"] for one in comparison.counting["nsga2"]])
    for statistic, value in of_all.items():
        ours = rows["nsga2, dfet:1x2", statistic]
        assert float(ours["miss [cm]"]) == pytest.approx(value(100 * np.abs(x - 2.0)), rel=1e-9)
        assert [float(ours[name]) for name in ("speed", "first")] == pytest.approx([value(v), value(first)], abs=1e-9)
        assert float(ours["greatest"]) >= value(most) - 1e-9 or statistic == "standard deviation"
    with (folder / "report" / "published-2.csv").open() as file:
        rows = {row["by"]: list(row.values()) for row in csv.DictReader(file)}
    told = [run.front.stats["population"] for run in comparison.runs["nsga2"]]
    ours = rows["nsga2, dfet:1x2"]
    assert float(ours[3]) == np.mean([one["first_feasible"] for one in told]) and ours[5] == "0"
    assert float(ours[-2]) == np.mean([one["nondominated"] for one in told])
    assert float(ours[-1]) == np.mean([len(front) for front in comparison.fronts["nsga2"]])
    assert "macs, dfet:1x2" not in rows, "it has no population"


def test_points_whose_flights_are_lost_are_simulated_again_if_their_problem_is_found(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "out")
    files = sorted((tmp_path / "out").glob("*/000?.json"))
    data = from_record(files[0].read_bytes())
    files[0].write_bytes(to_record({**data, "simulated": {}}))
    files[1].unlink()
    with pytest.raises(ValueError, match=r"points of run 1 of braking, dfet:1x2, \w+ cannot be simulated: .* was stated in a script"):
        study().report(tmp_path / "out")


def test_points_are_simulated_unless_a_study_says_no(tmp_path):
    given = {"problems": braking(), "solvers": "macs", "evaluations": 160, "runs": 1, "seed": 1}
    assert Study("plain", **given).verify == 1e-3 and Study("plain", **given, verify=None).verify is None
    text = 'problems = "goddard"\nsolvers = "macs"\nevaluations = 50\nruns = 1\nseed = 1\n'
    for words, expected in (("", 1e-3), ("verify = false\n", None), ("verify = 0.5\n", 0.5)):
        (tmp_path / "mine.toml").write_text(text + words, encoding="utf-8")
        read = Study.load(tmp_path / "mine.toml")
        assert read.verify == expected and read.definition()["verify"] == expected
    (tmp_path / "mine.toml").write_text(text + "verify = true\n", encoding="utf-8")
    with pytest.raises(ValueError, match="verify must be a positive number, not True"):
        Study.load(tmp_path / "mine.toml")
