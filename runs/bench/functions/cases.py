"""Sets of plain functions with known fronts, and the solvers that are compared on each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from macs import AGEMOEA2, CTAEA, MACS, MOEAD, NSGA2, NSGA3, RVEA, SMSEMOA, Solver
from macs.evaluation.blackbox import plain_problem
from macs.pareto.directions import simplex_lattice
from problems.vector import CompiledVectorProblem

from .uf import UF

OURS = "MACS"
LATTICE = {3: 60, 5: 10, 8: 5}
"""Divisions of the lattice on a front, by the number of objectives."""
DENSE = 8
"""Points along each objective of DTLZ7's front."""


@dataclass(frozen=True)
class Function:
    """A function to be minimised."""

    name: str
    problem: Callable[[], tuple[Any, ...]]  # () -> the arguments of `minimize`: a pymoo problem, or a function and its bounds
    objectives: int
    evaluations: int
    points: int  # of the archive, and of each rival's population
    # () -> points (k, m) of the true front. Without it, what is non-dominated among all that was found gives the ranges.
    front: Callable[[], np.ndarray] | None = None
    distance: Callable[[np.ndarray], np.ndarray] | None = None  # F (k, m) -> (k,): how far points are from the true front, in closed form

    def stated(self) -> CompiledVectorProblem:
        """The problem as studies take it."""
        return plain_problem(*self.problem(), names=[f"f{k + 1}" for k in range(self.objectives)], name=self.name)


@dataclass(frozen=True)
class Set:
    """Functions, the names of solvers, and those functions that the quick benchmark has."""

    title: str
    functions: tuple[Function, ...]
    rivals: tuple[str, ...]
    quick: tuple[str, ...]


def solvers_of(name: str) -> tuple[str, ...]:
    """The names of the solvers of a set, ours first."""
    return (OURS, *the_set(name).rivals)


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


def from_pymoo(name: str, **sizes: int) -> tuple[Any, ...]:
    """A problem of pymoo, which has its own bounds."""
    from pymoo.problems import get_problem

    return (get_problem(name, **sizes),)


def dtlz(kind: int, m: int) -> Function:
    """DTLZ1-4 and 7 with m objectives and their usual numbers of variables (Deb, Thiele, Laumanns and Zitzler 2005)."""
    rest = {1: 5, 7: 20}.get(kind, 10)
    fronts: dict[int, Callable[[], np.ndarray]] = {1: partial(plane, m), 7: partial(bumps, m)}
    distances: dict[int, Callable[[np.ndarray], np.ndarray] | None] = {1: from_plane, 7: None}
    return Function(
        f"DTLZ{kind}, {m} objectives",
        partial(from_pymoo, f"dtlz{kind}", n_var=m - 1 + rest, n_obj=m),
        m,
        15_000,
        120 if m == 8 else 110,
        fronts.get(kind, partial(sphere, m)),
        distances.get(kind, from_sphere),
    )


def plane(m: int) -> np.ndarray:
    """The front of DTLZ1."""
    return 0.5 * simplex_lattice(m, LATTICE[m])


def sphere(m: int) -> np.ndarray:
    """The front of DTLZ2, 3 and 4."""
    lattice = simplex_lattice(m, LATTICE[m])
    return lattice / np.linalg.norm(lattice, axis=1, keepdims=True)


def bumps(m: int) -> np.ndarray:
    """The front of DTLZ7: the last objective is a sum over the others, so that it is made of the values of each that no smaller one
    exceeds in its term."""
    f = np.linspace(0.0, 1.0, 20_001)
    term = f / 2.0 * (1.0 + np.sin(3.0 * np.pi * f))
    records = f[np.concatenate([[True], term[1:] > np.maximum.accumulate(term)[:-1]])]
    sides = records[np.linspace(0, len(records) - 1, DENSE).astype(int)]
    place = np.stack(np.meshgrid(*[sides] * (m - 1)), axis=-1).reshape(-1, m - 1)
    last = 2.0 * (m - (place / 2.0 * (1.0 + np.sin(3.0 * np.pi * place))).sum(axis=1))
    return np.column_stack([place, last])


def from_plane(F: np.ndarray) -> np.ndarray:
    """Distance from the front of DTLZ1."""
    return np.abs(F.sum(axis=1) - 0.5) / F.shape[1] ** 0.5


def from_sphere(F: np.ndarray) -> np.ndarray:
    """Distance from the front of DTLZ2, 3 and 4."""
    return np.abs(np.linalg.norm(F, axis=1) - 1.0)


def cec(kind: int) -> Function:
    """UF1 to UF10, with as many evaluations and points as in the competition."""
    function = UF(kind)
    return Function(
        f"UF{kind}",
        lambda: (function, function.bounds),
        function.objectives,
        300_000,
        100 if function.objectives == 2 else 150,
        function.front,
    )


def zdt(kind: int) -> Function:
    """ZDT1-4 and 6 (Zitzler, Deb and Thiele 2000)."""
    return Function(f"ZDT{kind}", partial(from_pymoo, f"zdt{kind}"), 2, 30_000, 100, partial(front_of_zdt, kind))


def front_of_zdt(kind: int) -> np.ndarray:
    """A thousand points of a front of pymoo."""
    return from_pymoo(f"zdt{kind}")[0].pareto_front(**{"n_points" if kind == 3 else "n_pareto_points": 1000})


def constrained(name: str) -> Function:
    """A problem with constraints: MW1 to MW14 (Ma and Wang 2019) and DTLZ with constraints (Jain and Deb 2014), as pymoo has them."""
    problem = from_pymoo(name)[0]
    return Function(name.upper(), partial(from_pymoo, name), problem.n_obj, 30_000, 100)


MW = tuple(f"mw{i}" for i in range(1, 15))
C_DTLZ = ("c1dtlz1", "c1dtlz3", "c2dtlz2", "c3dtlz1", "c3dtlz4")
NAMES = ("many", "uf", "zdt", "constrained")


def the_set(name: str) -> Set:
    """One of `NAMES`; problems of pymoo are made here, so that nothing is imported before."""
    if name == "many":
        functions = (*(dtlz(kind, 5) for kind in (1, 2, 3, 4, 7)), dtlz(2, 8))
        return Set("MANY OBJECTIVES", functions, ("NSGA-II", "NSGA-III", "MOEA/D", "AGE-MOEA-II", "RVEA"), ("DTLZ2, 5 objectives",))
    if name == "uf":
        functions = tuple(cec(kind) for kind in range(1, 11))
        return Set("UF1 TO UF10 OF CEC 2009", functions, ("NSGA-II", "NSGA-III", "MOEA/D", "AGE-MOEA-II"), ("UF1", "UF8"))
    if name == "zdt":
        functions = tuple(zdt(kind) for kind in (1, 2, 3, 4, 6))
        return Set("ZDT", functions, ("NSGA-II", "NSGA-III", "MOEA/D", "SMS-EMOA", "AGE-MOEA-II"), ("ZDT1", "ZDT3"))
    functions = tuple(map(constrained, (*MW, *C_DTLZ)))
    return Set("CONSTRAINTS", functions, ("NSGA-II", "NSGA-III", "SMS-EMOA", "AGE-MOEA-II", "RVEA", "C-TAEA"), ("MW1", "C2DTLZ2"))
