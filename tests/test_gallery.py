"""The gallery: each page is that of its script, every case has one, and what was learned can be seen on it."""

import importlib.util
import re
import sys
from pathlib import Path

import pytest

from problems import names
from problems.catalogue import STANDARD

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs" / "gallery"
spec = importlib.util.spec_from_file_location("make_gallery", FOLDER / "make.py")
assert spec is not None and spec.loader is not None
make = importlib.util.module_from_spec(spec)
sys.modules["make_gallery"] = make
spec.loader.exec_module(make)
SCRIPTS = make.scripts()
ALL = 4_000_000
"""Bytes of all pictures."""
SHORT, LONG = 4, 40
"""Lines of a script."""
QUICK = ("goddard", "bryson_denham", "car")
"""Scripts that are run here."""
NUMBER = re.compile(r"(?<![\w.#])[\u2212-]?\d[\d,]*(?:\.\d+)?(?:e[+-]?\d+)?(?![\w.]*\w)")
SMALL = 12
"""Whole numbers up to this may be counts."""


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.name)
def test_a_page_is_that_of_its_script(script):
    kept = script.result()
    assert kept is not None, "its code is other than that of the page, or its problem has changed: make gallery"
    assert script.is_current(), "its words are other than those of the page: make gallery"
    assert kept[0].command == f"python docs/gallery/make.py {script.name}"
    assert SHORT <= len(script.code.splitlines()) <= LONG


def test_every_case_and_a_dozen_published_problems_have_a_page():
    shown = [case for script in SCRIPTS for case in script.cases]
    assert {name for name in names() if not name.startswith(STANDARD)} <= set(shown)
    assert sum(case.startswith(STANDARD) for case in shown) >= 12 and set(shown) <= set(names())


def test_the_index_is_of_all_scripts():
    text = (FOLDER / "index.md").read_text(encoding="utf-8")
    assert text == make.index(SCRIPTS)
    assert set(re.findall(r'src="([^"]+)"', text)) == {f"{script.name}-1.png" for script in SCRIPTS}


def test_pictures_are_small_and_all_are_shown():
    pictures = {path.name: path.stat().st_size for path in FOLDER.glob("*.png")}
    shown = [name for script in SCRIPTS for name in re.findall(r"\]\(([\w-]+\.png)\)", script.page.read_text(encoding="utf-8"))]
    assert set(pictures) == set(shown)
    assert max(pictures.values()) <= make.LARGEST and sum(pictures.values()) <= ALL


def numbers(text: str) -> list[str]:
    return [found.replace(",", "").replace("\N{MINUS SIGN}", "-") for found in NUMBER.findall(text)]


def is_seen(number: str, seen: list[float]) -> bool:
    """Whether this is one of the numbers, rounded to as many digits."""
    mantissa = number.partition("e")[0]
    digits = len(mantissa.partition(".")[2])
    half = 0.5 * 10.0 ** (-digits) * (10.0 ** float(number.partition("e")[2] or 0))
    return any(abs(abs(float(number)) - abs(value)) <= half * (1 + 1e-9) for value in seen)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.name)
def test_numbers_in_what_was_learned_are_on_the_page(script):
    """In what was printed, in the code, or in the statement of the problem."""
    sentences = re.findall(r"[^.!?]+(?:\.\d+[^.!?]*)*[.!?]", script.learned)
    assert 2 <= len(sentences) <= 8, sentences
    kept = script.result()
    assert kept is not None
    seen = [float(number) for number in numbers(script.text + script.code + kept[1])]
    missing = [n for n in numbers(script.learned) if not is_seen(n, seen) and not (n.isdigit() and int(n) <= SMALL)]
    assert not missing


def test_a_number_that_was_not_printed_is_missed():
    assert is_seen("1.2", [1.24]) and is_seen("1e-3", [9.6e-4]) and not is_seen("1.25", [1.24]) and not is_seen("3", [2.4])
    assert numbers("#5 takes 1,200 s, −3.5 km and 2e-5 of x1") == ["1200", "-3.5", "2e-5"]


def test_a_change_is_noticed(tmp_path, monkeypatch, capsys):
    """Of the words: the results stay. Of the code: they do not count. Of the problem: nor then."""
    monkeypatch.setattr(make, "HERE", tmp_path)
    text = (FOLDER / "car.py").read_text(encoding="utf-8")
    path = tmp_path / "car.py"
    path.write_text(text)
    (tmp_path / "car.md").write_bytes((FOLDER / "car.md").read_bytes())
    assert make.main(["--check"]) == 0 and "all are" in capsys.readouterr().out
    path.write_text(text.replace("What was learned\n#\n", "What was learned\n#\n# Much.\n"))
    script = make.Script.read(path)
    assert script.result() is not None and not script.is_current()
    assert make.main(["--check"]) == 1 and "car" in capsys.readouterr().out.splitlines()[-1]
    assert make.main([]) == 0 and "Much." in (tmp_path / "car.md").read_text() and make.main(["--check"]) == 0
    path.write_text(text.replace("print(best", "print()\nprint(best"))
    assert make.Script.read(path).result() is None
    path.write_text(text)
    page = tmp_path / "car.md"
    page.write_text(page.read_text().replace("digest: ", "digest: 0", 1))
    assert make.Script.read(path).result() is None and make.main(["--check"]) == 1


@pytest.mark.parametrize(
    "text", ["", "x = 1\n", '"""Title\n\nText.\n"""\nx = 1\n', '"""Title\n"""\nx = 1\n\n# What was learned\n#\n# A.\n']
)
def test_a_script_without_its_parts_is_refused(text, tmp_path):
    path = tmp_path / "bad.py"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"bad\.py needs a title"):
        make.Script.read(path)


def test_an_unknown_script_is_refused(capsys):
    with pytest.raises(SystemExit):
        make.main(["nowhere"])
    assert "there is no script nowhere" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("name", QUICK)
def test_a_script_runs_and_shows_what_its_page_says(name):
    script = make.Script.read(FOLDER / f"{name}.py")
    shown = make.show(script.path)
    page = script.page.read_text(encoding="utf-8")
    assert page.count(f"({name}-") == len(shown.pictures) and all(words in page for _, words in shown.pictures)
    assert all(len(picture) <= make.LARGEST for picture, _ in shown.pictures)
    last = shown.printed.strip().splitlines()[-1].partition(":")[0]
    assert last in page and "verified" in shown.printed
