"""The pictures of "Data as you have it": `python docs/stating/data.py` writes docs/stating/data.png."""

from pathlib import Path

import casadi as ca
import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from scipy.ndimage import gaussian_filter1d

rng = np.random.default_rng(1)
figure, axes = plt.subplots(2, 2, figsize=(9, 5.5), layout="constrained")

place = np.linspace(0.0, 2000.0, 101)
measured = 0.02 * np.sin(place / 300) + rng.normal(0, 0.008, len(place))
axes[0, 0].plot(place, measured, ".-", color="0.7", label="measured")
axes[0, 0].plot(place, gaussian_filter1d(measured, 4, mode="nearest"), label="smoothed over 80 m")
axes[0, 0].set(xlabel="position [m]", ylabel="grade [-]", title="Noise: smooth it")
axes[0, 0].legend()

times, speeds = [0, 10, 20, 30, 40, 50], [0, 8, 8, 3, 12, 0]
axes[0, 1].plot(times, speeds, "o-")
axes[0, 1].set(xlabel="time [s]", ylabel="speed [m/s]", title="Drive cycle: linear in time")

altitude, wind = np.array([0, 1, 3, 6, 10, 12, 16, 20]), np.array([2, 6, 9, 18, 34, 36, 20, 8])
fine = np.linspace(0, 20, 201)
spline = ca.interpolant("wind", "bspline", [altitude.astype(float)], wind.astype(float))
axes[1, 0].plot(np.array(spline(fine)).ravel(), fine)
axes[1, 0].plot(wind, altitude, "o")
axes[1, 0].set(xlabel="wind [m/s]", ylabel="altitude [km]", title="Wind: a spline, looked at")

after = np.array([0.0, 0.1, 0.3, 1.0, 1.6, 1.8, 2.0])
thrust = np.array([0.0, 14.0, 9.0, 8.0, 7.5, 2.0, 0.0])
axes[1, 1].plot(after, thrust, "o-")
axes[1, 1].set(xlabel="time after ignition [s]", ylabel="thrust [N]", title="Thrust curve: linear in time")
figure.savefig(Path(__file__).with_suffix(".png"), dpi=90)
