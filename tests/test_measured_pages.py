"""Pages of measured results: each has a header, a command that exists, and files that it is of."""

import csv
import importlib.util
import re
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from runs.batch.store import Store
from runs.bench import BENCHES
from runs.bench.contract import Row
from runs.cli import main
from runs.report.comparison import comparisons
from runs.report.comparison_tables import runs_table
from runs.report.page import PageHeader, digest_of_bench, digest_of_study
from runs.report.published import with_count
from runs.study import Study

ROOT = Path(__file__).parents[1]
SCRIPT = ROOT / "docs" / "measured" / "make.py"
spec = importlib.util.spec_from_file_location("make_measured", SCRIPT)
assert spec is not None and spec.loader is not None
make = importlib.util.module_from_spec(spec)
spec.loader.exec_module(make)
PAGES = [page for page in SCRIPT.parent.glob("*.md") if page.name not in ("index.md", "README.md")]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_page_has_a_header_and_a_command_that_exists(page):
    header = PageHeader.read(page.read_text(encoding="utf-8"))
    assert page.stem in make.listed() and f"--page docs/measured/{page.name}" in header.command
    assert all(file.is_file() for file in make.files_of(header.command))


def test_every_benchmark_is_of_files():
    for files in (one.sources for one in BENCHES.values()):
        assert len(files) > 1 and all(file.is_file() for file in files) and len(set(files)) == len(files)
    assert any(file.name == "functions.py" for file in BENCHES["uf"].sources) and BENCHES["study"].sources[0].name == "workers.py"
    assert "macs.search.macs" in BENCHES["uf"].code and "macs.gradient_tools" in BENCHES["peers"].code


def stub(monkeypatch, ends: BaseException | None = None) -> None:
    """The benchmark of populations with given values; it may end by Ctrl-C."""

    def prepare(case, effort, steps):
        def measured(number):
            yield from (Row.once("case", who, speed=5.0, candidates=100.0) for who in ("one by one", "in one call"))
            if ends:
                raise ends

        return measured

    monkeypatch.setitem(BENCHES, "population", replace(BENCHES["population"], prepare=prepare))


def made(tmp_path, monkeypatch) -> Path:
    """The page of a benchmark whose values are given."""
    stub(monkeypatch)
    page = tmp_path / "bench-population.md"
    assert main(["bench", "population", "--quick", "--page", str(page)]) == 0
    monkeypatch.setattr(make, "listed", lambda: {page.stem: (1, "")})
    return page


def test_a_page_of_a_benchmark(tmp_path, monkeypatch, capsys):
    page = made(tmp_path, monkeypatch)
    text = page.read_text()
    header = PageHeader.read(text)
    assert header.command == f"macs bench population --quick --page {page}"
    assert header.digest == digest_of_bench(BENCHES["population"].sources)
    assert "POPULATIONS" in text and "at least 4 times as fast" in text and text.count("```") == 2
    assert "POPULATIONS" in capsys.readouterr().out
    assert make.main(["--check"], tmp_path) == 0
    said = capsys.readouterr().out
    assert f"bench-population.md: {header.command}" in said and "OUT OF DATE" not in said
    monkeypatch.setattr(make, "listed", lambda: {page.stem: (1, ""), "another": (1, "")})
    assert make.main(["--check"], tmp_path) == 1 and "not made yet: another" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("digest: ", "digest: 0", "OUT OF DATE: what states it"),
        ("code: ", "code: macs.none 0, ", "OUT OF DATE: macs.none"),
        ("macs bench population", "macs bench populations", "makes no page"),
        ("macs bench population", "macs list", "there is no command"),
        ("--page", "--csv", "makes no page"),
        ("<!-- made by", "made by", "does not begin"),
    ],
)
def test_pages_that_are_wrong_are_named(old, new, words, tmp_path, monkeypatch, capsys):
    page = made(tmp_path, monkeypatch)
    page.write_text(page.read_text().replace(old, new, 1))
    capsys.readouterr()
    assert make.main(["--check"], tmp_path) == 1 and words in capsys.readouterr().out


def test_every_page_is_listed_with_its_minutes():
    listed = make.listed()
    assert {page.stem for page in PAGES} <= listed.keys() and list(listed.values()) == sorted(listed.values())
    assert all(file.is_file() for _, command in listed.values() for file in make.files_of(command))
    assert make.files_of("macs study report out/goddard-table3") == [ROOT / "runs" / "studies" / "goddard-table3.toml"]
    for text in (tomllib.loads(file.read_text())["description"] for file in make.STUDIES.glob("*.toml")):
        assert not re.search(r"\b\d+ runs", text), f"a page says how many runs there are, {text} need not"
    assert sum(minutes for minutes, _ in listed.values()) <= 16 * 60, "eight hours of two processors"


@pytest.mark.parametrize("page", [page for page in PAGES if not page.stem.startswith("bench-")], ids=lambda page: page.name)
def test_a_page_has_the_words_of_its_study(page):
    text, file = page.read_text(encoding="utf-8"), make.STUDIES / f"{page.stem}.toml"
    if PageHeader.read(text).digest == digest_of_study(file):  # else it is out of date
        study = Study.load(file)
        stated = [study.description, study.note, *study.pictures.values()]
        stated += [one[word] for one in study.paper for word in ("source", "note", "differs") if word in one]
        assert [words for words in stated if with_count(words, {"runs": study.runs}) not in text] == []


SMALL = """name = "small"
problems = ["goddard"]
transcriptions = ["dfet:2x3"]
evaluations = 100
runs = 1
seed = 1
solvers = {MACS = {solver = "macs", mesh = "fixed"}, NSGA-II = {solver = "nsga2", population = 10}}
"""


@pytest.mark.slow
def test_a_page_is_confirmed_by_first_runs_with_the_same_numbers(tmp_path, monkeypatch, capsys):
    page, file, other = tmp_path / "small.md", tmp_path / "small.toml", tmp_path / "other"
    command = "macs study report out/small --page docs/measured/small.md"
    other.mkdir()
    file.write_text(SMALL)
    monkeypatch.chdir(tmp_path)
    for name in ("HERE", "STUDIES", "ROOT"):
        monkeypatch.setattr(make, name, tmp_path)
    monkeypatch.setattr(make, "_made", lambda page, beside: True)
    monkeypatch.setattr(make, "_done", lambda words, at: monkeypatch.chdir(at) or main([words[0], words[1], str(file), *words[3:]]) == 0)
    assert main(["study", "run", str(file)]) == 0
    data = runs_table(comparisons(Store.open("out/small"), {})).csv().replace("NSGA-II,1,100", "NSGA-II,1,99")
    for found, beside in (("100", None), ("99", None), ("99", other)):
        page.with_suffix(".csv").write_text(data.replace("MACS,1,100", f"MACS,1,{found}"))
        old = str(PageHeader.now(command, *make.now(command)))
        page.write_text(re.sub(r"macs\.refinement \w+", "macs.refinement 0", old) + "\n\nData of all runs: [CSV](small.csv).\n")
        confirmed = make.confirm("small", command, 1, beside)
        assert confirmed is (old in page.read_text()) is (found == "100" or beside == other)
        assert ("changed since in macs.refinement; the first run of MACS was made again by it" in page.read_text()) is confirmed
    assert "'evaluations' of goddard, dfet:2x3, MACS, 1 is 100, not 99" in capsys.readouterr().out
    assert "as by the old code beside it" in page.read_text()
    again = [Store.open(folder / "out" / "small-again") for folder in (tmp_path, other)]
    assert [[run.finished for run in store.runs()] for store in again] == 2 * [[True, False]], "NSGA-II does not depend on that code"


def test_runs_without_a_point_are_infinitely_far_away_in_the_data():
    rows = [row for file in SCRIPT.parent.glob("*.csv") for row in csv.DictReader(file.read_text(encoding="utf-8").splitlines())]
    empty = [row for row in rows if row["points"] == "0" and row["IGD"]]
    assert empty and {(row["GD"], row["IGD"]) for row in empty} == {("inf", "inf")}


def test_the_index_of_papers_leads_somewhere(monkeypatch, tmp_path):
    text = (SCRIPT.parents[1] / "measured.md").read_text(encoding="utf-8")
    assert text.partition(make.BEGINS)[2].partition(make.ENDS)[0].strip() == make.index().strip(), (
        "`python docs/measured/make.py` writes it"
    )
    monkeypatch.setattr(make, "HERE", tmp_path / "measured")
    make.HERE.mkdir()
    (make.HERE / "pages.toml").write_text("studies.one = 1\nbenches = {}\n")
    rows = make.HERE / "papers.toml"
    for row, words in (("", "leads nowhere"), (", at = ['two']", "no page 'two'"), (", at = ['none.md']", "no page 'none.md'")):
        rows.write_text(f"paper = [{{title = 'A', rows = [{{is = 'Table 1', of = 'all'{row}}}]}}]")
        with pytest.raises(ValueError, match=words):
            make.index()
    rows.write_text("paper = [{title = 'A', rows = [{is = 'Table 1', of = 'all', at = ['one']}]}]")
    assert "| Table 1 | all | one, to be made |  |" in make.index()
    (make.HERE / "one.md").write_text("# one")
    assert "[one](measured/one.md)" in make.index()


def test_what_is_out_of_date_is_made_again_the_cheapest_first(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(make, "listed", lambda: {"bench-zdt": (1, "macs bench zdt"), "mine": (60, "macs study report out/mine")})
    ran: list[list[str]] = []
    monkeypatch.setattr(make, "write_index", lambda: None)
    monkeypatch.setattr(make, "_done", lambda words: bool(ran.append(words)) or "mine" not in words)
    assert make.main([], tmp_path) == 1
    said = capsys.readouterr()
    assert "2 pages, about 1.0 h" in said.out and "not made: mine" in said.err
    assert ran == [
        ["bench", "zdt", "--jobs", "2", "--keep", "out/bench-zdt"],
        ["study", "run", "mine", "--out", "out/mine", "--jobs", "2", "--fresh"],
    ]
    monkeypatch.setattr(make, "HERE", tmp_path)
    monkeypatch.setattr(make, "_done", lambda words: True)
    (tmp_path / "mine.md").write_text("![new](mine-new.png)")
    for picture in ("mine-new.png", "mine-old.png"):
        (tmp_path / picture).touch()
    assert make.main(["mine"], tmp_path) == 0 and [one.name for one in tmp_path.glob("*.png")] == ["mine-new.png"]
    monkeypatch.setattr(make, "_done", lambda words: (_ for _ in ()).throw(KeyboardInterrupt))
    assert make.main(["mine"], tmp_path) == make.INTERRUPTED and "goes on" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        make.main(["yours"], tmp_path)


def test_what_was_interrupted_makes_no_page(tmp_path, monkeypatch, capsys):
    stub(monkeypatch, KeyboardInterrupt())
    main(["bench", "population", "--page", str(tmp_path / "a.md")])
    assert "POPULATIONS" in capsys.readouterr().out and not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--page", "a.md"], "of which one?"),
        (["inner", "--page", "nowhere/a.md"], "there is no folder"),
        (["inner", "--page", "a>b.md"], "'>'"),
    ],
)
def test_wrong_pages_are_refused_before_any_work(words, said, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert main(["bench", *words]) == 2 and said in capsys.readouterr().err and not list(tmp_path.iterdir())


@pytest.mark.slow
def test_the_script_runs_by_itself():
    done = subprocess.run([sys.executable, str(SCRIPT), "--check"], capture_output=True, text=True, cwd=ROOT, timeout=60)
    assert done.returncode in (0, 1) and done.stderr == "" and len(done.stdout.splitlines()) == len(PAGES) + 1


def test_terms_of_table_vii_are_those_that_its_study_of_parametrisations_found_the_best():
    names = ("parametrisations", "table7", "table7-smooth")
    choosing, *both = (tomllib.loads((make.STUDIES / f"reentry-{name}.toml").read_text()) for name in names)
    best: dict[tuple[str, str], tuple[float, str]] = {}  # by solver and start
    section, inside = "", False
    for line in (SCRIPT.parent / "reentry-parametrisations.md").read_text(encoding="utf-8").splitlines():
        if line.startswith("## "):
            section = line.removeprefix("## reentry_case1, ")
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 11:
            inside = cells[0] == "hypervolume" or (inside and not cells[0])
            if inside:
                terms = choosing["terms"].get(cells[1], {})
                found = float(cells[6]), terms.get("transcription", section)
                place = cells[1].removesuffix(", uniform"), terms.get("start", choosing["start"])
                best[place] = max(best.get(place, found), found)
    stated = set()
    for stating, label in ((study, label) for study in both for label in study["terms"]):
        solver, start, one = label.removesuffix(", equal time"), stating["start"], stating["terms"][label]
        if not label.endswith(", as printed") and not label.startswith("sweep"):  # gradients alone have meshes of their own
            assert one["transcription"] == best[solver, start][1], label
            assert stating["solvers"][label] == choosing["solvers"][solver]
            stated.add((solver, start))
    for solver in {solver for solver, _ in best}:
        assert max((place for place in best if place[0] == solver), key=lambda place: best[place]) in stated
    assert all(one["terms"].keys() == one["solvers"].keys() and one["seed"] != choosing["seed"] for one in both)
