"""Makes the pages of the gallery: `python docs/gallery/make.py` runs each script in this folder whose page is out of date, and writes the
page, its pictures and the index; `--check` only says which are out of date; names of scripts run these in any case.

A script begins with a docstring, the title and the text of its page, and ends with the comment "What was learned". Whatever it prints, and
all its figures, are shown in between. A page is out of date once its code, or its problem (by its fingerprint), is another than when it was
made; where only words are others, the results stay.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import io
import os
import re
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from problems import load
from problems.catalogue import CASES, STANDARD
from runs.report.page import PageHeader, digest, print_standing, standing

HERE = Path(__file__).parent
COMMAND = "python docs/gallery/make.py"
LEARNED = "# What was learned\n"
"""The comment that the end of a script begins with."""
LOADED = re.compile(r'load\("([\w/]+)"')
RESULT, LESSONS = "## Result\n\n", "## What was learned\n\n"
"""Headings of a page."""
DPI, SHADES, LARGEST, ACROSS = 100, (256, 64, 32, 24), 80_000, 3
"""Of pictures; how many colours they may have; their largest size, bytes; pictures in a row of the index."""


@dataclass(frozen=True)
class Script:
    """The parts of a script: title and text of its page, the code, and what was learned."""

    path: Path
    title: str
    text: str
    code: str
    learned: str

    @classmethod
    def read(cls, path: Path) -> Script:
        """Raises ValueError if a part is missing."""
        source = path.read_text(encoding="utf-8")
        tree = ast.parse(source, path.name)
        title, _, text = (ast.get_docstring(tree) or "").partition("\n")
        after = tree.body[0].end_lineno if tree.body else 0
        code, found, learned = "".join(source.splitlines(keepends=True)[after:]).partition(LEARNED)
        lines = learned.splitlines()
        if not title or not text.strip() or not found or not lines or not all(line.startswith("#") for line in lines):
            raise ValueError(f"{path.name} needs a title, a text, and a comment '{LEARNED.strip()}' at its end")
        return cls(path, title.rstrip("."), text.strip(), code.strip() + "\n", "\n".join(line[1:].strip() for line in lines).strip())

    @property
    def name(self) -> str:
        return self.path.stem

    @property
    def cases(self) -> list[str]:
        """Names of the problems that it loads."""
        return list(dict.fromkeys(LOADED.findall(self.code)))

    @property
    def page(self) -> Path:
        return self.path.with_suffix(".md")

    def digest(self) -> str:
        """The digest of its problems, of their fingerprints."""
        return digest(" ".join(map(fingerprint, self.cases)))

    def header(self) -> PageHeader:
        """That of a page which is made now."""
        return PageHeader.now(f"{COMMAND} {self.name}", self.digest(), {})

    def result(self) -> tuple[PageHeader, str] | None:
        """Header and result of its page, unless that is of other code or of another problem."""
        if not self.page.is_file() or not standing(self.page, now)[1]:
            return None
        text = self.page.read_text(encoding="utf-8")
        before, _, after = text.partition(RESULT)
        result, found, _ = after.partition(LESSONS)
        return (PageHeader.read(text), result) if found and before.endswith(f"```python\n{self.code}```\n\n") else None

    def is_current(self) -> bool:
        """Whether its page is as it would be made now."""
        kept = self.result()
        return kept is not None and self.page.read_text(encoding="utf-8") == page(self, *kept)


@dataclass(frozen=True)
class Shown:
    """What a script printed, its pictures as PNG with what they show, and the seconds of a processor that it took."""

    printed: str
    pictures: Sequence[tuple[bytes, str]]
    seconds: float


def scripts() -> list[Script]:
    """All of them, those of the published problems last."""
    found = [Script.read(path) for path in sorted(HERE.glob("*.py")) if path.name != Path(__file__).name]
    order = list(CASES)
    return sorted(found, key=lambda script: min(order.index(case) for case in script.cases))


@cache
def fingerprint(case: str) -> str:
    """That of a problem of the catalogue."""
    return load(case).compile().fingerprint


def now(command: str) -> tuple[str, dict[str, str]]:
    """The digest of the problems of a page, from the command that makes it. Raises ValueError if there is no such command."""
    program, _, name = command.rpartition(" ")
    path = HERE / f"{name}.py"
    if program != COMMAND or not re.fullmatch(r"\w+", name) or not path.is_file():
        raise ValueError(f"there is no command '{command}'")
    return Script.read(path).digest(), {}


def show(path: Path) -> Shown:
    """Run a script as a program, in this process."""
    os.environ["MPLBACKEND"] = "Agg"
    from matplotlib import pyplot

    printed, began = io.StringIO(), time.process_time()
    pyplot.close("all")
    with contextlib.redirect_stdout(printed):
        exec(compile(path.read_text(encoding="utf-8"), str(path), "exec"), {"__name__": "__main__"})
    seconds = time.process_time() - began
    figures = [pyplot.figure(number) for number in pyplot.get_fignums()]
    return Shown(printed.getvalue(), [(_png(figure), _words(figure)) for figure in figures], seconds)


def _png(figure: Any) -> bytes:
    """A figure as a small PNG, of as many colours as it has room for."""
    from PIL import Image

    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=DPI)
    picture = np.asarray(Image.open(drawn).convert("RGB"))
    return next(found for shades in SHADES if len(found := of_few_colors(picture, shades)) <= LARGEST or shades == SHADES[-1])


def of_few_colors(picture: np.ndarray, shades: int) -> bytes:
    """A picture (height, width, 3) as PNG: the most frequent colours as they are, and those in between."""
    from PIL import Image

    small = io.BytesIO()
    colors, places, counts = np.unique(picture.reshape(-1, 3), axis=0, return_inverse=True, return_counts=True)
    between = Image.fromarray(colors[None]).quantize(shades // 2).getpalette() or []
    palette = np.vstack([colors[np.argsort(-counts)[: shades // 2]], np.array(between, dtype=np.uint8).reshape(-1, 3)[: shades // 2]])
    nearest = cKDTree(palette.astype(float)).query(colors.astype(float))[1]
    result = Image.fromarray(nearest[places].reshape(picture.shape[:2]).astype(np.uint8))
    result.putpalette(palette.ravel().tolist())
    result.save(small, format="png", optimize=True)
    return small.getvalue()


def _words(figure: Any) -> str:
    """What a figure shows, for those who cannot see it: the labels of its axes."""
    up = [label for ax in figure.axes if (label := ax.get_ylabel())]
    across = next((label for ax in figure.axes if (label := ax.get_xlabel())), "") or figure.get_supxlabel()
    named = [" ".join(text.get_text().split()) for text in figure.axes[0].get_xticklabels()]
    words = f"{', '.join(up)} over {across}" if up else f"parallel coordinates: {', '.join(named)}"
    return " ".join(re.sub(r"[\N{LEFTWARDS ARROW}\N{RIGHTWARDS ARROW}]", "", words).replace("[", "(").replace("]", ")").split())


def result(script: Script, shown: Shown) -> str:
    """What a script printed and drew, as text of its page."""
    printed = "\n".join(line.rstrip() for line in shown.printed.strip("\n").splitlines())
    pictures = "\n\n".join(f"![{words}]({script.name}-{i}.png)" for i, (_, words) in enumerate(shown.pictures, 1))
    took = f"It took {max(1, round(shown.seconds))} s of one processor, with all that the script does."
    return f"```text\n{printed}\n```\n\n{pictures}\n\n{took}\n\n"


def page(script: Script, header: PageHeader, shown: str) -> str:
    """The text of the page of a script."""
    said = f"{header}\n\n# {script.title}\n\n{script.text}\n\n## Script\n\n```python\n{script.code}```\n\n"
    return f"{said}{RESULT}{shown}{LESSONS}{script.learned}\n"


def index(found: Sequence[Script]) -> str:
    """The text of the index, with a picture of each page."""
    own = [script for script in found if not script.cases[0].startswith(STANDARD)]
    published = [script for script in found if script not in own]
    tree = "\n".join(script.name for script in found)
    return f"""# Gallery

Each page is a short script, what it prints and draws, and what was learned. Points are simulated, and marked where that does not confirm
them. `make gallery` runs the scripts whose pages are out of date; `{COMMAND} --check` says which these are.

## Fronts

Most come from papers; what these leave open is chosen, and said in the module of the case. Both re-entries after Betts have one objective.
All are in `problems/cases`.

{grid(own)}

## Published optima

Problems of one objective, solved by `optimize` without options, beside the value that was published. All are in
`problems/cases/standard`; `macs bench standard` solves every one.

{grid(published)}

```{{toctree}}
:hidden:
:maxdepth: 1

{tree}
```
"""


def grid(found: Sequence[Script]) -> str:
    """A table of pictures that lead to the pages."""
    cells = [
        f'[<img src="{one.name}-1.png" alt="{one.title}" height="140px">]({one.name}.md)<br>[{one.title}]({one.name}.md)' for one in found
    ]
    rows = [cells[i : i + ACROSS] for i in range(0, len(cells), ACROSS)]
    lines = [f"| {' | '.join(row + [''] * (ACROSS - len(row)))} |" for row in rows]
    empty = f"|{'  |' * ACROSS}"
    return "\n".join([empty, f"|{' --- |' * ACROSS}", *lines])


def write(script: Script, shown: Shown) -> None:
    """Write the page and the pictures of a script, and remove old pictures."""
    for old in HERE.glob(f"{script.name}-*.png"):
        old.unlink()
    for i, (picture, _) in enumerate(shown.pictures, 1):
        (HERE / f"{script.name}-{i}.png").write_bytes(picture)
    script.page.write_text(page(script, script.header(), result(script, shown)), encoding="utf-8")


def run(stale: Sequence[Script], jobs: int) -> Iterator[tuple[Script, Shown]]:
    """Run scripts in processes of their own, several at a time."""
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), max_tasks_per_child=1) as pool:
        waiting = {pool.submit(show, script.path): script for script in stale}
        for done in as_completed(waiting):
            yield waiting[done], done.result()


def main(arguments: Sequence[str] | None = None) -> int:
    """Make what is out of date; returns the exit code."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="Make the pages of the gallery that are out of date.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="scripts to run, whether their pages are out of date or not")
    parser.add_argument("--all", action="store_true", help="run all scripts")
    parser.add_argument("--check", action="store_true", help="run nothing, say which pages are out of date; exit code 1 if any is")
    parser.add_argument("--jobs", type=int, default=2, help="scripts that run at a time (default: 2)")
    given = parser.parse_args(arguments)
    found = scripts()
    unknown = set(given.names) - {script.name for script in found}
    if unknown:
        parser.error(f"there is no script {', '.join(sorted(unknown))}; there are {', '.join(script.name for script in found)}")
    if given.check:
        current = print_standing((script.page for script in found), now)
        differ = [script.name for script in found if not script.is_current()]
        print(f"other than their scripts say: {', '.join(differ)}" if differ else "all are as their scripts say")
        return int(not current or bool(differ))
    kept = {script: script.result() for script in found}
    wanted = [one for one in found if given.all or one.name in given.names or (not given.names and kept[one] is None)]
    for script, old in kept.items():
        if old is not None and script not in wanted:
            script.page.write_text(page(script, *old), encoding="utf-8")
    began = time.perf_counter()
    for number, (script, shown) in enumerate(run(wanted, given.jobs), 1):
        write(script, shown)
        print(
            f"{number} of {len(wanted)}: {script.name}, {shown.seconds:.0f} s of a processor; {time.perf_counter() - began:.0f} s",
            flush=True,
        )
    (HERE / "index.md").write_text(index([script for script in found if script.page.is_file()]), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
