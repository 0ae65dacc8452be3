r"""Aerocapture: shapes of capsules

A capsule is captured by the atmosphere of Mars. Five numbers are its shape; the constant bank angle that captures it follows from a
boundary value problem within the evaluation, so that there are no trajectories here. How compact it is, $l_{max}/V$, is minimised
against the mass of its heat shield; lift over drag is at least 0.3. Armellin and Lavagna, "Multidisciplinary Optimization of
Aerocapture Maneuvers", Journal of Artificial Evolution and Applications 2008; constants that the paper leaves out are fitted to its
tables, see [its page](../aerocapture.md).
"""

from macs import MACS
from problems import load
from problems.cases.aerocapture.coupled import reference

front = MACS(archive=12).solve(load("aerocapture"), evaluations=10_000, seed=1)
print(front.table())
front.plot(marked=[0, 3, 11], beside={"200,000 evaluations, then gradients": reference()})
front.plot_variables()

# What was learned
#
# The front has two pieces. Slender capsules, with a front angle of 20 deg, are more compact and need more heat shield; from
# 0.502 1/m2 on blunt ones do better, with front angles up to the bound of 70 deg: the heat shield falls from 12.7 % at 0.477
# 1/m2 to 10.7 %. Along the blunt piece the rear angle makes the compromise; the front angle is on its bound, and so nearly is the nose. The
# slender ones have positive angles of attack, the blunt ones negative ones: a capsule and its mirror image are equally good. The
# points are on the long reference front or a little above it, and the rear radius is not settled: it hardly counts.
