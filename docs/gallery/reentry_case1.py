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
from transcription import SingleShooting

solver = MACS(agents=30, archive=20, polish_on="dfet:24x3:bernstein:1", polish_every=100)
flown = SingleShooting(200, control="linear")  # candidates are propagated; only the best are solved by gradients
front = solver.solve(load("reentry_case1"), flown, evaluations=3000, seed=1, inner="propagate", start="smooth", verify=0.01)
print(front.table())
kept = front[front.verified]
best = np.unique(kept.F.argmin(axis=0))  # of each objective
kept.plot(marked=best)
kept.plot_trajectories(best)

# What was learned
#
# Cross-range and heat are in conflict: #19, of the largest cross-range, 34.3 deg, has a heat load of 140.9 kBtu/ft² and the
# greatest peak heating rate; #0, of the least heat load, 42.2, skips high above with the largest angle of attack, nearly up to
# the limit of the load factor, and reaches 6.9 deg. The smoothest flight, #6 with 0.081 rad, glides down evenly and follows the
# limit of the dynamic pressure. Smoothness is cheap: #16 has nearly the same oscillation and reaches 31.7 deg. To propagate 3,000
# flights takes seconds; most of the time goes into 37 gradient solves. All points but #14, #17 and #18, which are as the search
# left them, come from these solves. Three points are not verified; pictures have the others, numbered anew: #16 there is #19 of
# the table. They are local optima, and longer searches may find better ones.
