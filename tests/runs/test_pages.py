"""Pages of measured results, their headers, and what only verified points and counted work may decide in reports."""

import csv
import hashlib
import re
import shutil
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from misbehaving import Plain
from test_study import Inline

from macs import NSGA2
from macs.front import Front
from macs.fronts.points import Points
from problems import load
from runs import Study
from runs.batch.store import Store
from runs.cli import main
from runs.report.comparison import AXES, CHARGED, PROCESSOR, Charge, comparisons, histories, spent
from runs.report.page import PageHeader, digest, digest_of_study
from transcription import DFET
from transcription.inner.base import solves_charge

TOML = """name = "small"
description = "A small study"
problems = ["goddard"]
transcriptions = ["dfet:2x3"]
inner = "projection"
evaluations = 100
runs = 2
seed = 1
note = "Of no use but here."

[solvers]
plain = {solver = "macs", refine = false}
gradients = {solver = "macs", mesh = "fixed"}
"as published" = {solver = "macs", paper = true}
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory) -> Path:
    """A study file, and its finished runs in `out`."""
    base = tmp_path_factory.mktemp("pages")
    (base / "small.toml").write_text(TOML)
    assert Study.load(base / "small.toml").run(base / "out", executor=Inline()).finished == 6
    return base


def page_of(place: Path, *more: str) -> int:
    return main(["study", "report", str(place / "out"), "--page", str(place / "small.md"), "--study", str(place / "small.toml"), *more])


@pytest.mark.slow
def test_a_page_has_tables_pictures_and_where_they_are_from(place, capsys):
    assert page_of(place) == 0
    text = (place / "small.md").read_text()
    header = PageHeader.read(text)
    assert header.digest == digest_of_study(place / "small.toml")
    assert header.command == f"macs study report {place / 'out'} --page {place / 'small.md'} --study {place / 'small.toml'}"
    for words in ("# small", "A small study", "Of no use but here.", "6 runs", "casadi", "## goddard, dfet:2x3", "| indicator | solver |"):
        assert words in text, words
    before, _, after = text.partition("## goddard")
    assert "**Medians of a run.**" in before and "<details>" not in before and after.index("![") < after.index("<details>")
    assert "more than one code" not in text and "transcription.elements" in header.code and "runs.measures" in header.code
    rows = list(csv.DictReader((place / "small.csv").read_text().splitlines()))
    assert len(rows) == 6 and {row["run"] for row in rows} == {"1", "2"} and all(float(row["evaluations"]) == 100 for row in rows)
    assert all(float(row["IGD"]) >= 0 and float(row["time [s]"]) > 0 for row in rows) and "[CSV](small.csv)" in text
    pictures = [line.split("](")[1].rstrip(")") for line in text.splitlines() if line.startswith("![")]
    assert len(pictures) == 2 and all((place / one).read_bytes().startswith(b"\x89PNG") for one in pictures)


@pytest.mark.slow
def test_a_study_says_which_pictures_its_page_has_and_what_stands_below_them(place, capsys):
    def stated(words: str) -> int:
        (place / "small.toml").write_text(TOML.replace("[solvers]", f"[pictures]\n{words}\n[solvers]"))
        return page_of(place)

    try:
        assert stated('paths = "Figure 2: paths."\n"dfet-2x3-fronts" = "Figure 1: fronts."') == 0
        text = (place / "small.md").read_text()
        pictures = re.findall(r"^!\[.*\]\((.*)\)\n\n(.*)$", text, re.MULTILINE)
        assert pictures == [(f"small-goddard-dfet-2x3-{one}.png", f"Figure {k}: {one}.") for k, one in ((1, "fronts"), (2, "paths"))]
        assert stated('fronts = ""\n"dfet-2x3-fronts" = ""\nronts = ""') == 2 and "ends with fronts, ronts" in capsys.readouterr().err
    finally:
        (place / "small.toml").write_text(TOML)


@pytest.mark.slow
def test_no_page_of_a_study_that_has_changed_or_is_not_finished(place, capsys):
    file, page = place / "small.toml", place / "small.md"
    page.unlink(missing_ok=True)
    for changed, words in (
        (TOML.replace("= 100", "= 101"), "contains another study"),
        (TOML.replace("Of no", "Of much"), "note of the study changed after its last run"),
    ):
        file.write_text(changed)
        assert page_of(place) == 2 and words in capsys.readouterr().err
    file.write_text(TOML)
    lost = next(Store.open(place / "out").runs()).path
    content, record = lost.read_bytes(), lost.with_suffix(".json").read_bytes()
    lost.unlink()
    try:
        assert page_of(place) == 2 and "1 run of" in capsys.readouterr().err
    finally:
        lost.write_bytes(content)
        lost.with_suffix(".json").write_bytes(record)
    assert page_of(place, "--no-figures") == 2 and not page.exists()


def test_gradient_solves_are_charged_by_counted_work(place):
    [comparison] = comparisons(Store.open(place / "out"), {})
    charge = Charge.of(comparison)
    assert charge is not None
    each = {solver: np.mean([run.front.stats["charge"] / 100 for run in comparison.runs[solver]]) for solver in ("plain", "as published")}
    assert charge.unit == pytest.approx(min(each.values())) and charge.solver == min(each, key=each.get)
    costs = spent(comparison, charge)
    for solver, runs in comparison.runs.items():
        assert all(0.0 < value < run.wall_time + 0.1 for run, value in zip(runs, costs[PROCESSOR][solver], strict=True))
    for run, charged in zip(comparison.runs["gradients"], costs[CHARGED]["gradients"], strict=True):
        stats = run.front.stats
        assert stats["gradient_solves"] > 0 and charged == pytest.approx(stats["charge"] / charge.unit) and charged > stats["evaluations"]
    assert np.mean(costs[CHARGED][charge.solver]) == pytest.approx(100)
    reached = histories(comparison, comparison.against, "IGD", CHARGED, charge)
    assert [float(moments[-1]) for moments, _ in reached["gradients"]] == pytest.approx(costs[CHARGED]["gradients"])
    assert CHARGED in AXES and not histories(comparison, comparison.against, "IGD", CHARGED)


@pytest.mark.slow
def test_gradient_solves_on_another_transcription_are_charged_as_there(tmp_path):
    study = Study(
        "mixed",
        problems="goddard",
        transcriptions="shooting:20",
        solvers={"nsga2": NSGA2(population=10), "polished": Plain(refine=True, polish_on="dfet:2x3", polish_every=10)},
        inner="propagate",
        evaluations=60,
        runs=1,
        seed=1,
    )
    study.run(tmp_path / "out", executor=Inline())
    [comparison] = comparisons(Store.open(tmp_path / "out"), {})
    charge = Charge.of(comparison)
    assert charge is not None
    (plain,), (polished,) = comparison.runs["nsga2"], comparison.runs["polished"]
    assert charge(plain.front.stats) == pytest.approx(60)
    stats = polished.front.stats
    solves = solves_charge(DFET(2, 3).transcribe(load("goddard")), stats["gradient_solves"], sum(stats["iterations_for"].values()))
    assert 0.9 * solves < stats["charge"] - 60 * charge.unit < 1.1 * solves


@pytest.mark.slow
def test_unions_hold_only_what_a_simulation_found(place, tmp_path):
    shutil.copytree(place / "out", tmp_path / "out")
    store = Store.open(tmp_path / "out")
    [before] = comparisons(store, {})
    # A point that claims to be better than all, which a simulation does not find, joins a run.
    run = before.runs["plain"][0]
    best = np.min([front.F.min(axis=0) for front in before.every if len(front)], axis=0) - 1.0
    false = run.front[[0]].replace(F=best[None], verified=np.array([False]))
    joined = Front.of(Points.concatenate([run.front, false])).sorted()
    joined.save(run.path)
    run.path.with_suffix(".json").unlink()
    [after] = comparisons(Store.open(tmp_path / "out"), {})
    assert after.counting["plain"][0].claimed == before.counting["plain"][0].claimed + 1
    np.testing.assert_array_equal(after.union().front.F, before.union().front.F)
    # Confirmed, it would be the whole union.
    nothing = np.zeros(len(joined))
    joined.replace(verified=nothing == 0, defect=nothing, simulated_violation=nothing, simulated_F=joined.F).save(run.path)
    [confirmed] = comparisons(Store.open(tmp_path / "out"), {})
    np.testing.assert_array_equal(confirmed.union().front.F, best[None])
    # The same by a program of which nothing can be simulated.
    [foreign] = comparisons(Store.open(place / "out"), {"theirs": [false]})
    assert len(foreign.fronts["theirs"][0]) == 1 and foreign.union().what == "the union of 6 runs"
    np.testing.assert_array_equal(foreign.union().front.F, before.union().front.F)


def test_header_as_written_is_read_again():
    stated = digest('name = "one"')
    header = PageHeader.now("macs study report out/one --page one.md", stated, {"macs.search.macs": "1", "macs.search.trials": "2"})
    assert header.date == date.today().isoformat()
    assert header.digest == hashlib.sha256(b'name = "one"').hexdigest()
    text = str(header)
    assert text.splitlines()[0] == "<!-- made by: macs study report out/one --page one.md"
    assert [line.split(": ")[0] for line in text.splitlines()[1:]] == ["digest", "code", "version", "date"] and text.endswith(" -->")
    assert PageHeader.read(f"{text}\n\n# One\n\n<!-- more -->\n") == header
    assert not header.different(stated, {"macs.search.macs": "1", "macs.search.trials": "2"})
    assert header.different("other", {"macs.search.macs": "2", "macs.search.trials": "2"}) == ["what states it", "macs.search"]
    gallery = replace(header, code="")
    assert PageHeader.read(str(gallery)) == gallery and not gallery.different(stated, {})
    assert gallery.different(stated, {"macs.search.macs": "1"}) == ["unknown code"]


def test_words_of_a_study_are_not_in_its_digest(tmp_path):
    def of(*, runs=2, note="A", differs="B", value=1.0, words="C", figure="fronts"):
        file = tmp_path / "study.toml"
        paper = f'[[paper]]\ndiffers = "{differs}"\nrows = [{{x = {value}}}]\n'
        file.write_text(f'runs = {runs}  # {note}\nnote = "{note}"\npictures = {{{figure} = "{words}"}}\n{paper}')
        return digest_of_study(file)

    assert of() == of(note="D") == of(differs="D") == of(words="D")
    assert len({of(), of(runs=3), of(value=2.0), of(figure="means")}) == 4


@pytest.mark.parametrize("text", ["# One\n", "<!-- made by: x\ndigest: y\nversion: z -->", "<!-- made by: x"])
def test_what_is_no_header_is_refused(text):
    with pytest.raises(ValueError, match="does not begin"):
        PageHeader.read(text)


@pytest.mark.parametrize("command", ["", "a --> b", "a\u2028b"])
def test_entries_that_would_end_the_comment_are_refused(command):
    with pytest.raises(ValueError, match="made by"):
        PageHeader(command, "d", "v", "2026-01-01")
