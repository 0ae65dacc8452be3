"""The pictures of "Data as you have it": `python docs/stating/data.py` runs the code of that page and writes docs/stating/data.png."""

import re
from contextlib import chdir
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

HERE = Path(__file__).resolve()
page: dict[str, Any] = {}
with TemporaryDirectory() as folder, chdir(folder):
    for code in re.findall(r"^```python\n(.*?)^```", HERE.with_suffix(".md").read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE):
        exec(code, page)

figure, axes = plt.subplots(2, 2, figsize=(9, 5.5), layout="constrained")
axes[0, 0].plot(page["place"], page["measured"], ".-", color="0.7", label="measured")
axes[0, 0].plot(page["place"], page["smooth"], label="smoothed over 80 m")
axes[0, 0].set(xlabel="position [m]", ylabel="grade [-]", title="Noise: smooth it")
axes[0, 0].legend()

axes[0, 1].plot(page["times"], page["speeds"], "o-")
axes[0, 1].set(xlabel="time [s]", ylabel="speed [m/s]", title="Drive cycle: linear in time")

fine = np.linspace(0, 20, 201)
axes[1, 0].plot(np.array(page["wind"](fine)).ravel(), fine)
axes[1, 0].plot(page["winds"], page["altitudes"], "o")
axes[1, 0].set(xlabel="wind [m/s]", ylabel="altitude [km]", title="Wind: a spline, looked at")

axes[1, 1].plot(page["after"], page["pushes"], "o-")
axes[1, 1].set(xlabel="time after ignition [s]", ylabel="thrust [N]", title="Thrust curve: linear in time")
figure.savefig(HERE.with_suffix(".png"), dpi=90)
