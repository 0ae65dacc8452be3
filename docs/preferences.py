"""The picture of docs/choosing.md: `python docs/preferences.py` writes docs/preferences.png.

Figure 3 of Chai, Savvaris, Tsourdos and Xia (2017): the preference function of an objective that is to be small, with and without fuzzy
boundaries, and as eq. (35) is printed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from macs.decisions import FuzzyPhysicalProgramming, Smaller
from macs.fronts.pictures.style import COLORS
from runs.report.plots import COLUMN, legend, new_figure, style

TARGET = Path(__file__).with_suffix(".png")
BOUNDARIES = (120.0, 140.0, 170.0, 210.0, 260.0)
SPREAD = 12.0


def main() -> None:
    """Draw."""
    fuzzy, printed = (
        FuzzyPhysicalProgramming({"J": Smaller(*BOUNDARIES)}, spread={"J": SPREAD}, printed=as_printed).fuzzy_functions["J"]
        for as_printed in (False, True)
    )
    J = np.linspace(BOUNDARIES[0] - 10.0, BOUNDARIES[-1], 1001)
    with style():
        figure = new_figure(COLUMN, 2.7)
        ax = figure.subplots()
        drawn = {"preference": (fuzzy.crisp, "-"), "fuzzy": (fuzzy, "--"), "fuzzy, as printed": (printed, ":")}
        for color, (name, (function, dashes)) in zip(COLORS, drawn.items(), strict=False):
            ax.semilogy(J, function(J), dashes, color=color, lw=1.3, label=name)
        for number, place in enumerate(BOUNDARIES, 1):
            ax.axvline(place, color="black", lw=0.5, ls=":")
            ax.annotate(
                f"$J_{number}$",
                (place, 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(0, 1),
                textcoords="offset points",
                ha="center",
                va="bottom",
            )
        ax.set(xlabel="objective J", ylabel="preference function", xlim=(J[0], J[-1] + 2.0))
        legend(figure, ax)
    figure.savefig(TARGET, dpi=150)
    print(f"written to {TARGET}")


if __name__ == "__main__":
    main()
