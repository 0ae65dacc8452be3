"""Origin of a result: the identity of its problem, what it cost, and the versions that made it."""

from __future__ import annotations

import platform
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Annotated, Any, Required, TypedDict

import msgspec
import numpy as np
from msgspec import Meta

import problems
from problems.catalogue import is_catalogued
from problems.compiled import CompiledProblem
from problems.problem import Problem
from problems.vector import CompiledVectorProblem, VectorProblem

from ..evaluation.evaluator import Counts
from ..io.text import document
from .columns import read_attribute, read_document

AnyCompiled = CompiledProblem | CompiledVectorProblem


@dataclass(frozen=True)
class ProblemSource:
    """Identity of a problem: its name, its fingerprint, and the address and data that `problems.load` makes it from.

    `address` is empty where a script stated the problem; then only the script can give it again. To load a problem runs the code at its
    address: one that was read from a file is only loaded if it is of the catalogue, or `trusted`.
    """

    name: str
    fingerprint: str
    address: str = ""
    data: Mapping[str, Any] = field(default_factory=dict)
    trusted: bool = field(default=False, compare=False)
    vector: bool = False
    """Whether it is a vector problem, which has no dynamics."""

    @classmethod
    def of(cls, problem: AnyCompiled) -> ProblemSource:
        vector = isinstance(problem, CompiledVectorProblem)
        return cls(problem.name, problem.fingerprint, problem.address, dict(problem.data), trusted=True, vector=vector)

    def check(self, problem: Problem | VectorProblem | AnyCompiled | str, whose: str) -> Any:
        """`problem`, or the one that `problems.load` makes of its name, compiled."""
        compiled = (problems.load(problem) if isinstance(problem, str) else problem).compile()
        if compiled.fingerprint != self.fingerprint:
            one, other = f"'{self.name}' ({self.fingerprint[:8]})", f"'{compiled.name}' ({compiled.fingerprint[:8]})"
            parts = "bounds, limits, objectives, data or values of the function" if self.vector else "bounds, equations, objectives or data"
            casadi = "" if self.vector else ", or another CasADi"
            raise ValueError(f"{whose} belongs to problem {one}, not to {other}: {parts} differ{casadi}")
        return compiled

    def load(self) -> Any:
        """The Problem or VectorProblem from its address. This runs the code that the address names."""
        if not self.address:
            raise ValueError(
                f"problem '{self.name}' was stated in a script, so it cannot be found by name: pass it, Front.load(path, problem=problem)"
            )
        if not (self.trusted or is_catalogued(self.address)):
            raise ValueError(
                f"the file says that its problem '{self.name}' is made by the code at {self.address!r}, which is not run unasked: "
                "to run it give --trust, or Front.load(path, trust=True); "
                "to name the problem yourself give --problem, or Front.load(path, problem=...)"
            )
        try:
            problem = problems.load(self.address, **self.data)
        except (Exception, SystemExit) as error:
            raise ValueError(
                f"problem '{self.name}' does not load from '{self.address}' ({error}): pass it, Front.load(path, problem=problem)"
            ) from error
        self.check(problem, "the front")
        return problem


Count = Annotated[int, Meta(ge=0)]
Amount = Annotated[float, Meta(ge=0.0)]


class Stats(TypedDict, total=False):
    """`stats` of a front, as files may have them. Solvers and tools add more, see the manual."""

    evaluations: Required[Count]  # candidates of a search
    inner_iterations: Required[Count]
    gradient_solves: Required[Count]
    fallbacks: Required[Count]  # candidates that went to IPOPT, because the fast inner level failed
    failures: Required[dict[str, Count]]  # by status
    solves_for: dict[str, Count]  # solves_for, iterations_for, kept_for: see `Counts`
    iterations_for: dict[str, Count]
    kept_for: dict[str, Count]
    wall_time: Required[Amount]  # s
    seed: Required[int | list[int | None] | None]  # of merged fronts several
    tolerance: Required[Amount]  # of violations
    reproducible: Required[bool]  # the same seed gives the same front
    versions: Required[dict[str, str]]
    verify: Annotated[float, Meta(gt=0.0)]  # how much verified points may miss
    stopped: str  # why the work ended


STATS: dict[str, Any] = {
    "evaluations": 0,
    "inner_iterations": 0,
    "gradient_solves": 0,
    "fallbacks": 0,
    "failures": {},
    "wall_time": 0.0,
    "seed": None,
    "tolerance": 1e-6,
    "reproducible": True,
}
"""Defaults of the entries that the `stats` of every front have, beside `versions`."""


def versions() -> dict[str, str]:
    """Versions of Python, of this package and of those whose arithmetic its results depend on, by name."""
    packages = ("macs-trajectories", "casadi", "numpy", "pymoo", "scipy")
    system = f"{platform.system()} {platform.machine()}"
    return {"python": platform.python_version(), "platform": system, **{package: _version(package) for package in packages}}


@cache
def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"


COUNTED = ("evaluations", "inner_iterations", "gradient_solves", "fallbacks", "work", "charge")
"""What `Counts` has that are entries of `stats`."""
COUNTED_BY = ("solves_for", "iterations_for", "kept_for")  # the same, by what gradient solves were for


def costs(counts: Counts, **about: Any) -> dict[str, Any]:
    """`stats` of a front from the counts of a run, with `about`: `wall_time`, `seed`, `tolerance` and more."""
    first = {key: one for key in ("from_cache", "first_failure") if (one := getattr(counts, key))}
    by = {key: dict(getattr(counts, key)) for key in (*COUNTED_BY, "failures")}
    return {**{key: getattr(counts, key) for key in COUNTED}, **by, **first, **about}


def more_costs(stats: Mapping[str, Any], counts: Counts, wall_time: float, stopped: str) -> dict[str, Any]:
    """`stats` of a front that was worked on further: counts and seconds are added, `stopped` says what ended the work early."""
    added = ("gradient_solves", "inner_iterations", "work", "charge")
    return {
        **stats,
        **{key: stats.get(key, 0) + getattr(counts, key) for key in added},
        **{key: dict(Counter(stats.get(key, {})) + getattr(counts, key)) for key in COUNTED_BY},
        "wall_time": stats["wall_time"] + wall_time,
        "reproducible": stats["reproducible"] and not (counts.clocked or stopped),
        **({"stopped": stopped} if stopped else {}),
    }


def merged_stats(several: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """`stats` of merged fronts: costs are summed, seeds listed; the loosest tolerances and the least reproducible run count for all."""
    seeds = [seed for stats in several for seed in (stats["seed"] if isinstance(stats["seed"], list) else [stats["seed"]])]
    verify = [stats["verify"] for stats in several if "verify" in stats]
    found: dict[str, dict[str, None]] = {}
    for stats in several:
        for package, number in stats["versions"].items():
            found.setdefault(package, {})[number] = None
    return {
        **{key: sum(stats.get(key, 0) for stats in several) for key in (*COUNTED, "wall_time")},
        **{key: dict(sum((Counter(stats.get(key, {})) for stats in several), Counter())) for key in (*COUNTED_BY, "failures")},
        "seed": seeds if len(seeds) > 1 else seeds[0],
        "tolerance": max(stats["tolerance"] for stats in several),
        "reproducible": all(stats["reproducible"] for stats in several),
        "versions": {package: ", ".join(numbers) for package, numbers in found.items()},
        **({"verify": max(verify)} if verify else {}),
    }


# As attributes of a file


def stats_attributes(stats: Mapping[str, Any]) -> dict[str, Any]:
    """The entries of `STATS` that are numbers, each as an attribute; versions, and the others together, as JSON."""
    found = {key: _number(value) for key, value in stats.items() if key in STATS}
    numbers = {key: value for key, value in found.items() if value is not None}
    rest = {key: value for key, value in stats.items() if key not in numbers and key != "versions"}
    return {**numbers, "versions": document(stats["versions"]), "stats": document(rest)}


def _number(value: Any) -> float | int | list[int] | None:
    """A number, or at least two whole ones, as an attribute of netCDF; None for anything else."""
    if isinstance(value, float | np.floating):
        return float(value)
    several = value if isinstance(value, list) and len(value) > 1 else [value]
    whole = [int(entry) for entry in several if isinstance(entry, int | np.integer | np.bool_) and abs(int(entry)) < 2**63]
    if len(whole) < len(several):
        return None
    return whole if several is value else whole[0]


VECTOR = "vector"
"""What the attribute `problem_kind` says of a vector problem; other problems do not have it."""


def source_attributes(source: ProblemSource | None) -> dict[str, str]:
    """A source, without its address if the data that it takes cannot be written down: then the problem has to be passed again."""
    if source is None:
        return {"problem": "", "fingerprint": "", "address": "", "data": "{}"}
    try:
        address, data = source.address, document(dict(source.data), strict=True)
    except TypeError:
        address, data = "", "{}"
    kind = {"problem_kind": VECTOR} if source.vector else {}
    return {"problem": source.name, "fingerprint": source.fingerprint, "address": address, "data": data, **kind}


def read_stats(attrs: Mapping[str, Any]) -> dict[str, Any]:
    """`stats` from its attributes. Raises ValueError for what it cannot be."""
    stats = {**read_document(attrs, "stats"), "versions": read_document(attrs, "versions")}
    stats |= {name: bool(attrs[name]) if isinstance(usual, bool) else attrs[name] for name, usual in STATS.items() if name in attrs}
    stats |= {name: _whole(stats[name]) for name in (*COUNTED, *COUNTED_BY, "failures", "seed") if name in stats}
    try:
        msgspec.convert(stats, Stats)
    except msgspec.ValidationError as error:
        raise ValueError(f"its 'stats' are not what they should be: {error}") from error
    return stats


def _whole(value: Any) -> Any:
    """Counts as whole numbers, where another program has written them as 10.0; all else as it is."""
    if isinstance(value, dict):
        return {name: _whole(one) for name, one in value.items()}
    return int(value) if isinstance(value, float | np.floating) and float(value).is_integer() else value


def read_source(attrs: Mapping[str, Any]) -> ProblemSource | None:
    """A source from its attributes; None for a black box, which has no fingerprint. Raises ValueError for what it cannot be."""
    name, fingerprint, address = (read_attribute(attrs, key, str) for key in ("problem", "fingerprint", "address"))
    vector = attrs.get("problem_kind", "") == VECTOR
    return ProblemSource(name, fingerprint, address, read_document(attrs, "data"), vector=vector) if fingerprint else None
