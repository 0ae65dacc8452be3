r"""Re-entry around no-fly zones

The [re-entry of a shuttle](reentry_case1.md) around three circles on the ground that it may not cross. Chai et al., IEEE Transactions
on Cybernetics 50(4), 2020, case 3. Every feasible flight passes south of all three, as far as gradients can tell.
"""

import numpy as np

from macs import MACS
from problems import load
from transcription import SingleShooting

solver = MACS(agents=30, archive=20, polish_on="dfet:24x3:bernstein:1", polish_every=100)
flown = SingleShooting(200, control="linear")
front = solver.solve(load("reentry_case3"), flown, evaluations=3000, seed=1, inner="propagate", start="smooth", verify=0.01).mended()
print(front.table())
kept = front[front.verified]
best = np.unique(kept.F.argmin(axis=0))  # of each objective
kept.plot(marked=best)
kept.plot_trajectories(best)

# What was learned
#
# The zones limit the cross-range: #19, of the largest, 32.1 deg, passes along the edge of the third zone and ends with a short,
# steep dive. The smoothest flight, #9 with 0.082 rad, passes along the edges of the first and the third, and follows the limit of
# the dynamic pressure. Flights of little heat load turn late and keep far from the second and the third zone; the least, 43.6
# kBtu/ft², is that of #0. All points are verified. Five of them, #0 and #19 among them, have the objectives of their simulation:
# their meshes do not give these to 0.01 of the front's range. All are local optima, and a longer search finds others.
