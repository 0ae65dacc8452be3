"""Makes the pages of measured results: `python docs/measured/make.py` makes those that are out of date, the cheapest first, `--check` says
which these are and why; names of pages make only these.

A page is out of date once what states it, a study but its words or the modules of a benchmark, or the code that its results depend on is
another than when they were made; comments and docstrings are no code. Where only code has changed, `--confirm` makes the first run of each
solver that it may concern again: with the same numbers, the page stays, and says so. `pages.toml` has all pages, with the minutes of a
processor that each takes. Killed or interrupted, the same command goes on with the runs that are missing; those in `out` by other code are
made again.
"""

from __future__ import annotations

import argparse
import csv
import os
import resource
import shlex
import subprocess
import sys
import time
import tomllib
from collections.abc import Collection, Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path

from runs.batch.code import code_of_measures, merged, rooms
from runs.batch.store import Store
from runs.bench import BENCHES
from runs.bench.contest import CONTESTS
from runs.cli.parser import build_parser
from runs.report.comparison import comparisons
from runs.report.comparison_tables import runs_table
from runs.report.page import PageHeader, digest_of_bench, digest_of_study, print_standing, standing
from runs.study import Study

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
STUDIES = ROOT / "runs" / "studies"
SCRIPT = "docs/measured/make.py"
COMMAND = f"python {SCRIPT}"
BEGINS, ENDS = "<!-- index: from papers.toml -->", "<!-- end of the index -->"
INTERRUPTED = 130
"""Exit code after Ctrl-C."""


def listed() -> dict[str, tuple[float, str]]:
    """{name of a page: minutes of one processor, command that makes it}, the cheapest first."""
    stated = tomllib.loads((HERE / "pages.toml").read_text(encoding="utf-8"))
    found = {name: (minutes, _page(f"study report out/{name}", name)) for name, minutes in stated["studies"].items()}
    found |= {name: (minutes, _page(f"bench {words}", name)) for name, (minutes, words) in stated["benches"].items()}
    return dict(sorted(found.items(), key=lambda one: one[1]))


def _page(words: str, name: str) -> str:
    return f"macs {words} --page docs/measured/{name}.md"


def files_of(command: str) -> list[Path]:
    """The files that state what a command measures. Raises ValueError if there is no such command."""
    program, *words = shlex.split(command)
    try:
        arguments = build_parser().parse_args(words)
    except SystemExit:
        raise ValueError(f"there is no command '{command}'") from None
    if program == "macs" and arguments.command == "bench" and arguments.what in BENCHES and arguments.page:
        return BENCHES[arguments.what].sources
    if program == "macs" and arguments.command == "study" and arguments.action == "report":
        return [STUDIES / f"{Path(arguments.folder).name}.toml"]
    raise ValueError(f"'{command}' makes no page")


def now(command: str) -> tuple[str, dict[str, str]]:
    """The digest of what states a page and the code that it depends on, from its command. Raises ValueError if there is no such command."""
    files = files_of(command)
    if files[0].suffix != ".toml":
        return digest_of_bench(files), BENCHES[shlex.split(command)[2]].code
    study = Study.load(files[0])
    return digest_of_study(files[0]), {**merged(study.code(cell) for cell in study.cells), **code_of_measures()}


def index() -> str:
    """Tables of the papers' tables and figures with links to where they are here. Raises ValueError for a row that leads nowhere."""
    known, parts = listed(), []
    for paper in tomllib.loads((HERE / "papers.toml").read_text(encoding="utf-8"))["paper"]:
        parts += [f"**{paper['title']}**", "", "| there | what it shows | here | remarks |", "|---|---|---|---|"]
        for row in paper["rows"]:
            places = [_place(one, known) for one in row.get("at", [])]
            if not places and not row.get("says"):
                raise ValueError(f"{row['is']} of '{paper['title'][:40]}...' leads nowhere, without a reason")
            parts.append(f"| {row['is']} | {row['of']} | {', '.join(places)} | {row.get('says', '')} |")
        parts.append("")
    return "\n".join(parts)


def _place(at: str, known: Collection[str]) -> str:
    """A link to a page of results, if it is made, or of the manual. Raises ValueError if there is no such page."""
    if at in known:
        return f"[{at}](measured/{at}.md)" if (HERE / f"{at}.md").is_file() else f"{at}, to be made"
    if not (HERE.parent / at).is_file():
        raise ValueError(f"papers.toml: there is no page '{at}'")
    return f"[{Path(at).stem}]({at})"


def write_index() -> None:
    """Put the index into its place in the manual."""
    page = HERE.parent / "measured.md"
    before, _, rest = page.read_text(encoding="utf-8").partition(BEGINS)
    page.write_text(f"{before}{BEGINS}\n\n{index()}\n{ENDS}{rest.partition(ENDS)[2]}", encoding="utf-8")


def pages(folder: Path = HERE) -> list[Path]:
    """Those that are there."""
    return [folder / f"{name}.md" for name in listed() if (folder / f"{name}.md").is_file()]


def make(name: str, command: str, jobs: int) -> bool:
    """Make the runs of a page that are missing or by other code, and the page. Returns whether it is there. Raises KeyboardInterrupt."""
    words = shlex.split(command)[1:]
    if words[0] == "study":
        made = _done(["study", "run", name, "--out", words[2], "--jobs", str(jobs), "--fresh"]) and _done(words)
        return made and tidied(name)
    return _done([*words, *(["--jobs", str(jobs), "--keep", f"out/{name}"] if words[1] in CONTESTS else [])])


def confirm(name: str, command: str, jobs: int, beside: Path | None = None) -> bool:
    """Make the first run of each solver that changed code concerns again, in a folder of its own. If its numbers are those of the page, or
    those by the checkout `beside` that made the page, the page is by the code of now, and says so. Returns whether it is."""
    page, out = HERE / f"{name}.md", f"out/{name}-again"
    try:
        if shlex.split(command)[1] != "study" or not page.is_file():
            raise ValueError("it has to be made; only pages of studies that are there can be confirmed")
        text, (stated, code) = page.read_text(encoding="utf-8"), now(command)
        header = PageHeader.read(text)
        if stated != header.digest or not header.code:
            raise ValueError("it has to be made again, since more than code has changed")
        different = header.different(stated, code)
        if not different:
            print(f"{name}: it is by the code of now")
            return True
        if beside is not None and not _made(page, beside):
            raise ValueError(f"the code in '{beside}' is not that which made the page")
        solvers = _concerned(Study.load(STUDIES / f"{name}.toml"), different)
        run = ["study", "run", name, "--out", out, "--runs", "1", "--jobs", str(jobs), "--fresh", "--solvers", *solvers]
        if not all(_done(run, folder) for folder in (ROOT, beside) if folder):
            return False
        again, *old = (runs_table(comparisons(Store.open(folder / out), {})).csv() for folder in (ROOT, beside) if folder)
        _compare(again, old[0] if old else page.with_suffix(".csv").read_text(encoding="utf-8"))
    except ValueError as why:
        print(f"{name}: {why}")
        return False
    said = f"The code has changed since in {', '.join(different)}; the first run of {'; '.join(solvers)} was made again by it"
    said += f" on {date.today().isoformat()}, with the same numbers{' as by the old code beside it' if beside else ''}."
    text = text.replace("Data of all runs:", f"{said} Data of all runs:", 1)
    made = replace(header, code=PageHeader.now(command, stated, code).code)
    page.write_text(text.replace(str(header), str(made), 1), encoding="utf-8")
    return True


def _concerned(study: Study, different: Collection[str]) -> list[str]:
    """The solvers whose runs may depend on changed code: all, if it belongs to none in particular, such as measures."""
    own = {cell: rooms(study.code(cell)).keys() for cell in study.cells}
    others = set(different).difference(*own.values())
    return list(dict.fromkeys(cell.solver for cell in study.cells if others or own[cell] & set(different)))


def _compare(again: str, known: str) -> None:
    """Raises ValueError if a run of one table, in CSV, has other numbers in the other, or no indicators, without a reference of its own."""
    rows = _by_run(known)
    for run, row in _by_run(again).items():
        for word in ("evaluations", "gradient solves", "points", "GD", "IGD", "hypervolume"):
            if not row[word]:
                raise ValueError(f"it has to be made again: '{word}' needs more runs than the first, since its study states no reference")
            if row[word] != rows[run][word]:
                raise ValueError(f"it has to be made again: '{word}' of {', '.join(run)} is {row[word]}, not {rows[run][word]}")


def _made(page: Path, beside: Path) -> bool:
    """Whether a page is current by the code of another checkout."""
    done = subprocess.run([sys.executable, SCRIPT, "--check"], cwd=beside, env=_environment(beside), capture_output=True, text=True)
    return any(line.startswith(f"{page.name}: ") and "OUT OF DATE" not in line for line in done.stdout.splitlines())


def _environment(folder: Path) -> dict[str, str]:
    """That of processes which run the code of a checkout."""
    return os.environ | {"PYTHONPATH": str(folder)}


def _by_run(data: str) -> dict[tuple[str, ...], dict[str, str]]:
    """The rows of CSV by problem, transcription, solver and number of the run."""
    return {tuple(row.values())[:4]: row for row in csv.DictReader(data.splitlines())}


def tidied(name: str) -> bool:
    """Remove pictures of earlier pages of this name that are not on it now; true."""
    text = (HERE / f"{name}.md").read_text(encoding="utf-8")
    for picture in HERE.glob(f"{name}-*.png"):
        if picture.name not in text:
            picture.unlink()
    return True


def _done(words: Sequence[str], folder: Path | None = None) -> bool:
    """Run a command of `macs` in a process of its own, by the code of a checkout; whether it made what it should."""
    folder = folder or ROOT
    print(f"$ macs {shlex.join(words)}", flush=True)
    process = subprocess.Popen([sys.executable, "-m", "runs.cli", *words], cwd=folder, env=_environment(folder))
    while True:
        try:
            process.wait()
            break
        except KeyboardInterrupt:  # the process has it, too, and ends by itself
            continue
    if process.returncode == INTERRUPTED:
        raise KeyboardInterrupt
    return process.returncode == 0 or (words[0] == "bench" and process.returncode == 1)  # targets that are missed are on its page


def _checkout(folder: str) -> Path:
    """A folder with a copy of this project."""
    path = Path(folder).resolve()
    if not (path / SCRIPT).is_file():
        raise argparse.ArgumentTypeError(f"'{folder}' is no checkout of this project: it has no {SCRIPT}")
    return path


def seconds() -> float:
    """Of a processor, of all processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main(arguments: Sequence[str] | None = None, folder: Path = HERE) -> int:
    """Make what is out of date, or name it; returns the exit code."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="Make the pages of measured results that are out of date.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="pages to make, whether they are out of date or not")
    parser.add_argument("--check", action="store_true", help="make nothing, say which are out of date and why; exit code 1 if any is")
    parser.add_argument("--confirm", action="store_true", help="only make again what shows whether code that has changed changes a number")
    parser.add_argument("--beside", metavar="FOLDER", type=_checkout, help="with --confirm: compare with a checkout that made the pages")
    parser.add_argument("--jobs", type=int, default=2, help="processes that work at a time (default: 2)")
    given = parser.parse_args(arguments)
    if given.beside and not given.confirm:
        parser.error("--beside is for --confirm")
    known = listed()
    if unknown := set(given.names) - set(known):
        parser.error(f"there is no page {', '.join(sorted(unknown))}; there are {', '.join(known)}")
    if given.check:
        current = print_standing(pages(folder), now)
        missing = [name for name in known if not (folder / f"{name}.md").exists()]
        print(f"not made yet: {', '.join(missing)}" if missing else "all are made")
        return int(not current or bool(missing))
    write_index()
    todo = [name for name in known if name in given.names or (not given.names and not standing(folder / f"{name}.md", now)[1])]
    total = sum(known[name][0] for name in todo)
    print(f"{len(todo)} pages, about {total / 60:.1f} h of one processor: {', '.join(todo)}", flush=True)
    failed, began = [], time.perf_counter()
    try:
        for number, name in enumerate(todo, 1):
            before, (stated, command) = seconds(), known[name]
            done = confirm(name, command, given.jobs, given.beside) if given.confirm else make(name, command, given.jobs)
            failed += [] if done else [name]
            write_index()
            spent, elapsed = (seconds() - before) / 60, (time.perf_counter() - began) / 60
            print(
                f"{number} of {len(todo)}: {name}, {spent:.1f} min of a processor ({stated:g} stated); {elapsed:.0f} min so far", flush=True
            )
    except KeyboardInterrupt:
        print("interrupted; the same command goes on from there", file=sys.stderr)
        return INTERRUPTED
    if failed:
        print(f"not {'confirmed' if given.confirm else 'made'}: {', '.join(failed)}", file=sys.stderr)
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
