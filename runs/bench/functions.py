"""Plain functions with known fronts: UF1 to UF10 of CEC 2009, and those of pymoo; the sets of them that solvers are compared on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from macs import AGEMOEA2, CTAEA, MACS, MOEAD, NSGA2, NSGA3, RVEA, SMSEMOA, Solver
from macs.evaluation.blackbox import plain_problem
from macs.pareto.directions import simplex_lattice
from macs.pareto.dominance import nondominated
from problems.vector import CompiledVectorProblem

OURS = "MACS"
J = np.arange(1, 31)
"""The numbers of UF's variables, from 1, as in the report."""


@dataclass(frozen=True)
class UF:
    """UF1 to UF10: functions of 30 variables whose best values are coupled, and their true fronts.

    Zhang, Zhou, Zhao, Suganthan, Liu and Tiwari, Multiobjective optimization test instances for the CEC 2009 special session and
    competition, University of Essex, CES-487, 2008.
    """

    kind: int  # 1 to 10

    @property
    def objectives(self) -> int:
        """Their number, m."""
        return 2 if self.kind < 8 else 3

    @property
    def bounds(self) -> list[tuple[float, float]]:
        """Of each variable."""
        rest = {3: (0.0, 1.0), 4: (-2.0, 2.0)}.get(self.kind, (-1.0, 1.0) if self.kind < 8 else (-2.0, 2.0))
        places = self.objectives - 1
        return [(0.0, 1.0)] * places + [rest] * (len(J) - places)

    def __call__(self, X: np.ndarray) -> np.ndarray:
        """Objectives (k, m) of vectors X (k, 30)."""
        m, x = self.objectives, X[:, 0]
        y = X - self.best(X)
        parts = [(m <= J) & (J % m == (i + 1) % m) for i in range(m)]
        far = np.column_stack([2.0 * self._distances(y[:, part], J[part]) / part.sum() for part in parts])
        return far + self._shape(x, X[:, 1])

    def _shape(self, x: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Objectives (k, m) on the Pareto set, by its one or two free variables."""
        if self.kind in (8, 10):
            a, b = 0.5 * np.pi * x, 0.5 * np.pi * second
            return np.column_stack([np.cos(a) * np.cos(b), np.cos(a) * np.sin(b), np.sin(a)])
        if self.kind == 9:
            hump = np.maximum(0.0, 1.1 * (1.0 - 4.0 * (2.0 * x - 1.0) ** 2))
            return np.column_stack([0.5 * (hump + 2.0 * x) * second, 0.5 * (hump - 2.0 * x + 2.0) * second, 1.0 - second])
        if self.kind == 5:
            hump = 0.15 * np.abs(np.sin(20.0 * np.pi * x))
            return np.column_stack([x + hump, 1.0 - x + hump])
        if self.kind == 6:
            hump = np.maximum(0.0, 0.7 * np.sin(4.0 * np.pi * x))
            return np.column_stack([x + hump, 1.0 - x + hump])
        if self.kind == 7:
            return np.column_stack([x**0.2, 1.0 - x**0.2])
        return np.column_stack([x, 1.0 - x**2 if self.kind == 4 else 1.0 - np.sqrt(x)])

    def best(self, X: np.ndarray) -> np.ndarray:
        """The values (k, 30) of the variables on the Pareto set, for the places that the first one or two of X (k, 30) say."""
        x, phase = X[:, :1], 6.0 * np.pi * X[:, :1] + J * np.pi / len(J)
        if self.kind == 3:
            return x ** (0.5 * (1.0 + 3.0 * (J - 2.0) / (len(J) - 2.0)))
        if self.kind == 2:
            width = 0.3 * x**2 * np.cos(4.0 * phase) + 0.6 * x
            return width * np.where(J % 2 == 1, np.cos(phase), np.sin(phase))
        if self.kind >= 8:
            return 2.0 * X[:, 1:2] * np.sin(2.0 * np.pi * x + J * np.pi / len(J))
        return np.sin(phase)

    def _distances(self, y: np.ndarray, j: np.ndarray) -> np.ndarray:
        """The sum (k,) over the variables of one objective, of which y (k, l) is what they are away from their best."""
        if self.kind == 4:
            return (np.abs(y) / (1.0 + np.exp(2.0 * np.abs(y)))).sum(axis=1)
        if self.kind == 5:
            return (2.0 * y**2 - np.cos(4.0 * np.pi * y) + 1.0).sum(axis=1)
        if self.kind == 10:
            return (4.0 * y**2 - np.cos(8.0 * np.pi * y) + 1.0).sum(axis=1)
        if self.kind in (3, 6):
            return 4.0 * (y**2).sum(axis=1) - 2.0 * np.cos(20.0 * y * np.pi / np.sqrt(j)).prod(axis=1) + 2.0
        return (y**2).sum(axis=1)

    def front(self) -> np.ndarray:
        """Points (k, m) of the true front, evenly in the parameters that the competition's own sampling is even in: 1000, or 10,000 of
        three objectives."""
        if self.kind >= 8:
            first = np.linspace(0.0, 1.0, 100)
            if self.kind == 9:  # the front has a gap
                first = np.concatenate([np.linspace(0.0, 0.25, 50), np.linspace(0.75, 1.0, 50)])
            a, b = (one.ravel() for one in np.meshgrid(first, np.linspace(0.0, 1.0, 100)))
            return self._shape(a, b)
        x = np.linspace(0.0, 1.0, 1000)
        if self.kind == 5:
            x = np.linspace(0.0, 1.0, 21)
        elif self.kind == 6:
            x = np.concatenate([[0.0], np.linspace(0.25, 0.5, 333), np.linspace(0.75, 1.0, 333)])
        elif self.kind == 7:
            x = x**5  # even in the first objective
        return self._shape(x, x)


@dataclass(frozen=True)
class PlainFunction:
    """A function to be minimised."""

    name: str
    problem: Callable[[], tuple[Any, ...]]  # () -> the arguments of `minimize`: a pymoo problem, or a function and its bounds
    objectives: int
    evaluations: int
    points: int  # of the archive, and of each rival's population
    # () -> points (k, m) of the true front. Without it, what is non-dominated among all that was found gives the ranges.
    front: Callable[[], np.ndarray] | None = None
    distance: Callable[[np.ndarray], np.ndarray] | None = None  # F (k, m) -> (k,): how far points are from the true front, in closed form
    distances: tuple[str, ...] = ("igd",)  # which are measured from the true front: "igd", "igd_plus"

    def stated(self) -> CompiledVectorProblem:
        """The problem as studies take it."""
        return plain_problem(*self.problem(), names=[f"f{k + 1}" for k in range(self.objectives)], name=self.name)


def from_pymoo(name: str, *sizes: int, **more: int) -> tuple[Any, ...]:
    """A problem of pymoo, which has its own bounds."""
    from pymoo.problems import get_problem

    return (get_problem(name, *sizes, **more),)


def lattice_on(m: int) -> np.ndarray:
    """Directions (k, m) to points of a front."""
    return simplex_lattice(m, {3: 60, 5: 10, 8: 5}[m])


def sphere(m: int) -> np.ndarray:
    """The front of DTLZ2, 3 and 4."""
    return lattice_on(m) / np.linalg.norm(lattice_on(m), axis=1, keepdims=True)


def plane(m: int) -> np.ndarray:
    """The front of DTLZ1."""
    return 0.5 * lattice_on(m)


def bumps(m: int) -> np.ndarray:
    """The front of DTLZ7: the last objective is a sum over the others, so that it is made of the values of each that no smaller one
    exceeds in its term; eight values of each."""
    f = np.linspace(0.0, 1.0, 20_001)
    term = f / 2.0 * (1.0 + np.sin(3.0 * np.pi * f))
    records = f[np.concatenate([[True], term[1:] > np.maximum.accumulate(term)[:-1]])]
    sides = records[np.linspace(0, len(records) - 1, 8).astype(int)]
    place = np.stack(np.meshgrid(*[sides] * (m - 1)), axis=-1).reshape(-1, m - 1)
    last = 2.0 * (m - (place / 2.0 * (1.0 + np.sin(3.0 * np.pi * place))).sum(axis=1))
    return np.column_stack([place, last])


def from_plane(F: np.ndarray) -> np.ndarray:
    """Distance from the front of DTLZ1."""
    return np.abs(F.sum(axis=1) - 0.5) / F.shape[1] ** 0.5


def from_sphere(F: np.ndarray) -> np.ndarray:
    """Distance from the front of DTLZ2, 3 and 4."""
    return np.abs(np.linalg.norm(F, axis=1) - 1.0)


def dtlz(kind: int, m: int) -> PlainFunction:
    """DTLZ1-4 and 7 with m objectives and their usual numbers of variables (Deb, Thiele, Laumanns and Zitzler 2005)."""
    front, distance = {1: (plane, from_plane), 7: (bumps, None)}.get(kind, (sphere, from_sphere))
    problem = partial(from_pymoo, f"dtlz{kind}", n_var=m - 1 + {1: 5, 7: 20}.get(kind, 10), n_obj=m)
    return PlainFunction(f"DTLZ{kind}, {m} objectives", problem, m, 15_000, 120 if m == 8 else 110, partial(front, m), distance)


def cec(kind: int) -> PlainFunction:
    """UF1 to UF10, with as many evaluations and points as in the competition."""
    one = UF(kind)
    return PlainFunction(f"UF{kind}", lambda: (one, one.bounds), one.objectives, 300_000, 100 if kind < 8 else 150, one.front)


def zdt(kind: int) -> PlainFunction:
    """ZDT1-4 and 6 (Zitzler, Deb and Thiele 2000), and a thousand points of each front."""
    number = {"n_points" if kind == 3 else "n_pareto_points": 1000}
    return PlainFunction(
        f"ZDT{kind}", partial(from_pymoo, f"zdt{kind}"), 2, 30_000, 100, lambda: from_pymoo(f"zdt{kind}")[0].pareto_front(**number)
    )


def constrained(name: str) -> PlainFunction:
    """A problem with constraints: MW1 to MW14 (Ma and Wang 2019) and DTLZ with constraints (Jain and Deb 2014), as pymoo has them."""
    return PlainFunction(name.upper(), partial(from_pymoo, name), from_pymoo(name)[0].n_obj, 30_000, 100)


small = partial(PlainFunction, evaluations=5_000, distances=("igd_plus",))
"""A function with a search of about a second; competitions have 20 to 60 times as many evaluations, CRE in its paper 2 times, as here."""


@dataclass(frozen=True)
class MaF:
    """MaF1 to MaF6, whose last ten variables are 0.5 on the front, and their true fronts.

    Cheng, Li, Tian, Zhang, Yang, Jin and Yao, A benchmark test suite for evolutionary many-objective optimization, Complex & Intelligent
    Systems 3, 2017; MaF5 as in their code, PlatEMO, without powers of four.
    """

    kind: int  # 1 to 6

    def __call__(self, X: np.ndarray) -> np.ndarray:
        """Five objectives (k, 5) of vectors X (k, 14), from 0 to 1."""
        place, rest = X[:, :4], X[:, 4:] - 0.5
        g = (rest**2).sum(axis=1, keepdims=True)
        if self.kind in (3, 4):
            g = 100.0 * (10.0 + g - np.cos(20.0 * np.pi * rest).sum(axis=1, keepdims=True))
        elif self.kind == 2:  # each objective has variables of its own, and half their range
            g = ((rest / 2.0) ** 2).reshape(len(X), 5, 2).sum(axis=2)
            place = place / 2.0 + 0.25
        elif self.kind == 5:
            place = place**100
        elif self.kind == 6:
            place = np.hstack([place[:, :1], (1.0 + 2.0 * g * place[:, 1:]) / (2.0 + 2.0 * g)])
            g = 100.0 * g
        along, across = (place, 1.0 - place) if self.kind == 1 else (np.cos(place * np.pi / 2.0), np.sin(place * np.pi / 2.0))
        one = np.ones((len(X), 1))
        shape = np.cumprod(np.hstack([one, along]), axis=1)[:, ::-1] * np.hstack([one, across[:, ::-1]])
        return self._placed(shape, 1.0 + g)

    def _placed(self, shape: np.ndarray, radius: np.ndarray | float) -> np.ndarray:
        """Objectives (k, 5) from points of the unit simplex or sphere, and how far out they are."""
        F, powers = radius * shape, 2.0 ** np.arange(1, 6)
        if self.kind in (1, 4):  # inverted
            return (radius - F) * (1.0 if self.kind == 1 else powers)
        if self.kind == 3:
            return np.hstack([F[:, :-1] ** 4, F[:, -1:] ** 2])
        return F * (powers[::-1] if self.kind == 5 else 1.0)

    def front(self) -> np.ndarray:
        """Some 1000 points (k, 5) of the true front."""
        if self.kind not in (2, 6):
            return self._placed(lattice_on(5) if self.kind == 1 else sphere(5), 1.0)
        # Of MaF6 it is a curve.
        sides = [np.linspace(0.0, 1.0, 6)] * 4 if self.kind == 2 else [np.linspace(0.0, 1.0, 1000), *[np.zeros(1)] * 3]
        place = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 4)
        return self(np.hstack([place, np.full((len(place), 10), 0.5)]))


def wfg_front(kind: int) -> np.ndarray:
    """Points (k, 3) of the true front of WFG1, 2, or 4 to 9 with three objectives (Huband, Hingston, Barone and While 2006)."""
    ranges = np.array([2.0, 4.0, 6.0])
    if kind >= 4:
        return sphere(3) * ranges
    x, y = (side.ravel() for side in np.meshgrid(np.linspace(0.0, 1.0, 200), np.linspace(0.0, 1.0, 50)))
    a, b = x * np.pi / 2.0, y * np.pi / 2.0
    last = 1.0 - x - np.cos(10.0 * np.pi * x + np.pi / 2.0) / (10.0 * np.pi) if kind == 1 else 1.0 - x * np.cos(5.0 * np.pi * x) ** 2
    F = ranges * np.column_stack([(1.0 - np.cos(a)) * (1.0 - np.cos(b)), (1.0 - np.cos(a)) * (1.0 - np.sin(b)), last])
    return F[nondominated(F)]


def cf_front(kind: int) -> np.ndarray:
    """Points (k, m) of the true front of CF1 to CF10 (Zhang and others 2008, as of `UF`), evenly in the first objective or by angles."""
    x = np.linspace(0.0, 1.0, 2001)
    if kind == 1:
        return np.column_stack([x[::100], 1.0 - x[::100]])
    if kind in (2, 3):
        power = 0.5 if kind == 2 else 2.0
        place = 4.0 * x**power
        x = x[(place == 0.0) | ((place >= 1.0) & (place <= 2.0)) | (place >= 3.0)]
        return np.column_stack([x, 1.0 - x**power])
    if kind in (4, 5):
        return np.column_stack([x, np.select([x <= 0.5, x <= 0.75], [1.0 - x, 0.75 - 0.5 * x], 1.125 - x)])
    if kind in (6, 7):
        return np.column_stack([x, np.select([x <= 0.5, x <= 0.75], [(1.0 - x) ** 2, 0.5 - 0.5 * x], 0.25 * np.sqrt(1.0 - x))])
    # Meridians of a sphere, and of CF9 and CF10 what lies between every other two of them.
    share = np.linspace(0.0, 1.0, 5) if kind == 8 else np.concatenate([[0.0], np.linspace(0.25, 0.5, 25), np.linspace(0.75, 1.0, 25)])
    first, angle = (side.ravel() for side in np.meshgrid(np.sqrt(share), np.linspace(0.0, np.pi / 2.0, 100)))
    return np.column_stack([np.cos(angle) * first, np.cos(angle) * np.sqrt(1.0 - first**2), np.sin(angle)])


def from_cmo(name: str) -> tuple[Any, ...]:
    """A problem of the package cmo. Raises ValueError if that is not installed."""
    try:
        from cmo.problems.factory import get_problem
    except ImportError:
        raise ValueError("sets 'cf' and 're' need cmo, which is not installed: pip install 'macs-trajectories[suites]'") from None
    return (get_problem(name),)


def maf(kind: int) -> PlainFunction:
    """MaF1 to MaF6."""
    one = MaF(kind)
    return small(f"MaF{kind}", lambda: (one, [(0.0, 1.0)] * 14), 5, points=110, front=one.front)


def wfg(kind: int) -> PlainFunction:
    """WFG with four variables of place and twenty of distance, as pymoo has it."""
    problem = partial(from_pymoo, f"wfg{kind}", n_var=24, n_obj=3)
    return small(f"WFG{kind}", problem, 3, points=105, front=partial(wfg_front, kind))


def limited(name: str, m: int, **more: Any) -> PlainFunction:
    """A problem with constraints, of the package cmo: CF with ten variables, or CRE (Tanabe and Ishibuchi 2020), whose constraints are 0 or
    by how much a limit is exceeded, as their authors state them."""
    return small(name, partial(from_cmo, name.lower()), m, points=100 if m == 2 else 105, **more)


FUNCTIONS: dict[str, Callable[[], tuple[PlainFunction, ...]]] = {
    "many": lambda: (*(dtlz(kind, 5) for kind in (1, 2, 3, 4, 7)), dtlz(2, 8)),
    "uf": lambda: tuple(map(cec, range(1, 11))),
    "zdt": lambda: tuple(map(zdt, (1, 2, 3, 4, 6))),
    "constrained": lambda: tuple(
        map(constrained, (*(f"mw{i}" for i in range(1, 15)), "c1dtlz1", "c1dtlz3", "c2dtlz2", "c3dtlz1", "c3dtlz4"))
    ),
    "maf": lambda: tuple(map(maf, range(1, 7))),
    "wfg": lambda: tuple(map(wfg, (1, 2, 4, 6, 9))),
    "cf": lambda: tuple(limited(f"CF{k}", 2 if k < 8 else 3, front=partial(cf_front, k)) for k in (1, 2, 3, 5, 7, 8, 10)),
    "re": lambda: tuple(limited(f"CRE{k}", k // 10, evaluations=10_000) for k in (21, 23, 24, 25, 31, 32)),
}
"""The sets, made only when they are asked for: pymoo is imported then."""


def solvers(names: Sequence[str], points: int) -> dict[str, Solver]:
    """Ours and these rivals with so many points, and with its defaults otherwise.

    As in pymoo, rivals rank infeasible points by the sum of violations. NSGA-III gives all its points, and not only those nearest to its
    directions: covered volumes are the larger, and distances from the true front to the points the smaller.
    """
    known: dict[str, Callable[..., Solver]] = {
        "NSGA-II": NSGA2,
        "NSGA-III": partial(NSGA3, whole=True),
        "MOEA/D": MOEAD,
        "SMS-EMOA": SMSEMOA,
        "AGE-MOEA-II": AGEMOEA2,
        "RVEA": RVEA,
        "C-TAEA": CTAEA,
    }
    return {OURS: MACS(archive=points), **{name: known[name](population=points, degree="sum") for name in names}}
