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
# TODO
