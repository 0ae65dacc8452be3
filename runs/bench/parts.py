"""What each part of the search brings: MACS with its defaults against itself without one part, on problems that nothing was tuned on."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from typing import Any
from unittest.mock import patch

import numpy as np
from scipy.stats import t

from macs import MACS, Front
from macs.io.console import Steps
from macs.pareto import archive as archives
from macs.pareto.dominance import nondominated
from macs.pareto.spread import dominated_volume
from macs.search import breeding, repair
from macs.search import macs as search
from macs.search.settings import Variant
from macs.search.state import Credit
from problems import load

from .contract import Bench, Effort, Row, short
from .functions import from_pymoo

WHOLE = "all parts"
FIRST_SEED = 101

Switch = tuple[dict[str, Any], Callable[[], AbstractContextManager[Any]]]
"""Settings of MACS, and a context, with which a part is off."""


Stated = Callable[[], tuple[Any, ...]] | None
"""A function that returns the arguments of `minimize`; None for a problem of the catalogue."""


def setting(**settings: Any) -> Switch:
    """A part that is off by settings."""
    return settings, nullcontext


def variant(**fields: Any) -> Switch:
    """A part that is off by the variant of the search."""
    return setting(variant=Variant(**fields))


def patched(target: Any, name: str, other: Any) -> Switch:
    """A part that is off where a name of a module or class stands for something else."""
    return {}, lambda: patch.object(target, name, other)


GENERAL: dict[str, Switch] = {
    "agents move by social actions": variant(social_moves=False),
    "momentum": variant(momentum=0.0),
    "past improvements": variant(experience=0.0),
    "directions are drawn again": variant(redraw=False),
    "fewer coordinates": variant(adaptive_coordinates=False),
    "breeding": variant(breeding=False),
    "credit of breeding": patched(breeding, "LEAST_SHARE", 0.5),
}
VOLUME: dict[str, Switch] = {"volume in the archive": patched(archives, "swap_by_hypervolume", lambda F, chosen, *rest: chosen)}
ALPHA: dict[str, Switch] = {"alpha-dominance": patched(archives, "alpha_nondominated", lambda F: np.ones(len(F), dtype=bool))}
PARTS: dict[str, dict[str, Switch]] = {
    "curves": GENERAL | VOLUME,
    "constraints": {
        **GENERAL,
        "repair": variant(repair=False),
        "signs of residuals": patched(repair, "MODEL_LIMITS", replace(repair.MODEL_LIMITS, rounds=0)),
        "credit of repair": patched(Credit, "rates", lambda self, prior=0.0: np.ones(len(self.gained))),
        "infeasible parents": patched(archives, "outside", lambda known, *rest, **more: known.take(np.arange(0))),
    },
    "coupled variables": GENERAL | VOLUME,
    "surfaces": GENERAL | VOLUME | ALPHA,
    "many objectives": {"breeding": GENERAL["breeding"], **ALPHA, "niches": patched(archives, "MANY", 99)},
    "trajectories": GENERAL,
    "gradients": {
        "gradient actions": variant(refine_every=10**9),
        "choice of the inner solver": patched(search, "initial_credit", lambda *known: (Credit.equal(0), np.zeros((0, 3)))),
        "polish beyond 60 solves": setting(polish_every=10**6),
    },
}
"""Parts that can be off, by the kind of problem on which they do anything."""


@dataclass(frozen=True)
class AblationCase:
    """A problem of a kind, of which there is a solver for each switch."""

    kind: str
    name: str
    evaluations: int

    def solve(self, solver: MACS, seed: int) -> Front:
        """The front of a search, not simulated."""
        stated = PROBLEMS[self.kind][self.name]
        if stated is None:
            return solver.solve(load(self.name), evaluations=self.evaluations, seed=seed, verify=None, progress=False)
        return solver.minimize(*stated(), evaluations=self.evaluations, seed=seed, progress=False)


def crash(X: np.ndarray) -> np.ndarray:
    """Mass, acceleration and intrusion of a vehicle in a crash (Liao, Li, Yang, Zhang and Li 2008)."""
    a, b, c, d, e = X.T
    mass = 1640.2823 + 2.3573285 * a + 2.3220035 * b + 4.5688768 * c + 7.7213633 * d + 4.4559504 * e
    acceleration = 6.5856 + 1.15 * a - 1.0427 * b + 0.9738 * c + 0.8364 * d - 0.3695 * a * d + 0.0861 * a * e
    acceleration += 0.3628 * b * d - 0.1106 * a**2 - 0.3437 * c**2 + 0.1764 * d**2
    intrusion = -0.0551 + 0.0181 * a + 0.1024 * b + 0.0421 * c - 0.0073 * a * b + 0.0240 * b * c - 0.0118 * b * d
    intrusion += -0.0204 * c * d - 0.008 * c * e - 0.0241 * b**2 + 0.0109 * d**2
    return np.column_stack([mass, acceleration, intrusion])


def coupled(X: np.ndarray, slower: float) -> np.ndarray:
    """LZ09_F3, whose Pareto set is a curve through 30 dimensions, and F4, where half of it turns `slower` (Li and Zhang 2009)."""
    x, j = X[:, :1], np.arange(2, X.shape[1] + 1)
    angle, odd = 6.0 * np.pi * x + j * np.pi / X.shape[1], j % 2 == 1
    far = (X[:, 1:] - 0.8 * x * np.where(odd, np.cos(angle / slower), np.sin(angle))) ** 2
    return np.hstack([x, 1.0 - x**0.5]) + 2.0 * np.column_stack([far[:, odd].mean(axis=1), far[:, ~odd].mean(axis=1)])


def ellipsoids(X: np.ndarray) -> np.ndarray:
    """ELLI1: two long ellipsoids along the same axes, which lie oblique to those of the variables (Igel, Hansen and Roth 2007)."""
    n = X.shape[1]
    axes, _ = np.linalg.qr(np.random.default_rng(0).standard_normal((n, n)))
    y = X @ axes
    return np.column_stack([(((y - centre) ** 2) * 1000.0 ** (2.0 * np.arange(n) / (n - 1) - 2.0)).mean(axis=1) for centre in (0.0, 2.0)])


def thin_kursawe(X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Kursawe's function on a surface, an equality stated as a limit on an absolute value."""
    return from_pymoo("kursawe")[0].evaluate(X), np.abs(X[:, :1] + 0.5 * X[:, 1:2] ** 2 - X[:, 2:] - 1.0) - 1e-3


PROBLEMS: dict[str, dict[str, Stated]] = {
    "curves": {
        **{f"WFG{k}": partial(from_pymoo, f"wfg{k}", n_var=12, n_obj=2) for k in (2, 4, 9)},
        "Kursawe": partial(from_pymoo, "kursawe"),
    },
    "constraints": {
        **{name: partial(from_pymoo, name.lower()) for name in ("OSY", "TNK", "CTP2")},
        **{f"DASCMOP{k}": partial(from_pymoo, f"dascmop{k}", 5) for k in (1, 4)},
        "thin Kursawe": lambda: (thin_kursawe, [(-5.0, 5.0)] * 3),
        "welded_beam": None,
    },
    "coupled variables": {
        **{
            name: partial(lambda slower: (partial(coupled, slower=slower), [(0.0, 1.0)] + [(-1.0, 1.0)] * 29), slower)
            for name, slower in (("LZ09_F3", 1.0), ("LZ09_F4", 3.0))
        },
        "ELLI1": lambda: (ellipsoids, [(-10.0, 10.0)] * 10),
    },
    "surfaces": {
        **{f"WFG{k}": partial(from_pymoo, f"wfg{k}", n_var=14, n_obj=3) for k in (4, 9)},
        "crash": lambda: (crash, [(1.0, 3.0)] * 5),
    },
    "many objectives": {f"WFG{k}": partial(from_pymoo, f"wfg{k}", n_var=14, n_obj=5) for k in (4, 9)},
    "trajectories": dict.fromkeys(("goddard", "orbit_rise", "landing_site", "aerocapture")),
    "gradients": dict.fromkeys(("goddard", "landing_site")),
}
"""Problems by kind; None: of the catalogue. The last two kinds have archives of 10 points, the others of 50."""
BUDGETS = {"curves": 2000, "constraints": 2000, "coupled variables": 30_000, "surfaces": 2000, "many objectives": 2000}
BUDGETS |= {"trajectories": 300, "gradients": 200}


def measure(rows: list[Row], effort: Effort) -> None:
    """Searches of all problems with and without each part, from the same seeds; a row for each kind and part."""
    with Steps("parts", sum(len(PARTS[one.kind]) + 1 for one in effort.cases)) as steps:
        for kind in dict.fromkeys(one.kind for one in effort.cases):
            gains = [_gains(one, effort, steps) for one in effort.cases if one.kind == kind]
            rows += [_row(kind, part, gains) for part in PARTS[kind]]


def _gains(problem: AblationCase, effort: Effort, steps: Steps) -> dict[str, list[tuple[float, float, float]]]:
    """For each part, in each round: the hypervolume, seconds of the processor, and whether anything feasible was found."""
    budget = effort.evaluations or problem.evaluations
    problem = replace(problem, evaluations=min(budget, problem.evaluations))
    small = problem.kind in ("trajectories", "gradients")
    plain: dict[str, Any] = {"archive": 10 if small else 50, "refine": problem.kind == "gradients", "mesh": "fixed"}
    fronts: dict[str, list[tuple[np.ndarray, float]]] = {}
    for part, (settings, context) in ({WHOLE: setting()} | PARTS[problem.kind]).items():
        steps.begin(f"{problem.name}, {'all parts' if part == WHOLE else f'without {part}'}")
        fronts[part] = []
        for seed in range(FIRST_SEED, FIRST_SEED + effort.rounds):
            with context():
                began = time.process_time()
                front = problem.solve(MACS(**(plain | settings)), seed)
                fronts[part].append((front.F, time.process_time() - began))
    points = np.vstack([F for found in fronts.values() for F, _ in found])
    best = points[nondominated(points)]
    ideal, span = best.min(axis=0), np.where(np.ptp(best, axis=0) > 0.0, np.ptp(best, axis=0), 1.0)
    whole = 1.1 ** len(ideal)
    return {
        part: [(dominated_volume((F - ideal) / span) / whole if len(F) else 0.0, took, float(len(F) > 0)) for F, took in found]
        for part, found in fronts.items()
    }


def _row(kind: str, part: str, gains: Sequence[Mapping[str, list[tuple[float, float, float]]]]) -> Row:
    """The means over the problems of a kind: of differences in each round, and of seconds and solved problems."""
    whole, without = (np.array([one[name] for one in gains]) for name in (WHOLE, part))  # (problems, rounds, 3)
    return Row(
        kind,
        part,
        {
            "volume": np.median(without[:, :, 0], axis=1).tolist(),
            "all": np.median(whole[:, :, 0], axis=1).tolist(),
            "gain": (100.0 * (whole - without)[:, :, 0].mean(axis=0)).tolist(),
            "time": (np.median(whole[:, :, 1], axis=1) / np.median(without[:, :, 1], axis=1)).tolist(),
            "solved": (whole - without)[:, :, 2].sum(axis=1).tolist(),
        },
    )


def noise(row: Row) -> float:
    """Half of the interval in which the mean gain lies in 95 % of cases."""
    gain = np.array(row.values["gain"])
    return float(t.ppf(0.975, len(gain) - 1) * gain.std(ddof=1) / len(gain) ** 0.5) if len(gain) > 1 else np.inf


def verdict(row: Row) -> str:
    """Whether a part brings more than the noise."""
    gain = row.of("gain", np.mean)
    return "pays" if gain > noise(row) else "costs" if gain < -noise(row) else "noise"


CASES = tuple(AblationCase(kind, name, BUDGETS[kind]) for kind, problems in PROBLEMS.items() for name in problems)
PARTS_BENCH = Bench(
    title="parts",
    about=(
        "MACS with all parts against MACS without one of them, on problems that none of its numbers was chosen on, at equal "
        f"evaluations: {', '.join(f'{kind} {budget}' for kind, budget in BUDGETS.items())}; from the same seeds, {FIRST_SEED} and on. "
        "Hypervolume: of the points in the ranges of the best of all that were found, up to 1.1, as a part of all; median over seeds, mean "
        "over problems. Gain: what the part adds to it, in hundredths, mean over problems and seeds; noise: half of the interval in which "
        "that mean lies in 95 % of cases, by Student's distribution. Time: of the processor with the part, divided by that without. "
        "Solved: searches that found something feasible, more with the part than without."
    ),
    full=Effort(CASES, rounds=10),
    quick=Effort(tuple(one for one in CASES if one.name in ("Kursawe", "TNK")), rounds=2, evaluations=200),
    whole=measure,
    columns=(
        ("hyper-", "volume", lambda row: short(row.of("all", np.mean))),
        ("without", "", lambda row: short(row.of("volume", np.mean))),
        ("gain", "%", lambda row: f"{row.of('gain', np.mean):+.2f}"),
        ("noise", "%", lambda row: f"{noise(row):.2f}"),
        ("", "", verdict),
        ("time", "ratio", lambda row: f"{row.of('time', np.mean):.2f}"),
        ("solved", "more", lambda row: f"{row.of('solved', np.sum):+.0f}"),
    ),
    seeded=True,
)
