r"""Ascent from a flat airless body

A rocket with the constant thrust acceleration $a$, at an angle $u$, leaves the ground and is to fly level at a height of 10 km: in
the least time, and with the greatest horizontal speed.

$$\dot x = v_x, \quad \dot v_x = a \cos u, \quad \dot y = v_y, \quad \dot v_y = a \sin u - g$$

with $a = 0.004$ km/s² and $g = 0.0016$ km/s². Ricciardi, Vasile and Maddock, "Global solution of multi-objective optimal control
problems with multi agent collaborative search and direct finite elements transcription", IEEE CEC 2016. The front is known in
closed form, by the linear tangent law of Bryson and Ho.
"""

import numpy as np

from macs import MACS
from problems import load
from problems.cases.goddard import reference

front = MACS().solve(load("goddard"), seed=1)
print(front.table())
truth = reference(points=20_001)  # flight time, greatest horizontal speed
off = np.interp(front.objectives[:, 0], *truth.T) - front.objectives[:, 1]
print(f"largest difference of horizontal speeds from the closed form: {abs(off).max():.0e} km/s")

front.plot(marked=[0, 4, 9], beside={"closed form": truth})
front.plot_trajectories([0, 4, 9])

# What was learned
#
# More time buys horizontal speed, and the first seconds buy most: the knee of the front is near point #3, beyond which speed
# grows evenly with time. The quickest ascent thrusts straight up and then straight down, on both bounds of the angle, and has no
# horizontal speed; along the front the angle becomes a smooth tangent law, and no bound acts but the longest time of 250 s. All
# points are verified. They differ most from the closed form at the quickest ascent, where the front is vertical. Most of the work
# is 51 gradient solves, half of them from other starts.
