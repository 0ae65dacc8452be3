"""The pictures of docs/aerocapture.md: `python docs/aerocapture.py` writes docs/aerocapture.png and docs/aerocapture-shapes.png.

Figures 3, 7 and 8 of Armellin and Lavagna (2008): exits to the target orbit, and the passages of the shapes of Table 1, of which the
ballistic coefficients alone are printed, and decide the passage. And the shapes of Table 2.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from macs.fronts.pictures.style import COLORS
from problems.cases.aerocapture.designs import TABLE_2, shapes_of
from problems.cases.aerocapture.mars import EXIT_SPEED, circularisation, exit_angle, exit_speeds
from problems.cases.aerocapture.passage import profile
from runs.report.plots import PAGE, new_figure, style

TARGET = Path(__file__).with_suffix(".png")
SHAPES = TARGET.with_stem("aerocapture-shapes")
TABLE_1 = {"shape 1": (135.99, 43.01, -8.57), "shape 2": (69.62, 48.6, -8.11)}
"""Ballistic coefficient, kg/m2, lowest altitude, km, and entry angle, deg, as printed."""
EXIT = (EXIT_SPEED, 1.73, 52.6)
"""The paper's exit: speed, m/s, angle, deg, and delta v, m/s, as printed."""
PRINTED = {"marker": "o", "ls": "", "ms": 4.5, "mfc": "white", "mec": "black", "mew": 0.9, "zorder": 4}


def draw_shapes() -> None:
    """The outlines of the solutions of Table 2, from the tip on the left to the back."""
    shapes, _ = shapes_of(np.array([solution.design for solution in TABLE_2.values()]))
    with style():
        figure = new_figure(PAGE, 2.1)
        for i, (ax, number) in enumerate(zip(figure.subplots(1, len(TABLE_2), sharex=True, sharey=True), TABLE_2, strict=True)):
            one = {name: float(np.asarray(getattr(shapes, name))[i]) for name in ("nose", "cap", "cone", "frustum", "edge", "base", "rear")}
            round_ = np.linspace(0.0, one["edge"], 60)
            along = [one["nose"] - np.sqrt(one["nose"] ** 2 - round_**2), np.cumsum([one["cap"], one["cone"], one["frustum"]])]
            x, y = np.concatenate(along), np.concatenate([round_, [one["edge"], one["base"], one["rear"]]])
            ax.fill(np.concatenate([x, x[::-1]]), np.concatenate([y, -y[::-1]]), fc="#dfe7ef", ec=COLORS[0], lw=1.2)
            ax.set_title(f"solution {number}", loc="left", fontsize=7)
            ax.set_aspect("equal")
            ax.set(xlabel="length [m]", ylabel="" if i else "radius [m]")
    figure.savefig(SHAPES, dpi=130)
    print(f"written to {SHAPES}")


def main() -> None:
    """Draw, and print what is drawn beside what is printed."""
    draw_shapes()
    with style():
        figure = new_figure(PAGE, 4.6)
        (angle, burn), (altitude, speed) = figure.subplots(2, 2, sharex="row")
        least, most = exit_speeds()
        exits = least + 1e-6 + (most - least - 1e-6) * np.linspace(0.0, 1.0, 2001) ** 2
        angle.plot(exits, np.degrees([exit_angle(one) for one in exits]), color=COLORS[0])
        burn.plot(exits, circularisation(exits), color=COLORS[0])
        for ax, printed, label in ((angle, EXIT[1], "path angle at the exit [deg]"), (burn, EXIT[2], "delta v [m/s]")):
            ax.plot(EXIT[:1], [printed], **PRINTED)
            ax.set(xlabel="exit speed [m/s]", ylabel=label)
        print(f"exits of {exits[0]:.1f} to {exits[-1]:.1f} m/s; delta v from {circularisation(exits[-1]):.2f} m/s")
        print(f"at {EXIT[0]:g} m/s: {np.degrees(exit_angle(EXIT[0])):.2f} deg, {circularisation(EXIT[0]):.2f} m/s")
        for color, (name, (ballistic, lowest, entry)) in zip(COLORS, TABLE_1.items(), strict=False):
            flight = profile(ballistic)
            heights, label = 1e-3 * flight.altitude, f"{name}, {ballistic:g} kg/m²"
            altitude.plot(flight.time, heights, color=color, label=label)
            altitude.plot(flight.time[heights.argmin()], lowest, **PRINTED)
            speed.plot(flight.time, 1e-3 * flight.speed, color=color, label=label)
            print(f"{name}: {heights.min():.2f} km ({lowest} printed), {np.degrees(flight.path_angle[0]):.2f} deg ({entry} printed)")
        altitude.set(xlabel="time [s]", ylabel="altitude [km]")
        speed.set(xlabel="time [s]", ylabel="speed [km/s]")
        altitude.plot([], [], **PRINTED, label="as printed")
        altitude.legend(frameon=False)
    figure.savefig(TARGET, dpi=130)
    print(f"written to {TARGET}")


if __name__ == "__main__":
    main()
