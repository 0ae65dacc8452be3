"""What a study says that its fronts are measured against."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from macs.front import Front
from macs.solvers.start import unknown
from problems.compiled import Objective

from .references import called, closed_form, foreign, read

if TYPE_CHECKING:
    from problems.compiled import CompiledProblem


@dataclass(frozen=True)
class Reference:
    """What fronts are measured against.

    Attributes
    ----------
    front : Front
    what : str
        In words: "the true front, in closed form".
    true : bool
        Whether it is the truth, or only the best that is known.
    """

    front: Front
    what: str
    true: bool


def look_up(given: Any, label: str, address: str, data: Mapping[str, Any], goals: Sequence[Objective]) -> Reference | None:
    """The reference of a problem.

    Parameters
    ----------
    given : None, str, or mapping
        "union"; "truth" or the address of a case with a known front; a file; or {label of a problem: one of these}. None: the truth where
        it is known, else the union.
    label, address, data, goals
        Of the problem.

    Returns
    -------
    Reference or None
        None: the union of what was found.

    Raises
    ------
    ValueError, OSError
        If there is no such reference, or it cannot be read.
    """
    if isinstance(given, Mapping):
        given = given.get(label)
    if given == "union":
        return None
    if given is None or given == "truth":
        try:
            if not address:
                raise ValueError("no true front of a problem that a script states is known; measure against a file or the union")
            return Reference(foreign(closed_form(address, data), goals, "truth"), *called(address))
        except ValueError:
            if given is not None:
                raise
            return None
    if Path(given).suffix in (".nc", ".csv"):
        return Reference(read(given, goals), str(given), False)
    what, true = called(given)
    return Reference(foreign(closed_form(given), goals, "truth"), f"{what} of {given}", true)


def check_reference(given: Any, stated: Mapping[str, CompiledProblem]) -> None:
    """Raise ValueError if a study of problems, by label, has no such reference, or it cannot be read."""
    for label, one in (given if isinstance(given, Mapping) else dict.fromkeys(stated, given)).items():
        if label not in stated:
            raise ValueError(f"reference: {unknown('problem', label, stated)}")
        if one is not None and not isinstance(one, str):
            raise ValueError(f"reference must be 'union', 'truth', the name of a case, a file, or one of these by problem, not {one!r}")
    for label, problem in stated.items():
        try:
            look_up(given, label, problem.address, problem.data, problem.goals)
        except (ValueError, OSError) as error:
            raise ValueError(f"reference of '{label}': {error}") from error
