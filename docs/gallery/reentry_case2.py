r"""Re-entry within narrow limits

The [re-entry of a shuttle](reentry_case1.md) with limits of 150 Btu/ft²/s, 250 lbf/ft² and 1.25 g. Chai et al., IEEE Transactions
on Cybernetics 50(4), 2020, case 2.
"""

import numpy as np

from macs import MACS
from problems import load
from transcription import SingleShooting

solver = MACS(agents=30, archive=20, polish_on="dfet:24x3:bernstein:1", polish_every=100)
flown = SingleShooting(200, control="linear")
front = solver.solve(load("reentry_case2"), flown, evaluations=3000, seed=1, inner="propagate", start="smooth", verify=0.01).mended()
print(front.table())
kept = front[front.verified]
best = np.unique(kept.F.argmin(axis=0))  # of each objective
kept.plot(marked=best)
kept.plot_trajectories(best)

# What was learned
#
# The narrow limits leave the largest cross-range nearly as it was: #19 reaches 34.3 deg, now with the heating rate at its limit
# early and the dynamic pressure at its limit late. They cost heat load instead: a flight of little heat load skips, and each dive
# is held back by the load factor, so that #1, of the least heat load, 44.6 kBtu/ft², skips less. The smoothest flights, #7, #11
# and #16 with 0.088 rad, have the objectives of their simulation: their meshes do not give these to 0.01 of the front's range. So
# all points are verified. All are local optima of few gradient solves.
