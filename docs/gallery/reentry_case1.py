r"""Re-entry of a shuttle

A shuttle enters at 79 km and flies to a point at 24 km, with four objectives: large cross-range, and little heat load, oscillation
$\int |\dot\gamma|\, \mathrm{d}t$ and peak heating rate. Heating rate, dynamic pressure and load factor are limited to 200
Btu/ft²/s, 280 lbf/ft² and 2.5 g. Angle of attack and bank angle follow their commands with a lag. Chai, Savvaris, Tsourdos, Xia and
Chai, "Solving multiobjective constrained trajectory optimization problem by an extended evolutionary algorithm", IEEE Transactions
on Cybernetics 50(4), 2020; what it leaves out is from Betts' shuttle, or chosen.
"""

import numpy as np

from macs import MACS
from problems import load
from transcription import DFET

front = MACS(archive=10).solve(load("reentry_case1"), DFET(24, 3, basis="bernstein", control_order=1), evaluations=100, seed=1, verify=0.01)
print(front.table())
kept = front[front.verified]
best = np.unique(kept.F.argmin(axis=0))  # of each objective
kept.plot(marked=best)
kept.plot_trajectories(best)

# What was learned
#
# Cross-range and heat are in conflict: the flight of the largest cross-range, 34.3 deg, has a heat load of 140.9 kBtu/ft²; that of
# the least verified heat load, 59.7, stays high with a large angle of attack, has the least peak heating rate, too, and reaches 17.0
# deg. The smoothest flight, 0.081 rad, follows the limit of the dynamic pressure; the other limits do not act. One point is not
# verified: its controls switch faster than 24 elements can follow, and its oscillation differs by 0.0099 rad when simulated. Pictures
# have the verified points, numbered anew. Four of them are nearly equal: 100 evaluations are few for four objectives, and the front
# between these ends is left to be found.
