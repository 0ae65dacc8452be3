"""Numbers beside the ticks of an axis."""

from __future__ import annotations

from matplotlib.ticker import ScalarFormatter


class PlainNumbers(ScalarFormatter):
    """Numbers as plain text; only a power of ten that they share, at the end of the axis, is a formula."""

    def __init__(self) -> None:
        super().__init__(useMathText=False)

    def get_offset(self) -> str:
        """The power of ten, empty if there is none."""
        self.set_useMathText(True)
        text = super().get_offset()
        self.set_useMathText(False)
        return text
