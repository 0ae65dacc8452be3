"""Solvers that work on terms of their own beside others in one study."""

import pytest
from misbehaving import Plain, glide
from test_study import Inline

from macs import NSGA2
from problems import Problem
from runs import Study
from runs.batch.store import Store
from runs.report.comparison import comparisons
from runs.report.comparison_tables import indicator_tables, runs_table
from transcription import Smooth, parse

APART = {"macs": {"transcription": "dfet:3x2", "evaluations": 40, "inner": "ipopt", "start": "uniform", "runs": 2}}
SOLVERS = {"macs": Plain(agents=4), "nsga2": NSGA2(population=10)}
PROPAGATED = {"inner": "propagate", "transcriptions": ["shooting:5", "shooting:9"]}


def study(**more) -> Study:
    given = {"problems": glide(), "solvers": SOLVERS, "terms": APART, "evaluations": 60, "runs": 2, "seed": 1, **PROPAGATED}
    return Study("both", **given | more)


def test_cells():
    cells = {cell.labels: cell for cell in study().cells}
    budgets = {("glide", "shooting:5", "nsga2"): 60, ("glide", "shooting:9", "nsga2"): 60, ("glide", "dfet:3x2", "macs"): 40}
    assert {labels: cell.evaluations for labels, cell in cells.items()} == budgets
    plain = study(terms={}, solvers={"nsga2": SOLVERS["nsga2"]}).cells[0]
    assert cells[plain.labels].seed(1, 1) == plain.seed(1, 1) and cells[plain.labels].to_dict() == plain.to_dict(), "others do not notice"
    quick = study(terms={"macs": {**APART["macs"], "evaluations": 9000}}, evaluations=60_000).quick()
    assert {cell.labels[2]: cell.evaluations for cell in quick.cells} == {"macs": 75, "nsga2": 500}
    assert quick.terms["macs"]["inner"] == "ipopt" and quick.runs == 2
    assert {cell.labels[2]: cell.evaluations for cell in study(evaluations=60_000).quick().cells} == {"macs": 40, "nsga2": 500}
    assert study(transcriptions=[f"shooting:{n}" for n in range(3, 12)]).quick().runs == 1


@pytest.mark.slow
def test_runs_are_made_on_these_terms_and_compared_on_each_ground(tmp_path):
    assert study(runs=3).run(tmp_path / "out", executor=Inline()).finished == 8
    found = comparisons(Store.open(tmp_path / "out"), {})
    assert [comparison.transcription for comparison in found] == ["shooting:5", "shooting:9"] and len(runs_table(found).rows) == 8
    for comparison in found:
        assert [(one, comparison.place(one)) for one in comparison.fronts] == [("nsga2", comparison.transcription), ("macs", "dfet:3x2")]
        for solver, budgets in (("macs", [40, 40]), ("nsga2", [60, 60, 60])):
            assert [front.stats["evaluations"] for front in comparison.fronts[solver]] == budgets
    assert found[0].fronts["macs"][0].F.tolist() == found[1].fronts["macs"][0].F.tolist()
    assert "Mann-Whitney" in str(study(runs=3).report(tmp_path / "out", figures=False))
    found[0].runs["macs"][1].path.unlink()
    assert "comparisons" not in indicator_tables(comparisons(Store.open(tmp_path / "out"), {})[0], {}), "of one run nothing follows"
    with pytest.raises(ValueError, match=r"another study: .*details\.terms\.evaluations|evaluations is 40 there and 30"):
        study(terms={"macs": {**APART["macs"], "evaluations": 30}}).run(tmp_path / "out", executor=Inline())


@pytest.mark.slow
def test_searches_of_macs_may_end_when_they_are_done(tmp_path):
    made = study(terms={"macs": {**APART["macs"], "evaluations": "auto", "inner": "auto"}}, runs=1, transcriptions="shooting:5")
    cells = {cell.solver: cell for cell in made.cells}
    assert cells["macs"].evaluations is None and cells["macs"].planned > 0 and cells["nsga2"].evaluations == 60
    assert {cell.solver: cell.evaluations for cell in made.quick().cells}["macs"] == 500
    made.run(tmp_path / "out", executor=Inline())
    found = {run.cell.solver: run.front.stats for run in Store.open(tmp_path / "out").runs()}
    assert found["macs"]["stopped"] == "done" and found["macs"]["evaluations"] >= 500 and found["nsga2"]["evaluations"] == 60
    assert "macs" in str(made.report(tmp_path / "out", figures=False))


def endless() -> Problem:
    problem = glide()
    problem.default_evaluations = None
    return problem


@pytest.mark.parametrize(
    ("terms", "message", "others"),
    [
        ({}, "shooting:5, nsga2: evaluations 'auto' is for MACS; state a number, if need be in terms of 'nsga2'", {"evaluations": "auto"}),
        ({}, "evaluations must be a whole number or 'auto', not 'many'", {"evaluations": "many"}),
        ({}, "'glide' has no number of its own: state one, or 'auto' for MACS", {"evaluations": None, "problems": endless()}),
        ([], "terms must be a table of tables", {}),
        ({"mac": {"inner": "ipopt"}}, "unknown solver in terms 'mac', did you mean macs", {}),
        ({"macs": {}}, "terms of 'macs': it must be a table with transcription, evaluations, inner, start, runs", {}),
        ({"macs": {"budget": 3}}, "terms of 'macs': .*'budget'", {}),
        ({"macs": {"evaluations": 0}}, "terms of 'macs': evaluations must be", {}),
        ({"macs": {"evaluations": {"glyde": 40}}}, "terms of 'macs': unknown problem in evaluations 'glyde', did", {}),
        ({"macs": {"evaluations": {"glide": 0}}}, "terms of 'macs': evaluations of 'glide' must be", {}),
        ({"macs": {"inner": "outer"}}, "terms of 'macs': .*inner level 'outer'", {}),
        ({"macs": {"start": "soft"}}, "terms of 'macs': unknown start 'soft'", {}),
        ({"macs": {"start": 3}}, "terms of 'macs': start must be 'uniform', 'smooth'", {}),
        ({"macs": {"start": {"spread": 2.0}}}, "spread must be in", {}),
        ({"macs": {"transcription": ["dfet:2x2"]}}, "terms of 'macs': transcription must be one", {}),
        ({"macs": {"transcription": {"glide": ["dfet:2x2"]}}}, "terms of 'macs': transcription must be one, or one for each problem", {}),
        ({"macs": {"transcription": {"glyde": "dfet:2x2"}}}, "terms of 'macs': unknown problem in transcription 'glyde', did", {}),
        ({"macs": {"transcription": {"glide": "dfet"}}}, "terms of 'macs': transcriptions: unknown transcription 'dfet'", {}),
        ({"macs": {"transcription": "dfet:2"}}, "dfet", {}),
    ],
)
def test_terms_and_budgets_that_make_no_sense_are_refused(terms, message, others):
    with pytest.raises(ValueError, match=message):
        study(terms=terms, **others)


# What a case has of its own


def narrow(**own) -> Problem:
    """Half of what is drawn flies too far: how it is made feasible tells."""
    problem = glide(most=6.0)
    for name, value in {"default_inner": "propagate", "default_start": "smooth", **own}.items():
        setattr(problem, name, value)
    return problem


def bare(problem: Problem, **more) -> Study:
    return Study("bare", **{"problems": problem, "solvers": {"plain": Plain()}, "runs": 1, "seed": 1} | more)


@pytest.mark.slow
def test_a_study_that_says_nothing_does_as_the_command_line_does(tmp_path):
    (run,) = bare(narrow()).run(tmp_path / "own", executor=Inline()).runs
    (plain,) = bare(glide(most=6.0)).run(tmp_path / "plain", executor=Inline()).runs
    given = {"evaluations": 60, "seed": run.seed}
    front = Plain().solve(narrow(), parse("dfet:2x2"), inner="propagate", start="smooth", **given)
    assert run.front.F.tolist() == front.F.tolist() == Plain().solve(narrow(), parse("dfet:2x2"), **given).F.tolist()
    assert plain.front.F.tolist() == Plain().solve(glide(most=6.0), parse("dfet:2x2"), **given).F.tolist() != front.F.tolist()


def test_what_a_study_or_a_solver_says_comes_before_what_the_case_says():
    def found(problem=None, **more) -> tuple:
        one = bare(problem or narrow(), **more)
        assert (one.quick().inner_of(one.cells[0]), one.quick().sampling_of(one.cells[0])) == (
            one.inner_of(one.cells[0]),
            one.sampling_of(one.cells[0]),
        )
        return one.inner_of(one.cells[0]), one.sampling_of(one.cells[0])

    assert found() == ("propagate", Smooth()) and found(glide()) == ("auto", None)
    assert found(inner="auto") == ("auto", Smooth()) and found(start="uniform") == ("propagate", "uniform")
    assert found(terms={"plain": {"inner": "ipopt"}}) == ("ipopt", Smooth())
    assert found(terms={"plain": {"start": {"spread": 0.2}}}) == ("propagate", Smooth(spread=0.2))
    assert found(narrow(default_start=Smooth(length=0.2))) == ("propagate", Smooth(length=0.2))
    assert "terms" not in bare(narrow(), inner="auto", start="uniform").cells[0].details


def test_each_problem_has_its_own(tmp_path):
    both = bare(glide(), problems={"plain": glide(), "narrow": narrow()})
    assert [both.inner_of(cell) for cell in both.cells] == ["auto", "propagate"]
    both.run(tmp_path / "out", executor=Inline())
    assert both.status(tmp_path / "out").finished == 2
    with pytest.raises(ValueError, match=r"another study: narrow, dfet:2x2, plain: details\.terms"):
        bare(glide(), problems={"plain": glide(), "narrow": narrow(default_inner="ipopt")}).run(tmp_path / "out")


@pytest.mark.parametrize(
    ("own", "message"), [({"default_inner": "mrch"}, "inner level 'mrch'"), ({"default_start": "soft"}, "unknown start 'soft'")]
)
def test_a_case_whose_own_makes_no_sense_is_named(own, message):
    with pytest.raises(ValueError, match=f"problems: 'glide': .*{message}"):
        bare(narrow(**own))


def test_a_reference_is_held_against_the_problems_before_any_run(tmp_path):
    file = tmp_path / "truth.csv"
    file.write_text("time [s],distance [km]\n1,3\n")
    assert study(reference={"glide": str(file)}).reference and study(reference="union") and study(reference=str(file))
    file.with_name("other.csv").write_text("time [s],mass [kg]\n1,3\n")
    for given, message in (
        ("nowhere.csv", "reference of 'glide'.*nowhere.csv"),
        (str(file.with_name("other.csv")), "reference of 'glide'.*no column 'distance"),
        ("truth", "reference of 'glide'.*a problem that a script states"),
        ("goddart", "reference of 'glide'.*there is no problem 'goddart'"),
        ({"glyde": "union"}, "unknown problem 'glyde', did you mean glide"),
        (7, "reference must be 'union'.*not 7"),
        ({"glide": ["union"]}, "reference must be 'union'"),
    ):
        with pytest.raises(ValueError, match=message):
            study(reference=given)
