r"""Aerocapture: shape and bank profile together

The shape of the [capsules](aerocapture.md) and the [bank profile](aerocapture_bank.md) are chosen together, with three objectives:
how compact the capsule is, its heat shield, and the burn that is left at the apoapsis. Armellin and Lavagna, Journal of Artificial
Evolution and Applications 2008, work in two steps; see [the page](../aerocapture.md) that compares both.
"""

from macs import MACS
from problems import load

front = MACS(archive=10).solve(load("aerocapture_codesign", delta_v=45.0), evaluations=60, seed=1)
print(front.table())
front.plot(marked=[0, 5, 9])
front.plot_trajectories([0, 5, 9])

# What was learned
#
# TODO
