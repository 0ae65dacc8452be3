"""Searches on plain functions: the functions against closed forms, what is measured, and what is asked."""

from dataclasses import replace
from operator import methodcaller

import numpy as np
import pytest
from plain import dtlz, uf

from macs.pareto.dominance import nondominated
from runs import gd
from runs.bench import BENCHES, contest, solvers_of
from runs.bench import functions as plain
from runs.bench.contract import Effort, Row
from runs.bench.functions import UF
from runs.cli import main


@pytest.mark.parametrize("kind", range(1, 11))
def test_the_pareto_set_maps_onto_the_front(kind):
    function = UF(kind)
    random, places = np.random.default_rng(0).random((400, 30)), function.objectives - 1
    X = function.best(random)
    X[:, :places] = random[:, :places]
    lower, upper = np.array(function.bounds).T
    assert len(function.bounds) == 30 and (np.clip(X, lower, upper) == X).all()
    F = function(X)
    if kind in (8, 10):
        np.testing.assert_allclose(np.linalg.norm(F, axis=1), 1.0, atol=1e-12)
    elif kind == 9:
        apart = np.abs(2 * X[:, 0] - 1) >= 0.5
        np.testing.assert_allclose(F[apart].sum(axis=1), 1.0, atol=1e-12)
        assert (F[~apart].sum(axis=1) > 1.0).all()
    elif kind in (5, 6):
        assert (F.sum(axis=1) >= 1 - 1e-12).all(), "between the pieces of the front there is a hump"
        k = np.arange(21) / 20 if kind == 5 else np.linspace(0.25, 0.5, 50)
        places = np.zeros((len(k), 30))
        places[:, 0] = k
        best = function.best(places)
        best[:, 0] = places[:, 0]
        np.testing.assert_allclose(function(best).sum(axis=1), 1.0, atol=1e-12)
    else:
        f1 = F[:, 0]
        np.testing.assert_allclose(F[:, 1], {4: 1 - f1**2, 7: 1 - f1}.get(kind, 1 - np.sqrt(f1)), atol=1e-12)
    away = X.copy()
    away[:, 5] = np.clip(away[:, 5] + 0.1, lower[5], upper[5])
    moved = np.abs(away - X).max(axis=1) > 0.05
    assert (function(away)[moved] >= F[moved] - 1e-12).all() and (function(away)[moved] > F[moved] + 1e-6).any(axis=1).all()


@pytest.mark.parametrize("kind", range(1, 11))
def test_fronts_are_of_points_that_do_not_dominate_each_other(kind):
    front = UF(kind).front()
    counts = {5: 21, 6: 667, 8: 10_000, 9: 10_000, 10: 10_000}
    assert front.shape == (counts.get(kind, 1000), UF(kind).objectives)
    some = np.unique(front[:: 1 if len(front) < 2000 else 11].round(12), axis=0)
    assert nondominated(some).all()
    np.testing.assert_allclose(front.min(axis=0), 0.0, atol=1e-12)


@pytest.mark.parametrize("kind", [1, 2, 3])
def test_another_statement_has_the_same_values(kind):
    function, bounds, _ = uf(kind)
    lower, upper = np.array(bounds).T
    X = lower + np.random.default_rng(1).random((50, 30)) * (upper - lower)
    assert [tuple(map(float, pair)) for pair in bounds] == UF(kind).bounds
    np.testing.assert_allclose(UF(kind)(X), function(X), rtol=1e-12)


@pytest.mark.parametrize(("kind", "m"), [(1, 5), (2, 5), (3, 5), (4, 5), (7, 3), (2, 8)])
def test_functions_of_pymoo_are_those_of_the_paper(kind, m):
    function, bounds, _ = dtlz(kind, m)
    case = plain.dtlz(kind, m)
    (problem,) = case.problem()
    X = np.random.default_rng(2).random((20, len(bounds)))
    np.testing.assert_allclose(problem.evaluate(X, return_values_of=["F"]), function(X), rtol=1e-9)
    front = case.front()
    assert nondominated(front).all() and (case.distance is None or case.distance(front).max() < 1e-12)
    X[:, m - 1 :] = 0.0 if kind == 7 else 0.5
    if case.distance is not None:
        assert case.distance(function(X)).max() < 1e-9
    elif kind == 7:
        others = front[:, : m - 1]
        np.testing.assert_allclose(function(np.hstack([others, np.zeros((len(others), 20))])), front, rtol=1e-9)


ELSEWHERE = {
    "CRE24": (4734.28, 961.774, 0.789474),
    "CRE31": (31.8912, 3.96309, 11.8643, 0.0),
    "CRE32": (-518.799, 11519.4, 11458.7, 3.3586),
    "CF1": (0.701064, 1.67326, -0.607681),
    "CF5": (10.0296, 16.3483, 1.215),
    "CF7": (21.7254, 29.051, 2.67421),
    "CF8": (12.2587, 4.34016, 8.8034, 7.13079),
    "CF10": (16.5292, 6.22321, 11.5158, 4.35047),
    "MaF1": (1.58667, 1.58581, 1.57945, 1.51724, 0.0793565),
    "MaF2": (0.575792, 0.386086, 0.417472, 0.440992, 0.455029),
    "MaF6": (33.088, 24.8727, 28.5853, 31.8294, 4.68503),
}
"""Objectives and the sum of constraints by other code, at 0.6 of the bounds (CRE), or along their diagonal from 0.05 to 0.95."""


@pytest.mark.parametrize(
    "function", [one for name in ("maf", "wfg", "cf", "re") for one in plain.FUNCTIONS[name]()], ids=lambda one: one.name
)
def test_functions_of_sets_have_the_values_and_fronts_of_other_sources(function):
    problem = function.stated()
    if function.name in ELSEWHERE:
        lower, upper = np.array([(one.lower, one.upper) for one in problem.variables]).T
        share = 0.6 if function.name.startswith("CRE") else np.linspace(0.05, 0.95, len(lower))
        F, G = problem.rows((lower + share * (upper - lower))[None])
        assert [*F[0], *([G.sum()] if G.size else [])] == pytest.approx(ELSEWHERE[function.name], rel=1e-5, abs=1e-9)
    if function.front is not None:
        front = function.front()[::7]
        assert front.shape[1] == function.objectives and nondominated(front).all()


@pytest.mark.parametrize(("kind", "other"), [(3, 3), (4, 3), (5, 4)])
def test_maf_is_made_of_dtlz(kind, other):
    X = np.random.default_rng(3).random((20, 14))
    F, powers = dtlz(other, 5)[0](X), 2.0 ** np.arange(1, 6)
    inverted = (np.linalg.norm(F, axis=1, keepdims=True) - F) * powers
    made = {3: np.hstack([F[:, :4] ** 4, F[:, 4:] ** 2]), 4: inverted, 5: F * powers[::-1]}[kind]
    np.testing.assert_allclose(plain.MaF(kind)(X), made, rtol=1e-9)


@pytest.mark.parametrize(("name", "near"), [("WFG2", 0.05), ("WFG4", 0.05), ("CF2", 0.001), ("CF3", 0.005), ("CF5", 0.001), ("CF7", 0.001)])
def test_points_that_packages_give_are_near_the_fronts_and_dominate_none_of_theirs(name, near):
    function = next(one for made in ("wfg", "cf") for one in plain.FUNCTIONS[made]() if one.name == name)
    (problem,), front = function.problem(), function.front()[::3]
    given = problem.pareto_front() if name.startswith("CF") else problem.evaluate(problem.pareto_set(n_points=300), return_values_of=["F"])
    given = given[nondominated(given) & (given <= 1.1 * front.max(axis=0)).all(axis=1)]
    assert len(given) > 50 and gd(given, front) < near
    assert nondominated(np.vstack([front, given + 1e-3 * np.ptp(front, axis=0)]))[: len(front)].all()


@pytest.mark.parametrize("kind", [1, 8, 10])
def test_the_fronts_of_cf_meet_their_constraints(kind):
    F = plain.cf_front(kind)
    F = F[F[:, -1] < 0.999] if kind > 1 else F
    np.testing.assert_allclose(F.sum(axis=1) if kind == 1 else np.linalg.norm(F, axis=1), 1.0)
    wave = np.sin(10 * np.pi * (2 * F[:, 0])) if kind == 1 else np.sin(2 * np.pi * (2 * F[:, 0] ** 2 / (1 - F[:, 2] ** 2)))
    assert (wave if kind == 10 else np.abs(wave)).max() < 1e-9 and len(F) == len(np.unique(F, axis=0)) > 20


def rows_of(case: str, key: str, evaluations: float, **found: list[float]) -> list[Row]:
    """The rows of a case; names of rivals with - as _."""
    return [
        Row(case, who.replace("_", "-"), {key: values, "evaluations": [evaluations], "seconds": [1.0] * len(values)})
        for who, values in found.items()
    ]


def against_all(name: str, case: str, key: str, evaluations: float, ours: list[float], theirs: list[float]) -> list[Row]:
    """The rows of a case with all rivals of its set, which are all alike."""
    return rows_of(case, key, evaluations, **{who: ours if who == "MACS" else theirs for who in solvers_of(name)})


def many_rows(distance: float, volume: float, good: int) -> list[Row]:
    """Of all functions; ours is behind by more than 2 % on all of five objectives but so many."""
    rows: list[Row] = []
    for i, one in enumerate(plain.FUNCTIONS["many"]()):
        own = volume if one.name.startswith("DTLZ2") else 0.99 if i < good else 0.9
        found = against_all("many", one.name, "volume", 15_000, [0.0, own, 9.0], [0.5])
        for row in found:
            row.values["distance"] = [distance * 0.1, distance, 9.0] if row.who == "MACS" else [2.0]
            if row.who == "NSGA-III":
                row.values |= {"volume": [1.0], "distance": [1.0]}
        rows += found
    return rows


@pytest.mark.parametrize(
    ("distance", "volume", "good", "missed"), [(0.9, 1.1, 4, 0), (1.1, 1.1, 4, 2), (0.9, 0.99, 5, 2), (0.9, 0.97, 4, 3), (0.9, 1.1, 2, 1)]
)
def test_what_is_asked_of_many_objectives(distance, volume, good, missed):
    assert sum(not one.met for one in BENCHES["many"].targets(many_rows(distance, volume, good))) == missed


@pytest.mark.parametrize(("name", "key", "least"), [("uf", "igd", 7), ("zdt", "igd", 3), ("constrained", "volume", 12)])
def test_the_best_median_is_asked_on_a_share(name, key, least):
    functions = plain.FUNCTIONS[name]()
    for good in (least, least - 1):
        better = 2.0 if key == "volume" else 0.5
        rows = [
            row
            for i, one in enumerate(functions)
            for row in against_all(name, one.name, key, one.evaluations, [0.0, better if i < good else 1 / better, 9.0], [1.0])
        ]
        assert [one.met for one in BENCHES[name].targets(rows)] == [good == least]
        assert f"{good} of {len(functions)}" in BENCHES[name].report(rows)
    several = len(solvers_of(name))
    assert BENCHES[name].targets(rows[several:]) == [], "not all functions were measured"
    assert BENCHES[name].targets([row for row in rows if row.who != "NSGA-II"]) == [], "not all rivals were measured"
    rows[0].values["evaluations"] = [1000.0]
    assert BENCHES[name].targets(rows) == [], "not with all evaluations"


def indicators(rows: list[Row]) -> list[tuple]:
    """What is measured but times."""
    return [(row.case, row.who, row.values["igd"], row.values["volume"]) for row in rows]


ZDT = replace(next(one for one in contest.ALL_CONTESTS if one.name == "zdt"), rivals=("NSGA-II", "NSGA-III"))
"""With two quick rivals alone."""


def searched(keep, **settings) -> list[Row]:
    """ZDT1 with few evaluations."""
    rows: list[Row] = []
    ZDT.measure(rows, Effort(("ZDT1",), evaluations=200, keep=str(keep), **settings))
    return rows


@pytest.mark.slow
def test_searches_that_are_kept_are_not_made_again(tmp_path, monkeypatch):
    alone = searched(tmp_path, rounds=2, solvers=("MACS",))
    assert [row.who for row in alone] == ["MACS"] and contest.UNJUDGED in ZDT.bench.report(alone)
    first = searched(tmp_path, rounds=2, jobs=2)
    assert [row.who for row in first] == ["MACS", *ZDT.rivals] and indicators(first[:1]) == indicators(alone)
    assert all(row.values["evaluations"] == [200.0, 200.0] for row in first)
    (folder,) = tmp_path.iterdir()
    made = {path: path.stat().st_mtime_ns for path in folder.rglob("*.nc")}
    assert len(made) == 6 and folder.name == "zdt-100"

    next(path for path in made if "__MACS__" in str(path)).unlink()
    again = searched(tmp_path, rounds=2)
    assert indicators(again) == indicators(first), "one process finds what two found"
    now = {path: path.stat().st_mtime_ns for path in folder.rglob("*.nc")}
    assert len(now) == len(made) and sum(now[path] != made[path] for path in made) == 1, "only what was missing is made"

    # After Ctrl-C there are the seeds that all solvers have finished; searches by other code are none of them.
    monkeypatch.setattr(contest.Study, "run", lambda *arguments, **settings: (_ for _ in ()).throw(KeyboardInterrupt))
    next(folder.glob("*NSGA-II__*/0002.nc")).unlink()
    interrupted: list[Row] = []
    with pytest.raises(KeyboardInterrupt):
        ZDT.measure(interrupted, Effort(("ZDT1",), evaluations=200, keep=str(tmp_path), rounds=2))
    assert [row.values["igd"] for row in interrupted] == [row.values["igd"][:1] for row in first]
    monkeypatch.setattr(contest.Study, "code", lambda self, cell: {})
    of_other_code: list[Row] = []
    with pytest.raises(KeyboardInterrupt):
        ZDT.measure(of_other_code, Effort(("ZDT1",), evaluations=200, keep=str(tmp_path), rounds=2))
    assert not of_other_code


def test_a_folder_of_other_things_is_refused(tmp_path, capsys):
    folder = tmp_path / "zdt-100"
    folder.mkdir()
    (folder / "letter.txt").write_text("dear reader")
    assert main(["bench", "zdt", "--seeds", "1", "--keep", str(tmp_path)]) == 2
    err = capsys.readouterr().err
    assert "contains no study but other things, 'letter.txt' for one" in err and "Traceback" not in err


@pytest.mark.slow
def test_a_search_that_fails_is_no_result(tmp_path, monkeypatch):
    """A function of exactly so many rows as a problem's fingerprint needs."""
    function = plain.PlainFunction("ZDT1", lambda: (methodcaller("reshape", 8, 2), [(0, 1)] * 2), 2, 200, 100)
    monkeypatch.setitem(contest.FUNCTIONS, "zdt", lambda: (function,))
    with pytest.raises(RuntimeError, match="cannot reshape"):
        replace(ZDT, rivals=()).measure([], Effort(keep=str(tmp_path)))


def test_differences_from_the_best_rival_are_counted():
    rows = [
        *rows_of("MW1", "volume", 1.0, MACS=[6, 7, 8, 9, 10], NSGA_II=[1, 2, 3, 4, 5], RVEA=[1, 1, 1, 1, 1]),
        *rows_of("MW2", "volume", 1.0, MACS=[1, 2, 3, 4, 5], NSGA_II=[6, 7, 8, 9, 10], RVEA=[1, 1, 1, 1, 1]),
        *rows_of("MW3", "volume", 1.0, MACS=[1, 2, 3, 4, 5], NSGA_II=[1, 2, 3, 4, 6], RVEA=[0, 0, 0, 0, 0]),
    ]
    text = " ".join(" ".join(contest.against_the_best(rows, "volume", contest.p_values(rows, "volume"))).split())
    assert "better on 1 (MW1), worse on 1 (MW2 to NSGA-II), no difference shown on 1 (MW3)." in text
    assert "against NSGA-II 1, 1, 1; RVEA 3, 0, 0." in text
    assert text.endswith("Last by the median, alone or with others: on none.")
    turned = [row for row in rows if row.case == "MW1"]
    turned = [Row(row.case, row.who, {"igd": row.values["volume"]}) for row in turned if row.who != "RVEA"]
    lines = contest.against_the_best(turned, "igd", contest.p_values(turned, "igd"))
    assert "better on 0, worse on 1" in lines[0] and "Last by the median, alone or with others: MW1." in lines
    assert contest.against_the_best(rows_of("MW1", "volume", 1.0, MACS=[1]), "volume", {}) == []


def test_p_values_are_corrected_for_all_rivals_and_where_nothing_is_found_none_is_the_best():
    rows = rows_of("UF1", "igd", 1.0, MACS=[1, 2, 3, 4, 5], NSGA_II=[6, 7, 8, 9, 10], RVEA=[1, 2, 3, 4, 5])
    p = contest.p_values(rows, "igd")
    assert p["UF1", "NSGA-II"] == pytest.approx(2 * 2 / 252) and p["UF1", "RVEA"] == 1.0
    assert contest.p_values(rows_of("UF1", "igd", 1.0, MACS=[1, 2], NSGA_II=[6, 7]), "igd") == {}
    assert contest.as_good_as_the_best(rows_of("MW1", "volume", 1.0, MACS=[0.0], NSGA_II=[0.0]), ["MW1"], "volume", 1.0) == []
    assert contest.as_good_as_the_best(rows_of("UF1", "igd", 1.0, MACS=[np.inf], NSGA_II=[np.inf]), ["UF1"], "igd", 1.0) == []
    rows = rows_of("MW1", "igd", 1.0, MACS=[np.inf, np.inf, 0.1], NSGA_II=[0.2, 0.2, np.inf])
    assert contest.medians(rows, "MW1", "igd") == {"MACS": np.inf, "NSGA-II": 0.2}
    assert contest.rank(rows, rows[0], "igd") == "-" and contest.rank(rows, rows[1], "igd") == "1"
    rows = [Row("UF1", "MACS", {"igd": [0.1, 0.2, 0.3, 0.4, 0.5], "seconds": [1.0] * 5, "evaluations": [10.0] * 5, "points": [9.0] * 5})]
    text = BENCHES["uf"].report(rows)
    assert contest.UNJUDGED in text and "0.300 [0.200, 0.400]" in text
    assert contest.p_values(rows, "igd") == {}
    assert not {"rank", "rival", "Holm"} & {word for column in contest.columns_of(rows, {}) for word in column[:2]}
