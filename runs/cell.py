"""One cell of a study: a problem, a transcription and a solver, run many times; and the seeds of its runs."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

LONGEST = 80
"""Characters of a folder's name."""


@dataclass(frozen=True)
class Cell:
    """What all runs of a cell have in common.

    Attributes
    ----------
    problem, transcription, solver : str
        Labels, as the study names them; together they are the cell's name.
    evaluations : int
        Budget of each run.
    details : mapping
        Plain data that decides the runs' numbers: addresses, fingerprint, settings. What another study in the same folder is told by.
    """

    problem: str
    transcription: str
    solver: str
    evaluations: int
    details: Mapping[str, Any] = field(hash=False, repr=False)

    @property
    def labels(self) -> tuple[str, str, str]:
        """Problem, transcription, solver."""
        return self.problem, self.transcription, self.solver

    @property
    def terms(self) -> Mapping[str, Any]:
        """What its runs have instead of what the study says: its solver's terms, and what its problem says where the study does not."""
        return self.details.get("terms", {})

    @property
    def apart(self) -> bool:
        """Whether its solver works on a transcription of its own, unlike the other solvers of the study."""
        return "transcription" in self.terms

    @property
    def name(self) -> str:
        """For people: goddard, dfet:4x6, macs."""
        return ", ".join(self.labels)

    @property
    def folder(self) -> str:
        """The name of its folder: of letters that any file system takes, and no other cell's."""
        plain = "__".join(re.sub(r"[^A-Za-z0-9.-]+", "-", label).strip(".") or "-" for label in self.labels)
        if len(plain) <= LONGEST and plain.lower() == "__".join(self.labels).replace(":", "-"):
            return plain
        return f"{plain[:LONGEST]}__{self._digest()[:4].hex()}"

    def seed(self, study: int, run: int) -> int:
        """The seed of run 1, 2, ...: 63 bits.

        Spawned from the study's seed by a key made of the cell's labels and of the run's number. So neither more runs nor other cells
        change it, and two cells never share one.
        """
        words = np.frombuffer(self._digest()[:16], dtype="<u4").tolist()
        return int(np.random.SeedSequence(study, spawn_key=(*words, run)).generate_state(1, np.uint64)[0] >> np.uint64(1))

    def to_dict(self) -> dict[str, Any]:
        """As plain data, for the study's record."""
        names = {"problem": self.problem, "transcription": self.transcription, "solver": self.solver, "folder": self.folder}
        return names | {"evaluations": self.evaluations, "details": dict(self.details)}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Cell:
        """From what `to_dict` gave."""
        return cls(data["problem"], data["transcription"], data["solver"], data["evaluations"], data["details"])

    def _digest(self) -> bytes:
        return hashlib.sha256(json.dumps(self.labels).encode()).digest()
