"""The picture "global collocation converges exponentially": `python docs/convergence.py` writes docs/convergence.png and prints the
numbers.

The problem is smooth and has a closed form: x' = u, x(0) = 1, least integral of (x^2 + u^2) / 2 over four seconds:
u = -sinh(4 - t) / cosh(4), and the optimum is tanh(4) / 2.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from problems import Problem
from transcription import DFET, Collocation, MultipleShooting, Transcription
from transcription.nlp.scalarized import scalarize

TARGET = Path(__file__).with_suffix(".png")
GLOBAL = (3, 4, 5, 6, 8, 10, 12, 14, 16, 18, 20, 24)
LOCAL = (6, 12, 24, 48, 96)
DURATION = 4.0
TIMES = np.linspace(0.0, DURATION, 401)
CONTROL, COST = -np.sinh(DURATION - TIMES) / np.cosh(DURATION), 0.5 * np.tanh(DURATION)


def regulator() -> Problem:
    """The problem."""
    problem = Problem("regulator")
    run = problem.phase("run", t0=0, tf=DURATION)
    x, u = run.state("x", bounds=(-2, 2), initial=1), run.control("u", bounds=(-2, 2))
    run.dynamics(x=u)
    problem.minimize("cost", run.integral(0.5 * (x**2 + u**2)))
    return problem


def families() -> dict[str, list[tuple[int, Transcription]]]:
    """For each method its transcriptions, with how many values of the control each has."""
    found: dict[str, list[tuple[int, Transcription]]] = {}
    for points, more in (("gauss", 0), ("radau", 0), ("lobatto", 1), ("chebyshev", 1)):
        found[points] = [(n, Collocation(1, n - more, points=points)) for n in GLOBAL]
    half = "chebyshev, controls of half the degree"
    found[half] = [(n, Collocation(1, 2 * (n - 1), points="chebyshev", control_order=n - 1)) for n in GLOBAL]
    found["radau, degree 3, on more intervals"] = [(n, Collocation(n // 3, 3)) for n in LOCAL]
    found["DFET, order 2, on more elements"] = [(n, DFET(n // 3, 2)) for n in LOCAL]
    found["shooting, linear controls, on more nodes"] = [(n + 1, MultipleShooting(n, steps=2, control="linear")) for n in LOCAL]
    return found


def errors(method: Transcription) -> tuple[float, float]:
    """Of the optimum, and the largest of the control at any time."""
    nlp = method.nlp(regulator().compile())
    solved = scalarize(nlp, nlp.first_guess(np.zeros((1, len(nlp.free))))[0], reference=np.zeros(1), weights=np.ones(1))
    if solved.status != "converged":
        return np.nan, np.nan
    control = nlp.unpack(solved.z)["run"].control(TIMES)[:, 0]
    return abs(float(solved.F[0]) - COST), float(np.abs(control - CONTROL).max())


def main() -> None:
    """Measure, print and draw."""
    figure, axes = plt.subplots(1, 2, figsize=(11, 5), sharex=True, layout="constrained")
    for i, (name, methods) in enumerate(families().items()):
        values = [n for n, _ in methods]
        found = np.array([errors(method) for _, method in methods])
        for n, (of_optimum, of_control) in zip(values, found, strict=True):
            print(f"{name:42s}{n:4d} values: optimum {of_optimum:.1e}, control {of_control:.1e}")
        for axis, column in zip(axes, found.T, strict=True):
            axis.loglog(values, np.maximum(column, 1e-16), "os^DPv<>"[i] + ("--" if "on more" in name else "-"), ms=4, lw=1, label=name)
    for axis, title in zip(axes, ("error of the optimum", "largest error of the control at any time"), strict=True):
        axis.set(xlabel="values of the control", title=title)
        axis.set_xticks([3, 6, 12, 24, 48, 96], [3, 6, 12, 24, 48, 96])
        axis.minorticks_off()
        axis.grid(alpha=0.3)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=9)
    figure.savefig(TARGET, dpi=110)
    print(f"written to {TARGET}")


if __name__ == "__main__":
    main()
