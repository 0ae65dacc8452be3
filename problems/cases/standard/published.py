"""The record of a published optimum."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

SHARE = 5e-4
"""A value meets a published one if it differs by no more than this share of its scale, or than `Published.within`."""


@dataclass(frozen=True)
class Published:
    """The optimum of one objective, for some data.

    Attributes
    ----------
    objective : str
    value : float
        As the user sees it: what is to be maximised is not negated.
    within : float
        Its uncertainty: half a unit of the last published digit, or more where it is known to be less accurate.
    source : str
        Author, year, and place in it; or the closed form.
    data : mapping
        Arguments of the module's `problem` if they are not the defaults.
    local : tuple of float
        Values of other local optima that are known.
    scale : float, optional
        What its differences are measured by: the size of the value by default.
    remark : str
        What a comparison has to know.
    """

    objective: str
    value: float
    within: float
    source: str
    data: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    local: tuple[float, ...] = ()
    scale: float | None = None
    remark: str = ""

    def error(self, value: float) -> float:
        """The difference of a value from the published one, in scales."""
        return (value - self.value) / (self.scale or abs(self.value) or 1.0)

    def met(self, value: float) -> bool:
        """Whether a value is the published one, within a share `SHARE` of its scale or its own uncertainty."""
        return abs(self.error(value)) <= SHARE or abs(value - self.value) <= self.within
