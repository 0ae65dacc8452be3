"""What is measured at several sizes: each series makes its work ready for a size, so that only the work itself is timed."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from macs import MACS, Front
from macs.fronts.builders import from_vectors
from macs.fronts.files import from_bytes, to_bytes
from macs.solvers import checkpoint
from problems import Problem, load
from transcription import Smooth, parse
from transcription.base import NLP
from transcription.nlp.derivatives import gradients, hessian

from .chains import masses, ride

Work = Callable[[], object]
WIDTH = 200
"""Variables of the vectors in a checkpoint."""


@dataclass(frozen=True)
class Series:
    """A piece of work at several sizes."""

    name: str  # name, unit: What is done, and what is counted
    unit: str
    prepare: Callable[[int], Work]  # A size -> the work, a function without arguments that is called once
    # sizes, quick: Those of the whole and of the quick benchmark, increasing; the fit is over the last three. No quick ones: it is not in
    # that.
    sizes: tuple[int, ...]
    quick: tuple[int, ...]


def setup(word: str) -> Callable[[int], Work]:
    """The transcription of a problem, by a word with a place for the size: NLP, functions, and what propagation leaves."""

    def prepare(size: int) -> Work:
        problem = load("goddard").compile()
        return lambda: parse(word.format(size)).transcribe(problem).reduced

    return prepare


def derivatives(word: str) -> Callable[[int], Work]:
    """Gradients and Hessian for gradient solves."""

    def prepare(size: int) -> Work:
        problem = load("goddard").compile()
        nlp = parse(word.format(size)).transcribe(problem)
        return lambda: (gradients(nlp), hessian(nlp))

    return prepare


def candidate(word: str) -> Callable[[int], Work]:
    """The propagation of one candidate, from the making of its functions to objectives and residuals, and its trajectory."""

    def prepare(size: int) -> Work:
        problem = load("goddard").compile()
        nlp = parse(word.format(size)).transcribe(problem)
        return lambda: nlp.unpack(nlp.propagate_and_score(middle(nlp))[0][0])

    return prepare


def middle(nlp: NLP) -> np.ndarray:
    """One vector (1, n): the guess, and the middle of the bounds where there is none."""
    known = np.where(np.isfinite(nlp.guess), nlp.guess, 0.5 * (nlp.lower + nlp.upper)[nlp.free])
    return nlp.first_guess(known[None])


def stated(build: Callable[[int], Problem], word: str) -> Callable[[int], Work]:
    """A problem of any size from its statement to its derivatives."""

    def prepare(size: int) -> Work:
        def work() -> object:
            nlp = parse(word).transcribe(build(size).compile())
            return gradients(nlp), hessian(nlp)

        return work

    return prepare


def front_of(points: int) -> Front:
    """A front of so many trajectories, which need not be good ones."""
    problem, transcription = load("goddard").compile(), parse("dfet:4x6")
    nlp = transcription.nlp(problem)
    X = Smooth().draw(problem, transcription, points, np.random.default_rng(0))
    Z = nlp.propagate(nlp.first_guess(X))
    return Front.of(from_vectors(nlp, Z, {"name": "drawn", "settings": {}}, {"tolerance": 1e-6, "evaluations": points}))


def saving(points: int) -> Work:
    """The content of a front's file."""
    front = front_of(points)
    return lambda: to_bytes(front)


def loading(points: int) -> Work:
    """A front from the content of its file."""
    content = to_bytes(front_of(points))
    return lambda: from_bytes(content)


def simulating(points: int) -> Work:
    """A front simulated."""
    front = front_of(points)
    return front.simulate


def searching(agents: int, archive: int | None = None) -> Work:
    """Iterations of MACS on a plain function, without gradients."""
    solver = MACS(agents=agents, archive=archive or agents, refine=False)
    return lambda: solver.minimize(two_goals, [(0.0, 1.0)] * 8, evaluations=20 * agents, seed=1)


def keeping(agents: int) -> Work:
    """The checkpoint of so many agents written and read again."""
    solver = MACS(agents=agents, archive=100, refine=False)

    def begun(path: Path) -> tuple[object, dict[str, np.ndarray]]:
        solver.minimize(two_goals, [(0.0, 1.0)] * WIDTH, evaluations=agents, seed=1, checkpoint=path)
        return checkpoint.read_file(path)

    header, arrays = in_folder(begun)

    def again(path: Path) -> object:
        path.write_bytes(checkpoint.to_bytes(header, arrays))
        return checkpoint.read_file(path)

    return lambda: in_folder(again)


def two_goals(X: np.ndarray) -> np.ndarray:
    """Zitzler, Deb and Thiele's first function (k, 2) of vectors (k, d) in the unit box."""
    g = 1.0 + 9.0 * X[:, 1:].mean(axis=1)
    return np.column_stack([X[:, 0], g * (1.0 - np.sqrt(X[:, 0] / g))])


def in_folder(work: Callable[[Path], Any]) -> Any:
    """What a function of the path of a file returns, which is then removed."""
    with tempfile.TemporaryDirectory() as folder:
        return work(Path(folder) / "file")


DFET, RADAU, SINGLE, MULTIPLE = "dfet:{}x3", "radau:{}x3", "shooting:{}", "multiple-shooting:{}"
FINE, COARSE = (500, 1000, 2000, 4000), (75, 300, 1200)
LONG, SHORT = (2500, 5000, 10000, 20000), (625, 2500, 10000)
SERIES = (
    Series("set-up, DFET", "elements", setup(DFET), FINE, COARSE),
    Series("set-up, Radau", "elements", setup(RADAU), FINE, ()),
    Series("set-up, single shooting", "nodes", setup(SINGLE), LONG, SHORT),
    Series("set-up, multiple shooting", "intervals", setup(MULTIPLE), FINE, COARSE),
    Series("candidate, DFET", "elements", candidate(DFET), FINE, COARSE),
    Series("candidate, single shooting", "nodes", candidate(SINGLE), LONG, SHORT),
    Series("candidate, multiple shooting", "intervals", candidate(MULTIPLE), FINE, ()),
    Series("derivatives, DFET", "elements", derivatives(DFET), FINE, COARSE),
    Series("derivatives, Radau", "elements", derivatives(RADAU), FINE, ()),
    Series("derivatives, multiple shooting", "intervals", derivatives(MULTIPLE), FINE, COARSE),
    Series("phases, DFET", "phases", stated(ride, "dfet:4x3"), (5, 10, 20, 40), (5, 10, 20)),
    Series("phases, multiple shooting", "phases", stated(ride, "multiple-shooting:10"), (5, 10, 20, 40), ()),
    Series("variables, DFET", "masses", stated(masses, "dfet:10x3"), (25, 50, 100, 200), (10, 20, 40)),
    Series("variables, multiple shooting", "masses", stated(masses, "multiple-shooting:20"), (25, 50, 100, 200), ()),
    Series("front saved", "points", saving, (250, 500, 1000, 2000), (50, 100, 200)),
    Series("front loaded", "points", loading, (250, 500, 1000, 2000), (50, 100, 200)),
    Series("front simulated", "points", simulating, (125, 250, 500, 1000), (25, 50, 100)),
    Series("search", "agents", searching, (32, 64, 128, 256), (16, 32, 64)),
    Series("checkpoint", "agents", keeping, (500, 1000, 2000, 4000), (100, 200, 400)),
)
"""Up to 40 phases and 256 agents: from about 100 phases on, what each picks from the vector of all shows, and from about 300 agents on,
that each looks at its distances to all others."""
