r"""Brachistochrone

The quickest way for a bead to slide without friction from rest to a point 2 m ahead and 2 m below, by the angle $\theta$ of the
wire from the vertical:

$$\dot x = v \sin\theta, \quad \dot y = v \cos\theta, \quad \dot v = g \cos\theta$$

Johann Bernoulli, Acta Eruditorum, 1696; with the data of an example of Becerra, "PSOPT Optimal Control Solver User Manual". The
optimum is a cycloid.
"""

import matplotlib.pyplot as plt
import numpy as np

from macs import optimize
from problems import load
from problems.cases.standard import published

best = optimize(load("standard/brachistochrone"))
print(best.alone().table())
known = published("brachistochrone")[0]
value = best.simulated[known.objective]
print(f"{known.objective}: simulated {value:.9g}, published {known.value:.9g} ({known.source}); difference {value - known.value:.0e}")
slide = best.trajectory["slide"]
bead = slide.at(np.linspace(0.0, slide.tf, 201))
ax = plt.figure(figsize=(5.5, 4.0), layout="constrained").add_subplot(xlabel="x [m]", ylabel="depth y [m]", aspect="equal")
ax.plot(bead["x"], bead["y"])
ax.invert_yaxis()
best.plot(costates=True)

# What was learned
#
# The curve begins steeply, to gain speed early, and the angle grows evenly with time, which is a cycloid. The time is that of the
# closed form to 1e-9 s or better. The costates of both places should be constant; on the first element they are not quite, where the
# bounds of the places hold back single coefficients.
