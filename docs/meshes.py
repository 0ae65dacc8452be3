"""The picture of docs/meshes.md: `python docs/meshes.py` writes docs/meshes.png.

Figure 2 of Chai, Savvaris, Tsourdos and Xia (2017): two densities on [0, 1], and meshes that have the same share of their integral in each
interval, eqs. (15)-(17).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from macs.fronts.pictures.style import COLORS
from runs.report.plots import PAGE, new_figure, style
from transcription.meshes.refinement import continuous, equidistributed, normalised

TARGET = Path(__file__).with_suffix(".png")
POINTS = 20
PLACES = np.linspace(0.0, 1.0, 2001)
DENSITIES = {
    "f(t) = t": PLACES,
    "f(t) = exp(−50t² + 20t − 2) + exp(−50t² + 80t − 32)": np.exp(-50 * (PLACES - 0.2) ** 2) + np.exp(-50 * (PLACES - 0.8) ** 2),
}


def main() -> None:
    """Draw."""
    with style():
        figure = new_figure(PAGE, 2.4)
        for ax, (name, values) in zip(figure.subplots(1, 2), DENSITIES.items(), strict=True):
            density = normalised(PLACES, continuous(values))
            mesh = equidistributed(PLACES, density, POINTS - 1)
            heights = np.interp(mesh, PLACES, np.append(density[:, 0], density[-1, 1]))
            ax.plot(PLACES[:-1], density[:, 0], color=COLORS[0])
            ax.vlines(mesh, 0.0, heights, color=COLORS[1], lw=0.7)
            ax.plot(mesh, np.zeros(POINTS), "|", color=COLORS[1], ms=9, clip_on=False, zorder=4)
            ax.set(xlabel="t", ylabel="density, of mean 1", xlim=(0.0, 1.0), ylim=(0.0, None))
            ax.set_title(name, loc="left", fontsize=7)
    figure.savefig(TARGET, dpi=130)
    print(f"written to {TARGET}")


if __name__ == "__main__":
    main()
