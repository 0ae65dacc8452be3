"""The true fronts of the cases, as far as gradients found them: tables beside this file, which `runs.truths` makes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

REFERENCE = "the front that gradients found"
"""Name of the reference in reports: every row is a local solve within narrower limits, so that there may be better flights."""


def known(case: str) -> np.ndarray:
    """The front (k, 4) of a case, as the user sees it: cross-range, heat load, oscillation, peak heating rate.

    The further columns of the table are the commands that were simulated, from which each row can be checked.
    """
    return np.loadtxt(Path(__file__).with_name(f"{case}.csv"), delimiter=",", usecols=range(4), ndmin=2)
