"""Breakwell's problem: Bryson and Denham's, with the wall at a tenth.

Bryson and Ho, "Applied Optimal Control", 1975, section 3.11, after J. V. Breakwell; among PSOPT's examples.
"""

from __future__ import annotations

from ....problem import Problem
from ..published import Published
from .bryson_denham import turn

PUBLISHED = (Published("effort", 40.0 / 9.0, 0.0, "Bryson and Ho 1975, section 3.11: 4 / (9 wall)"),)


def problem() -> Problem:
    """With an arc along the wall from 0.3 to 0.7."""
    return turn("breakwell", 0.1)
