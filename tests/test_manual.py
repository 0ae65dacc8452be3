"""The manual is true: its code runs and prints what it says, its commands and study files are valid, and its links lead somewhere."""

import contextlib
import io
import json
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from doctest import ELLIPSIS, NORMALIZE_WHITESPACE, OutputChecker
from pathlib import Path
from typing import Any

import pytest
from markdown_it import MarkdownIt

from macs import Front
from macs.solvers.solver import solver_class
from problems import names
from runs import Study
from runs.batch import file as studyfile
from runs.cli import main
from runs.cli.parser import build_parser
from transcription import parse

ROOT = Path(__file__).parents[1]
OTHERS = ("gallery", "notebooks", "api", "measured")
"""Folders of docs/ whose pages are made by commands, and have tests of their own."""
PAGES = [
    ROOT / "README.md",
    *(page for page in sorted((ROOT / "docs").rglob("*.md")) if page.relative_to(ROOT / "docs").parts[0] not in OTHERS),
]
SLOW = (
    "docs/choosing.md",
    "docs/clusters.md",
    "docs/costates.md",
    "docs/curve.md",
    "docs/files.md",
    "docs/first-steps.md",
    "docs/meshes.md",
    "docs/pymoo.md",
    "docs/settings.md",
    "docs/studies.md",
    "docs/sweep-or-search.md",
    "docs/vector-problems.md",
    "docs/verification.md",
    "docs/extending/problem.md",
    "docs/stating/data.md",
    "docs/stating/guesses.md",
    "docs/stating/limits.md",
    "docs/stating/objectives.md",
    "docs/stating/parameters.md",
    "docs/stating/periodic.md",
    "docs/stating/phases.md",
    "docs/stating/tables.md",
)
"""Pages that take more than a second."""
COMMANDS = ("docs/first-steps.md",)
"""Pages whose commands are run, one after the other."""
WORDS = 900
"""What the README may have."""


@dataclass(frozen=True)
class Block:
    """A fenced block of a page: its language, its text, and the line where it begins."""

    language: str
    text: str
    line: int


def blocks(page: Path) -> list[Block]:
    """The fenced blocks of a page, also those in lists; directives of the manual's generator are none."""
    found = [token for token in MarkdownIt().parse(page.read_text(encoding="utf-8")) if token.type == "fence"]
    return [Block(token.info, token.content, (token.map or [0])[0] + 2) for token in found if not token.info.startswith("{")]


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def commands(block: Block) -> Iterator[list[str]]:
    """The arguments of each call of the command line in a block."""
    for line in block.text.splitlines():
        words = shlex.split(line.removeprefix("$ "), comments=True)
        if words[:1] == ["macs"]:
            yield words[1:]


@pytest.mark.parametrize(
    "page", [pytest.param(page, marks=[pytest.mark.slow] * (name_of(page) in SLOW), id=name_of(page)) for page in PAGES]
)
def test_the_code_of_a_page_runs_and_prints_what_it_says(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)  # where a page imports its own file
    monkeypatch.setenv("MPLBACKEND", "Agg")
    space: dict[str, Any] = {"__name__": "__manual__"}
    printed = io.StringIO()
    for block in blocks(page):
        match block.language:
            case "python":
                named = re.match(r"# (\w+\.py)\b", block.text)
                if named:
                    (tmp_path / named[1]).write_text(block.text)
                with contextlib.redirect_stdout(printed):
                    exec(compile("\n" * (block.line - 1) + block.text, page, "exec"), space)
            case "text":
                assert is_printed(block.text, printed.getvalue()), f"line {block.line}: the page prints\n{printed.getvalue()}"
            case "none":
                pass  # a drawing
            case "json":
                json.loads(block.text)
            case "toml":
                Path("stated.toml").write_text(block.text)
                Study.load("stated.toml", trust=True)
            case "shell":
                for arguments in commands(block):
                    check_command(arguments)
                    if name_of(page) in COMMANDS:
                        with contextlib.redirect_stdout(printed):
                            assert main(arguments) == 0
            case _:
                raise AssertionError(f"line {block.line}: a block must be python, text, json, toml or shell, not {block.language!r}")
    EXTRA.get(name_of(page), lambda _: None)(space)


def is_printed(text: str, printed: str) -> bool:
    """Whether this is part of what was printed; "..." in it stands for anything, and spaces for any other number of them."""
    return OutputChecker().check_output(f"... {text.strip()} ...", f"| {printed} |", ELLIPSIS | NORMALIZE_WHITESPACE)


def check_command(arguments: list[str]) -> None:
    """Parse a call of the command line, and the words in it that only its commands would refuse."""
    call = build_parser().parse_args(arguments)
    if call.command == "solve":
        assert call.problem in names() or re.fullmatch(r"[\w/.]+:\w+", call.problem), call.problem
        solver_class(call.solver)
    for word in (getattr(call, "transcription", None), getattr(call, "polish_on", None)):
        if word is not None:
            parse(word)
    if call.command == "study" and call.action == "run":
        assert call.study in studyfile.names() or call.study.endswith(".toml"), call.study


def check_readme(space: dict[str, Any]) -> None:
    """The whole front, up to where it is known to end, verified, and what the comments say."""
    front, again = space["front"], Front.load("ascent.nc")
    assert front.stats["stopped"] == "done" and len(front) == 10 and front.verified.all()
    assert front.objectives[0, 0] == pytest.approx(109.10894, rel=1e-5) and front.objectives[-1].tolist() == pytest.approx([250, 0.90389])
    assert front[3].verified is True and front[3].simulated == pytest.approx(front[3].objectives, rel=1e-6)
    assert max(space["check"].defect["ascent"].values()) < 1e-6 and space["check"].violation < 1e-6
    assert again.F.tobytes() == front.F.tobytes()


def check_choosing(space: dict[str, Any]) -> None:
    """The times of the choices are those of the page."""
    found = [f"{turn.choice.objectives['flight time']:.0f}" for turn in space["dialogue"].history]
    assert found == re.findall(r"# (\d+) s\b", (ROOT / "docs/choosing.md").read_text(encoding="utf-8"))


def check_vector_problems(space: dict[str, Any]) -> None:
    front, again = space["front"], space["again"]
    assert front.verified.all() and again[3].simulate().objectives == front[3].objectives
    listed = re.findall(r"^\| `(\w+)` \|", (ROOT / "docs/vector-problems.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert listed and set(listed) <= set(names())
    assert Path("out/truss/report/four-bar-truss-no-transcription-variables.png").is_file()


def check_aerocapture(space: dict[str, Any]) -> None:
    assert space["front"].verified.all()
    text = (ROOT / "docs/aerocapture.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| `(aerocapture\w*)` \|", text, re.MULTILINE)) <= set(names())
    assert set(re.findall(r"^\| `(aerocapture-\w+)` \|", text, re.MULTILINE)) <= set(studyfile.names())


EXTRA = {
    "README.md": check_readme,
    "docs/choosing.md": check_choosing,
    "docs/vector-problems.md": check_vector_problems,
    "docs/aerocapture.md": check_aerocapture,
}
"""What else is to hold after the code of a page."""


def links(page: Path) -> Iterator[str]:
    """Where links and pictures of a page lead to."""
    for token in MarkdownIt().enable("table").parse(page.read_text(encoding="utf-8")):
        for child in token.children or ():
            target = child.attrGet("href") if child.type == "link_open" else child.attrGet("src") if child.type == "image" else None
            if target is not None:
                yield str(target)


TEXTS = [*ROOT.glob("*.md"), *sorted((ROOT / "docs").rglob("*.md"))]


@pytest.mark.parametrize("page", TEXTS, ids=name_of)
def test_no_link_is_dead(page: Path) -> None:
    for target in links(page):
        if re.match(r"\w+:", target):
            continue
        path, _, anchor = target.partition("#")
        place = (page.parent / path).resolve() if path else page
        assert place.exists() and place.is_relative_to(ROOT), f"{target} leads nowhere"
        if anchor:
            heads = re.findall(r"^#+ (.*)$", place.read_text(encoding="utf-8"), re.MULTILINE)
            assert anchor in {re.sub(r"[^\w -]", "", head.lower()).replace(" ", "-") for head in heads}, f"{target}: no such heading"


def test_every_page_is_in_the_manual() -> None:
    """Each page stands in a table of contents."""
    listed: set[Path] = set()
    for index in (ROOT / "docs").rglob("*.md"):
        for tree in re.findall(r"```\{toctree\}\n(.*?)```", index.read_text(encoding="utf-8"), re.DOTALL):
            for entry in re.findall(r"^(?!:)(\S+)$", tree, re.MULTILINE):
                listed |= {path.resolve() for path in index.parent.glob(f"{entry}.*") if path.suffix in (".md", ".rst")}
    pages = {path for path in (ROOT / "docs").rglob("*") if path.suffix in (".md", ".rst") and "generated" not in path.parts}
    pages = {page for page in pages if "_templates" not in page.parts}
    assert pages - listed == {ROOT / "docs" / "index.md"}
    assert not {page.stem for page in pages if page.parent == ROOT / "docs"} & {"search", "genindex"}, "the generator's own pages"


@pytest.mark.slow
def test_the_manual_is_built_without_a_warning(tmp_path: Path) -> None:
    call = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", ROOT / "docs", tmp_path / "html"]
    done = subprocess.run(call, capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "html" / "api" / "generated" / "macs.MACS.html").is_file()


def test_the_readme_is_one_page() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").split()) <= WORDS
