r"""Dubins' car

The shortest way of a car that turns no tighter than on a circle of radius 1, to a place behind it, in the direction that it has at
the start:

$$\dot x = \cos\theta, \quad \dot y = \sin\theta, \quad \dot\theta = u, \quad |u| \le 1$$

Dubins, "On curves of minimal length with a constraint on average curvature", American Journal of Mathematics 79, 1957. The optimum
is a word of three arcs and straight lines; other words are local optima.
"""

import matplotlib.pyplot as plt
import numpy as np

from macs import optimize
from problems import load
from problems.cases.standard import published

best = optimize(load("standard/dubins"))
print(best.alone().table())
known = published("dubins")[0]
value = best.simulated[known.objective]
print(f"{known.objective}: simulated {value:.9g}, published {known.value:.9g} ({known.source}); difference {value - known.value:.0e}")
stats = best.alone().stats
print(f"{stats['starts']} starts led to {stats['optima']} optima, {stats['found']} of them to this one")
drive = best.trajectory["drive"]
car = drive.at(np.linspace(0.0, drive.tf, 401))
ax = plt.figure(figsize=(5.5, 4.0), layout="constrained").add_subplot(xlabel="x", ylabel="y", aspect="equal")
ax.plot(car["x"], car["y"])
ax.quiver([0, -3], [0, 1], [1, 1], [0, 0], color="#D55E00", width=0.006, zorder=3)
best.plot(costates=True)

# What was learned
#
# An arc, a straight line and an arc: on the arcs the car turns as tightly as it may, on the line it does not turn at all, which
# is singular. Each piece is an element of its own, so that the length agrees with the closed form to 4e-9. Of 41 starts 37 led to
# this way, the others to longer ones.
