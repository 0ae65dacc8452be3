r"""Zermelo's ship

A ship of speed 1 is to reach the origin as soon as possible, through a current that grows across the stream:

$$\dot x = \cos\theta - y, \quad \dot y = \sin\theta$$

Zermelo, ZAMM 11, 1931; with the data of Bryson and Ho, "Applied Optimal Control", 1975, section 2.7.
"""

import matplotlib.pyplot as plt
import numpy as np

from macs import optimize
from problems import load
from problems.cases.standard import published

best = optimize(load("standard/zermelo"))
print(best.alone().table())
known = published("zermelo")[0]
value = best.simulated[known.objective]
print(f"{known.objective}: simulated {value:.9g}, published {known.value:.9g} ({known.source}); difference {value - known.value:.0e}")
trip = best.trajectory["trip"]
ship = trip.at(np.linspace(0.0, trip.tf, 201))
ax = plt.figure(figsize=(5.5, 3.6), layout="constrained").add_subplot(xlabel="x", ylabel="y")
ax.plot(ship["x"], ship["y"])
ax.quiver(*np.meshgrid([0, 1, 2, 3, 4], [-2, -1, 1]), [[2] * 5, [1] * 5, [-1] * 5], 0, color="#666666", width=0.003)
best.plot(costates=True)

# What was learned
#
# The ship first crosses the current, though that carries it away from its goal, since beyond y = 0 the water flows towards it: the
# way is long, and the quickest. The costate of x is constant and that of y grows evenly, as the current does; the Hamiltonian is −1,
# as for every least time. The time agrees with shooting to 2e-10.
