"""Solvers by name, for the command line ("macs") and for studies."""

from __future__ import annotations

import importlib
import inspect
from typing import Any

from problems.checks import unknown

from .solver import Solver

SOLVERS: dict[str, str] = {
    "macs": "macs.search.macs:MACS",
    "nsga2": "macs.baselines.nsga2:NSGA2",
    "nsga3": "macs.baselines.nsga3:NSGA3",
    "moead": "macs.baselines.moead:MOEAD",
    "mopso": "macs.baselines.mopso:MOPSO",
    "mopsocd": "macs.baselines.mopsocd:MOPSOCD",
    "smsemoa": "macs.baselines.smsemoa:SMSEMOA",
    "agemoea2": "macs.baselines.agemoea2:AGEMOEA2",
    "rvea": "macs.baselines.rvea:RVEA",
    "ctaea": "macs.baselines.ctaea:CTAEA",
    "decide": "macs.decision_solver:Decide",
    "optimum": "macs.gradient_solvers:Optimum",
    "payoff": "macs.gradient_solvers:Payoff",
    "sweep": "macs.gradient_solvers:Sweep",
}
"""Module and class of each solver, imported only when needed."""
PAPER = "paper"
"""In a study file, `{solver = "macs", paper = true}`: the settings of the paper. Also the name of the method of a class that has them."""


def solver_class(name: str) -> type[Solver]:
    """The class of a solver by its name. Raises ValueError, with the known names, for an unknown name."""
    place = SOLVERS.get(name.lower())
    if place is None:
        raise ValueError(unknown("solver", name, SOLVERS))
    module, _, item = place.partition(":")
    return getattr(importlib.import_module(module), item)


def solver(name: str, **settings: Any) -> Solver:
    """A solver by name, with its settings; with `paper=True` those of its paper, where it has them (`MACS.paper`), but for those given."""
    kind = solver_class(name)
    known = inspect.signature(kind).parameters
    paper = settings.pop(PAPER, False)
    if paper not in (True, False):
        raise ValueError(f"solver '{name}': {PAPER} must be true or false, not {paper!r}")
    as_published = getattr(kind, PAPER, None)
    if paper and as_published is None:
        raise ValueError(f"solver '{name}' has no settings of a paper")
    for key in settings:
        if key not in known:
            raise ValueError(unknown(f"setting of solver '{name}'", key, known))
    return as_published(**settings) if paper and as_published else kind(**settings)
