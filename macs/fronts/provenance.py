"""Which problem a front belongs to: enough to find it again, and to know that it is the same one."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from problems.compiled import CompiledProblem


@dataclass(frozen=True)
class Source:
    """The name of a problem, what `problems.load` takes to make it, and its fingerprint.

    `address` is empty where a script built the problem; then only the script can give it again.
    """

    name: str
    fingerprint: str
    address: str = ""
    data: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, problem: CompiledProblem) -> Source:
        return cls(problem.name, problem.fingerprint, problem.address, dict(problem.data))

    def check(self, problem: Any, whose: str) -> CompiledProblem:
        """`problem` (a `Problem` or a `CompiledProblem`), compiled, once it is known to be the one that is meant.

        Raises
        ------
        ValueError
            If it is another problem; the message says whose it is not.
        """
        compiled = problem.compile() if hasattr(problem, "compile") else problem
        if compiled.fingerprint != self.fingerprint:
            one, other = f"'{self.name}' ({self.fingerprint[:8]})", f"'{compiled.name}' ({compiled.fingerprint[:8]})"
            raise ValueError(
                f"{whose} belongs to problem {one}, not to {other}: bounds, equations, objectives or data differ, or another CasADi"
            )
        return compiled

    def load(self) -> CompiledProblem:
        """The problem from its address. This runs the code that the address names.

        Raises
        ------
        ValueError
            If there is no address, nothing is found there, or something else is.
        """
        if not self.address:
            raise ValueError(
                f"problem '{self.name}' was stated in a script, so it cannot be found by name: pass it, Front.load(path, problem=problem)"
            )
        import problems

        try:
            problem = problems.load(self.address, **self.data)
        except Exception as error:
            raise ValueError(
                f"problem '{self.name}' does not load from '{self.address}' ({error}): pass it, Front.load(path, problem=problem)"
            ) from error
        return self.check(problem, "the front")


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
"""What every front's `stats` hold, and `versions`."""


PACKAGES = ("macs-trajectories", "casadi", "numpy", "scipy")


@lru_cache(maxsize=1)
def _found() -> tuple[tuple[str, str], ...]:
    found = [("python", platform.python_version()), ("platform", f"{platform.system()} {platform.machine()}")]
    for package in PACKAGES:
        try:
            found.append((package, version(package)))
        except PackageNotFoundError:
            found.append((package, "unknown"))
    return tuple(found)


def versions() -> dict[str, str]:
    """Versions of Python, of this package and of those whose arithmetic its results depend on, by name."""
    return dict(_found())
