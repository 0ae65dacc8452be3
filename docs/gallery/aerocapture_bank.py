r"""Aerocapture: the bank profile of a capsule

A capsule of given shape comes to Mars on a hyperbola, and its bank angle over time brings it to an ellipse above the poles, with an
apoapsis at 200 km. The burn that makes this orbit circular is minimised against the heat shield. Armellin and Lavagna, Journal of
Artificial Evolution and Applications 2008, section 5; see [its page](../aerocapture.md).
"""

from macs import sweep
from problems import load

front = sweep(load("aerocapture_bank"), points=8, starts=1)
print(front.table())
front.plot(marked=[0, 3, 7])
front.plot_trajectories([0, 3, 7])

# What was learned
#
# All flights lift up at first and, with one roll that is as fast as the bank rate allows, down after the lowest point. A deeper
# and shorter passage needs less heat shield and leaves the air more steeply, which the burn pays for. The knee is near #3: from
# 36.8 to 46.9 m/s the shield falls from 9.0 to 7.7 %, and the rest, to 7.1 %, takes a burn of up to 100 m/s. At #7 the front ends
# with the steepest exit that the problem allows. Eight points took 16 gradient solves from one start, on meshes that were refined
# until a simulation agreed.
